//! Networks: which cells are active, training by (A5), and fitting against dense linear algebra.

mod active;
mod fitting;
mod training;

use crate::cmac::{Composition, Membership, Network, NetworkOptions, Sensor};

pub const GAUSSIAN: Membership = Membership::Gaussian { sigma: 0.5 };

pub fn network(cells: &[usize], active: usize, outputs: usize, membership: Membership) -> Network {
    let composition = if membership == Membership::BSpline { Composition::Product } else { Composition::Min };
    let options = NetworkOptions { membership, composition, hashed: None };
    made(cells, active, outputs, options)
}

pub fn made(cells: &[usize], active: usize, outputs: usize, options: NetworkOptions) -> Network {
    let sensor = |&cells: &usize| Sensor { low: -1.0, high: 2.0, cells, active };
    Network::new(cells.iter().map(sensor).collect(), outputs, options).unwrap()
}

/// Inputs that fill the range evenly (Weyl's sequence).
pub fn inputs(count: usize, width: usize) -> Vec<f64> {
    let step = |k: usize| (2.0 + k as f64).sqrt();
    (0..count * width).map(|at| 3.0 * ((at / width + 1) as f64 * step(at % width)).fract() - 1.0).collect()
}
