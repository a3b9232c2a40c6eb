//! Kernels of one input: how alike two values of it are.
//!
//! Distances are `D = 1 - cos(dq)` for angles, the squared exponential's exponent on the circle (cos q, sin q), so that
//! a turn more changes nothing and a range of less than a turn costs nothing; `D = u^2 / 2` for lengths and other
//! features, with u scaled so that the data's range is pi. At short distances both are half the squared
//! distance.

use truearm_kinematics::{Isa, Kernel, Lane, dispatch, exp};

/// What kind of values an input takes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum InputKind {
    /// An angle in rad, alike after a turn.
    Angle,
    /// A length or a feature on a line.
    Line,
}

/// One input of the field and how its values are scaled.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Input {
    /// Kind of values.
    pub kind: InputKind,
    /// Values are multiplied with this (one for angles, the phase by the value for those of a wave).
    pub scale: f64,
}

impl Input {
    /// An angle.
    pub const ANGLE: Input = Input { kind: InputKind::Angle, scale: 1.0 };

    /// A line whose data range, given in its own unit, becomes pi.
    pub fn line(range: f64) -> Self {
        let scale = if range > 0.0 { std::f64::consts::PI / range } else { 1.0 };
        Self { kind: InputKind::Line, scale }
    }

    /// Distance D of two raw values.
    pub fn distance(&self, a: f64, b: f64) -> f64 {
        self.distance_of(self.scale * (a - b))
    }

    /// Coordinates of a raw value, half of whose squared distance is D.
    pub fn place(&self, value: f64) -> impl ExactSizeIterator<Item = f64> + use<> {
        let scaled = self.scale * value;
        let (coordinates, count) = match self.kind {
            InputKind::Angle => ([scaled.cos(), scaled.sin()], 2),
            InputKind::Line => ([scaled, 0.0], 1),
        };
        coordinates.into_iter().take(count)
    }

    /// Distance D of a scaled difference.
    pub fn distance_of(&self, difference: f64) -> f64 {
        match self.kind {
            InputKind::Angle => {
                let sine = (0.5 * difference).sin();
                2.0 * sine * sine
            }
            InputKind::Line => 0.5 * difference * difference,
        }
    }
}

/// How a kernel falls with the distance.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Shape {
    /// exp(-D / l^2).
    SquaredExponential,
    /// Matern 5/2 of r = sqrt(2 D) / l: (1 + sqrt5 r + 5 r^2 / 3) exp(-sqrt5 r) (Rasmussen and Williams 2006, eq. 4.17).
    Matern,
}

/// Kernels of eight distances and their derivatives by the logarithm of the length scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Value {
    /// The kernels.
    pub kernel: Lane,
    /// Their derivatives.
    pub by_log_length: Lane,
}

impl Shape {
    /// Kernels of eight distances.
    #[inline(always)]
    pub fn of<I: Isa>(self, distance: Lane, length: f64) -> Value {
        match self {
            Self::SquaredExponential => {
                let exponent = distance * (1.0 / (length * length));
                let kernel = exp::<I>(-exponent);
                Value { kernel, by_log_length: exponent * kernel * 2.0 }
            }
            Self::Matern => {
                let s = (distance * 10.0).sqrt() * (1.0 / length);
                let decay = exp::<I>(-s);
                let (linear, square) = (s + Lane::splat(1.0), s * s * (1.0 / 3.0));
                Value { kernel: (linear + square) * decay, by_log_length: square * linear * decay }
            }
        }
    }

    /// The kernel of one distance.
    pub fn at(self, distance: f64, length: f64) -> f64 {
        dispatch(Of { shape: self, distance, length }).kernel.0[0]
    }
}

struct Of {
    shape: Shape,
    distance: f64,
    length: f64,
}

impl Kernel for Of {
    type Output = Value;

    #[inline(always)]
    fn run<I: Isa>(self) -> Value {
        self.shape.of::<I>(Lane::splat(self.distance), self.length)
    }
}
