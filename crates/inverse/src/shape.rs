//! What an arm looks like: the plain arm with a closed form that is nearest to it.

use truearm_kinematics::{Transform, cross};

use crate::axes::Axes;
use crate::branch::Planar;
use crate::opw::Opw;
use crate::parallel::Parallel;
use crate::vector::{Line, Vector, dot, sub, unit_across};

/// How far from square or parallel the axes of an arm may be for the closed form of the plain one to be
/// a start, radians: ten times what factory calibrations show.
const SQUARE_RAD: f64 = 0.02;
/// The same for axes that meet, metres.
pub const MEETING_M: f64 = 0.02;

/// How an arm is solved.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Method {
    /// Closed form of a base of two parallel axes across the first, and a spherical wrist.
    SphericalWrist,
    /// Closed form of three parallel axes across the first and the fifth.
    ThreeParallel,
    /// Newton from many starts.
    Numeric,
}

/// An arm's closed form, or none.
#[derive(Debug, Clone)]
pub enum Shape {
    Opw(Box<Opw>),
    Parallel(Box<Parallel>),
    /// No closed form; the planar part, if the first axes have one, names the branches.
    None(Option<Box<Planar>>),
}

impl Shape {
    /// The shape of an arm by its axes.
    pub fn of(axes: &Axes) -> Shape {
        let base = axes.all_revolute.then(|| Base::of(axes)).flatten();
        let Some(base) = base else {
            return Shape::None(None);
        };
        if let Some(opw) = Opw::of(axes, &base) {
            return Shape::Opw(Box::new(opw));
        }
        if let Some(parallel) = Parallel::of(axes, &base) {
            return Shape::Parallel(Box::new(parallel));
        }
        Shape::None(Planar::of_five_axes(axes, &base).map(Box::new))
    }

    /// How an arm of this shape is solved.
    pub fn method(&self) -> Method {
        match self {
            Shape::Opw(_) => Method::SphericalWrist,
            Shape::Parallel(_) => Method::ThreeParallel,
            Shape::None(_) => Method::Numeric,
        }
    }

    /// Joint values at which the plain arm's end has the pose; those of an undetermined joint near the seed.
    pub fn candidates(&self, base_from_end: &Transform, seed: &[f64]) -> Vec<[f64; 6]> {
        match (self, <&[f64; 6]>::try_from(seed)) {
            (Shape::Opw(opw), Ok(seed)) => opw.candidates(base_from_end, seed),
            (Shape::Parallel(parallel), Ok(seed)) => parallel.candidates(base_from_end, seed),
            _ => Vec::new(),
        }
    }
}

/// The first three axes of an arm whose second and third are parallel and across the first.
///
/// The model's frame has z on the first axis, y along the second and its origin at the second's height.
#[derive(Debug, Clone)]
pub struct Base {
    pub x: Vector,
    pub y: Vector,
    pub z: Vector,
    pub origin: Vector,
    /// Second axis from the first, along x.
    pub a1: f64,
    /// Third axis from the second.
    pub c2: f64,
    /// Angle about y from z to the way from the second axis to the third, joint values zero.
    pub start: f64,
    /// Direction of the third axis against the second.
    pub sign: f64,
}

impl Base {
    fn of(axes: &Axes) -> Option<Base> {
        let [first, second, third, ..] = axes.lines.as_slice() else {
            return None;
        };
        if !square(first, second.direction) || !along(third, second.direction) {
            return None;
        }
        let z = first.direction;
        let y = unit_across(second.direction, z)?;
        let x = cross(y, z);
        let origin = first.nearest(second.point);
        let mut base =
            Base { x, y, z, origin, a1: dot(sub(second.point, origin), x), c2: 0.0, start: 0.0, sign: 1.0 };
        let (u, w) = base.planar(sub(third.point, second.point));
        base.c2 = u.hypot(w);
        base.start = u.atan2(w);
        base.sign = dot(third.direction, y).signum();
        (base.c2 > MEETING_M).then_some(base)
    }

    /// Parts of a vector along x and z.
    pub fn planar(&self, vector: Vector) -> (f64, f64) {
        (dot(vector, self.x), dot(vector, self.z))
    }

    /// base_from_model.
    pub fn frame(&self) -> Transform {
        frame(self.x, self.y, self.z, self.origin)
    }
}

/// A frame from its axes and origin.
pub fn frame(x: Vector, y: Vector, z: Vector, origin: Vector) -> Transform {
    Transform { rotation: [x[0], y[0], z[0], x[1], y[1], z[1], x[2], y[2], z[2]], translation: origin }
}

/// Whether a line is across a unit direction, within [`SQUARE_RAD`].
pub fn square(line: &Line, direction: Vector) -> bool {
    dot(line.direction, direction).abs() < SQUARE_RAD
}

/// Whether a line is along a unit direction, either way, within [`SQUARE_RAD`].
pub fn along(line: &Line, direction: Vector) -> bool {
    let across = cross(line.direction, direction);
    dot(across, across) < SQUARE_RAD * SQUARE_RAD
}
