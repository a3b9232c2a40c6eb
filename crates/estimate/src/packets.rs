//! Measurements sorted into lanes: eight poses of one group side by side.

use std::ops::Range;

use truearm_kinematics::{LANES, Lane};

use crate::MeasurementSet;

/// Packets that share one Gram matrix: long enough to pay for its horizontal sums, short enough for the cache.
const PACKETS_PER_CHUNK: usize = 16;

/// Eight poses of one group; the last packet of a group repeats its last pose with weight zero.
#[derive(Clone, Copy)]
pub struct Packet<'a> {
    pub poses: [usize; LANES],
    pub count: usize,
    /// (J,).
    pub joints: &'a [Lane],
    /// Measured points in world, (3 T,), missing ones zero.
    pub targets: &'a [Lane],
    /// Measured rotations in world, row-major, (9,), missing ones zero; empty where none was measured at all.
    pub rotation: &'a [Lane],
    /// One where the target (then: the orientation) was measured, else zero, (T + 1,).
    pub present: &'a [Lane],
    /// Of what is measured along x, y and z of world, m, and of orientation, rad, (4,).
    pub sigma: &'a [Lane],
}

/// Consecutive packets of one group.
pub struct Chunk {
    pub group: usize,
    pub packets: Range<usize>,
}

/// All measurements as packets, chunk by chunk, each kind of value in one array.
pub struct Packets {
    pub chunks: Vec<Chunk>,
    poses: Vec<([usize; LANES], usize)>,
    joints: Vec<Lane>,
    targets: Vec<Lane>,
    rotations: Vec<Lane>,
    present: Vec<Lane>,
    sigma: Vec<Lane>,
}

impl Packets {
    /// All poses of a set, sorted by group.
    pub fn new(set: &MeasurementSet) -> Self {
        let count = set.pose_count().div_ceil(LANES) + set.group_count.min(set.pose_count());
        let mut packed = Self {
            chunks: Vec::new(),
            poses: Vec::with_capacity(count),
            joints: Vec::with_capacity(count * set.joint_count),
            targets: Vec::with_capacity(count * 3 * set.target_count),
            rotations: Vec::with_capacity(if set.has_rotations() { 9 * count } else { 0 }),
            present: Vec::with_capacity(count * (set.target_count + 1)),
            sigma: Vec::with_capacity(4 * count),
        };
        for group in 0..set.group_count {
            let poses: Vec<usize> = (0..set.pose_count()).filter(|&pose| set.group[pose] == group).collect();
            let start = packed.len();
            poses.chunks(LANES).for_each(|eight| packed.push(set, eight));
            let end = packed.len();
            let firsts = (start..end).step_by(PACKETS_PER_CHUNK);
            let packets = |first: usize| first..(first + PACKETS_PER_CHUNK).min(end);
            packed.chunks.extend(firsts.map(|first| Chunk { group, packets: packets(first) }));
        }
        packed
    }

    /// Packets in all.
    pub fn len(&self) -> usize {
        self.poses.len()
    }

    /// The packets of a chunk.
    pub fn of(&self, chunk: &Chunk) -> impl Iterator<Item = Packet<'_>> {
        chunk.packets.clone().map(|index| self.packet(index))
    }

    fn packet(&self, index: usize) -> Packet<'_> {
        let part = |lanes: &'_ [Lane]| {
            let width = lanes.len() / self.len();
            index * width..(index + 1) * width
        };
        let (poses, count) = self.poses[index];
        Packet {
            poses,
            count,
            joints: &self.joints[part(&self.joints)],
            targets: &self.targets[part(&self.targets)],
            rotation: &self.rotations[part(&self.rotations)],
            present: &self.present[part(&self.present)],
            sigma: &self.sigma[part(&self.sigma)],
        }
    }

    fn push(&mut self, set: &MeasurementSet, eight: &[usize]) {
        let mut poses = [eight[eight.len() - 1]; LANES];
        poses[..eight.len()].copy_from_slice(eight);
        let count = eight.len();
        self.poses.push((poses, count));
        gather(&mut self.joints, &set.joints, set.joint_count, &poses);
        let sigmas = poses.map(|pose| set.sigma[pose].values());
        self.sigma.extend((0..4).map(|k| Lane::from_fn(|lane| sigmas[lane][k])));
        let width = 3 * set.target_count;
        let first = self.targets.len();
        gather(&mut self.targets, &set.targets, width, &poses);
        for target in 0..set.target_count {
            let here = |lane: usize| lane < count && set.has_target(poses[lane], target);
            self.present.push(Lane::from_fn(|lane| f64::from(u8::from(here(lane)))));
        }
        let here = |lane: usize| lane < count && set.has_rotation(poses[lane]);
        self.present.push(Lane::from_fn(|lane| f64::from(u8::from(here(lane)))));
        zero_missing(&mut self.targets[first..]);
        if set.has_rotations() {
            let first = self.rotations.len();
            gather(&mut self.rotations, &set.rotations, 9, &poses);
            zero_missing(&mut self.rotations[first..]);
        }
    }
}

/// Appends rows (width,) of eight poses as lanes.
fn gather(lanes: &mut Vec<Lane>, rows: &[f64], width: usize, poses: &[usize; LANES]) {
    lanes.extend((0..width).map(|k| Lane::from_fn(|lane| rows[poses[lane] * width + k])));
}

fn zero_missing(lanes: &mut [Lane]) {
    for value in lanes.iter_mut().flat_map(|lane| &mut lane.0) {
        if value.is_nan() {
            *value = 0.0;
        }
    }
}
