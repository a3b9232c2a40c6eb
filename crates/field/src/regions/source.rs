//! Where a region's measurements come from: a workspace that is measured on demand, or a data set.

use truearm_estimate::MeasurementSet;

use crate::FieldError;

/// Whether a region can have CEPs of its own.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Verdict {
    /// Yes: the poses to identify them from have this condition number.
    Ready(f64),
    /// The best poses are conditioned worse than the limit allows: the region is too small.
    IllConditioned {
        /// Their condition number.
        kappa: f64,
        /// The limit.
        limit: f64,
    },
    /// There are too few poses in it.
    Scarce {
        /// Poses that there are.
        found: usize,
        /// Poses that it takes.
        needed: usize,
    },
}

/// A region looked at before anything is measured in it.
#[derive(Debug, Clone)]
pub struct Prepared {
    /// The verdict.
    pub verdict: Verdict,
    /// Joint values (n, J) of the poses to measure, or their numbers in the data set.
    pub joints: Vec<f64>,
    /// Numbers in the data set.
    pub rows: Vec<usize>,
}

/// Measurements of a region.
#[derive(Debug, Clone)]
pub struct RegionRows {
    /// To identify CEPs from.
    pub identify: MeasurementSet,
    /// To judge them by.
    pub judge: MeasurementSet,
    /// Features of both, (n, F).
    pub identify_features: Vec<f64>,
    /// Features, (n, F).
    pub judge_features: Vec<f64>,
}

/// Gives regions their measurements.
pub trait Source {
    /// What can go wrong beside the estimate.
    type Error: From<FieldError>;

    /// Whether a region with too few poses may stand beside a half that has enough: a part that cannot be reached.
    const SCARCE_HALVES: bool;

    /// Chooses the poses of the box between two corners (F,); nothing is measured yet.
    fn prepare(&mut self, low: &[f64], high: &[f64], seed: u64) -> Result<Prepared, Self::Error>;

    /// The measurements of a region that is ready.
    fn rows(
        &mut self,
        prepared: &Prepared,
        low: &[f64],
        high: &[f64],
        seed: u64,
    ) -> Result<RegionRows, Self::Error>;
}
