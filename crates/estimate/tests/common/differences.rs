//! Derivatives by moving the unknowns, and the analytic ones laid out in the same way.

use truearm_estimate::{Layout, Linearised, Point, Problem, residuals};

/// d prediction / d unknown, (rows, u), by central differences of the residuals.
pub fn differences(problem: &Problem, point: Point) -> Vec<f64> {
    const STEP: f64 = 1e-5;
    let layout = Layout::new(problem);
    let moved = |unknown: usize, by: f64| {
        let mut step = vec![0.0; layout.len()];
        step[unknown] = by;
        let setup = layout.step_setup(point.setup, &step);
        let mut parameters = point.parameters.to_vec();
        for (index, &column) in problem.columns.iter().enumerate() {
            let sets = parameters.iter_mut().skip(column).step_by(problem.chain.parameter_count());
            sets.for_each(|value| *value += step[index]);
        }
        residuals(problem, Point { parameters: &parameters, setup: &setup }).unwrap()
    };
    let columns: Vec<Vec<f64>> = (0..layout.len())
        .map(|unknown| {
            let (ahead, behind) = (moved(unknown, STEP), moved(unknown, -STEP));
            ahead.iter().zip(&behind).map(|(a, b)| (b - a) / (2.0 * STEP)).collect()
        })
        .collect();
    (0..columns[0].len()).flat_map(|row| columns.iter().map(move |column| column[row])).collect()
}

/// The analytic derivatives of all rows, (rows, u), with each group's columns in their place.
pub fn dense(problem: &Problem, rows: &Linearised) -> Vec<f64> {
    let layout = Layout::new(problem);
    let (arm, width, all) = (layout.arm, layout.group_width(), layout.len());
    let count = problem.measurements.pose_count() * rows.rows;
    let mut out = vec![0.0; count * all];
    for (row, line) in out.chunks_exact_mut(all).enumerate() {
        let own = layout.group(problem.measurements.group[row / rows.rows]);
        line[..arm].copy_from_slice(&rows.arm[row * arm..(row + 1) * arm]);
        line[own].copy_from_slice(&rows.setup[row * width..(row + 1) * width]);
    }
    out
}
