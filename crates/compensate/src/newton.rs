//! Damped Newton from readings to those that bring the tool to a target, eight poses at once.
//!
//! Each step is the smallest change of the joints that removes the error, J^T (J J^T)^-1 e. Where that is longer than a
//! step may be, the error is far smaller than what the joints would have to turn for it: the step is then damped,
//! J^T (J J^T + m)^-1 e with m = (|e| / 2 longest)^2, which is never longer than `longest` and leaves the directions in
//! which the arm moves well nearly undamped. A step that makes the error larger is halved. Errors are shifts and rotation
//! vectors: however large they are, -J^T e is the slope of |e|^2 / 2, and no target is so far that steps lead away from it.
//!
//! How a step bends off its straight line is known from the screws of the joints, [`truearm_kinematics::bend`]: taken off
//! the error before that is solved again, it makes a step exact but for the third order (Chebyshev's method), and a
//! Jacobian good for the steps that follow a short one. A search ends with a step whose error is not looked at where the
//! rate at which errors fell says that it is small enough (Hairer and Wanner, Solving Ordinary Differential Equations II,
//! section IV.8). What a pose gets does not depend on the poses beside it.

use std::marker::PhantomData;

use truearm_kinematics::{Isa, Kernel, Lane, LaneFrame};

use crate::aimed::{Aimed, AimedScratch};
use crate::bend::Bend;
use crate::cholesky::{Factor, gram};
use crate::plan::{Left, Plan};
use crate::task::{AxisGoal, Goal, PoseGoal, PositionGoal, Task, shift};

/// Step up to which a Jacobian is good enough for the steps to come, in units, if errors fall fast.
const SHORT: f64 = 1e-2;
/// Part of the error up to which a step may bend, if that is to be trusted, and by which it may make the step longer.
const SLIGHT: f64 = 0.3;
/// Longest step after which an error is foreseen, in units: near singular configurations a small error asks for a long one, on
/// which parameters vary.
const NEAR: f64 = 5e-6;
/// Step at which it ends where an error is left that the joints cannot remove, in units.
const STANDSTILL: f64 = 1e-11;
/// Largest rate at which errors fall that is trusted to hold for one more step, and with the same Jacobian.
const STEADY: f64 = 0.1;
/// Added to J J^T so that it can be inverted everywhere, m^2.
const FLOOR: f64 = 1e-12;

/// What a search writes to.
#[derive(Debug, Clone)]
pub(crate) struct Search {
    /// The best readings so far, N; the start when a search begins.
    pub best: Vec<Lane>,
    trial: Vec<Lane>,
    /// The last step of the moving readings, in units.
    step: Vec<Lane>,
    /// The same in rad and m: of all readings, zero where they may not move, and of all joint values.
    shifts: Vec<Lane>,
    turns: Vec<Lane>,
    /// Motions of the task's rows by the moving readings, in metres and units.
    pub columns: Vec<[Lane; 6]>,
    bend: Bend,
    pub model: AimedScratch,
}

impl Search {
    /// Room for a model's searches.
    pub fn new(aimed: &Aimed) -> Self {
        let lanes = vec![Lane::ZERO; aimed.chain.joint_count()];
        Self {
            best: lanes.clone(),
            trial: lanes.clone(),
            columns: vec![[Lane::ZERO; 6]; lanes.len()],
            bend: Bend::new(lanes.len()),
            step: lanes.clone(),
            shifts: lanes.clone(),
            turns: lanes,
            model: aimed.scratch(),
        }
    }
}

/// How far each pose's search has come. Flags are one where they hold, and zero.
struct Progress {
    /// Smallest squared error.
    least: Lane,
    /// Squared length of the last step.
    length: Lane,
    /// What the smallest error leaves of position and orientation, squared.
    left: [Lane; 2],
    /// Squared ratio of the last error to the smallest before it; zero where there was none.
    rate: Lane,
    /// The same of the error before.
    rate_before: Lane,
    /// Squared length of the step to the last trial, in units.
    behind: Lane,
    /// Flag: the search goes on.
    open: Lane,
    /// Flag: the last trial was better than those before.
    better: Lane,
    /// Flag: the next step needs a Jacobian of its own.
    stale: Lane,
    /// Flag: the last step had one.
    fresh: Lane,
    /// Flag: the last step was damped.
    damped: Lane,
    /// Damping of the last Jacobian.
    damping: Lane,
}

/// A step by the Jacobian alone.
struct Straight<const M: usize> {
    /// What is left to do, in metres, and its square.
    error: [Lane; M],
    norm: Lane,
    /// Squared length of the step in units.
    length: Lane,
    /// What it brings beside its straight line, in metres.
    bent: [Lane; M],
}

const NO: Lane = Lane::ZERO;
const YES: Lane = Lane::splat(1.0);

/// Moves `search.best` to the target; gives what is left.
#[inline(always)]
pub(crate) fn toward<I: Isa>(
    aimed: &Aimed,
    plan: &Plan,
    target: &LaneFrame,
    alone: bool,
    search: &mut Search,
) -> Left {
    let to = To { aimed, plan, target, alone };
    match plan.task {
        Task::Pose => to.meet::<I, PoseGoal, 6>(search),
        Task::Axis => to.meet::<I, AxisGoal, 5>(search),
        Task::Position => to.meet::<I, PositionGoal, 3>(search),
    }
}

/// What is searched for.
#[derive(Clone, Copy)]
struct To<'a> {
    aimed: &'a Aimed,
    plan: &'a Plan,
    target: &'a LaneFrame,
    alone: bool,
}

impl To<'_> {
    /// The task's rows; then, where they cannot all be met, the position from there once more and alone.
    #[inline(always)]
    fn meet<I: Isa, G: Goal<M>, const M: usize>(self, search: &mut Search) -> Left {
        let [mut position, turn] = I::call(Approach::<G, M> { to: self, search, goal: PhantomData });
        let Self { aimed, plan, target, alone } = self;
        if plan.meets_all() {
            return Left { position, turn, aside: NO };
        }
        if plan.position_first() {
            [position, _] = I::call(Approach::<PositionGoal, 3> { to: self, search, goal: PhantomData });
        }
        let frame = aimed.end::<I>(&search.best, alone, &mut search.model);
        let turn = squared::<I>(&G::error::<I>(&frame, target)[3..]).sqrt();
        Left { position, turn, aside: plan.aside::<I>(&shift(&frame, target)) }
    }
}

/// A search for a goal: moves `search.best` there; its output is what is left of position (m) and orientation (rad).
struct Approach<'a, G, const M: usize> {
    to: To<'a>,
    search: &'a mut Search,
    goal: PhantomData<G>,
}

impl<G: Goal<M>, const M: usize> Kernel for Approach<'_, G, M> {
    type Output = [Lane; 2];

    #[inline(always)]
    fn run<I: Isa>(self) -> [Lane; 2] {
        let Self { to: To { aimed, plan, target, alone }, search, .. } = self;
        let mut progress = Progress::new();
        let mut factor = None;
        search.trial.copy_from_slice(&search.best);
        for step in 0..=plan.steps {
            let stale = progress.any_stale();
            let frame = if stale {
                aimed.sweep::<I>(&search.trial, alone, &mut search.model)
            } else {
                aimed.end::<I>(&search.trial, alone, &mut search.model)
            };
            let error = plan.weigh::<I, M>(G::error::<I>(&frame, target));
            let norm = progress.take::<I, M>(&error, plan, search);
            if step == plan.steps || !progress.any_open() {
                break;
            }
            if stale {
                fill_columns::<I, G, M>(aimed, plan, &frame, progress.stale, search);
                let (joints, model) = (aimed.chain.joint_count(), &search.model);
                search.bend.take(&model.screws[..joints], &model.inputs[..joints], progress.stale);
                factor = Some(progress.factor::<I, M>(plan, search));
            }
            // Every search begins without a Jacobian.
            let Some(factor) = &mut factor else { break };
            let length = step_for::<I, M>(plan, &factor.solve::<I>(&error), search);
            let straight =
                Straight { error, norm, length, bent: search.bent::<I, G, M>(aimed, plan, &frame) };
            progress.find_step::<I, M>(plan, factor, straight, search);
            search.advance(plan, &progress);
            progress.foresee(norm, plan, search);
            if !progress.any_open() {
                break;
            }
            progress.settle();
        }
        [progress.left[0].sqrt(), progress.left[1].sqrt() * (1.0 / plan.turn_weight)]
    }
}

impl Progress {
    #[inline(always)]
    fn new() -> Self {
        let infinite = Lane::splat(f64::INFINITY);
        Self {
            least: infinite,
            length: infinite,
            left: [infinite; 2],
            rate: NO,
            rate_before: NO,
            behind: infinite,
            open: YES,
            better: NO,
            stale: YES,
            fresh: NO,
            damped: NO,
            damping: Lane::splat(FLOOR),
        }
    }

    #[inline(always)]
    fn any_open(&self) -> bool {
        NO.any_below(self.open)
    }

    #[inline(always)]
    fn any_stale(&self) -> bool {
        NO.any_below(self.stale * self.open)
    }

    /// Takes over the trials that are better than what was found before; gives the squared errors.
    #[inline(always)]
    fn take<I: Isa, const M: usize>(&mut self, error: &[Lane; M], plan: &Plan, search: &mut Search) -> Lane {
        let before = self.least;
        let infinite = Lane::splat(f64::INFINITY);
        let norm = NO.where_below(self.open, squared::<I>(error), infinite);
        (self.rate_before, self.behind) = (self.rate, self.length);
        self.rate = before.where_below(infinite, norm / before, NO);
        let left = [squared::<I>(&error[..3]), squared::<I>(&error[3..])];
        for (kept, found) in self.left.iter_mut().zip(left) {
            *kept = norm.where_below(before, found, *kept);
        }
        for (best, trial) in search.best.iter_mut().zip(&search.trial) {
            *best = norm.where_below(before, *trial, *best);
        }
        self.least = norm.where_below(before, norm, before);
        self.better = norm.where_below(before, YES, NO);
        let far = Lane::splat(plan.enough() * plan.enough()).where_below(self.least, self.open, NO);
        let far = Lane::splat(STANDSTILL * STANDSTILL).where_below(self.length, far, NO);
        let slow = Lane::splat(plan.hopeless * plan.hopeless).where_below(self.rate, self.better, NO);
        let slow = NO.where_below(self.fresh, slow, NO);
        self.open = NO.where_below(slow, NO, far);
        norm
    }

    /// Takes the floor for the damping of new Jacobians; factors all.
    #[inline(always)]
    fn factor<I: Isa, const M: usize>(&mut self, plan: &Plan, search: &Search) -> Factor<M> {
        self.damping = NO.where_below(self.stale, Lane::splat(FLOOR), self.damping);
        Factor::new::<I>(&gram::<I, M>(&search.columns[..plan.moving.len()]), self.damping)
    }

    /// Writes the next step in units: where it would be too long damped, else with how it bends.
    #[inline(always)]
    fn find_step<I: Isa, const M: usize>(
        &mut self,
        plan: &Plan,
        factor: &mut Factor<M>,
        straight: Straight<M>,
        search: &mut Search,
    ) {
        let longest = Lane::splat(plan.longest * plan.longest);
        let Straight { error, norm, length, bent } = straight;
        self.damped = longest.where_below(length, YES, NO);
        if NO.any_below(self.damped) {
            let damping = Lane::splat(FLOOR) + norm * (0.25 / (plan.longest * plan.longest));
            self.damping = NO.where_below(self.damped, damping, self.damping);
            let columns = &search.columns[..plan.moving.len()];
            I::call(Damp { columns, damping: self.damping, factor });
        }
        let slight = squared::<I>(&bent).where_below(norm * (SLIGHT * SLIGHT), YES, NO);
        let mut bends = NO.where_below(self.damped, NO, slight);
        // Near a singular configuration little of the error may ask for much of the joints: such steps stay straight.
        let longer = length * ((1.0 + SLIGHT) * (1.0 + SLIGHT));
        loop {
            let mut rest = error;
            for (rest, bent) in rest.iter_mut().zip(&bent) {
                *rest = NO.where_below(bends, *rest - *bent, *rest);
            }
            self.length = step_for::<I, M>(plan, &factor.solve::<I>(&rest), search);
            let jumps = longer.where_below(self.length, bends, NO);
            if !NO.any_below(jumps) {
                break;
            }
            bends = NO.where_below(jumps, NO, bends);
        }
    }

    /// Takes over the next trials where they will be near enough, and ends their searches.
    ///
    /// Where the parameters vary errors fall by turns more and less: the lesser of the last two falls counts. Where they do not, a
    /// Jacobian that is kept is off by about the angle of the step behind it, and errors fall no faster than that.
    #[inline(always)]
    fn foresee(&mut self, norm: Lane, plan: &Plan, search: &mut Search) {
        let least = if plan.varied { self.rate_before } else { self.behind };
        let rate = self.rate.where_below(least, least, self.rate);
        let enough = Lane::splat(plan.foreseen * plan.foreseen);
        let near = (norm * rate).where_below(enough, self.open, NO);
        let near = rate.where_below(Lane::splat(STEADY * STEADY), near, NO);
        let near = self.length.where_below(Lane::splat(NEAR * NEAR), near, NO);
        let near = NO.where_below(self.rate, near, NO);
        for (best, trial) in search.best.iter_mut().zip(&search.trial) {
            *best = NO.where_below(near, *trial, *best);
        }
        for left in &mut self.left {
            *left = NO.where_below(near, *left * rate, *left);
        }
        self.open = NO.where_below(near, NO, self.open);
    }

    /// Which poses need a Jacobian at their next trial: those with a long or damped step, and those whose errors do not fall
    /// fast.
    #[inline(always)]
    fn settle(&mut self) {
        let far = Lane::splat(SHORT * SHORT).where_below(self.length, YES, NO);
        let far = Lane::splat(STEADY * STEADY).where_below(self.rate, YES, far);
        let far = NO.where_below(self.damped, YES, far);
        self.fresh = self.stale;
        self.stale = NO.where_below(self.better, far, YES);
    }
}

#[inline(always)]
fn squared<I: Isa>(values: &[Lane]) -> Lane {
    dot::<I>(values, values)
}

/// Takes the columns of the stale poses.
#[inline(always)]
fn fill_columns<I: Isa, G: Goal<M>, const M: usize>(
    aimed: &Aimed,
    plan: &Plan,
    frame: &LaneFrame,
    stale: Lane,
    search: &mut Search,
) {
    let moving = plan.moving.iter().zip(&plan.unit);
    let screws = &search.model.screws[..aimed.chain.joint_count()];
    for (column, (&k, &unit)) in search.columns.iter_mut().zip(moving) {
        let screw = aimed.model.coupling.screw::<I>(screws, k);
        let rows = plan.weigh::<I, M>(G::column::<I>(&screw, frame));
        for (value, row) in column.iter_mut().zip(rows) {
            *value = NO.where_below(stale, row * unit, *value);
        }
    }
}

/// The columns of a pose at `search.best`, see [`fill_columns`].
#[inline(always)]
pub(crate) fn fill_pose_columns<I: Isa>(aimed: &Aimed, plan: &Plan, alone: bool, search: &mut Search) {
    let frame = aimed.sweep::<I>(&search.best, alone, &mut search.model);
    fill_columns::<I, PoseGoal, 6>(aimed, plan, &frame, YES, search);
}

/// J^T y, the next step; gives its squared length.
#[inline(always)]
fn step_for<I: Isa, const M: usize>(plan: &Plan, y: &[Lane; M], search: &mut Search) -> Lane {
    let mut length = NO;
    for (step, column) in search.step.iter_mut().zip(&search.columns).take(plan.moving.len()) {
        let mut sum = NO;
        for (value, row) in column.iter().zip(y) {
            sum = I::mul_add(*value, *row, sum);
        }
        *step = sum;
        length = I::mul_add(sum, sum, length);
    }
    length
}

#[inline(always)]
fn dot<I: Isa>(u: &[Lane], v: &[Lane]) -> Lane {
    let mut sum = NO;
    for (u, v) in u.iter().zip(v) {
        sum = I::mul_add(*u, *v, sum);
    }
    sum
}

/// Factors anew with other damping: rare, and so kept out of the way of what is not.
struct Damp<'a, const M: usize> {
    columns: &'a [[Lane; 6]],
    damping: Lane,
    factor: &'a mut Factor<M>,
}

impl<const M: usize> Kernel for Damp<'_, M> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self) {
        *self.factor = Factor::new::<I>(&gram::<I, M>(self.columns), self.damping);
    }
}

impl Search {
    /// What the step brings to the task's rows beside its straight line, in metres.
    #[inline(always)]
    fn bent<I: Isa, G: Goal<M>, const M: usize>(
        &mut self,
        aimed: &Aimed,
        plan: &Plan,
        frame: &LaneFrame,
    ) -> [Lane; M] {
        self.shifts.fill(NO);
        for ((&k, &unit), step) in plan.moving.iter().zip(&plan.unit).zip(&self.step) {
            self.shifts[k] = *step * unit;
        }
        aimed.model.coupling.joints::<I>(&self.shifts, &mut self.turns);
        let bent = self.bend.along::<I>(&self.model.inputs, &self.turns);
        plan.weigh::<I, M>(G::bent::<I>(&bent, frame))
    }

    /// The next trials: a step on from those that were better, half the way back from the others.
    #[inline(always)]
    fn advance(&mut self, plan: &Plan, progress: &Progress) {
        for ((&k, &unit), step) in plan.moving.iter().zip(&plan.unit).zip(&self.step) {
            let best = self.best[k];
            let back = (self.trial[k] + best) * 0.5;
            let next = NO.where_below(progress.better, best + *step * unit, back);
            self.trial[k] = NO.where_below(progress.open, next, best);
        }
    }
}
