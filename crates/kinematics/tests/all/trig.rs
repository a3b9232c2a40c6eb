//! Accuracy of the eight-fold sine and cosine, for every instruction set.

use proptest::prelude::*;
use truearm_kinematics::{InstructionSet, Isa, Kernel, LANES, Lane, dispatch_on, sin_cos};

struct Both(Lane);

impl Kernel for Both {
    type Output = (Lane, Lane);
    #[inline(always)]
    fn run<I: Isa>(self) -> (Lane, Lane) {
        sin_cos::<I>(self.0)
    }
}

/// Largest difference from the standard library's sines and cosines.
fn worst(angles: impl Iterator<Item = f64>, set: InstructionSet) -> f64 {
    let angles: Vec<f64> = angles.collect();
    let mut worst = 0.0_f64;
    for group in angles.chunks_exact(LANES) {
        let lane = Lane::from_fn(|i| group[i]);
        let (sine, cosine) = dispatch_on(set, Both(lane));
        for (angle, (s, c)) in group.iter().zip(sine.0.iter().zip(&cosine.0)) {
            worst = worst.max((s - angle.sin()).abs()).max((c - angle.cos()).abs());
        }
    }
    worst
}

#[test]
fn error_is_below_the_bound_everywhere() {
    // The library's own error of half a unit in the last place, 0.56e-16 below one, adds to the bound of 2.3e-16.
    let bound = 2.3e-16 + 0.56e-16;
    for set in InstructionSet::ALL {
        for scale in [1.0, 10.0, 1e3, 1e5, 9.9e5] {
            let angles =
                (0..400_000).map(|i| scale * ((f64::from(i) * 0.618_033_988_749_895).fract() * 2.0 - 1.0));
            let error = worst(angles, set);
            assert!(error <= bound, "{set:?} to {scale}: {error:e}");
        }
        let near = (0..80_000).map(|i| f64::from(i - 40_000) * std::f64::consts::FRAC_PI_4);
        assert!(worst(near, set) <= bound, "{set:?} near multiples of an eighth turn");
    }
}

#[test]
fn angles_beyond_the_reduction_go_to_the_library() {
    let lane = Lane([1e7, -3e9, 1e22, f64::MAX, 2e6, -1e15, 0.5, -0.0]);
    for set in InstructionSet::ALL {
        let (sine, cosine) = dispatch_on(set, Both(lane));
        assert_eq!(sine.0, lane.0.map(f64::sin));
        assert_eq!(cosine.0, lane.0.map(f64::cos));
    }
}

#[test]
fn what_is_no_angle_gives_nan_and_harms_no_neighbour() {
    let lane = Lane([f64::NAN, f64::INFINITY, f64::NEG_INFINITY, 1.0, 2.0, 3.0, 4.0, 5.0]);
    for set in InstructionSet::ALL {
        let (sine, cosine) = dispatch_on(set, Both(lane));
        for i in 0..3 {
            assert!(sine.0[i].is_nan() && cosine.0[i].is_nan());
        }
        for i in 3..LANES {
            assert!(
                (sine.0[i] - lane.0[i].sin()).abs() < 3e-16 && (cosine.0[i] - lane.0[i].cos()).abs() < 3e-16
            );
        }
    }
}

/// Angles of all sizes, and what is none.
fn any_angle() -> impl Strategy<Value = f64> {
    prop_oneof![-7.0..7.0f64, -1e6..1e6f64, -1e12..1e12f64, Just(f64::NAN), Just(f64::INFINITY)]
}

proptest! {
    #[test]
    fn neighbours_change_nothing(angles in prop::array::uniform8(any_angle()), lane in 0..LANES) {
        for set in InstructionSet::ALL {
            let among = dispatch_on(set, Both(Lane(angles)));
            let alone = dispatch_on(set, Both(Lane::splat(angles[lane])));
            prop_assert_eq!(among.0.0[lane].to_bits(), alone.0.0[lane].to_bits());
            prop_assert_eq!(among.1.0[lane].to_bits(), alone.1.0[lane].to_bits());
        }
    }
}
