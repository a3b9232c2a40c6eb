//! Measurements sorted into lanes: eight poses of one group side by side.

use std::ops::Range;

use truearm_kinematics::{LANES, Lane};

use crate::MeasurementSet;

/// Packets that share one Gram matrix: long enough to pay for its horizontal sums, short enough for the cache.
const PACKETS_PER_CHUNK: usize = 16;

/// Eight poses of one group; the last packet of a group repeats its last pose with weight zero.
pub struct Packet {
    pub poses: [usize; LANES],
    pub count: usize,
    pub joints: Vec<Lane>,
    /// Measured points in world, missing ones zero.
    pub targets: Vec<[Lane; 3]>,
    /// Measured rotations in world, row-major, missing ones zero.
    pub rotation: [Lane; 9],
    /// One where the target (then: the orientation) was measured, else zero.
    pub present: Vec<Lane>,
    pub sigma: Lane,
}

/// Consecutive packets of one group.
pub struct Chunk {
    pub group: usize,
    pub packets: Range<usize>,
}

/// All measurements as packets, chunk by chunk.
pub struct Packets {
    pub packets: Vec<Packet>,
    pub chunks: Vec<Chunk>,
}

impl Packets {
    pub fn new(set: &MeasurementSet) -> Self {
        let mut packed = Self { packets: Vec::new(), chunks: Vec::new() };
        for group in 0..set.group_count {
            let poses: Vec<usize> = (0..set.pose_count()).filter(|&pose| set.group[pose] == group).collect();
            let start = packed.packets.len();
            packed.packets.extend(poses.chunks(LANES).map(|eight| Packet::new(set, eight)));
            let end = packed.packets.len();
            packed.chunks.extend(
                (start..end)
                    .step_by(PACKETS_PER_CHUNK)
                    .map(|first| Chunk { group, packets: first..(first + PACKETS_PER_CHUNK).min(end) }),
            );
        }
        packed
    }

    pub fn of(&self, chunk: &Chunk) -> &[Packet] {
        &self.packets[chunk.packets.clone()]
    }
}

impl Packet {
    fn new(set: &MeasurementSet, eight: &[usize]) -> Self {
        let poses = std::array::from_fn(|lane| eight[lane.min(eight.len() - 1)]);
        let count = eight.len();
        let lanes = |value: &dyn Fn(usize) -> f64| Lane(poses.map(value));
        let measured = |value: &dyn Fn(usize) -> f64| {
            let filled = |lane: usize| if lane < count { value(poses[lane]) } else { 0.0 };
            Lane(std::array::from_fn(|lane| if filled(lane).is_nan() { 0.0 } else { filled(lane) }))
        };
        let here = |has: &dyn Fn(usize) -> bool| {
            Lane(std::array::from_fn(|lane| f64::from(u8::from(lane < count && has(poses[lane])))))
        };
        let width = set.target_count;
        let mut present: Vec<Lane> =
            (0..width).map(|target| here(&|pose| set.has_target(pose, target))).collect();
        present.push(here(&|pose| set.has_rotation(pose)));
        Self {
            poses,
            count,
            joints: (0..set.joint_count)
                .map(|j| lanes(&|pose| set.joints[pose * set.joint_count + j]))
                .collect(),
            targets: (0..width)
                .map(|t| std::array::from_fn(|k| measured(&|pose| set.targets[3 * (pose * width + t) + k])))
                .collect(),
            rotation: std::array::from_fn(|k| {
                measured(&|pose| if set.has_rotation(pose) { set.rotations[9 * pose + k] } else { 0.0 })
            }),
            present,
            sigma: lanes(&|pose| set.sigma[pose]),
        }
    }
}
