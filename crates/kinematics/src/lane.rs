//! Eight numbers worked on at once.

use std::ops::{Add, AddAssign, Div, Mul, Neg, Sub, SubAssign};

/// Poses in a group.
pub const LANES: usize = 8;

/// One value for each of eight poses; plain arithmetic element by element.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[repr(C, align(64))]
pub struct Lane(pub [f64; LANES]);

/// Eight numbers of single precision: tables of them take half the memory and half the work.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
#[repr(C, align(32))]
pub struct Short(pub [f32; LANES]);

impl Short {
    /// Eight zeros.
    pub const ZERO: Short = Short([0.0; LANES]);

    /// The same value eight times.
    #[inline(always)]
    pub const fn splat(value: f32) -> Short {
        Short([value; LANES])
    }
}

impl AddAssign for Short {
    #[inline(always)]
    fn add_assign(&mut self, other: Short) {
        for i in 0..LANES {
            self.0[i] += other.0[i];
        }
    }
}

/// Which of sixteen numbers, those of two lanes, become the numbers of one; see [`crate::Isa::pick`].
#[derive(Debug, Clone, PartialEq, Eq)]
#[repr(align(64))]
pub struct Pick {
    pub(crate) from: [u64; LANES],
    /// A bit for each number: where it is not set stands zero.
    pub(crate) taken: u8,
}

impl Pick {
    /// Of up to eight numbers where they come from: 0 to 7 in the first lane, 8 to 15 in the second; the others are zero.
    pub fn new(sources: impl IntoIterator<Item = Option<usize>>) -> Self {
        let mut pick = Self { from: [0; LANES], taken: 0 };
        for (i, source) in sources.into_iter().enumerate().take(LANES) {
            if let Some(source) = source.filter(|&source| source < 2 * LANES) {
                pick.from[i] = source as u64;
                pick.taken |= 1 << i;
            }
        }
        pick
    }

    /// The number that becomes the one of a place, if any does.
    #[inline(always)]
    pub(crate) fn of(&self, place: usize, low: &Lane, high: &Lane) -> Option<f64> {
        if self.taken >> place & 1 == 0 {
            return None;
        }
        let from = self.from[place] as usize;
        if from < LANES { Some(low.0[from]) } else { high.0.get(from - LANES).copied() }
    }
}

impl Lane {
    /// Zero for every pose.
    pub const ZERO: Lane = Lane([0.0; LANES]);

    /// The same value for every pose.
    #[inline(always)]
    pub const fn splat(value: f64) -> Lane {
        Lane([value; LANES])
    }

    /// Several values, each the same for every pose.
    #[inline(always)]
    pub fn splat_all<const N: usize>(values: &[f64; N]) -> [Lane; N] {
        let mut out = [Lane::ZERO; N];
        for (lane, value) in out.iter_mut().zip(values) {
            *lane = Lane::splat(*value);
        }
        out
    }

    /// The values of `f(0)` to `f(7)`.
    #[inline(always)]
    pub fn from_fn(mut f: impl FnMut(usize) -> f64) -> Lane {
        let mut out = [0.0; LANES];
        for (i, value) in out.iter_mut().enumerate() {
            *value = f(i);
        }
        Lane(out)
    }

    /// Square roots.
    #[inline(always)]
    pub fn sqrt(self) -> Lane {
        let mut out = [0.0; LANES];
        for i in 0..LANES {
            out[i] = self.0[i].sqrt();
        }
        Lane(out)
    }

    /// Where a number of `self` is below the one of `bound`, that of `yes`, else that of `no`; NaN is below nothing.
    #[inline(always)]
    pub fn where_below(self, bound: Lane, yes: Lane, no: Lane) -> Lane {
        let mut out = [0.0; LANES];
        for i in 0..LANES {
            out[i] = if self.0[i] < bound.0[i] { yes.0[i] } else { no.0[i] };
        }
        Lane(out)
    }

    /// Whether any number is below the one of `bound`.
    #[inline(always)]
    pub fn any_below(self, bound: Lane) -> bool {
        let mut any = false;
        for i in 0..LANES {
            any |= self.0[i] < bound.0[i];
        }
        any
    }

    /// Lanes as one run of numbers.
    pub(crate) fn numbers(lanes: &mut [Lane]) -> &mut [f64] {
        // SAFETY: a lane is eight f64 without padding, its alignment a multiple of theirs.
        unsafe { std::slice::from_raw_parts_mut(lanes.as_mut_ptr().cast(), lanes.len() * LANES) }
    }

    /// Sum of the eight values, in a fixed order.
    #[inline(always)]
    pub fn sum(self) -> f64 {
        let x = self.0;
        ((x[0] + x[4]) + (x[1] + x[5])) + ((x[2] + x[6]) + (x[3] + x[7]))
    }
}

impl Add for Lane {
    type Output = Lane;
    #[inline(always)]
    fn add(self, other: Lane) -> Lane {
        let mut out = [0.0; LANES];
        for i in 0..LANES {
            out[i] = self.0[i] + other.0[i];
        }
        Lane(out)
    }
}

impl Sub for Lane {
    type Output = Lane;
    #[inline(always)]
    fn sub(self, other: Lane) -> Lane {
        let mut out = [0.0; LANES];
        for i in 0..LANES {
            out[i] = self.0[i] - other.0[i];
        }
        Lane(out)
    }
}

impl Mul for Lane {
    type Output = Lane;
    #[inline(always)]
    fn mul(self, other: Lane) -> Lane {
        let mut out = [0.0; LANES];
        for i in 0..LANES {
            out[i] = self.0[i] * other.0[i];
        }
        Lane(out)
    }
}

impl Div for Lane {
    type Output = Lane;
    #[inline(always)]
    fn div(self, other: Lane) -> Lane {
        let mut out = [0.0; LANES];
        for i in 0..LANES {
            out[i] = self.0[i] / other.0[i];
        }
        Lane(out)
    }
}

impl Mul<f64> for Lane {
    type Output = Lane;
    #[inline(always)]
    fn mul(self, other: f64) -> Lane {
        let mut out = [0.0; LANES];
        for i in 0..LANES {
            out[i] = self.0[i] * other;
        }
        Lane(out)
    }
}

impl Neg for Lane {
    type Output = Lane;
    #[inline(always)]
    fn neg(self) -> Lane {
        let mut out = [0.0; LANES];
        for i in 0..LANES {
            out[i] = -self.0[i];
        }
        Lane(out)
    }
}

impl AddAssign for Lane {
    #[inline(always)]
    fn add_assign(&mut self, other: Lane) {
        *self = *self + other;
    }
}

impl SubAssign for Lane {
    #[inline(always)]
    fn sub_assign(&mut self, other: Lane) {
        *self = *self - other;
    }
}
