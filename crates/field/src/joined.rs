//! Poses that were measured several times count once.
//!
//! Shots at an arm that stands still share what it did not repeat and what no field holds: between them is the noise of a
//! shot alone. As rows of their own they would say that all the rest is the field's, which would follow every pose and
//! mislead between them. The likelihood of n shots falls into that of their mean, of variance `p^2 + s^2 / n` with p of the
//! pose and s of a shot, and that of their differences, which knows s alone and is left out here.

use std::collections::VecDeque;
use truearm_bank::Input;

use crate::outliers::chi_squared;
use crate::training::Training;

/// Joint values that differ by less, rad or m, are one pose: far less than the shortest length scale, more than what
/// readings of an arm that stands still scatter.
const STILL: f64 = 3e-4;
/// The same of features, whose range is pi: a thousandth of it.
const ALIKE: f64 = 3e-3;
/// Typical deviations from the median of a pose's shots from which on one stands apart, to be judged as a row of its own.
const FAR: f64 = 10.0;
/// Least deviation that is taken for typical, m or rad: that of an instrument's last digit.
const LAST_DIGIT: f64 = 1e-5;
/// Degrees of freedom from which on shots tell their noise: three poses of two.
const ENOUGH: f64 = 9.0;
/// Rows of a position, and of an orientation.
const COORDINATES: f64 = 3.0;

/// Rows with one pose for all of its shots.
pub struct Joined {
    pub training: Training,
    /// Which of these poses each measured one has become a part of, (n,).
    pub pose_of: Vec<usize>,
    /// Poses of single shots that most others of their pose contradict.
    pub doubtful: Vec<usize>,
}

/// Joins the shots of each pose; `group` (n,) tells set-ups apart, each pose has a place for `rows_per_pose` residuals.
pub fn join(training: Training, group: &[usize], rows_per_pose: usize) -> Joined {
    let shots = Shots { training: &training, group, rows_per_pose };
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
        let sigmas = |pose: usize| &training.variance[training.rows(pose)];
        let places = |pose: usize| {
            training.rows(pose).map(move |row| training.source[row][0] - pose * self.rows_per_pose)
        };
        let weight = |pose: usize| training.rows(pose).next().map(|row| training.weight[row]);
        self.group[a] == self.group[b]
            && inputs.skip(joints).all(are_alike)
            && sigmas(a) == sigmas(b)
            && weight(a).is_some()
            && weight(a) == weight(b)
            && places(a).eq(places(b))
    }

    /// Squares of a shot's deviations from `centre`, a value a row, of positions and of orientations.
    fn squares(&self, shot: usize, centre: &[f64]) -> [f64; 2] {
        let mut squares = [0.0; 2];
        for (row, centre) in self.training.rows(shot).zip(centre) {
            let kind = usize::from(self.training.is_orientation[row]);
            squares[kind] += (self.training.residual[row] - centre).powi(2);
        }
        squares
    }

    /// What `of` makes of the values of each row of a pose.
    fn centre(&self, members: &[usize], of: impl Fn(&mut [f64]) -> f64) -> Vec<f64> {
        let rows = self.training.rows(members[0]).len();
        let at = |member: usize, row: usize| self.training.residual[self.training.rows(member).start + row];
        (0..rows)
            .map(|row| of(&mut members.iter().map(|&member| at(member, row)).collect::<Vec<f64>>()))
            .collect()
    }

    /// Makes poses of their own of shots that stand apart; gives those that most others of their pose contradict.
    fn set_apart(&self, poses: &mut Vec<Vec<usize>>) -> Vec<usize> {
        let mut squares = vec![[0.0; 2]; self.training.pose_count()];
        let mut all: [Vec<f64>; 2] = Default::default();
        for members in poses.iter().filter(|members| members.len() > 1) {
            let centre = self.centre(members, median);
            let freedom = (members.len() - 1) as f64 / members.len() as f64;
            for &shot in members {
                squares[shot] = self.squares(shot, &centre).map(|square| square / freedom);
                all.iter_mut().zip(squares[shot]).for_each(|(all, square)| all.push(square));
            }
        }
        let left = self.left();
        let typical =
            [0, 1].map(|kind| median(&mut all[kind]).min(left[kind]) / chi_squared(COORDINATES, 0.0));
        let typical = typical.map(|typical| typical.max(LAST_DIGIT * LAST_DIGIT));
        let limit = typical.map(|typical| FAR * FAR * COORDINATES * typical);
        let is_far = |shot: &usize| squares[*shot].iter().zip(limit).any(|(square, limit)| *square > limit);
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

    /// Typical square of what the constants leave of positions and of orientations: shots of a pose do not differ by more, and
    /// where there are few of them, those that do are all there is.
    fn left(&self) -> [f64; 2] {
        let mut all: [Vec<f64>; 2] = Default::default();
        for shot in 0..self.training.pose_count() {
            let squares = self.squares(shot, &vec![0.0; self.training.rows(shot).len()]);
            let present = all.iter_mut().zip(squares).filter(|(_, square)| *square > 0.0);
            present.for_each(|(all, square)| all.push(square));
        }
        all.map(|mut all| median(&mut all))
    }

    /// Variance of a shot beside its own, of positions and of orientations: what it is at least, in all likelihood, so that
    /// a few that happen to differ do not vouch for the noise of all.
    fn variance(&self, poses: &[Vec<usize>]) -> [f64; 2] {
        let (mut sums, mut freedom, mut own) = ([0.0; 2], [0.0; 2], [0.0; 2]);
        for members in poses.iter().filter(|members| members.len() > 1) {
            let centre = self.centre(members, mean);
            let more = (members.len() - 1) as f64;
            for &shot in members {
                let squares = self.squares(shot, &centre);
                (0..2).for_each(|kind| sums[kind] += squares[kind]);
            }
            for row in self.training.rows(members[0]) {
                let kind = usize::from(self.training.is_orientation[row]);
                freedom[kind] += more;
                own[kind] += more * self.training.variance[row];
            }
        }
        let least = |kind: usize| {
            let most: f64 = freedom[kind] + 2.0 * f64::sqrt(2.0 * freedom[kind]);
            if freedom[kind] < ENOUGH { 0.0 } else { ((sums[kind] - own[kind]) / most).max(0.0) }
        };
        [least(0), least(1)]
    }

    /// One pose with the mean of the residuals for each of `poses`.
    fn means(&self, poses: &[Vec<usize>]) -> Training {
        let old = self.training;
        let firsts: Vec<usize> = poses.iter().map(|members| members[0]).collect();
        let mut joined = old.select(&firsts);
        joined.shot = self.variance(poses);
        for (pose, members) in poses.iter().enumerate().filter(|(_, members)| members.len() > 1) {
            let centre = self.centre(members, mean);
            for (k, row) in joined.rows(pose).enumerate() {
                let of = |member: &usize| old.rows(*member).start + k;
                let own: f64 = members.iter().map(|member| old.variance[of(member)]).sum();
                joined.residual[row] = centre[k];
                joined.variance[row] = own / (members.len() * members.len()) as f64;
                joined.source[row] =
                    members.iter().flat_map(|member| old.source[of(member)].clone()).collect();
            }
        }
        joined
    }
}

fn mean(values: &mut [f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

fn median(values: &mut [f64]) -> f64 {
    if values.is_empty() {
        return 0.0;
    }
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    if values.len() % 2 == 1 { values[middle] } else { 0.5 * (values[middle - 1] + values[middle]) }
}
