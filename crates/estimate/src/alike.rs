//! Whether the poses are too alike to tell where the arm stands and where the targets sit.
//!
//! A set-up may be open by the nature of the arm: on a SCARA frame and targets cannot be told apart along its
//! axes, wherever it goes, and no prediction depends on it. What matters is what these poses leave open and
//! others would not, so their rank is compared with that of as many poses drawn over all turns of the joints.

use std::ops::Range;

use crate::EstimateError;
use crate::MeasurementSet;
use crate::layout::{Layout, Problem};
use crate::minimise::State;
use crate::packets::Packets;
use crate::pass::{Normal, normal_equations};
use crate::rows::Point;

/// A column is open at the poses when less than this share of it stands out of the others' span: 0.3 mrad of turn,
/// which moves a target less than it is measured to, and more than corrections of parallel axes bring.
const OPEN: f64 = 3e-4;
/// A column is closed at other poses when more than this share stands out.
const CLOSED: f64 = 1e-2;

/// Refuses poses that leave more of the set-up open than the arm's nature does.
///
/// # Errors
/// [`EstimateError::Singular`], [`EstimateError::Kinematics`].
pub fn check_poses(problem: &Problem, state: &State, normal: &Normal) -> Result<(), EstimateError> {
    let layout = Layout::new(problem);
    let open: Vec<_> = blocks(problem, &layout)
        .into_iter()
        .map(|block| (rank(normal, block.clone(), OPEN), block))
        .filter(|(rank, block)| *rank < block.len())
        .collect();
    if open.is_empty() {
        return Ok(());
    }
    let elsewhere =
        MeasurementSet { joints: spread(&problem.measurements.joints), ..problem.measurements.clone() };
    let moved = Problem { measurements: &elsewhere, ..*problem };
    let point = Point { parameters: &state.parameters, setup: &state.setup };
    let other = normal_equations(&moved, &Packets::new(&elsewhere), point, None)?;
    if open.into_iter().any(|(found, block)| found < rank(&other, block, CLOSED)) {
        let rows = problem.measurements.measured_values();
        return Err(EstimateError::Singular { unknowns: layout.len(), rows });
    }
    Ok(())
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
