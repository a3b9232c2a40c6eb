//! The `sag` block: each joint gives way in proportion to what it carries.
//!
//! A joint with stiffness s under the weights w_k of the links behind it turns by `sum_k w_k g_jk / s`, where g_jk is the
//! derivative by joint j of the height at which link k ends: the lever of that weight. Weights and stiffness are not
//! known apart: the block has one number for each pair of joints, rad for each metre of lever. Levers are those of the
//! nominal arm, and up is the z axis of the base unless another direction is given.

use truearm_kinematics::{
    Chain, Isa, Kernel, KinematicsError, Lane, LaneParameters, LeverScratch, OnePose, SharedParameters,
    dispatch, lever_count,
};

use crate::bank::Block;
use crate::cells::Grid;

/// Name of the block.
pub const SAG_NAME: &str = "sag";

/// Up, in the base frame of an arm that stands.
pub const UPRIGHT: [f64; 3] = [0.0, 0.0, 1.0];

/// The levers of an arm.
#[derive(Debug, Clone, PartialEq)]
pub struct Levers {
    arm: Chain,
    /// The arm in a base frame whose z axis is up.
    chain: Chain,
    nominal: SharedParameters,
    up: [f64; 3],
}

/// Weights of the block.
#[derive(Debug, Clone, PartialEq)]
pub struct Sag {
    /// The arm's levers, L.
    pub levers: Levers,
    /// Parameter that each lever drives, (L,): 5 * link + (theta, d).
    pub outputs: Vec<usize>,
    /// Its weight, (L,): rad/m, m/m where the joint slides.
    pub weights: Vec<f64>,
}

/// What levers are worked out in.
#[derive(Debug, Clone)]
pub struct SagScratch {
    joints: Vec<Lane>,
    loads: Vec<Lane>,
    frames: LeverScratch,
    one: OnePose,
}

/// A sag prepared for evaluation.
#[derive(Debug, Clone, PartialEq)]
pub struct Loads {
    levers: Levers,
    /// Parameter that each joint's loads drive, (J,).
    pub outputs: Vec<usize>,
    /// Of each lever its weight and those of the same joint behind it, (L,).
    heights: Vec<f64>,
}

impl Sag {
    /// How it is stored: as a block over all joints without cells.
    pub fn stored(&self) -> Block {
        Block {
            name: SAG_NAME.to_owned(),
            grid: Grid { inputs: (0..self.levers.joint_count()).collect(), axes: Vec::new() },
            outputs: self.outputs.clone(),
            weights: self.weights.clone(),
        }
    }
}

impl Levers {
    /// Of an arm as it was meant to be, standing upright.
    pub fn new(chain: &Chain) -> Self {
        let nominal = SharedParameters::new(&chain.nominal());
        Self { nominal, arm: chain.clone(), chain: chain.clone(), up: UPRIGHT }
    }

    /// Of the same arm, where `up` is a direction in its base frame.
    ///
    /// # Errors
    /// [`KinematicsError::NoDirection`].
    pub fn along(self, up: [f64; 3]) -> Result<Self, KinematicsError> {
        Ok(Self { chain: self.arm.with_up(up)?, up, ..self })
    }

    /// The direction, in the base frame, that heights are measured along.
    pub fn up(&self) -> [f64; 3] {
        self.up
    }

    /// Number of joints, N.
    pub fn joint_count(&self) -> usize {
        self.chain.joint_count()
    }

    /// Number of levers, L: for each joint those of all links from its own on.
    pub fn len(&self) -> usize {
        lever_count(self.joint_count())
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Joint of each lever, (L,).
    pub fn joints(&self) -> impl Iterator<Item = usize> {
        let count = self.joint_count();
        (0..count).flat_map(move |j| std::iter::repeat_n(j, count - j))
    }

    /// Levers of one configuration, given its N joint values; what follows them is not looked at.
    pub fn at(&self, values: &[f64]) -> Vec<f64> {
        let mut scratch = self.scratch();
        for (lane, value) in scratch.joints.iter_mut().zip(values) {
            *lane = Lane::splat(*value);
        }
        let mut out = vec![Lane::ZERO; self.len()];
        dispatch(At { levers: self, scratch: &mut scratch, out: &mut out });
        out.iter().map(|lane| lane.0[0]).collect()
    }

    /// Room for a group of configurations.
    pub fn scratch(&self) -> SagScratch {
        let lanes = vec![Lane::ZERO; self.joint_count()];
        SagScratch {
            joints: lanes.clone(),
            loads: lanes,
            frames: LeverScratch::new(&self.chain),
            one: OnePose::new(&self.nominal),
        }
    }
}

struct At<'a> {
    levers: &'a Levers,
    scratch: &'a mut SagScratch,
    out: &'a mut [Lane],
}

impl Kernel for At<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self) {
        let Levers { chain, nominal, .. } = self.levers;
        let SagScratch { joints, frames, .. } = self.scratch;
        chain.levers::<I>(joints, LaneParameters::Shared(nominal), frames, self.out);
    }
}

/// For each of `joints` the sum of the products of its levers in two configurations: how alike its loads are.
pub fn alike(joints: usize, a: &[f64], b: &[f64], out: &mut [f64]) {
    let mut pairs = a.iter().zip(b);
    for (j, sum) in out.iter_mut().enumerate().take(joints) {
        *sum = pairs.by_ref().take(joints - j).map(|(x, y)| x * y).sum();
    }
}

impl Loads {
    /// Of a sag.
    pub fn new(sag: &Sag) -> Self {
        let joints = sag.levers.joint_count();
        let (mut heights, mut outputs, mut at) = (sag.weights.clone(), Vec::new(), 0);
        for own in (1..=joints).rev() {
            for k in (at..at + own - 1).rev() {
                heights[k] += heights[k + 1];
            }
            outputs.push(sag.outputs[at]);
            at += own;
        }
        Self { levers: sag.levers.clone(), outputs, heights }
    }

    /// Room for a group of configurations.
    pub fn scratch(&self) -> SagScratch {
        self.levers.scratch()
    }

    /// What the loads add to the outputs, for up to 8 poses whose inputs `input` gives.
    #[inline(always)]
    pub fn at<'a, I: Isa>(
        &self,
        input: impl Fn(usize) -> Lane,
        alone: bool,
        scratch: &'a mut SagScratch,
    ) -> &'a [Lane] {
        let SagScratch { joints, loads, frames, one } = scratch;
        for (k, lane) in joints.iter_mut().enumerate() {
            *lane = input(k);
        }
        let Levers { chain, nominal, .. } = &self.levers;
        let parameters = if alone {
            one.move_to::<I>(chain, joints);
            LaneParameters::One(one)
        } else {
            LaneParameters::Shared(nominal)
        };
        chain.loads::<I>(joints, parameters, &self.heights, frames, loads);
        loads
    }
}
