//! Fuzzy association cells: B-spline memberships over one input, and grids of them over several.

use std::f64::consts::TAU;

use crate::kernel::{Input, InputKind};
use crate::spline::{Alone, cubic, quadratic};

/// Largest number of cells that are active at once along one input (cubic memberships).
pub const MOST_ACTIVE: usize = 4;

/// Inputs of a grid at the most.
pub const MOST_AXES: usize = 3;

/// Cells at equal distances along one input.
#[derive(Debug, Clone, PartialEq)]
pub struct Axis {
    /// How raw values are scaled.
    pub input: Input,
    /// Scaled value at the centre of the first cell.
    pub origin: f64,
    /// Distance of neighbouring cells, scaled.
    pub spacing: f64,
    /// Number of cells.
    pub count: usize,
    /// Whether the last cell is the first one's neighbour (a full turn).
    pub closed: bool,
    /// Degree of the memberships, 2 or 3.
    pub degree: usize,
}

/// An axis as calibrations store it: is an angle, scale, origin, spacing, count, closed, degree.
pub type StoredAxis = (bool, f64, f64, f64, usize, bool, usize);

/// Cells that a value excites, and how much; grades add up to one where the axis covers the value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Active {
    /// Cell of each grade.
    pub cell: [u32; MOST_ACTIVE],
    /// Membership grades; zero beyond the axis.
    pub grade: [f64; MOST_ACTIVE],
}

/// Cells reach this many length scales beyond the data: there the kernel has fallen to one percent.
const MARGIN: f64 = 3.0;
/// Widest spacing, so that the first harmonics of a turn are well represented.
const WIDEST: f64 = 0.6;
/// More cells than this along one input are no calibration of ours.
const MOST_CELLS: usize = 100_000;
/// Part of a turn by which the cells of a closed axis may miss it.
const CLOSES: f64 = 1e-9;
/// Cells of one cycle of a wave: they bend a thousandth of it at most.
const CELLS_OF_CYCLE: usize = 16;
/// Finest spacing: more cells than this on a turn are beyond any data set.
const FINEST: f64 = 0.004;

impl Axis {
    /// An axis for the values of one input (raw), with a length scale, about so far from cell to cell.
    pub fn covering(
        input: Input,
        values: impl Iterator<Item = f64>,
        length: f64,
        spacing: f64,
        degree: usize,
    ) -> Self {
        let spacing = spacing.clamp(FINEST, WIDEST);
        let mut scaled: Vec<f64> = values.map(|value| input.scale * value).collect();
        let (low, high) = match input.kind {
            InputKind::Line => range(&scaled),
            InputKind::Angle => arc(&mut scaled),
        };
        let margin = MARGIN * length + spacing;
        let open = high - low + 2.0 * margin;
        if input.kind == InputKind::Angle && open >= TAU - spacing {
            let count = ((TAU / spacing).ceil() as usize).max(2 * MOST_ACTIVE);
            return Self { input, origin: low, spacing: TAU / count as f64, count, closed: true, degree };
        }
        // Values that need more are of a file that was altered; they lie beyond the cells.
        let count = ((open / spacing).ceil() as usize).min(MOST_CELLS - 1) + 1;
        let middle = 0.5 * (low + high);
        let origin = middle - 0.5 * spacing * (count - 1) as f64;
        Self { input, origin, spacing, count, closed: false, degree }
    }

    /// An axis for waves of so much phase by the value: cells over one cycle.
    pub fn over_cycle(cycles: f64, degree: usize) -> Self {
        let input = Input { kind: InputKind::Angle, scale: cycles };
        let spacing = TAU / CELLS_OF_CYCLE as f64;
        Self { input, origin: 0.0, spacing, count: CELLS_OF_CYCLE, closed: true, degree }
    }

    /// The axis that is stored so; not yet checked.
    pub fn restored((angle, scale, origin, spacing, count, closed, degree): StoredAxis) -> Self {
        let kind = if angle { InputKind::Angle } else { InputKind::Line };
        Self { input: Input { kind, scale }, origin, spacing, count, closed, degree }
    }

    /// How it is stored.
    pub fn stored(&self) -> StoredAxis {
        let angle = self.input.kind == InputKind::Angle;
        (angle, self.input.scale, self.origin, self.spacing, self.count, self.closed, self.degree)
    }

    /// Whether it can be evaluated: positive finite numbers, cells enough and not too many, a known degree.
    pub fn is_sound(&self) -> bool {
        let fewest = if self.closed { MOST_ACTIVE } else { 1 };
        let positive = [self.spacing, self.input.scale].iter().all(|x| x.is_finite() && *x > 0.0);
        let cells = (fewest..=MOST_CELLS).contains(&self.count);
        let turn = self.spacing * self.count as f64;
        let closes = !self.closed || (turn - TAU).abs() < TAU * CLOSES;
        positive && closes && self.origin.is_finite() && cells && matches!(self.degree, 2 | 3)
    }

    /// First cell, beyond the axis where it may be, and grades of the cells that a raw value excites.
    #[inline]
    fn unbounded(&self, value: f64) -> (i64, [f64; MOST_ACTIVE]) {
        let mut offset = self.input.scale * value - self.origin;
        if self.input.kind == InputKind::Angle {
            // Folded to the turn whose middle is the axis's middle, so that the seam lies where no cells are.
            let half = 0.5 * self.spacing * (self.count - 1) as f64;
            offset -= TAU * ((offset - half) / TAU).round();
        }
        let position = offset / self.spacing;
        if self.degree == 2 {
            let middle = position.round();
            let [low, mid, high] = quadratic::<Alone, f64>(position - middle);
            return (middle as i64 - 1, [low, mid, high, 0.0]);
        }
        let below = position.floor();
        (below as i64 - 1, cubic::<Alone, f64>(position - below))
    }

    /// The cells that a raw value excites.
    #[inline]
    pub fn active(&self, value: f64) -> Active {
        let (first, grades) = self.unbounded(value);
        let mut active = Active::NONE;
        for (k, grade) in grades.into_iter().enumerate() {
            let cell = first + k as i64;
            if self.closed {
                active.cell[k] = cell.rem_euclid(self.count as i64) as u32;
                active.grade[k] = grade;
            } else if (0..self.count as i64).contains(&cell) {
                active.cell[k] = cell as u32;
                active.grade[k] = grade;
            }
        }
        active
    }

    /// Scaled value at the centre of a cell.
    pub fn centre(&self, cell: usize) -> f64 {
        self.origin + self.spacing * cell as f64
    }
}

/// The least and the largest of some values.
pub fn range<'a>(values: impl IntoIterator<Item = &'a f64>) -> (f64, f64) {
    values.into_iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &x| (low.min(x), high.max(x)))
}

/// The shortest arc that holds all angles: the turn without its largest gap.
fn arc(values: &mut [f64]) -> (f64, f64) {
    values.iter_mut().for_each(|x| *x = x.rem_euclid(TAU));
    values.sort_by(f64::total_cmp);
    let last = values.len() - 1;
    let mut best = (TAU - values[last] + values[0], 0);
    for k in 0..last {
        let gap = values[k + 1] - values[k];
        if gap > best.0 {
            best = (gap, k + 1);
        }
    }
    (values[best.1], values[best.1] + TAU - best.0)
}

/// A grid of cells over one to three inputs, the last running fastest.
#[derive(Debug, Clone, PartialEq)]
pub struct Grid {
    /// Index of each axis's input.
    pub inputs: Vec<usize>,
    /// The axes.
    pub axes: Vec<Axis>,
}

impl Grid {
    /// Cells of the grid.
    pub fn cell_count(&self) -> usize {
        self.axes.iter().map(|axis| axis.count).product()
    }

    /// Calls `visit(cell, grade)` for every cell that the inputs' values excite.
    #[inline]
    pub fn visit(&self, values: &[f64], mut visit: impl FnMut(usize, f64)) {
        let active: [Active; 3] = std::array::from_fn(|k| match self.axes.get(k) {
            Some(axis) => axis.active(values[self.inputs[k]]),
            None => Active { grade: [1.0, 0.0, 0.0, 0.0], ..Active::NONE },
        });
        let count = |k: usize| self.axes.get(k).map_or(1, |axis| axis.count);
        for (cell_0, grade_0) in active[0].nonzero() {
            for (cell_1, grade_1) in active[1].nonzero() {
                for (cell_2, grade_2) in active[2].nonzero() {
                    visit((cell_0 * count(1) + cell_1) * count(2) + cell_2, grade_0 * grade_1 * grade_2);
                }
            }
        }
    }
}

impl Active {
    /// No cell at all.
    pub const NONE: Self = Self { cell: [0; MOST_ACTIVE], grade: [0.0; MOST_ACTIVE] };

    /// Excited cells with their grades.
    #[inline]
    pub fn nonzero(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        self.cell
            .iter()
            .zip(&self.grade)
            .filter(|entry| *entry.1 != 0.0)
            .map(|(&cell, &grade)| (cell as usize, grade))
    }

    /// The cells' values by their grades, given those of all cells.
    #[inline]
    pub fn weigh(&self, values: &[f64]) -> f64 {
        self.nonzero().map(|(cell, grade)| grade * values[cell]).sum()
    }
}

/// The prior of one axis's cells, and the kernel between values that it implies through the memberships.
#[derive(Debug, Clone, PartialEq)]
pub struct CellKernel {
    /// The axis.
    pub axis: Axis,
    /// Prior correlation of cells by how many apart they are, (count,), scaled so that a value's variance is one on average.
    pub correlation: Vec<f64>,
}

impl CellKernel {
    /// The prior of an axis's cells under a kernel.
    pub fn new(axis: Axis, kernel: impl Fn(f64) -> f64) -> Self {
        let raw: Vec<f64> = (0..axis.count)
            .map(|apart| kernel(axis.input.distance_of(axis.spacing * apart as f64)))
            .collect();
        let mut cells = Self { axis, correlation: raw };
        const SAMPLES: usize = 16;
        let middle = cells.axis.centre(cells.axis.count / 2);
        let mean = (0..SAMPLES)
            .map(|k| {
                let scaled = middle + cells.axis.spacing * k as f64 / SAMPLES as f64;
                let active = cells.axis.active(scaled / cells.axis.input.scale);
                cells.implied(&active, &active)
            })
            .sum::<f64>()
            / SAMPLES as f64;
        cells.correlation.iter_mut().for_each(|c| *c /= mean);
        cells
    }

    /// Kernel between two values, given the cells that they excite.
    #[inline]
    pub fn implied(&self, a: &Active, b: &Active) -> f64 {
        b.nonzero().map(|(j, grade)| grade * self.with_cell(a, j)).sum()
    }

    /// Kernels between a value and others, given the cells that each excites.
    pub fn kernels<'a>(
        &self,
        here: &'a Active,
        others: impl ExactSizeIterator<Item = &'a Active>,
    ) -> impl Iterator<Item = f64> {
        // What all cells have in common with the value is worth knowing where the others look at most of them.
        let line = (others.len() * MOST_ACTIVE > self.axis.count).then(|| self.line(here));
        others.map(move |other| match &line {
            Some(line) => other.weigh(line),
            None => self.implied(here, other),
        })
    }

    /// Kernel between a value, given the cells that it excites, and each cell, (count,).
    fn line(&self, a: &Active) -> Vec<f64> {
        (0..self.axis.count).map(|j| self.with_cell(a, j)).collect()
    }

    #[inline]
    fn with_cell(&self, a: &Active, j: usize) -> f64 {
        a.nonzero().map(|(i, grade)| grade * self.correlation[i.abs_diff(j)]).sum()
    }

    /// Prior variance at a value, as if the axis went on beyond its last cells.
    pub fn variance(&self, value: f64) -> f64 {
        let (_, grades) = self.axis.unbounded(value);
        let pairs = (0..MOST_ACTIVE).flat_map(|i| (0..MOST_ACTIVE).map(move |j| (i, j)));
        pairs.map(|(i, j)| grades[i] * grades[j] * self.correlation[i.abs_diff(j)]).sum()
    }

    /// Multiplies cell values (outer, count, inner) with the prior correlation along the axis.
    pub fn spread(&self, values: &[f64], inner: usize) -> Vec<f64> {
        let count = self.axis.count;
        let mut out = vec![0.0; values.len()];
        for (block, target) in values.chunks_exact(count * inner).zip(out.chunks_exact_mut(count * inner)) {
            for (i, line) in target.chunks_exact_mut(inner).enumerate() {
                for (j, source) in block.chunks_exact(inner).enumerate() {
                    let factor = self.correlation[i.abs_diff(j)];
                    line.iter_mut().zip(source).for_each(|(x, y)| *x += factor * y);
                }
            }
        }
        out
    }
}
