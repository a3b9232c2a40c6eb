use faer::Mat;
use truearm_estimate::dense::Orthogonal;

use super::{GAUSSIAN, inputs, made, network};
use crate::cmac::{Composition, FitOptions, LinearRows, Membership, Network, NetworkOptions, Scales};

const COLUMNS: [usize; 2] = [0, 1];
const SCALES: Scales = Scales { noise: 2e-5, roughness: 1e-4, level: 1e-3 };

struct Measured {
    inputs: Vec<f64>,
    jacobian: Vec<f64>,
    residual: Vec<f64>,
}

impl Measured {
    /// Poses whose three rows see an angle and a length that vary smoothly, with noise of a size.
    fn new(count: usize, noise: f64) -> Self {
        let inputs = inputs(count, 2);
        let (mut jacobian, mut residual) = (Vec::new(), Vec::new());
        for (pose, x) in inputs.chunks_exact(2).enumerate() {
            for row in 0..3 {
                let angle = (3 * pose + row) as f64;
                let line = [0.5 * angle.sin(), angle.cos()];
                let error = noise * (angle * 12.9898).sin();
                residual.push(line[0] * truth(x)[0] + line[1] * truth(x)[1] + error);
                jacobian.extend(line);
            }
        }
        Self { inputs, jacobian, residual }
    }

    fn rows(&self) -> LinearRows<'_> {
        LinearRows {
            inputs: &self.inputs,
            jacobian: &self.jacobian,
            residual: &self.residual,
            columns: &COLUMNS,
            targets: 1,
        }
    }
}

fn truth(x: &[f64]) -> [f64; 2] {
    [1e-3 * (0.8 * x[0]).sin() * x[1], 5e-4 * (x[0] - x[1]).cos()]
}

/// Weights (cells, 2) by least squares on the penalised equations written out.
fn dense(network: &Network, measured: &Measured, cells: [usize; 2]) -> Vec<f64> {
    let (active, grades) = network.active(&measured.inputs).unwrap();
    let (count, each) = (cells[0] * cells[1], network.active_count());
    let unit = [0.3, 1.0];
    let mut lines: Vec<(Vec<(usize, f64)>, f64)> = Vec::new();
    for (row, residual) in measured.residual.iter().enumerate() {
        let pose = row / 3;
        let sum: f64 = grades[pose * each..(pose + 1) * each].iter().sum();
        let entry = |k: usize, output: usize| {
            let grade = grades[pose * each + k] / sum;
            let jacobian = measured.jacobian[row * 2 + output] / unit[output];
            (active[pose * each + k] as usize * 2 + output, grade * jacobian / SCALES.noise)
        };
        let line = (0..each).flat_map(|k| [entry(k, 0), entry(k, 1)]).collect();
        lines.push((line, residual / SCALES.noise));
    }
    for output in 0..2 {
        for cell in 0..count {
            lines.push((vec![(cell * 2 + output, SCALES.level.recip())], 0.0));
            for (stride, along) in
                [(cells[1], cell / cells[1] + 2 < cells[0]), (1, cell % cells[1] + 2 < cells[1])]
            {
                if along {
                    let at = |step: usize| (cell + step * stride) * 2 + output;
                    let s = SCALES.roughness.recip();
                    lines.push((vec![(at(0), s), (at(1), -2.0 * s), (at(2), s)], 0.0));
                }
            }
        }
    }
    let mut matrix = Mat::<f64>::zeros(lines.len(), 2 * count);
    for (i, (line, _)) in lines.iter().enumerate() {
        line.iter().for_each(|&(j, value)| matrix[(i, j)] += value);
    }
    let right: Vec<f64> = lines.iter().map(|line| line.1).collect();
    let weights = Orthogonal::new(matrix).least_squares(&right);
    weights.iter().enumerate().map(|(k, weight)| weight / unit[k % 2]).collect()
}

#[test]
fn weights_are_those_of_the_penalised_equations_written_out() {
    let measured = Measured::new(40, 1e-5);
    for (active, membership) in [(3, GAUSSIAN), (4, Membership::BSpline)] {
        let network = network(&[8, 7], active, 2, membership);
        let options = FitOptions { scales: Some(SCALES), ..FitOptions::default() };
        let fit = network.fit(&measured.rows(), &options).unwrap();
        let expected = dense(&network, &measured, [8, 7]);
        for (found, expected) in fit.network.weights().iter().zip(&expected) {
            assert!((found - expected).abs() < 1e-10, "{found} {expected}");
        }
    }
}

fn error_at(network: &Network, count: usize) -> f64 {
    let s: Vec<f64> = inputs(count, 2).iter().map(|x| 0.95 * x + 0.01).collect();
    let mut out = vec![0.0; 2 * count];
    network.output(&s, &mut out).unwrap();
    let error = |(ceps, x): (&[f64], &[f64])| {
        let wanted = truth(x);
        (0.3 * (ceps[0] - wanted[0])).abs().max((ceps[1] - wanted[1]).abs())
    };
    out.chunks_exact(2).zip(s.chunks_exact(2)).map(error).fold(0.0, f64::max)
}

#[test]
fn scales_are_found_and_truth_comes_back() {
    let network = network(&[10, 10], 4, 2, Membership::BSpline);
    let exact = network.fit(&Measured::new(400, 0.0).rows(), &FitOptions::default()).unwrap();
    assert!(error_at(&exact.network, 100) < 5e-6, "{}", error_at(&exact.network, 100));
    let noisy = network.fit(&Measured::new(400, 2e-4).rows(), &FitOptions::default()).unwrap();
    // The noise is a sine of amplitude 0.2 mm.
    assert!((noisy.scales.noise / 1.41e-4 - 1.0).abs() < 0.2, "{:?}", noisy.scales);
    assert!(error_at(&noisy.network, 100) < 2e-4, "{}", error_at(&noisy.network, 100));
    let squares: f64 = noisy.residual.iter().map(|r| r * r).sum();
    assert!((squares / 1200.0).sqrt() < 1.6e-4);
}

#[test]
fn rows_without_a_measurement_change_nothing() {
    let network = network(&[8, 7], 3, 2, GAUSSIAN);
    let options = FitOptions { scales: Some(SCALES), ..FitOptions::default() };
    let mut measured = Measured::new(40, 1e-5);
    let before = network.fit(&measured.rows(), &options).unwrap().network;
    measured.inputs.extend([0.3, 0.4]);
    measured.jacobian.extend([0.0; 6]);
    measured.residual.extend([0.0; 3]);
    let after = network.fit(&measured.rows(), &options).unwrap().network;
    let pairs = before.weights().into_iter().zip(after.weights());
    assert!(pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max) < 1e-14);
}

#[test]
fn what_cannot_be_fitted_is_refused() {
    let measured = Measured::new(40, 0.0);
    let options = NetworkOptions { membership: GAUSSIAN, composition: Composition::Min, hashed: Some(64) };
    let hashed = made(&[8, 8], 3, 2, options).fit(&measured.rows(), &FitOptions::default());
    assert!(hashed.unwrap_err().to_string().contains("update rule"));
    let large = network(&[200, 200], 3, 2, GAUSSIAN).fit(&measured.rows(), &FitOptions::default());
    assert!(large.unwrap_err().to_string().contains("20000"));
    let scales = Some(Scales { noise: 0.0, ..SCALES });
    let options = FitOptions { scales, ..FitOptions::default() };
    let refused = network(&[8, 8], 3, 2, GAUSSIAN).fit(&measured.rows(), &options);
    assert!(refused.unwrap_err().to_string().contains("the noise is 0"));
    let short = LinearRows { residual: &measured.residual[..119], ..measured.rows() };
    assert!(network(&[8, 8], 3, 2, GAUSSIAN).fit(&short, &FitOptions::default()).is_err());
}
