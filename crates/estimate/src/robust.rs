//! Weights of robust losses, by iterative reweighting.

/// The loss of a residual.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Robust {
    /// Least squares.
    None,
    /// Huber's loss (Huber 1964), 95 % efficient at the normal distribution.
    Huber,
    /// Cauchy's loss, 95 % efficient at the normal distribution.
    Cauchy,
}

/// Tuning constants for 95 % efficiency at the normal distribution (Holland and Welsch 1977, Table 1).
const HUBER: f64 = 1.345;
const CAUCHY: f64 = 2.385;

impl Robust {
    /// Weight of a residual that is `z` standard deviations large.
    pub fn weight(self, z: f64) -> f64 {
        match self {
            Robust::None => 1.0,
            Robust::Huber => (HUBER / z.max(HUBER)).min(1.0),
            Robust::Cauchy => 1.0 / (1.0 + (z / CAUCHY).powi(2)),
        }
    }
}

/// Standard deviation from the median of absolute values, for normal errors.
pub fn scale_from_median(absolute: &mut [f64]) -> f64 {
    /// Median of |x| for a standard normal x.
    const MEDIAN_OF_ABSOLUTE_NORMAL: f64 = 0.674_489_750_196_081_7;
    if absolute.is_empty() {
        return 0.0;
    }
    let middle = absolute.len() / 2;
    let (_, median, _) = absolute.select_nth_unstable_by(middle, f64::total_cmp);
    *median / MEDIAN_OF_ABSOLUTE_NORMAL
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn weights_fall_with_size() {
        for loss in [Robust::Huber, Robust::Cauchy] {
            assert!(loss.weight(0.0) > 0.999);
            assert!(loss.weight(3.0) < loss.weight(2.0));
            assert!(loss.weight(1e6) < 1e-5);
        }
        assert_eq!(Robust::None.weight(1e6), 1.0);
    }

    #[test]
    fn scale_ignores_gross_values() {
        let mut values: Vec<f64> = (0..1001).map(|i| f64::from(i) / 1000.0).collect();
        values.extend([1e9; 20]);
        let scale = scale_from_median(&mut values);
        assert!((scale - 0.51 / 0.6745).abs() < 0.01, "{scale}");
    }
}
