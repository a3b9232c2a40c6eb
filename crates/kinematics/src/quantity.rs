//! What a batch can compute of a group of eight poses.

use crate::chain::Chain;
use crate::frame::LaneFrame;
use crate::isa::Isa;
use crate::lane::{LANES, Lane};
use crate::parameters::LaneParameters;
use crate::rows::store_lanes;
use crate::sweep::Screw;
use crate::transform::Transform;

/// A row of numbers for every pose.
pub(crate) trait Quantity: Copy + Sync {
    /// Numbers for one pose.
    fn width(&self) -> usize;

    /// Poses from which a second thread pays.
    fn parallel_from(&self) -> usize;

    /// What [`Quantity::group`] needs, made once for many groups.
    fn scratch(&self) -> Scratch {
        Scratch::default()
    }

    /// Write the rows of a group; `rows` holds eight rows or, at the end of a batch, fewer.
    fn group<I: Isa>(
        &self,
        chain: &Chain,
        joints: &[Lane],
        parameters: LaneParameters<'_>,
        scratch: &mut Scratch,
        rows: &mut [f64],
    );
}

/// Screws of a group, and the lane of the screws that goes into each column of a row.
#[derive(Default)]
pub(crate) struct Scratch {
    screws: Vec<Screw>,
    order: Vec<usize>,
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
        8192
    }

    #[inline(always)]
    fn group<I: Isa>(
        &self,
        chain: &Chain,
        joints: &[Lane],
        parameters: LaneParameters<'_>,
        _scratch: &mut Scratch,
        rows: &mut [f64],
    ) {
        let point = chain.end_point::<I>(joints, parameters);
        let mut all = [0.0; 3 * LANES];
        for i in 0..LANES {
            for (k, lane) in point.iter().enumerate() {
                all[3 * i + k] = lane.0[i];
            }
        }
        rows.copy_from_slice(&all[..rows.len()]);
    }
}

impl Quantity for Pose {
    fn width(&self) -> usize {
        16
    }

    fn parallel_from(&self) -> usize {
        4096
    }

    #[inline(always)]
    fn group<I: Isa>(
        &self,
        chain: &Chain,
        joints: &[Lane],
        parameters: LaneParameters<'_>,
        _scratch: &mut Scratch,
        rows: &mut [f64],
    ) {
        const ORDER: [usize; 16] = [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15];
        let frame = chain.end_frame::<I>(joints, parameters);
        let (r, p) = (&frame.rotation, &frame.position);
        let (zero, one) = (Lane::ZERO, Lane::splat(1.0));
        let matrix =
            [r[0], r[1], r[2], p[0], r[3], r[4], r[5], p[1], r[6], r[7], r[8], p[2], zero, zero, zero, one];
        store_lanes::<I>(&matrix, &ORDER, rows);
    }
}

impl Quantity for Jacobian<'_> {
    fn width(&self) -> usize {
        self.rows * self.columns.len()
    }

    fn parallel_from(&self) -> usize {
        1024
    }

    fn scratch(&self) -> Scratch {
        let lane = |row: usize, column: usize| 6 * column + (row + 3) % 6;
        let columns = self.columns.len();
        let order = (0..self.rows).flat_map(|row| (0..columns).map(move |column| lane(row, column)));
        Scratch { screws: vec![Screw::ZERO; columns], order: order.collect() }
    }

    #[inline(always)]
    fn group<I: Isa>(
        &self,
        chain: &Chain,
        joints: &[Lane],
        parameters: LaneParameters<'_>,
        scratch: &mut Scratch,
        rows: &mut [f64],
    ) {
        let mut frame = LaneFrame::splat(&Transform::IDENTITY);
        chain.sweep_again::<I>(joints, parameters, self.columns, &mut frame, &mut scratch.screws);
        store_lanes::<I>(Screw::lanes(&scratch.screws), &scratch.order, rows);
    }
}
