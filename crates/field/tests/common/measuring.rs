//! Measurements of an arm from hidden set-ups.

use truearm_estimate::{MeasurementSet, Sigma};
use truearm_kinematics::{Parameters, Transform};

use super::{Arm, Random};

/// How an arm is measured.
#[derive(Debug, Clone, Copy)]
pub struct Measure {
    pub poses: usize,
    /// Standard deviation of each position component, m.
    pub noise: f64,
    /// Standard deviation of each rotation component, rad, where orientation is measured.
    pub orientation: Option<f64>,
    pub groups: usize,
    pub targets: usize,
    /// Part of the joint ranges that is visited.
    pub share: (f64, f64),
    pub seed: u64,
}

impl Measure {
    pub fn poses(poses: usize) -> Self {
        Self { poses, noise: 3e-5, orientation: None, groups: 1, targets: 1, share: (0.0, 1.0), seed: 7 }
    }

    /// Measurements, groups taken in turn; the same frames and targets whatever the seed.
    pub fn of(&self, arm: &Arm) -> MeasurementSet {
        let joints = arm.configurations(self.poses, self.share, self.seed);
        let joint_count = arm.chain.joint_count();
        let parameters: Vec<f64> = joints.chunks(joint_count).flat_map(|q| arm.parameters(q)).collect();
        let mut flanges = vec![0.0; 16 * self.poses];
        arm.chain.poses(&joints, Parameters::Each(&parameters), &mut flanges).unwrap();
        let mut random = Random::new(self.seed + 1000);
        let mut set = MeasurementSet {
            joint_count,
            target_count: self.targets,
            group_count: self.groups,
            group: (0..self.poses).map(|pose| pose % self.groups).collect(),
            sigma: vec![Sigma::default(); self.poses],
            weight: vec![1.0; self.poses],
            joints,
            ..MeasurementSet::default()
        };
        for (pose, flange) in flanges.chunks(16).enumerate() {
            let hidden = Hidden::of(set.group[pose], self.targets);
            let world_from_flange = hidden.world_from_base.compose(&transform(flange));
            for target in &hidden.targets {
                let point = world_from_flange.apply(*target);
                let noise = random.normals::<3>(self.noise);
                set.targets.extend(point.iter().zip(noise).map(|(x, e)| x + e));
            }
            if let Some(sigma) = self.orientation {
                let error = Transform::from_rotation_vector(random.normals(sigma), [0.0; 3]);
                let turned = world_from_flange.compose(&hidden.flange_from_target);
                set.rotations.extend(Transform { translation: [0.0; 3], ..turned }.compose(&error).rotation);
            }
        }
        set
    }
}

/// A set-up that fits have to find.
struct Hidden {
    world_from_base: Transform,
    targets: Vec<[f64; 3]>,
    flange_from_target: Transform,
}

impl Hidden {
    fn of(group: usize, targets: usize) -> Self {
        let mut random = Random::new(500 + group as u64);
        let turn = [random.between(-0.5, 0.5), random.between(-0.5, 0.5), random.between(-3.0, 3.0)];
        let world_from_base = Transform::from_rotation_vector(turn, random.normals(1.0));
        let flange_from_target = Transform::from_rotation_vector(random.normals(0.3), [0.0; 3]);
        let target = |_| [random.between(0.03, 0.1), random.between(-0.1, 0.1), random.between(0.05, 0.15)];
        Self { world_from_base, flange_from_target, targets: (0..targets).map(target).collect() }
    }
}

fn transform(m: &[f64]) -> Transform {
    Transform {
        rotation: [m[0], m[1], m[2], m[4], m[5], m[6], m[8], m[9], m[10]],
        translation: [m[3], m[7], m[11]],
    }
}

/// Some poses of a set of positions, in the given order.
pub fn subset(set: &MeasurementSet, poses: &[usize]) -> MeasurementSet {
    let take = |values: &[f64], width: usize| -> Vec<f64> {
        poses.iter().flat_map(|&pose| &values[pose * width..(pose + 1) * width]).copied().collect()
    };
    MeasurementSet {
        joints: take(&set.joints, set.joint_count),
        targets: take(&set.targets, 3 * set.target_count),
        rotations: if set.has_rotations() { take(&set.rotations, 9) } else { Vec::new() },
        sigma: poses.iter().map(|&pose| set.sigma[pose]).collect(),
        weight: take(&set.weight, 1),
        group: poses.iter().map(|&pose| set.group[pose]).collect(),
        ..set.clone()
    }
}

/// Each pose of a set of positions so many times, one after the other: readings and targets scatter by their noise.
pub fn shots(set: &MeasurementSet, count: usize, still: f64, noise: f64, seed: u64) -> MeasurementSet {
    let again: Vec<usize> = (0..set.pose_count()).flat_map(|pose| vec![pose; count]).collect();
    let mut all = subset(set, &again);
    let mut random = Random::new(seed);
    all.joints.iter_mut().for_each(|q| *q += random.normals::<1>(still)[0]);
    all.targets.iter_mut().for_each(|x| *x += random.normals::<1>(noise)[0]);
    all
}
