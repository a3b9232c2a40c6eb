//! CEPs of regions shrunk towards those of the region that they are halves of.
//!
//! The CEPs of a half differ from those of the whole by a Gaussian of zero mean, alike for lengths and angles at 0.3 m;
//! its standard deviation is `halving` for the halves of the workspace and changes by the factor `finer` from one
//! halving to the next. Both, and the noise, are found by maximum marginal likelihood. Messages of means and
//! precisions run up the tree and down again, which is exact inference.

use faer::{Mat, Par};
use truearm_estimate::dense::{Cholesky, transposed_product};

use crate::compass::Compass;
use crate::regions::tree::Regions;

/// Normal equations of a region's own rows, in metres.
#[derive(Debug, Clone)]
pub struct Own {
    /// (P, P).
    pub normal: Mat<f64>,
    /// (P,).
    pub right: Vec<f64>,
    pub squares: f64,
    pub rows: usize,
}

/// Standard deviations, m.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Spread {
    pub noise: f64,
    pub halving: f64,
    pub finer: f64,
}

/// Natural logarithms of `halving` over the noise, and of `finer`.
const RATIOS: Compass = Compass { start: [1.0, 0.0], steps: (1.0, 0.1), ends: (-6.0, 10.0) };
/// Standard deviation of the whole workspace's CEPs over the noise: flat, the data alone decides.
const FLAT: f64 = 1e6;

impl Spread {
    fn of(&self, depth: usize) -> f64 {
        match depth {
            0 => FLAT * self.noise,
            _ => self.halving * self.finer.powi(depth as i32 - 1),
        }
    }
}

/// What a region and its halves know of its CEPs, in units of the noise.
struct Message {
    /// Factor of the precision and of the prior's.
    factor: Cholesky,
    information: Vec<f64>,
    /// Variance of the step from the whole to this half.
    variance: f64,
}

/// Messages from the leaves up, with the logarithm of the evidence (noise one) and the squares that are explained.
fn upwards(regions: &Regions, own: &[Own], spread: Spread) -> Option<(Vec<Message>, f64, f64)> {
    let width = own[0].right.len();
    let mut precision: Vec<Mat<f64>> = own.iter().map(|o| o.normal.clone()).collect();
    let mut information: Vec<Vec<f64>> = own.iter().map(|o| o.right.clone()).collect();
    let (mut messages, mut evidence, mut explained) = (Vec::new(), 0.0, 0.0);
    for region in (0..regions.count()).rev() {
        let variance = spread.of(regions.depth(region)).powi(2);
        let mut sum = precision[region].clone();
        (0..width).for_each(|k| sum[(k, k)] += variance.recip());
        let factor = Cholesky::new(sum, Par::Seq)?;
        let own_information = std::mem::take(&mut information[region]);
        let mean = factor.solve_vector(&own_information);
        evidence -= 0.5 * (factor.log_determinant() + width as f64 * variance.ln());
        explained += own_information.iter().zip(&mean).map(|(a, b)| a * b).sum::<f64>();
        if let Some(parent) = regions.parent(region) {
            let mut inner = precision[region].clone();
            factor.solve(inner.as_mut());
            let passed = &precision[region] - transposed_product(precision[region].as_ref(), inner.as_ref());
            for i in 0..width {
                information[parent][i] += mean[i] / variance;
                for j in 0..width {
                    precision[parent][(i, j)] += 0.5 * (passed[(i, j)] + passed[(j, i)]);
                }
            }
        }
        messages.push(Message { factor, information: own_information, variance });
    }
    messages.reverse();
    Some((messages, evidence, explained))
}

/// Squares and rows of all regions.
fn totals(own: &[Own]) -> (f64, usize) {
    own.iter().fold((0.0, 0), |sum, o| (sum.0 + o.squares, sum.1 + o.rows))
}

/// Evidence at its best noise, and that noise.
fn evidence(regions: &Regions, own: &[Own], [halving, finer]: [f64; 2]) -> Option<(f64, f64)> {
    let spread = Spread { noise: 1.0, halving: halving.exp(), finer: finer.exp() };
    let (_, evidence, explained) = upwards(regions, own, spread)?;
    let (squares, rows) = totals(own);
    let variance = ((squares - explained) / rows as f64).max(f64::MIN_POSITIVE);
    Some((evidence - 0.5 * rows as f64 * variance.ln(), variance.sqrt()))
}

/// Evidence of a noise, by the given deviation of every half over it, and that noise.
fn evidence_of_noise(regions: &Regions, own: &[Own], halving: f64, ratio: f64) -> Option<(f64, f64)> {
    let spread = Spread { noise: 1.0, halving: ratio.exp(), finer: 1.0 };
    let (_, evidence, explained) = upwards(regions, own, spread)?;
    let (noise, (squares, rows)) = (halving / ratio.exp(), totals(own));
    let of_rows = rows as f64 * noise.ln() + 0.5 * (squares - explained) / (noise * noise);
    Some((evidence - of_rows, noise))
}

/// The spread of maximum evidence: all of it, or the noise beside a given deviation of every half.
fn found(regions: &Regions, own: &[Own], halving: Option<f64>) -> Option<Spread> {
    let ([ratio, finer], _, noise) = RATIOS
        .search(|[ratio, finer]| {
            Ok::<_, ()>(match halving {
                Some(halving) if finer == 0.0 => evidence_of_noise(regions, own, halving, ratio),
                Some(_) => None,
                None => evidence(regions, own, [ratio, finer]),
            })
        })
        .ok()??;
    let halving = halving.unwrap_or(noise * ratio.exp());
    Some(Spread { noise, halving, finer: finer.exp() })
}

/// CEPs of all regions in metres, (N, P), and the spread: found from the rows, or with the given deviation of every half.
pub fn shrunk(regions: &Regions, own: &[Own], halving: Option<f64>) -> Option<(Vec<Vec<f64>>, Spread)> {
    let spread = found(regions, own, halving)?;
    let noise = spread.noise;
    let in_noise = Spread { noise: 1.0, halving: spread.halving / noise, ..spread };
    let (messages, _, _) = upwards(regions, own, in_noise)?;
    let mut ceps: Vec<Vec<f64>> = Vec::with_capacity(regions.count());
    for (region, message) in messages.iter().enumerate() {
        let mut right = message.information.clone();
        if let Some(parent) = regions.parent(region) {
            right.iter_mut().zip(&ceps[parent]).for_each(|(r, c)| *r += c / message.variance);
        }
        ceps.push(message.factor.solve_vector(&right));
    }
    Some((ceps, spread))
}

#[cfg(test)]
mod tests {
    use super::*;
    use truearm_estimate::dense::column;

    fn tree() -> Regions {
        let mut regions = Regions::new(&[0.0], &[1.0]).unwrap();
        regions.halve(0, 0);
        regions.halve(2, 0);
        regions
    }

    /// Normal equations of three rows in every leaf but the last.
    fn own(regions: &Regions) -> Vec<Own> {
        let of = |region: usize| {
            let rows = if regions.is_leaf(region) && region != 4 { 3 } else { 0 };
            let a = Mat::from_fn(rows, 2, |i, j| ((7 * region + 3 * i + j) as f64).sin());
            let r: Vec<f64> = (0..rows).map(|i| ((region + i) as f64).cos()).collect();
            let right = a.transpose() * column(&r);
            Own {
                normal: a.transpose() * &a,
                right: vec![right[(0, 0)], right[(1, 0)]],
                squares: r.iter().map(|x| x * x).sum(),
                rows,
            }
        };
        (0..regions.count()).map(of).collect()
    }

    /// Precision of all regions' CEPs side by side, written out.
    fn joint(regions: &Regions, own: &[Own], spread: Spread) -> (Mat<f64>, Vec<f64>) {
        let n = 2 * regions.count();
        let (mut precision, mut right) = (Mat::zeros(n, n), vec![0.0; n]);
        for region in 0..regions.count() {
            let weight = spread.of(regions.depth(region)).powi(-2);
            for k in 0..2 {
                let here = 2 * region + k;
                precision[(here, here)] += weight;
                right[here] += own[region].right[k];
                (0..2).for_each(|j| precision[(here, 2 * region + j)] += own[region].normal[(k, j)]);
                if let Some(parent) = regions.parent(region) {
                    let there = 2 * parent + k;
                    precision[(there, there)] += weight;
                    precision[(here, there)] -= weight;
                    precision[(there, here)] -= weight;
                }
            }
        }
        (precision, right)
    }

    #[test]
    fn messages_give_the_posterior_written_out() {
        let regions = tree();
        let own = own(&regions);
        let (ceps, spread) = shrunk(&regions, &own, Some(0.3)).unwrap();
        let spread = Spread { noise: 1.0, halving: spread.halving / spread.noise, finer: 1.0 };
        let (precision, right) = joint(&regions, &own, spread);
        let expected = Cholesky::new(precision, Par::Seq).unwrap().solve_vector(&right);
        for (found, expected) in ceps.iter().flatten().zip(&expected) {
            assert!((found - expected).abs() < 1e-6, "{found} {expected}");
        }
        // A region without rows is like the one that it is half of.
        assert!((ceps[4][0] - ceps[2][0]).abs() < 1e-12);
    }

    #[test]
    fn the_noise_beside_a_given_halving_is_of_maximum_evidence() {
        let regions = tree();
        let own = own(&regions);
        let halving = 0.05;
        let (_, spread) = shrunk(&regions, &own, Some(halving)).unwrap();
        assert_eq!((spread.halving, spread.finer), (halving, 1.0));
        let evidence = |noise: f64| {
            let (precision, right) =
                joint(&regions, &own, Spread { noise: 1.0, halving: halving / noise, finer: 1.0 });
            let factor = Cholesky::new(precision, Par::Seq).unwrap();
            let explained: f64 = factor.solve_vector(&right).iter().zip(&right).map(|(a, b)| a * b).sum();
            let halves = 2.0 * (regions.count() - 1) as f64;
            let (squares, rows) = totals(&own);
            -0.5 * factor.log_determinant()
                - halves * (halving / noise).ln()
                - rows as f64 * noise.ln()
                - 0.5 * (squares - explained) / (noise * noise)
        };
        for factor in [0.8, 1.25] {
            assert!(evidence(spread.noise) > evidence(factor * spread.noise), "{spread:?} {factor}");
        }
    }

    #[test]
    fn evidence_differs_as_that_written_out_does() {
        let regions = tree();
        let own = own(&regions);
        let direct = |halving: f64| {
            let spread = Spread { noise: 1.0, halving, finer: 1.0 };
            let (precision, right) = joint(&regions, &own, spread);
            let factor = Cholesky::new(precision, Par::Seq).unwrap();
            let explained: f64 = factor.solve_vector(&right).iter().zip(&right).map(|(a, b)| a * b).sum();
            let prior: f64 =
                (0..regions.count()).map(|r| 2.0 * spread.of(regions.depth(r)).powi(-2).ln()).sum();
            0.5 * (prior - factor.log_determinant() + explained)
        };
        let messages = |halving: f64| {
            let spread = Spread { noise: 1.0, halving, finer: 1.0 };
            let (_, evidence, explained) = upwards(&regions, &own, spread).unwrap();
            evidence + 0.5 * explained
        };
        let difference = (messages(0.2) - messages(2.0)) - (direct(0.2) - direct(2.0));
        assert!(difference.abs() < 1e-6, "{difference}");
    }
}
