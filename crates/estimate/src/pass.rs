//! One pass over the measurements: the normal equations of all unknowns at a point.

use faer::Mat;
use rayon::prelude::*;
use truearm_kinematics::{Isa, Kernel, LANES, dispatch};

use crate::EstimateError;
use crate::distance;
use crate::layout::{Layout, Problem};
use crate::normal::Columns;
use crate::packets::{Chunk, Packets};
use crate::rows::{Point, RowBuilder, Weighting};

/// Below this many poses threads cost more than they bring.
const THREADED_POSES: usize = 1024;

/// Normal equations of weighted rows: matrix (u, u), right-hand side (u,), sum of squares.
#[derive(Debug, Clone)]
pub struct Normal {
    pub matrix: Mat<f64>,
    pub right: Vec<f64>,
    pub squares: f64,
}

impl Normal {
    /// No rows yet.
    pub fn zeros(unknowns: usize) -> Self {
        Self { matrix: Mat::zeros(unknowns, unknowns), right: vec![0.0; unknowns], squares: 0.0 }
    }

    /// Adds one row: derivatives at the given unknowns, and its residual.
    pub fn add_row(&mut self, entries: &[(usize, f64)], residual: f64) {
        for &(i, a) in entries {
            for &(j, b) in entries {
                self.matrix[(i, j)] += a * b;
            }
            self.right[i] += a * residual;
        }
        self.squares += residual * residual;
    }

    /// Adds the Gram matrix of a chunk: arm columns, columns of a group that start at `group`, residual.
    fn add_chunk(&mut self, gram: &[f64], layout: &Layout, group: usize) {
        let width = layout.arm + layout.group_width() + 1;
        let start = layout.group(group).start;
        let place = |column: usize| if column < layout.arm { column } else { start + column - layout.arm };
        for i in 0..width - 1 {
            for j in 0..=i {
                self.matrix[(place(i), place(j))] += gram[i * width + j];
                if i != j {
                    self.matrix[(place(j), place(i))] += gram[i * width + j];
                }
            }
            self.right[place(i)] += gram[(width - 1) * width + i];
        }
        self.squares += gram[width * width - 1];
    }
}

struct ChunkGram<'a> {
    builder: &'a RowBuilder<'a>,
    packets: &'a Packets,
    chunk: &'a Chunk,
}

impl Kernel for ChunkGram<'_> {
    type Output = Vec<f64>;

    #[inline(always)]
    fn run<I: Isa>(self) -> Vec<f64> {
        let count = self.chunk.packets.len();
        let (rows, width) = (self.builder.rows(), self.builder.width());
        let group = &self.builder.point.setup.groups[self.chunk.group];
        let mut columns = Columns::new(width, rows * count);
        let mut sweep = self.builder.scratch();
        for (index, packet) in self.packets.of(self.chunk).enumerate() {
            self.builder.fill::<I>(&packet, group, &mut sweep, &mut columns, index * rows);
        }
        let mut gram = vec![0.0; width * width];
        columns.add_gram::<I>(rows * count, &mut gram);
        gram
    }
}

/// Accumulates the normal equations; the sum runs over the chunks in order, whatever the threads.
///
/// # Errors
/// [`EstimateError::Kinematics`].
pub fn normal_equations(
    problem: &Problem,
    packets: &Packets,
    point: Point,
    weighting: Weighting,
) -> Result<Normal, EstimateError> {
    if problem.measurements.is_distances() {
        return distance::normal_equations(problem, point, weighting);
    }
    let builder = RowBuilder::new(problem, point, weighting);
    let gram = |chunk: &Chunk| dispatch(ChunkGram { builder: &builder, packets, chunk });
    let mut normal = Normal::zeros(builder.layout.len());
    let threaded = rayon::current_num_threads() > 1 && packets.len() * LANES > THREADED_POSES;
    if threaded {
        let grams: Vec<Vec<f64>> = packets.chunks.par_iter().map(gram).collect();
        for (chunk, gram) in packets.chunks.iter().zip(&grams) {
            normal.add_chunk(gram, &builder.layout, chunk.group);
        }
    } else {
        for chunk in &packets.chunks {
            normal.add_chunk(&gram(chunk), &builder.layout, chunk.group);
        }
    }
    Ok(normal)
}
