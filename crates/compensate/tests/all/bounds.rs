//! Every bound refuses with its reason, and near singular configurations no joint jumps.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use crate::common::{Scene, apart, correct, readings, six_axis, tool, unbounded};
use proptest::prelude::*;
use truearm_compensate::{
    CompensateError, ConstantSpread, Correction, Corrector, Limits, Model, Options, Reason, Spread,
};

use truearm_kinematics::Transform;

const Q: [f64; 6] = [0.3, -1.2, 1.4, -0.7, 1.1, 0.2];

fn scene() -> Scene {
    Scene::new(six_axis(), 1e-3)
}

fn limits(limits: Limits) -> Options {
    Options { limits, ..Options::default() }
}

fn one(corrector: &Corrector, q: &[f64]) -> (Vec<f64>, Correction) {
    let mut out = vec![0.0; q.len()];
    let found = corrector.correct(q, &[], true, &mut out, &mut corrector.workspace());
    (out, found)
}

#[track_caller]
fn refuses(options: Options, reason: Reason) -> String {
    let (out, found) = one(&scene().corrector(options), &Q);
    let refusal = found.refusal.unwrap();
    assert_eq!(refusal.reason, reason);
    assert!(out.iter().all(|value| value.is_nan()), "a refused waypoint has readings");
    refusal.to_string()
}

#[test]
fn an_ordinary_waypoint_is_accepted() {
    let (out, found) = one(&scene().corrector(Options::default()), &Q);
    assert_eq!(found.refusal, None);
    assert!(out.iter().zip(&Q).all(|(a, b)| (a - b).abs() < 0.05));
    assert!(found.std_m.is_nan(), "no uncertainty was given");
}

#[test]
fn joint_limits() {
    let mut joints = vec![[-3.0, 3.0]; 6];
    joints[2] = [-3.0, Q[2] - 0.1];
    let text = refuses(limits(Limits { joints, ..Limits::default() }), Reason::JointLimit);
    assert!(text.contains("joint 3 would be at"), "{text}");
}

#[test]
fn readings_far_beyond_their_limits_are_the_reason_where_nothing_is_reached() {
    let mut joints = vec![[-3.0, 3.0]; 6];
    joints[2] = [-3.0, Q[2] - 0.1];
    let never = Limits { residual: 1e-30, ..Limits::default() };
    let text = refuses(limits(Limits { joints: joints.clone(), ..never.clone() }), Reason::JointLimit);
    assert!(text.contains("joint 3 would be at 80.2"), "{text}");
    // A correction could still bring this one back.
    joints[2] = [-3.0, Q[2] - 0.01];
    refuses(limits(Limits { joints, ..never }), Reason::PositionNotReached);
}

#[test]
fn the_other_bounds() {
    let base = Limits::default;
    let text = refuses(limits(Limits { largest_angle: 1e-6, ..base() }), Reason::JointCorrection);
    assert!(text.contains("would change by") && text.contains("0.0001 deg are allowed"), "{text}");
    refuses(limits(Limits { largest_shift: 1e-6, ..base() }), Reason::Shift);
    refuses(limits(Limits { largest_turn: 1e-6, ..base() }), Reason::Turn);
    // Without knowledge of the uncertainty a bound on it cannot be kept.
    let text = refuses(limits(Limits { largest_std: 1e-3, ..base() }), Reason::Spread);
    assert!(text.contains("has no standard deviation to compare with the 1.0000 mm"), "{text}");
}

#[test]
fn joint_limits_between_which_nothing_lies() {
    for wrong in [[f64::NAN, 1.0], [-1.0, f64::NAN], [1.0, -1.0]] {
        let joints = [vec![[f64::NEG_INFINITY, f64::INFINITY]; 5], vec![wrong]].concat();
        let scene = scene();
        let made = Corrector::new(
            scene.calibrated(),
            scene.programming(),
            &tool(),
            limits(Limits { joints, ..Limits::default() }),
        );
        let said = made.map(drop).unwrap_err().to_string();
        assert!(said.contains("the limits of joint 6 are"), "{said}");
    }
}

#[test]
fn not_finite_and_of_other_lengths() {
    let corrector = scene().corrector(Options::default());
    for q in [vec![f64::NAN; 6], vec![f64::INFINITY; 6], vec![0.1; 5], vec![]] {
        let mut out = [0.0; 6];
        let found = corrector.correct(&q, &[], true, &mut out, &mut corrector.workspace());
        assert_eq!(found.refusal.unwrap().reason, Reason::NotFinite);
        assert!(out.iter().all(|value| value.is_nan()));
    }
    let (q, mut workspace) = (Q, corrector.workspace());
    let mut out = [0.0; 6];
    assert_eq!(
        corrector.correct(&q, &[1.0], true, &mut out, &mut workspace).refusal.unwrap().reason,
        Reason::NotFinite
    );
    assert_eq!(corrector.correct(&q, &[], true, &mut out, &mut workspace).refusal, None);
}

#[test]
fn bad_options_are_refused() {
    let scene = scene();
    let make = |options| Corrector::new(scene.calibrated(), scene.programming(), &tool(), options).err();
    let moving = |moving| Options { moving: Some(moving), ..Options::default() };
    for wrong in [vec![], vec![6], vec![1, 0], vec![2, 2]] {
        assert!(matches!(make(moving(wrong)), Some(CompensateError::Moving { .. })));
    }
    for bad in [0.0, -1.0, f64::NAN] {
        let options = limits(Limits { largest_shift: bad, ..Limits::default() });
        assert!(matches!(make(options), Some(CompensateError::Bound { .. })));
    }
    let options = limits(Limits { joints: vec![[0.0, 1.0]], ..Limits::default() });
    assert!(matches!(make(options), Some(CompensateError::Length { .. })));
}

/// A parameter that only turns the base is as uncertain as the frame, which turns the other way.
#[test]
fn what_the_frame_takes_over_does_not_count() {
    let scene = scene();
    let (columns, by) = (vec![0], 2e-3);
    let Transform { rotation, translation: [x, y, z] } = *scene.chain.base();
    let [u, v, w] = [rotation[2], rotation[5], rotation[8]];
    let back = [v * z - w * y, w * x - u * z, u * y - v * x, -u, -v, -w];
    let still = [0.0; 3];
    let direction: Vec<f64> = std::iter::once(1.0).chain(back).chain(still).map(|share| share * by).collect();
    let together: Vec<f64> = direction.iter().flat_map(|a| direction.iter().map(move |b| a * b)).collect();
    let std = |covariance: &[f64]| {
        let model = Model::new(scene.chain.clone(), &scene.constants, &scene.coupling).unwrap();
        let spread = Spread::Constant(ConstantSpread::new(columns.clone(), covariance).unwrap());
        let model = std::sync::Arc::new(model.with_spread(spread).unwrap());
        let corrector = Corrector::new(model, scene.programming(), &tool(), Options::default()).unwrap();
        one(&corrector, &Q).1.std_m
    };
    let alone = std(&[by * by]);
    assert!(alone > 1e-4);
    assert!(std(&together) < 1e-6 * alone, "{}", std(&together));
}

#[test]
fn standard_deviation_of_constants() {
    let scene = scene();
    let columns: Vec<usize> = vec![0, 1, 7, 8, 15];
    // A covariance of rank two, as priors that are tied together give.
    let (a, b) = ([1e-3, 2e-4, -3e-4, 1e-3, 5e-4], [0.0, 1e-4, 4e-4, 0.0, -2e-4]);
    let covariance: Vec<f64> = (0..25).map(|k| a[k / 5] * a[k % 5] + b[k / 5] * b[k % 5]).collect();
    let model = Model::new(scene.chain.clone(), &scene.constants, &scene.coupling).unwrap();
    let spread = Spread::Constant(ConstantSpread::new(columns.clone(), &covariance).unwrap());
    let model = std::sync::Arc::new(model.with_spread(spread).unwrap());
    let corrector = Corrector::new(model, scene.programming(), &tool(), Options::default()).unwrap();
    let (out, found) = one(&corrector, &Q);
    let end = scene.chain.with_end(scene.chain.end().compose(&tool())).unwrap();
    let mut jacobian = vec![0.0; 3 * 30];
    let parameters = truearm_kinematics::Parameters::One(&scene.constants);
    end.position_jacobian(&out, parameters, &mut jacobian).unwrap();
    let motion = |v: &[f64; 5], row: usize| -> f64 {
        columns.iter().zip(v).map(|(column, x)| jacobian[row * 30 + column] * x).sum()
    };
    let variance: f64 = (0..3).map(|row| motion(&a, row).powi(2) + motion(&b, row).powi(2)).sum();
    assert!(
        (found.std_m - variance.sqrt()).abs() < 1e-9 * variance.sqrt(),
        "{} {}",
        found.std_m,
        variance.sqrt()
    );
}

#[test]
fn a_standard_deviation_that_nobody_asks_for_is_not_worked_out_and_a_bound_asks() {
    let scene = scene();
    let told = |asked: bool, largest_std: f64| {
        let model = Model::new(scene.chain.clone(), &scene.constants, &scene.coupling).unwrap();
        let spread = Spread::Constant(ConstantSpread::new(vec![0], &[1e-6]).unwrap());
        let model = std::sync::Arc::new(model.with_spread(spread).unwrap());
        let options = limits(Limits { largest_std, ..Limits::default() });
        let corrector = Corrector::new(model, scene.programming(), &tool(), options).unwrap();
        corrector.correct(&Q, &[], asked, &mut [0.0; 6], &mut corrector.workspace())
    };
    let [silent, asked] = [false, true].map(|asked| told(asked, f64::INFINITY));
    assert!(silent.std_m.is_nan() && asked.std_m > 1e-4);
    assert_eq!((silent.residual_m, silent.shift), (asked.residual_m, asked.shift));
    assert_eq!(told(false, 1e-5).refusal.unwrap().reason, Reason::Spread);
}

#[test]
fn the_correction_may_not_change_fast_along_a_path() {
    let scene = scene();
    let path =
        |step: f64| -> Vec<f64> { (0..600).flat_map(|i| Q.map(|q| q + step * f64::from(i))).collect() };
    let smooth = correct(&scene.corrector(limits(Limits::default())), &path(1e-4), 1);
    assert_eq!(smooth.refused.len(), 0, "{:?}", smooth.refused.first());
    let tight = Limits { shift_change: 1e-4, ..Limits::default() };
    let found = correct(&scene.corrector(limits(tight)), &path(1e-3), 1);
    let places: Vec<usize> = found.refused.iter().map(|(place, _)| *place).collect();
    assert_eq!(places, (1..600).collect::<Vec<_>>(), "all but the first, those where tasks meet included");
    for (place, refusal) in &found.refused {
        assert_eq!(refusal.reason, Reason::ShiftChange);
        assert!(found.readings[place * 6..place * 6 + 6].iter().all(|value| value.is_nan()));
    }
}

#[test]
fn neighbours_get_neighbouring_corrections() {
    let scene = Scene::varying(six_axis(), 1e-3);
    let corrector = scene.corrector(limits(unbounded()));
    let path: Vec<f64> = (0..1000).flat_map(|i| Q.map(|q| q + 1e-5 * f64::from(i))).collect();
    let found = correct(&corrector, &path, 1);
    let change = |i: usize, k: usize| found.readings[i * 6 + k] - path[i * 6 + k];
    for i in 1..1000 {
        for k in 0..6 {
            assert!((change(i, k) - change(i - 1, k)).abs() < 1e-6, "waypoint {i}, joint {k}");
        }
    }
}

#[test]
fn threads_batches_and_single_waypoints_agree_bit_for_bit() {
    for scene in [scene(), Scene::varying(six_axis(), 1e-3)] {
        let corrector = scene.corrector(limits(unbounded()));
        let mut q = readings(&scene.chain, 1003, 4);
        // Some near the wrist's singular configuration, whose steps are damped, among others.
        q.chunks_exact_mut(6).step_by(5).for_each(|row| row[4] = 1e-4);
        let found = correct(&corrector, &q, 1);
        let bits = |values: &[f64]| values.iter().map(|x| x.to_bits()).collect::<Vec<_>>();
        for threads in [2, 4] {
            assert_eq!(bits(&correct(&corrector, &q, threads).readings), bits(&found.readings));
        }
        for (from, to) in q.chunks_exact(6).zip(found.readings.chunks_exact(6)) {
            let (out, single) = one(&corrector, from);
            assert!(single.refusal.is_some() == to[0].is_nan());
            assert!(out.iter().zip(to).all(|(a, b)| a.to_bits() == b.to_bits()), "{out:?} {to:?}");
        }
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

    /// Around the wrist's singular configuration a small error moves no joint by more than the bound, whether the
    /// waypoint is accepted or, with a loose residual, taken as near as the arm comes.
    #[test]
    fn near_singular_configurations_no_joint_jumps(
        q in proptest::array::uniform6(-2.8_f64..2.8),
        exponent in -9.0_f64..-1.0,
        sign in proptest::bool::ANY,
    ) {
        let scene = Scene::new(six_axis(), 3e-4);
        let mut q = q;
        q[4] = 10.0_f64.powf(exponent) * if sign { 1.0 } else { -1.0 };
        let loose = Limits { residual: 1.0, residual_turn: 1.0, ..unbounded() };
        let bound = 3.0_f64.to_radians();
        let near = scene.corrector(limits(Limits { largest_angle: bound, ..loose }));
        let (out, found) = one(&near, &q);
        match found.refusal {
            Some(refusal) => prop_assert_eq!(refusal.reason, Reason::JointCorrection),
            None => {
                let change = out.iter().zip(&q).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
                prop_assert!(change <= bound, "{} rad", change);
                let without = apart(&scene.meant(&q)[0], &scene.real(&q)[0]);
                let with = apart(&scene.meant(&q)[0], &scene.real(&out)[0]);
                let size = |(d, a): (f64, f64)| d.hypot(0.3 * a);
                prop_assert!(size(with) <= size(without) * (1.0 + 1e-9), "{:?} {:?}", with, without);
            }
        }
        let exact = scene.corrector(limits(Limits { largest_angle: bound, ..unbounded() }));
        let (out, found) = one(&exact, &q);
        if found.refusal.is_none() {
            let (distance, angle) = apart(&scene.meant(&q)[0], &scene.real(&out)[0]);
            prop_assert!(distance < 1e-9 && angle < 1e-9);
        }
    }
}

#[test]
fn from_a_singular_wrist_a_bound_refuses_nothing_that_it_allows() {
    let scene = scene();
    let mut q = readings(&scene.chain, 2000, 5);
    q.iter_mut().skip(4).step_by(6).for_each(|fifth| *fifth = 0.0);
    let free = correct(&scene.corrector(limits(unbounded())), &q, 1);
    let bound = 3.0_f64.to_radians();
    let bounded = correct(&scene.corrector(limits(Limits { largest_angle: bound, ..unbounded() })), &q, 1);
    let largest =
        |i: usize| (0..6).map(|k| (free.readings[6 * i + k] - q[6 * i + k]).abs()).fold(0.0, f64::max);
    let allowed: Vec<usize> =
        (0..2000).filter(|i| free.readings[6 * i].is_finite() && largest(*i) < bound).collect();
    assert!(allowed.len() > 20, "{} of 2000", allowed.len());
    let refused = allowed.iter().filter(|i| bounded.readings[6 * **i].is_nan()).count();
    assert!(refused * 10 <= allowed.len(), "{refused} of {} refused", allowed.len());
}
