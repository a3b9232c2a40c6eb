//! The `sag` block: each joint gives way in proportion to what it carries.
//!
//! A joint with stiffness s under the weights w_k of the links behind it turns by `sum_k w_k g_jk / s`, where g_jk is the
//! derivative by joint j of the height at which link k ends: the lever of that weight. Weights and stiffness are not
//! known apart: the block has one number for each pair of joints, rad for each metre of lever. Levers are those of the
//! nominal arm, and up is the z axis of the base unless another direction is given.
//!
//! The centre of gravity of what hangs on the flange need not lie where a link ends: each joint has three numbers more, for
//! the levers of a typical link's length along the flange's axes.
//!
//! A payload is a weight that an input tells: it multiplies levers, which have weights of their own for it. That these follow
//! all links, not the last alone, lets the links bend.

use truearm_kinematics::{
    BESIDE, Chain, Isa, Kernel, KinematicsError, Lane, LaneParameters, LeverScratch, OnePose,
    SharedParameters, dispatch, lever_count,
};

use crate::bank::Block;
use crate::cells::Grid;

/// Name of the block.
pub const SAG_NAME: &str = "sag";

/// A typical link is no shorter, as the joints of a wrist alone would be.
const SHORTEST_M: f64 = 0.01;
/// A typical link is no longer, as those of a table with nearly parallel axes would be.
const LONGEST_M: f64 = 1.0;

/// Up, in the base frame of an arm that stands.
pub const UPRIGHT: [f64; 3] = [0.0, 0.0, 1.0];

/// The levers of an arm.
#[derive(Debug, Clone, PartialEq)]
pub struct Levers {
    arm: Chain,
    /// The arm in a base frame whose z axis is up.
    chain: Chain,
    nominal: SharedParameters,
    /// How far beside the end levers are taken, m.
    beside_m: f64,
    up: [f64; 3],
    payloads: Vec<Payload>,
}

/// An input that tells what the arm carries.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Payload {
    input: usize,
    /// Of this much a priori as much is expected as of a link.
    unit: f64,
}

/// Weights of the block.
#[derive(Debug, Clone, PartialEq)]
pub struct Sag {
    /// The arm's levers, L.
    pub levers: Levers,
    /// Parameter that each lever drives, (L,): 5 * link + (theta, d).
    pub outputs: Vec<usize>,
    /// Its weight, (L,): rad/m, m/m where the joint slides; those of a payload for each unit of its input.
    pub weights: Vec<f64>,
}

/// What levers are worked out in.
#[derive(Debug, Clone)]
pub struct SagScratch {
    joints: Vec<Lane>,
    loads: Vec<Lane>,
    /// The payloads.
    carried: Vec<Lane>,
    /// What one of them adds to the loads.
    added: Vec<Lane>,
    frames: LeverScratch,
    one: OnePose,
}

/// A sag prepared for evaluation.
#[derive(Debug, Clone, PartialEq)]
pub struct Loads {
    levers: Levers,
    /// Parameter that each joint's loads drive, (J,).
    pub outputs: Vec<usize>,
    /// Of each of the arm's levers its weight and those of the same joint's links behind it, (L,); of those beside the end
    /// their weights for each metre.
    heights: Vec<f64>,
    /// The same of each payload, with its input.
    payloads: Vec<(usize, Vec<f64>)>,
}

impl Sag {
    /// From stored values; those of files that know nothing beside the end have no weights there.
    pub fn restored(levers: Levers, outputs: Vec<usize>, weights: Vec<f64>) -> Self {
        let outputs = levers.with_beside(outputs, |output| output);
        let weights = levers.with_beside(weights, |_| 0.0);
        Self { levers, outputs, weights }
    }

    /// How it is stored: as a block over all joints and payloads without cells.
    pub fn stored(&self) -> Block {
        let payloads = self.levers.payloads.iter().map(|payload| payload.input);
        let inputs = (0..self.levers.joint_count()).chain(payloads).collect();
        Block {
            name: SAG_NAME.to_owned(),
            grid: Grid { inputs, axes: Vec::new() },
            outputs: self.outputs.clone(),
            weights: self.weights.clone(),
            reading: None,
        }
    }
}

impl Levers {
    /// Of an arm as it was meant to be, standing upright.
    pub fn new(chain: &Chain) -> Self {
        let nominal = SharedParameters::new(&chain.nominal());
        let beside_m = typical_length(chain);
        Self {
            nominal,
            arm: chain.clone(),
            chain: chain.clone(),
            beside_m,
            up: UPRIGHT,
            payloads: Vec::new(),
        }
    }

    /// The same with payloads: inputs, and of each how much is expected to bend the arm as a link does.
    pub fn carrying(self, payloads: impl IntoIterator<Item = (usize, f64)>) -> Self {
        let payload = |(input, unit)| Payload { input, unit };
        Self { payloads: payloads.into_iter().map(payload).collect(), ..self }
    }

    /// Weights of levers by these for levers by payloads in their inputs' own units.
    pub fn in_own_units(self, mut weights: Vec<f64>) -> (Self, Vec<f64>) {
        let own = lever_count(self.joint_count());
        for (payload, weights) in self.payloads.iter().zip(weights[own..].chunks_exact_mut(own)) {
            weights.iter_mut().for_each(|weight| *weight /= payload.unit);
        }
        let inputs: Vec<_> = self.payloads.iter().map(|payload| (payload.input, 1.0)).collect();
        (self.carrying(inputs), weights)
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

    /// Number of inputs that they need at least: the joints, and all up to the last payload.
    pub fn input_count(&self) -> usize {
        self.payloads.iter().map(|payload| payload.input + 1).fold(self.joint_count(), usize::max)
    }

    /// Number of levers, L: for each joint those of all links from its own on, and those beside the end; once for the arm,
    /// once for each payload.
    pub fn len(&self) -> usize {
        lever_count(self.joint_count()) * (1 + self.payloads.len())
    }

    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Joint of each lever, (L,).
    pub fn joints(&self) -> impl Iterator<Item = usize> {
        let count = self.joint_count();
        let own = move |_| (0..count).flat_map(move |j| std::iter::repeat_n(j, count - j + BESIDE));
        (0..=self.payloads.len()).flat_map(own)
    }

    /// The first of the arm's levers about each joint, and how many links it carries.
    fn first_levers(&self) -> impl Iterator<Item = (usize, usize)> {
        let joints = self.joint_count();
        (0..joints).map(move |j| (lever_count(joints) - lever_count(joints - j), joints - j))
    }

    /// The levers beside the end among the arm's, (L,): for each joint the last ones.
    fn beside(&self) -> impl Iterator<Item = usize> {
        self.first_levers().flat_map(|(first, links)| first + links..first + links + BESIDE)
    }

    /// Values of levers, (L,), where `values` may lack those beside the end: `beside` makes them from a joint's last one.
    fn with_beside<T: Copy>(&self, values: Vec<T>, beside: impl Fn(T) -> T) -> Vec<T> {
        let joints = self.joint_count();
        let own = lever_count(joints) - BESIDE * joints;
        if own == 0 || values.len() != own * (1 + self.payloads.len()) {
            return values;
        }
        let mut all = Vec::with_capacity(self.len());
        for mut left in values.chunks_exact(own) {
            for links in (1..=joints).rev() {
                let (of_joint, others) = left.split_at(links);
                all.extend_from_slice(of_joint);
                all.extend([beside(of_joint[links - 1]); BESIDE]);
                left = others;
            }
        }
        all
    }

    /// Levers of one configuration, (L,), given its inputs, (I,): those for a payload times that.
    pub fn at(&self, values: &[f64]) -> Vec<f64> {
        let mut scratch = self.scratch();
        for (lane, value) in scratch.joints.iter_mut().zip(values) {
            *lane = Lane::splat(*value);
        }
        let mut out = vec![Lane::ZERO; lever_count(self.joint_count())];
        dispatch(At { levers: self, scratch: &mut scratch, out: &mut out });
        for lever in self.beside() {
            out[lever] = out[lever] * self.beside_m;
        }
        let shares = self.payloads.iter().map(|payload| values[payload.input] / payload.unit);
        let share = |share: f64| out.iter().map(move |lane| share * lane.0[0]);
        std::iter::once(1.0).chain(shares).flat_map(share).collect()
    }

    /// Room for a group of configurations.
    pub fn scratch(&self) -> SagScratch {
        let lanes = vec![Lane::ZERO; self.joint_count()];
        SagScratch {
            joints: lanes.clone(),
            carried: vec![Lane::ZERO; self.payloads.len()],
            added: lanes.clone(),
            loads: lanes,
            frames: LeverScratch::new(&self.chain),
            one: OnePose::new(&self.nominal),
        }
    }
}

/// Mean length of the links of an arm, m, as far as it is one of a link.
fn typical_length(chain: &Chain) -> f64 {
    let lengths = chain.links().iter().map(|link| link.a.hypot(link.d));
    (lengths.sum::<f64>() / chain.links().len().max(1) as f64).clamp(SHORTEST_M, LONGEST_M)
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
    let own = lever_count(joints);
    out.fill(0.0);
    for (a, b) in a.chunks_exact(own).zip(b.chunks_exact(own)) {
        let mut pairs = a.iter().zip(b);
        for (j, sum) in out.iter_mut().enumerate().take(joints) {
            *sum += pairs.by_ref().take(joints - j + BESIDE).map(|(x, y)| x * y).sum::<f64>();
        }
    }
}

impl Loads {
    /// Of a sag.
    pub fn new(sag: &Sag) -> Self {
        let own = lever_count(sag.levers.joint_count());
        let (arm, carried) = sag.weights.split_at(own);
        let heights = |weights: &[f64]| {
            let mut heights = weights.to_vec();
            for (first, links) in sag.levers.first_levers() {
                for k in (first..first + links - 1).rev() {
                    heights[k] += heights[k + 1];
                }
            }
            sag.levers.beside().for_each(|lever| heights[lever] *= sag.levers.beside_m);
            heights
        };
        let payloads = sag.levers.payloads.iter().zip(carried.chunks_exact(own));
        Self {
            outputs: sag.levers.first_levers().map(|(first, _)| sag.outputs[first]).collect(),
            heights: heights(arm),
            payloads: payloads.map(|(payload, weights)| (payload.input, heights(weights))).collect(),
            levers: sag.levers.clone(),
        }
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
        let SagScratch { joints, loads, frames, one, .. } = scratch;
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
        if !self.payloads.is_empty() {
            for (carried, (payload, _)) in scratch.carried.iter_mut().zip(&self.payloads) {
                *carried = input(*payload);
            }
            I::call(Carry { loads: self, alone, scratch });
        }
        &scratch.loads
    }
}

/// Adds what the payloads bring to the loads: rare, and so kept out of the way of what is not.
struct Carry<'a> {
    loads: &'a Loads,
    alone: bool,
    scratch: &'a mut SagScratch,
}

impl Kernel for Carry<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self) {
        let Levers { chain, nominal, .. } = &self.loads.levers;
        let SagScratch { joints, loads, carried, added, frames, one } = self.scratch;
        let parameters = if self.alone { LaneParameters::One(one) } else { LaneParameters::Shared(nominal) };
        for (carried, (_, heights)) in carried.iter().zip(&self.loads.payloads) {
            chain.loads::<I>(joints, parameters, heights, frames, added);
            for (load, added) in loads.iter_mut().zip(added.iter()) {
                *load = I::mul_add(*carried, *added, *load);
            }
        }
    }
}
