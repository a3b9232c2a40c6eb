//! Weights of rows from noise, and noise from residuals.

use crate::measurements::Noise;
use crate::robust::scale_from_median;

/// Over the largest square a variance under which the median of what is left is below that of a standard normal.
const ABOVE_ALL: f64 = 3.0;

/// Weight (inverse variance) of a row: its own sigma on top of the noise, thinned by the outlier weight.
#[inline(always)]
pub fn row_weight(noise: f64, sigma: f64, weight: f64) -> f64 {
    weight / (noise * noise + sigma * sigma)
}

/// Squared residuals of one kind of rows with their own variances and weights.
#[derive(Debug, Clone, Default)]
pub struct Squares {
    /// Squared residual, own variance, outlier weight of every row.
    rows: Vec<(f64, f64, f64)>,
    has_own: bool,
}

impl Squares {
    /// Adds a row.
    pub fn push(&mut self, square: f64, own_variance: f64, weight: f64) {
        self.has_own |= own_variance > 0.0;
        self.rows.push((square, own_variance, weight));
    }

    /// How many rows there are.
    pub fn rows(&self) -> f64 {
        self.rows.len() as f64
    }

    /// The noise on top of the rows' own variances under which the median of the sizes is what it would be without
    /// outliers, times `widened` for what the unknowns took of them; 0 when the rows' own sigmas explain more.
    pub fn robust_noise(&self, widened: f64) -> f64 {
        let scale = |variance: f64| {
            let sizes = self.rows.iter().map(|(square, own, _)| (square / (own + variance)).sqrt());
            widened * scale_from_median(&mut sizes.collect::<Vec<f64>>())
        };
        if !self.has_own {
            return scale(1.0);
        }
        let largest = self.rows.iter().map(|row| row.0).fold(0.0, f64::max) * widened * widened;
        let smallest = largest * 1e-12;
        if largest == 0.0 || scale(smallest) <= 1.0 {
            return 0.0;
        }
        bisect(|variance| scale(variance) - 1.0, smallest, ABOVE_ALL * largest).sqrt()
    }

    /// The noise for which the weighted squares add up to the degrees of freedom, or 0 when the rows' own
    /// sigmas explain more than the residuals.
    ///
    /// `unknowns` is the number of effective unknowns that these rows determine.
    pub fn noise(&self, unknowns: f64) -> f64 {
        let freedom = (self.rows.iter().map(|row| row.2).sum::<f64>() - unknowns).max(1.0);
        let largest = self.rows.iter().map(|row| row.2 * row.0).sum::<f64>() / freedom;
        if !self.has_own || largest == 0.0 {
            return largest.sqrt();
        }
        let excess = |variance: f64| {
            let rows = self.rows.iter();
            rows.map(|(square, own, weight)| weight * square / (own + variance)).sum::<f64>() - freedom
        };
        let smallest = largest * 1e-12;
        if excess(smallest) <= 0.0 {
            return 0.0;
        }
        bisect(excess, smallest, largest).sqrt()
    }
}

/// Root of a falling function between two positive values, by bisection of the logarithm.
fn bisect(falling: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    const RELATIVE_TOLERANCE: f64 = 1e-9;
    while high / low > 1.0 + RELATIVE_TOLERANCE {
        let middle = (low * high).sqrt();
        if falling(middle) > 0.0 { low = middle } else { high = middle }
    }
    (low * high).sqrt()
}

impl Noise {
    /// A first guess before any residual is known.
    pub const GUESS: Noise = Noise { position: 1e-4, orientation: 3e-4 };
}

#[cfg(test)]
mod tests {
    use super::*;

    fn alike(own_variance: f64) -> Squares {
        let mut squares = Squares::default();
        (0..12).for_each(|_| squares.push(4.0, own_variance, 1.0));
        squares
    }

    #[test]
    fn noise_of_equal_rows_is_their_root_mean_square() {
        let squares = alike(0.0);
        assert!((squares.noise(0.0) - 2.0).abs() < 1e-8);
        assert!((squares.noise(3.0) - (48.0f64 / 9.0).sqrt()).abs() < 1e-8);
    }

    #[test]
    fn own_sigma_is_taken_off() {
        let squares = alike(3.0);
        assert!((squares.noise(0.0) - 1.0).abs() < 1e-8);
        let explained = alike(5.0);
        assert_eq!(explained.noise(0.0), 0.0);
    }

    #[test]
    fn robust_noise_is_on_top_of_own_sigma_too() {
        let scale = 1.0 / 0.674_489_750_196_081_7;
        assert!((alike(0.0).robust_noise(1.0) - 2.0 * scale).abs() < 1e-12);
        let on_top = ((2.0 * scale).powi(2) - 3.0).sqrt();
        assert!((alike(3.0).robust_noise(1.0) - on_top).abs() < 1e-8);
        assert_eq!(alike(9.0).robust_noise(1.0), 0.0);
    }
}
