//! The frame that is carried along a chain.

use crate::isa::Isa;
use crate::lane::Lane;
use crate::transform::Transform;

/// A frame of eight poses: base_from_frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LaneFrame {
    /// Rotation matrix, row-major.
    pub rotation: [Lane; 9],
    /// Origin, metres.
    pub position: [Lane; 3],
}

impl LaneFrame {
    /// The same transform for all poses.
    #[inline(always)]
    pub fn splat(transform: &Transform) -> LaneFrame {
        LaneFrame {
            rotation: Lane::splat_all(&transform.rotation),
            position: Lane::splat_all(&transform.translation),
        }
    }

    /// Axis k, in the base frame.
    #[inline(always)]
    pub fn axis(&self, k: usize) -> [Lane; 3] {
        [self.rotation[k], self.rotation[3 + k], self.rotation[6 + k]]
    }

    /// The frame of pose `i`, below [`LANES`](crate::LANES).
    pub fn pose(&self, i: usize) -> Transform {
        Transform {
            rotation: self.rotation.map(|lane| lane.0[i]),
            translation: self.position.map(|lane| lane.0[i]),
        }
    }
}

/// A frame that is carried along a chain.
pub(crate) trait Carried {
    /// Turn about the axis that follows `first` and `second` in cyclic order.
    fn turn<I: Isa>(&mut self, first: usize, second: usize, angle: (Lane, Lane));

    /// Shift along an axis of its own.
    fn shift<I: Isa>(&mut self, axis: usize, by: Lane);

    /// Turn by a fixed rotation matrix, row-major, from the right.
    fn rotate<I: Isa>(&mut self, by: &[f64; 9]);

    /// Where it is, for all poses.
    fn here(&self) -> LaneFrame;
}

impl Carried for LaneFrame {
    #[inline(always)]
    fn turn<I: Isa>(&mut self, first: usize, second: usize, (sine, cosine): (Lane, Lane)) {
        for row in self.rotation.as_chunks_mut::<3>().0 {
            turn::<I>(row, first, second, (sine, cosine));
        }
    }

    #[inline(always)]
    fn shift<I: Isa>(&mut self, axis: usize, by: Lane) {
        for row in 0..3 {
            self.position[row] = I::mul_add(self.rotation[3 * row + axis], by, self.position[row]);
        }
    }

    #[inline(always)]
    fn rotate<I: Isa>(&mut self, by: &[f64; 9]) {
        for row in self.rotation.as_chunks_mut::<3>().0 {
            rotate::<I>(row, by);
        }
    }

    #[inline(always)]
    fn here(&self) -> LaneFrame {
        *self
    }
}

/// The frame of one pose, its three rows beside each other in the lanes.
#[derive(Debug, Clone, Copy)]
pub(crate) struct OneFrame {
    columns: [Lane; 3],
    position: Lane,
}

impl OneFrame {
    /// A transform.
    #[inline(always)]
    pub fn new(transform: &Transform) -> OneFrame {
        let mut frame = OneFrame { columns: [Lane::ZERO; 3], position: Lane::ZERO };
        for row in 0..3 {
            for (column, lane) in frame.columns.iter_mut().enumerate() {
                lane.0[row] = transform.rotation[3 * row + column];
            }
            frame.position.0[row] = transform.translation[row];
        }
        frame
    }
}

impl Carried for OneFrame {
    #[inline(always)]
    fn turn<I: Isa>(&mut self, first: usize, second: usize, angle: (Lane, Lane)) {
        turn::<I>(&mut self.columns, first, second, angle);
    }

    #[inline(always)]
    fn shift<I: Isa>(&mut self, axis: usize, by: Lane) {
        self.position = I::mul_add(self.columns[axis], by, self.position);
    }

    #[inline(always)]
    fn rotate<I: Isa>(&mut self, by: &[f64; 9]) {
        rotate::<I>(&mut self.columns, by);
    }

    #[inline(always)]
    fn here(&self) -> LaneFrame {
        let mut frame = LaneFrame { rotation: [Lane::ZERO; 9], position: [Lane::ZERO; 3] };
        for row in 0..3 {
            for (column, lane) in self.columns.iter().enumerate() {
                frame.rotation[3 * row + column] = Lane::splat(lane.0[row]);
            }
            frame.position[row] = Lane::splat(self.position.0[row]);
        }
        frame
    }
}

/// One row of a rotation matrix turned about the axis that follows `first` and `second`.
#[inline(always)]
fn turn<I: Isa>(row: &mut [Lane; 3], first: usize, second: usize, (sine, cosine): (Lane, Lane)) {
    let (u, v) = (row[first], row[second]);
    row[first] = I::mul_add(u, cosine, v * sine);
    row[second] = I::mul_add(v, cosine, -(u * sine));
}

/// One row of a rotation matrix times another matrix, row-major.
#[inline(always)]
fn rotate<I: Isa>(row: &mut [Lane; 3], by: &[f64; 9]) {
    let [x, y, z] = *row;
    for (column, value) in row.iter_mut().enumerate() {
        *value = I::mul_add(y, Lane::splat(by[3 + column]), x * by[column]);
        *value = I::mul_add(z, Lane::splat(by[6 + column]), *value);
    }
}
