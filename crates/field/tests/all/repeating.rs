//! The same input gives the same bits, a restored posterior the same covariance, a request to stop is obeyed.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use std::time::{Duration, Instant};

use crate::common::{Measure, Truth, fit_from, options, problem, scara, six_axes, with_threads};
use truearm_estimate::{EstimateError, Point};
use truearm_field::{Begin, FieldError, FieldFit, Hyper, Posterior, restore};
use truearm_kinematics::{Cancel, Cancelled};

/// Everything that a fit says, as bits.
fn bits(field: &FieldFit) -> Vec<u64> {
    let group = &field.setup.groups[0];
    let blocks = field.bank.blocks.iter().flat_map(|block| block.weights.clone());
    let setup = group.world_from_base.to_matrix().into_iter().chain(group.targets.concat());
    let judged = field.judgement.score.iter().chain(&field.judgement.distance).copied();
    let hyper = [field.evidence, field.judgement.inflation, field.hyper.extrapolation, field.hyper.noise[0]];
    let constants = field.parameters.iter().chain(&field.residuals).copied();
    let columns = field.posterior.training().columns.len();
    let jacobian: Vec<f64> = (0..3 * columns).map(|k| (k as f64).sin()).collect();
    let values = vec![0.1; field.bank.input_count];
    let sure =
        [1, 3].map(|rows| field.posterior.covariance(&values, &jacobian[..rows * columns], None, rows));
    let constants = constants.chain(sure.into_iter().flat_map(Result::unwrap));
    constants.chain(blocks).chain(setup).chain(judged).chain(hyper).map(f64::to_bits).collect()
}

#[test]
fn threads_do_not_change_a_fit() {
    let arm = six_axes(Truth::BENDING);
    let set = Measure::poses(60).of(&arm);
    let fits = [1, 2, 4].map(|threads| {
        with_threads(threads, || {
            let (constant, options) = options(&arm, &set).unwrap();
            bits(&fit_from(&arm, &set, constant, options).unwrap().field)
        })
    });
    assert!(fits[0] == fits[1], "two threads");
    assert!(fits[0] == fits[2], "four threads");
}

#[test]
fn threads_do_not_change_weight_space() {
    let arm = scara(Truth { own: 1e-4, ..Truth::RIGID });
    let set = Measure::poses(2100).of(&arm);
    let mut hyper = Hyper::start(&[0, 1], 4, [3e-5, 1e-4]);
    hyper.own_length = 1.0;
    (hyper.smooth_length, hyper.smooth_line_length) = (3.0, 3.0);
    hyper.products.truncate(1);
    hyper.products[0].lengths.fill(3.0);
    let fits = [1, 2, 4].map(|threads| {
        with_threads(threads, || {
            let (constant, mut options) = options(&arm, &set).unwrap();
            options.begin = Begin::Known(hyper.clone());
            let field = fit_from(&arm, &set, constant, options).unwrap().field;
            assert!(matches!(field.posterior, Posterior::Weight(_)));
            bits(&field)
        })
    });
    assert!(fits[0] == fits[1], "two threads");
    assert!(fits[0] == fits[2], "four threads");
}

#[test]
fn a_fit_that_begins_at_a_rough_one_ends_where_one_from_nothing_does() {
    let arm = six_axes(Truth::BENDING);
    // More rows than a search is made on, and fewer.
    for poses in [320, 80] {
        let set = Measure::poses(poses).of(&arm);
        let (constant, mut options) = options(&arm, &set).unwrap();
        let mut fitted = |begin, rough| {
            (options.begin, options.rough) = (begin, rough);
            fit_from(&arm, &set, constant.clone(), options.clone()).unwrap().field
        };
        let whole = fitted(Begin::Anew, false);
        let rough = fitted(Begin::Anew, true);
        assert!(rough.wide.is_none() && rough.evaluations <= whole.evaluations);
        let finished = fitted(Begin::Near(rough.start()), false);
        let [finished, whole] = [finished, whole].map(|field| (bits(&field), field.evaluations));
        assert!(finished.0 == whole.0, "{poses} poses");
        assert_eq!(finished.1 + rough.evaluations, whole.1);
    }
}

#[test]
fn a_restored_posterior_is_as_sure_as_the_fit() {
    let arm = six_axes(Truth::BENDING);
    let mut set = Measure::poses(60).of(&arm);
    set.targets[3 * 11] += 5e-3;
    let (constant, mut options) = options(&arm, &set).unwrap();
    options.begin = Begin::Known(Hyper::start(&[1, 2], 6, [3e-5, 1e-4]));
    let start = constant.clone();
    let fit = fit_from(&arm, &set, constant, options).unwrap();
    assert_eq!(fit.field.judgement.outliers, [11]);
    let training = fit.field.posterior.training();
    set.weight = (0..60).map(|pose| training.weight[training.rows(pose).start]).collect();
    let point = Point { parameters: &start.parameters, setup: &start.setup };
    let problem = problem(&arm, &set, &arm.columns);
    let restored = restore(&problem, point, &fit.options, fit.field.hyper.clone()).unwrap();
    let (values, columns) = (arm.configurations(5, (0.1, 0.9), 5), arm.columns.len());
    let jacobian: Vec<f64> = (0..5 * 3 * columns).map(|k| (k as f64).sin()).collect();
    let of = |posterior: &Posterior| posterior.covariance(&values, &jacobian, None, 3).unwrap();
    assert_eq!(of(&restored), of(&fit.field.posterior));
}

#[test]
fn a_request_to_stop_is_obeyed_at_once() {
    let arm = six_axes(Truth::BENDING);
    let set = Measure::poses(200).of(&arm);
    let (constant, mut options) = options(&arm, &set).unwrap();
    options.cancel = Cancel::default();
    let cancel = options.cancel.clone();
    let asked = std::thread::spawn(move || {
        std::thread::sleep(Duration::from_millis(300));
        cancel.request();
        Instant::now()
    });
    let Err(stopped) = fit_from(&arm, &set, constant, options) else { panic!("the fit went on") };
    let took = asked.join().unwrap().elapsed();
    // Wherever it is, also in a fit of constants within.
    let is_obeyed = matches!(
        stopped,
        FieldError::Cancelled(Cancelled) | FieldError::Estimate(EstimateError::Cancelled(Cancelled))
    );
    assert!(is_obeyed, "{stopped}");
    assert!(took < Duration::from_secs(1), "stopped {took:?} after the request");
}
