//! Amplitudes that the evidence leaves open widen standard deviations, others do not.

use truearm_kinematics::Cancel;

use super::common::{Measure, Truth, options, problem, six_axes};
use super::sets::{few_driven, hyper, positions};
use crate::data_space::DataSpace;
use crate::evidence::Evidence;
use crate::fit::fit_field;
use crate::hyper::AT_SMOOTH;
use crate::hyper_prior::HyperPrior;
use crate::model::Model;
use crate::posterior::Posterior;
use crate::widening::with_widenings;

#[test]
fn the_prior_alone_bounds_what_few_poses_leave_open() {
    let training = few_driven(3);
    let cancel = Cancel::default();
    let evidence = Evidence::new(&training, &cancel);
    let start = hyper(&training, 6);
    let wide = with_widenings(&evidence, &start).unwrap();
    let prior = HyperPrior::new(&start);
    let most = |k: usize| prior.precision_of(AT_SMOOTH + k).recip().exp() * (1.0 + 1e-12);
    let within = (0..3).all(|k| (1.0..=most(k)).contains(&wide.smooth_widening[k]));
    assert!(within, "{:?}", wide.smooth_widening);
    let all = [wide.smooth_widening, wide.products[1].widening].concat();
    assert!(all.iter().any(|&w| w > 2.0), "{all:?}");
}

#[test]
fn an_amplitude_that_much_data_tells_is_not_widened() {
    let arm = six_axes(Truth { own: 5e-4, ..Truth::RIGID });
    let set = Measure::poses(150).of(&arm);
    let (constant, options) = options(&arm, &set).unwrap();
    let fit = fit_field(&problem(&arm, &set, &arm.columns), &constant, &options).unwrap();
    assert!(fit.hyper.own_widening < 1.1, "{}", fit.hyper.own_widening);
}

#[test]
fn wider_amplitudes_make_nothing_surer() {
    let training = positions(20);
    let narrow = hyper(&training, 6);
    let wide = narrow.with_widenings(&[1.1, 1.5, 2.0, 1.0, 1.6, 1.2, 1.3, 1.4, 2.0, 2.1, 2.2]);
    let posterior = |hyper| {
        let model = Model::new(training.clone(), hyper, 2);
        Posterior::Data(Box::new(DataSpace::new(model, &Cancel::default()).unwrap()))
    };
    let plain = posterior(narrow.clone());
    let widened = posterior(wide).widened(2, &Cancel::default()).unwrap().unwrap();
    let same = posterior(narrow).widened(2, &Cancel::default()).unwrap().unwrap();
    let far: Vec<f64> = training.values_of(2).iter().map(|value| value + 0.8).collect();
    for values in [training.values_of(4), &far] {
        let columns = training.columns.len();
        let rows = &training.jacobian[..3 * columns];
        let of = |posterior: &Posterior| posterior.covariance(values, rows, None, 3).unwrap();
        let (plain, widened) = (of(&plain), of(&widened));
        assert_eq!(plain, of(&same));
        assert!((0..3).all(|k| widened[4 * k] > plain[4 * k]), "{plain:?} {widened:?}");
    }
}
