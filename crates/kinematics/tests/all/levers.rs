//! Levers against differences of heights, and one pose alone against the same pose among others.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use crate::common::{mixed, reference, six_axis, spread};
use truearm_kinematics::{
    BESIDE, Chain, Convention, InstructionSet, Isa, Joint, Kernel, Lane, LaneFrame, LaneParameters,
    LeverScratch, Link, OnePose, Screw, SharedParameters, Transform, dispatch_on, lever_count,
};

const STEP: f64 = 1e-5;

/// Height at which the link that joint `k` moves ends: the origin of the next joint's frame, or the end.
fn height(chain: &Chain, k: usize, joints: &[f64]) -> f64 {
    let next = chain.joint_columns().get(k + 1).map(|column| column / 5);
    let Some(next) = next else { return reference(chain, joints, &chain.nominal()).translation[2] };
    let mut links: Vec<Link> = chain.links()[..next].to_vec();
    if chain.convention() == Convention::Modified {
        links.push(Link { joint: Joint::Fixed, theta: 0.0, d: 0.0, ..chain.links()[next] });
    }
    let part = Chain::new(chain.convention(), links, *chain.base(), Transform::IDENTITY).unwrap();
    reference(&part, &joints[..=k], &part.nominal()).translation[2]
}

struct Levers<'a>(&'a Chain, &'a [Lane]);

impl Kernel for Levers<'_> {
    type Output = Vec<Lane>;

    #[inline(always)]
    fn run<I: Isa>(self) -> Vec<Lane> {
        let mut out = vec![Lane::ZERO; lever_count(self.0.joint_count())];
        let shared = SharedParameters::new(&self.0.nominal());
        let parameters = LaneParameters::Shared(&shared);
        self.0.levers::<I>(self.1, parameters, &mut LeverScratch::new(self.0), &mut out);
        out
    }
}

#[test]
fn levers_are_derivatives_of_heights() {
    for chain in [six_axis(), mixed(Convention::Standard), mixed(Convention::Modified)] {
        let count = chain.joint_count();
        let q = spread(count, 7);
        let lanes: Vec<Lane> = q.iter().map(|x| Lane::splat(*x)).collect();
        let found = dispatch_on(InstructionSet::detected(), Levers(&chain, &lanes));
        let mut at = 0;
        for j in 0..count {
            for k in j..count {
                let moved = |by: f64| {
                    let mut q = q.clone();
                    q[j] += by;
                    height(&chain, k, &q)
                };
                let wanted = (moved(STEP) - moved(-STEP)) / (2.0 * STEP);
                assert!((found[at].0[3] - wanted).abs() < 1e-9, "joint {j}, link {k}");
                at += 1;
            }
            for axis in 0..BESIDE {
                let added = |by: f64| {
                    let mut q = q.clone();
                    q[j] += by;
                    reference(&chain, &q, &chain.nominal()).rotation[6 + axis]
                };
                let wanted = (added(STEP) - added(-STEP)) / (2.0 * STEP);
                assert!((found[at].0[3] - wanted).abs() < 1e-9, "joint {j}, axis {axis}");
                at += 1;
            }
        }
    }
}

struct Loads<'a>(&'a Chain, &'a [Lane], &'a [f64]);

impl Kernel for Loads<'_> {
    type Output = Vec<Lane>;

    #[inline(always)]
    fn run<I: Isa>(self) -> Vec<Lane> {
        let Self(chain, joints, heights) = self;
        let mut out = vec![Lane::ZERO; chain.joint_count()];
        let shared = SharedParameters::new(&chain.nominal());
        let parameters = LaneParameters::Shared(&shared);
        chain.loads::<I>(joints, parameters, heights, &mut LeverScratch::new(chain), &mut out);
        out
    }
}

#[test]
fn loads_are_weighted_sums_of_levers() {
    for chain in [six_axis(), mixed(Convention::Standard), mixed(Convention::Modified)] {
        let count = chain.joint_count();
        let lanes: Vec<Lane> = spread(count, 5).iter().map(|x| Lane::splat(*x)).collect();
        let weights = spread(lever_count(count), 6);
        for set in InstructionSet::ALL {
            let levers = dispatch_on(set, Levers(&chain, &lanes));
            let (mut heights, mut wanted, mut at) = (Vec::new(), Vec::new(), 0);
            for links in (1..=count).rev() {
                let own = links + BESIDE;
                let weights = &weights[at..at + own];
                heights.extend((0..links).map(|k| weights[k..links].iter().sum::<f64>()));
                heights.extend(&weights[links..]);
                wanted.push(weights.iter().zip(&levers[at..]).map(|(w, g)| w * g.0[2]).sum::<f64>());
                at += own;
            }
            for (found, wanted) in dispatch_on(set, Loads(&chain, &lanes, &heights)).iter().zip(wanted) {
                assert!((found.0[2] - wanted).abs() < 1e-12, "{} is not {wanted}", found.0[2]);
            }
        }
    }
}

/// Everything of a sweep of one pose, by `OnePose` where it is alone.
struct Alone<'a> {
    chain: &'a Chain,
    joints: &'a [Lane],
    each: Option<&'a [Lane]>,
    alone: bool,
}

impl Kernel for Alone<'_> {
    type Output = (LaneFrame, Vec<Screw>, [Lane; 3]);

    #[inline(always)]
    fn run<I: Isa>(self) -> Self::Output {
        let Self { chain, joints, each, alone } = self;
        let shared = SharedParameters::new(&chain.nominal());
        let mut one = OnePose::new(&shared);
        let parameters = match (each, alone) {
            (None, false) => LaneParameters::Shared(&shared),
            (Some(lanes), false) => LaneParameters::Each(lanes),
            (None, true) => {
                one.move_to::<I>(chain, joints);
                LaneParameters::One(&one)
            }
            (Some(lanes), true) => {
                let row: Vec<f64> = lanes.iter().map(|lane| lane.0[0]).collect();
                one.set::<I>(chain, joints, &row);
                LaneParameters::One(&one)
            }
        };
        let mut frame = LaneFrame::splat(&Transform::IDENTITY);
        let mut screws = vec![Screw::ZERO; chain.joint_count()];
        chain.sweep::<I>(joints, parameters, chain.joint_columns(), &mut frame, &mut screws);
        (frame, screws, chain.end_point::<I>(joints, parameters))
    }
}

#[test]
fn a_pose_alone_is_to_the_bit_what_it_is_among_others() {
    for chain in [six_axis(), mixed(Convention::Standard), mixed(Convention::Modified)] {
        let joints: Vec<Lane> = spread(chain.joint_count(), 4).iter().map(|x| Lane::splat(3.0 * x)).collect();
        let own = spread(chain.parameter_count(), 9);
        let each: Vec<Lane> = own.iter().map(|x| Lane::splat(*x)).collect();
        for each in [None, Some(&each[..])] {
            for set in InstructionSet::ALL {
                let run = |alone| dispatch_on(set, Alone { chain: &chain, joints: &joints, each, alone });
                assert_eq!(run(true), run(false));
            }
        }
    }
}
