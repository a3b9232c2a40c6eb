//! The conservative standard deviation against exact values it has never seen.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use crate::common::Random;
use truearm_bank::{BankError, Conservative, FACTOR_COLUMNS, InputKind, Leverage, MOVED};
use truearm_field::{ConservativePlan, FieldError, Samples, fit_leverage};
use truearm_kinematics::{Cancel, Cancelled, Chain, Convention, Joint, Link, Parameters, Transform};

const JOINTS: usize = 4;
const RANGES: [[f64; 2]; JOINTS] = [[-6.3, 6.3], [-2.0, 1.0], [-2.5, 2.5], [0.1, 0.6]];
const KINDS: [InputKind; JOINTS] = [InputKind::Angle, InputKind::Angle, InputKind::Angle, InputKind::Line];
const LARGEST: [f64; 2] = [2e-3, 5e-3];
const CENTRE: [f64; 3] = [0.1, -0.2, 0.3];

/// Valleys about two points, on a slope: tables over single inputs cannot follow that.
fn exact(q: &[f64]) -> [f64; 2] {
    let valley = |a: f64, b: f64| 1.0 - 0.5 * (-((q[1] - a).powi(2) + (q[2] - b).powi(2))).exp();
    let slope = 1.0 + 0.3 * (q[0] - 0.4 * q[2]).sin() + q[3];
    let std = 2e-4 * slope * valley(-0.4, 0.3) * valley(0.2, -1.0);
    [std, 0.07 * std.sqrt()]
}

struct Drawn {
    inputs: Vec<f64>,
    std: Vec<f64>,
}

impl Drawn {
    fn new(count: usize, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let mut inputs = Vec::new();
        for _ in 0..count {
            inputs.extend(RANGES.map(|[low, high]| random.between(low, high)));
        }
        let std = inputs.chunks_exact(JOINTS).flat_map(exact).collect();
        Self { inputs, std }
    }

    fn samples(&self) -> Samples<'_> {
        Samples { inputs: &self.inputs, std: &self.std }
    }
}

fn plan() -> ConservativePlan {
    ConservativePlan {
        kinds: KINDS.to_vec(),
        ranges: RANGES.to_vec(),
        together: vec![1, 2],
        largest: LARGEST,
        centre: CENTRE,
        chain: None,
    }
}

fn fitted() -> Conservative {
    let (fitted, fresh) = (Drawn::new(3000, 1), Drawn::new(3000, 2));
    plan().fit(fitted.samples(), fresh.samples(), &Cancel::default()).unwrap()
}

fn ratios(field: &Conservative, drawn: &Drawn, k: usize) -> Vec<f64> {
    let found = field.std(&drawn.inputs).unwrap();
    let mut ratios: Vec<f64> =
        found.iter().zip(&drawn.std).skip(k).step_by(2).map(|(found, exact)| found / exact).collect();
    ratios.sort_by(f64::total_cmp);
    ratios
}

#[test]
fn a_tool_is_as_far_as_it_is_from_the_centre() {
    let field = fitted();
    assert_eq!(field.reach(CENTRE), 0.0);
    assert!((field.reach([0.1, 0.1, 0.7]) - 0.5).abs() < 1e-15);
}

#[test]
fn it_is_never_below_the_exact_one_and_not_far_above() {
    let (field, drawn) = (fitted(), Drawn::new(20_000, 3));
    for k in 0..2 {
        let ratios = ratios(&field, &drawn, k);
        assert!(ratios[0] >= 1.0, "{k}: {}", ratios[0]);
        let median = ratios[ratios.len() / 2];
        assert!(median < 1.6, "{k}: {median}");
        assert!((median / field.parts().looseness[k] - 1.0).abs() < 0.02);
    }
}

#[test]
fn turns_and_batches_change_nothing() {
    let (field, drawn) = (fitted(), Drawn::new(19, 4));
    let all = field.std(&drawn.inputs).unwrap();
    for (q, together) in drawn.inputs.chunks_exact(JOINTS).zip(all.chunks_exact(2)) {
        assert_eq!(field.std(q).unwrap(), together);
        let turned = [q[0] + std::f64::consts::TAU, q[1], q[2], q[3]];
        let turned = field.std(&turned).unwrap();
        assert!(turned.iter().zip(together).all(|(a, b)| (a / b - 1.0).abs() < 1e-9));
    }
}

#[test]
fn outside_its_range_stands_the_largest_value() {
    let field = fitted();
    for (joint, value) in [(1, 1.01), (2, -2.6), (3, 0.05), (3, f64::NAN)] {
        let mut q = [0.3, 0.2, -0.4, 0.4];
        assert!(field.std(&q).unwrap()[0] < LARGEST[0]);
        q[joint] = value;
        assert_eq!(field.std(&q).unwrap(), LARGEST);
    }
}

#[test]
fn the_same_samples_give_the_same_bits_however_many_threads() {
    let by = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(fitted).parts().clone()
    };
    assert_eq!(by(1), by(3));
}

#[test]
fn stored_parts_are_the_same_field() {
    let field = fitted();
    assert_eq!(Conservative::new(field.parts().clone()).unwrap(), field);
    let mut parts = field.parts().clone();
    parts.level[1] = f64::NAN;
    assert!(matches!(Conservative::new(parts), Err(BankError::NotFinite { .. })));
    let mut parts = field.parts().clone();
    parts.ranges.pop();
    assert!(matches!(Conservative::new(parts), Err(BankError::Length { .. })));
}

#[test]
fn samples_that_are_no_standard_deviations_are_refused() {
    let (good, mut bad) = (Drawn::new(50, 1), Drawn::new(50, 2));
    bad.std[7] = 0.0;
    let refused = plan().fit(good.samples(), bad.samples(), &Cancel::default());
    assert!(matches!(refused, Err(FieldError::NotFinite { .. })));
    bad.std.pop();
    let refused = plan().fit(bad.samples(), good.samples(), &Cancel::default());
    assert!(matches!(refused, Err(FieldError::Length { .. })));
}

/// An arm of the four joints, to its flange.
fn chain() -> Chain {
    let link = |joint, d, a, alpha| Link { joint, theta: 0.0, d, a, alpha, beta: 0.0 };
    let links = vec![
        link(Joint::Revolute, 0.4, 0.05, -1.5),
        link(Joint::Revolute, 0.0, 0.5, 0.1),
        link(Joint::Revolute, 0.1, 0.0, 1.5),
        link(Joint::Prismatic, 0.0, 0.0, 0.0),
    ];
    Chain::new(Convention::Standard, links, Transform::IDENTITY, Transform::IDENTITY).unwrap()
}

/// What constants leave of which one combination is known much less well than all others, and a joint's share of it.
fn of_constants(inputs: &[f64]) -> Vec<f64> {
    let to_centre = chain().with_end(Transform { translation: CENTRE, ..Transform::IDENTITY }).unwrap();
    let (n, width) = (inputs.len() / JOINTS, to_centre.parameter_count());
    let mut jacobian = vec![0.0; n * 3 * width];
    let nominal = to_centre.nominal();
    to_centre.position_jacobian(inputs, Parameters::One(&nominal), &mut jacobian).unwrap();
    let variance = |(rows, q): (&[f64], &[f64])| {
        let mut sum = 0.0;
        for row in rows.chunks_exact(width) {
            let lean: f64 = row.iter().enumerate().map(|(k, value)| value * (0.7 * k as f64).cos()).sum();
            sum += 1e-6 * lean * lean + row.iter().map(|value| 1e-10 * value * value).sum::<f64>();
        }
        sum * (1.0 + 0.1 * (3.0 * q[1]).sin())
    };
    let poses = jacobian.chunks_exact(3 * width).zip(inputs.chunks_exact(JOINTS));
    poses.map(variance).flat_map(|variance: f64| [variance.sqrt(), 1e-3]).collect()
}

#[test]
fn a_leverage_follows_what_constants_leave_where_tables_cannot() {
    let [fitted, fresh, drawn] = [1, 2, 3].map(|seed| {
        let mut drawn = Drawn::new(3000, seed);
        drawn.std = of_constants(&drawn.inputs);
        drawn
    });
    let median = |chain| {
        let plan = ConservativePlan { chain, largest: [1.0; 2], together: Vec::new(), ..plan() };
        let found = plan.fit(fitted.samples(), fresh.samples(), &Cancel::default()).unwrap();
        let ratios = ratios(&found, &drawn, 0);
        assert!(ratios[0] >= 1.0, "{}", ratios[0]);
        assert_eq!(found.std(&drawn.inputs[..JOINTS]).unwrap(), found.std(&drawn.inputs).unwrap()[..2]);
        ratios[ratios.len() / 2]
    };
    let (without, with) = (median(None), median(Some(chain())));
    assert!(with < 1.1 && without > 1.4, "{with} {without}");
}

#[test]
fn a_leverage_is_the_same_however_many_threads_and_once_stored() {
    let (inputs, centre) = (Drawn::new(700, 1).inputs, [0.1, 0.0, 0.2]);
    let std: Vec<f64> = of_constants(&inputs).into_iter().step_by(2).collect();
    let by = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| fit_leverage(&chain(), centre, (&inputs, JOINTS), &std, &Cancel::default())).unwrap()
    };
    let found = by(1);
    assert_eq!(found, by(3));
    assert_eq!(Leverage::new(&chain(), centre, &found.factor()).unwrap(), found);
    let mut spoilt = found.factor();
    spoilt[3] = f64::NAN;
    let error = Leverage::new(&chain(), centre, &spoilt).unwrap_err();
    assert_eq!(error, BankError::NotFinite { what: "factor of the standard deviation" });
    assert!(matches!(Leverage::new(&chain(), centre, &spoilt[8..]), Err(BankError::Length { .. })));
}

#[test]
fn ranges_and_samples_that_do_not_fit_are_refused() {
    let (fitted, fresh) = (Drawn::new(300, 1), Drawn::new(300, 2));
    let refusal = |ranges: Vec<[f64; 2]>| {
        let plan = ConservativePlan { ranges, ..plan() };
        plan.fit(fitted.samples(), fresh.samples(), &Cancel::default()).map(drop).unwrap_err().to_string()
    };
    for wrong in [[1.0, -2.0], [f64::NAN, 1.0], [-2.0, f64::INFINITY]] {
        let ranges = RANGES.map(|range| if range == RANGES[1] { wrong } else { range });
        let rule = format!("input 1 (counted from 0) is {} to {}: give the lowest", wrong[0], wrong[1]);
        assert!(refusal(ranges.to_vec()).contains(&rule), "{wrong:?}");
    }
    let narrow = RANGES.map(|range| if range == RANGES[3] { [0.1, 0.5] } else { range });
    let said = refusal(narrow.to_vec());
    assert!(said.contains("input 3") && said.contains("take samples within the ranges"), "{said}");
}

/// Motions (n, 5 L + 9, 3) of a point of the flange by all constants, by differences, and by base and tool.
fn motions(chain: &Chain, point: [f64; 3], inputs: &[f64]) -> Vec<[f64; 3]> {
    let (joints, nominal) = (chain.joint_count(), chain.nominal());
    let to_point = chain
        .with_end(chain.end().compose(&Transform { translation: point, ..Transform::IDENTITY }))
        .unwrap();
    let mut motions = Vec::new();
    for q in inputs.chunks_exact(joints) {
        let pose = |parameters: &[f64]| {
            let mut pose = [0.0; 16];
            to_point.poses(q, Parameters::One(parameters), &mut pose).unwrap();
            pose
        };
        for k in 0..nominal.len() {
            let shifted = |by: f64| {
                let mut parameters = nominal.clone();
                parameters[k] += by;
                pose(&parameters)
            };
            let (above, below) = (shifted(1e-6), shifted(-1e-6));
            motions.push([3, 7, 11].map(|at| (above[at] - below[at]) / 2e-6));
        }
        let here = pose(&nominal);
        let [x, y, z] = [3, 7, 11].map(|at| here[at]);
        motions.extend([[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        motions.extend([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]]);
        motions.extend([0, 1, 2].map(|axis| [0, 1, 2].map(|row| here[4 * row + axis])));
    }
    motions
}

#[test]
fn a_leverage_is_how_far_a_factor_moves_the_point_of_any_arm() {
    let turned = |x: f64| Transform {
        translation: [0.1, x, -0.2],
        rotation: [0.0, -1.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0],
    };
    let links = chain().links().to_vec();
    let (point, inputs) = ([0.05, -0.1, 0.2], Drawn::new(21, 4).inputs);
    for convention in [Convention::Standard, Convention::Modified] {
        let arm = Chain::new(convention, links.clone(), turned(0.3), turned(-0.1)).unwrap();
        let rows = arm.parameter_count() + MOVED;
        let factor: Vec<f64> = (0..rows * FACTOR_COLUMNS).map(|k| (0.3 * k as f64).sin()).collect();
        let leverage = Leverage::new(&arm, point, &factor).unwrap();
        let found = leverage.at(&inputs, JOINTS);
        for (found, motions) in found.iter().zip(motions(&arm, point, &inputs).chunks_exact(rows)) {
            let moved = |column: usize, axis: usize| -> f64 {
                (0..rows).map(|row| motions[row][axis] * factor[FACTOR_COLUMNS * row + column]).sum()
            };
            let squares = (0..3 * FACTOR_COLUMNS).map(|k| moved(k / 3, k % 3).powi(2));
            let expected = squares.sum::<f64>().sqrt();
            assert!((found - expected).abs() < 1e-7 * expected, "{convention:?}: {found} {expected}");
        }
        for (place, q) in inputs.chunks_exact(JOINTS).enumerate() {
            assert_eq!(leverage.at(q, JOINTS), found[place..=place]);
        }
    }
}

#[test]
fn what_moves_the_point_by_rounding_alone_has_no_factor() {
    // The last joint slides along the axis that its theta turns about, and the point lies on it.
    let (inputs, last) = (Drawn::new(400, 5).inputs, 5 * (JOINTS - 1));
    let std: Vec<f64> = of_constants(&inputs).into_iter().step_by(2).collect();
    let found = fit_leverage(&chain(), [0.0, 0.0, 0.2], (&inputs, JOINTS), &std, &Cancel::default()).unwrap();
    let factor = found.factor();
    let of = |row: usize| &factor[FACTOR_COLUMNS * row..][..FACTOR_COLUMNS];
    assert_eq!(of(last), [0.0; FACTOR_COLUMNS]);
    assert!(of(last + 1).iter().any(|entry| *entry != 0.0));
}

#[test]
fn a_leverage_of_more_joints_than_inputs_is_refused() {
    let (fitted, fresh) = (Drawn::new(300, 1), Drawn::new(300, 2));
    let links = [chain().links(), chain().links()].concat();
    let eight = Chain::new(Convention::Standard, links, Transform::IDENTITY, Transform::IDENTITY).unwrap();
    let plan = ConservativePlan { chain: Some(eight.clone()), ..plan() };
    let refused = plan.fit(fitted.samples(), fresh.samples(), &Cancel::default());
    let error = BankError::Length { what: "a configuration", found: JOINTS, expected: 2 * JOINTS };
    assert_eq!(refused.map(drop), Err(FieldError::Bank(error.clone())));
    let mut parts =
        self::plan().fit(fitted.samples(), fresh.samples(), &Cancel::default()).unwrap().parts().clone();
    let factor = vec![0.0; (eight.parameter_count() + MOVED) * FACTOR_COLUMNS];
    parts.leverage = Some(Leverage::new(&eight, CENTRE, &factor).unwrap());
    assert_eq!(Conservative::new(parts).map(drop), Err(error));
}

#[test]
fn no_inputs_are_refused_and_a_fit_ends_on_request() {
    let (fitted, fresh, cancel) = (Drawn::new(300, 1), Drawn::new(300, 2), Cancel::default());
    let nothing = ConservativePlan { kinds: Vec::new(), ranges: Vec::new(), ..plan() };
    let refused = nothing.fit(fitted.samples(), fresh.samples(), &cancel);
    assert!(refused.unwrap_err().to_string().starts_with("the number of inputs is 0"));
    cancel.request();
    let plan = ConservativePlan { chain: Some(chain()), ..plan() };
    let ended = plan.fit(fitted.samples(), fresh.samples(), &cancel).map(drop);
    assert_eq!(ended, Err(FieldError::Cancelled(Cancelled)));
}
