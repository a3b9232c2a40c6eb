//! Which of the arm's parameters the measurements determine at all, and with what the others are confounded.
//!
//! The columns of the Jacobian at the nominal arm, lengths in mm and angles in 1/300 rad, are taken in order:
//! set-up first, then links in order. A column that the ones before it span is undetermined; its combination
//! of them says with what it is confounded. The count of the others is
//! `rank([arm, set-up]) - rank(set-up)`.
//!
//! Of two confounded columns the earlier one is kept. Between (anti-)parallel axes d is confounded with the
//! next link's d, and Hayati's beta is what describes an error of direction: offer beta there in place of d,
//! on no other link, and the base's row likewise. Offered so, the paper's arm keeps exactly the paper's fifteen;
//! with all five parameters of each row the rank is the same, but others take the place of some of them.

use faer::{Mat, MatRef, concat};

use truearm_kinematics::ANGLE_ARM;

use crate::EstimateError;
use crate::dense::{Orthogonal, singular_values};
use crate::distance;
use crate::layout::{Layout, Problem};
use crate::rows::{Linearised, Point, linearise};
use crate::scale::{PoseRows, column_unit, scaled_matrix};
use crate::setup::Setup;

/// A column counts as spanned when less than this share of it stands out of the others' span.
const INDEPENDENT_SHARE: f64 = 1e-6;
/// A column shorter than this share of the longest one holds nothing but rounding.
const ROUNDING: f64 = 1e-10;
/// Rows that are looked at together: of more, triangular factors take the place of rows.
const ROWS: usize = 3000;
/// Rows a column, of which a triangular factor takes the place.
const TALL: usize = 4;
/// Parts of a combination below this are left out.
const NOTEWORTHY: f64 = 0.02;

/// A parameter that the data cannot tell from a combination of others.
#[derive(Debug, Clone, PartialEq)]
pub struct Confounded {
    /// Index into the problem's columns.
    pub column: usize,
    /// Index into the problem's columns, and its part in the combination (scaled units).
    pub with: Vec<(usize, f64)>,
    /// Whether the set-up (frame, targets) takes part.
    pub with_setup: bool,
}

/// The answer.
#[derive(Debug, Clone, PartialEq)]
pub struct Identifiability {
    /// Indices into the problem's columns that the data determines, ascending.
    pub determined: Vec<usize>,
    /// The others.
    pub undetermined: Vec<Confounded>,
    /// Rank of set-up and arm together.
    pub total_rank: usize,
    /// 2-norm condition number of the determined columns and the set-up, scaled.
    pub condition: f64,
}

/// Asks the measurements' poses, at given link parameters (5 L,), or one set a pose (n, 5 L), and set-up.
///
/// # Errors
/// [`EstimateError::Parameters`], [`EstimateError::Setup`] where these are another problem's,
/// [`EstimateError::Kinematics`].
pub fn identifiability(
    problem: &Problem,
    parameters: &[f64],
    setup: &Setup,
) -> Result<Identifiability, EstimateError> {
    let point = Point { parameters, setup };
    point.check(problem)?;
    let layout = Layout::new(problem);
    let columns = if problem.measurements.is_distances() {
        dense_distances(problem, &layout, point)?
    } else {
        folded_rows(problem, &layout, &linearise(problem, point)?)
    };
    Ok(in_order(columns.as_ref(), layout.len() - layout.arm))
}

fn scale(problem: &Problem, layout: &Layout, column: usize) -> f64 {
    let within = |at: usize| at < layout.frame && at >= 3 || at >= layout.frame + 3 * layout.targets;
    if column < layout.arm {
        return column_unit(problem.columns[column]).recip();
    }
    let anchors = layout.arm + layout.groups * layout.group_width();
    let angle = column < anchors && within((column - layout.arm) % layout.group_width());
    if angle { ANGLE_ARM.recip() } else { 1.0 }
}

/// Scaled columns, set-up first, of all poses; of many the triangular factor, whose columns have the same products.
fn folded_rows(problem: &Problem, layout: &Layout, rows: &Linearised) -> Mat<f64> {
    let poses: Vec<usize> = (0..problem.measurements.pose_count()).collect();
    let parts = poses.chunks((ROWS / rows.rows).max(1)).map(|some| dense_rows(problem, layout, rows, some));
    let none = Mat::zeros(0, layout.len());
    parts.fold(none, |above, below| {
        let both = concat![[above], [below]];
        if both.nrows() > TALL * both.ncols() { Orthogonal::new(both).upper() } else { both }
    })
}

/// Scaled columns, set-up first: rows of some poses, in mm (orientation rows at 300 mm).
fn dense_rows(problem: &Problem, layout: &Layout, rows: &Linearised, poses: &[usize]) -> Mat<f64> {
    let set = problem.measurements;
    let (width, own) = (layout.len(), layout.len() - layout.arm);
    let kinds = PoseRows::new(rows.rows, layout.targets);
    let mut dense = Mat::zeros(poses.len() * rows.rows, width);
    for (index, &pose) in poses.iter().enumerate().filter(|(_, pose)| set.weight[**pose] > 0.0) {
        let group = layout.group(set.group[pose]).start - layout.arm;
        for row in 0..rows.rows {
            let at = pose * rows.rows + row;
            let unit = kinds.unit(row);
            let line = index * rows.rows + row;
            for k in 0..layout.arm {
                dense[(line, own + k)] = unit * rows.arm[at * layout.arm + k] * scale(problem, layout, k);
            }
            for k in 0..layout.group_width() {
                let value = rows.setup[at * layout.group_width() + k];
                dense[(line, group + k)] = unit * value * scale(problem, layout, layout.arm + group + k);
            }
        }
    }
    dense
}

fn dense_distances(problem: &Problem, layout: &Layout, point: Point) -> Result<Mat<f64>, EstimateError> {
    let (width, own) = (layout.len(), layout.len() - layout.arm);
    let rows = distance::derivatives(problem, point)?;
    let set = problem.measurements;
    Ok(Mat::from_fn(rows.len() / width, width, |row, column| {
        if set.distances[row].weight(&set.weight) == 0.0 {
            return 0.0;
        }
        let source = if column < own { layout.arm + column } else { column - own };
        rows[row * width + source] * scale(problem, layout, source)
    }))
}

/// Columns of a Jacobian (n, m, P) of parameters `columns` that none before them can stand for: their positions, ascending.
///
/// # Errors
/// [`EstimateError::Length`] where the Jacobian is empty or not of whole poses.
pub fn independent_columns(
    jacobian: &[f64],
    rows: PoseRows,
    columns: &[usize],
) -> Result<Vec<usize>, EstimateError> {
    Ok(independent(scaled_matrix(jacobian, rows, columns)?.as_ref()))
}

/// Gram-Schmidt in order, twice over for accuracy: columns that those before them do not span.
fn independent(columns: MatRef<f64>) -> Vec<usize> {
    let mut basis: Vec<Vec<f64>> = Vec::new();
    let mut accepted: Vec<usize> = Vec::new();
    let norms = (0..columns.ncols()).map(|column| columns.col(column).norm_l2());
    let negligible = ROUNDING * norms.fold(0.0, f64::max);
    for column in 0..columns.ncols() {
        let original: Vec<f64> = (0..columns.nrows()).map(|row| columns[(row, column)]).collect();
        let norm = length(&original);
        let mut rest = original;
        for _ in 0..2 {
            for direction in &basis {
                let part = dot(direction, &rest);
                rest.iter_mut().zip(direction).for_each(|(x, d)| *x -= part * d);
            }
        }
        let left = length(&rest);
        if norm > negligible && left > INDEPENDENT_SHARE * norm {
            basis.push(rest.into_iter().map(|x| x / left).collect());
            accepted.push(column);
        }
    }
    accepted
}

/// The answer for scaled columns, of which the first `own` belong to the set-up and the others to the arm.
pub fn in_order(columns: MatRef<f64>, own: usize) -> Identifiability {
    let accepted = independent(columns);
    let independent = Mat::from_fn(columns.nrows(), accepted.len(), |row, k| columns[(row, accepted[k])]);
    let factors = Orthogonal::new(independent.clone());
    let undetermined = (own..columns.ncols())
        .filter(|column| !accepted.contains(column))
        .map(|column| confounded(columns, &factors, &accepted, own, column))
        .collect();
    Identifiability {
        determined: accepted.iter().filter(|&&column| column >= own).map(|column| column - own).collect(),
        undetermined,
        total_rank: accepted.len(),
        condition: condition(independent.as_ref()),
    }
}

fn confounded(
    columns: MatRef<f64>,
    factors: &Orthogonal,
    accepted: &[usize],
    own: usize,
    column: usize,
) -> Confounded {
    let target: Vec<f64> = (0..columns.nrows()).map(|row| columns[(row, column)]).collect();
    let parts = accepted.iter().copied().zip(factors.least_squares(&target));
    let noteworthy: Vec<(usize, f64)> = parts.filter(|part| part.1.abs() > NOTEWORTHY).collect();
    Confounded {
        column: column - own,
        with: noteworthy.iter().filter(|part| part.0 >= own).map(|part| (part.0 - own, part.1)).collect(),
        with_setup: noteworthy.iter().any(|part| part.0 < own),
    }
}

fn condition(columns: MatRef<f64>) -> f64 {
    let Some(values) = singular_values(columns) else { return f64::INFINITY };
    match (values.first(), values.last()) {
        (Some(largest), Some(smallest)) => largest / smallest,
        _ => 1.0,
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(x, y)| x * y).sum()
}

pub fn length(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}
