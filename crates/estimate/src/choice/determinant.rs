//! Exchange for the largest determinant: the best candidate comes in, the pose that is missed least goes out, until
//! it is the same one (Mitchell 1974, with single exchanges).

use faer::{Mat, Par};

use crate::choice::pool::Pool;
use crate::dense::Cholesky;
use truearm_kinematics::Cancel;

use crate::EstimateError;

/// Share of the mean diagonal entry that is added to M^t M so that a few poses have an inverse at all.
const RIDGE: f64 = 1e-7;
/// A better determinant is better by more than this share: less is rounding.
const BETTER: f64 = 1e-9;
/// Changes of rank M after which the inverse is made anew, before rounding adds up.
const RENEWAL: usize = 200;

/// The inverse of the present M^t M, kept up by changes of low rank.
pub struct Present<'a, const M: usize> {
    pool: &'a mut Pool<M>,
    /// M^t M of what was measured already, with the ridge.
    given: Mat<f64>,
    inverse: Mat<f64>,
    /// The chosen candidates.
    pub chosen: Vec<usize>,
    is_chosen: Vec<bool>,
    changes: usize,
}

impl<'a, const M: usize> Present<'a, M> {
    /// Begins with chosen candidates and M^t M (P, P) of what was measured already.
    ///
    /// # Errors
    /// [`EstimateError::Untelling`] where the candidates' Jacobians are zero.
    pub fn new(pool: &'a mut Pool<M>, given: &Mat<f64>, chosen: &[usize]) -> Result<Self, EstimateError> {
        let width = pool.width;
        let size =
            pool.score(&unit_directions(width)).iter().sum::<f64>() / (pool.count.max(1) * width) as f64;
        let mut given = given.clone();
        (0..width).for_each(|k| given[(k, k)] += RIDGE * size);
        let mut is_chosen = vec![false; pool.count];
        chosen.iter().for_each(|&pose| is_chosen[pose] = true);
        let inverse = Mat::zeros(width, width);
        let mut present = Self { pool, given, inverse, chosen: chosen.to_vec(), is_chosen, changes: 0 };
        present.renew()?;
        Ok(present)
    }

    fn renew(&mut self) -> Result<(), EstimateError> {
        let mut normal = self.given.clone();
        for &pose in &self.chosen {
            let jacobian = self.pool.jacobian(pose);
            normal += jacobian.transpose() * &jacobian;
        }
        self.inverse = Cholesky::new(normal, Par::Seq).ok_or(EstimateError::Untelling)?.inverse();
        self.pool.renew(&self.inverse);
        self.changes = 0;
        Ok(())
    }

    /// Adds the candidate that raises the determinant most; gives its place among the chosen.
    fn add(&mut self) -> Result<(usize, f64), EstimateError> {
        let gains = self.pool.gains.iter().take(self.pool.count).enumerate();
        let better = |best: (usize, f64), (pose, &gain): (usize, &f64)| {
            if gain > best.1 && !self.is_chosen[pose] { (pose, gain) } else { best }
        };
        let (pose, gain) = gains.fold((usize::MAX, 0.0), better);
        if pose == usize::MAX {
            return Err(EstimateError::Untelling);
        }
        self.change(pose, 1.0)?;
        self.is_chosen[pose] = true;
        self.chosen.push(pose);
        Ok((self.chosen.len() - 1, gain))
    }

    fn change(&mut self, pose: usize, sign: f64) -> Result<(), EstimateError> {
        self.changes += 1;
        self.pool.exchange(&mut self.inverse, pose, sign).ok_or(EstimateError::Untelling)
    }

    /// Adds candidates until there are `count`.
    ///
    /// # Errors
    /// [`EstimateError::Untelling`], [`EstimateError::Cancelled`].
    pub fn fill(&mut self, count: usize, cancel: &Cancel) -> Result<(), EstimateError> {
        while self.chosen.len() < count {
            cancel.check()?;
            if self.changes > RENEWAL {
                self.renew()?;
            }
            self.add()?;
        }
        Ok(())
    }

    /// Exchanges until nothing better is found, or `most` times; gives how many exchanges were made.
    ///
    /// # Errors
    /// [`EstimateError::Untelling`], [`EstimateError::Cancelled`].
    pub fn settle(&mut self, most: usize, cancel: &Cancel) -> Result<usize, EstimateError> {
        for made in 0..most {
            cancel.check()?;
            if self.chosen.len() == self.pool.count {
                return Ok(made);
            }
            if self.changes > RENEWAL {
                self.renew()?;
            }
            let (place, gain) = self.add()?;
            let losses = self.chosen.iter().map(|&pose| self.pool.loss(pose)).enumerate();
            let (out, loss) =
                losses.fold((place, 0.0), |best, (at, loss)| if loss > best.1 { (at, loss) } else { best });
            let worth = out != place && gain * loss > 1.0 + BETTER;
            let leaves = if worth { out } else { place };
            let pose = self.chosen[leaves];
            self.change(pose, -1.0)?;
            self.is_chosen[pose] = false;
            self.chosen.swap_remove(leaves);
            if !worth {
                return Ok(made);
            }
        }
        Ok(most)
    }
}

fn unit_directions(width: usize) -> Vec<(f64, Vec<f64>)> {
    let direction = |k: usize| (0..width).map(|i| f64::from(u8::from(i == k))).collect();
    (0..width).map(|k| (1.0, direction(k))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::common::stream::Stream;

    #[test]
    fn changes_of_low_rank_add_up_to_the_inverse_made_anew() {
        let mut stream = Stream::new(4);
        let jacobian: Vec<f64> = (0..50 * 18).map(|_| stream.normal()).collect();
        let mut pool = Pool::<3>::new(&jacobian, 3, 6);
        let mut present = Present::new(&mut pool, &Mat::zeros(6, 6), &[1, 7, 9]).unwrap();
        present.fill(12, &Cancel::default()).unwrap();
        present.settle(60, &Cancel::default()).unwrap();
        let (kept, gains) = (present.inverse.clone(), present.pool.gains.clone());
        present.renew().unwrap();
        let error = (&kept - &present.inverse).norm_max() / present.inverse.norm_max();
        assert!(error < 1e-9, "{error:e}");
        for (before, after) in gains.iter().zip(&present.pool.gains) {
            assert!((before / after - 1.0).abs() < 1e-8);
        }
        let leaves = present.pool.loss(present.chosen[0]);
        assert!(leaves > 0.0 && leaves < 1.0);
    }
}
