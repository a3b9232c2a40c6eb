//! Weights fitted to the measurements themselves: linear least squares with a roughness penalty.
//!
//! The weights of an output have a Gaussian prior that makes second differences along an input small
//! (`roughness`) and bounds what is not rough (`level`); both, and the noise, are found by maximum marginal
//! likelihood unless they are given. What is solved has as many rows as there are measured values, so that the
//! number of cells hardly matters.

use faer::Mat;
use truearm_estimate::dense::{Cholesky, parallelism, product, times};
use truearm_estimate::{EstimateError, column_unit};
use truearm_kinematics::Cancel;

use crate::FieldError;
use crate::cmac::gain::LinearRows;
use crate::cmac::network::Network;
use crate::cmac::roughness::Modes;
use crate::compass::Compass;

/// Standard deviations, m; angles of weights and rows count at 0.3 m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Scales {
    /// Of a measured value.
    pub noise: f64,
    /// Of a second difference of weights along one input.
    pub roughness: f64,
    /// Of what has no second differences.
    pub level: f64,
}

/// How weights are fitted.
#[derive(Debug, Clone, Default)]
pub struct FitOptions {
    /// Known scales; found from the measurements where there are none.
    pub scales: Option<Scales>,
    /// Looked at between the steps.
    pub cancel: Cancel,
}

/// A network fitted to measurements.
#[derive(Debug, Clone)]
pub struct NetworkFit {
    /// The network.
    pub network: Network,
    /// Noise and prior.
    pub scales: Scales,
    /// Measured minus predicted, (n, m), m and rad.
    pub residual: Vec<f64>,
}

/// Rows of the equations at most: their matrix takes 1.1 GB then.
const MOST_ROWS: usize = 12_000;
/// Association cells at most: each pose excites all modes of their penalty.
const MOST_CELLS: u64 = 20_000;
/// Cells along one input of a fit at the most: their penalty's eigenvectors take seconds.
const MOST_CELLS_ALONG: usize = 1000;
/// Poses that the scales are found from; more take the cube of their number and hardly change the scales.
const SCALE_POSES: usize = 300;
/// Natural logarithms of roughness and level over noise. Beyond the upper end rounding would make the equations
/// indefinite.
const RATIOS: Compass = Compass { start: [2.0, 4.0], steps: (2.0, 0.2), ends: (-7.0, 12.0) };

impl Network {
    /// Fit the weights to linearised measurements.
    ///
    /// # Errors
    /// [`EstimateError`] where an array does not fit, the network is hashed (its rows have no neighbours) or too large,
    /// there are too many rows, or on request; [`FieldError::NotPositiveDefinite`] where values are far outside the model.
    pub fn fit(&self, rows: &LinearRows<'_>, options: &FitOptions) -> Result<NetworkFit, FieldError> {
        let (poses, per_pose) = rows.check(self)?;
        self.check_size(poses * per_pose)?;
        let modes = Modes::new(self)?;
        let (cells, grades) = self.active(rows.inputs)?;
        let excitations = modes.excitations(self, &cells, &grades);
        let (jacobian, residual) = rows.scaled(per_pose);
        let width = rows.columns.len();
        let kept = |row: usize| jacobian[row * width..(row + 1) * width].iter().any(|&x| x != 0.0);
        let equations = Equations {
            roughness: &modes.roughness,
            excitations,
            rows: (0..poses * per_pose).filter(|&row| kept(row)).collect(),
            per_pose,
            jacobian: Mat::from_fn(poses * per_pose, width, |i, j| jacobian[i * width + j]),
            residual,
        };
        let scales = match options.scales {
            Some(scales) => scales.checked()?,
            None => equations.thinned().scales(&options.cancel)?,
        };
        options.cancel.check()?;
        let mut weights = modes.weights(&equations.solve(scales)?, width);
        for (at, weight) in weights.iter_mut().enumerate() {
            *weight /= column_unit(rows.columns[at % width]);
        }
        let network = self.with_weights(&weights)?;
        let residual = network.left_over(rows, per_pose)?;
        Ok(NetworkFit { network, scales, residual })
    }

    fn check_size(&self, rows: usize) -> Result<(), EstimateError> {
        let refuse = |what, value, rule| Err(EstimateError::Option { what, value, rule });
        if let Some(size) = self.options().hashed {
            let rule =
                "a penalty on roughness needs neighbours: make the table dense, or train by the update rule";
            return refuse("the size of the hash table", size as f64, rule);
        }
        if self.cell_count() > MOST_CELLS {
            let rule = "a fit takes 20000 at most: lower the sensors' cells, or train by the update rule";
            return refuse("the number of association cells", self.cell_count() as f64, rule);
        }
        if let Some(sensor) = self.sensors().iter().find(|sensor| sensor.cells > MOST_CELLS_ALONG) {
            let rule = "a fit takes 1000 at most: lower the sensor's cells, or train by the update rule";
            return refuse("the number of cells along one input", sensor.cells as f64, rule);
        }
        if rows > MOST_ROWS {
            let rule = "a fit takes 12000 at most: thin the measurements, or train by the update rule";
            return refuse("the number of measured values", rows as f64, rule);
        }
        Ok(())
    }

    fn left_over(&self, rows: &LinearRows<'_>, per_pose: usize) -> Result<Vec<f64>, EstimateError> {
        let width = rows.columns.len();
        let mut ceps = vec![0.0; rows.residual.len() / per_pose.max(1) * width];
        self.output(rows.inputs, &mut ceps)?;
        let left = |(row, residual): (usize, &f64)| {
            let jacobian = &rows.jacobian[row * width..(row + 1) * width];
            let ceps = &ceps[row / per_pose * width..][..width];
            residual - jacobian.iter().zip(ceps).map(|(j, c)| j * c).sum::<f64>()
        };
        Ok(rows.residual.iter().enumerate().map(left).collect())
    }
}

impl Scales {
    fn checked(self) -> Result<Scales, EstimateError> {
        for (what, value) in
            [("the noise", self.noise), ("the roughness", self.roughness), ("the level", self.level)]
        {
            if !(value > 0.0 && value.is_finite()) {
                return Err(EstimateError::Option { what, value, rule: "it must be a positive length, m" });
            }
        }
        Ok(self)
    }

    /// Prior variance of a mode's weights.
    fn variance(&self, roughness: f64) -> f64 {
        (roughness / (self.roughness * self.roughness) + (self.level * self.level).recip()).recip()
    }
}

/// `residual = (jacobian weights) excited + noise`, in metres, with weights in units of a millimetre's worth.
struct Equations<'a> {
    /// Penalty of each mode.
    roughness: &'a [f64],
    /// (n, modes).
    excitations: Mat<f64>,
    /// Rows that hold a measurement, of (n, m).
    rows: Vec<usize>,
    per_pose: usize,
    /// (n m, P).
    jacobian: Mat<f64>,
    /// (n, m).
    residual: Vec<f64>,
}

impl Equations<'_> {
    /// The same with poses spread over all of them, few enough to find scales from.
    fn thinned(&self) -> Equations<'_> {
        let poses = self.excitations.nrows();
        let stride = poses.div_ceil(SCALE_POSES).max(1);
        let rows = self.rows.iter().filter(|&&row| (row / self.per_pose).is_multiple_of(stride));
        let kept = |pose: usize| pose * stride;
        let (per_pose, count) = (self.per_pose, poses.div_ceil(stride));
        let from = |row: usize| kept(row / per_pose) * per_pose + row % per_pose;
        Equations {
            roughness: self.roughness,
            excitations: Mat::from_fn(count, self.roughness.len(), |i, j| self.excitations[(kept(i), j)]),
            rows: rows.map(|row| row / per_pose / stride * per_pose + row % per_pose).collect(),
            per_pose,
            jacobian: Mat::from_fn(count * per_pose, self.jacobian.ncols(), |i, j| {
                self.jacobian[(from(i), j)]
            }),
            residual: (0..count * per_pose).map(|row| self.residual[from(row)]).collect(),
        }
    }

    /// Covariance of the rows' residuals.
    fn covariance(&self, scales: Scales) -> Mat<f64> {
        let (count, modes) = (self.excitations.nrows(), self.roughness.len());
        let deviation: Vec<f64> = self.roughness.iter().map(|&value| scales.variance(value).sqrt()).collect();
        let scaled = Mat::from_fn(count, modes, |i, j| self.excitations[(i, j)] * deviation[j]);
        let alike = product(scaled.as_ref(), scaled.transpose());
        let rows = &self.rows;
        let jacobian = Mat::from_fn(rows.len(), self.jacobian.ncols(), |i, j| self.jacobian[(rows[i], j)]);
        let mut covariance = product(jacobian.as_ref(), jacobian.transpose());
        for j in 0..rows.len() {
            for i in j..rows.len() {
                covariance[(i, j)] *= alike[(rows[i] / self.per_pose, rows[j] / self.per_pose)];
            }
            covariance[(j, j)] += scales.noise * scales.noise;
        }
        covariance
    }

    fn kept_residual(&self) -> Vec<f64> {
        self.rows.iter().map(|&row| self.residual[row]).collect()
    }

    /// Logarithm of the evidence at its best noise, and that noise, for logarithms of roughness and level over noise.
    fn evidence(&self, ratios: [f64; 2]) -> Option<(f64, f64)> {
        let [roughness, level] = ratios.map(f64::exp);
        let factor = Cholesky::new(self.covariance(Scales { noise: 1.0, roughness, level }), parallelism())?;
        let residual = self.kept_residual();
        let solved = factor.solve_vector(&residual);
        let squares: f64 = residual.iter().zip(&solved).map(|(a, b)| a * b).sum();
        let rows = residual.len() as f64;
        let variance = (squares / rows).max(f64::MIN_POSITIVE);
        Some((-0.5 * (rows * variance.ln() + factor.log_determinant()), variance.sqrt()))
    }

    /// Scales of maximum evidence.
    fn scales(&self, cancel: &Cancel) -> Result<Scales, FieldError> {
        let found = RATIOS.search(|ratios| cancel.check().map(|()| self.evidence(ratios)))?;
        let (ratios, _, noise) = found.ok_or(FieldError::NotPositiveDefinite { rows: self.rows.len() })?;
        let [roughness, level] = ratios.map(|ratio| noise * ratio.exp());
        Ok(Scales { noise, roughness, level })
    }

    /// Weights of the modes, (modes, P), scaled.
    fn solve(&self, scales: Scales) -> Result<Vec<f64>, FieldError> {
        let indefinite = FieldError::NotPositiveDefinite { rows: self.rows.len() };
        let factor = Cholesky::new(self.covariance(scales), parallelism()).ok_or(indefinite)?;
        let solved = factor.solve_vector(&self.kept_residual());
        let (count, width) = (self.excitations.nrows(), self.jacobian.ncols());
        let mut asked = vec![0.0; count * width];
        for (&row, value) in self.rows.iter().zip(&solved) {
            let target = &mut asked[row / self.per_pose * width..][..width];
            target.iter_mut().enumerate().for_each(|(k, to)| *to += value * self.jacobian[(row, k)]);
        }
        let mut weights = vec![0.0; self.roughness.len() * width];
        for output in 0..width {
            let column: Vec<f64> = asked.iter().skip(output).step_by(width).copied().collect();
            let along = times(self.excitations.transpose(), &column);
            for (mode, value) in along.into_iter().enumerate() {
                weights[mode * width + output] = value * scales.variance(self.roughness[mode]);
            }
        }
        Ok(weights)
    }
}
