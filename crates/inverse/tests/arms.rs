//! Random arms of both shapes, plain and as a factory measures them: every solution reaches, none is lost.

#![allow(clippy::expect_used, reason = "a test may stop")]

use proptest::prelude::*;
use truearm_inverse::{Arm, Inverse, InverseError, Method, Readings};
use truearm_kinematics::{Chain, Convention, Joint, Link, Parameters, Transform};

const QUARTER: f64 = std::f64::consts::FRAC_PI_2;
const HALF: f64 = std::f64::consts::PI;
/// theta, d, a, alpha, beta.
type Row = [f64; 5];
type Pose = [f64; 16];

fn chain(rows: &[Row]) -> Chain {
    let links = rows.iter().map(|&[theta, d, a, alpha, beta]| Link {
        joint: Joint::Revolute,
        theta,
        d,
        a,
        alpha,
        beta,
    });
    Chain::new(Convention::Standard, links.collect(), Transform::IDENTITY, Transform::IDENTITY)
        .expect("a chain")
}

fn solver(rows: &[Row], limits: Vec<[f64; 2]>) -> Inverse {
    let count = rows.len();
    let one: Vec<f64> = (0..count * count).map(|k| f64::from(u8::from(k % (count + 1) == 0))).collect();
    let readings = Readings::new(one.clone(), one, limits, &vec![true; count]).expect("readings");
    Inverse::new(Arm { chain: chain(rows), readings }).expect("a solver")
}

fn full_circle(count: usize) -> Vec<[f64; 2]> {
    vec![[-HALF, HALF]; count]
}

fn pose(rows: &[Row], joints: &[f64]) -> Pose {
    let chain = chain(rows);
    let mut out = [0.0; 16];
    chain.poses(joints, Parameters::One(&chain.nominal()), &mut out).expect("a pose");
    out
}

fn apart(a: &Pose, b: &Pose) -> f64 {
    a.iter().zip(b).map(|(x, y)| (x - y).abs()).fold(0.0, f64::max)
}

fn holds(found: &[Vec<f64>], joints: &[f64]) -> bool {
    found.iter().any(|row| {
        row.iter().zip(joints).all(|(x, y)| {
            let turn = (x - y) / (2.0 * HALF);
            (turn - turn.round()).abs() < 1e-6
        })
    })
}

/// Base of two parallel axes across the first, spherical wrist; shoulder offset and elbow offset of any sign.
fn spherical(lengths: [f64; 6], turns: [f64; 6]) -> Vec<Row> {
    let [a1, d1, a2, a3, d3, d4] = lengths;
    vec![
        [turns[0], d1 + 0.3, a1, -QUARTER, 0.0],
        [turns[1], 0.0, a2.abs() + 0.2, 0.0, 0.0],
        [turns[2], 0.5 * d3, a3, QUARTER, 0.0],
        [turns[3], -(d4.abs() + 0.2), 0.0, -QUARTER, 0.0],
        [turns[4], 0.0, 0.0, QUARTER, 0.0],
        [turns[5], d1, 0.0, 0.0, 0.0],
    ]
}

/// Three parallel axes across the first and the fifth.
fn parallel(lengths: [f64; 6], turns: [f64; 6]) -> Vec<Row> {
    let [d1, a2, a3, d4, d5, d6] = lengths;
    vec![
        [turns[0], d1, 0.0, QUARTER, 0.0],
        [turns[1], 0.0, -(a2.abs() + 0.2), 0.0, 0.0],
        [turns[2], 0.0, a3.abs() + 0.2, 0.0, 0.0],
        [turns[3], d4, 0.0, QUARTER, 0.0],
        [turns[4], d5, 0.0, -QUARTER, 0.0],
        [turns[5], d6, 0.0, 0.0, 0.0],
    ]
}

fn bent(rows: &[Row], by: &[f64]) -> Vec<Row> {
    let bend = |(row, change): (&Row, &[f64])| std::array::from_fn(|k| row[k] + change[k]);
    rows.iter().zip(by.chunks_exact(5)).map(bend).collect()
}

fn six(range: std::ops::Range<f64>) -> impl Strategy<Value = [f64; 6]> {
    prop::array::uniform6(range)
}

/// Determinant of the joint Jacobian: small where branches meet, and none can be told from its neighbour.
fn determinant(rows: &[Row], joints: &[f64; 6]) -> f64 {
    let chain = chain(rows);
    let mut m = [0.0; 36];
    chain.joint_pose_jacobian(joints, Parameters::One(&chain.nominal()), &mut m).expect("a Jacobian");
    let mut product = 1.0;
    for k in 0..6 {
        let pivot = (k..6).max_by(|&a, &b| m[6 * a + k].abs().total_cmp(&m[6 * b + k].abs())).unwrap_or(k);
        (0..6).for_each(|j| m.swap(6 * k + j, 6 * pivot + j));
        product *= m[7 * k];
        for i in k + 1..6 {
            let factor = m[6 * i + k] / m[7 * k];
            (k..6).for_each(|j| m[6 * i + j] -= factor * m[6 * k + j]);
        }
    }
    product.abs()
}

fn check(rows: &[Row], joints: &[f64; 6], method: Method) -> Result<(), TestCaseError> {
    prop_assume!(determinant(rows, joints) > 2e-3);
    let solver = solver(rows, full_circle(6));
    prop_assert_eq!(solver.method(), method);
    let wanted = pose(rows, joints);
    let target = Transform::from_matrix(&wanted);
    let found = solver.solutions(&target, false).expect("solutions");
    prop_assert!(found.len() <= 16 && holds(&found, joints), "{} solutions", found.len());
    for row in &found {
        prop_assert!(apart(&pose(rows, row), &wanted) < 1e-9);
    }
    let near = solver.near(&[target], joints).expect("a solution").remove(0).expect("within limits");
    prop_assert!(near.iter().zip(joints).all(|(x, y)| (x - y).abs() < 1e-6));
    Ok(())
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn spherical_wrists_are_solved(lengths in six(-0.4..0.4), turns in six(-3.0..3.0), q in six(-3.1..3.1)) {
        check(&spherical(lengths, turns), &q, Method::SphericalWrist)?;
    }

    #[test]
    fn three_parallel_axes_are_solved(lengths in six(0.05..0.6), turns in six(-3.0..3.0), q in six(-3.1..3.1)) {
        check(&parallel(lengths, turns), &q, Method::ThreeParallel)?;
    }

    #[test]
    fn what_a_factory_measures_is_solved_too(
        lengths in six(0.05..0.6),
        q in six(-3.1..3.1),
        by in prop::collection::vec(-1e-3..1e-3, 30),
    ) {
        check(&bent(&parallel(lengths, [0.0; 6]), &by), &q, Method::ThreeParallel)?;
        check(&bent(&spherical(lengths, [0.0; 6]), &by), &q, Method::SphericalWrist)?;
    }
}

#[test]
fn many_targets_are_solved_as_one_by_one() {
    let rows = parallel([0.1, 0.4, 0.3, 0.15, 0.1, 0.1], [0.0; 6]);
    let solver = solver(&rows, full_circle(6));
    let targets: Vec<Transform> = (0..50)
        .map(|k| {
            let q: Vec<f64> = (0..6).map(|j| f64::from(7 * k + 3 * j).sin() * 2.5).collect();
            Transform::from_matrix(&pose(&rows, &q))
        })
        .collect();
    let one: Vec<_> = targets.iter().map(|target| solver.solutions(target, false).expect("some")).collect();
    for threads in [1, 3] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool");
        assert_eq!(pool.install(|| solver.all(&targets)).expect("all"), one);
    }
}

#[test]
fn limits_and_turns() {
    let rows = parallel([0.1, 0.4, 0.3, 0.15, 0.1, 0.1], [0.0; 6]);
    let q = [0.4, -1.0, 1.2, -0.9, 0.8, 0.3];
    let target = Transform::from_matrix(&pose(&rows, &q));
    let narrow = q.iter().map(|&x| [x - 0.1, x + 0.1]).collect();
    assert_eq!(solver(&rows, narrow).solutions(&target, true).expect("one").len(), 1);
    let two_turns = vec![[-2.0 * HALF, 2.0 * HALF]; 6];
    let all = solver(&rows, two_turns).solutions(&target, true).expect("many");
    assert_eq!(all.len() % 64, 0);
    let nowhere = vec![[3.0, 3.01]; 6];
    assert!(solver(&rows, nowhere).near(&[target], &q).expect("asked").remove(0).is_none());
}

#[test]
fn bad_input_is_refused() {
    let rows = parallel([0.1, 0.4, 0.3, 0.15, 0.1, 0.1], [0.0; 6]);
    let readings = Readings::new(vec![1.0; 4], vec![1.0; 36], full_circle(6), &[true; 6]);
    assert!(matches!(readings, Err(InverseError::Length { name: "the coupling", got: 4, wanted: 36 })));
    let solver = solver(&rows, full_circle(6));
    let seed = [f64::NAN; 6];
    assert!(matches!(solver.near(&[Transform::IDENTITY], &seed), Err(InverseError::SeedNotFinite { .. })));
    assert!(matches!(solver.near(&[Transform::IDENTITY], &[0.0; 5]), Err(InverseError::Length { .. })));
}

#[test]
fn arms_on_a_fixed_row_are_solved_like_those_without() {
    let rows = spherical([0.1, 0.4, 0.3, 0.05, 0.0, 0.4], [0.0; 6]);
    let joints = [0.3, -0.4, 0.5, 0.2, 0.7, -0.3];
    let mut links = vec![Link { joint: Joint::Fixed, theta: 0.2, d: 0.3, a: 0.1, alpha: 0.4, beta: 0.0 }];
    links.extend(chain(&rows).links());
    let chain = Chain::new(Convention::Standard, links, Transform::IDENTITY, Transform::IDENTITY);
    let chain = chain.expect("a chain");
    let mut target = [0.0; 16];
    chain.poses(&joints, Parameters::One(&chain.nominal()), &mut target).expect("a pose");
    let one: Vec<f64> = (0..36).map(|k| f64::from(u8::from(k % 7 == 0))).collect();
    let readings = Readings::new(one.clone(), one, full_circle(6), &[true; 6]).expect("readings");
    let solver = Inverse::new(Arm { chain, readings }).expect("a solver");
    let found = solver.solutions(&Transform::from_matrix(&target), false).expect("solutions");
    assert!(holds(&found, &joints), "{found:?}");
}
