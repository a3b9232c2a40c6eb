//! Damped Newton from readings to those that bring the tool to a target, eight poses at once.
//!
//! Each step is the smallest change of the joints that removes the error, J^T (J J^T)^-1 e. Where that is longer than a
//! step may be, the error is far smaller than what the joints would have to turn for it: the step is then damped,
//! J^T (J J^T + m)^-1 e with m = (|e| / 2 longest)^2, which is never longer than `longest` and leaves the directions in
//! which the arm moves well nearly undamped. A step that makes the error larger is halved. What a pose
//! gets does not depend on the poses beside it.

use truearm_kinematics::{Isa, Kernel, Lane, LaneFrame, dispatch_on};

use crate::aimed::{Aimed, AimedScratch};
use crate::cholesky::{gram, solve};
use crate::task::{AxisGoal, Goal, PoseGoal, PositionGoal, Task};

/// So far apart 1 rad and 1 m weigh the same, in errors and in joint changes, m: half the length of a lower arm.
pub(crate) const LEVER: f64 = 0.3;
/// Error at which the search ends, m: a few roundings of a pose.
const ENOUGH: f64 = 1e-12;
/// Step at which it ends where an error is left that the joints cannot remove, rad.
const STANDSTILL: f64 = 1e-11;
/// Added to J J^T so that it can be inverted everywhere, m^2.
const FLOOR: f64 = 1e-12;

/// How a search goes.
#[derive(Debug, Clone)]
pub(crate) struct Plan {
    pub task: Task,
    /// Readings that may change, ascending.
    pub moving: Vec<usize>,
    /// For each of these, its unit: 1 rad, or as many metres.
    pub unit: Vec<f64>,
    /// Metres that one radian of the task counts.
    pub turn_weight: f64,
    /// Steps at most.
    pub steps: usize,
    /// Longest step, rad.
    pub longest: f64,
}

/// What a search writes to.
#[derive(Debug, Clone)]
pub(crate) struct Search {
    /// The best readings so far, N; the start when a search begins.
    pub best: Vec<Lane>,
    trial: Vec<Lane>,
    step: Vec<Lane>,
    pub columns: Vec<[Lane; 6]>,
    pub model: AimedScratch,
}

impl Search {
    pub fn new(aimed: &Aimed) -> Self {
        let lanes = vec![Lane::ZERO; aimed.chain.joint_count()];
        Self {
            best: lanes.clone(),
            trial: lanes.clone(),
            columns: vec![[Lane::ZERO; 6]; lanes.len()],
            step: lanes,
            model: aimed.scratch(),
        }
    }
}

/// How far each pose's search has come.
struct Progress {
    /// Smallest squared error.
    least: Lane,
    /// Squared length of the last step.
    length: Lane,
    /// What the smallest error leaves of position and orientation, squared.
    left: [Lane; 2],
}

/// Moves `search.best` to the target; gives what is left of position (m) and orientation (rad).
#[inline(always)]
pub(crate) fn toward<I: Isa>(
    aimed: &Aimed,
    plan: &Plan,
    target: &LaneFrame,
    alone: bool,
    search: &mut Search,
) -> [Lane; 2] {
    dispatch_on(I::LEVEL, Toward { aimed, plan, target, alone, search })
}

/// A search: large, and so compiled once for each instruction set and not wherever it is needed.
struct Toward<'a> {
    aimed: &'a Aimed,
    plan: &'a Plan,
    target: &'a LaneFrame,
    alone: bool,
    search: &'a mut Search,
}

impl Kernel for Toward<'_> {
    type Output = [Lane; 2];

    #[inline(always)]
    fn run<I: Isa>(self) -> [Lane; 2] {
        let Self { aimed, plan, target, alone, search } = self;
        match plan.task {
            Task::Pose => approach::<I, PoseGoal, 6>(aimed, plan, target, alone, search),
            Task::Axis => approach::<I, AxisGoal, 5>(aimed, plan, target, alone, search),
            Task::Position => approach::<I, PositionGoal, 3>(aimed, plan, target, alone, search),
        }
    }
}

/// Moves `search.best` to the target; gives what is left of position (m) and orientation (rad).
#[inline(always)]
fn approach<I: Isa, G: Goal<M>, const M: usize>(
    aimed: &Aimed,
    plan: &Plan,
    target: &LaneFrame,
    alone: bool,
    search: &mut Search,
) -> [Lane; 2] {
    let infinite = Lane::splat(f64::INFINITY);
    let mut progress = Progress { least: infinite, length: infinite, left: [infinite; 2] };
    search.trial.copy_from_slice(&search.best);
    for step in 0..=plan.steps {
        let frame = aimed.sweep::<I>(&search.trial, alone, &mut search.model);
        let error = weighted::<I, G, M>(&frame, target, plan.turn_weight);
        let norm = squared::<I>(&error);
        let better = keep_better::<I, M>(&error, norm, search, &mut progress);
        let open = progress.open();
        if step == plan.steps || !Lane::ZERO.any_below(open) {
            break;
        }
        fill_columns::<I, G, M>(aimed, plan, &frame, search);
        progress.length = find_step::<I, M>(plan, &error, norm, search);
        search.advance(plan, open, better);
    }
    let weight = 1.0 / plan.turn_weight;
    [progress.left[0].sqrt(), progress.left[1].sqrt() * weight]
}

impl Progress {
    /// One where the search goes on, zero where it has ended.
    #[inline(always)]
    fn open(&self) -> Lane {
        let (one, enough) = (Lane::splat(1.0), Lane::splat(ENOUGH * ENOUGH));
        let far = enough.where_below(self.least, one, Lane::ZERO);
        Lane::splat(STANDSTILL * STANDSTILL).where_below(self.length, far, Lane::ZERO)
    }
}

/// The task's error, all of it in metres.
#[inline(always)]
fn weighted<I: Isa, G: Goal<M>, const M: usize>(
    frame: &LaneFrame,
    target: &LaneFrame,
    weight: f64,
) -> [Lane; M] {
    let mut error = G::error::<I>(frame, target);
    for value in error.iter_mut().skip(3) {
        *value = *value * weight;
    }
    error
}

#[inline(always)]
fn squared<I: Isa>(values: &[Lane]) -> Lane {
    let mut sum = Lane::ZERO;
    for value in values {
        sum = I::mul_add(*value, *value, sum);
    }
    sum
}

/// Takes over the trials that are better than what was found before; one for those, zero for the others.
#[inline(always)]
fn keep_better<I: Isa, const M: usize>(
    error: &[Lane; M],
    norm: Lane,
    search: &mut Search,
    progress: &mut Progress,
) -> Lane {
    let before = progress.least;
    let left = [squared::<I>(&error[..3]), squared::<I>(&error[3..])];
    for (kept, found) in progress.left.iter_mut().zip(left) {
        *kept = norm.where_below(before, found, *kept);
    }
    for (best, trial) in search.best.iter_mut().zip(&search.trial) {
        *best = norm.where_below(before, *trial, *best);
    }
    progress.least = norm.where_below(before, norm, before);
    norm.where_below(before, Lane::splat(1.0), Lane::ZERO)
}

/// Motions of the task's rows by the readings that may change, in metres and units.
#[inline(always)]
fn fill_columns<I: Isa, G: Goal<M>, const M: usize>(
    aimed: &Aimed,
    plan: &Plan,
    frame: &LaneFrame,
    search: &mut Search,
) {
    let moving = plan.moving.iter().zip(&plan.unit);
    for (column, (&k, &unit)) in search.columns.iter_mut().zip(moving) {
        let screw = aimed.model.coupling.screw::<I>(&search.model.screws, k);
        let rows = G::column::<I>(&screw, frame);
        for (i, (value, row)) in column.iter_mut().zip(rows).enumerate() {
            *value = row * if i < 3 { unit } else { unit * plan.turn_weight };
        }
    }
}

/// The columns of a pose at `search.best`, see [`fill_columns`].
#[inline(always)]
pub(crate) fn fill_pose_columns<I: Isa>(aimed: &Aimed, plan: &Plan, alone: bool, search: &mut Search) {
    let frame = aimed.sweep::<I>(&search.best, alone, &mut search.model);
    fill_columns::<I, PoseGoal, 6>(aimed, plan, &frame, search);
}

/// Writes the next step in units; gives its squared length.
#[inline(always)]
fn find_step<I: Isa, const M: usize>(
    plan: &Plan,
    error: &[Lane; M],
    norm: Lane,
    search: &mut Search,
) -> Lane {
    let columns = &search.columns[..plan.moving.len()];
    let a = gram::<I, M>(columns);
    let (floor, longest) = (Lane::splat(FLOOR), Lane::splat(plan.longest * plan.longest));
    let length = step_for::<I, M>(columns, &solve::<I, M>(&a, floor, error), &mut search.step);
    if !longest.any_below(length) {
        return length;
    }
    let damping = I::mul_add(norm, Lane::splat(0.25 / (plan.longest * plan.longest)), floor);
    let damping = longest.where_below(length, damping, floor);
    step_for::<I, M>(columns, &solve::<I, M>(&a, damping, error), &mut search.step)
}

/// J^T y, and its squared length.
#[inline(always)]
fn step_for<I: Isa, const M: usize>(columns: &[[Lane; 6]], y: &[Lane; M], step: &mut [Lane]) -> Lane {
    let mut length = Lane::ZERO;
    for (step, column) in step.iter_mut().zip(columns) {
        let mut sum = Lane::ZERO;
        for (value, row) in column.iter().zip(y) {
            sum = I::mul_add(*value, *row, sum);
        }
        *step = sum;
        length = I::mul_add(sum, sum, length);
    }
    length
}

impl Search {
    /// The next trials: a step on from those that were better, half the way back from the others.
    #[inline(always)]
    fn advance(&mut self, plan: &Plan, open: Lane, better: Lane) {
        let half = Lane::splat(0.5);
        for ((&k, &unit), step) in plan.moving.iter().zip(&plan.unit).zip(&self.step) {
            let best = self.best[k];
            let back = (self.trial[k] + best) * 0.5;
            let next = half.where_below(better, best + *step * unit, back);
            self.trial[k] = half.where_below(open, next, best);
        }
    }
}
