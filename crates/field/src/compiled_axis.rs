//! The memberships of eight poses along one axis, without branches that depend on them.

use std::f64::consts::TAU;

use truearm_kinematics::{Isa, LANES, Lane};

use crate::cells::{Axis, MOST_ACTIVE};
use crate::kernel::InputKind;
use crate::spline::{cubic, cubic_slopes, quadratic, quadratic_slopes};

/// Added and taken away it rounds to a whole number.
const ROUNDING: f64 = 1.5 * (1_u64 << 52) as f64;
/// Added to a whole number it leaves that number in the lowest bits.
const WHOLE: f64 = (1_u64 << 52) as f64;

/// Cells without weights beyond each end of an open axis: what lies outside excites them alone.
const EMPTY: usize = MOST_ACTIVE;
/// More than any index.
const NEVER: i64 = 1 << 31;

/// Cells that eight values excite, and how much.
#[derive(Debug, Clone, Copy)]
pub struct Excited<const K: usize> {
    /// Cell of each grade, always one that tables have.
    pub cell: [[u64; LANES]; K],
    /// Membership grades.
    pub grade: [Lane; K],
}

impl<const K: usize> Excited<K> {
    /// No membership at all.
    pub const NONE: Self = Self { cell: [[0; LANES]; K], grade: [Lane::ZERO; K] };
}

/// How scaled values fold to one turn.
#[derive(Debug, Clone, PartialEq)]
struct Turn {
    period: f64,
    per_period: f64,
    /// Middle of the axis, in turns from its origin.
    middle: f64,
}

/// An axis with its constants worked out.
#[derive(Debug, Clone, PartialEq)]
pub struct CompiledAxis {
    /// Index of the input.
    pub input: usize,
    scale: f64,
    origin: f64,
    per_spacing: f64,
    /// None on an open line.
    turn: Option<Turn>,
    /// Bounds of the centre cell: beyond them all excited cells are empty.
    lowest: f64,
    highest: f64,
    /// Added to the centre it leaves the first excited cell's index in the lowest bits, a turn more on a closed axis.
    whole: f64,
    /// Cells of a turn; more than there are on an open axis.
    wrap: i64,
    count: usize,
    closed: bool,
    cubic: bool,
}

impl CompiledAxis {
    /// The axis of an input, from 0.
    pub fn new(input: usize, axis: &Axis) -> Self {
        let count = axis.count as f64;
        let period = match axis.input.kind {
            InputKind::Angle => Some(TAU),
            InputKind::Line => axis.closed.then_some(axis.spacing * count),
        };
        let beyond = EMPTY as f64 - 1.0;
        Self {
            input,
            scale: axis.input.scale,
            origin: axis.origin,
            per_spacing: 1.0 / axis.spacing,
            turn: period.map(|period| Turn {
                period,
                per_period: 1.0 / period,
                middle: 0.5 * axis.spacing * (count - 1.0) / period,
            }),
            lowest: if axis.closed { -1.0 } else { -beyond },
            highest: if axis.closed { count } else { count + 1.0 },
            whole: WHOLE + if axis.closed { count - 1.0 } else { beyond },
            wrap: if axis.closed { axis.count as i64 } else { NEVER },
            count: axis.count,
            closed: axis.closed,
            cubic: axis.degree == 3,
        }
    }

    /// Cells that tables have along this axis, with the empty ones beyond the ends of an open axis.
    pub fn room(&self) -> usize {
        if self.closed { self.count } else { self.count + 2 * EMPTY }
    }

    /// Where tables keep a cell of the axis.
    pub fn place(&self, cell: usize) -> usize {
        if self.closed { cell } else { cell + EMPTY }
    }

    /// Cells of a row along this axis: a turn's first ones again behind its last, so that no run of excited cells breaks.
    pub fn row_room(&self) -> usize {
        self.room() + if self.closed { MOST_ACTIVE - 1 } else { 0 }
    }

    /// Where rows keep a cell of the axis.
    pub fn places(&self, cell: usize) -> impl Iterator<Item = usize> + use<> {
        let turn = if self.closed { self.count } else { self.row_room() };
        (self.place(cell)..self.row_room()).step_by(turn)
    }

    /// Cells of the axis.
    pub fn cell_count(&self) -> usize {
        self.count
    }

    /// Whether grades add up to one everywhere.
    pub fn is_closed(&self) -> bool {
        self.closed
    }

    /// Cells and grades of eight raw values.
    #[inline(always)]
    pub fn excite<I: Isa, const K: usize>(&self, values: Lane, excited: &mut Excited<K>) {
        let mut offset = I::mul_add(values, Lane::splat(self.scale), Lane::splat(-self.origin));
        if let Some(turn) = &self.turn {
            let turns = I::mul_add(offset, Lane::splat(turn.per_period), Lane::splat(-turn.middle));
            offset = I::mul_add(nearest(turns), Lane::splat(-turn.period), offset);
        }
        let position = offset * self.per_spacing;
        let centre = if self.cubic {
            let below = nearest(position - Lane::splat(0.5));
            excited.grade.copy_from_slice(&cubic::<I, Lane>(position - below)[..K]);
            below
        } else {
            let middle = nearest(position);
            let [low, mid, high] = quadratic::<I, Lane>(position - middle);
            excited.grade.copy_from_slice(&[low, mid, high, Lane::ZERO][..K]);
            middle
        };
        self.cells(centre, &mut excited.cell);
    }

    /// Derivatives of the grades by the raw values.
    #[inline(always)]
    pub fn slopes<I: Isa, const K: usize>(&self, excited: &Excited<K>) -> [Lane; K] {
        let mut grade = [Lane::ZERO; MOST_ACTIVE];
        grade[..K].copy_from_slice(&excited.grade);
        let [first, second, third, last] = grade;
        let slopes = if self.cubic {
            cubic_slopes::<I, Lane>([first, second, third, last])
        } else {
            let [low, mid, high] = quadratic_slopes::<I, Lane>([first, second, third]);
            [low, mid, high, Lane::ZERO]
        };
        let mut found = [Lane::ZERO; K];
        for k in 0..K {
            found[k] = slopes[k] * (self.scale * self.per_spacing);
        }
        found
    }

    /// Indices of the cells around a centre, in the tables.
    #[inline(always)]
    fn cells<const K: usize>(&self, centre: Lane, cell: &mut [[u64; LANES]; K]) {
        let mut first = [0_i64; LANES];
        for (first, &centre) in first.iter_mut().zip(&centre.0) {
            let high = if centre > self.lowest { centre } else { self.lowest };
            let inside = if high < self.highest { high } else { self.highest };
            let index = (inside + self.whole).to_bits() as i64 - WHOLE.to_bits() as i64;
            *first = once_around(index, self.wrap);
        }
        for (k, cell) in cell.iter_mut().enumerate() {
            for (cell, first) in cell.iter_mut().zip(&first) {
                *cell = once_around(first + k as i64, self.wrap) as u64;
            }
        }
    }
}

/// A turn less, where that leaves an index.
#[inline(always)]
fn once_around(index: i64, wrap: i64) -> i64 {
    let less = index - wrap;
    if less < 0 { index } else { less }
}

#[inline(always)]
fn nearest(x: Lane) -> Lane {
    (x + Lane::splat(ROUNDING)) - Lane::splat(ROUNDING)
}
