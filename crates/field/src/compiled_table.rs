//! Weights laid out for evaluation: one output over one input, or many outputs over up to three.

use truearm_kinematics::{Isa, LANES, Lane};

use crate::bank::Block;
use crate::compiled_axis::Excited;

/// Lanes of outputs whose sums fit into registers.
pub const MOST_LANES: usize = 5;
/// Inputs of a grid.
const MOST_AXES: usize = 3;

/// One output over one axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    pub axis: usize,
    pub output: usize,
    /// (cells,).
    pub weights: Vec<f64>,
}

impl Line {
    /// Adds to the outputs (up to 8, `width`) of the poses.
    #[inline(always)]
    pub fn add<I: Isa, const K: usize>(&self, excited: &[Excited<K>], out: &mut [f64], width: usize) {
        let excited = &excited[self.axis];
        let mut sum = Lane::ZERO;
        for k in 0..K {
            let mut weight = Lane::ZERO;
            for p in 0..LANES {
                weight.0[p] = self.weights[excited.cell[k][p] as usize];
            }
            sum = I::mul_add(excited.grade[k], weight, sum);
        }
        for (out, sum) in out.chunks_exact_mut(width).zip(&sum.0) {
            out[self.output] += sum;
        }
    }
}

/// All blocks with the same outputs.
#[derive(Debug, Clone, PartialEq)]
pub struct Sheet {
    pub outputs: Vec<usize>,
    tables: Vec<Table>,
}

/// Weights of one block, (cells, lanes), over up to three axes, the last of them always there.
#[derive(Debug, Clone, PartialEq)]
struct Table {
    /// The last axis and its cells.
    last: (usize, usize),
    /// The one before and its cells.
    middle: Option<(usize, usize)>,
    first: Option<usize>,
    weights: Vec<Lane>,
}

impl Sheet {
    pub fn new(outputs: &[usize]) -> Self {
        Self { outputs: outputs.to_vec(), tables: Vec::new() }
    }

    fn lanes(&self) -> usize {
        self.outputs.len().div_ceil(LANES)
    }

    /// Takes in a block's outputs from `offset` on, over the given compiled axes.
    pub fn push(&mut self, block: &Block, offset: usize, axes: &[usize]) {
        let (wide, count, lanes) = (block.outputs.len(), self.outputs.len(), self.lanes());
        let mut weights = vec![Lane::ZERO; block.grid.cell_count() * lanes];
        for (source, target) in block.weights.chunks_exact(wide).zip(weights.chunks_exact_mut(lanes)) {
            for (i, weight) in source[offset..offset + count].iter().enumerate() {
                target[i / LANES].0[i % LANES] = *weight;
            }
        }
        let axes = &axes[..axes.len().min(MOST_AXES)];
        let mut from_last = axes.iter().zip(&block.grid.axes).map(|(&axis, cells)| (axis, cells.count)).rev();
        let Some(last) = from_last.next() else { return };
        let middle = from_last.next();
        let first = from_last.next().map(|(axis, _)| axis);
        self.tables.push(Table { last, middle, first, weights });
    }

    /// Adds to the outputs (up to 8, `width`) of the poses.
    #[inline(always)]
    pub fn add<I: Isa, const K: usize>(&self, excited: &[Excited<K>], out: &mut [f64], width: usize) {
        for (pose, out) in out.chunks_exact_mut(width).enumerate() {
            match self.lanes() {
                1 => self.pose::<I, K, 1>(excited, pose, out),
                2 => self.pose::<I, K, 2>(excited, pose, out),
                3 => self.pose::<I, K, 3>(excited, pose, out),
                4 => self.pose::<I, K, 4>(excited, pose, out),
                _ => self.pose::<I, K, MOST_LANES>(excited, pose, out),
            }
        }
    }

    #[inline(always)]
    fn pose<I: Isa, const K: usize, const W: usize>(
        &self,
        excited: &[Excited<K>],
        pose: usize,
        out: &mut [f64],
    ) {
        let mut sums = [Lane::ZERO; W];
        for table in &self.tables {
            table.add::<I, K, W>(excited, pose, &mut sums);
        }
        for (outputs, sums) in self.outputs.chunks(LANES).zip(&sums) {
            for (&output, sum) in outputs.iter().zip(&sums.0) {
                out[output] += sum;
            }
        }
    }
}

impl Table {
    #[inline(always)]
    fn add<I: Isa, const K: usize, const W: usize>(
        &self,
        excited: &[Excited<K>],
        pose: usize,
        sums: &mut [Lane; W],
    ) {
        let (weights, _) = self.weights.as_chunks::<W>();
        let last = &excited[self.last.0];
        let Some((middle, middle_count)) = self.middle else {
            row::<I, K, W>(weights, last, pose, sums);
            return;
        };
        let middle = &excited[middle];
        let Some(first) = self.first else {
            plane::<I, K, W>(weights, self.last.1, [middle, last], pose, sums);
            return;
        };
        let first = &excited[first];
        let plane_cells = middle_count * self.last.1;
        for k in 0..K {
            let mut part = [Lane::ZERO; W];
            let weights = &weights[first.cell[k][pose] as usize * plane_cells..];
            plane::<I, K, W>(weights, self.last.1, [middle, last], pose, &mut part);
            weigh::<I, W>(first.grade[k].0[pose], &part, sums);
        }
    }
}

/// Adds the excited cells of a grid over two axes, rows of so many cells.
#[inline(always)]
fn plane<I: Isa, const K: usize, const W: usize>(
    weights: &[[Lane; W]],
    cells: usize,
    axes: [&Excited<K>; 2],
    pose: usize,
    sums: &mut [Lane; W],
) {
    let [outer, inner] = axes;
    for k in 0..K {
        let mut part = [Lane::ZERO; W];
        row::<I, K, W>(&weights[outer.cell[k][pose] as usize * cells..], inner, pose, &mut part);
        weigh::<I, W>(outer.grade[k].0[pose], &part, sums);
    }
}

/// Adds the excited cells of one axis.
#[inline(always)]
fn row<I: Isa, const K: usize, const W: usize>(
    weights: &[[Lane; W]],
    axis: &Excited<K>,
    pose: usize,
    sums: &mut [Lane; W],
) {
    for k in 0..K {
        weigh::<I, W>(axis.grade[k].0[pose], &weights[axis.cell[k][pose] as usize], sums);
    }
}

#[inline(always)]
fn weigh<I: Isa, const W: usize>(grade: f64, weights: &[Lane; W], sums: &mut [Lane; W]) {
    for w in 0..W {
        sums[w] = I::mul_add(Lane::splat(grade), weights[w], sums[w]);
    }
}
