//! How a search goes, and what of its task the arm can meet.

use truearm_kinematics::{ANGLE_ARM, Chain, Isa, Lane, Parameters, norm};

use crate::error::CompensateError;
use crate::model::Model;
use crate::task::{Task, dot};

/// Error at which the search ends, m: a few roundings of a pose.
const ENOUGH: f64 = 1e-13;
/// The same where the parameters vary, which each step leaves a thousandth of the error for, or less.
const ENOUGH_VARIED: f64 = 1e-10;
/// With fewer joints than the task has numbers, turns weigh so much less that the position is met first, and no joint turns
/// far for what little of the orientation it would mend.
const POSITION_FIRST: f64 = 1e-4;

/// Off parallel, or off square, by less than this axes count as such, rad.
const PARALLEL: f64 = 1e-3;

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
    /// Normal of the planes that the arm moves in, base frame, where it cannot leave them.
    pub normal: Option<[f64; 3]>,
    /// Whether the model's parameters vary with the joints.
    pub varied: bool,
    /// Steps at most.
    pub steps: usize,
    /// Longest step, rad.
    pub longest: f64,
    /// Rate from which on errors fall too slowly to go on.
    pub hopeless: f64,
    /// Foreseen error at which the search ends without another look, m.
    pub foreseen: f64,
}

impl Plan {
    pub(crate) fn new(
        model: &Model,
        task: Task,
        moving: Option<&[usize]>,
        steps: usize,
        longest: f64,
    ) -> Result<Plan, CompensateError> {
        let joints = model.joint_count();
        let moving = moving.map_or_else(|| (0..joints).collect(), <[usize]>::to_vec);
        let known = moving.last().is_some_and(|last| *last < joints);
        if !known || !moving.is_sorted_by(|a, b| a < b) {
            return Err(CompensateError::Moving { moving, joints });
        }
        let unit = |k: &usize| if model.chain.slides(*k) { ANGLE_ARM } else { 1.0 };
        let normal = plane_normal(&model.chain)?;
        // The last of five axes mostly is that of the tool, and then moves nothing that an axis task asks for.
        let few = moving.len() < task.rows() || joints < Task::Pose.rows() || normal.is_some();
        let position_first = task != Task::Position && few;
        let turn_weight = if position_first { ANGLE_ARM * POSITION_FIRST } else { ANGLE_ARM };
        let unit = moving.iter().map(unit).collect();
        let (varied, hopeless, foreseen) = (model.field.is_some(), f64::INFINITY, 0.0);
        Ok(Plan { task, moving, unit, turn_weight, normal, varied, steps, longest, hopeless, foreseen })
    }

    /// Error at which the search ends, m.
    pub fn enough(&self) -> f64 {
        if self.varied { ENOUGH_VARIED } else { ENOUGH }
    }

    /// Whether the position is met first: joints are too few for all of the task, or move in planes.
    pub fn position_first(&self) -> bool {
        self.turn_weight < ANGLE_ARM
    }

    /// Whether the arm can meet all of the task.
    pub fn meets_all(&self) -> bool {
        !self.position_first() && self.normal.is_none()
    }

    /// Rows of the task, all of them in metres; what leads out of the planes that the arm moves in counts nothing.
    ///
    /// The real arm's axes are off parallel by a little: without that joints would turn far for it.
    #[inline(always)]
    pub fn weigh<I: Isa, const M: usize>(&self, mut rows: [Lane; M]) -> [Lane; M] {
        for value in rows.iter_mut().skip(3) {
            *value = *value * self.turn_weight;
        }
        if let Some(normal) = &self.normal {
            let normal = normal.map(Lane::splat);
            let off = dot::<I>(&[rows[0], rows[1], rows[2]], &normal);
            for (row, part) in rows.iter_mut().zip(normal) {
                *row = I::mul_add(-off, part, *row);
            }
        }
        rows
    }

    /// How far a shift leads out of the planes that the arm moves in, m.
    #[inline(always)]
    pub fn aside<I: Isa>(&self, shift: &[Lane; 3]) -> Lane {
        let Some(normal) = &self.normal else { return Lane::ZERO };
        let off = dot::<I>(shift, &normal.map(Lane::splat));
        (off * off).sqrt()
    }
}

/// What a search leaves of its task.
pub(crate) struct Left {
    /// Of the position, as far as the arm can move it, m.
    pub position: Lane,
    /// Of the orientation, rad.
    pub turn: Lane,
    /// Of the position off the planes that the arm moves in, m.
    pub aside: Lane,
}

impl Left {
    /// How far pose `i` is from its target, m.
    pub fn distance(&self, i: usize) -> f64 {
        let (position, aside) = (self.position.0[i], self.aside.0[i]);
        if aside > 0.0 { position.hypot(aside) } else { position }
    }
}

/// Normal of the planes that an arm moves in by its nominal table, in the base frame: its axes are parallel, and what
/// slides does so across them. None where it leaves such planes.
fn plane_normal(chain: &Chain) -> Result<Option<[f64; 3]>, CompensateError> {
    let count = chain.joint_count();
    let (readings, nominal) = (vec![0.0; count], chain.nominal());
    let mut motions = vec![0.0; 6 * count];
    chain.joint_pose_jacobian(&readings, Parameters::One(&nominal), &mut motions)?;
    let motion = |row: usize, joint: usize| -> [f64; 3] {
        std::array::from_fn(|k| motions[(row + k) * count + joint])
    };
    let Some(first) = (0..count).find(|joint| !chain.slides(*joint)) else { return Ok(None) };
    let normal = motion(3, first);
    let stays = |joint: usize| {
        let way = if chain.slides(joint) { motion(0, joint) } else { motion(3, joint) };
        let cosine: f64 = way.iter().zip(&normal).map(|(a, b)| a * b).sum();
        if chain.slides(joint) {
            cosine.abs() < PARALLEL
        } else {
            norm(std::array::from_fn(|k| way[k] - cosine * normal[k])) < PARALLEL
        }
    };
    Ok((0..count).all(stays).then_some(normal))
}
