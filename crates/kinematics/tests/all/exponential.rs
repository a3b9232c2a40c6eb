//! Accuracy of the eight-fold exponential, for every instruction set.

use truearm_kinematics::{InstructionSet, Isa, Kernel, LANES, Lane, dispatch_on, exp};

struct Exponential(Lane);

impl Kernel for Exponential {
    type Output = Lane;
    #[inline(always)]
    fn run<I: Isa>(self) -> Lane {
        exp::<I>(self.0)
    }
}

#[test]
fn relative_error_is_below_the_bound_everywhere() {
    for set in InstructionSet::ALL {
        for first in 0..20_000 {
            let x = Lane::from_fn(|i| {
                1400.0 * (f64::from(first * LANES as i32 + i as i32) * 0.618_033_988_749_895).fract() - 700.0
            });
            let found = dispatch_on(set, Exponential(x));
            for (value, x) in found.0.iter().zip(x.0) {
                let error = (value / x.exp() - 1.0).abs();
                assert!(error < 5e-16, "{set:?} at {x}: {error:e}");
            }
        }
    }
}

#[test]
fn what_is_no_number_stays_so_and_harms_no_neighbour() {
    let x = Lane([f64::NAN, 1.0, -f64::NAN, 0.0, -3.0, 5.0, f64::INFINITY, f64::NEG_INFINITY]);
    for set in InstructionSet::ALL {
        let found = dispatch_on(set, Exponential(x)).0;
        assert!(found[0].is_nan() && found[2].is_nan());
        assert!([1, 3, 4, 5, 6, 7].iter().all(|&k| found[k].is_finite()));
    }
}

#[test]
fn arguments_out_of_range_count_as_its_ends() {
    let x = Lane([-1e300, -709.0, -708.0, 0.0, 709.0, 710.0, 1e300, 1.0]);
    for set in InstructionSet::ALL {
        let found = dispatch_on(set, Exponential(x)).0;
        assert_eq!(found[0], found[2]);
        assert_eq!(found[1], found[2]);
        assert!(found[2] > 0.0 && found[2].is_normal());
        assert_eq!(found[3], 1.0);
        assert_eq!(found[5], found[4]);
        assert_eq!(found[6], found[4]);
    }
}
