//! The arms of the tests, with the parameters that are asked for.

use std::f64::consts::{FRAC_PI_2, PI};

use truearm_kinematics::{Chain, Convention, Joint, Link, Transform};

use Joint::{Fixed, Prismatic, Revolute};

pub const THETA: usize = 0;
pub const D: usize = 1;
pub const A: usize = 2;
pub const ALPHA: usize = 3;
pub const BETA: usize = 4;
pub const PLAIN: [usize; 4] = [THETA, D, A, ALPHA];
/// What is asked for where an axis is parallel to its neighbour.
pub const PARALLEL: [usize; 4] = [THETA, A, ALPHA, BETA];

fn chain(convention: Convention, rows: &[(Joint, [f64; 4])]) -> Chain {
    let links =
        rows.iter().map(|&(joint, [theta, d, a, alpha])| Link { joint, theta, d, a, alpha, beta: 0.0 });
    Chain::new(convention, links.collect(), Transform::IDENTITY, Transform::IDENTITY).unwrap()
}

/// The same chain between transforms of its own at both ends.
pub fn with_ends(chain: &Chain) -> Chain {
    let base = Transform::from_rotation_vector([0.3, -0.2, 1.1], [0.1, -0.4, 0.7]);
    let end = Transform::from_rotation_vector([-0.9, 0.5, 0.2], [0.05, 0.02, 0.11]);
    chain.with_base(base).unwrap().with_end(end).unwrap()
}

pub fn ur10() -> Chain {
    let rows = [
        [0.0, 0.1273, 0.0, FRAC_PI_2],
        [0.0, 0.0, -0.612, 0.0],
        [0.0, 0.0, -0.5723, 0.0],
        [0.0, 0.163_941, 0.0, FRAC_PI_2],
        [0.0, 0.1157, 0.0, -FRAC_PI_2],
        [0.0, 0.0922, 0.0, 0.0],
    ];
    chain(Convention::Standard, &rows.map(|row| (Revolute, row)))
}

/// theta, d, a, alpha of all six links.
pub fn ur10_plain_columns() -> Vec<usize> {
    columns(&[PLAIN.as_slice(); 6])
}

/// The same with beta in place of d on the two axes that are parallel to the next.
pub fn ur10_columns() -> Vec<usize> {
    columns(&[&PLAIN, &PARALLEL, &PARALLEL, &PLAIN, &PLAIN, &PLAIN])
}

/// The eighteen of them that positions determine.
pub fn ur10_determined() -> Vec<usize> {
    columns(&[&[A, ALPHA], &PARALLEL, &PARALLEL, &PLAIN, &PLAIN])
}

/// Table I of the paper: BASE, A1 to A5, TOOL.
pub fn rv_m2() -> Chain {
    let rows = [
        (Fixed, [FRAC_PI_2, 0.4, -0.08, PI]),
        (Revolute, [0.0, 0.0, 0.12, -FRAC_PI_2]),
        (Revolute, [0.0, 0.0, 0.25, 0.0]),
        (Revolute, [0.0, 0.0, 0.265, -FRAC_PI_2]),
        (Revolute, [0.0, 0.0, 0.0, FRAC_PI_2]),
        (Revolute, [0.0, 0.0, 0.0, 0.0]),
        (Fixed, [0.0, 0.0, 0.17, 0.0]),
    ];
    chain(Convention::Standard, &rows)
}

/// Half ranges of the joints in the paper's experiment: four and five stay at zero.
pub const RV_M2_SPANS: [f64; 5] = [2.6, 1.1, 1.0, 0.0, 0.0];

/// The paper's fifteen of twenty-five.
pub fn rv_m2_fifteen() -> Vec<usize> {
    columns(&[&PARALLEL, &PLAIN, &PARALLEL, &[THETA, D, A]])
}

/// A seven-axis arm in Craig's convention.
pub fn seven_axis() -> Chain {
    let rows = [
        [0.0, 0.333, 0.0, 0.0],
        [0.0, 0.0, 0.0, -FRAC_PI_2],
        [0.0, 0.316, 0.0, FRAC_PI_2],
        [0.0, 0.0, 0.0825, FRAC_PI_2],
        [0.0, 0.384, -0.0825, -FRAC_PI_2],
        [0.0, 0.0, 0.0, FRAC_PI_2],
        [0.0, 0.107, 0.088, FRAC_PI_2],
    ];
    chain(Convention::Modified, &rows.map(|row| (Revolute, row)))
}

/// Two parallel axes, a quill that slides along them and turns.
pub fn scara() -> Chain {
    let rows = [
        (Revolute, [0.0, 0.3, 0.325, 0.0]),
        (Revolute, [0.0, 0.0, 0.275, PI]),
        (Prismatic, [0.0, 0.1, 0.0, 0.0]),
        (Revolute, [0.0, 0.05, 0.0, 0.0]),
    ];
    chain(Convention::Standard, &rows)
}

/// The same chain with other parameters (5 L,).
pub fn with_parameters(chain: &Chain, parameters: &[f64]) -> Chain {
    let rows = chain.links().iter().zip(parameters.chunks_exact(5));
    let links =
        rows.map(|(link, p)| Link { theta: p[0], d: p[1], a: p[2], alpha: p[3], beta: p[4], ..*link });
    Chain::new(chain.convention(), links.collect(), *chain.base(), *chain.end()).unwrap()
}

/// Indices 5 * link + kind, given the kinds of each link from the first on.
pub fn columns(kinds: &[&[usize]]) -> Vec<usize> {
    kinds.iter().enumerate().flat_map(|(link, kinds)| kinds.iter().map(move |kind| 5 * link + kind)).collect()
}

/// All parameters of a chain.
pub fn all_columns(chain: &Chain) -> Vec<usize> {
    (0..chain.parameter_count()).collect()
}
