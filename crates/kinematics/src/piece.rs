//! The loop over the groups of eight of a part of a batch.

use crate::chain::Chain;
use crate::isa::{Isa, Kernel};
use crate::lane::{LANES, Lane};
use crate::parameters::{LaneParameters, SharedParameters};
use crate::quantity::Quantity;
use crate::rows::{lane_room, load_lanes};
use crate::writer::LineWriter;

/// Where a piece takes its parameters from.
#[derive(Clone, Copy)]
pub(crate) enum Source<'a> {
    Shared(&'a SharedParameters),
    Each(&'a [f64]),
}

/// A run of poses from `first` on, as many as `out` has rows for.
pub(crate) struct Piece<'a, Q> {
    pub chain: &'a Chain,
    pub quantity: Q,
    pub joints: &'a [f64],
    pub source: Source<'a>,
    pub first: usize,
    pub out: &'a mut [f64],
    /// Write past the caches.
    pub stream: bool,
}

impl<Q: Quantity> Kernel for Piece<'_, Q> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self) {
        let group = LANES * self.quantity.width();
        let mut reader = Reader::new(self.chain, self.joints, self.source, self.first);
        let mut scratch = self.quantity.scratch();
        if !self.stream {
            for rows in self.out.chunks_mut(group) {
                let (joints, parameters) = reader.next::<I>();
                self.quantity.group::<I>(self.chain, joints, parameters, &mut scratch, rows);
            }
            return;
        }
        let mut left = self.out.len();
        let mut writer = LineWriter::new(self.out, group);
        while left > 0 {
            let count = left.min(group);
            let (joints, parameters) = reader.next::<I>();
            self.quantity.group::<I>(self.chain, joints, parameters, &mut scratch, writer.room(count));
            writer.commit::<I>(count);
            left -= count;
        }
        writer.finish::<I>();
    }
}

/// Takes group after group of poses from the arrays of a batch.
struct Reader<'a> {
    joints: &'a [f64],
    joint_count: usize,
    source: Source<'a>,
    parameter_count: usize,
    first: usize,
    joint_lanes: Vec<Lane>,
    parameter_lanes: Vec<Lane>,
}

impl<'a> Reader<'a> {
    fn new(chain: &Chain, joints: &'a [f64], source: Source<'a>, first: usize) -> Self {
        let (joint_count, parameter_count) = (chain.joint_count(), chain.parameter_count());
        let own = match source {
            Source::Shared(_) => 0,
            Source::Each(_) => lane_room(parameter_count),
        };
        let (joint_lanes, parameter_lanes) =
            (vec![Lane::ZERO; lane_room(joint_count)], vec![Lane::ZERO; own]);
        Self { joints, joint_count, source, parameter_count, first, joint_lanes, parameter_lanes }
    }

    #[inline(always)]
    fn next<I: Isa>(&mut self) -> (&[Lane], LaneParameters<'_>) {
        let first = self.first;
        self.first += LANES;
        load_lanes::<I>(self.joints, self.joint_count, first, &mut self.joint_lanes);
        let parameters = match self.source {
            Source::Shared(shared) => LaneParameters::Shared(shared),
            Source::Each(values) => {
                load_lanes::<I>(values, self.parameter_count, first, &mut self.parameter_lanes);
                LaneParameters::Each(&self.parameter_lanes)
            }
        };
        (&self.joint_lanes[..self.joint_count], parameters)
    }
}
