//! Whether the poses are too alike to tell where the arm stands and where the targets sit.
//!
//! A set-up may be open by the nature of the arm: on a SCARA frame and targets cannot be told apart along its
//! axes, wherever it goes, and no prediction depends on it. What matters is what these poses leave open and
//! others would not, so their rank is compared with that of as many poses drawn over all turns of the joints.
//!
//! Poses that go about in space with one orientation of the tool, as in palletising, leave open where a target
//! sits on the flange. For tools that are held so it makes no difference: targets are then kept near the flange.

use std::ops::Range;

use faer::Mat;

use crate::EstimateError;
use crate::MeasurementSet;
use crate::Noise;
use crate::dense::eigenvalues;
use crate::layout::{HELD_PRECISION, Layout, Problem, TARGET_PRECISION};
use crate::packets::Packets;
use crate::pass::{Normal, normal_equations};
use crate::rows::Point;
use crate::setup::Setup;
use crate::start::flange_poses;

/// A column is open at the poses when less than this share of it stands out of the others' span: 0.3 mrad of turn,
/// which moves a target less than it is measured to, and more than corrections of parallel axes bring.
const OPEN: f64 = 3e-4;
/// A column is closed at other poses when more than this share stands out.
const CLOSED: f64 = 1e-2;

/// Flanges that are no farther from a plane than this, m, root mean square, are in it.
const THIN: f64 = 0.02;

/// What poses leave open of the set-up that the arm's nature does not.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Open {
    Nothing,
    /// Where targets sit on the flange, against where the arm stands.
    Targets,
    More,
}

/// Whether poses leave open where targets sit on the flange, and nothing else that the arm's nature does not.
///
/// # Errors
/// [`EstimateError::Singular`] where they leave more of the set-up open, [`EstimateError::Kinematics`].
pub fn leave_targets_open(problem: &Problem, setup: &Setup) -> Result<bool, EstimateError> {
    match open(problem, setup)? {
        Open::Nothing => Ok(false),
        Open::Targets => Ok(true),
        Open::More => Err(EstimateError::Singular {
            unknowns: Layout::new(problem).len(),
            rows: problem.measurements.measured_values(),
        }),
    }
}

/// Prior precision of steps of the set-up (len - arm,) beside a field, from the constants' set-up.
///
/// Where poses leave targets open these stay where the constants have them: what calibrated joints turn the tool is
/// itself an estimate, and beside errors of the arm it would look like a tool of a metre.
///
/// # Errors
/// [`EstimateError::Kinematics`].
pub fn setup_precision(problem: &Problem, setup: &Setup) -> Result<Vec<f64>, EstimateError> {
    let held = open(problem, setup)? == Open::Targets;
    Ok(Layout::new(problem).setup_precision(if held { HELD_PRECISION } else { TARGET_PRECISION }))
}

/// Asked of the nominal arm, whose joints turn the tool as the poses were chosen, and of the rows that take part.
fn open(problem: &Problem, setup: &Setup) -> Result<Open, EstimateError> {
    let nominal = problem.chain.nominal();
    let (problem, point) = (&problem.with_columns(&[]), Point { parameters: &nominal, setup });
    let layout = Layout::new(problem);
    let normal_of = |set: &MeasurementSet| {
        let moved = Problem { measurements: set, ..*problem };
        normal_equations(&moved, &Packets::new(set), point, Some((Noise::GUESS, &set.weight)))
    };
    let normal = normal_of(problem.measurements)?;
    let open: Vec<_> = blocks(problem, &layout)
        .into_iter()
        .map(|block| (rank(&normal, block.clone(), OPEN), block))
        .filter(|(rank, block)| *rank < block.len())
        .collect();
    if open.is_empty() {
        return Ok(Open::Nothing);
    }
    let elsewhere =
        MeasurementSet { joints: spread(&problem.measurements.joints), ..problem.measurements.clone() };
    let other = normal_of(&elsewhere)?;
    let is_lost = |(found, block): &(usize, Range<usize>)| *found < rank(&other, block.clone(), CLOSED);
    let lost: Vec<_> = open.into_iter().filter(is_lost).map(|(_, block)| block).collect();
    if lost.is_empty() {
        return Ok(Open::Nothing);
    }
    let known = |block: &Range<usize>| rank(&normal, block.start..block.start + 6, OPEN) == 6;
    let frames = layout.frame == 6 && lost.iter().all(known);
    let groups: Vec<usize> = lost.iter().map(|block| block.start / layout.group_width()).collect();
    Ok(if frames && go_about_in_space(problem, point, &groups)? { Open::Targets } else { Open::More })
}

/// Whether the flanges of each of these groups are in no plane.
fn go_about_in_space(problem: &Problem, point: Point, groups: &[usize]) -> Result<bool, EstimateError> {
    let set = problem.measurements;
    for &group in groups {
        let used = |&pose: &usize| set.group[pose] == group && set.weight[pose] > 0.0;
        let poses: Vec<usize> = (0..set.pose_count()).filter(used).collect();
        let flanges = flange_poses(problem, point.parameters, &poses)?;
        let mean_of = |value: &dyn Fn(&[f64; 3]) -> f64| {
            flanges.iter().map(|flange| value(&flange.translation)).sum::<f64>() / flanges.len() as f64
        };
        let centre: [f64; 3] = std::array::from_fn(|k| mean_of(&|point| point[k]));
        let spread =
            Mat::from_fn(3, 3, |i, j| mean_of(&|point| (point[i] - centre[i]) * (point[j] - centre[j])));
        if !eigenvalues(&spread).is_some_and(|squares| squares[0] > THIN * THIN) {
            return Ok(false);
        }
    }
    Ok(true)
}

/// Unknowns of the set-up that rows can share: those of a group, or all where distances join groups and anchors.
fn blocks(problem: &Problem, layout: &Layout) -> Vec<Range<usize>> {
    if problem.measurements.is_distances() {
        return std::iter::once(layout.arm..layout.len()).collect();
    }
    (0..layout.groups).map(|group| layout.group(group)).collect()
}

/// Columns of a block that are independent of those before them, from their Gram matrix by elimination.
fn rank(normal: &Normal, block: Range<usize>, share: f64) -> usize {
    let (start, n) = (block.start, block.len());
    let scale = |i: usize| normal.matrix[(start + i, start + i)].max(f64::MIN_POSITIVE).sqrt().recip();
    let mut gram: Vec<Vec<f64>> = (0..n)
        .map(|i| (0..n).map(|j| normal.matrix[(start + i, start + j)] * scale(i) * scale(j)).collect())
        .collect();
    let mut rank = 0;
    for pivot in 0..n {
        let line = gram[pivot].clone();
        if line[pivot] <= share * share {
            continue;
        }
        rank += 1;
        for row in gram.iter_mut().skip(pivot + 1) {
            let factor = row[pivot] / line[pivot];
            (pivot..n).for_each(|k| row[k] -= factor * line[k]);
        }
    }
    rank
}

/// As many joint values, scattered over a turn (or as many metres).
fn spread(joints: &[f64]) -> Vec<f64> {
    let scattered = |index: usize| (12.9898 * (index + 1) as f64).sin() * 43_758.545_3;
    (0..joints.len()).map(|index| std::f64::consts::PI * scattered(index).fract()).collect()
}
