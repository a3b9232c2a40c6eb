//! Where the parameters of a batch come from.

use crate::chain::Joint;
use crate::isa::Isa;
use crate::lane::Lane;
use crate::one_pose::OnePose;
use crate::trig::sin_cos;

/// Metres that a radian counts, in errors and in changes of parameters and joints: half the length of a lower arm.
pub const ANGLE_ARM: f64 = 0.3;

/// Whether the parameter with index 5 * link + (theta, d, a, alpha, beta) is a length, m, and no angle, rad.
#[inline(always)]
pub const fn is_length(column: usize) -> bool {
    matches!(column % 5, 1 | 2)
}

/// Absolute parameters of a batch, by link theta, d, a, alpha, beta.
#[derive(Debug, Clone, Copy)]
pub enum Parameters<'a> {
    /// One set for all poses, 5 L.
    One(&'a [f64]),
    /// One set for all poses, prepared for many small batches.
    Prepared(&'a SharedParameters),
    /// A set for each pose, n x 5 L, row-major.
    Each(&'a [f64]),
}

/// Parameters of a group of eight poses.
#[derive(Debug, Clone, Copy)]
pub enum LaneParameters<'a> {
    /// One set for all poses, prepared once.
    Shared(&'a SharedParameters),
    /// A set for each pose of the group, 5 L lanes.
    Each(&'a [Lane]),
    /// One pose in all lanes, its joint values included.
    One(&'a OnePose),
}

/// One set of parameters with the sines and cosines that all poses share.
#[derive(Debug, Clone, PartialEq)]
pub struct SharedParameters {
    pub(crate) links: Vec<SharedLink>,
}

/// Numbers of one link; alpha and beta as sine and cosine, `bent` unless beta is zero.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SharedLink {
    pub theta: f64,
    pub d: f64,
    pub a: f64,
    pub alpha: (f64, f64),
    pub beta: (f64, f64),
    pub bent: bool,
}

impl SharedParameters {
    /// Prepare 5 L absolute parameters.
    pub fn new(parameters: &[f64]) -> SharedParameters {
        let links = parameters.chunks_exact(5).map(|p| SharedLink {
            theta: p[0],
            d: p[1],
            a: p[2],
            alpha: p[3].sin_cos(),
            beta: p[4].sin_cos(),
            bent: p[4] != 0.0,
        });
        SharedParameters { links: links.collect() }
    }

    /// Number of parameters, 5 L.
    pub(crate) fn len(&self) -> usize {
        5 * self.links.len()
    }
}

/// Numbers of one link with its joint where it is; angles as sine and cosine, `bent` unless beta is zero.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LinkValues<T> {
    pub theta: (T, T),
    pub d: T,
    pub a: T,
    pub alpha: (T, T),
    pub beta: (T, T),
    pub bent: bool,
}

impl LinkValues<f64> {
    /// The same for all poses.
    #[inline(always)]
    pub fn splat(&self) -> LinkValues<Lane> {
        LinkValues {
            theta: splat(self.theta),
            d: Lane::splat(self.d),
            a: Lane::splat(self.a),
            alpha: splat(self.alpha),
            beta: splat(self.beta),
            bent: self.bent,
        }
    }
}

#[inline(always)]
fn splat((sine, cosine): (f64, f64)) -> (Lane, Lane) {
    (Lane::splat(sine), Lane::splat(cosine))
}

/// The values of a link for a group of poses.
pub(crate) trait LinkSource {
    /// Of the link's joint, `value` is where it is; of no meaning where it is fixed.
    fn link<I: Isa>(&self, index: usize, joint: Joint, value: Lane) -> LinkValues<Lane>;
}

impl LinkSource for &SharedParameters {
    #[inline(always)]
    fn link<I: Isa>(&self, index: usize, joint: Joint, value: Lane) -> LinkValues<Lane> {
        let link = &self.links[index];
        let (theta, d) = moved(joint, Lane::splat(link.theta), Lane::splat(link.d), value);
        LinkValues {
            theta: sin_cos::<I>(theta),
            d,
            a: Lane::splat(link.a),
            alpha: splat(link.alpha),
            beta: splat(link.beta),
            bent: link.bent,
        }
    }
}

impl LinkSource for &[Lane] {
    #[inline(always)]
    fn link<I: Isa>(&self, index: usize, joint: Joint, value: Lane) -> LinkValues<Lane> {
        let p = &self[5 * index..5 * index + 5];
        let (theta, d) = moved(joint, p[0], p[1], value);
        LinkValues {
            theta: sin_cos::<I>(theta),
            d,
            a: p[2],
            alpha: sin_cos::<I>(p[3]),
            beta: sin_cos::<I>(p[4]),
            bent: true,
        }
    }
}

/// theta and d with a joint's value added to the one that moves.
#[inline(always)]
fn moved(joint: Joint, theta: Lane, d: Lane, value: Lane) -> (Lane, Lane) {
    match joint {
        Joint::Revolute => (theta + value, d),
        Joint::Prismatic => (theta, d + value),
        Joint::Fixed => (theta, d),
    }
}
