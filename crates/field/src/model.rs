//! The prior model of one training set: cells, what they drive, and how alike configurations are under it.

use truearm_bank::{Active, Axis, CellKernel, Grid, Levers, Sag, Shape, alike};

use crate::hyper::{Hyper, Product, WAVE_NAME, Wave};
use crate::own::OwnKernel;
use crate::pairs::{ByColumn, PairKernels, PairTable};
use crate::training::{Class, Training};

/// Cells per length scale: `own` curves have a rougher kernel and cost little.
const OWN_CELLS: f64 = 3.0;
const CELLS: f64 = 2.0;

/// Cell priors of all blocks under given hyper-parameters.
#[derive(Debug, Clone)]
pub struct Cells {
    /// One per input; `None` where no parameter is driven.
    pub own: Vec<Option<CellKernel>>,
    /// One per input.
    pub smooth: Vec<CellKernel>,
    /// Inputs and cells of each product.
    pub products: Vec<Vec<(usize, CellKernel)>>,
    /// Input and cells of each wave.
    pub waves: Vec<(usize, CellKernel)>,
    /// What the joints carry.
    pub geometry: Levers,
}

impl Cells {
    /// Cells that cover the values of a training set.
    pub fn new(training: &Training, by_column: &ByColumn, hyper: &Hyper, degree: usize) -> Self {
        let axis = |k: usize, length: f64, spacing: f64| {
            let values = (0..training.pose_count()).map(|pose| training.values_of(pose)[k]);
            Axis::covering(training.inputs[k], values, length, spacing, degree)
        };
        let own = |k: usize| {
            let kernel = OwnKernel::of(hyper, training.inputs[k].kind);
            let axis = axis(k, hyper.own_length, kernel.finest_scale() / OWN_CELLS);
            by_column.own[k]
                .filter(|_| training.has_curve(k))
                .map(|_| CellKernel::new(axis, |d| kernel.at(d)))
        };
        let smooth = |k: usize, length: f64| {
            CellKernel::new(axis(k, length, length / CELLS), |d| Shape::SquaredExponential.at(d, length))
        };
        let product = |product: &Product| {
            let joints = product.joints.iter().zip(&product.lengths);
            joints.map(|(&k, &length)| (k, smooth(k, length))).collect()
        };
        // The kernel of a cosine and a sine with weights of the same variance is the cosine of the distance.
        let wave = |wave: &Wave| {
            (wave.joint, CellKernel::new(Axis::over_cycle(wave.cycles, degree), |distance| 1.0 - distance))
        };
        Self {
            own: (0..training.inputs.len()).map(own).collect(),
            smooth: training.inputs[..training.input_count()]
                .iter()
                .enumerate()
                .map(|(k, input)| smooth(k, hyper.smooth_length_of(input)))
                .collect(),
            products: hyper.products.iter().map(product).collect(),
            waves: hyper.waves.iter().map(wave).collect(),
            geometry: training.geometry.clone(),
        }
    }

    /// The cells that one configuration excites.
    pub fn excite(&self, values: &[f64]) -> Excited {
        Excited {
            own: self
                .own
                .iter()
                .zip(values)
                .map(|(cells, &v)| cells.as_ref().map(|c| c.axis.active(v)))
                .collect(),
            smooth: self.smooth.iter().zip(values).map(|(cells, &v)| cells.axis.active(v)).collect(),
            products: self
                .products
                .iter()
                .map(|axes| axes.iter().map(|(k, cells)| cells.axis.active(values[*k])).collect())
                .collect(),
            waves: self.waves.iter().map(|(k, cells)| cells.axis.active(values[*k])).collect(),
            levers: self.geometry.at(values),
        }
    }

    /// Prior correlations of one configuration with others.
    pub fn fill(&self, here: &Excited, others: &[Excited], table: &mut PairTable) {
        table.clear(self.own.len(), self.products.len(), self.waves.len(), others.len());
        for (k, column) in table.own.iter_mut().enumerate() {
            if let (Some(cells), Some(active)) = (&self.own[k], &here.own[k]) {
                let values = cells.kernels(
                    active,
                    others.iter().map(|other| other.own[k].as_ref().unwrap_or(&Active::NONE)),
                );
                column.iter_mut().zip(values).for_each(|(out, value)| *out = value);
            }
        }
        for (k, (cells, active)) in self.smooth.iter().zip(&here.smooth).enumerate() {
            let values = cells.kernels(active, others.iter().map(|other| &other.smooth[k]));
            table.smooth.iter_mut().zip(values).for_each(|(sum, value)| *sum += value);
        }
        for (index, (column, axes)) in table.products.iter_mut().zip(&self.products).enumerate() {
            column.fill(1.0);
            for (k, (_, cells)) in axes.iter().enumerate() {
                let values = cells
                    .kernels(&here.products[index][k], others.iter().map(|other| &other.products[index][k]));
                column.iter_mut().zip(values).for_each(|(product, value)| *product *= value);
            }
        }
        for (index, (column, (_, cells))) in table.waves.iter_mut().zip(&self.waves).enumerate() {
            let values = cells.kernels(&here.waves[index], others.iter().map(|other| &other.waves[index]));
            column.iter_mut().zip(values).for_each(|(out, value)| *out = value);
        }
        let mut loads = vec![0.0; self.own.len()];
        for (i, other) in others.iter().enumerate() {
            self.fill_loads((&here.levers, &other.levers), &mut loads, table, i);
        }
    }

    /// How alike the loads of the joints are under two sets of levers; `loads` is room for them, one an input.
    fn fill_loads(
        &self,
        (here, there): (&[f64], &[f64]),
        loads: &mut [f64],
        table: &mut PairTable,
        at: usize,
    ) {
        alike(self.geometry.joint_count(), here, there, loads);
        table.sag.iter_mut().zip(loads.iter()).for_each(|(column, load)| column[at] = *load);
    }
}

/// Excited cells of one configuration.
#[derive(Debug, Clone)]
pub struct Excited {
    own: Vec<Option<Active>>,
    smooth: Vec<Active>,
    products: Vec<Vec<Active>>,
    waves: Vec<Active>,
    levers: Vec<f64>,
}

/// Kernels between the training poses that the cells imply.
pub struct Implied<'a> {
    pub cells: &'a Cells,
    pub excited: &'a [Excited],
}

impl PairKernels for Implied<'_> {
    fn fill(&self, j: usize, table: &mut PairTable) {
        self.cells.fill(&self.excited[j], &self.excited[j..], table);
    }
}

/// One block of the bank before its weights are known.
pub struct BlockPlan<'a> {
    pub name: &'a str,
    /// Input and cells of each axis.
    pub axes: Vec<(usize, &'a CellKernel)>,
    /// Driven columns with the prior variance of their weights.
    pub driven: Vec<(usize, f64)>,
    /// Whether these are all that blocks drive, and not the joint's own column alone.
    pub of_all: bool,
}

impl BlockPlan<'_> {
    /// The block's grid of cells.
    pub fn grid(&self) -> Grid {
        Grid {
            inputs: self.axes.iter().map(|axis| axis.0).collect(),
            axes: self.axes.iter().map(|axis| axis.1.axis.clone()).collect(),
        }
    }
}

/// A training set under given hyper-parameters.
pub struct Model {
    pub training: Training,
    pub hyper: Hyper,
    pub cells: Cells,
    pub by_column: ByColumn,
}

impl Model {
    /// Cells for a training set under hyper-parameters, with memberships of a degree, 2 or 3.
    pub fn new(training: Training, hyper: Hyper, degree: usize) -> Self {
        let by_column = ByColumn::new(&training);
        let cells = Cells::new(&training, &by_column, &hyper, degree);
        Self { training, hyper, cells, by_column }
    }

    /// Prior standard deviation of a column's constant.
    pub fn constant_deviation(&self, p: usize) -> f64 {
        let column = &self.training.columns[p];
        self.hyper.constant[Class::of(column.parameter).index()] * column.constant
    }

    /// All blocks, `own` of each input first, then `smooth`, then the products, then waves.
    pub fn plans(&self) -> Vec<BlockPlan<'_>> {
        let mut plans = Vec::new();
        for (k, own) in self.by_column.own.iter().enumerate() {
            if let (Some((p, lever)), Some(cells)) = (own, &self.cells.own[k]) {
                let driven = vec![(*p, (self.hyper.own * lever).powi(2))];
                plans.push(BlockPlan { name: "own", axes: vec![(k, cells)], driven, of_all: false });
            }
        }
        for (k, cells) in self.cells.smooth.iter().enumerate() {
            plans.push(BlockPlan {
                name: "smooth",
                axes: vec![(k, cells)],
                driven: self.driven(&self.hyper.smooth),
                of_all: true,
            });
        }
        for (axes, product) in self.cells.products.iter().zip(&self.hyper.products) {
            let axes = axes.iter().map(|(k, cells)| (*k, cells)).collect();
            let driven = self.driven(&product.amplitudes);
            plans.push(BlockPlan { name: &product.name, axes, driven, of_all: true });
        }
        for ((k, cells), wave) in self.cells.waves.iter().zip(&self.hyper.waves) {
            if let Some((p, lever)) = self.by_column.own[*k] {
                let driven = vec![(p, (wave.amplitude * lever).powi(2))];
                plans.push(BlockPlan { name: WAVE_NAME, axes: vec![(*k, cells)], driven, of_all: false });
            }
        }
        plans
    }

    /// Driven columns with their prior variances.
    fn driven(&self, amplitudes: &[f64; 3]) -> Vec<(usize, f64)> {
        let classes = self.by_column.driven.iter().zip(amplitudes);
        let mut driven: Vec<_> =
            classes.flat_map(|(columns, a)| columns.iter().map(move |&p| (p, a * a))).collect();
        driven.sort_by_key(|entry| entry.0);
        driven
    }

    /// Column and prior standard deviation of every lever's weight, (L,); `None` where nothing is driven.
    pub fn sag_terms(&self) -> Vec<Option<(usize, f64)>> {
        let of = |joint: usize| self.by_column.own[joint].map(|(p, lever)| (p, self.hyper.sag * lever));
        self.training.geometry.joints().map(of).collect()
    }

    /// The `sag` block with given weights, zero where nothing is driven.
    pub fn sag(&self, weights: Vec<f64>) -> Option<Sag> {
        let parameter = |term: &Option<(usize, f64)>| term.map(|(p, _)| self.training.columns[p].parameter);
        let terms = self.sag_terms();
        let any = terms.iter().find_map(parameter)?;
        let outputs = terms.iter().map(|term| parameter(term).unwrap_or(any)).collect();
        let (levers, weights) = self.training.geometry.clone().in_own_units(weights);
        Some(Sag { levers, outputs, weights })
    }

    /// Prior covariance of each column's CEP at one configuration and at others, (n, P).
    pub fn covariances(&self, here: &Excited, others: &[Excited]) -> Vec<f64> {
        let mut table = PairTable::default();
        self.cells.fill(here, others, &mut table);
        self.combined(&table, others.len())
    }

    /// Prior variance of each column's CEP at a configuration, (P,).
    pub fn variances(&self, here: &Excited) -> Vec<f64> {
        self.covariances(here, std::slice::from_ref(here))
    }

    /// Prior covariances of each column's CEP, (count, P).
    fn combined(&self, table: &PairTable, count: usize) -> Vec<f64> {
        let width = self.training.columns.len();
        let constants: Vec<f64> = (0..width).map(|p| self.constant_deviation(p).powi(2)).collect();
        let mut out = constants.repeat(count);
        self.add_varying(table, &mut out);
        out
    }

    /// Adds what blocks have in common to covariances (count, P) of the columns' CEPs.
    pub fn add_varying(&self, table: &PairTable, out: &mut [f64]) {
        for (i, variances) in out.chunks_exact_mut(self.training.columns.len()).enumerate() {
            for (class, columns) in self.by_column.driven.iter().enumerate() {
                let products = self.hyper.products.iter().zip(&table.products);
                let products: f64 =
                    products.map(|(product, kernels)| product.amplitudes[class].powi(2) * kernels[i]).sum();
                let value = self.hyper.smooth[class].powi(2) * table.smooth[i] + products;
                columns.iter().for_each(|&p| variances[p] += value);
            }
            for (k, entry) in self.by_column.own.iter().enumerate() {
                if let Some((p, lever)) = entry {
                    variances[*p] += (self.hyper.own * lever).powi(2) * table.own[k][i];
                    variances[*p] += (self.hyper.sag * lever).powi(2) * table.sag[k][i];
                }
            }
            for (wave, kernels) in self.hyper.waves.iter().zip(&table.waves) {
                if let Some((p, lever)) = self.by_column.own[wave.joint] {
                    variances[p] += (wave.amplitude * lever).powi(2) * kernels[i];
                }
            }
        }
    }
}
