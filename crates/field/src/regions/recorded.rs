//! Passive mode: a region's measurements are those of a data set that lie in it.

use truearm_estimate::{MeasurementSet, Problem, Setup, observability};

use crate::FieldError;
use crate::regions::estimate::{Held, scaled};
use crate::regions::source::{Prepared, RegionRows, Source, Verdict};

/// A data set with features, some rows of which judge and take no part in any fit.
pub struct Recorded<'a> {
    /// Measurements and the CEPs' columns.
    pub problem: Problem<'a>,
    /// Link parameters, (5 L,).
    pub parameters: &'a [f64],
    /// Frames and targets.
    pub setup: &'a Setup,
    /// Features, (n, F).
    pub features: &'a [f64],
    /// Whether a row judges, (n,).
    pub judges: &'a [bool],
    /// Least number of poses to identify a region's CEPs from.
    pub poses: usize,
    /// Largest condition number kappa(M).
    pub limit: f64,
    /// Corners of the workspace, (F,) each; rows beyond count as on its faces.
    pub corners: (&'a [f64], &'a [f64]),
}

impl Recorded<'_> {
    /// Rows in the box: those that look-up finds there.
    fn within(&self, low: &[f64], high: &[f64], judges: bool) -> Vec<usize> {
        let width = low.len();
        let inside = |&row: &usize| {
            let point = &self.features[row * width..(row + 1) * width];
            (0..width).all(|k| {
                (low[k] <= point[k] || low[k] <= self.corners.0[k])
                    && (point[k] < high[k] || high[k] >= self.corners.1[k])
            })
        };
        (0..self.judges.len()).filter(|&row| self.judges[row] == judges).filter(inside).collect()
    }

    fn subset(&self, rows: &[usize]) -> (MeasurementSet, Vec<f64>) {
        let width = self.features.len() / self.judges.len().max(1);
        let features = rows.iter().flat_map(|&row| &self.features[row * width..(row + 1) * width]);
        (self.problem.measurements.subset(rows), features.copied().collect())
    }
}

impl Source for Recorded<'_> {
    type Error = FieldError;

    const SCARCE_HALVES: bool = false;

    fn prepare(&mut self, low: &[f64], high: &[f64], _seed: u64) -> Result<Prepared, FieldError> {
        let rows = self.within(low, high, false);
        let verdict = if rows.len() < self.poses {
            Verdict::Scarce { found: rows.len(), needed: self.poses }
        } else {
            let (set, _) = self.subset(&rows);
            let part = Problem { measurements: &set, ..self.problem };
            let held = Held { parameters: self.parameters, setup: self.setup };
            let (matrix, _) = scaled(&part, &held.rows(&part, &vec![0.0; part.columns.len()])?);
            let kappa = observability(&matrix, rows.len()).map_err(FieldError::from)?.kappa;
            if kappa <= self.limit {
                Verdict::Ready(kappa)
            } else {
                Verdict::IllConditioned { kappa, limit: self.limit }
            }
        };
        Ok(Prepared { verdict, joints: Vec::new(), rows })
    }

    fn rows(
        &mut self,
        prepared: &Prepared,
        low: &[f64],
        high: &[f64],
        _: u64,
    ) -> Result<RegionRows, FieldError> {
        let (identify, identify_features) = self.subset(&prepared.rows);
        let (judge, judge_features) = self.subset(&self.within(low, high, true));
        Ok(RegionRows { identify, judge, identify_features, judge_features })
    }
}
