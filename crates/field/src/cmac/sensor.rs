//! One input's sensor: cells at equal distances, and how strongly a value excites the nearest of them.

use truearm_bank::{cubic, linear, quadratic};
use truearm_estimate::EstimateError;
use truearm_kinematics::{Isa, LANES, Lane, exp};

/// Cells of a sensor that may be active at once.
pub const MOST_ACTIVE: usize = 8;
/// Cells that B-spline memberships may have active: linear to cubic.
const SPLINES: std::ops::RangeInclusive<usize> = 2..=4;

/// Narrowest Gaussian membership, in cells: between two of narrower ones squares of grades are too small for a number.
const NARROWEST: f64 = 0.05;

/// How strongly a value excites a cell, by its distance from the cell's centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Membership {
    /// The value counts as that of the nearest cell, and its c nearest cells are excited fully: a CMAC.
    Quantised,
    /// exp(-u^2 / (2 sigma^2)), equation (A3), with u and sigma in cells.
    Gaussian {
        /// Standard deviation in cells.
        sigma: f64,
    },
    /// The B-spline of degree c - 1, which vanishes where a cell is no longer among the c nearest.
    BSpline,
}

/// Cells along one input.
///
/// Values beyond the range count as its nearest end, so that a network is constant there. Of cells that are equally
/// near, the one with the lower number is active.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Sensor {
    /// Least value.
    pub low: f64,
    /// Largest value.
    pub high: f64,
    /// Number of cells. Gaussian and quantised: the first centre lies at `low`, the last at `high`. B-splines: the
    /// outer centres lie beyond, so that c cells reach every value of the range.
    pub cells: usize,
    /// Cells that are active at once, c: those with the largest grades.
    pub active: usize,
}

/// What a group of eight values excites: the first cell of each, and the grades of it and the following ones.
pub struct Window {
    pub first: [u64; LANES],
    pub grades: [Lane; MOST_ACTIVE],
}

impl Sensor {
    /// Checks the numbers against each other and against the membership.
    ///
    /// # Errors
    /// [`EstimateError::Option`].
    pub fn check(&self, membership: Membership) -> Result<(), EstimateError> {
        let refuse = |what, value, rule| Err(EstimateError::Option { what, value, rule });
        if !(self.low.is_finite() && self.high.is_finite() && self.low < self.high) {
            return refuse("a sensor's upper end", self.high, "it must be finite and above the lower end");
        }
        if self.active == 0 || self.active > MOST_ACTIVE {
            return refuse("a sensor's number of active cells", self.active as f64, "it must be 1 to 8");
        }
        if self.cells <= self.active {
            return refuse(
                "a sensor's number of cells",
                self.cells as f64,
                "it must exceed the active cells",
            );
        }
        match membership {
            Membership::Gaussian { sigma } if !(sigma >= NARROWEST && sigma.is_finite()) => refuse(
                "sigma",
                sigma,
                "it must be a number of cells, 0.05 or more: narrower cells excite nothing",
            ),
            Membership::BSpline if !SPLINES.contains(&self.active) => refuse(
                "the number of active cells of a B-spline",
                self.active as f64,
                "it must be 2 (linear), 3 (quadratic) or 4 (cubic)",
            ),
            _ => Ok(()),
        }
    }

    /// Distance between neighbouring cells.
    pub fn spacing(&self, membership: Membership) -> f64 {
        let steps = match membership {
            Membership::BSpline => self.cells + 1 - self.active,
            _ => self.cells - 1,
        };
        (self.high - self.low) / steps as f64
    }

    /// Position of the range's lower end in cells from the first.
    pub fn start(&self, membership: Membership) -> f64 {
        match membership {
            Membership::BSpline => 0.5 * self.active as f64 - 1.0,
            _ => 0.0,
        }
    }

    /// The c cells with the largest grades for eight values.
    #[inline(always)]
    pub fn excite<I: Isa>(&self, values: Lane, membership: Membership, window: &mut Window) {
        let (spacing, start) = (self.spacing(membership), self.start(membership));
        let mut position = [0.0; LANES];
        for i in 0..LANES {
            let inside = values.0[i].max(self.low).min(self.high);
            position[i] = (inside - self.low) / spacing + start;
        }
        if membership == Membership::Quantised {
            position.iter_mut().for_each(|x| *x = (*x - 0.5).ceil());
        }
        let (half, last) = (0.5 * self.active as f64, (self.cells - self.active) as f64);
        let mut offset = [0.0; LANES];
        for i in 0..LANES {
            let first = (position[i] - half).ceil().max(0.0).min(last);
            window.first[i] = first as u64;
            offset[i] = position[i] - first;
        }
        match membership {
            Membership::Quantised => window.grades[..self.active].fill(Lane::splat(1.0)),
            Membership::Gaussian { sigma } => {
                let factor = Lane::splat(-0.5 / (sigma * sigma));
                for (k, grade) in window.grades[..self.active].iter_mut().enumerate() {
                    let distance = Lane(offset) - Lane::splat(k as f64);
                    *grade = exp::<I>(distance * distance * factor);
                }
            }
            Membership::BSpline => self.spline::<I>(Lane(offset), &mut window.grades),
        }
    }

    /// Grades of the B-spline for offsets from the window's first centre.
    #[inline(always)]
    fn spline<I: Isa>(&self, offset: Lane, grades: &mut [Lane; MOST_ACTIVE]) {
        let middle = offset - Lane::splat(1.0);
        match self.active {
            2 => grades[..2].copy_from_slice(&linear::<I, Lane>(offset)),
            3 => grades[..3].copy_from_slice(&quadratic::<I, Lane>(middle)),
            _ => grades[..4].copy_from_slice(&cubic::<I, Lane>(middle)),
        }
    }
}
