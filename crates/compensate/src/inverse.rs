//! Readings for poses: inverse kinematics of any model, plain or calibrated, from a seed.

use std::f64::consts::TAU;
use std::sync::Arc;

use truearm_kinematics::{Isa, Kernel, LANES, Lane, LaneFrame, Transform, dispatch, lane_room, load_lanes};

use crate::aimed::Aimed;
use crate::corrector::Options;
use crate::error::{CompensateError, check_finite, check_length};
use crate::limits::Limits;
use crate::model::Model;
use crate::newton::{Search, fill_pose_columns, toward};
use crate::path::{Run, not_finite};
use crate::plan::{Left, Plan};
use crate::refusal::{Reason, Refusal};
use crate::task::Task;

/// Steps at most, for seeds that are far away.
const STEPS: usize = 100;
/// Longest step, rad: short enough that a search does not jump over a singular configuration to another branch.
const LONGEST_STEP: f64 = 0.2;
/// Poses of a task.
const POSES_PER_TASK: usize = 256;
/// Numbers of a pose.
const MATRIX: usize = 16;
/// Numbers told of each pose: residual in m and rad.
const RESIDUALS: usize = 2;
/// Two ways round count as equally far where they differ by less, rad.
const EQUALLY_FAR: f64 = 1e-6;
/// Determinant of a six-joint Jacobian in metres below which it is singular and has no sign.
const SINGULAR: f64 = 1e-6;

/// Finds readings for which a model puts the tool at a pose, near a seed: on its branch and turn.
#[derive(Debug, Clone)]
pub struct Inverse {
    aimed: Aimed,
    plan: Plan,
    limits: Limits,
}

/// Where the results go.
pub struct Solved<'a> {
    /// Readings, n x N; NaN where there is no solution.
    pub readings: &'a mut [f64],
    /// Residual in m and rad, n x 2.
    pub residuals: &'a mut [f64],
}

/// Memory of one thread.
struct Workspace {
    search: Search,
    seed: Vec<Lane>,
    target: Vec<Lane>,
    seed_columns: Vec<[Lane; 6]>,
}

impl Inverse {
    /// Of `options`, task, moving joints, joint limits and residuals count.
    ///
    /// # Errors
    /// [`CompensateError`] if the tool is no rigid motion or an option breaks a rule.
    pub fn new(
        model: Arc<Model>,
        flange_from_tool: &Transform,
        options: Options,
    ) -> Result<Inverse, CompensateError> {
        options.limits.check(model.joint_count())?;
        let plan = Plan::new(&model, options.task, options.moving.as_deref(), STEPS, LONGEST_STEP)?;
        Ok(Inverse { aimed: Aimed::new(model, flange_from_tool)?, plan, limits: options.limits })
    }

    /// Readings for `poses` (n, 4, 4), base_from_tool, each near its seed, (n, N); gives the refused ones.
    ///
    /// # Errors
    /// [`CompensateError`] if an array does not fit or a pose is no rigid motion.
    pub fn each(
        &self,
        poses: &[f64],
        seeds: &[f64],
        features: &[f64],
        out: Solved<'_>,
        run: &Run,
    ) -> Result<Vec<(usize, Refusal)>, CompensateError> {
        let count = self.joint_count();
        self.check(poses, features, &out)?;
        check_length("the seeds", seeds.len(), poses.len() / MATRIX * count)?;
        let pieces: Vec<Piece<'_>> = poses
            .chunks(POSES_PER_TASK * MATRIX)
            .zip(seeds.chunks(POSES_PER_TASK * count))
            .zip(out.readings.chunks_mut(POSES_PER_TASK * count))
            .zip(out.residuals.chunks_mut(POSES_PER_TASK * RESIDUALS))
            .map(|(((poses, seeds), readings), residuals)| Piece {
                poses,
                seeds,
                out: Solved { readings, residuals },
            })
            .collect();
        let work = |workspace: &mut Workspace, piece| self.solve(piece, workspace);
        let refused = run.each(pieces, || self.workspace(features), work)?;
        let numbered = refused.into_iter().enumerate();
        Ok(numbered
            .flat_map(|(task, refused)| {
                refused.into_iter().map(move |(place, refusal)| (task * POSES_PER_TASK + place, refusal))
            })
            .collect())
    }

    /// Readings for `poses` (n, 4, 4) along a path: the first near `seed` (N), each other near the one before.
    ///
    /// # Errors
    /// [`CompensateError`] if an array does not fit or a pose is no rigid motion.
    pub fn follow(
        &self,
        poses: &[f64],
        seed: &[f64],
        features: &[f64],
        out: Solved<'_>,
        run: &Run,
    ) -> Result<Vec<(usize, Refusal)>, CompensateError> {
        let count = self.joint_count();
        self.check(poses, features, &out)?;
        check_length("the seed", seed.len(), count)?;
        let (mut workspace, mut last, mut refused) = (self.workspace(features), seed.to_vec(), Vec::new());
        let places = out.readings.chunks_exact_mut(count).zip(out.residuals.chunks_exact_mut(RESIDUALS));
        for (place, (poses, (readings, residuals))) in poses.chunks_exact(MATRIX).zip(places).enumerate() {
            run.cancel.check()?;
            let piece = Piece { poses, seeds: &last, out: Solved { readings, residuals } };
            let found = self.solve(piece, &mut workspace);
            if let Some((_, refusal)) = found.first() {
                refused.push((place, *refusal));
            } else {
                last.copy_from_slice(readings);
            }
        }
        Ok(refused)
    }

    /// Number of joints, N.
    pub fn joint_count(&self) -> usize {
        self.aimed.chain.joint_count()
    }

    /// Solves a piece; what a joint's limit is in the way of once more the other way round, if that is no farther.
    fn solve(&self, piece: Piece<'_>, workspace: &mut Workspace) -> Vec<(usize, Refusal)> {
        let Piece { poses, seeds, out: Solved { readings, residuals } } = piece;
        let count = self.joint_count();
        let all =
            Piece { poses, seeds, out: Solved { readings: &mut *readings, residuals: &mut *residuals } };
        let mut refused = dispatch(Work { inverse: self, workspace, piece: all });
        refused.retain(|(place, refusal)| {
            let Some(seed) = self.other_way(refusal, &seeds[place * count..][..count]) else { return true };
            let poses = &poses[place * MATRIX..][..MATRIX];
            let readings = &mut readings[place * count..][..count];
            let residuals = &mut residuals[place * RESIDUALS..][..RESIDUALS];
            let one = Piece { poses, seeds: &seed, out: Solved { readings, residuals } };
            !dispatch(Work { inverse: self, workspace, piece: one }).is_empty()
        });
        refused
    }

    /// A seed on the other side of half a turn of a joint that the first search led out of its limits.
    fn other_way(&self, refusal: &Refusal, seed: &[f64]) -> Option<Vec<f64>> {
        if refusal.reason != Reason::JointLimit || refusal.slides {
            return None;
        }
        let joint = refusal.joint - 1;
        let way = refusal.value - seed[joint];
        let back = way - TAU.copysign(way);
        let [low, high] = self.limits.joints[joint];
        let fits = back.abs() <= way.abs() + EQUALLY_FAR && (low..=high).contains(&(seed[joint] + back));
        fits.then(|| {
            let mut other = seed.to_vec();
            other[joint] += back;
            other
        })
    }

    fn check(&self, poses: &[f64], features: &[f64], out: &Solved<'_>) -> Result<(), CompensateError> {
        let (matrices, rest) = poses.as_chunks::<MATRIX>();
        check_length("the poses", poses.len(), poses.len() - rest.len())?;
        check_length("the features", features.len(), self.aimed.model.feature_count)?;
        check_finite("the features", features)?;
        check_length("the readings", out.readings.len(), matrices.len() * self.joint_count())?;
        check_length("the residuals", out.residuals.len(), matrices.len() * RESIDUALS)?;
        for matrix in matrices {
            Transform::from_matrix(matrix).check("target pose's")?;
        }
        Ok(())
    }

    fn workspace(&self, features: &[f64]) -> Workspace {
        let mut search = Search::new(&self.aimed);
        search.model.set_features(self.joint_count(), features);
        Workspace {
            seed: vec![Lane::ZERO; lane_room(self.joint_count())],
            target: vec![Lane::ZERO; lane_room(MATRIX)],
            seed_columns: search.columns.clone(),
            search,
        }
    }

    /// Whether the sign of the Jacobian's determinant tells branches apart: six joints for six numbers.
    fn has_branches(&self) -> bool {
        self.plan.task == Task::Pose && self.plan.moving.len() == self.plan.task.rows()
    }

    /// Finds the readings of a group; the solutions are in `workspace.search.best`.
    #[inline(always)]
    fn group<I: Isa>(&self, alone: bool, target: &LaneFrame, workspace: &mut Workspace) -> Left {
        let Workspace { search, seed, seed_columns, .. } = workspace;
        search.best.copy_from_slice(&seed[..self.joint_count()]);
        if self.has_branches() {
            fill_pose_columns::<I>(&self.aimed, &self.plan, alone, search);
            seed_columns.copy_from_slice(&search.columns);
        }
        let left = toward::<I>(&self.aimed, &self.plan, target, alone, search);
        if self.has_branches() {
            fill_pose_columns::<I>(&self.aimed, &self.plan, alone, search);
        }
        left
    }

    fn refuse(&self, left: &Left, workspace: &Workspace, i: usize) -> Option<Refusal> {
        self.limits
            .refuse_residual(&self.plan, left, i)
            .or_else(|| {
                self.limits
                    .refuse_reading(&self.aimed.chain, false, |joint| workspace.search.best[joint].0[i])
            })
            .or_else(|| {
                let other = self.has_branches()
                    && sign(&workspace.seed_columns, i) * sign(&workspace.search.columns, i) < 0.0;
                other.then(|| Refusal::plain(Reason::Branch))
            })
    }
}

/// Poses of a task, their seeds, and where the solutions go.
struct Piece<'a> {
    poses: &'a [f64],
    seeds: &'a [f64],
    out: Solved<'a>,
}

struct Work<'a> {
    inverse: &'a Inverse,
    workspace: &'a mut Workspace,
    piece: Piece<'a>,
}

impl Kernel for Work<'_> {
    type Output = Vec<(usize, Refusal)>;

    #[inline(always)]
    fn run<I: Isa>(self) -> Vec<(usize, Refusal)> {
        let Self { inverse, workspace, piece: Piece { poses, seeds, out } } = self;
        let (count, all) = (inverse.joint_count(), poses.len() / MATRIX);
        let mut refused = Vec::new();
        for first in (0..all).step_by(LANES) {
            load_lanes::<I>(seeds, count, first, &mut workspace.seed);
            load_lanes::<I>(poses, MATRIX, first, &mut workspace.target);
            let bad = not_finite(&mut workspace.seed[..count]);
            let target = frame(&workspace.target);
            let left = inverse.group::<I>(all == 1, &target, workspace);
            for place in first..all.min(first + LANES) {
                let i = place - first;
                let unusable = bad[i].then(|| Refusal::plain(Reason::NotFinite));
                let refusal = unusable.or_else(|| inverse.refuse(&left, workspace, i));
                for (joint, value) in out.readings[place * count..][..count].iter_mut().enumerate() {
                    *value = if refusal.is_none() { workspace.search.best[joint].0[i] } else { f64::NAN };
                }
                out.residuals[place * RESIDUALS..][..RESIDUALS]
                    .copy_from_slice(&[left.distance(i), left.turn.0[i]]);
                refused.extend(refusal.map(|refusal| (place, refusal)));
            }
        }
        refused
    }
}

/// The frame of sixteen lanes of matrices.
#[inline(always)]
fn frame(m: &[Lane]) -> LaneFrame {
    LaneFrame {
        rotation: [m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]],
        position: [m[3], m[7], m[11]],
    }
}

/// Sign of the determinant of pose `i`'s six columns; zero where it is singular.
fn sign(columns: &[[Lane; 6]], i: usize) -> f64 {
    let mut a = [[0.0; 6]; 6];
    for (row, column) in a.iter_mut().zip(columns) {
        for (value, lane) in row.iter_mut().zip(column) {
            *value = lane.0[i];
        }
    }
    let determinant = determinant(a);
    if determinant.abs() < SINGULAR { 0.0 } else { determinant.signum() }
}

/// By elimination with partial pivoting.
fn determinant(mut a: [[f64; 6]; 6]) -> f64 {
    let mut product = 1.0;
    for j in 0..6 {
        let largest = (j..6).fold(j, |best, i| if a[i][j].abs() > a[best][j].abs() { i } else { best });
        if a[largest][j] == 0.0 {
            return 0.0;
        }
        if largest != j {
            a.swap(largest, j);
            product = -product;
        }
        product *= a[j][j];
        for i in j + 1..6 {
            let factor = a[i][j] / a[j][j];
            for k in j..6 {
                a[i][k] -= factor * a[j][k];
            }
        }
    }
    product
}
