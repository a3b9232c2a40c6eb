//! The variable calibration from start to end: linearise, choose, weigh, infer, judge outliers, relinearise.

use truearm_bank::Bank;
use truearm_estimate::{ConstantFit, Layout, Point, Problem, Setup};

use crate::FieldError;
use crate::drives::Drives;
use crate::evidence::Evidence;
use crate::extrapolation::extrapolation_factor;
use crate::hyper::{Hyper, Wave};
use crate::joined::{Joined, join};
use crate::linear::{input_values, left_by_constants, training};
use crate::optimise::Limits;
use crate::options::{Begin, FieldOptions, Start};
use crate::outliers::{self, Judgement};
use crate::posterior::{Posterior, Solution};
use crate::refine::relinearised;
use crate::select::{Found, contest_major, prune_major, refine, select_major};
use crate::training::Training;
use crate::upright::contest_up;
use crate::waves::{are_alike, find_waves};
use crate::widening::with_widenings;

/// A variable calibration.
pub struct FieldFit {
    /// Constants: absolute link parameters (5 L,).
    pub parameters: Vec<f64>,
    /// What varies.
    pub bank: Bank,
    /// Frames and targets, re-estimated with the field.
    pub setup: Setup,
    /// Hyper-parameters of the evidence's maximum.
    pub hyper: Hyper,
    /// Logarithm of evidence and priors there, on the poses it was evaluated on.
    pub evidence: f64,
    /// Evaluations of the evidence.
    pub evaluations: usize,
    /// Residuals of all poses (n, m), base frame.
    pub residuals: Vec<f64>,
    /// Judgement of every pose by the others; shots of the same pose share it.
    pub judgement: Judgement,
    /// Which of the posterior's poses each measured one is a shot of, (n,).
    pub pose_of: Vec<usize>,
    /// Weight of every measured pose in the posterior, (n,); one where nothing was measured.
    pub weights: Vec<f64>,
    /// Poses that were judged but not fitted, since others that fill the space stood for them.
    pub stood_aside: usize,
    /// The posterior that the field was taken from.
    pub posterior: Posterior,
    /// The posterior under widened amplitudes, where it is another one.
    pub wide: Option<Posterior>,
}

impl FieldFit {
    /// For a fit to nearly the same measurements.
    pub fn start(&self) -> Start {
        Start { hyper: self.hyper.clone(), evidence: self.evidence }
    }

    /// For standard deviations.
    pub fn spread(&self) -> &Posterior {
        self.wide.as_ref().unwrap_or(&self.posterior)
    }
}

/// Rows that hyper-parameters are chosen on: the evidence costs their cube.
const ROWS_FOR_SELECTION: usize = 540;
const ROWS_FOR_HYPER: usize = 900;
/// Poses that are wanted all the same where each brings many rows.
const POSES_FOR_SELECTION: usize = 120;
const POSES_FOR_HYPER: usize = 200;
const ROWS_FOR_POLISH: usize = 3000;
const ROWS_FOR_EXTRAPOLATION: usize = 1200;
/// Rows that are judged at once: of more a part judges all first.
const ROWS_AT_ONCE: usize = 2 * ROWS_FOR_POLISH;
/// Share of all squared residuals from which outliers that come or go, of more rows than those, are worth another posterior.
const FELT: f64 = 0.01;
const SEARCH: Limits = Limits { evaluations: 60, gain: 0.02 };
const POLISH: Limits = Limits { evaluations: 12, gain: 0.05 };
/// Reweightings of outliers at the most, and how many of them have hyper-parameters of their own where none is spoiled.
const REWEIGHTINGS: usize = 5;
const REWEIGHTINGS_WITH_SEARCH: usize = 2;
/// The field leaves this share of the constants' residual to noise at the start of the search.
const NOISE_SHARE: f64 = 0.3;

/// Fits constants, field and set-up together, starting from a constant calibration.
///
/// Poses whose weight is zero take no part. Other weights are where the search begins, or the judgement of many poses by a part
/// of them that comes before it: after it every pose is judged by the others, and has its full weight or, as an outlier,
/// next to none; of very many rows a few that are judged otherwise at the end, and change next to nothing, keep theirs.
///
/// # Errors
/// [`FieldError`].
pub fn fit_field(
    problem: &Problem,
    constant: &ConstantFit,
    options: &FieldOptions,
) -> Result<FieldFit, FieldError> {
    let point = Point { parameters: &constant.parameters, setup: &constant.setup };
    point.setup.check_steps(&Layout::new(problem))?;
    let Joined { mut training, pose_of, doubtful } = rows(problem, point, options)?;
    training.take_weight(&doubtful);
    let noise = [constant.noise.position * NOISE_SHARE, constant.noise.orientation * NOISE_SHARE];
    let mut search = Search { problem, options, evidence: f64::NAN, evaluations: 0 };
    let mut hyper = search.first(&mut training, noise)?;
    let all: Vec<usize> = (0..training.pose_count()).collect();
    let mut judged = search.judge(search.posterior(&training, &hyper)?, (&training, &all))?;
    let large = training.row_count() > ROWS_FOR_POLISH;
    let felt = if training.row_count() > ROWS_AT_ONCE { FELT } else { 0.0 };
    for round in 0..REWEIGHTINGS {
        let fitted = training.weight.clone();
        let news = judged.judgement.reweigh(&mut training);
        if !news.spoils() && (!news.poses || news.share < felt) {
            training.weight = fitted;
            break;
        }
        let Judged { posterior, .. } = judged;
        let posterior = if news.spoils() && options.begin.searches() {
            drop(posterior);
            hyper = search.contested(&training, hyper, noise)?;
            search.posterior(&training, &hyper)?
        } else if options.rough || large || round >= REWEIGHTINGS_WITH_SEARCH {
            // Where few rows of many change, hyper-parameters stay.
            posterior.reweighed(&training, &options.cancel)?
        } else {
            // Two posteriors of many rows take gigabytes.
            drop(posterior);
            hyper = search.cleaned(&training, hyper)?;
            search.posterior(&training, &hyper)?
        };
        judged = search.judge(posterior, (&training, &all))?;
    }
    let Judged { posterior, solution, judgement } = judged;
    let values = input_values(problem, options);
    let refined = relinearised(problem, point, &posterior, &values, solution)?;
    let wide = if options.rough { None } else { posterior.widened(options.degree, &options.cancel)? };
    Ok(FieldFit {
        parameters: refined.parameters,
        bank: refined.bank,
        setup: refined.setup,
        hyper: as_loud_as_shots(hyper, posterior.training()),
        evidence: search.evidence,
        evaluations: search.evaluations,
        residuals: refined.residuals,
        judgement: judgement.of_shots(&pose_of),
        weights: pose_of.iter().map(|&pose| training.weight_of(pose).unwrap_or(1.0)).collect(),
        pose_of,
        stood_aside: posterior.training().aside(&training).len(),
        posterior,
        wide,
    })
}

/// The posterior of known hyper-parameters, for standard deviations without a fit.
///
/// # Errors
/// [`FieldError`].
pub fn restore(
    problem: &Problem,
    point: Point,
    options: &FieldOptions,
    hyper: Hyper,
) -> Result<Posterior, FieldError> {
    let training = rows(problem, point, options)?.training;
    let posterior = Posterior::new(training, hyper, options.degree, &options.cancel)?;
    Ok(posterior.widened(options.degree, &options.cancel)?.unwrap_or(posterior))
}

/// The rows of a problem linearised at a point, shots of the same pose as one.
fn rows(problem: &Problem, point: Point, options: &FieldOptions) -> Result<Joined, FieldError> {
    options.check(problem)?;
    let set = problem.measurements;
    let training = training(problem, point, options)?;
    let left = left_by_constants(problem, point, &training);
    let joined = join(training, &left, &set.group, set.rows_per_pose());
    if joined.training.row_count() == 0 {
        let rule = "a field needs some: give positions or orientations whose weights are not zero";
        return Err(FieldError::Option { what: "the number of measured values", value: 0, rule });
    }
    if let Some(hyper) = options.begin.found() {
        let drives = options.drives.as_ref().map_or(0, Drives::len);
        hyper.check(&joined.training.inputs, problem.chain.joint_count(), drives)?;
    }
    Ok(joined)
}

struct Judged {
    posterior: Posterior,
    solution: Solution,
    judgement: Judgement,
}

struct Search<'a> {
    problem: &'a Problem<'a>,
    options: &'a FieldOptions,
    evidence: f64,
    evaluations: usize,
}

impl Search<'_> {
    /// Hyper-parameters that the judgement of all poses begins with.
    fn first(&mut self, training: &mut Training, noise: [f64; 2]) -> Result<Hyper, FieldError> {
        match &self.options.begin {
            Begin::Known(hyper) => self.judged_by_part(training, hyper.clone(), noise),
            Begin::Anew => {
                let found = self.searched(training, noise)?;
                let found = self.judged_by_part(training, found, noise)?;
                if self.options.rough { Ok(found) } else { self.finished(training, found) }
            }
            Begin::Near(start) => {
                let begun = self.begun(training, start, noise)?;
                if self.options.rough {
                    self.again(&middle_of(training), begun)
                } else {
                    self.finished(training, begun)
                }
            }
            Begin::Contested(start) => {
                let begun = self.begun(training, start, noise)?;
                self.contested(training, begun, noise)
            }
        }
    }

    /// Hyper-parameters of a fit to nearly the same rows, which outliers are judged by.
    fn begun(
        &mut self,
        training: &mut Training,
        start: &Start,
        noise: [f64; 2],
    ) -> Result<Hyper, FieldError> {
        self.evidence = start.evidence;
        self.judged_by_part(training, start.hyper.clone(), noise)
    }

    /// Hyper-parameters from nothing but the rows.
    fn anew(&mut self, training: &Training, noise: [f64; 2]) -> Result<Hyper, FieldError> {
        let found = self.searched(training, noise)?;
        if self.options.rough { Ok(found) } else { self.finished(training, found) }
    }

    /// Hyper-parameters for all poses from those that a search found.
    fn finished(&mut self, training: &Training, mut hyper: Hyper) -> Result<Hyper, FieldError> {
        hyper.waves = self.waves(training, &hyper)?;
        hyper = self.widened(training, &hyper)?;
        let part = training.row_count() > middle_of(training).row_count();
        if part || !hyper.waves.is_empty() {
            hyper = self.again(training, hyper)?;
        }
        self.trusted_beyond(training, hyper)
    }

    /// The more probable of hyper-parameters that were found on other rows, polished on these, and of those of a search from nothing.
    ///
    /// Where outliers were taken out, up, joints of the larger blocks and widths were chosen with them as well; where rows were
    /// added, one of the two searches may have ended at a lesser maximum.
    fn contested(&mut self, training: &Training, hyper: Hyper, noise: [f64; 2]) -> Result<Hyper, FieldError> {
        let rough = self.options.rough;
        let judges = if rough { middle_of(training) } else { part_of(training, ROWS_FOR_POLISH, 0) };
        let polished =
            if rough { self.again(&middle_of(training), hyper)? } else { self.cleaned(training, hyper)? };
        let reached = self.evidence;
        let other = self.anew(training, noise)?;
        if self.value(&judges, &other)? >= self.value(&judges, &polished)? {
            return Ok(other);
        }
        self.evidence = reached;
        if rough {
            return Ok(polished);
        }
        let polished = self.widened(training, &polished)?;
        self.trusted_beyond(training, polished)
    }

    /// Hyper-parameters without outliers that a part of many poses tells among all, whose weight is taken away; those that were
    /// found with them are searched again.
    ///
    /// What takes long then begins without most of what it would have to be done again for.
    fn judged_by_part(
        &mut self,
        training: &mut Training,
        mut hyper: Hyper,
        noise: [f64; 2],
    ) -> Result<Hyper, FieldError> {
        let known = self.options.begin.found().is_some();
        let rounds = if training.row_count() > ROWS_AT_ONCE { REWEIGHTINGS } else { 0 };
        for _ in 0..rounds {
            let chosen = evenly(training, ROWS_FOR_POLISH, 0);
            let posterior = self.posterior(&training.select(&chosen), &hyper)?;
            let Judged { judgement, .. } = self.judge(posterior, (training, &chosen))?;
            let news = judgement.reweigh(training);
            if !news.poses || news.share < FELT {
                break;
            }
            if news.spoils() && !known {
                hyper = self.searched(training, noise)?;
            }
        }
        Ok(hyper)
    }

    /// Hyper-parameters with how far they are trusted where nothing was measured.
    fn trusted_beyond(&self, training: &Training, mut hyper: Hyper) -> Result<Hyper, FieldError> {
        let trusted = training.trusted();
        let told = if trusted.pose_count() == 0 { training } else { &trusted };
        let large = part_of(told, ROWS_FOR_EXTRAPOLATION, 0).under(&hyper)?;
        hyper.extrapolation =
            extrapolation_factor(&large, &hyper, self.options.degree, &self.options.cancel)?;
        Ok(hyper)
    }

    fn widened(&self, training: &Training, hyper: &Hyper) -> Result<Hyper, FieldError> {
        let middle = middle_of(training).under(hyper)?;
        with_widenings(&Evidence::new(&middle, &self.options.cancel), hyper)
    }

    /// The waves of single joints that the residuals show under hyper-parameters.
    fn waves(&self, training: &Training, hyper: &Hyper) -> Result<Vec<Wave>, FieldError> {
        let large = part_of(training, ROWS_FOR_POLISH, 0).under(hyper)?;
        find_waves(&large, hyper, &self.options.cancel)
    }

    /// Hyper-parameters without what outliers made of them: waves are found again, and all else with them.
    fn cleaned(&mut self, training: &Training, hyper: Hyper) -> Result<Hyper, FieldError> {
        if !self.options.begin.searches() {
            return Ok(hyper);
        }
        let hyper = self.again(training, hyper)?;
        let waves = self.waves(training, &hyper)?;
        if are_alike(&waves, &hyper.waves) {
            return Ok(hyper);
        }
        let found = self.again(training, Hyper { waves, ..hyper })?;
        self.widened(training, &found)
    }

    /// The more probable of hyper-parameters whose curves go with joint values, and with readings of coupled joints.
    fn searched(&mut self, training: &Training, noise: [f64; 2]) -> Result<Hyper, FieldError> {
        let mut found = self.searched_in(training, noise)?;
        if training.drives.is_some() {
            let other = self.searched_in(&training.clone().by_readings(), noise)?;
            if other.value > found.value {
                found.hyper = Hyper { by_readings: true, ..other.hyper };
                found.value = other.value;
            }
            found.evaluations += other.evaluations;
        }
        self.note(&found);
        Ok(found.hyper)
    }

    fn searched_in(&self, training: &Training, noise: [f64; 2]) -> Result<Found, FieldError> {
        let joints = self.problem.measurements.joint_count;
        let small = part_of(training, ROWS_FOR_SELECTION, POSES_FOR_SELECTION);
        let chosen = select_major(&small, joints, noise, &self.options.cancel)?;
        let chosen = contest_up(&small, chosen, &self.options.cancel)?;
        let middle = middle_of(training).lifted(chosen.hyper.up)?;
        let evidence = Evidence::new(&middle, &self.options.cancel);
        let mut found = refine(&evidence, chosen.hyper, SEARCH)?;
        found.evaluations += chosen.evaluations;
        let found = contest_major(&evidence, found, joints)?;
        let found = prune_major(&evidence, found)?;
        refine_more(&evidence, found, POLISH)
    }

    /// Hyper-parameters from present ones, on as many rows as can be afforded.
    fn again(&mut self, training: &Training, hyper: Hyper) -> Result<Hyper, FieldError> {
        let large = part_of(training, ROWS_FOR_POLISH, 0).under(&hyper)?;
        let evidence = Evidence::new(&large, &self.options.cancel);
        let found = refine(&evidence, hyper, POLISH)?;
        self.note(&found);
        Ok(found.hyper)
    }

    /// Logarithm of the evidence of hyper-parameters on some rows.
    fn value(&mut self, training: &Training, hyper: &Hyper) -> Result<f64, FieldError> {
        self.evaluations += 1;
        Evidence::new(&training.clone().under(hyper)?, &self.options.cancel).value(hyper)
    }

    fn note(&mut self, found: &Found) {
        self.evidence = found.value;
        self.evaluations += found.evaluations;
    }

    fn posterior(&self, training: &Training, hyper: &Hyper) -> Result<Posterior, FieldError> {
        let hyper = as_loud_as_shots(hyper.clone(), training);
        Posterior::new(training.clone(), hyper, self.options.degree, &self.options.cancel)
    }

    /// Judges a training set by a posterior whose poses have these places in it.
    fn judge(
        &self,
        posterior: Posterior,
        (all, places): (&Training, &[usize]),
    ) -> Result<Judged, FieldError> {
        let cancel = &self.options.cancel;
        cancel.check()?;
        let solution = posterior.solve(&posterior.training().residual)?;
        cancel.check()?;
        let judgement = outliers::judge(&posterior, &solution, all, places, cancel)?;
        Ok(Judged { posterior, solution, judgement })
    }
}

/// Hyper-parameters whose noise is not less than what shots of a pose differ by.
fn as_loud_as_shots(mut hyper: Hyper, training: &Training) -> Hyper {
    hyper.noise.iter_mut().zip(training.shot).for_each(|(noise, shot)| *noise = noise.max(shot.sqrt()));
    hyper
}

fn refine_more(evidence: &Evidence, found: Found, limits: Limits) -> Result<Found, FieldError> {
    let better = refine(evidence, found.hyper, limits)?;
    Ok(Found { evaluations: found.evaluations + better.evaluations, ..better })
}

fn middle_of(training: &Training) -> Training {
    part_of(training, ROWS_FOR_HYPER, POSES_FOR_HYPER)
}

/// The rows of [`evenly`] spread poses.
fn part_of(training: &Training, rows: usize, at_least: usize) -> Training {
    training.select(&evenly(training, rows, at_least))
}

/// Poses spread evenly over the training set (and so over its groups) with at most `rows` rows, or
/// `at_least` poses.
fn evenly(training: &Training, rows: usize, at_least: usize) -> Vec<usize> {
    let poses = training.pose_count();
    let per_pose = (training.row_count() as f64 / poses.max(1) as f64).max(1.0);
    let wanted = ((rows as f64 / per_pose) as usize).max(at_least).clamp(1, poses);
    (0..wanted).map(|k| k * poses / wanted).collect()
}
