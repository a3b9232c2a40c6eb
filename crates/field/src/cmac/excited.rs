//! The association cells that eight inputs excite.

use truearm_kinematics::{Isa, LANES, Lane, lane_room, load_lanes};

use crate::cmac::network::{Composition, Network};
use crate::cmac::sensor::{MOST_ACTIVE, Window};

/// Scratch and result of [`Excited::by`].
pub struct Excited {
    window: Window,
    inputs: Vec<Lane>,
    scratch: Vec<Lane>,
    /// The first active cell of each input.
    pub first: [u64; LANES],
    /// Excitation of each cell of the network's pattern, (A,).
    pub grades: Vec<Lane>,
    /// Sum of the excitations.
    pub sum: Lane,
}

impl Excited {
    /// Room for a network's active cells.
    pub fn new(network: &Network) -> Self {
        let room = vec![Lane::ZERO; network.active_count()];
        Self {
            window: Window { first: [0; LANES], grades: [Lane::ZERO; MOST_ACTIVE] },
            inputs: vec![Lane::ZERO; lane_room(network.input_count())],
            scratch: room.clone(),
            first: [0; LANES],
            grades: room,
            sum: Lane::ZERO,
        }
    }

    /// Excite the cells of up to eight rows of inputs (n, I); the last row stands for missing ones.
    #[inline(always)]
    pub fn by<I: Isa>(&mut self, network: &Network, inputs: &[f64]) {
        let (width, options) = (network.input_count(), network.options());
        let strides = network.strides();
        load_lanes::<I>(inputs, width, 0, &mut self.inputs);
        self.first = [0; LANES];
        self.grades[0] = Lane::splat(1.0);
        let mut filled = 1;
        for (index, sensor) in network.sensors().iter().enumerate() {
            sensor.excite::<I>(self.inputs[index], options.membership, &mut self.window);
            for i in 0..LANES {
                self.first[i] += self.window.first[i] * strides[index];
            }
            std::mem::swap(&mut self.grades, &mut self.scratch);
            let active = &self.window.grades[..sensor.active];
            for (source, target) in
                self.scratch[..filled].iter().zip(self.grades.chunks_exact_mut(sensor.active))
            {
                for (grade, to) in active.iter().zip(target) {
                    *to = composed(options.composition, *source, *grade);
                }
            }
            filled *= sensor.active;
        }
        self.sum = Lane::ZERO;
        for grade in &self.grades {
            self.sum += *grade;
        }
    }
}

#[inline(always)]
fn composed(composition: Composition, a: Lane, b: Lane) -> Lane {
    if composition == Composition::Product { a * b } else { a.where_below(b, a, b) }
}
