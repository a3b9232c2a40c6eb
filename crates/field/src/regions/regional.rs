//! Representative CEPs of all regions of a tree from measurements.

use truearm_estimate::dense::{to_vec, transposed_product};
use truearm_estimate::{EstimateError, Problem, Setup, column_unit, observability};

use crate::FieldError;
use crate::regions::estimate::{Held, scaled};
use crate::regions::shrink::{Own, shrunk};
use crate::regions::tree::Regions;

/// How CEPs are estimated.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Method {
    /// Least squares in each region alone, as in the paper; regions with fewer measured values than CEPs have none.
    LeastSquares,
    /// Shrunk towards the region that it is half of: the standard deviation of the step to a half (m, angles at 0.3 m),
    /// or none to find it from the measurements.
    Shrunk(Option<f64>),
}

/// CEPs of all regions.
#[derive(Debug, Clone)]
pub struct RegionalFit {
    /// Added to the parameters, (N, P), m and rad; NaN where there are none.
    pub ceps: Vec<f64>,
    /// Condition number of each region's rows, (N,); infinite where they do not determine all CEPs.
    pub kappa: Vec<f64>,
    /// Poses in each region, (N,).
    pub poses: Vec<usize>,
    /// Noise, m, where shrinking estimated it.
    pub noise: Option<f64>,
    /// Standard deviation of the step to a half, by depth from 1 on, m, where CEPs were shrunk.
    pub prior: Vec<f64>,
}

/// Estimate the CEPs of every region from the measurements in it, with parameters (5 L,) and set-up held.
///
/// # Errors
/// [`FieldError::Length`] where features (n, F) do not fit, [`FieldError::Estimate`] where parameters or set-up are
/// another problem's, [`FieldError::NotPositiveDefinite`] where shrinking fails.
pub fn regional_ceps(
    regions: &Regions,
    problem: &Problem<'_>,
    (parameters, setup): (&[f64], &Setup),
    features: &[f64],
    method: Method,
) -> Result<RegionalFit, FieldError> {
    problem.measurements.check()?;
    let poses = problem.measurements.pose_count();
    let expected = poses * regions.dimensions();
    if features.len() != expected {
        return Err(FieldError::Length { what: "features", found: features.len(), expected });
    }
    let members = members(regions, &regions.find_all(features)?);
    let held = Held { parameters, setup };
    let mut fit = RegionalFit {
        ceps: vec![f64::NAN; regions.count() * problem.columns.len()],
        kappa: vec![f64::INFINITY; regions.count()],
        poses: members.iter().map(Vec::len).collect(),
        noise: None,
        prior: Vec::new(),
    };
    fit.conditions(problem, held, &members)?;
    match method {
        Method::LeastSquares => fit.alone(problem, held, &members)?,
        Method::Shrunk(halving) => fit.together(regions, problem, (held, halving), &members)?,
    }
    Ok(fit)
}

/// Poses in each region of any size.
fn members(regions: &Regions, leaf_of: &[usize]) -> Vec<Vec<usize>> {
    let mut members = vec![Vec::new(); regions.count()];
    for (pose, &leaf) in leaf_of.iter().enumerate() {
        members[leaf].push(pose);
        let mut region = leaf;
        while let Some(parent) = regions.parent(region) {
            members[parent].push(pose);
            region = parent;
        }
    }
    members
}

impl RegionalFit {
    fn conditions(
        &mut self,
        problem: &Problem<'_>,
        held: Held<'_>,
        members: &[Vec<usize>],
    ) -> Result<(), FieldError> {
        let zero = vec![0.0; problem.columns.len()];
        for (region, poses) in members.iter().enumerate() {
            let set = problem.measurements.subset(poses);
            if set.measured_values() >= zero.len() {
                let part = Problem { measurements: &set, ..*problem };
                let (matrix, _) = scaled(&part, &held.rows(&part, &zero)?);
                self.kappa[region] = observability(&matrix, poses.len())?.kappa;
            }
        }
        Ok(())
    }

    fn alone(
        &mut self,
        problem: &Problem<'_>,
        held: Held<'_>,
        members: &[Vec<usize>],
    ) -> Result<(), FieldError> {
        let width = problem.columns.len();
        for (region, poses) in members.iter().enumerate() {
            let set = problem.measurements.subset(poses);
            let part = Problem { measurements: &set, ..*problem };
            if !self.kappa[region].is_finite() {
                continue;
            }
            if let Some(ceps) = held.least_squares(&part, &vec![0.0; width])? {
                self.ceps[region * width..(region + 1) * width].copy_from_slice(&ceps);
            }
        }
        Ok(())
    }

    fn together(
        &mut self,
        regions: &Regions,
        problem: &Problem<'_>,
        (held, halving): (Held<'_>, Option<f64>),
        members: &[Vec<usize>],
    ) -> Result<(), FieldError> {
        let width = problem.columns.len();
        // The model is linear at the CEPs of the whole workspace, from which those of its parts differ little.
        let middle = held.least_squares(problem, &vec![0.0; width])?.ok_or(undetermined(problem))?;
        let own = |region: usize| -> Result<Own, FieldError> {
            let poses = if regions.is_leaf(region) { members[region].as_slice() } else { &[] };
            let set = problem.measurements.subset(poses);
            let part = Problem { measurements: &set, ..*problem };
            let (matrix, residual) = scaled(&part, &held.rows(&part, &middle)?);
            let right = transposed_product(matrix.as_ref(), residual.as_ref());
            Ok(Own {
                normal: transposed_product(matrix.as_ref(), matrix.as_ref()),
                right: to_vec(right.as_ref()),
                squares: residual.squared_norm_l2(),
                rows: set.measured_values(),
            })
        };
        let own: Vec<Own> = (0..regions.count()).map(own).collect::<Result<_, _>>()?;
        let rows = problem.measurements.measured_values();
        let (ceps, spread) =
            shrunk(regions, &own, halving).ok_or(FieldError::NotPositiveDefinite { rows })?;
        for (at, value) in ceps.into_iter().flatten().enumerate() {
            let k = at % width;
            self.ceps[at] = middle[k] + value / column_unit(problem.columns[k]);
        }
        self.noise = Some(spread.noise);
        let deepest = (0..regions.count()).map(|region| regions.depth(region)).max().unwrap_or(0);
        self.prior = (0..deepest).map(|depth| spread.halving * spread.finer.powi(depth as i32)).collect();
        Ok(())
    }
}

/// There are too few measured values for the CEPs, or the poses are too alike.
pub fn undetermined(problem: &Problem<'_>) -> FieldError {
    let (rows, unknowns) = (problem.measurements.measured_values(), problem.columns.len());
    if rows >= unknowns {
        return FieldError::Estimate(EstimateError::Singular { unknowns, rows });
    }
    let needed = unknowns.div_ceil(problem.measurements.rows_per_pose().max(1));
    FieldError::Estimate(EstimateError::TooFew { rows, unknowns, needed, hint: String::new() })
}

/// Gives leaves whose CEPs (N, P) are NaN the mean of their neighbours', the paper's way for regions without data; those
/// without neighbours that have any wait until a neighbour has some. Regions that are halved are left alone.
///
/// # Errors
/// [`FieldError::Length`].
pub fn fill_without_data(regions: &Regions, ceps: &mut [f64]) -> Result<(), FieldError> {
    let width = ceps.len() / regions.count();
    if width * regions.count() != ceps.len() {
        let expected = width * regions.count();
        return Err(FieldError::Length { what: "CEPs of regions", found: ceps.len(), expected });
    }
    loop {
        let has = |ceps: &[f64], region: usize| {
            ceps[region * width..(region + 1) * width].iter().all(|v| !v.is_nan())
        };
        let mut filled = Vec::new();
        for leaf in regions.leaves().into_iter().filter(|&leaf| !has(ceps, leaf)) {
            let known: Vec<usize> =
                regions.neighbours(leaf).into_iter().filter(|&other| has(ceps, other)).collect();
            if !known.is_empty() {
                let sum = |k: usize| known.iter().map(|&other| ceps[other * width + k]).sum::<f64>();
                filled.push((leaf, (0..width).map(|k| sum(k) / known.len() as f64).collect::<Vec<_>>()));
            }
        }
        if filled.is_empty() {
            return Ok(());
        }
        for (leaf, values) in filled {
            ceps[leaf * width..(leaf + 1) * width].copy_from_slice(&values);
        }
    }
}
