//! Python bindings: convert, release the lock, call, translate errors.

use pyo3::PyClass;
use pyo3::prelude::*;

mod arrays;
mod asked;
mod blocks;
mod chain;
mod choice;
mod clearance;
mod cmac;
mod compensate;
mod conservative;
mod division;
mod door;
mod drift;
mod estimate;
mod field;
mod greedy;
mod hyper;
mod inverse;
mod measured;
mod regions;
mod shots;
mod stream;
mod text;

/// Python allocates its objects at multiples of so many bytes, whatever their types ask for.
const PYTHON_ALIGNS: usize = 16;

fn add_class<T: PyClass>(module: &Bound<'_, PyModule>) -> PyResult<()> {
    const { assert!(align_of::<T>() <= PYTHON_ALIGNS, "lanes within an object have to be on the heap") };
    module.add_class::<T>()
}

/// The compiled core of truearm: private, wrapped by the Python package.
#[pymodule]
fn _core(module: &Bound<'_, PyModule>) -> PyResult<()> {
    door::open()?;
    module.add("__version__", env!("CARGO_PKG_VERSION"))?;
    module.add("ANGLE_ARM_M", truearm_kinematics::ANGLE_ARM)?;
    module.add("STILL_M", truearm_field::STILL)?;
    module.add("NORMAL_95", truearm_field::QUANTILE_95)?;
    module.add("CoreError", module.py().get_type::<door::CoreError>())?;
    add_class::<chain::Chain>(module)?;
    add_class::<measured::MeasurementSet>(module)?;
    add_class::<measured::Setup>(module)?;
    add_class::<estimate::IdentificationProblem>(module)?;
    add_class::<estimate::ConstantFit>(module)?;
    add_class::<choice::Choice>(module)?;
    add_class::<regions::Regions>(module)?;
    add_class::<regions::RegionalFit>(module)?;
    add_class::<division::Division>(module)?;
    add_class::<cmac::Network>(module)?;
    add_class::<cmac::TrainedNetwork>(module)?;
    add_class::<cmac::NetworkFit>(module)?;
    add_class::<conservative::Conservative>(module)?;
    add_class::<field::FieldFit>(module)?;
    add_class::<field::Field>(module)?;
    add_class::<field::Posterior>(module)?;
    add_class::<inverse::Inverse>(module)?;
    add_class::<clearance::Clearance>(module)?;
    module.add_function(wrap_pyfunction!(choice::choose_poses, module)?)?;
    module.add_function(wrap_pyfunction!(regions::regional_ceps, module)?)?;
    module.add_function(wrap_pyfunction!(regions::fill_without_data, module)?)?;
    module.add_function(wrap_pyfunction!(division::divide, module)?)?;
    module.add_function(wrap_pyfunction!(division::divide_rows, module)?)?;
    module.add_function(wrap_pyfunction!(choice::observability, module)?)?;
    module.add_function(wrap_pyfunction!(choice::independent_columns, module)?)?;
    module.add_function(wrap_pyfunction!(greedy::choose_informative, module)?)?;
    module.add_function(wrap_pyfunction!(greedy::choose_telling, module)?)?;
    module.add_function(wrap_pyfunction!(estimate::linearise, module)?)?;
    module.add_function(wrap_pyfunction!(estimate::setup_jacobian, module)?)?;
    module.add_function(wrap_pyfunction!(estimate::step_setup, module)?)?;
    add_class::<compensate::ArmModel>(module)?;
    add_class::<compensate::Corrector>(module)?;
    add_class::<stream::Stream>(module)?;
    add_class::<compensate::Solver>(module)?;
    module.add_function(wrap_pyfunction!(estimate::fit_constant, module)?)?;
    module.add_function(wrap_pyfunction!(estimate::identifiability, module)?)?;
    module.add_function(wrap_pyfunction!(estimate::non_negative_least_squares, module)?)?;
    module.add_function(wrap_pyfunction!(estimate::residuals, module)?)?;
    module.add_function(wrap_pyfunction!(field::fit_field, module)?)?;
    module.add_function(wrap_pyfunction!(drift::find_drift, module)?)?;
    module.add_function(wrap_pyfunction!(shots::same_poses, module)?)?;
    module.add_function(wrap_pyfunction!(text::find_bytes, module)?)?;
    module.add_function(wrap_pyfunction!(text::scan_lines, module)?)?;
    module.add_function(wrap_pyfunction!(text::read_numbers, module)?)?;
    module.add_function(wrap_pyfunction!(text::splice_numbers, module)?)?;
    Ok(())
}
