//! Eight numbers at once: taken out of sixteen, added to what is there, and in single precision.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use proptest::prelude::*;
use truearm_kinematics::{InstructionSet, Isa, Kernel, LANES, Lane, Pick, Short, dispatch_on};

struct Picking<'a>(&'a [Lane; 2], &'a Pick);

impl Kernel for Picking<'_> {
    type Output = Lane;

    #[inline(always)]
    fn run<I: Isa>(self) -> Lane {
        I::pick(&self.0[0], &self.0[1], self.1)
    }
}

struct Adding<'a>(&'a [Lane; 2], &'a Pick, &'a mut [f64]);

impl Kernel for Adding<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self) {
        I::add_picked(&self.0[0], &self.0[1], self.1, self.2);
    }
}

/// Numbers rounded to single precision, and with them a b + c there and again in double precision.
struct Shortened([Lane; 3]);

impl Kernel for Shortened {
    type Output = ([Short; 3], Lane);

    #[inline(always)]
    fn run<I: Isa>(self) -> Self::Output {
        let [a, b, c] = [I::narrow(self.0[0]), I::narrow(self.0[1]), I::narrow(self.0[2])];
        ([a, b, c], I::widen(I::mul_add_short(a, b, c)))
    }
}

proptest! {
    #[test]
    fn short_numbers_are_those_nearest_to_longer_ones(numbers in prop::array::uniform24(-1.0..1.0)) {
        let lane = |first: usize| Lane::from_fn(|i| numbers[first + i]);
        let lanes = [lane(0), lane(LANES), lane(2 * LANES)];
        for set in InstructionSet::ALL {
            let (short, sums) = dispatch_on(set, Shortened(lanes));
            for i in 0..LANES {
                let [a, b, c] = [0, 1, 2].map(|k| {
                    let (short, long) = (short[k].0[i], lanes[k].0[i]);
                    prop_assert_eq!(short, long as f32);
                    Ok(f64::from(short))
                });
                let wanted = a? * b? + c?;
                prop_assert!((sums.0[i] - wanted).abs() <= f64::from(f32::EPSILON), "{} {wanted}", sums.0[i]);
            }
        }
    }

    #[test]
    fn numbers_come_from_where_they_are_picked(
        numbers in prop::array::uniform16(-1.0..1.0),
        sources in prop::collection::vec(prop::option::of(0..20_usize), 0..12),
    ) {
        let lanes = [Lane::from_fn(|i| numbers[i]), Lane::from_fn(|i| numbers[LANES + i])];
        let pick = Pick::new(sources.iter().copied());
        let wanted = |i: usize| {
            let source = sources.get(i).copied().flatten();
            source.and_then(|source| numbers.get(source)).copied().unwrap_or(0.0)
        };
        for set in InstructionSet::ALL {
            prop_assert_eq!(dispatch_on(set, Picking(&lanes, &pick)), Lane::from_fn(wanted));
        }
    }

    #[test]
    fn no_more_is_added_to_than_is_there(
        numbers in prop::array::uniform16(-1.0..1.0),
        sources in prop::collection::vec(prop::option::of(0..20_usize), 0..12),
        before in prop::collection::vec(-1.0..1.0, 0..12),
    ) {
        let lanes = [Lane::from_fn(|i| numbers[i]), Lane::from_fn(|i| numbers[LANES + i])];
        let pick = Pick::new(sources.iter().copied());
        for set in InstructionSet::ALL {
            let mut found = before.clone();
            dispatch_on(set, Adding(&lanes, &pick, &mut found));
            for (i, (found, before)) in found.iter().zip(&before).enumerate() {
                let source = sources.get(i).copied().flatten().filter(|_| i < LANES);
                let number = source.and_then(|source| numbers.get(source)).copied().unwrap_or(0.0);
                prop_assert_eq!(*found, before + number);
            }
        }
    }
}
