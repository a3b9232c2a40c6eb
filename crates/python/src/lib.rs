//! Python bindings: convert, release the lock, call, translate errors.

use pyo3::prelude::*;

mod chain;
mod door;

/// The compiled core of truearm: private, wrapped by the Python package.
#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    door::check_environment()?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("CoreError", module.py().get_type::<door::CoreError>())?;
    module.add_class::<chain::Chain>()?;
    Ok(())
}
