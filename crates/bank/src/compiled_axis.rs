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
        *excited = self.rule().excite::<I, K>(values);
    }

    #[inline(always)]
    fn rule(&self) -> Rule {
        let Self { scale, origin, per_spacing, lowest, highest, whole, .. } = *self;
        let turn = self.turn.as_ref().map(|turn| [turn.period, turn.per_period, turn.middle]);
        Rule {
            scale: Lane::splat(scale),
            origin: Lane::splat(origin),
            per_spacing: Lane::splat(per_spacing),
            turn: turn.map(|turn| Lane::splat_all(&turn)),
            bounds: Lane::splat_all(&[lowest, highest]),
            whole: Lane::splat(whole),
            wrap: [self.wrap; LANES],
            cubic: self.cubic,
        }
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
}

/// How values become cells and grades, lane by lane: eight poses along one axis, or one along eight.
#[derive(Debug, Clone, PartialEq)]
struct Rule {
    scale: Lane,
    origin: Lane,
    per_spacing: Lane,
    /// Period, its inverse, and the middle of the axis in turns from its origin; zeros in the lanes of open lines.
    turn: Option<[Lane; 3]>,
    /// Lowest and highest centre.
    bounds: [Lane; 2],
    whole: Lane,
    wrap: [i64; LANES],
    cubic: bool,
}

impl Rule {
    #[inline(always)]
    fn excite<I: Isa, const K: usize>(&self, values: Lane) -> Excited<K> {
        let mut offset = I::mul_add(values, self.scale, -self.origin);
        if let Some([period, per_period, middle]) = self.turn {
            let turns = I::mul_add(offset, per_period, -middle);
            offset = I::mul_add(nearest(turns), -period, offset);
        }
        let position = offset * self.per_spacing;
        let mut excited = Excited::NONE;
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
        excited
    }

    /// Indices of the cells around a centre, in the tables.
    #[inline(always)]
    fn cells<const K: usize>(&self, centre: Lane, cell: &mut [[u64; LANES]; K]) {
        let [lowest, highest] = &self.bounds;
        let high = centre.where_below(*lowest, *lowest, centre);
        let inside = high.where_below(*highest, high, *highest);
        let mut first = [0_i64; LANES];
        for (i, first) in first.iter_mut().enumerate() {
            let index = (inside.0[i] + self.whole.0[i]).to_bits() as i64 - WHOLE.to_bits() as i64;
            *first = once_around(index, self.wrap[i]);
        }
        for (k, cell) in cell.iter_mut().enumerate() {
            for (i, cell) in cell.iter_mut().enumerate() {
                *cell = once_around(first[i] + k as i64, self.wrap[i]) as u64;
            }
        }
    }
}

/// Up to eight axes of one degree side by side, for a single pose.
#[derive(Debug, Clone, PartialEq)]
pub struct Abreast {
    /// Indices of the axes.
    axes: Vec<usize>,
    /// Index of each one's input; lanes without an axis repeat the first one.
    inputs: [usize; LANES],
    rule: Rule,
}

impl Abreast {
    /// All axes, eight at a time.
    pub fn of(axes: &[CompiledAxis]) -> Vec<Self> {
        let alike = |cubic| axes.iter().enumerate().filter(move |axis| axis.1.cubic == cubic).collect();
        let kinds: [Vec<(usize, &CompiledAxis)>; 2] = [alike(false), alike(true)];
        kinds.iter().flat_map(|axes| axes.chunks(LANES)).map(Self::new).collect()
    }

    fn new(axes: &[(usize, &CompiledAxis)]) -> Self {
        let lanes: [&CompiledAxis; LANES] = std::array::from_fn(|i| axes.get(i).unwrap_or(&axes[0]).1);
        let rules = lanes.map(CompiledAxis::rule);
        let each = |value: fn(&Rule) -> Lane| Lane::from_fn(|i| value(&rules[i]).0[i]);
        let still = [Lane::ZERO; 3];
        let turn: [Lane; 3] =
            std::array::from_fn(|k| Lane::from_fn(|i| rules[i].turn.unwrap_or(still)[k].0[i]));
        Self {
            axes: axes.iter().map(|axis| axis.0).collect(),
            inputs: lanes.map(|axis| axis.input),
            rule: Rule {
                scale: each(|rule| rule.scale),
                origin: each(|rule| rule.origin),
                per_spacing: each(|rule| rule.per_spacing),
                turn: rules.iter().any(|rule| rule.turn.is_some()).then_some(turn),
                bounds: [each(|rule| rule.bounds[0]), each(|rule| rule.bounds[1])],
                whole: each(|rule| rule.whole),
                wrap: std::array::from_fn(|i| rules[i].wrap[i]),
                cubic: rules[0].cubic,
            },
        }
    }

    /// Cells and grades of a pose, whose raw values are in the first lane of each input, into all lanes of `excited`.
    #[inline(always)]
    pub fn excite<I: Isa, const K: usize>(&self, input: &impl Fn(usize) -> Lane, excited: &mut [Excited<K>]) {
        let mut values = Lane::ZERO;
        for i in 0..LANES {
            values.0[i] = input(self.inputs[i]).0[0];
        }
        let found = self.rule.excite::<I, K>(values);
        for (i, axis) in self.axes.iter().enumerate() {
            let excited = &mut excited[*axis];
            for k in 0..K {
                excited.cell[k] = [found.cell[k][i]; LANES];
                excited.grade[k] = Lane::splat(found.grade[k].0[i]);
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
