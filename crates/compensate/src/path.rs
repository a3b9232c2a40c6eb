//! The corrected joints of many waypoints.

use std::num::NonZeroUsize;

use rayon::prelude::*;
use truearm_kinematics::{Cancel, Isa, Kernel, LANES, Lane, dispatch, load_lanes, norm};

use crate::change::Mark;
use crate::corrector::{Correction, Corrector, Workspace};
use crate::error::{CompensateError, check_finite, check_length};
use crate::refusal::{Reason, Refusal};

/// Waypoints of a task: enough to be worth a thread's while, few enough to stay in the nearest caches.
const WAYPOINTS_PER_TASK: usize = 256;
/// Numbers told of each waypoint: residual (m, rad), size of the correction (m, rad), standard deviation (m).
pub const NUMBERS: usize = 5;

/// Where the results of a path go.
pub struct Path<'a> {
    /// Corrected readings, n x N; NaN where a waypoint is refused.
    pub readings: &'a mut [f64],
    /// [`NUMBERS`] of each waypoint.
    pub numbers: &'a mut [f64],
}

/// How many waypoints are worked on; the results do not depend on it.
#[derive(Debug, Clone, Default)]
pub struct Run {
    /// Threads at most; None: as many as rayon has.
    pub threads: Option<NonZeroUsize>,
    /// Asked between tasks.
    pub cancel: Cancel,
}

/// What a task found beside the numbers.
struct Done {
    refused: Vec<(usize, Refusal)>,
    first: Mark,
    last: Mark,
}

impl Corrector {
    /// Corrects a path of n waypoints, `readings` n x N; gives the refused ones with their index from 0, ascending.
    ///
    /// Beside the bounds of each waypoint, the change of the correction from the waypoint before is bounded.
    /// The results are the same on any number of threads.
    ///
    /// # Errors
    /// [`CompensateError::Length`] if an array does not fit, [`CompensateError::NotFinite`] if a feature is not finite,
    /// [`CompensateError::Cancelled`].
    pub fn correct_path(
        &self,
        readings: &[f64],
        features: &[f64],
        out: Path<'_>,
        run: &Run,
    ) -> Result<Vec<(usize, Refusal)>, CompensateError> {
        let count = self.joint_count();
        let waypoints = readings.len() / count;
        check_length("the readings", readings.len(), waypoints * count)?;
        check_length("the features", features.len(), self.feature_count())?;
        check_finite("the features", features)?;
        check_length("the corrected readings", out.readings.len(), waypoints * count)?;
        check_length("the numbers", out.numbers.len(), waypoints * NUMBERS)?;
        let pieces: Vec<(&[f64], Path<'_>)> = readings
            .chunks(WAYPOINTS_PER_TASK * count)
            .zip(out.readings.chunks_mut(WAYPOINTS_PER_TASK * count))
            .zip(out.numbers.chunks_mut(WAYPOINTS_PER_TASK * NUMBERS))
            .map(|((readings, out), numbers)| (readings, Path { readings: out, numbers }))
            .collect();
        let done = run.each(
            pieces,
            || self.prepared(features),
            |workspace, (readings, out)| dispatch(Piece { corrector: self, workspace, readings, out }),
        )?;
        Ok(self.join(&done, readings, out.readings))
    }

    fn prepared(&self, features: &[f64]) -> Workspace {
        let mut workspace = self.workspace();
        workspace.search.model.set_features(self.joint_count(), features);
        workspace
    }

    /// All refusals in order, those at the seams between tasks included.
    fn join(&self, done: &[Option<Done>], readings: &[f64], out: &mut [f64]) -> Vec<(usize, Refusal)> {
        let (count, mut refused) = (self.joint_count(), Vec::new());
        let mut before: Option<&Mark> = None;
        for (index, task) in done.iter().flatten().enumerate() {
            let first = index * WAYPOINTS_PER_TASK;
            let seam = before
                .and_then(|before| self.refuse_change(before, &task.first, &readings[(first - 1) * count..]));
            if let Some(refusal) = seam {
                out[first * count..(first + 1) * count].fill(f64::NAN);
                refused.push((first, refusal));
            }
            refused.extend(task.refused.iter().map(|(place, refusal)| (first + place, *refusal)));
            before = Some(&task.last);
        }
        refused
    }
}

impl Run {
    /// The results of pieces of work in their order, each thread with a workspace of its own.
    pub(crate) fn each<P: Send, W, T: Send>(
        &self,
        pieces: Vec<P>,
        workspace: impl Fn() -> W + Sync + Send,
        work: impl Fn(&mut W, P) -> T + Sync + Send,
    ) -> Result<Vec<T>, CompensateError> {
        let guarded = |workspace: &mut W, piece: P| {
            self.cancel.check()?;
            Ok(work(workspace, piece))
        };
        let all = rayon::current_num_threads();
        let threads = self.threads.map_or(all, NonZeroUsize::get).min(all);
        if threads == 1 || pieces.len() <= 1 {
            let mut workspace = workspace();
            return pieces.into_iter().map(|piece| guarded(&mut workspace, piece)).collect();
        }
        // As many pieces stay together as it takes to occupy no more threads than allowed.
        let together = if threads < all { pieces.len().div_ceil(threads) } else { 1 };
        pieces.into_par_iter().with_min_len(together).map_init(workspace, guarded).collect()
    }
}

/// The waypoints of one task.
struct Piece<'a> {
    corrector: &'a Corrector,
    workspace: &'a mut Workspace,
    readings: &'a [f64],
    out: Path<'a>,
}

impl Kernel for Piece<'_> {
    type Output = Option<Done>;

    #[inline(always)]
    fn run<I: Isa>(self) -> Option<Done> {
        let Self { corrector, workspace, readings, out } = self;
        let count = corrector.joint_count();
        let waypoints = readings.len() / count;
        let mut done: Option<Done> = None;
        for first in (0..waypoints).step_by(LANES) {
            load_lanes::<I>(readings, count, first, &mut workspace.nominal);
            let bad = not_finite(&mut workspace.nominal[..count]);
            let group = corrector.group::<I>(false, true, workspace);
            for place in first..waypoints.min(first + LANES) {
                let i = place - first;
                let mut mark = Mark::new(corrector.judge(&group, workspace, i), &group.target, i);
                if bad[i] {
                    mark.correction = Correction::refused(Refusal::plain(Reason::NotFinite));
                }
                if let Some(done) = &done {
                    let change = corrector.refuse_change(&done.last, &mark, &readings[(place - 1) * count..]);
                    mark.correction.refusal = mark.correction.refusal.or(change);
                }
                corrector.write(&mark.correction, workspace, i, &mut out.readings[place * count..][..count]);
                out.numbers[place * NUMBERS..][..NUMBERS].copy_from_slice(&mark.correction.numbers());
                let done = done.get_or_insert_with(|| Done { refused: Vec::new(), first: mark, last: mark });
                done.refused.extend(mark.correction.refusal.map(|refusal| (place, refusal)));
                done.last = mark;
            }
        }
        done
    }
}

impl Corrector {
    /// The readings of waypoint `i` of a group; NaN where it is refused.
    #[inline(always)]
    pub(crate) fn write(&self, correction: &Correction, workspace: &Workspace, i: usize, out: &mut [f64]) {
        for (value, lane) in out.iter_mut().zip(&workspace.search.best) {
            *value = if correction.refusal.is_none() { lane.0[i] } else { f64::NAN };
        }
    }
}

impl Correction {
    /// Residual (m, rad), size of the correction (m, rad), standard deviation (m).
    pub fn numbers(&self) -> [f64; NUMBERS] {
        [self.residual_m, self.residual_rad, norm(self.shift), norm(self.turn), self.std_m]
    }
}

/// Which waypoints have a reading that is not finite; those readings become zero.
pub(crate) fn not_finite(readings: &mut [Lane]) -> [bool; LANES] {
    let mut bad = [false; LANES];
    for lane in readings {
        for (bad, value) in bad.iter_mut().zip(&mut lane.0) {
            if !value.is_finite() {
                *bad = true;
                *value = 0.0;
            }
        }
    }
    bad
}
