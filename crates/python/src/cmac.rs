//! `_core.Network`: CMAC and FCMAC, their training and fitting.

use numpy::ndarray::Array2;
use numpy::{
    IntoPyArray, PyArray2, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use truearm_field::FieldError;
use truearm_field::cmac::{
    Composition, FitOptions, LinearRows, Membership, Network as Core, NetworkFit as CoreFit, NetworkOptions,
    Rate, Scales, Sensor, Trained, TrainingEnd, TrainingOptions,
};
use truearm_kinematics::Cancel;

use crate::arrays::{unknown, wrong_shape};
use crate::chain::{contiguous, not_contiguous};
use crate::door::{CoreError, Failure, long, quick, with_threads};
use crate::measured::matrix;

type Array<'py> = Bound<'py, PyArray2<f64>>;

/// Options of [`Network`] by keyword.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Options {
    membership: String,
    sigma: f64,
    composition: String,
    table: Option<usize>,
}

impl Options {
    fn core(&self) -> PyResult<NetworkOptions> {
        let membership = match self.membership.as_str() {
            "gaussian" => Membership::Gaussian { sigma: self.sigma },
            "bspline" => Membership::BSpline,
            "quantised" => Membership::Quantised,
            other => {
                return Err(unknown("membership", other, "'gaussian', 'bspline' or 'quantised'"));
            }
        };
        let composition = match self.composition.as_str() {
            "min" => Composition::Min,
            "product" => Composition::Product,
            other => return Err(unknown("composition", other, "'min' or 'product'")),
        };
        Ok(NetworkOptions { membership, composition, hashed: self.table })
    }
}

/// Options of training by keyword.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Training {
    columns: Vec<usize>,
    rate: f64,
    normalise: String,
    tolerance: f64,
    epochs: usize,
}

impl Training {
    fn core(&self, cancel: &Cancel) -> Result<TrainingOptions, FieldError> {
        let rate = if self.normalise == "squares" { Rate::Projected } else { Rate::Printed };
        let (tolerance, epochs) = (self.tolerance, self.epochs);
        Ok(TrainingOptions { rate: rate(self.rate), tolerance, epochs, cancel: cancel.clone() })
    }

    fn check(&self) -> PyResult<()> {
        match self.normalise.as_str() {
            "printed" | "squares" => Ok(()),
            other => Err(unknown("normalise", other, "'printed' or 'squares'")),
        }
    }
}

/// Options of a fit by keyword.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
pub struct Fitting {
    columns: Vec<usize>,
    targets: usize,
    scales: Option<(f64, f64, f64)>,
    threads: Option<usize>,
}

/// A CMAC or FCMAC, see the stub.
#[pyclass(frozen, module = "truearm._core")]
pub struct Network {
    core: Core,
}

/// A trained network, see the stub.
#[pyclass(frozen, name = "Training", module = "truearm._core")]
pub struct TrainedNetwork {
    core: Trained,
}

/// A fitted network, see the stub.
#[pyclass(frozen, module = "truearm._core")]
pub struct NetworkFit {
    core: CoreFit,
    rows: usize,
}

#[pymethods]
impl Network {
    #[new]
    fn new(sensors: Vec<(f64, f64, usize, usize)>, outputs: usize, options: Options) -> PyResult<Self> {
        let sensor = |(low, high, cells, active)| Sensor { low, high, cells, active };
        let sensors = sensors.into_iter().map(sensor).collect();
        let core = Core::new(sensors, outputs, options.core()?).map_err(Failure::into_exception)?;
        Ok(Self { core })
    }

    #[getter]
    fn sensors(&self) -> Vec<(f64, f64, usize, usize)> {
        self.core.sensors().iter().map(|s| (s.low, s.high, s.cells, s.active)).collect()
    }

    #[getter]
    fn outputs(&self) -> usize {
        self.core.output_count()
    }

    #[getter]
    fn sensor_cells(&self) -> usize {
        self.core.sensors().iter().map(|sensor| sensor.cells).sum()
    }

    #[getter]
    fn cell_count(&self) -> u64 {
        self.core.cell_count()
    }

    #[getter]
    fn active_count(&self) -> usize {
        self.core.active_count()
    }

    #[getter]
    fn table_size(&self) -> usize {
        self.core.row_count()
    }

    #[getter]
    fn weights<'py>(&self, py: Python<'py>) -> Array<'py> {
        matrix(py, &self.core.weights(), self.core.output_count())
    }

    fn with_weights(&self, weights: PyReadonlyArray2<'_, f64>) -> PyResult<Self> {
        let expected = [self.core.row_count(), self.core.output_count()];
        if weights.shape() != expected {
            return Err(wrong_shape("weights", weights.shape(), &expected));
        }
        let values: Vec<f64> = weights.as_array().iter().copied().collect();
        let core = self.core.with_weights(&values).map_err(Failure::into_exception)?;
        Ok(Self { core })
    }

    fn active<'py>(
        &self,
        py: Python<'py>,
        s: PyReadonlyArray2<'py, f64>,
    ) -> PyResult<(Bound<'py, PyArray2<i64>>, Array<'py>)> {
        let rows = self.rows(&s)?;
        let inputs: Vec<f64> = s.as_array().iter().copied().collect();
        let (cells, grades) = quick(py, || self.core.active(&inputs))?;
        let width = self.core.active_count();
        let cells = Array2::from_shape_fn((rows, width), |(i, k)| cells[i * width + k] as i64);
        Ok((cells.into_pyarray(py), matrix(py, &grades, width)))
    }

    #[pyo3(signature = (s, out=None, threads=None))]
    fn output<'py>(
        &self,
        py: Python<'py>,
        s: PyReadonlyArray2<'py, f64>,
        out: Option<Array<'py>>,
        threads: Option<usize>,
    ) -> PyResult<Array<'py>> {
        let expected = [self.rows(&s)?, self.core.output_count()];
        let out = out.unwrap_or_else(|| PyArray2::zeros(py, expected, false));
        if out.shape() != expected {
            return Err(wrong_shape("out", out.shape(), &expected));
        }
        if !out.is_c_contiguous() {
            return Err(not_contiguous("out"));
        }
        {
            let inputs = contiguous("s", &s)?;
            let mut borrowed =
                out.try_readwrite().map_err(|error| CoreError::new_err(format!("out: {error}")))?;
            let values = borrowed.as_slice_mut().map_err(|_| not_contiguous("out"))?;
            match threads {
                None => quick(py, || self.core.output(inputs, values))?,
                _ => quick(py, || with_threads(threads, || self.core.output(inputs, values)))?,
            }
        }
        Ok(out)
    }

    fn train(
        &self,
        py: Python<'_>,
        s: PyReadonlyArray2<'_, f64>,
        ceps: PyReadonlyArray2<'_, f64>,
        options: Training,
    ) -> PyResult<TrainedNetwork> {
        let expected = [self.rows(&s)?, self.core.output_count()];
        if ceps.shape() != expected {
            return Err(wrong_shape("ceps", ceps.shape(), &expected));
        }
        options.check()?;
        let (inputs, wanted): (Vec<f64>, Vec<f64>) =
            (s.as_array().iter().copied().collect(), ceps.as_array().iter().copied().collect());
        let core = long(py, |cancel| -> Result<_, FieldError> {
            Ok(self.core.train((&inputs, &wanted), &options.columns, &options.core(cancel)?)?)
        })?;
        Ok(TrainedNetwork { core })
    }

    #[pyo3(signature = (s, jacobian, residual, options, targets=1))]
    fn train_on_measurements(
        &self,
        py: Python<'_>,
        s: PyReadonlyArray2<'_, f64>,
        jacobian: PyReadonlyArray3<'_, f64>,
        residual: PyReadonlyArray2<'_, f64>,
        options: Training,
        targets: usize,
    ) -> PyResult<TrainedNetwork> {
        options.check()?;
        let linear = self.linear(&s, &jacobian, &residual)?;
        let core = long(py, |cancel| -> Result<_, FieldError> {
            Ok(self.core.train_on_rows(&linear.rows(&options.columns, targets), &options.core(cancel)?)?)
        })?;
        Ok(TrainedNetwork { core })
    }

    fn fit(
        &self,
        py: Python<'_>,
        s: PyReadonlyArray2<'_, f64>,
        jacobian: PyReadonlyArray3<'_, f64>,
        residual: PyReadonlyArray2<'_, f64>,
        options: Fitting,
    ) -> PyResult<NetworkFit> {
        let linear = self.linear(&s, &jacobian, &residual)?;
        let scales = options.scales.map(|(noise, roughness, level)| Scales { noise, roughness, level });
        let core = long(py, |cancel| {
            let how = FitOptions { scales, cancel: cancel.clone() };
            let rows = linear.rows(&options.columns, options.targets);
            with_threads(options.threads, || self.core.fit(&rows, &how))
        })?;
        Ok(NetworkFit { core, rows: residual.shape()[1] })
    }
}

/// Arrays of linearised measurements, held while the lock is not.
struct Linear {
    inputs: Vec<f64>,
    jacobian: Vec<f64>,
    residual: Vec<f64>,
}

impl Linear {
    fn rows<'a>(&'a self, columns: &'a [usize], targets: usize) -> LinearRows<'a> {
        let Self { inputs, jacobian, residual } = self;
        LinearRows { inputs, jacobian, residual, columns, targets }
    }
}

impl Network {
    /// Rows of inputs, (n, I): n.
    fn rows(&self, s: &PyReadonlyArray2<'_, f64>) -> PyResult<usize> {
        let (found, inputs) = (s.shape(), self.core.input_count());
        if found[1] == inputs { Ok(found[0]) } else { Err(wrong_shape("s", found, &[found[0], inputs])) }
    }

    fn linear(
        &self,
        s: &PyReadonlyArray2<'_, f64>,
        jacobian: &PyReadonlyArray3<'_, f64>,
        residual: &PyReadonlyArray2<'_, f64>,
    ) -> PyResult<Linear> {
        let (poses, rows) = (self.rows(s)?, residual.shape()[1]);
        if residual.shape()[0] != poses {
            return Err(wrong_shape("residual", residual.shape(), &[poses, rows]));
        }
        let expected = [poses, rows, self.core.output_count()];
        if jacobian.shape() != expected {
            return Err(wrong_shape("jacobian", jacobian.shape(), &expected));
        }
        Ok(Linear {
            inputs: s.as_array().iter().copied().collect(),
            jacobian: jacobian.as_array().iter().copied().collect(),
            residual: residual.as_array().iter().copied().collect(),
        })
    }
}

#[pymethods]
impl TrainedNetwork {
    #[getter]
    fn network(&self) -> Network {
        Network { core: self.core.network.clone() }
    }

    #[getter]
    fn epochs(&self) -> usize {
        self.core.epochs
    }

    #[getter]
    fn converged(&self) -> bool {
        self.core.end == TrainingEnd::Converged
    }

    #[getter]
    fn reason(&self) -> String {
        self.core.end.to_string()
    }

    #[getter]
    fn largest(&self) -> f64 {
        self.core.largest
    }

    #[getter]
    fn rms(&self) -> f64 {
        self.core.rms
    }

    #[getter]
    fn cells_excited(&self) -> usize {
        self.core.excited
    }

    #[getter]
    fn collisions(&self) -> usize {
        self.core.collisions
    }
}

#[pymethods]
impl NetworkFit {
    #[getter]
    fn network(&self) -> Network {
        Network { core: self.core.network.clone() }
    }

    #[getter]
    fn scales(&self) -> (f64, f64, f64) {
        let Scales { noise, roughness, level } = self.core.scales;
        (noise, roughness, level)
    }

    #[getter]
    fn residual<'py>(&self, py: Python<'py>) -> Array<'py> {
        matrix(py, &self.core.residual, self.rows)
    }
}
