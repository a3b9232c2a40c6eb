//! Poses that were measured several times count once.
//!
//! Shots at an arm that stands still share what it did not repeat and what no field holds: between them is the noise of a
//! shot alone. As rows of their own they would say that all the rest is the field's, which would follow every pose and
//! mislead between them. The likelihood of n shots falls into that of their mean, of variance `p^2 + s^2 / n` with p of the
//! pose and s of a shot, and that of their differences, which knows s alone and is left out here. Where shots state sigmas,
//! each counts by `1 / (s^2 + sigma^2)`, and the mean of a target is of those that hold it: this is exact as well.

use std::collections::{BTreeMap, VecDeque};
use truearm_bank::Input;

use crate::outliers::chi_squared;
use crate::training::{Shot, Training};

/// Joint values that differ by less, rad or m, are one pose: far less than the shortest length scale, more than what
/// readings of an arm that stands still scatter.
const STILL: f64 = 3e-4;
/// The same of features, whose range is pi: a twentieth of it. They may be read at each shot, and scatter; the mean has theirs.
const ALIKE: f64 = 0.05 * std::f64::consts::PI;
/// Typical deviations from the median of a pose's shots from which on one stands apart, to be judged as a row of its own.
const FAR: f64 = 10.0;
/// Least deviation that is taken for typical, m or rad: that of an instrument's last digit.
const LAST_DIGIT: f64 = 1e-5;
/// Degrees of freedom from which on shots tell their noise: three poses of two.
const ENOUGH: f64 = 9.0;
/// Rows of a position, and of an orientation.
const COORDINATES: f64 = 3.0;
/// Sums of shares that differ by less are the same.
const ROUNDING: f64 = 1e-9;

/// Rows with one pose for all of its shots.
pub struct Joined {
    pub training: Training,
    /// Which of these poses each measured one has become a part of, (n,).
    pub pose_of: Vec<usize>,
    /// Poses of single shots that most others of their pose contradict.
    pub doubtful: Vec<usize>,
}

/// Joins the shots of each pose; constants leave `left` (R,) of its rows, `group` (n,) tells set-ups apart, each pose has a
/// place for `rows_per_pose` residuals.
pub fn join(training: Training, left: &[f64], group: &[usize], rows_per_pose: usize) -> Joined {
    let shots = Shots { training: &training, left, group, rows_per_pose };
    let mut poses = shots.poses();
    if poses.len() == training.pose_count() {
        let pose_of = (0..poses.len()).collect();
        return Joined { training, pose_of, doubtful: Vec::new() };
    }
    let doubted = shots.set_apart(&mut poses);
    poses.sort_unstable_by_key(|members| members[0]);
    let mut pose_of = vec![0; training.pose_count()];
    for (pose, members) in poses.iter().enumerate() {
        members.iter().for_each(|&member| pose_of[member] = pose);
    }
    let doubtful = doubted.into_iter().map(|shot| pose_of[shot]).collect();
    Joined { training: shots.means(&poses), pose_of, doubtful }
}

/// The shots of each pose, ascending: joint values within [`STILL`] of those of one of them that `may_be_one` with it.
pub fn shots_of_poses(joints: &[&[f64]], may_be_one: impl Fn(usize, usize) -> bool) -> Vec<Vec<usize>> {
    let widest = widest(joints);
    let first = |shot: usize| joints[shot].get(widest).copied().unwrap_or(0.0);
    let are_still = |a: usize, b: usize| joints[a].iter().zip(joints[b]).all(|(x, y)| (x - y).abs() <= STILL);
    let mut order: Vec<usize> = (0..joints.len()).collect();
    order.sort_by(|&a, &b| first(a).total_cmp(&first(b)));
    let mut poses: Vec<Vec<usize>> = Vec::new();
    // Those that the next one may be a shot of.
    let mut near: VecDeque<usize> = VecDeque::new();
    for shot in order {
        while near.front().is_some_and(|&pose| first(poses[pose][0]) < first(shot) - STILL) {
            near.pop_front();
        }
        let is_one = |pose: &usize| are_still(poses[*pose][0], shot) && may_be_one(poses[*pose][0], shot);
        if let Some(pose) = near.iter().copied().find(is_one) {
            poses[pose].push(shot);
        } else {
            near.push_back(poses.len());
            poses.push(vec![shot]);
        }
    }
    poses.iter_mut().for_each(|shots| shots.sort_unstable());
    poses
}

/// The joint that moves most: it keeps those few that may be alike.
fn widest(joints: &[&[f64]]) -> usize {
    let span = |joint: usize| {
        let values = joints.iter().map(|values| values[joint]);
        values.clone().fold(f64::NEG_INFINITY, f64::max) - values.fold(f64::INFINITY, f64::min)
    };
    let count = joints.first().map_or(0, |values| values.len());
    (0..count).fold(0, |best, joint| if span(joint) > span(best) { joint } else { best })
}

/// What may be several shots of the same pose.
struct Shots<'a> {
    training: &'a Training,
    left: &'a [f64],
    group: &'a [usize],
    rows_per_pose: usize,
}

impl Shots<'_> {
    /// The shots of each pose, ascending.
    fn poses(&self) -> Vec<Vec<usize>> {
        let training = self.training;
        let joints = training.geometry.joint_count();
        let poses = 0..training.pose_count();
        let readings: Vec<&[f64]> = poses.map(|pose| &training.values_of(pose)[..joints]).collect();
        shots_of_poses(&readings, |a, b| self.may_be_one(a, b))
    }

    fn may_be_one(&self, a: usize, b: usize) -> bool {
        let training = self.training;
        let joints = training.geometry.joint_count();
        let are_alike = |((input, x), y): ((&Input, &f64), &f64)| (input.scale * (x - y)).abs() <= ALIKE;
        let inputs = training.inputs.iter().zip(training.values_of(a)).zip(training.values_of(b));
        let is_measured = |shot: usize| !training.rows(shot).is_empty();
        self.group[a] == self.group[b]
            && inputs.skip(joints).all(are_alike)
            && is_measured(a)
            && is_measured(b)
    }

    /// Rows of a pose's shots: of each target's coordinate, and of the orientation's, those of all shots that hold it.
    fn rows_of(&self, members: &[usize]) -> Vec<Vec<usize>> {
        let mut rows: BTreeMap<usize, Vec<usize>> = BTreeMap::new();
        for row in members.iter().flat_map(|&member| self.training.rows(member)) {
            rows.entry(self.place(row) % self.rows_per_pose).or_default().push(row);
        }
        rows.into_values().collect()
    }

    fn place(&self, row: usize) -> usize {
        self.training.source[row][0].place
    }

    fn shot(&self, row: usize) -> usize {
        self.place(row) / self.rows_per_pose
    }

    fn kind(&self, row: usize) -> usize {
        usize::from(self.training.is_orientation[row])
    }

    /// Rows of the same quantity with their shares of its mean, where shots differ by variances beside those they state.
    fn shared(&self, rows: &[usize], variance: [f64; 2]) -> Shared {
        let of = |&row: &usize| {
            1.0 / (self.training.variance[row] + variance[self.kind(row)].max(LAST_DIGIT * LAST_DIGIT))
        };
        let weights: Vec<f64> = rows.iter().map(of).collect();
        let whole: f64 = weights.iter().sum();
        let shares = weights.iter().map(|weight| weight / whole).collect();
        let values = rows.iter().map(|&row| self.training.residual[row]).collect();
        Shared { values, weights, shares }
    }

    /// Makes poses of their own of shots that stand apart; gives those that most others of their pose contradict.
    fn set_apart(&self, poses: &mut Vec<Vec<usize>>) -> Vec<usize> {
        let squares = self.squares(poses);
        let left = self.squares_left();
        let typical = [0, 1].map(|kind| {
            let share = |squares: &[Mean]| median(squares.iter().filter_map(Mean::value).collect());
            share(&squares[kind]).min(share(&left[kind])) * COORDINATES / chi_squared(COORDINATES, 0.0)
        });
        let is_far = |&shot: &usize| {
            (0..2).any(|kind| {
                let least = LAST_DIGIT * LAST_DIGIT / self.stated(shot, kind);
                squares[kind][shot]
                    .value()
                    .is_some_and(|square| square > FAR * FAR * typical[kind].max(least))
            })
        };
        let (mut kept, mut doubted) = (Vec::new(), Vec::new());
        for members in poses.drain(..) {
            let (far, near): (Vec<usize>, Vec<usize>) = members.into_iter().partition(is_far);
            if near.len() > far.len().max(1) {
                doubted.extend(&far);
            }
            kept.extend(far.into_iter().map(|shot| vec![shot]));
            kept.extend((!near.is_empty()).then_some(near));
        }
        *poses = kept;
        doubted
    }

    /// Variance that a shot's positions or orientations state at the most, with that of an instrument's last digit.
    fn stated(&self, shot: usize, kind: usize) -> f64 {
        let rows = self.training.rows(shot).filter(|&row| self.kind(row) == kind);
        rows.map(|row| self.training.variance[row]).fold(0.0, f64::max) + LAST_DIGIT * LAST_DIGIT
    }

    /// Squares of each shot's deviations from its pose's median, over what it states, of positions and of orientations.
    fn squares(&self, poses: &[Vec<usize>]) -> [Vec<Mean>; 2] {
        let mut squares = [0, 1].map(|_| vec![Mean::default(); self.training.pose_count()]);
        let several =
            poses.iter().filter(|members| members.len() > 1).flat_map(|members| self.rows_of(members));
        for rows in several.filter(|rows| rows.len() > 1) {
            let shared = self.shared(&rows, [0.0; 2]);
            let centre = shared.median();
            for (k, &row) in rows.iter().enumerate() {
                let square = shared.weights[k] * (shared.values[k] - centre).powi(2);
                squares[self.kind(row)][self.shot(row)].add(square / (1.0 - shared.shares[k]));
            }
        }
        squares
    }

    /// The same of what the constants leave: shots of a pose do not differ by more, and where there are few of them, those
    /// that do are all there is.
    fn squares_left(&self) -> [Vec<Mean>; 2] {
        let mut squares = [0, 1].map(|_| vec![Mean::default(); self.training.pose_count()]);
        for (row, left) in self.left.iter().enumerate() {
            let stated = self.training.variance[row] + LAST_DIGIT * LAST_DIGIT;
            squares[self.kind(row)][self.shot(row)].add(left * left / stated);
        }
        squares
    }

    /// Variance of a shot beside its own, of positions and of orientations, from squares of differences (DerSimonian and
    /// Laird 1986): what it is at least, in all likelihood, so that a few that happen to differ do not vouch for the noise
    /// of all.
    fn variance(&self, poses: &[Vec<usize>]) -> [f64; 2] {
        let (mut excess, mut gain, mut freedom) = ([0.0; 2], [0.0; 2], [0.0; 2]);
        let several =
            poses.iter().filter(|members| members.len() > 1).flat_map(|members| self.rows_of(members));
        for rows in several.filter(|rows| rows.len() > 1) {
            let (kind, shared) = (self.kind(rows[0]), self.shared(&rows, [0.0; 2]));
            let centre = shared.mean();
            for (k, &row) in rows.iter().enumerate() {
                let (weight, free) = (shared.weights[k], 1.0 - shared.shares[k]);
                let square = (shared.values[k] - centre).powi(2);
                excess[kind] += weight * (square - free * self.training.variance[row]);
                gain[kind] += weight * free;
            }
            freedom[kind] += (rows.len() - 1) as f64;
        }
        let least = |kind: usize| {
            let most: f64 = 1.0 + 2.0 * f64::sqrt(2.0 / freedom[kind]);
            if freedom[kind] < ENOUGH { 0.0 } else { (excess[kind] / (gain[kind] * most)).max(0.0) }
        };
        [least(0), least(1)]
    }

    /// One pose with the mean of the residuals for each of `poses`, and the least of the weights.
    fn means(&self, poses: &[Vec<usize>]) -> Training {
        let old = self.training;
        let rows: Vec<Vec<Vec<usize>>> = poses.iter().map(|members| self.rows_of(members)).collect();
        let firsts: Vec<usize> = poses.iter().map(|members| members[0]).collect();
        let of_firsts = |rows: &Vec<Vec<usize>>| rows.iter().map(|shots| shots[0]).collect();
        let mut joined = old.with_rows(&firsts, &rows.iter().map(of_firsts).collect::<Vec<Vec<usize>>>());
        joined.shot = self.variance(poses);
        for (pose, members) in poses.iter().enumerate().filter(|(_, members)| members.len() > 1) {
            let weight =
                rows[pose].iter().flatten().map(|&row| old.weight[row]).fold(f64::INFINITY, f64::min);
            for (shots, row) in rows[pose].iter().zip(joined.rows(pose)) {
                let shared = self.shared(shots, joined.shot);
                let own =
                    shared.shares.iter().zip(shots).map(|(share, &shot)| share * share * old.variance[shot]);
                joined.variance[row] = own.sum();
                joined.residual[row] = shared.mean();
                joined.weight[row] = weight;
                let source = shared.shares.iter().zip(shots);
                joined.source[row] =
                    source.map(|(&share, &shot)| Shot { place: self.place(shot), share }).collect();
            }
            self.average_features(&mut joined, pose, members);
        }
        joined
    }

    /// Gives a pose the mean of its shots' features.
    fn average_features(&self, joined: &mut Training, pose: usize, members: &[usize]) {
        let (joints, inputs) = (joined.geometry.joint_count(), joined.inputs.len());
        if inputs == joints {
            return;
        }
        for input in joints..inputs {
            let sum: f64 = members.iter().map(|&member| self.training.values_of(member)[input]).sum();
            joined.values[pose * inputs + input] = sum / members.len() as f64;
        }
        let levers = joined.geometry.at(joined.values_of(pose));
        let count = joined.geometry.len();
        joined.levers[pose * count..][..count].copy_from_slice(&levers);
    }
}

/// Values of the same quantity (k,) from shots of a pose, weights that are inverse variances, and their shares of the mean.
struct Shared {
    values: Vec<f64>,
    weights: Vec<f64>,
    shares: Vec<f64>,
}

impl Shared {
    fn mean(&self) -> f64 {
        self.values.iter().zip(&self.shares).map(|(value, share)| value * share).sum()
    }

    /// Half of the shares lie below it, half above.
    fn median(&self) -> f64 {
        let mut order: Vec<usize> = (0..self.values.len()).collect();
        order.sort_by(|&a, &b| self.values[a].total_cmp(&self.values[b]));
        let from = |least: f64| {
            let mut sum = 0.0;
            let reached = order.iter().find(|&&k| {
                sum += self.shares[k];
                sum > least
            });
            self.values[*reached.unwrap_or(&order[order.len() - 1])]
        };
        0.5 * (from(0.5 - ROUNDING) + from(0.5 + ROUNDING))
    }
}

/// A mean of values that come one after the other.
#[derive(Debug, Clone, Copy, Default)]
struct Mean {
    sum: f64,
    count: f64,
}

impl Mean {
    fn add(&mut self, value: f64) {
        self.sum += value;
        self.count += 1.0;
    }

    fn value(&self) -> Option<f64> {
        (self.count > 0.0).then(|| self.sum / self.count)
    }
}

fn median(mut values: Vec<f64>) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len() % 2 == 1 { values[middle] } else { 0.5 * (values[middle - 1] + values[middle]) }
}
