//! Kernels of one input: how alike two values of it are.
//!
//! Distances are `D = 1 - cos(dq)` for angles, the squared exponential's exponent on the circle (cos q, sin q), so that
//! a turn more changes nothing and a range of less than a turn costs nothing; `D = u^2 / 2` for lengths and other
//! features, with u scaled so that the data's range is pi. At short distances both are half the squared
//! distance.

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
    /// Values are multiplied with this (one for angles).
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

/// A kernel and its derivative by the logarithm of the length scale.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Value {
    pub kernel: f64,
    pub by_log_length: f64,
}

/// exp(-D / l^2).
#[inline]
pub fn squared_exponential(distance: f64, length: f64) -> Value {
    let exponent = distance / (length * length);
    let kernel = (-exponent).exp();
    Value { kernel, by_log_length: 2.0 * exponent * kernel }
}

/// Matern 5/2 of r = sqrt(2 D) / l: (1 + sqrt5 r + 5 r^2 / 3) exp(-sqrt5 r) (Rasmussen and Williams 2006, eq. 4.17).
#[inline]
pub fn matern(distance: f64, length: f64) -> Value {
    let s = (10.0 * distance).sqrt() / length;
    let decay = (-s).exp();
    Value { kernel: (1.0 + s + s * s / 3.0) * decay, by_log_length: s * s * (1.0 + s) * decay / 3.0 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn derivatives_match_finite_differences() {
        for kernel in [squared_exponential, matern] {
            for distance in [0.0, 1e-4, 0.03, 0.7, 2.0] {
                let (length, step) = (0.37_f64, 1e-6_f64);
                let difference = (kernel(distance, length * step.exp()).kernel
                    - kernel(distance, length * (-step).exp()).kernel)
                    / (2.0 * step);
                assert!((difference - kernel(distance, length).by_log_length).abs() < 1e-8);
            }
        }
    }

    #[test]
    fn a_turn_more_changes_nothing() {
        let turn = std::f64::consts::TAU;
        assert!((Input::ANGLE.distance(0.3, 0.1) - Input::ANGLE.distance(0.3 + turn, 0.1)).abs() < 1e-14);
    }

    #[test]
    fn short_distances_are_half_squares() {
        let line = Input::line(2.0);
        assert!((line.distance(0.5, 0.4) - 0.5 * (0.1 * line.scale).powi(2)).abs() < 1e-15);
        assert!((Input::ANGLE.distance(0.5, 0.4999) - 0.5e-8).abs() < 1e-15);
    }
}
