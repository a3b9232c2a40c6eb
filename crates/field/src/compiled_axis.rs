//! The memberships of eight poses along one axis, without branches that depend on them.

use std::f64::consts::TAU;

use truearm_kinematics::{Isa, LANES, Lane};

use crate::cells::Axis;
use crate::kernel::InputKind;

/// Added and taken away it rounds to a whole number.
const ROUNDING: f64 = 1.5 * (1_u64 << 52) as f64;
/// Added to a whole number it leaves that number in the lowest bits.
const WHOLE: f64 = (1_u64 << 52) as f64;

/// Cells that eight values excite, and how much.
#[derive(Debug, Clone, Copy)]
pub struct Excited<const K: usize> {
    /// Cell of each grade, always one that exists.
    pub cell: [[u32; LANES]; K],
    /// Membership grades; zero beyond the axis.
    pub grade: [Lane; K],
}

impl<const K: usize> Excited<K> {
    /// No membership at all.
    pub const NONE: Self = Self { cell: [[0; LANES]; K], grade: [Lane::ZERO; K] };
}

/// An axis with its constants worked out.
#[derive(Debug, Clone, PartialEq)]
pub struct CompiledAxis {
    /// Index of the input.
    pub input: usize,
    scale: f64,
    origin: f64,
    per_spacing: f64,
    /// Period of the scaled value and the middle of the turn to fold to; none on an open line.
    turn: Option<(f64, f64)>,
    count: f64,
    closed: bool,
    cubic: bool,
}

impl CompiledAxis {
    pub fn new(input: usize, axis: &Axis) -> Self {
        let count = axis.count as f64;
        let period = match axis.input.kind {
            InputKind::Angle => Some(TAU),
            InputKind::Line => axis.closed.then_some(axis.spacing * count),
        };
        Self {
            input,
            scale: axis.input.scale,
            origin: axis.origin,
            per_spacing: 1.0 / axis.spacing,
            turn: period.map(|period| (period, 0.5 * axis.spacing * (count - 1.0))),
            count,
            closed: axis.closed,
            cubic: axis.degree == 3,
        }
    }

    /// Cells and grades of eight raw values.
    #[inline(always)]
    pub fn excite<I: Isa, const K: usize>(&self, values: Lane, excited: &mut Excited<K>) {
        let mut offset = I::mul_add(values, Lane::splat(self.scale), Lane::splat(-self.origin));
        if let Some((period, middle)) = self.turn {
            let turns = I::mul_add(offset, Lane::splat(1.0 / period), Lane::splat(-middle / period));
            offset = I::mul_add(nearest(turns), Lane::splat(-period), offset);
        }
        let position = offset * self.per_spacing;
        let mut grade = [Lane::ZERO; 4];
        let centre = if self.cubic {
            let below = nearest(position - Lane::splat(0.5));
            cubic::<I>(position - below, &mut grade);
            below
        } else {
            let middle = nearest(position);
            quadratic::<I>(position - middle, &mut grade);
            middle
        };
        for k in 0..K {
            self.place(centre + Lane::splat(k as f64 - 1.0), &mut grade[k], &mut excited.cell[k]);
            excited.grade[k] = grade[k];
        }
    }

    /// Wraps a closed axis's cells; takes the grade of cells beyond an open one.
    #[inline(always)]
    fn place(&self, cell: Lane, grade: &mut Lane, index: &mut [u32; LANES]) {
        let last = self.count - 1.0;
        let mut cell = cell;
        if self.closed {
            for c in &mut cell.0 {
                *c += if *c < 0.0 { self.count } else { 0.0 };
                *c -= if *c > last { self.count } else { 0.0 };
            }
        } else {
            for (g, c) in grade.0.iter_mut().zip(&cell.0) {
                *g = if (*c < 0.0) | (*c > last) { 0.0 } else { *g };
            }
        }
        for (i, c) in index.iter_mut().zip(&cell.0) {
            let high = if *c > 0.0 { *c } else { 0.0 };
            let inside = if high < last { high } else { last };
            *i = (inside + WHOLE).to_bits() as u32;
        }
    }
}

#[inline(always)]
fn nearest(x: Lane) -> Lane {
    (x + Lane::splat(ROUNDING)) - Lane::splat(ROUNDING)
}

/// Quadratic B-spline: three cells.
#[inline(always)]
fn quadratic<I: Isa>(t: Lane, grade: &mut [Lane; 4]) {
    let (low, high) = (Lane::splat(0.5) - t, Lane::splat(0.5) + t);
    grade[0] = low * low * 0.5;
    grade[1] = I::mul_add(-t, t, Lane::splat(0.75));
    grade[2] = high * high * 0.5;
}

/// Cubic B-spline: four cells.
#[inline(always)]
fn cubic<I: Isa>(t: Lane, grade: &mut [Lane; 4]) {
    let s = Lane::splat(1.0) - t;
    let (t2, s2) = (t * t, s * s);
    let two_thirds = Lane::splat(2.0 / 3.0);
    grade[0] = s2 * s * (1.0 / 6.0);
    grade[1] = I::mul_add(t2, t * 0.5 - Lane::splat(1.0), two_thirds);
    grade[2] = I::mul_add(s2, s * 0.5 - Lane::splat(1.0), two_thirds);
    grade[3] = t2 * t * (1.0 / 6.0);
}
