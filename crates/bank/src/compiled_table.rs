//! Weights laid out for evaluation: one output over one input, or many outputs over up to three.
//!
//! The latter are of single precision: what an evaluation of many outputs costs is to fetch them. They are rounded by less than
//! a ten-millionth, some thousandths of a nanometre in the position.

use truearm_kinematics::{Isa, Kernel, LANES, Lane, Pick, Short};

use crate::bank::Block;
use crate::cells::MOST_AXES;
use crate::compiled_axis::{CompiledAxis, Excited};

/// Lanes of outputs whose sums fit into registers.
pub const MOST_LANES: usize = 5;
/// A smaller weight, rad or m, is none: its products would leave the range of normal numbers, where processors are slow.
const LEAST_WEIGHT: f64 = 1e-20;

/// A compiled axis and its index.
pub type Numbered<'a> = (usize, &'a CompiledAxis);

/// One output over one axis.
#[derive(Debug, Clone, PartialEq)]
pub struct Line {
    pub axis: usize,
    /// Which of the single sums it adds to.
    pub single: usize,
    /// (cells,), with those that a turn repeats.
    weights: Vec<f64>,
}

impl Line {
    /// The table of a block over one axis, numbered among the compiled ones, whose first sum is `single`.
    pub fn new(block: &Block, (axis, cells): Numbered<'_>, single: usize) -> Self {
        let mut weights = vec![0.0; cells.row_room()];
        for (cell, weight) in block.weights.iter().enumerate() {
            cells.places(cell).for_each(|place| weights[place] = *weight);
        }
        Self { axis, single, weights }
    }

    /// Adds to the single sums of up to 8 poses.
    #[inline(always)]
    pub fn add<I: Isa, const K: usize>(&self, excited: &[Excited<K>], poses: usize, singles: &mut [Lane]) {
        let excited = &excited[self.axis];
        let sum = &mut singles[self.single];
        *sum = self.sum::<I, K>(excited, &excited.grade, poses, *sum);
    }

    /// `start` and the weights that up to 8 poses excite, each times its factor; a single pose's in all lanes.
    #[inline(always)]
    pub fn sum<I: Isa, const K: usize>(
        &self,
        excited: &Excited<K>,
        factors: &[Lane; K],
        poses: usize,
        start: Lane,
    ) -> Lane {
        let mut weights = [Lane::ZERO; K];
        if poses == LANES {
            for p in 0..LANES {
                self.take(excited.cell[0][p], p, &mut weights);
            }
        } else if poses == 1 {
            let first = excited.cell[0][0] as usize;
            for (lane, weight) in weights.iter_mut().zip(&self.weights[first..first + K]) {
                *lane = Lane::splat(*weight);
            }
        } else {
            for p in 0..poses.min(LANES) {
                self.take(excited.cell[0][p], p, &mut weights);
            }
        }
        let mut sum = start;
        for k in 0..K {
            sum = I::mul_add(factors[k], weights[k], sum);
        }
        sum
    }

    #[inline(always)]
    fn take<const K: usize>(&self, first: u64, pose: usize, weights: &mut [Lane; K]) {
        let row = &self.weights[first as usize..first as usize + K];
        for k in 0..K {
            weights[k].0[pose] = row[k];
        }
    }
}

/// All blocks with the same outputs.
#[derive(Debug, Clone, PartialEq)]
pub struct Sheet {
    pub outputs: Vec<usize>,
    tables: Vec<Table>,
    /// Of all tables, (rows, cells, lanes).
    weights: Vec<Short>,
    /// How the sums reach the parameters.
    ways: Vec<Way>,
    /// Where in the single sums the numbers of each lane begin; empty if they begin with nothing.
    begin: Vec<Pick>,
}

/// From sums to eight parameters.
#[derive(Debug, Clone, PartialEq)]
struct Way {
    /// First of the parameters, a multiple of eight.
    parameter: usize,
    /// First of the two lanes of sums.
    lane: usize,
    pick: Pick,
}

/// One block over up to three axes.
#[derive(Debug, Clone, PartialEq)]
struct Table {
    /// Its first cell in the sheet.
    first: usize,
    /// Its cells, with those that a turn repeats.
    cells: usize,
    /// The axis along rows.
    last: usize,
    /// Cells of a row, with those that a turn repeats: what is excited together lies together.
    row_cells: usize,
    /// The other axes, each with its cells.
    outer: Vec<(usize, usize)>,
    /// Whether all its axes close.
    closed: bool,
}

/// A row of a table that eight poses excite.
#[derive(Debug, Clone, Copy)]
pub struct Row {
    /// First excited cell, in the sheet.
    cell: [u64; LANES],
    /// Product of the grades along the other axes.
    grade: Short,
}

impl Row {
    /// Without any effect.
    pub const NONE: Self = Self { cell: [0; LANES], grade: Short::ZERO };
}

impl Sheet {
    /// No tables yet for the parameters `outputs`.
    pub fn new(outputs: &[usize]) -> Self {
        Self {
            outputs: outputs.to_vec(),
            tables: Vec::new(),
            weights: Vec::new(),
            ways: ways(outputs),
            begin: Vec::new(),
        }
    }

    /// Lets the sums begin with single ones of the given outputs; whether it could.
    pub fn begin_with(&mut self, singles: &[usize]) -> bool {
        let known = singles.iter().all(|output| self.outputs.contains(output));
        if !known || singles.len() > LANES {
            return false;
        }
        let source = |output| singles.iter().position(|single| single == output);
        let lanes = self.outputs.chunks(LANES);
        self.begin = lanes.map(|outputs| Pick::new(outputs.iter().map(source))).collect();
        true
    }

    fn lanes(&self) -> usize {
        self.outputs.len().div_ceil(LANES)
    }

    /// Rows that a pose excites, with so many cells excited along each axis.
    pub fn row_count(&self, active: usize) -> usize {
        self.tables.iter().map(|table| table.row_count(active)).sum()
    }

    /// Takes in a block's outputs from `offset` on, over the given axes.
    ///
    /// Larger blocks come first: one over a single axis that closes is added to a table over it and others that close,
    /// whose grades add up to one.
    pub fn push(&mut self, block: &Block, offset: usize, axes: &[Numbered<'_>]) {
        let axes = &axes[..axes.len().min(MOST_AXES)];
        let Some((last, outer)) = axes.split_last() else { return };
        let lanes = self.lanes();
        let outer: Vec<(usize, usize)> = outer.iter().map(|&(axis, cells)| (axis, cells.room())).collect();
        let table = Table {
            first: self.weights.len() / lanes,
            cells: outer.iter().map(|axis| axis.1).product::<usize>() * last.1.row_room(),
            last: last.0,
            row_cells: last.1.row_room(),
            outer,
            closed: axes.iter().all(|axis| axis.1.is_closed()),
        };
        let mut weights = vec![Short::ZERO; table.cells * lanes];
        for (cell, source) in block.weights.chunks_exact(block.outputs.len()).enumerate() {
            for place in places(axes, cell) {
                let target = &mut weights[place * lanes..][..lanes];
                let source = &source[offset..offset + self.outputs.len()];
                for (i, weight) in source.iter().enumerate().filter(|(_, weight)| weight.abs() > LEAST_WEIGHT)
                {
                    target[i / LANES].0[i % LANES] = *weight as f32;
                }
            }
        }
        let Self { tables, weights: all, .. } = self;
        if !tables.iter().any(|larger| larger.absorb(&table, all, &weights, lanes)) {
            tables.push(table);
            all.extend(weights);
        }
    }

    /// Adds to the outputs (up to 8, `width`) of the poses; of `singles` each lane is a pose's.
    #[inline(always)]
    pub fn add<I: Isa, const K: usize>(
        &self,
        excited: &[Excited<K>],
        singles: &[Lane; LANES],
        rows: &mut [Row],
        out: &mut [f64],
        width: usize,
    ) {
        let mut free = &mut rows[..];
        for table in &self.tables {
            let (own, rest) = free.split_at_mut(table.row_count(K));
            table.excite::<I, K>(excited, own);
            free = rest;
        }
        let to = Poses { sheet: self, excited, singles, rows, out, width };
        match self.lanes() {
            1 => I::call(Wide::<K, 1>(to)),
            2 => I::call(Wide::<K, 2>(to)),
            3 => I::call(Wide::<K, 3>(to)),
            4 => I::call(Wide::<K, 4>(to)),
            _ => I::call(Wide::<K, MOST_LANES>(to)),
        }
    }
}

/// Where the sums of up to eight poses come from, and where they go.
struct Poses<'a, const K: usize> {
    sheet: &'a Sheet,
    excited: &'a [Excited<K>],
    singles: &'a [Lane; LANES],
    rows: &'a [Row],
    out: &'a mut [f64],
    width: usize,
}

/// The sums of a sheet that is so many lanes wide.
struct Wide<'a, const K: usize, const W: usize>(Poses<'a, K>);

impl<const K: usize, const W: usize> Kernel for Wide<'_, K, W> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self) {
        let Poses { sheet, excited, singles, rows, out, width } = self.0;
        let (cells, _) = sheet.weights.as_chunks::<W>();
        for (pose, out) in (0..LANES).zip(out.chunks_exact_mut(width)) {
            let mut sums = [Lane::ZERO; W];
            for (sum, pick) in sums.iter_mut().zip(&sheet.begin) {
                *sum = I::pick(&singles[pose], &Lane::ZERO, pick);
            }
            let mut rows = rows.iter();
            for table in &sheet.tables {
                let mut grades = [Lane::ZERO; K];
                for (grade, along) in grades.iter_mut().zip(&excited[table.last].grade) {
                    *grade = Lane::splat(along.0[pose]);
                }
                // Cell by cell along the last axis first: its grades then count once for all rows.
                let mut parts = [[Short::ZERO; W]; K];
                let mut own = rows.by_ref().take(table.row_count(K));
                if table.outer.is_empty() {
                    let first = own.next().map_or(0, |row| row.cell[pose] as usize);
                    parts.copy_from_slice(&cells[first..first + K]);
                }
                for row in own {
                    let (first, grade) = (row.cell[pose] as usize, Short::splat(row.grade.0[pose]));
                    for (part, weights) in parts.iter_mut().zip(&cells[first..first + K]) {
                        for w in 0..W {
                            part[w] = I::mul_add_short(grade, weights[w], part[w]);
                        }
                    }
                }
                for (grade, part) in grades.iter().zip(&parts) {
                    for w in 0..W {
                        sums[w] = I::mul_add(*grade, I::widen(part[w]), sums[w]);
                    }
                }
            }
            let mut found = [Lane::ZERO; MOST_LANES + 1];
            found[..W].copy_from_slice(&sums);
            for way in &sheet.ways {
                let last = out.len().min(way.parameter + LANES);
                let out = &mut out[way.parameter..last];
                I::add_picked(&found[way.lane], &found[way.lane + 1], &way.pick, out);
            }
        }
    }
}

/// How sums of the given outputs reach their parameters.
fn ways(outputs: &[usize]) -> Vec<Way> {
    let mut left: Vec<(usize, usize)> = outputs.iter().copied().enumerate().collect();
    let mut ways = Vec::new();
    while let Some(&(sum, output)) = left.first() {
        let (parameter, lane) = (output / LANES * LANES, sum / LANES);
        let mut from = [None; LANES];
        left.retain(|&(sum, output)| {
            let (here, source) = (output.wrapping_sub(parameter), sum - lane * LANES);
            let taken = here < LANES && source < 2 * LANES && from[here].is_none();
            if taken {
                from[here] = Some(source);
            }
            !taken
        });
        ways.push(Way { parameter, lane, pick: Pick::new(from) });
    }
    ways
}

/// Where a table over the given axes keeps a cell of their grid.
fn places(axes: &[Numbered<'_>], cell: usize) -> impl Iterator<Item = usize> {
    let (mut rest, mut start, mut stride) = (cell, 0, 1);
    let mut along_row = None;
    for (_, axis) in axes.iter().rev() {
        let along = rest % axis.cell_count();
        rest /= axis.cell_count();
        if along_row.is_none() {
            along_row = Some(axis.places(along));
            stride = axis.row_room();
        } else {
            start += axis.place(along) * stride;
            stride *= axis.room();
        }
    }
    along_row.into_iter().flatten().map(move |place| start + place)
}

impl Table {
    fn row_count(&self, active: usize) -> usize {
        active.pow(self.outer.len() as u32)
    }

    /// Takes in a table over one of its axes, where that changes no sum; says whether it did.
    ///
    /// `all` are the weights of the sheet, `weights` those of the other table.
    fn absorb(&self, other: &Table, all: &mut [Short], weights: &[Short], lanes: usize) -> bool {
        if !other.outer.is_empty() || !self.closed || !other.closed {
            return false;
        }
        let mut stride = (self.last == other.last).then_some((1, self.row_cells));
        let mut behind = self.row_cells;
        for &(axis, cells) in self.outer.iter().rev() {
            if axis == other.last {
                stride = Some((behind, cells));
            }
            behind *= cells;
        }
        let Some((stride, count)) = stride else { return false };
        let own = all[self.first * lanes..].chunks_exact_mut(lanes).take(self.cells);
        for (cell, target) in own.enumerate() {
            let along = cell / stride % count;
            for (sum, weight) in target.iter_mut().zip(&weights[along * lanes..]) {
                *sum += *weight;
            }
        }
        true
    }

    /// The rows that eight poses excite.
    #[inline(always)]
    fn excite<I: Isa, const K: usize>(&self, excited: &[Excited<K>], rows: &mut [Row]) {
        let row_cells = self.row_cells as u64;
        let mut first = excited[self.last].cell[0];
        for cell in &mut first {
            *cell += self.first as u64;
        }
        match self.outer[..] {
            [(axis, _)] => {
                let outer = &excited[axis];
                for (k, row) in rows.iter_mut().enumerate().take(K) {
                    *row = Row {
                        cell: beyond(&first, &outer.cell[k], row_cells),
                        grade: I::narrow(outer.grade[k]),
                    };
                }
            }
            [(axis, _), (next, cells)] => {
                let (outer, inner) = (&excited[axis], &excited[next]);
                for (j, rows) in rows.chunks_exact_mut(K).enumerate().take(K) {
                    let start = beyond(&first, &outer.cell[j], cells as u64 * row_cells);
                    for (k, row) in rows.iter_mut().enumerate() {
                        let cell = beyond(&start, &inner.cell[k], row_cells);
                        *row = Row { cell, grade: I::narrow(outer.grade[j] * inner.grade[k]) };
                    }
                }
            }
            _ => rows.fill(Row { cell: first, grade: Short::splat(1.0) }),
        }
    }
}

/// So many cells beyond `start` for each of `steps`.
#[inline(always)]
fn beyond(start: &[u64; LANES], steps: &[u64; LANES], cells: u64) -> [u64; LANES] {
    let mut found = *start;
    for (found, steps) in found.iter_mut().zip(steps) {
        *found += steps * cells;
    }
    found
}
