//! Measurements of an arm whose errors, frames and targets are known to the test and hidden from the fit.

use truearm_estimate::{
    Distance, DistanceTo, FrameMode, GroupSetup, MeasurementSet, Point, Problem, Setup, Sigma, residuals,
};
use truearm_kinematics::{Chain, Joint, Parameters, Transform};

use super::stream::Stream;

/// What is to be made.
#[derive(Clone)]
pub struct Plan {
    pub chain: Chain,
    /// Parameters that are wrong and asked for.
    pub columns: Vec<usize>,
    pub frame: FrameMode,
    /// Poses of each group.
    pub poses: Vec<usize>,
    pub targets: usize,
    pub rotations: bool,
    /// Standard deviation of each hidden correction, m and rad.
    pub errors: f64,
    /// Noise of positions (m) and orientations (rad).
    pub noise: (f64, f64),
    /// Half ranges of the joints; empty for 2.5 rad and 0.3 m.
    pub spans: Vec<f64>,
    /// What makes joints of a pose follow from others, once they are drawn.
    pub bound: fn(&mut [f64]),
    /// Half a side of the cube that the targets lie in, m.
    pub tool: f64,
    pub seed: u64,
}

impl Plan {
    /// One target in one group, unknown frame, no noise, corrections of a millimetre and a milliradian.
    pub fn new(chain: Chain, columns: Vec<usize>, poses: usize) -> Self {
        Self {
            chain,
            columns,
            frame: FrameMode::Free,
            poses: vec![poses],
            targets: 1,
            rotations: false,
            errors: 1e-3,
            noise: (0.0, 0.0),
            spans: vec![],
            bound: |_| (),
            tool: 0.15,
            seed: 1,
        }
    }

    pub fn make(&self) -> Scene {
        let mut stream = Stream::new(self.seed);
        let mut truth = self.chain.nominal();
        self.columns.iter().for_each(|&column| truth[column] += self.errors * stream.normal());
        let groups = self.poses.iter().map(|_| self.group(&mut stream)).collect();
        let setup = Setup { groups, anchors: vec![] };
        let mut set = self.empty(&mut stream);
        self.measure(&mut set, &truth, &setup, &mut stream);
        Scene {
            chain: self.chain.clone(),
            columns: self.columns.clone(),
            frame: self.frame,
            truth,
            setup,
            set,
        }
    }

    fn group(&self, stream: &mut Stream) -> GroupSetup {
        let frame = Transform::from_rotation_vector(stream.vector(1.8), stream.vector(2.0));
        let turn = Transform::from_rotation_vector(stream.vector(1.0), [0.0; 3]);
        let free = self.frame == FrameMode::Free;
        GroupSetup {
            world_from_base: if free { frame } else { Transform::IDENTITY },
            targets: (0..self.targets).map(|_| stream.vector(self.tool)).collect(),
            flange_from_target: if self.rotations { turn.rotation } else { Transform::IDENTITY.rotation },
        }
    }

    fn empty(&self, stream: &mut Stream) -> MeasurementSet {
        let n: usize = self.poses.iter().sum();
        let joints = (0..n).flat_map(|_| self.joints(stream)).collect();
        let group = self.poses.iter().enumerate().flat_map(|(g, &count)| vec![g; count]).collect();
        MeasurementSet {
            joint_count: self.chain.joint_count(),
            target_count: self.targets,
            group_count: self.poses.len(),
            joints,
            group,
            targets: vec![0.0; 3 * n * self.targets],
            rotations: vec![0.0; if self.rotations { 9 * n } else { 0 }],
            sigma: vec![Sigma::default(); n],
            weight: vec![1.0; n],
            ..MeasurementSet::default()
        }
    }

    fn joints(&self, stream: &mut Stream) -> Vec<f64> {
        let moving = self.chain.links().iter().filter(|link| link.joint != Joint::Fixed).enumerate();
        let half = |(k, joint)| match (self.spans.get(k), joint) {
            (Some(&span), _) => span,
            (None, Joint::Prismatic) => 0.3,
            (None, _) => 2.5,
        };
        let mut joints: Vec<f64> = moving.map(|(k, link)| stream.within(half((k, link.joint)))).collect();
        (self.bound)(&mut joints);
        joints
    }

    fn measure(&self, set: &mut MeasurementSet, truth: &[f64], setup: &Setup, stream: &mut Stream) {
        let flanges = flanges(&self.chain, &set.joints, truth);
        for (pose, flange) in flanges.iter().enumerate() {
            let group = &setup.groups[set.group[pose]];
            let world_from_flange = group.world_from_base.compose(flange);
            for (t, &target) in group.targets.iter().enumerate() {
                let (point, noise) = (world_from_flange.apply(target), stream.normals(self.noise.0));
                let at = 3 * (pose * self.targets + t);
                (0..3).for_each(|k| set.targets[at + k] = point[k] + noise[k]);
            }
            if self.rotations {
                let target = Transform { rotation: group.flange_from_target, translation: [0.0; 3] };
                let noise = Transform::from_rotation_vector(stream.normals(self.noise.1), [0.0; 3]);
                let turned = noise.compose(&world_from_flange).compose(&target);
                set.rotations[9 * pose..9 * pose + 9].copy_from_slice(&turned.rotation);
            }
        }
    }
}

/// Measurements with what they were made of.
#[derive(Clone)]
pub struct Scene {
    pub chain: Chain,
    pub columns: Vec<usize>,
    pub frame: FrameMode,
    /// True link parameters (5 L,).
    pub truth: Vec<f64>,
    /// True frames and targets.
    pub setup: Setup,
    pub set: MeasurementSet,
}

impl Scene {
    pub fn problem(&self) -> Problem<'_> {
        Problem { chain: &self.chain, measurements: &self.set, columns: &self.columns, frame: self.frame }
    }

    pub fn point(&self) -> Point<'_> {
        Point { parameters: &self.truth, setup: &self.setup }
    }

    /// Distances of the same arm in place of its points: every pose to the next, or to each of the anchors.
    pub fn with_distances(mut self, anchors: &[[f64; 3]], noise: f64) -> Self {
        let (n, mut stream) = (self.set.pose_count(), Stream::new(99));
        self.setup.anchors = anchors.to_vec();
        self.set.anchor_count = anchors.len();
        self.set.target_count = 0;
        self.set.targets.clear();
        let to = |pose: usize| match anchors.len() {
            0 => vec![DistanceTo::Pose((pose + 1) % n), DistanceTo::Pose((pose + 7) % n)],
            count => (0..count).map(DistanceTo::Anchor).collect(),
        };
        let all =
            (0..n).flat_map(|pose| to(pose).into_iter().map(move |to| Distance { pose, to, value: 0.0 }));
        self.set.distances = all.collect();
        let predicted = residuals(&self.problem(), self.point()).unwrap();
        for (distance, residual) in self.set.distances.iter_mut().zip(predicted) {
            distance.value = -residual + noise * stream.normal();
        }
        self
    }

    /// Largest difference between the fitted and the true parameters that were asked for.
    pub fn error_of(&self, parameters: &[f64]) -> f64 {
        self.columns.iter().map(|&c| (parameters[c] - self.truth[c]).abs()).fold(0.0, f64::max)
    }
}

/// base_from_flange of each pose.
pub fn flanges(chain: &Chain, joints: &[f64], parameters: &[f64]) -> Vec<Transform> {
    let mut matrices = vec![0.0; 16 * joints.len() / chain.joint_count()];
    chain.poses(joints, Parameters::One(parameters), &mut matrices).unwrap();
    matrices.chunks_exact(16).map(|m| Transform::from_matrix(&std::array::from_fn(|k| m[k]))).collect()
}
