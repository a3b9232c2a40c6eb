//! Active mode: poses are chosen in the region and measured on demand.

use truearm_estimate::{
    ChoiceOptions, Criterion, EstimateError, FrameMode, MeasurementSet, Point, Problem, Setup, Sigma,
    choose_poses, linearise,
};
use truearm_kinematics::{Cancel, Chain};

use crate::FieldError;
use crate::regions::source::{Prepared, RegionRows, Source, Verdict};

/// Poses that may be measured.
#[derive(Debug, Clone, Default)]
pub struct Candidates {
    /// Joint values, (n, J).
    pub joints: Vec<f64>,
    /// Features, (n, F).
    pub features: Vec<f64>,
}

/// An arm and its instrument.
pub trait Workspace {
    /// What can go wrong.
    type Error: From<FieldError>;

    /// Up to `count` poses within the box between two corners (F,) that can be reached and measured; the same for
    /// the same seed.
    fn candidates(
        &mut self,
        low: &[f64],
        high: &[f64],
        count: usize,
        seed: u64,
    ) -> Result<Candidates, Self::Error>;

    /// Measure poses with joint values (n, J), of one group.
    fn measure(&mut self, joints: &[f64]) -> Result<MeasurementSet, Self::Error>;
}

/// How poses are chosen.
#[derive(Debug, Clone)]
pub struct PoseOptions {
    /// Poses to identify a region's CEPs from.
    pub poses: usize,
    /// Candidates that they are chosen from.
    pub candidates: usize,
    /// Poses to judge them by.
    pub tests: usize,
    /// Largest condition number kappa(M).
    pub limit: f64,
    /// What the choice makes best.
    pub criterion: Criterion,
    /// Runs of the exchange through the chosen poses.
    pub passes: usize,
    /// Whether orientations are measured.
    pub orientation: bool,
}

/// A workspace that is measured on demand.
pub struct Active<'a, W> {
    /// The arm's model.
    pub chain: &'a Chain,
    /// Parameters that CEPs belong to.
    pub columns: &'a [usize],
    /// Link parameters, (5 L,).
    pub parameters: &'a [f64],
    /// Frame and target of the one group.
    pub setup: &'a Setup,
    /// Where poses come from.
    pub workspace: W,
    /// How they are chosen.
    pub options: PoseOptions,
}

/// Seeds of test points differ from those of candidates.
const TESTS: u64 = 1 << 63;

impl<W: Workspace> Source for Active<'_, W> {
    type Error = W::Error;

    const SCARCE_HALVES: bool = true;

    fn prepare(&mut self, low: &[f64], high: &[f64], seed: u64) -> Result<Prepared, W::Error> {
        let found = self.workspace.candidates(low, high, self.options.candidates, seed)?;
        let width = self.chain.joint_count();
        let count = self.count(&found, low.len())?;
        let needed = self.options.poses;
        if count < needed {
            let verdict = Verdict::Scarce { found: count, needed };
            return Ok(Prepared { verdict, joints: Vec::new(), rows: Vec::new() });
        }
        let (jacobian, rows) = self.jacobian(&found.joints).map_err(FieldError::from)?;
        let options = &self.options;
        let how = ChoiceOptions {
            count: options.poses,
            criterion: options.criterion,
            columns: self.columns,
            given: &[],
            start: None,
            limit: Some(options.limit),
            passes: options.passes,
            cancel: Cancel::default(),
        };
        let choice = choose_poses(&jacobian, rows, &how).map_err(FieldError::from)?;
        let kappa = choice.after.kappa;
        let verdict = if choice.well_conditioned {
            Verdict::Ready(kappa)
        } else {
            Verdict::IllConditioned { kappa, limit: options.limit }
        };
        let joints = choice.chosen.iter().flat_map(|&k| &found.joints[k * width..(k + 1) * width]).copied();
        Ok(Prepared { verdict, joints: joints.collect(), rows: choice.chosen })
    }

    fn rows(
        &mut self,
        prepared: &Prepared,
        low: &[f64],
        high: &[f64],
        seed: u64,
    ) -> Result<RegionRows, W::Error> {
        let dimensions = low.len();
        let found = self.workspace.candidates(low, high, self.options.candidates, seed)?;
        let features = |k: &usize| found.features[k * dimensions..(k + 1) * dimensions].to_vec();
        let identify_features = prepared.rows.iter().flat_map(features).collect();
        let identify = self.measured(&prepared.joints)?;
        let tests = self.workspace.candidates(low, high, self.options.tests, seed ^ TESTS)?;
        self.count(&tests, dimensions)?;
        let judge = self.measured(&tests.joints)?;
        Ok(RegionRows { identify, judge, identify_features, judge_features: tests.features })
    }
}

impl<W: Workspace> Active<'_, W> {
    fn count(&self, found: &Candidates, dimensions: usize) -> Result<usize, FieldError> {
        let count = found.features.len() / dimensions;
        for (what, found, width) in [
            ("the candidates' features", found.features.len(), dimensions),
            ("the candidates' joint values", found.joints.len(), self.chain.joint_count()),
        ] {
            if found != count * width {
                return Err(FieldError::Length { what, found, expected: count * width });
            }
        }
        Ok(count)
    }

    fn measured(&mut self, joints: &[f64]) -> Result<MeasurementSet, W::Error> {
        let set = self.workspace.measure(joints)?;
        set.check().map_err(FieldError::from)?;
        let (expected, found) = (joints.len() / self.chain.joint_count(), set.pose_count());
        if found != expected {
            return Err(FieldError::Length { what: "the measured poses", found, expected }.into());
        }
        Ok(set)
    }

    /// Derivatives (n, m, P) at joint values (n, J), and m.
    fn jacobian(&self, joints: &[f64]) -> Result<(Vec<f64>, usize), EstimateError> {
        let count = joints.len() / self.chain.joint_count();
        let targets = self.setup.groups.first().map_or(1, |group| group.targets.len());
        let set = MeasurementSet {
            joint_count: self.chain.joint_count(),
            target_count: targets,
            group_count: 1,
            joints: joints.to_vec(),
            group: vec![0; count],
            targets: vec![0.0; 3 * count * targets],
            rotations: if self.options.orientation {
                [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0].repeat(count)
            } else {
                Vec::new()
            },
            sigma: vec![Sigma::default(); count],
            weight: vec![1.0; count],
            ..MeasurementSet::default()
        };
        set.check()?;
        let problem =
            Problem { chain: self.chain, measurements: &set, columns: self.columns, frame: FrameMode::World };
        let rows = linearise(&problem, Point { parameters: self.parameters, setup: self.setup })?;
        Ok((rows.arm, rows.rows))
    }
}
