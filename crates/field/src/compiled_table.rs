//! Weights laid out for evaluation: one output over one input, or many outputs over up to three.

use truearm_kinematics::{Isa, LANES, Lane};

use crate::bank::Block;
use crate::cells::MOST_AXES;
use crate::compiled_axis::{CompiledAxis, Excited};

/// Lanes of outputs whose sums fit into registers.
pub const MOST_LANES: usize = 5;

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
        let (excited, poses) = (&excited[self.axis], LANES.min(out.len() / width));
        let mut sum = Lane::ZERO;
        for k in 0..K {
            let mut weight = Lane::ZERO;
            if poses == LANES {
                for p in 0..LANES {
                    weight.0[p] = self.weights[excited.cell[k][p] as usize];
                }
            } else {
                for p in 0..poses {
                    weight.0[p] = self.weights[excited.cell[k][p] as usize];
                }
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

/// Weights of one block, (cells, lanes), over up to three axes, the last running fastest.
#[derive(Debug, Clone, PartialEq)]
struct Table {
    /// The last axis and its cells.
    last: (usize, usize),
    /// The one before and its cells.
    middle: Option<(usize, usize)>,
    first: Option<usize>,
    /// Whether all its axes close.
    closed: bool,
    weights: Vec<Lane>,
}

/// A compiled axis and its index.
pub type Numbered<'a> = (usize, &'a CompiledAxis);

impl Line {
    pub fn new(block: &Block, (axis, cells): Numbered<'_>, output: usize) -> Self {
        let mut weights = vec![0.0; cells.room()];
        for (cell, weight) in block.weights.iter().enumerate() {
            weights[cells.place(cell)] = *weight;
        }
        Self { axis, output, weights }
    }
}

impl Sheet {
    pub fn new(outputs: &[usize]) -> Self {
        Self { outputs: outputs.to_vec(), tables: Vec::new() }
    }

    fn lanes(&self) -> usize {
        self.outputs.len().div_ceil(LANES)
    }

    /// Takes in a block's outputs from `offset` on, over the given axes.
    ///
    /// Larger blocks come first: one over a single axis that closes is added to a table over it and others that close,
    /// whose grades add up to one.
    pub fn push(&mut self, block: &Block, offset: usize, axes: &[Numbered<'_>]) {
        let axes = &axes[..axes.len().min(MOST_AXES)];
        let room = |k: usize| axes.get(k).map_or(1, |axis| axis.1.room());
        let shape = [room(0), room(1), room(2)];
        let lanes = self.lanes();
        let mut weights = vec![Lane::ZERO; shape.iter().product::<usize>() * lanes];
        for (cell, source) in block.weights.chunks_exact(block.outputs.len()).enumerate() {
            let target = &mut weights[place(axes, cell) * lanes..][..lanes];
            for (i, weight) in source[offset..offset + self.outputs.len()].iter().enumerate() {
                target[i / LANES].0[i % LANES] = *weight;
            }
        }
        let mut from_last = axes.iter().map(|&(axis, cells)| (axis, cells.room())).rev();
        let Some(last) = from_last.next() else { return };
        let middle = from_last.next();
        let first = from_last.next().map(|(axis, _)| axis);
        let closed = axes.iter().all(|axis| axis.1.is_closed());
        let table = Table { last, middle, first, closed, weights };
        if !self.tables.iter_mut().any(|larger| larger.absorb(&table, lanes)) {
            self.tables.push(table);
        }
    }

    /// Adds to the outputs (up to 8, `width`) of the poses.
    #[inline(always)]
    pub fn add<I: Isa, const K: usize>(&self, excited: &[Excited<K>], out: &mut [f64], width: usize) {
        match self.lanes() {
            1 => self.poses::<I, K, 1>(excited, out, width),
            2 => self.poses::<I, K, 2>(excited, out, width),
            3 => self.poses::<I, K, 3>(excited, out, width),
            4 => self.poses::<I, K, 4>(excited, out, width),
            _ => self.poses::<I, K, MOST_LANES>(excited, out, width),
        }
    }

    #[inline(always)]
    fn poses<I: Isa, const K: usize, const W: usize>(
        &self,
        excited: &[Excited<K>],
        out: &mut [f64],
        width: usize,
    ) {
        for (pose, out) in out.chunks_exact_mut(width).enumerate() {
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
}

/// Where a table over the given axes keeps a cell of their grid.
fn place(axes: &[Numbered<'_>], cell: usize) -> usize {
    let (mut rest, mut stride, mut index) = (cell, 1, 0);
    for (_, axis) in axes.iter().rev() {
        index += axis.place(rest % axis.cell_count()) * stride;
        rest /= axis.cell_count();
        stride *= axis.room();
    }
    index
}

impl Table {
    /// Takes in a table over one of its axes, where that changes no sum; says whether it did.
    fn absorb(&mut self, other: &Table, lanes: usize) -> bool {
        let axis = other.last.0;
        let middle_cells = self.middle.map_or(1, |middle| middle.1);
        let stride = match (self.middle, self.first) {
            _ if self.last.0 == axis => 1,
            (Some(middle), _) if middle.0 == axis => self.last.1,
            (_, Some(first)) if first == axis => middle_cells * self.last.1,
            _ => return false,
        };
        if other.middle.is_some() || !self.closed || !other.closed {
            return false;
        }
        for (cell, target) in self.weights.chunks_exact_mut(lanes).enumerate() {
            let along = cell / stride % other.last.1;
            for (sum, weight) in target.iter_mut().zip(&other.weights[along * lanes..]) {
                *sum += *weight;
            }
        }
        true
    }

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
