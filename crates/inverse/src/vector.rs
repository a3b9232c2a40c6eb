//! Vectors of three, and lines.

use truearm_kinematics::{cross, norm};

pub type Vector = [f64; 3];

/// a + scale b.
pub fn add_scaled(a: Vector, scale: f64, b: Vector) -> Vector {
    [0, 1, 2].map(|i| a[i] + scale * b[i])
}

/// a - b.
pub fn sub(a: Vector, b: Vector) -> Vector {
    add_scaled(a, -1.0, b)
}

/// a . b.
pub fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// `a` without its part along the unit vector `direction`, of unit length; `None` if nothing is left.
pub fn unit_across(a: Vector, direction: Vector) -> Option<Vector> {
    let across = add_scaled(a, -dot(a, direction), direction);
    let length = norm(across);
    (length > 1e-6).then(|| across.map(|x| x / length))
}

/// A line through a point, with a unit direction.
#[derive(Debug, Clone, Copy)]
pub struct Line {
    pub point: Vector,
    pub direction: Vector,
}

impl Line {
    /// The point of the line that is nearest to `point`.
    pub fn nearest(&self, point: Vector) -> Vector {
        add_scaled(self.point, dot(sub(point, self.point), self.direction), self.direction)
    }

    /// The middle of the shortest way between two lines that are not parallel, and its length.
    pub fn meeting(&self, other: &Line) -> Option<(Vector, f64)> {
        let normal = cross(self.direction, other.direction);
        let square = dot(normal, normal);
        if square < 1e-6 {
            return None;
        }
        let between = sub(other.point, self.point);
        let on_self =
            add_scaled(self.point, dot(cross(between, other.direction), normal) / square, self.direction);
        let on_other = other.nearest(on_self);
        let middle = [0, 1, 2].map(|i| 0.5 * (on_self[i] + on_other[i]));
        Some((middle, norm(sub(on_self, on_other))))
    }
}
