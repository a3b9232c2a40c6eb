//! The tree of regions: boxes, each either a leaf or halved along one axis.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use truearm_estimate::EstimateError;

/// What a look-up needs of a region: 16 bytes.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Step {
    threshold: f64,
    axis: u32,
    /// The lower half; the upper half follows it. Zero for a leaf: the whole workspace is nobody's half.
    child: u32,
}

/// A binary tree of boxes in F features. Region 0 is the whole workspace; the halves of a region stand side by side.
#[derive(Debug, Clone, PartialEq)]
pub struct Regions {
    dimensions: usize,
    /// Lower corners, (N, F).
    low: Vec<f64>,
    /// Upper corners, (N, F).
    high: Vec<f64>,
    parent: Vec<u32>,
    steps: Vec<Step>,
}

/// The tree as arrays, to be saved.
#[derive(Debug, Clone, PartialEq)]
pub struct Parts {
    /// Lower corner of the workspace, (F,).
    pub low: Vec<f64>,
    /// Upper corner, (F,).
    pub high: Vec<f64>,
    /// Axis along which each region is halved, (N,); -1 for a leaf.
    pub axis: Vec<i64>,
    /// Number of each region's lower half, (N,); -1 for a leaf.
    pub child: Vec<i64>,
}

impl Regions {
    /// One region: the whole workspace between two corners (F,).
    ///
    /// # Errors
    /// [`EstimateError::Option`], [`EstimateError::Length`] where the corners span no box.
    pub fn new(low: &[f64], high: &[f64]) -> Result<Regions, EstimateError> {
        if low.len() != high.len() {
            let what = "the upper corner of the workspace";
            return Err(EstimateError::Length { what, found: high.len(), expected: low.len() });
        }
        if low.is_empty() {
            let (what, rule) = ("the number of features", "divide along one feature or more");
            return Err(EstimateError::Option { what, value: 0.0, rule });
        }
        for (&from, &to) in low.iter().zip(high) {
            if !(from.is_finite() && to.is_finite() && from < to) {
                let what = "an upper end of the workspace";
                let rule = "it must be finite and above the lower end";
                return Err(EstimateError::Option { what, value: to, rule });
            }
        }
        let steps = vec![Step { threshold: 0.0, axis: 0, child: 0 }];
        Ok(Regions { dimensions: low.len(), low: low.to_vec(), high: high.to_vec(), parent: vec![0], steps })
    }

    /// Features, F.
    pub fn dimensions(&self) -> usize {
        self.dimensions
    }

    /// Regions of all sizes, N.
    pub fn count(&self) -> usize {
        self.steps.len()
    }

    /// The regions that are not halved, ascending.
    pub fn leaves(&self) -> Vec<usize> {
        (0..self.count()).filter(|&region| self.is_leaf(region)).collect()
    }

    /// Whether a region is not halved.
    pub fn is_leaf(&self, region: usize) -> bool {
        self.steps[region].child == 0
    }

    /// The region that a region is a half of; none for the whole workspace.
    pub fn parent(&self, region: usize) -> Option<usize> {
        (region > 0).then(|| self.parent[region] as usize)
    }

    /// Axis and lower half of a region that is halved.
    pub fn halves(&self, region: usize) -> Option<(usize, usize)> {
        let step = self.steps[region];
        (step.child > 0).then_some((step.axis as usize, step.child as usize))
    }

    /// How many times the workspace was halved to get a region.
    pub fn depth(&self, region: usize) -> usize {
        std::iter::successors(self.parent(region), |&region| self.parent(region)).count()
    }

    /// Corners of a region, (F,) each.
    pub fn corners(&self, region: usize) -> (&[f64], &[f64]) {
        let range = region * self.dimensions..(region + 1) * self.dimensions;
        (&self.low[range.clone()], &self.high[range])
    }

    /// Halve a leaf along an axis; gives its lower half, which the upper one follows.
    pub fn halve(&mut self, leaf: usize, axis: usize) -> usize {
        let child = self.count();
        let (low, high) = self.corners(leaf);
        let (low, high) = (low.to_vec(), high.to_vec());
        let middle = 0.5 * (low[axis] + high[axis]);
        for upper in [false, true] {
            let (mut from, mut to) = (low.clone(), high.clone());
            if upper {
                from[axis] = middle;
            } else {
                to[axis] = middle;
            }
            self.low.extend(from);
            self.high.extend(to);
            self.parent.push(leaf as u32);
            self.steps.push(Step { threshold: 0.0, axis: 0, child: 0 });
        }
        self.steps[leaf] = Step { threshold: middle, axis: axis as u32, child: child as u32 };
        child
    }

    /// Axes by the length of a region's sides as shares of the workspace's, the longest first.
    pub fn longest_first(&self, region: usize) -> Vec<usize> {
        let (low, high) = self.corners(region);
        let share = |axis: usize| (high[axis] - low[axis]) / (self.high[axis] - self.low[axis]);
        let mut axes: Vec<usize> = (0..self.dimensions).collect();
        axes.sort_by(|&a, &b| share(b).total_cmp(&share(a)).then(a.cmp(&b)));
        axes
    }

    /// Halved to so many leaves, the largest first along their longest side.
    pub fn evenly(mut self, leaves: usize) -> Regions {
        let mut waiting: BinaryHeap<Reverse<(usize, usize)>> =
            self.leaves().into_iter().map(|leaf| Reverse((self.depth(leaf), leaf))).collect();
        while waiting.len() < leaves {
            let Some(Reverse((depth, largest))) = waiting.pop() else { break };
            let axis = self.longest_first(largest)[0];
            let lower = self.halve(largest, axis);
            waiting.extend([lower, lower + 1].map(|half| Reverse((depth + 1, half))));
        }
        self
    }

    /// The leaf of a point (F,); a point outside counts as the nearest one of the workspace.
    #[inline]
    pub fn find(&self, point: &[f64]) -> usize {
        let mut region = 0;
        loop {
            let step = self.steps[region];
            if step.child == 0 {
                return region;
            }
            region = step.child as usize + usize::from(point[step.axis as usize] >= step.threshold);
        }
    }

    /// The leaves of points (n, F).
    ///
    /// # Errors
    /// [`EstimateError::Length`], [`EstimateError::NotFinite`].
    pub fn find_all(&self, points: &[f64]) -> Result<Vec<usize>, EstimateError> {
        let (width, found) = (self.dimensions, points.len());
        if !found.is_multiple_of(width) {
            return Err(EstimateError::Length {
                what: "the features",
                found,
                expected: found / width * width,
            });
        }
        if let Some(at) = points.iter().position(|value| !value.is_finite()) {
            return Err(EstimateError::NotFinite { what: "a feature", pose: at / width });
        }
        Ok(points.chunks_exact(width).map(|point| self.find(point)).collect())
    }

    /// Leaves that share a face with a leaf, ascending.
    pub fn neighbours(&self, leaf: usize) -> Vec<usize> {
        let (low, high) = self.corners(leaf);
        let shares_face = |&other: &usize| {
            let (from, to) = self.corners(other);
            let touching = (0..self.dimensions).filter(|&k| from[k] == high[k] || to[k] == low[k]).count();
            let overlapping = (0..self.dimensions).filter(|&k| from[k] < high[k] && low[k] < to[k]).count();
            touching == 1 && overlapping == self.dimensions - 1
        };
        self.leaves().into_iter().filter(shares_face).collect()
    }

    /// The tree as arrays.
    pub fn parts(&self) -> Parts {
        let halves = |of: fn((usize, usize)) -> usize| -> Vec<i64> {
            (0..self.count()).map(|region| self.halves(region).map_or(-1, |found| of(found) as i64)).collect()
        };
        let (low, high) = self.corners(0);
        Parts { low: low.to_vec(), high: high.to_vec(), axis: halves(|h| h.0), child: halves(|h| h.1) }
    }

    /// A tree from its arrays.
    ///
    /// # Errors
    /// [`EstimateError::Length`], [`EstimateError::Option`] where the arrays are no tree.
    pub fn from_parts(parts: &Parts) -> Result<Regions, EstimateError> {
        let mut regions = Regions::new(&parts.low, &parts.high)?;
        let (found, expected) = (parts.axis.len(), parts.child.len());
        if found != expected {
            return Err(EstimateError::Length { what: "the axes", found, expected });
        }
        let mut halved: Vec<(i64, usize)> =
            (0..expected).filter(|&k| parts.child[k] >= 0).map(|k| (parts.child[k], k)).collect();
        halved.sort_unstable();
        for (child, region) in halved {
            let fits = child as usize == regions.count()
                && region < regions.count()
                && (0..regions.dimensions as i64).contains(&parts.axis[region]);
            if !fits {
                let (what, rule) =
                    ("the number of a region's half", "halves follow their whole, pair by pair");
                return Err(EstimateError::Option { what, value: child as f64, rule });
            }
            regions.halve(region, parts.axis[region] as usize);
        }
        if regions.count() != expected {
            let (what, rule) = ("the number of regions", "each but the first must be half of another");
            return Err(EstimateError::Option { what, value: expected as f64, rule });
        }
        Ok(regions)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn divided(halvings: &[(usize, usize)]) -> Regions {
        let mut regions = Regions::new(&[0.0, -1.0], &[2.0, 3.0]).unwrap();
        for &(which, axis) in halvings {
            let leaves = regions.leaves();
            regions.halve(leaves[which % leaves.len()], axis);
        }
        regions
    }

    fn halvings() -> impl Strategy<Value = Vec<(usize, usize)>> {
        proptest::collection::vec((0usize..100, 0usize..2), 0..20)
    }

    fn volume(regions: &Regions, region: usize) -> f64 {
        let (low, high) = regions.corners(region);
        low.iter().zip(high).map(|(a, b)| b - a).product()
    }

    proptest! {
        #[test]
        fn look_up_finds_the_box_that_holds_the_point(how in halvings(), x in 0.0..2.0f64, y in -1.0..3.0f64) {
            let regions = divided(&how);
            let (low, high) = regions.corners(regions.find(&[x, y]));
            prop_assert!(low[0] <= x && x < high[0] && low[1] <= y && y < high[1]);
            prop_assert!(regions.is_leaf(regions.find(&[x, y])));
        }

        #[test]
        fn leaves_fill_the_workspace(how in halvings()) {
            let regions = divided(&how);
            prop_assert_eq!(regions.leaves().len(), how.len() + 1);
            let sum: f64 = regions.leaves().iter().map(|&leaf| volume(&regions, leaf)).sum();
            prop_assert!((sum - 8.0).abs() < 1e-12);
        }

        #[test]
        fn arrays_hold_all_of_the_tree(how in halvings()) {
            let regions = divided(&how);
            prop_assert_eq!(Regions::from_parts(&regions.parts()).unwrap(), regions);
        }

        #[test]
        fn neighbours_are_mutual_and_touch(how in halvings()) {
            let regions = divided(&how);
            for leaf in regions.leaves() {
                for other in regions.neighbours(leaf) {
                    prop_assert!(regions.neighbours(other).contains(&leaf) && other != leaf);
                }
                prop_assert!(!regions.neighbours(leaf).is_empty() || how.is_empty());
            }
        }
    }

    #[test]
    fn an_even_division_differs_by_one_halving_at_most() {
        let regions = Regions::new(&[0.0; 3], &[1.0, 2.0, 3.0]).unwrap().evenly(110);
        let depths: Vec<usize> = regions.leaves().iter().map(|&leaf| regions.depth(leaf)).collect();
        assert_eq!((depths.len(), regions.count()), (110, 219));
        assert!(depths.iter().all(|&depth| depth == 6 || depth == 7));
    }

    #[test]
    fn arrays_that_are_no_tree_are_refused() {
        let parts = divided(&[(0, 0), (1, 1)]).parts();
        for child in [vec![1, 1, -1, -1, -1], vec![2, -1, -1], vec![-1; 5], vec![1, -1, 9, -1, -1]] {
            let axis = vec![0; child.len()];
            assert!(Regions::from_parts(&Parts { child, axis, ..parts.clone() }).is_err());
        }
        assert!(Regions::from_parts(&Parts { axis: vec![7; 5], ..parts }).is_err());
        assert!(Regions::new(&[0.0], &[0.0]).is_err());
        assert!(Regions::new(&[], &[]).is_err());
    }
}
