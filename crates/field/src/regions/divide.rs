//! The recursive workspace division algorithm, steps 1 to 4 of section 4.2 of the paper.
//!
//! Beside the paper: the error left at a test point is that of the model with the region's CEPs, which is what
//! compensation leaves too; a region whose halves could not be well conditioned stays whole, so that none is
//! estimated from ill-conditioned poses; a half that cannot be reached stays without CEPs.

use truearm_estimate::{FrameMode, MeasurementSet, Problem, Setup};
use truearm_kinematics::Chain;

use crate::FieldError;
use crate::mixed::mixed;
use crate::regions::estimate::Held;
use crate::regions::regional::undetermined;
use crate::regions::source::{Prepared, RegionRows, Source, Verdict};
use crate::regions::tree::Regions;
use crate::regions::trend;

/// Along which axis a region is halved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Halving {
    /// Along the longest side, as a share of the workspace's.
    Longest,
    /// Along the axis whose halves, allowed CEPs of their own, leave the least squares of what was measured in the whole.
    Best,
}

/// Which region is halved next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Order {
    /// The one with the largest error.
    Worst,
    /// The one that has waited longest.
    Breadth,
}

/// When and how regions are halved.
#[derive(Debug, Clone)]
pub struct DivisionOptions {
    /// Demanded accuracy: largest error at a test point, m.
    pub accuracy: f64,
    /// Regions (leaves) at most.
    pub regions: usize,
    /// Which axis.
    pub halving: Halving,
    /// Which region first.
    pub order: Order,
    /// Everything drawn follows from it.
    pub seed: u64,
}

/// Why a leaf was not halved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Ended {
    /// The demanded accuracy is reached at all test points.
    Accurate,
    /// The number of regions is reached.
    RegionLimit,
    /// Halves of it would be too small to be well conditioned.
    TooSmall,
    /// There are too few poses in a half, or none to judge by.
    TooFewPoses,
    /// It cannot be reached: it has no CEPs.
    Inaccessible,
}

impl std::fmt::Display for Ended {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(match self {
            Ended::Accurate => "accurate: the demanded accuracy is reached at all test points",
            Ended::RegionLimit => "the number of regions is reached",
            Ended::TooSmall => "too small: its halves could not be well conditioned",
            Ended::TooFewPoses => "too few poses in one of its halves, or none to judge it by",
            Ended::Inaccessible => "inaccessible: too few poses can be measured in it",
        })
    }
}

/// A divided workspace.
#[derive(Debug, Clone)]
pub struct Division {
    /// The tree.
    pub regions: Regions,
    /// CEPs of every region, added to the parameters, (N, P); NaN where there are none.
    pub ceps: Vec<f64>,
    /// Condition number of the poses they were identified from, (N,); NaN where there are none.
    pub kappa: Vec<f64>,
    /// Largest error at a test point, (N,), m; NaN where there is none.
    pub error: Vec<f64>,
    /// Why leaves are leaves, (N,); none for regions that are halved.
    pub ended: Vec<Option<Ended>>,
    /// In the order of measuring: region, number of poses, whether they are test points.
    pub batches: Vec<(usize, usize, bool)>,
}

/// What stays the same in all regions.
pub struct Arm<'a> {
    /// The model.
    pub chain: &'a Chain,
    /// Parameters that CEPs belong to.
    pub columns: &'a [usize],
    /// Link parameters, (5 L,).
    pub parameters: &'a [f64],
    /// Frames and targets.
    pub setup: &'a Setup,
}

impl Arm<'_> {
    pub(super) fn held(&self) -> Held<'_> {
        Held { parameters: self.parameters, setup: self.setup }
    }

    pub(super) fn problem<'b>(&'b self, set: &'b MeasurementSet) -> Problem<'b> {
        Problem { chain: self.chain, measurements: set, columns: self.columns, frame: FrameMode::World }
    }
}

/// Divide the workspace between two corners (F,).
///
/// # Errors
/// The source's, and [`FieldError`] where the whole workspace has too few or ill-conditioned poses.
pub fn divide<S: Source>(
    arm: &Arm<'_>,
    source: &mut S,
    (low, high): (&[f64], &[f64]),
    options: &DivisionOptions,
) -> Result<Division, S::Error> {
    let regions = Regions::new(low, high).map_err(FieldError::from)?;
    let mut work =
        Work { arm, source, options, division: Division::of(regions), open: Vec::new(), rows: Vec::new() };
    work.whole()?;
    while let Some(region) = work.next() {
        if work.division.regions.leaves().len() >= options.regions {
            work.division.ended[region] = Some(Ended::RegionLimit);
        } else {
            work.halve(region)?;
        }
    }
    Ok(work.division)
}

impl Division {
    fn of(regions: Regions) -> Self {
        let (ceps, kappa, error) = (Vec::new(), Vec::new(), Vec::new());
        Self { regions, ceps, kappa, error, ended: Vec::new(), batches: Vec::new() }
    }

    /// Poses that were measured, test points included.
    pub fn measurements(&self) -> usize {
        self.batches.iter().map(|batch| batch.1).sum()
    }
}

struct Work<'a, S> {
    arm: &'a Arm<'a>,
    source: &'a mut S,
    options: &'a DivisionOptions,
    division: Division,
    /// Leaves that are not accurate enough, in the order of their making.
    open: Vec<usize>,
    /// Measurements of every region.
    rows: Vec<Option<RegionRows>>,
}

impl<S: Source> Work<'_, S> {
    /// Takes the region to halve next.
    fn next(&mut self) -> Option<usize> {
        let error = |at: &usize| self.division.error[self.open[*at]];
        let at = match self.options.order {
            Order::Breadth => (0..self.open.len()).next()?,
            // Of equal errors the one that has waited longest.
            Order::Worst => (0..self.open.len()).rev().max_by(|a, b| error(a).total_cmp(&error(b)))?,
        };
        Some(self.open[at]).inspect(|_| {
            self.open.remove(at);
        })
    }

    fn whole(&mut self) -> Result<(), S::Error> {
        let prepared = self.prepare(0)?;
        match prepared.verdict {
            Verdict::Ready(_) => self.enter(0, &prepared, &vec![0.0; self.arm.columns.len()]),
            Verdict::IllConditioned { kappa, limit } => {
                Err(FieldError::IllConditioned { kappa, limit }.into())
            }
            Verdict::Scarce { found, needed } => Err(FieldError::Scarce { found, needed }.into()),
        }
    }

    /// Seed of a region: the same whatever was halved before it elsewhere.
    fn seed(&self, region: usize) -> u64 {
        let regions = &self.division.regions;
        let mut path = vec![region];
        while let Some(parent) = regions.parent(path[path.len() - 1]) {
            path.push(parent);
        }
        let upper = |pair: &[usize]| {
            let (axis, child) = regions.halves(pair[1]).unwrap_or_default();
            2 * axis as u64 + u64::from(pair[0] > child)
        };
        path.windows(2).rev().map(upper).fold(self.options.seed, |seed, step| mixed(seed ^ (step + 1)))
            & (u64::MAX >> 1)
    }

    fn prepare(&mut self, region: usize) -> Result<Prepared, S::Error> {
        let seed = self.seed(region);
        let (low, high) = self.division.regions.corners(region);
        self.source.prepare(low, high, seed)
    }

    /// Measures, estimates and judges a region.
    fn enter(&mut self, region: usize, prepared: &Prepared, start: &[f64]) -> Result<(), S::Error> {
        let seed = self.seed(region);
        let Verdict::Ready(kappa) = prepared.verdict else {
            self.record(&vec![f64::NAN; start.len()], (f64::NAN, f64::NAN), None);
            self.division.ended[region] = Some(Ended::Inaccessible);
            return Ok(());
        };
        let (low, high) = self.division.regions.corners(region);
        let rows = self.source.rows(prepared, low, high, seed)?;
        let poses = (rows.identify.pose_count(), rows.judge.pose_count());
        self.division.batches.extend([(region, poses.0, false), (region, poses.1, true)]);
        let held = self.arm.held();
        let problem = self.arm.problem(&rows.identify);
        let ceps = held.least_squares(&problem, start)?.ok_or_else(|| undetermined(&problem))?;
        let errors = held.errors(&self.arm.problem(&rows.judge), &ceps)?;
        let error = errors.into_iter().fold(f64::NAN, f64::max);
        self.record(&ceps, (kappa, error), Some(rows));
        if error > self.options.accuracy {
            self.open.push(region);
        } else {
            let ended = if error.is_nan() { Ended::TooFewPoses } else { Ended::Accurate };
            self.division.ended[region] = Some(ended);
        }
        Ok(())
    }

    /// Regions are entered in the order of their numbers.
    fn record(&mut self, ceps: &[f64], (kappa, error): (f64, f64), rows: Option<RegionRows>) {
        self.division.ceps.extend(ceps);
        self.division.kappa.push(kappa);
        self.division.error.push(error);
        self.division.ended.push(None);
        self.rows.push(rows);
    }

    /// Halves a region along the first of the preferred axes whose halves can both have CEPs.
    fn halve(&mut self, region: usize) -> Result<(), S::Error> {
        let mut reason = Ended::TooSmall;
        for axis in self.preferred(region)? {
            let before = self.division.regions.clone();
            let child = self.division.regions.halve(region, axis);
            let halves = [self.prepare(child)?, self.prepare(child + 1)?];
            let scarce = halves.iter().filter(|half| matches!(half.verdict, Verdict::Scarce { .. })).count();
            let ill = halves.iter().any(|half| matches!(half.verdict, Verdict::IllConditioned { .. }));
            if !ill && (scarce == 0 || scarce == 1 && S::SCARCE_HALVES) {
                let width = self.arm.columns.len();
                let start = self.division.ceps[region * width..(region + 1) * width].to_vec();
                self.rows[region] = None;
                self.enter(child, &halves[0], &start)?;
                return self.enter(child + 1, &halves[1], &start);
            }
            if scarce > 0 {
                reason = Ended::TooFewPoses;
            }
            self.division.regions = before;
        }
        self.division.ended[region] = Some(reason);
        Ok(())
    }

    fn preferred(&self, region: usize) -> Result<Vec<usize>, FieldError> {
        let longest = self.division.regions.longest_first(region);
        match (self.options.halving, &self.rows[region]) {
            (Halving::Best, Some(rows)) => {
                let width = self.arm.columns.len();
                let ceps = &self.division.ceps[region * width..(region + 1) * width];
                let corners = self.division.regions.corners(region);
                trend::best_first(self.arm, rows, ceps, corners, longest)
            }
            _ => Ok(longest),
        }
    }
}
