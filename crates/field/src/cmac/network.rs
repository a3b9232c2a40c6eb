//! The network: its sensors, how their grades are composed, and its weights.

use truearm_estimate::EstimateError;
use truearm_kinematics::{LANES, Lane};

use crate::cmac::sensor::{Membership, Sensor};
use crate::cmac::table::Table;

/// Inputs at most, and association cells active at once at most.
pub const MOST_INPUTS: usize = 8;
const MOST_ACTIVE_CELLS: usize = 1 << 14;

/// The fuzzy AND of the sensors' grades.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Composition {
    /// The smallest: max-min composition, the paper's.
    Min,
    /// Their product.
    Product,
}

/// What a network is made of beside its sensors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NetworkOptions {
    /// Grades of a sensor's cells.
    pub membership: Membership,
    /// How they are put together.
    pub composition: Composition,
    /// Rows of a hash table; `None` gives each association cell a row of its own.
    pub hashed: Option<usize>,
}

/// A CMAC or FCMAC: I inputs, P outputs.
///
/// Association cells are numbered with the last input running fastest. The output is the centroid of the active
/// cells' weights, equation (A4).
#[derive(Debug, Clone, PartialEq)]
pub struct Network {
    sensors: Vec<Sensor>,
    options: NetworkOptions,
    outputs: usize,
    table: Table,
    rows: usize,
    cells: u64,
    /// Numbers of the active cells, less that of the first, (A,).
    pattern: Vec<u64>,
    /// Rows of lanes, (rows, lanes of a row).
    weights: Vec<Lane>,
}

impl Network {
    /// A network whose weights are zero.
    ///
    /// # Errors
    /// [`EstimateError::Option`] where a number is out of its range.
    pub fn new(
        sensors: Vec<Sensor>,
        outputs: usize,
        options: NetworkOptions,
    ) -> Result<Network, EstimateError> {
        let refuse =
            |what, value: usize, rule| Err(EstimateError::Option { what, value: value as f64, rule });
        if sensors.is_empty() || sensors.len() > MOST_INPUTS {
            return refuse("the number of sensors", sensors.len(), "it must be 1 to 8, one for each input");
        }
        if outputs == 0 {
            return refuse("the number of outputs", outputs, "it must be 1 or more");
        }
        sensors.iter().try_for_each(|sensor| sensor.check(options.membership))?;
        let active: usize = sensors.iter().map(|sensor| sensor.active).product();
        if active > MOST_ACTIVE_CELLS {
            return refuse("the number of active cells", active, "it must be 16384 or fewer: lower c");
        }
        let Some(cells) = sensors.iter().try_fold(1u64, |n, sensor| n.checked_mul(sensor.cells as u64))
        else {
            return refuse("the number of sensor cells", sensors[0].cells, "their product must fit 64 bits");
        };
        let table = options.hashed.map_or(Table::Dense, |rows| Table::Hashed { rows });
        let rows = table.rows(cells)?;
        let pattern = pattern(&sensors);
        let weights = vec![Lane::ZERO; rows * outputs.div_ceil(LANES)];
        Ok(Network { sensors, options, outputs, table, rows, cells, pattern, weights })
    }

    /// The sensors, one for each input.
    pub fn sensors(&self) -> &[Sensor] {
        &self.sensors
    }

    /// What the network was made with.
    pub fn options(&self) -> NetworkOptions {
        self.options
    }

    /// Inputs, I.
    pub fn input_count(&self) -> usize {
        self.sensors.len()
    }

    /// Outputs, P.
    pub fn output_count(&self) -> usize {
        self.outputs
    }

    /// Association cells, whether or not they have a row of their own.
    pub fn cell_count(&self) -> u64 {
        self.cells
    }

    /// Association cells that an input excites, A.
    pub fn active_count(&self) -> usize {
        self.pattern.len()
    }

    /// Rows of weights.
    pub fn row_count(&self) -> usize {
        self.rows
    }

    /// The weights, (rows, P).
    pub fn weights(&self) -> Vec<f64> {
        let lanes = self.lanes();
        let row = |row: usize| {
            self.weights[row * lanes..(row + 1) * lanes].iter().flat_map(|lane| lane.0).take(self.outputs)
        };
        (0..self.rows).flat_map(row).collect()
    }

    /// The same network with other weights, (rows, P).
    ///
    /// # Errors
    /// [`EstimateError::Length`].
    pub fn with_weights(&self, weights: &[f64]) -> Result<Network, EstimateError> {
        let expected = self.rows * self.outputs;
        if weights.len() != expected {
            return Err(EstimateError::Length { what: "the weights", found: weights.len(), expected });
        }
        let mut network = self.clone();
        for (row, values) in weights.chunks_exact(self.outputs).enumerate() {
            network.set_row(row, values);
        }
        Ok(network)
    }

    /// Gives every row the same weights (P,).
    pub(super) fn fill(&mut self, values: &[f64]) {
        (0..self.rows).for_each(|row| self.set_row(row, values));
    }

    fn set_row(&mut self, row: usize, values: &[f64]) {
        let lanes = self.lanes();
        for (k, value) in values.iter().enumerate() {
            self.weights[row * lanes + k / LANES].0[k % LANES] = *value;
        }
    }

    /// Lanes of a row of weights.
    #[inline(always)]
    pub(super) fn lanes(&self) -> usize {
        self.outputs.div_ceil(LANES)
    }

    pub(super) fn pattern(&self) -> &[u64] {
        &self.pattern
    }

    pub(super) fn table(&self) -> Table {
        self.table
    }

    pub(super) fn lane_weights(&self) -> &[Lane] {
        &self.weights
    }

    pub(super) fn lane_weights_mut(&mut self) -> &mut [Lane] {
        &mut self.weights
    }

    /// Step of the cell number from one cell of each sensor to the next, (I,).
    pub(super) fn strides(&self) -> [u64; MOST_INPUTS] {
        strides(&self.sensors)
    }

    /// Inputs (n, I) that are finite and of the right number: n.
    pub(super) fn check_inputs(&self, inputs: &[f64]) -> Result<usize, EstimateError> {
        let (width, found) = (self.input_count(), inputs.len());
        if !found.is_multiple_of(width) {
            let expected = found / width * width;
            return Err(EstimateError::Length { what: "the inputs", found, expected });
        }
        match inputs.iter().position(|value| !value.is_finite()) {
            Some(at) => Err(EstimateError::NotFinite { what: "an input", pose: at / width }),
            None => Ok(found / width),
        }
    }
}

fn strides(sensors: &[Sensor]) -> [u64; MOST_INPUTS] {
    let mut strides = [1; MOST_INPUTS];
    for k in (0..sensors.len() - 1).rev() {
        strides[k] = strides[k + 1] * sensors[k + 1].cells as u64;
    }
    strides
}

fn pattern(sensors: &[Sensor]) -> Vec<u64> {
    let strides = strides(sensors);
    let mut pattern = vec![0];
    for (sensor, stride) in sensors.iter().zip(strides) {
        let steps = 0..sensor.active as u64;
        pattern = pattern.iter().flat_map(|&start| steps.clone().map(move |k| start + k * stride)).collect();
    }
    pattern
}
