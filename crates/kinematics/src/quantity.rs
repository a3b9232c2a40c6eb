//! What a batch can compute of a group of eight poses.

use crate::chain::Chain;
use crate::isa::Isa;
use crate::lane::{LANES, Lane};
use crate::parameters::LaneParameters;
use crate::rows::store_lanes;
use crate::sweep::{LaneFrame, Screw};
use crate::transform::Transform;

/// A row of numbers for every pose.
pub(crate) trait Quantity: Copy + Sync {
    /// Numbers for one pose.
    fn width(&self) -> usize;

    /// Poses from which a second thread pays.
    fn parallel_from(&self) -> usize;

    /// Room that [`Quantity::group`] needs for screws.
    fn screws(&self) -> usize;

    /// Write the rows of a group; `rows` holds eight rows or, at the end of a batch, fewer.
    fn group<I: Isa>(
        &self,
        chain: &Chain,
        joints: &[Lane],
        parameters: LaneParameters<'_>,
        screws: &mut [Screw],
        rows: &mut [f64],
    );
}

/// The end's origin, 3 numbers.
#[derive(Clone, Copy)]
pub(crate) struct Position;

/// The end's frame as a homogeneous matrix, 16 numbers.
#[derive(Clone, Copy)]
pub(crate) struct Pose;

/// Motion of the end by some of the parameters, `rows` x `columns.len()` numbers; 3 rows or 6.
#[derive(Clone, Copy)]
pub(crate) struct Jacobian<'a> {
    pub columns: &'a [usize],
    pub rows: usize,
}

impl Quantity for Position {
    fn width(&self) -> usize {
        3
    }

    fn parallel_from(&self) -> usize {
        4096
    }

    fn screws(&self) -> usize {
        0
    }

    #[inline(always)]
    fn group<I: Isa>(
        &self,
        chain: &Chain,
        joints: &[Lane],
        parameters: LaneParameters<'_>,
        _screws: &mut [Screw],
        rows: &mut [f64],
    ) {
        let mut frame = LaneFrame::splat(&Transform::IDENTITY);
        chain.sweep::<I>(joints, parameters, &[], &mut frame, &mut []);
        store_lanes(&frame.position, rows);
    }
}

impl Quantity for Pose {
    fn width(&self) -> usize {
        16
    }

    fn parallel_from(&self) -> usize {
        4096
    }

    fn screws(&self) -> usize {
        0
    }

    #[inline(always)]
    fn group<I: Isa>(
        &self,
        chain: &Chain,
        joints: &[Lane],
        parameters: LaneParameters<'_>,
        _screws: &mut [Screw],
        rows: &mut [f64],
    ) {
        let mut frame = LaneFrame::splat(&Transform::IDENTITY);
        chain.sweep::<I>(joints, parameters, &[], &mut frame, &mut []);
        let (r, p) = (&frame.rotation, &frame.position);
        let (zero, one) = (Lane::ZERO, Lane::splat(1.0));
        let matrix = [
            r[0], r[1], r[2], p[0], r[3], r[4], r[5], p[1], r[6], r[7], r[8], p[2], zero, zero,
            zero, one,
        ];
        store_lanes(&matrix, rows);
    }
}

impl Quantity for Jacobian<'_> {
    fn width(&self) -> usize {
        self.rows * self.columns.len()
    }

    fn parallel_from(&self) -> usize {
        1024
    }

    fn screws(&self) -> usize {
        self.columns.len()
    }

    #[inline(always)]
    fn group<I: Isa>(
        &self,
        chain: &Chain,
        joints: &[Lane],
        parameters: LaneParameters<'_>,
        screws: &mut [Screw],
        rows: &mut [f64],
    ) {
        let mut frame = LaneFrame::splat(&Transform::IDENTITY);
        chain.sweep::<I>(joints, parameters, self.columns, &mut frame, screws);
        let columns = self.columns.len();
        for (i, matrix) in rows.chunks_exact_mut(self.width()).take(LANES).enumerate() {
            for (row, values) in matrix.chunks_exact_mut(columns).enumerate() {
                for (value, screw) in values.iter_mut().zip(screws.iter()) {
                    let motion = if row < 3 {
                        &screw.linear[row]
                    } else {
                        &screw.angular[row - 3]
                    };
                    *value = motion.0[i];
                }
            }
        }
    }
}
