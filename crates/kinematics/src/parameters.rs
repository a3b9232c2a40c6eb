//! Where the parameters of a batch come from.

use crate::isa::Isa;
use crate::lane::Lane;
use crate::trig::sin_cos;

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
}

/// One set of parameters with the sines and cosines that all poses share.
#[derive(Debug, Clone)]
pub struct SharedParameters {
    links: Vec<LinkValues<f64>>,
}

impl SharedParameters {
    /// Prepare 5 L absolute parameters.
    pub fn new(parameters: &[f64]) -> SharedParameters {
        let links = parameters.chunks_exact(5).map(|p| LinkValues {
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

/// Numbers of one link; alpha and beta as sine and cosine, `bent` unless beta is zero.
#[derive(Debug, Clone, Copy)]
pub(crate) struct LinkValues<T> {
    pub theta: T,
    pub d: T,
    pub a: T,
    pub alpha: (T, T),
    pub beta: (T, T),
    pub bent: bool,
}

/// The values of a link for a group of poses.
pub(crate) trait LinkSource {
    fn link<I: Isa>(&self, index: usize) -> LinkValues<Lane>;
}

impl LinkSource for &SharedParameters {
    #[inline(always)]
    fn link<I: Isa>(&self, index: usize) -> LinkValues<Lane> {
        let link = &self.links[index];
        LinkValues {
            theta: Lane::splat(link.theta),
            d: Lane::splat(link.d),
            a: Lane::splat(link.a),
            alpha: (Lane::splat(link.alpha.0), Lane::splat(link.alpha.1)),
            beta: (Lane::splat(link.beta.0), Lane::splat(link.beta.1)),
            bent: link.bent,
        }
    }
}

impl LinkSource for &[Lane] {
    #[inline(always)]
    fn link<I: Isa>(&self, index: usize) -> LinkValues<Lane> {
        let p = &self[5 * index..5 * index + 5];
        LinkValues {
            theta: p[0],
            d: p[1],
            a: p[2],
            alpha: sin_cos::<I>(p[3]),
            beta: sin_cos::<I>(p[4]),
            bent: true,
        }
    }
}
