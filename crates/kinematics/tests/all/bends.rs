//! The second order of the end's way against differences of the textbook reference.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use crate::common::{mixed, reference, six_axis, spread};
use truearm_kinematics::{
    Bent, Chain, Convention, Isa, Kernel, Lane, LaneFrame, LaneParameters, Screw, SharedParameters,
    Transform, bend, dispatch,
};

/// Way and step of each joint, rad or m, at the most.
const SMALL: f64 = 1e-3;
/// The third order of such ways of several joints.
const THIRD: f64 = 2e-9;

struct Stepping<'a> {
    chain: &'a Chain,
    from: &'a [Lane],
    way: &'a [Lane],
    step: &'a [Lane],
}

impl Kernel for Stepping<'_> {
    type Output = (Vec<Screw>, Bent);

    #[inline(always)]
    fn run<I: Isa>(self) -> (Vec<Screw>, Bent) {
        let Self { chain, from, way, step } = self;
        let shared = SharedParameters::new(&chain.nominal());
        let parameters = LaneParameters::Shared(&shared);
        let mut frame = LaneFrame::splat(&Transform::IDENTITY);
        let mut screws = vec![Screw::ZERO; chain.joint_count()];
        chain.sweep::<I>(from, parameters, chain.joint_columns(), &mut frame, &mut screws);
        let bent = bend::<I>(&screws, way, step);
        (screws, bent)
    }
}

fn lanes(values: &[f64]) -> Vec<Lane> {
    values.iter().map(|x| Lane::splat(*x)).collect()
}

/// How far the end comes from one configuration to another: along, and about as a rotation vector.
fn between(chain: &Chain, from: &[f64], to: &[f64]) -> [f64; 6] {
    let [start, end] = [from, to].map(|q| reference(chain, q, &chain.nominal()));
    let turned = end.compose(&start.inverse()).rotation_vector();
    std::array::from_fn(|i| if i < 3 { end.translation[i] - start.translation[i] } else { turned[i - 3] })
}

#[test]
fn a_step_after_a_way_bends_as_differences_say() {
    for chain in [six_axis(), mixed(Convention::Standard), mixed(Convention::Modified)] {
        let count = chain.joint_count();
        let from: Vec<f64> = spread(count, 3).iter().map(|x| 2.0 * x).collect();
        let [way, step] =
            [4, 5].map(|seed| spread(count, seed).iter().map(|x| SMALL * x).collect::<Vec<f64>>());
        let on = |q: &[f64], by: &[f64]| q.iter().zip(by).map(|(a, b)| a + b).collect::<Vec<f64>>();
        let start = on(&from, &way);
        let there = between(&chain, &start, &on(&start, &step));
        let kernel = Stepping { chain: &chain, from: &lanes(&from), way: &lanes(&way), step: &lanes(&step) };
        let (screws, bent) = dispatch(kernel);
        let part = |screw: &Screw, row: usize| {
            if row < 3 { screw.linear[row].0[0] } else { screw.angular[row - 3].0[0] }
        };
        let mut largest = 0.0_f64;
        for row in 0..6 {
            let straight: f64 = screws.iter().zip(&step).map(|(screw, by)| part(screw, row) * by).sum();
            let wanted = there[row] - straight;
            largest = largest.max(wanted.abs());
            assert!((part(&bent.beside, row) - wanted).abs() < THIRD, "row {row}: {wanted:e}");
        }
        assert!(largest > 100.0 * THIRD, "nothing bends: {largest:e}");
        let turns = [(bent.turned, between(&chain, &from, &start)), (bent.turn, there)];
        for (i, (found, wanted)) in turns.iter().enumerate() {
            for k in 0..3 {
                assert!((found[k].0[0] - wanted[k + 3]).abs() < 10.0 * SMALL * SMALL, "turn {i}");
            }
        }
    }
}
