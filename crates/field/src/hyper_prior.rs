//! Prior of the logarithms of the hyper-parameters: normal about their starts.
//!
//! Amplitudes share a factor, since some arms bend more than others as a whole, and each has its own spread about it: their
//! covariance is `diag(spread^2) + SHARED^2 1 1^T` (docs/decisions/0041). Its inverse is that of a rank-one change (Sherman
//! and Morrison 1950).

use faer::Mat;

use crate::hyper::Hyper;

/// Standard deviation of the logarithm of the factor that amplitudes share.
pub const SHARED: f64 = 1.5;

/// The density at some hyper-parameters, and its derivatives by their logarithms.
pub struct HyperPrior {
    /// Inverse variance of each logarithm about what it shares with others; 0 for a flat prior.
    own: Vec<f64>,
    /// How far each is from its start.
    away: Vec<f64>,
    /// Positions of the amplitudes.
    amplitudes: Vec<usize>,
    /// What the shared factor leaves open of the amplitudes' precision, `own_i own_j` times it.
    open: f64,
}

impl HyperPrior {
    pub fn new(hyper: &Hyper) -> Self {
        let ranges = hyper.ranges();
        let own: Vec<f64> = ranges.iter().map(|range| range.spread.powi(-2)).collect();
        let away = ranges.iter().zip(hyper.to_logs()).map(|(range, log)| log - range.start.ln()).collect();
        let amplitudes = hyper.amplitude_positions();
        let all: f64 = amplitudes.iter().map(|&k| own[k]).sum();
        let open = SHARED.powi(2) / (1.0 + SHARED.powi(2) * all);
        Self { own, away, amplitudes, open }
    }

    /// Sum of the amplitudes' weighed deviations.
    fn together(&self) -> f64 {
        self.amplitudes.iter().map(|&k| self.own[k] * self.away[k]).sum()
    }

    /// Logarithm of the density, without its constant.
    pub fn value(&self) -> f64 {
        let apart: f64 = self.own.iter().zip(&self.away).map(|(own, away)| own * away * away).sum();
        -0.5 * (apart - self.open * self.together().powi(2))
    }

    /// Adds the gradient.
    pub fn add_gradient(&self, gradient: &mut [f64]) {
        let parts = self.own.iter().zip(&self.away).map(|(own, away)| own * away);
        gradient.iter_mut().zip(parts).for_each(|(sum, part)| *sum -= part);
        let common = self.open * self.together();
        self.amplitudes.iter().for_each(|&k| gradient[k] += self.own[k] * common);
    }

    /// Adds the precision.
    pub fn add_precision(&self, precision: &mut Mat<f64>) {
        self.own.iter().enumerate().for_each(|(k, own)| precision[(k, k)] += own);
        for &i in &self.amplitudes {
            self.amplitudes.iter().for_each(|&j| precision[(i, j)] -= self.open * self.own[i] * self.own[j]);
        }
    }

    /// Precision of one logarithm, the others given.
    pub fn precision_of(&self, k: usize) -> f64 {
        let shared = if self.amplitudes.contains(&k) { self.open * self.own[k].powi(2) } else { 0.0 };
        self.own[k] - shared
    }
}

#[cfg(test)]
mod tests {
    use truearm_estimate::dense::Cholesky;

    use super::*;

    /// The covariance of what has a prior, written out.
    fn covariance(hyper: &Hyper, known: &[usize]) -> Mat<f64> {
        let (ranges, amplitudes) = (hyper.ranges(), hyper.amplitude_positions());
        Mat::from_fn(known.len(), known.len(), |i, j| {
            let both = amplitudes.contains(&known[i]) && amplitudes.contains(&known[j]);
            let own = if i == j { ranges[known[i]].spread.powi(2) } else { 0.0 };
            own + if both { SHARED.powi(2) } else { 0.0 }
        })
    }

    #[test]
    fn it_is_that_of_the_covariance_written_out() {
        let start = Hyper::start(&[1, 2], 6, [1e-4, 3e-4]);
        let shift = |(k, log): (usize, f64)| log + 0.3 * ((k * k) as f64).sin() - 0.5;
        let hyper = start.with_logs(&start.to_logs().into_iter().enumerate().map(shift).collect::<Vec<_>>());
        let ranges = hyper.ranges();
        let known: Vec<usize> = (0..ranges.len()).filter(|&k| ranges[k].spread.is_finite()).collect();
        let logs = hyper.to_logs();
        let away: Vec<f64> = known.iter().map(|&k| logs[k] - ranges[k].start.ln()).collect();
        let factor = Cholesky::new(covariance(&hyper, &known), faer::Par::Seq).expect("a covariance");
        let pulled = factor.solve_vector(&away);
        let prior = HyperPrior::new(&hyper);
        let wanted = -0.5 * away.iter().zip(&pulled).map(|(a, b)| a * b).sum::<f64>();
        assert!((prior.value() - wanted).abs() < 1e-9, "{} instead of {wanted}", prior.value());
        let mut gradient = vec![0.0; ranges.len()];
        prior.add_gradient(&mut gradient);
        known.iter().zip(&pulled).for_each(|(&k, pull)| assert!((gradient[k] + pull).abs() < 1e-9));
        let mut precision = Mat::zeros(ranges.len(), ranges.len());
        prior.add_precision(&mut precision);
        for (i, &row) in known.iter().enumerate() {
            let unit: Vec<f64> = (0..known.len()).map(|j| f64::from(u8::from(i == j))).collect();
            let column = factor.solve_vector(&unit);
            known
                .iter()
                .zip(&column)
                .for_each(|(&k, entry)| assert!((precision[(k, row)] - entry).abs() < 1e-9));
            assert!((prior.precision_of(row) - column[i]).abs() < 1e-9);
        }
    }
}
