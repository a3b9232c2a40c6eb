//! What a block would add beyond its cells, which end some length scales behind the data.
//!
//! No row excites the cells that would be there: their share of a block's prior variance stays as it is. Shares b of two
//! configurations go together as the block's kernel k has it, `sqrt(b b') k`, a covariance as products of such are.

use truearm_bank::{CellKernel, Shape};

use crate::model::{Cells, Model};
use crate::own::OwnKernel;
use crate::pairs::PairTable;

/// Below this share of a block's variance it is rounding.
const ROUNDING: f64 = 1e-12;

/// Roots of the shares of each block's prior variance that lie beyond its cells.
pub struct Beyond {
    /// One per input, zero where no parameter is driven.
    own: Vec<f64>,
    /// One per input.
    smooth: Vec<f64>,
    /// One for each product.
    products: Vec<f64>,
}

impl Beyond {
    /// At one configuration (I,).
    pub fn new(cells: &Cells, values: &[f64]) -> Self {
        let root = |k: usize, cells: &CellKernel| left_out([(k, cells)].into_iter(), values).sqrt();
        let own = cells.own.iter().enumerate();
        Self {
            own: own.map(|(k, cells)| cells.as_ref().map_or(0.0, |cells| root(k, cells))).collect(),
            smooth: cells.smooth.iter().enumerate().map(|(k, cells)| root(k, cells)).collect(),
            products: cells
                .products
                .iter()
                .map(|axes| left_out(axes.iter().map(|(k, cells)| (*k, cells)), values).sqrt())
                .collect(),
        }
    }

    /// Whether all blocks' cells hold all there is.
    pub fn is_nothing(&self) -> bool {
        self.own.iter().chain(&self.smooth).chain(&self.products).all(|&root| root == 0.0)
    }
}

/// What is left of a block's prior variance, one on average, once that of its cells is taken.
fn left_out<'a>(axes: impl Iterator<Item = (usize, &'a CellKernel)>, values: &[f64]) -> f64 {
    let (whole, held) = axes.fold((1.0, 1.0), |(whole, held), (k, cells)| {
        let active = cells.axis.active(values[k]);
        (whole * cells.variance(values[k]), held * cells.implied(&active, &active))
    });
    if whole - held > ROUNDING { whole - held } else { 0.0 }
}

/// `a b kernel`, for which the kernel is asked only where it matters.
fn shared(a: f64, b: f64, kernel: impl FnOnce() -> f64) -> f64 {
    if a * b > 0.0 { a * b * kernel() } else { 0.0 }
}

impl Model {
    /// Covariance (P,) of what the cells leave out of each column's CEP at two configurations (I,).
    pub fn beyond_between(&self, here: (&[f64], &Beyond), there: (&[f64], &Beyond)) -> Vec<f64> {
        let (hyper, inputs) = (&self.hyper, &self.training.inputs);
        let distance = |k: usize| inputs[k].distance(here.0[k], there.0[k]);
        let smooth = |k: usize, length: f64| Shape::SquaredExponential.at(distance(k), length);
        let mut table = PairTable::default();
        table.clear(inputs.len(), hyper.products.len(), hyper.waves.len(), 1);
        for (k, own) in table.own.iter_mut().enumerate() {
            let kernel = || OwnKernel::of(hyper, inputs[k].kind).at(distance(k));
            own[0] = shared(here.1.own[k], there.1.own[k], kernel);
        }
        let of_input = |k: usize| {
            let kernel = || smooth(k, hyper.smooth_length_of(&inputs[k]));
            shared(here.1.smooth[k], there.1.smooth[k], kernel)
        };
        table.smooth[0] = (0..here.1.smooth.len()).map(of_input).sum();
        for (p, (out, product)) in table.products.iter_mut().zip(&hyper.products).enumerate() {
            let axes = product.joints.iter().zip(&product.lengths);
            let kernel = || axes.map(|(&k, &length)| smooth(k, length)).product::<f64>();
            out[0] = shared(here.1.products[p], there.1.products[p], kernel);
        }
        let mut covariances = vec![0.0; self.training.columns.len()];
        self.add_varying(&table, &mut covariances);
        covariances
    }

    /// What the cells leave out of each column's prior variance at a configuration beyond their axes, (P,).
    pub fn beyond(&self, values: &[f64]) -> Vec<f64> {
        let beyond = Beyond::new(&self.cells, values);
        self.beyond_between((values, &beyond), (values, &beyond))
    }
}
