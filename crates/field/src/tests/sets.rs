//! Small training sets and hyper-parameters at which nothing is negligible.

use truearm_bank::Input;
use truearm_estimate::{MeasurementSet, Point, Setup, Sigma};

use super::common::{Arm, Measure, Truth, options, problem, scara, shots, six_axes, subset};
use crate::drives::Drives;
use crate::hyper::{Hyper, Wave};
use crate::joined::join;
use crate::linear::training;
use crate::options::FieldOptions;
use crate::training::Training;

/// Rows of measurements, linearised at the constant fit.
pub fn rows_of(arm: &Arm, set: &MeasurementSet, change: impl Fn(&mut FieldOptions)) -> Training {
    let (constant, mut options) = options(arm, set).unwrap();
    change(&mut options);
    let setup: &Setup = &constant.setup;
    let point = Point { parameters: &constant.parameters, setup };
    training(&problem(arm, set, &arm.columns), point, &options).unwrap()
}

/// Positions of a six-axis arm.
pub fn positions(poses: usize) -> Training {
    let arm = six_axes(Truth::BENDING);
    rows_of(&arm, &Measure::poses(poses).of(&arm), |_| ())
}

/// The same where only a few columns vary.
pub fn few_driven(poses: usize) -> Training {
    let arm = six_axes(Truth::BENDING);
    rows_of(&arm, &Measure::poses(poses).of(&arm), |options| options.driven = vec![0, 4, 5, 9])
}

/// Poses in two groups, with rows of a sigma and a weight of their own and a few not measured at all.
pub fn poses_in_two_groups(poses: usize) -> Training {
    let arm = six_axes(Truth::BENDING);
    let measure = Measure { groups: 2, orientation: Some(1e-4), ..Measure::poses(poses) };
    let mut set = measure.of(&arm);
    for pose in 0..poses {
        set.sigma[pose] = Sigma::of_position(1e-5 * (pose % 4) as f64);
        set.weight[pose] = [1.0, 0.6, 1.0, 0.3, 1.0][pose % 5];
    }
    set.targets[3 * 4..3 * 5].fill(f64::NAN);
    set.rotations[9 * 7..9 * 8].fill(f64::NAN);
    set.weight[9] = 0.0;
    rows_of(&arm, &set, |_| ())
}

/// Some poses with one shot, the others with three.
pub fn several_shots(poses: usize) -> Training {
    let arm = six_axes(Truth::BENDING);
    let set = Measure::poses(poses).of(&arm);
    let once: Vec<usize> = (0..poses).filter(|pose| pose % 3 == 0).collect();
    let often: Vec<usize> = (0..poses).filter(|pose| pose % 3 > 0).collect();
    let mut all = shots(&subset(&set, &once), 1, 0.0, 0.0, 1);
    let more = shots(&subset(&set, &often), 3, 0.0, 2e-5, 2);
    let groups = [&all.group[..], &more.group].concat();
    all.joints.extend(&more.joints);
    all.targets.extend(&more.targets);
    all.sigma.extend(&more.sigma);
    all.weight.extend(&more.weight);
    all.group.extend(&more.group);
    let rows = rows_of(&arm, &all, |_| ());
    let left = rows.residual.clone();
    join(rows, &left, &groups, all.rows_per_pose()).training
}

/// Four targets and orientations, some not measured, with rows of a sigma and a weight of their own.
pub fn four_targets(poses: usize) -> Training {
    let arm = six_axes(Truth::BENDING);
    let measure = Measure { targets: 4, groups: 2, orientation: Some(1e-4), ..Measure::poses(poses) };
    let mut set = measure.of(&arm);
    for pose in 0..poses {
        set.sigma[pose] = Sigma::of_position(1e-5 * (pose % 2) as f64);
        set.weight[pose] = [1.0, 0.6, 1.0, 1e-3][pose % 4];
    }
    set.targets[12 * 4 + 3..12 * 4 + 6].fill(f64::NAN);
    set.targets[12 * 7..12 * 8].fill(f64::NAN);
    rows_of(&arm, &set, |_| ())
}

/// A prismatic joint and a feature.
pub fn line_inputs(poses: usize) -> Training {
    let arm = scara(Truth { own: 2e-4, ..Truth::RIGID });
    let set = Measure { orientation: Some(1e-4), ..Measure::poses(poses) }.of(&arm);
    rows_of(&arm, &set, |options| {
        options.features = vec![Input::line(12.0)];
        options.feature_values = (0..poses).map(|pose| 20.0 + 12.0 * (pose as f64 * 0.618).fract()).collect();
    })
}

/// Two features, a payload before another one.
pub fn loaded(poses: usize) -> Training {
    let arm = six_axes(Truth::BENDING);
    let set = Measure::poses(poses).of(&arm);
    rows_of(&arm, &set, |options| {
        options.features = vec![Input::line(5.0), Input::line(12.0)];
        options.payloads = vec![0];
        let of = |pose: usize| [2.5 * (pose % 3) as f64, 20.0 + 12.0 * (pose as f64 * 0.618).fract()];
        options.feature_values = (0..poses).flat_map(of).collect();
    })
}

/// Positions of an arm with a parallel link, whose curves go with readings.
pub fn by_readings(poses: usize) -> Training {
    let arm = six_axes(Truth { parallel: Some([1, 2]), ..Truth::BENDING });
    let set = Measure { orientation: Some(1e-4), ..Measure::poses(poses) }.of(&arm);
    let drives = Drives::of(&arm.coupling(), |_| false);
    assert_eq!(drives.as_ref().map(Drives::len), Some(2));
    rows_of(&arm, &set, |options| options.drives = drives.clone()).by_readings()
}

/// Hyper-parameters away from the centre of their priors.
pub fn hyper(training: &Training, joints: usize) -> Hyper {
    let mut start = Hyper::start(&[1, 2], joints, [4e-5, 1.2e-4]);
    start.waves = vec![
        Wave { joint: 1, cycles: 31.0, amplitude: 6e-5 },
        Wave { joint: 0, cycles: 12.4, amplitude: 3e-5 },
        Wave { joint: 1, cycles: 62.0, amplitude: 2e-5 },
    ];
    let mut logs = start.to_logs();
    logs.iter_mut().enumerate().for_each(|(k, log)| *log += 0.3 * (k as f64 * 1.7).sin());
    assert!(training.row_count() > 0);
    start.with_logs(&logs)
}

/// The same with curves of joints that ripple.
pub fn rippling(training: &Training, joints: usize) -> Hyper {
    Hyper { own_cycles: 12.4, ..hyper(training, joints) }
}

/// The same with long length scales, so that weights are few.
pub fn long(training: &Training, joints: usize) -> Hyper {
    let mut hyper = hyper(training, joints);
    hyper.own_length = 0.9;
    (hyper.smooth_length, hyper.smooth_line_length) = (3.0, 3.0);
    hyper.products.iter_mut().for_each(|product| product.lengths.fill(4.0));
    hyper
}
