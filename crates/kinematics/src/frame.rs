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
        let mut frame = LaneFrame { rotation: [Lane::ZERO; 9], position: [Lane::ZERO; 3] };
        for (lane, value) in frame.rotation.iter_mut().zip(&transform.rotation) {
            *lane = Lane::splat(*value);
        }
        for (lane, value) in frame.position.iter_mut().zip(&transform.translation) {
            *lane = Lane::splat(*value);
        }
        frame
    }

    /// Axis k, in the base frame.
    #[inline(always)]
    pub fn axis(&self, k: usize) -> [Lane; 3] {
        [self.rotation[k], self.rotation[3 + k], self.rotation[6 + k]]
    }

    /// Turn about the axis that follows `first` and `second` in cyclic order.
    #[inline(always)]
    pub(crate) fn turn<I: Isa>(&mut self, first: usize, second: usize, (sine, cosine): (Lane, Lane)) {
        for row in 0..3 {
            let (u, v) = (self.rotation[3 * row + first], self.rotation[3 * row + second]);
            self.rotation[3 * row + first] = I::mul_add(u, cosine, v * sine);
            self.rotation[3 * row + second] = I::mul_add(v, cosine, -(u * sine));
        }
    }

    /// Shift along an axis of its own.
    #[inline(always)]
    pub(crate) fn shift<I: Isa>(&mut self, axis: usize, by: Lane) {
        for row in 0..3 {
            self.position[row] = I::mul_add(self.rotation[3 * row + axis], by, self.position[row]);
        }
    }

    /// Turn by a fixed rotation matrix, row-major, from the right.
    #[inline(always)]
    pub(crate) fn rotate<I: Isa>(&mut self, by: &[f64; 9]) {
        for row in self.rotation.as_chunks_mut::<3>().0 {
            let [x, y, z] = *row;
            for (column, value) in row.iter_mut().enumerate() {
                *value = I::mul_add(y, Lane::splat(by[3 + column]), x * by[column]);
                *value = I::mul_add(z, Lane::splat(by[6 + column]), *value);
            }
        }
    }
}
