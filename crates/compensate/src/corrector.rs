//! The corrected joints of one waypoint.

use std::sync::Arc;

use truearm_kinematics::{Isa, Kernel, Lane, LaneFrame, Transform, dispatch, lane_room, norm};

use crate::aimed::{Aimed, AimedScratch};
use crate::error::CompensateError;
use crate::limits::Limits;
use crate::model::Model;
use crate::newton::{Search, toward};
use crate::plan::{Left, Plan};
use crate::refusal::{Reason, Refusal};
use crate::task::{Task, shift};
use crate::turn::{axis_turn, turn};

/// Steps at most: two or three do for a model that is smooth over the correction, a field takes one or two more.
const STEPS: usize = 8;
/// Longest step where joint corrections have a wide bound or none, rad.
const LONGEST_STEP: f64 = 0.5;
/// Longest step where they have a tight one: enough to find out what they would have to be.
const SHORT_STEP: f64 = 0.05;
/// Errors that fall by less than a thousandth with each step are all but the same after the last one.
const HOPELESS: f64 = 0.999;
/// Errors of a field fall less steadily: so much less has to be foreseen for a search to end.
const UNSTEADY: f64 = 0.1;
/// Those of constant parameters fall by what the last step tells: still below 1e-12 m, with so much more foreseen.
const STEADILY: f64 = 5.0;

/// What is corrected, and how far.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Options {
    /// What is to be met.
    pub task: Task,
    /// Joints that may change, from 0, ascending; None: all. More than needed: the smallest change.
    pub moving: Option<Vec<usize>>,
    /// Bounds.
    pub limits: Limits,
}

/// The correction of one waypoint.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Correction {
    /// How far from its target the calibrated model puts the tool, m.
    pub residual_m: f64,
    /// How far it is turned from it, rad.
    pub residual_rad: f64,
    /// Where the programming model puts the tool at the corrected readings, minus its target: base frame, m.
    pub shift: [f64; 3],
    /// The turn between these two as a rotation vector in the base frame, rad; of the tool's axis alone where the task is
    /// that.
    pub turn: [f64; 3],
    /// Standard deviation of the tool's position, m; NaN where the model does not know it, or nobody asks.
    pub std_m: f64,
    /// Why it must not be used.
    pub refusal: Option<Refusal>,
}

/// Finds readings for which the calibrated model puts the tool where the programming model puts it.
///
/// Readings q^c with `calibrated(q^c) = programming(q^n)`, equation (3) of the paper carried to convergence. It is
/// immutable: threads share it, each with a [`Workspace`] of its own.
#[derive(Debug, Clone)]
pub struct Corrector {
    pub(crate) calibrated: Aimed,
    pub(crate) programming: Aimed,
    pub(crate) options: Options,
    pub(crate) plan: Plan,
}

/// All memory that corrections need; one for each thread.
#[derive(Debug, Clone)]
pub struct Workspace {
    /// Readings of the program, N.
    pub(crate) nominal: Vec<Lane>,
    pub(crate) search: Search,
    programming: AimedScratch,
}

/// What was found for eight waypoints; the readings are in `search.best`.
pub(crate) struct Group {
    pub target: LaneFrame,
    pub left: Left,
    pub shift: [Lane; 3],
    pub turn: [Lane; 3],
    pub std: Lane,
}

impl Corrector {
    /// A corrector for a tool.
    ///
    /// # Errors
    /// [`CompensateError`] if the models have different joints, the programming one varies with features, the tool is no
    /// rigid motion, or an option breaks a rule.
    pub fn new(
        calibrated: Arc<Model>,
        programming: Arc<Model>,
        flange_from_tool: &Transform,
        options: Options,
    ) -> Result<Corrector, CompensateError> {
        let joints = calibrated.joint_count();
        if programming.joint_count() != joints {
            let programming = programming.joint_count();
            return Err(CompensateError::Joints { programming, calibrated: joints });
        }
        if programming.feature_count() > 0 {
            let found = programming.feature_count();
            return Err(CompensateError::Length {
                what: "the programming model's features",
                found,
                expected: 0,
            });
        }
        options.limits.check(joints)?;
        let plan = plan(&calibrated, &options)?;
        let calibrated = Aimed::new(calibrated, flange_from_tool)?;
        let programming = Aimed::new(programming, flange_from_tool)?;
        Ok(Corrector { calibrated, programming, options, plan })
    }

    /// Number of joints, N.
    pub fn joint_count(&self) -> usize {
        self.calibrated.chain.joint_count()
    }

    /// Number of features of the calibrated model, F.
    pub fn feature_count(&self) -> usize {
        self.calibrated.model.feature_count()
    }

    /// Memory for one thread.
    pub fn workspace(&self) -> Workspace {
        Workspace {
            nominal: vec![Lane::ZERO; lane_room(self.joint_count())],
            search: Search::new(&self.calibrated),
            programming: self.programming.scratch(),
        }
    }

    /// The corrected readings of one waypoint, without allocation, lock or panic.
    ///
    /// `readings` (N) and `features` (F) in, `out` (N); where the waypoint is refused, `out` is filled with NaN. Arrays
    /// of other lengths are refused as not finite. Unless `spread` is asked for, the standard deviation is worked out
    /// where a bound needs it alone, and else NaN.
    pub fn correct(
        &self,
        readings: &[f64],
        features: &[f64],
        spread: bool,
        out: &mut [f64],
        workspace: &mut Workspace,
    ) -> Correction {
        if out.len() != self.joint_count() || self.enter(readings, features, workspace).is_none() {
            out.fill(f64::NAN);
            return Correction::refused(Refusal::plain(Reason::NotFinite));
        }
        let spread = spread || self.options.limits.largest_std.is_finite();
        let group = dispatch(One { corrector: self, spread, workspace });
        let correction = self.judge(&group, workspace, 0);
        self.write(&correction, workspace, 0, out);
        correction
    }

    /// Where the calibrated model puts the tool, base_from_tool, without allocation, lock or panic.
    ///
    /// None where a number is not finite, or so large that the result is not, or an array does not fit.
    pub fn predict(
        &self,
        readings: &[f64],
        features: &[f64],
        workspace: &mut Workspace,
    ) -> Option<Transform> {
        self.enter(readings, features, workspace)?;
        let frame = dispatch(Predict { corrector: self, workspace });
        let pose = frame.pose(0);
        let finite = pose.rotation.iter().chain(&pose.translation).all(|value| value.is_finite());
        finite.then_some(pose)
    }

    /// Puts one waypoint into all lanes, if it can be used.
    fn enter(&self, readings: &[f64], features: &[f64], workspace: &mut Workspace) -> Option<()> {
        let fits = readings.len() == self.joint_count() && features.len() == self.feature_count();
        if !fits || !readings.iter().chain(features).all(|value| value.is_finite()) {
            return None;
        }
        for (lane, value) in workspace.nominal.iter_mut().zip(readings) {
            *lane = Lane::splat(*value);
        }
        workspace.search.model.set_features(self.joint_count(), features);
        Some(())
    }

    /// Corrects the waypoints in `workspace.nominal`; `alone`: there is one.
    #[inline(always)]
    pub(crate) fn group<I: Isa>(&self, alone: bool, spread: bool, workspace: &mut Workspace) -> Group {
        let Workspace { nominal, search, programming } = workspace;
        let nominal = &nominal[..self.joint_count()];
        let target = self.programming.end::<I>(nominal, alone, programming);
        search.best.copy_from_slice(nominal);
        let left = toward::<I>(&self.calibrated, &self.plan, &target, alone, search);
        let reached = self.programming.end::<I>(&search.best, alone, programming);
        // A closure would be compiled without the instruction set of this function.
        let std = match &self.calibrated.model.spread {
            Some(known) if spread => known.at::<I>(&self.calibrated, &search.best, alone, &mut search.model),
            _ => Lane::splat(f64::NAN),
        };
        let turned = if self.plan.task == Task::Axis {
            axis_turn::<I>(&target, &reached)
        } else {
            turn::<I>(&target, &reached)
        };
        Group { left, shift: shift(&target, &reached), turn: turned, std, target }
    }

    /// What waypoint `i` of a group found, and whether that may be used.
    pub(crate) fn judge(&self, group: &Group, workspace: &Workspace, i: usize) -> Correction {
        let pick = |lanes: &[Lane; 3]| [lanes[0].0[i], lanes[1].0[i], lanes[2].0[i]];
        let mut correction = Correction {
            residual_m: group.left.distance(i),
            residual_rad: group.left.turn.0[i],
            shift: pick(&group.shift),
            turn: pick(&group.turn),
            std_m: group.std.0[i],
            refusal: None,
        };
        correction.refusal = self.refuse(&correction, &group.left, workspace, i);
        correction
    }

    fn refuse(&self, found: &Correction, left: &Left, workspace: &Workspace, i: usize) -> Option<Refusal> {
        let limits = &self.options.limits;
        let std = if limits.largest_std.is_finite() { found.std_m } else { 0.0 };
        limits
            .refuse_reading(&self.calibrated.chain, true, |joint| workspace.nominal[joint].0[i])
            .or_else(|| limits.refuse_residual(&self.plan, left, i))
            .or_else(|| self.refuse_joint(workspace, i))
            .or_else(|| Refusal::above(Reason::Shift, norm(found.shift), limits.largest_shift))
            .or_else(|| Refusal::above(Reason::Turn, norm(found.turn), limits.largest_turn))
            .or_else(|| Refusal::above(Reason::Spread, std, limits.largest_std))
    }

    fn refuse_joint(&self, workspace: &Workspace, i: usize) -> Option<Refusal> {
        let limits = &self.options.limits;
        for (joint, (from, to)) in workspace.nominal.iter().zip(&workspace.search.best).enumerate() {
            let (from, to) = (from.0[i], to.0[i]);
            let slides = self.calibrated.chain.slides(joint);
            let largest = limits.largest_correction(slides);
            let value = (to - from).abs();
            if value > largest {
                let reason = Reason::JointCorrection;
                return Some(Refusal { reason, joint: joint + 1, value, limit: largest, slides });
            }
        }
        limits.refuse_reading(&self.calibrated.chain, false, |joint| workspace.search.best[joint].0[i])
    }
}

impl Correction {
    pub(crate) fn refused(refusal: Refusal) -> Self {
        let nothing = [f64::NAN; 3];
        Self {
            residual_m: f64::NAN,
            residual_rad: f64::NAN,
            shift: nothing,
            turn: nothing,
            std_m: f64::NAN,
            refusal: Some(refusal),
        }
    }
}

/// How corrections of a model are searched for.
fn plan(model: &Model, options: &Options) -> Result<Plan, CompensateError> {
    let limits = &options.limits;
    let longest = limits.largest_angle.clamp(SHORT_STEP, LONGEST_STEP);
    let plan = Plan::new(model, options.task, options.moving.as_deref(), STEPS, longest)?;
    // The turn that five axes leave is no failure: its least value is searched for to the end.
    let hopeless = if plan.position_first() { plan.hopeless } else { HOPELESS };
    // Short steps would end on the way to a turn that can be met, and meet the position by turning the tool.
    let longest = if plan.position_first() { LONGEST_STEP } else { plan.longest };
    let foreseen = plan.enough() * if plan.varied { UNSTEADY } else { STEADILY };
    Ok(Plan { longest, hopeless, foreseen, ..plan })
}

struct One<'a> {
    corrector: &'a Corrector,
    spread: bool,
    workspace: &'a mut Workspace,
}

impl Kernel for One<'_> {
    type Output = Group;

    #[inline(always)]
    fn run<I: Isa>(self) -> Group {
        self.corrector.group::<I>(true, self.spread, self.workspace)
    }
}

struct Predict<'a> {
    corrector: &'a Corrector,
    workspace: &'a mut Workspace,
}

impl Kernel for Predict<'_> {
    type Output = LaneFrame;

    #[inline(always)]
    fn run<I: Isa>(self) -> LaneFrame {
        let Workspace { nominal, search, .. } = self.workspace;
        let aimed = &self.corrector.calibrated;
        aimed.end::<I>(&nominal[..aimed.chain.joint_count()], true, &mut search.model)
    }
}
