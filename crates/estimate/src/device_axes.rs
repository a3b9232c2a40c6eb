//! Axes of the measuring device, along which a row may state sigmas that differ.

use crate::measurements::MeasurementSet;
use crate::setup::Setup;

/// Turns rows of positions (n, m, width) from the base's axes to those of world, where sigmas of the set differ along these;
/// all other rows stay as they are.
///
/// Where sigmas do not differ no axes are better than others, and rows keep those of the base.
pub fn turn_to_device(set: &MeasurementSet, setup: &Setup, rows: &mut [f64], width: usize) {
    if !set.differs_by_axis() || set.is_distances() {
        return;
    }
    let of_pose = set.rows_per_pose() * width;
    for (pose, rows) in rows.chunks_exact_mut(of_pose).enumerate() {
        let world_from_base = setup.groups[set.group[pose]].world_from_base;
        for point in rows.chunks_exact_mut(3 * width).take(set.target_count) {
            for column in 0..width {
                let in_base = [0, 1, 2].map(|k| point[k * width + column]);
                let in_world = world_from_base.rotate(in_base);
                (0..3).for_each(|k| point[k * width + column] = in_world[k]);
            }
        }
    }
}

/// Covariance (3, 3) in the base's axes of what a pose states of its positions.
pub fn own_covariance(set: &MeasurementSet, setup: &Setup, pose: usize) -> [[f64; 3]; 3] {
    let own = &set.sigma[pose];
    if !own.differs_by_axis() {
        let variance = own.position[0].powi(2);
        return [0, 1, 2].map(|i| [0, 1, 2].map(|j| if i == j { variance } else { 0.0 }));
    }
    let world_from_base = setup.groups[set.group[pose]].world_from_base.rotation;
    let entry = |i: usize, j: usize| {
        (0..3)
            .map(|k| world_from_base[3 * k + i] * own.position[k].powi(2) * world_from_base[3 * k + j])
            .sum()
    };
    [0, 1, 2].map(|i| [0, 1, 2].map(|j| entry(i, j)))
}
