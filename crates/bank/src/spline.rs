//! B-splines over cells at equal distances: grades of the cells that a value excites, for one value and for eight.

use std::ops::{Add, Mul, Neg, Sub};

use truearm_kinematics::{Isa, Lane};

/// What grades are worked out in, by the instruction set I.
pub trait Number<I>:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Neg<Output = Self>
    + Mul<Output = Self>
    + Mul<f64, Output = Self>
{
    /// The same value everywhere.
    fn of(value: f64) -> Self;

    /// a b + c.
    fn mul_add(a: Self, b: Self, c: Self) -> Self;
}

impl<I: Isa> Number<I> for Lane {
    #[inline(always)]
    fn of(value: f64) -> Self {
        Lane::splat(value)
    }

    #[inline(always)]
    fn mul_add(a: Self, b: Self, c: Self) -> Self {
        I::mul_add(a, b, c)
    }
}

/// Where one value is worked out, without an instruction set of its own.
pub struct Alone;

impl Number<Alone> for f64 {
    #[inline(always)]
    fn of(value: f64) -> Self {
        value
    }

    #[inline(always)]
    fn mul_add(a: Self, b: Self, c: Self) -> Self {
        a * b + c
    }
}

/// Linear, t from the first of two cells.
#[inline(always)]
pub fn linear<I, N: Number<I>>(t: N) -> [N; 2] {
    [N::of(1.0) - t, t]
}

/// Quadratic, t from the middle one of three cells.
#[inline(always)]
pub fn quadratic<I, N: Number<I>>(t: N) -> [N; 3] {
    let (low, high) = (N::of(0.5) - t, N::of(0.5) + t);
    [low * low * 0.5, N::mul_add(-t, t, N::of(0.75)), high * high * 0.5]
}

/// Derivatives of the quadratic grades by t, from the grades: the outer ones differ by t.
#[inline(always)]
pub fn quadratic_slopes<I, N: Number<I>>([low, _, high]: [N; 3]) -> [N; 3] {
    let t = high - low;
    [t - N::of(0.5), t * -2.0, t + N::of(0.5)]
}

/// Derivatives of the cubic grades by t, from the grades: the mean of their cells lies at t.
#[inline(always)]
pub fn cubic_slopes<I, N: Number<I>>([before, _, next, last]: [N; 4]) -> [N; 4] {
    let t = N::mul_add(last, N::of(2.0), next - before);
    let s = N::of(1.0) - t;
    let (two, inner) = (N::of(2.0), N::of(1.5));
    [s * s * -0.5, t * N::mul_add(t, inner, -two), -(s * N::mul_add(s, inner, -two)), t * t * 0.5]
}

/// Cubic, t from the second of four cells.
#[inline(always)]
pub fn cubic<I, N: Number<I>>(t: N) -> [N; 4] {
    let s = N::of(1.0) - t;
    let (t2, s2) = (t * t, s * s);
    let (one, two_thirds) = (N::of(1.0), N::of(2.0 / 3.0));
    [
        s2 * s * (1.0 / 6.0),
        N::mul_add(t2, t * 0.5 - one, two_thirds),
        N::mul_add(s2, s * 0.5 - one, two_thirds),
        t2 * t * (1.0 / 6.0),
    ]
}
