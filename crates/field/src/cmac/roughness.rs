//! The roughness penalty of a grid of cells, and networks as linear functions of its modes.
//!
//! Rough is what has second differences along an input, cell by cell. The penalty is a sum over the inputs, so its
//! eigenvectors are products of eigenvectors along each input, and nothing larger than one input's matrix is factored.

use faer::Mat;
use truearm_estimate::EstimateError;
use truearm_estimate::dense::{Eigen, transposed_product};

use crate::cmac::network::Network;

/// Eigenvectors and eigenvalues of the penalty.
pub struct Modes {
    /// Along each input (cells, cells), a column an eigenvector.
    vectors: Vec<Mat<f64>>,
    /// Eigenvalues of all products, the last input's running fastest, (cells of the grid,).
    pub roughness: Vec<f64>,
}

impl Modes {
    /// Modes of a network's grid.
    ///
    /// # Errors
    /// [`EstimateError::Singular`] where an eigenvalue cannot be found.
    pub fn new(network: &Network) -> Result<Modes, EstimateError> {
        let (mut vectors, mut roughness) = (Vec::new(), vec![0.0]);
        for sensor in network.sensors() {
            let (values, along) = second_differences(sensor.cells)
                .ok_or(EstimateError::Singular { unknowns: sensor.cells, rows: sensor.cells })?;
            roughness =
                roughness.iter().flat_map(|sum| values.iter().map(move |value| sum + value)).collect();
            vectors.push(along);
        }
        Ok(Modes { vectors, roughness })
    }

    /// How much each mode excites the output at each input: (n, modes) from active cells and grades (n, A).
    pub fn excitations(&self, network: &Network, cells: &[u64], grades: &[f64]) -> Mat<f64> {
        let active = network.active_count();
        let count = cells.len() / active;
        let mut out = Mat::zeros(count, self.roughness.len());
        for row in 0..count {
            let (cells, grades) = (&cells[row * active..], &grades[row * active..(row + 1) * active]);
            let sum: f64 = grades.iter().sum();
            let mut values: Vec<f64> = grades.iter().map(|grade| grade / sum).collect();
            let (mut outer, mut inner) = (active, 1);
            for (index, along) in self.vectors.iter().enumerate().rev() {
                let (cells_along, window) = (along.nrows(), network.sensors()[index].active);
                let first = (cells[0] / network.strides()[index]) as usize % cells_along;
                outer /= window;
                let part = along.as_ref().subrows(first, window);
                values =
                    contract(&values, (outer, window, inner), |cell, mode| part[(cell, mode)], cells_along);
                inner *= cells_along;
            }
            values.iter().enumerate().for_each(|(mode, value)| out[(row, mode)] = *value);
        }
        out
    }

    /// Weights of all cells (cells, P) from those of the modes (modes, P).
    pub fn weights(&self, modes: &[f64], outputs: usize) -> Vec<f64> {
        let mut values = modes.to_vec();
        let (mut outer, mut inner) = (self.roughness.len(), outputs);
        for along in self.vectors.iter().rev() {
            let cells = along.nrows();
            outer /= cells;
            values = contract(&values, (outer, cells, inner), |mode, cell| along[(cell, mode)], cells);
            inner *= cells;
        }
        values
    }
}

/// out(o, j, i) = sum over k of values(o, k, i) matrix(k, j), for j below `count`.
fn contract(
    values: &[f64],
    (outer, width, inner): (usize, usize, usize),
    matrix: impl Fn(usize, usize) -> f64,
    count: usize,
) -> Vec<f64> {
    let mut out = vec![0.0; outer * count * inner];
    for o in 0..outer {
        for j in 0..count {
            let target = &mut out[(o * count + j) * inner..][..inner];
            for k in 0..width {
                let factor = matrix(k, j);
                let source = &values[(o * width + k) * inner..][..inner];
                target.iter_mut().zip(source).for_each(|(to, from)| *to += factor * from);
            }
        }
    }
    out
}

/// Eigenvalues, ascending, and eigenvectors of D^T D with D the second differences of so many cells.
fn second_differences(cells: usize) -> Option<(Vec<f64>, Mat<f64>)> {
    let difference = |row: usize, cell: usize| match cell.checked_sub(row) {
        Some(0 | 2) => 1.0,
        Some(1) => -2.0,
        _ => 0.0,
    };
    let d = Mat::from_fn(cells.saturating_sub(2), cells, difference);
    let Eigen { values, vectors } = Eigen::new(&transposed_product(d.as_ref(), d.as_ref()))?;
    Some((values.into_iter().map(|value| value.max(0.0)).collect(), vectors))
}
