//! The links of one pose: the sines and cosines of all its angles together, eight at once.

use crate::chain::{Chain, Joint};
use crate::isa::Isa;
use crate::lane::{LANES, Lane};
use crate::parameters::{LinkSource, LinkValues, SharedLink, SharedParameters};
use crate::trig::sin_cos;

/// The links of a pose that stands in all lanes: each lane gets to the bit what that pose gets among others.
#[derive(Debug, Clone)]
pub struct OnePose {
    /// Of all links theta, then alpha, then beta.
    angles: Vec<Lane>,
    sines: Vec<Lane>,
    cosines: Vec<Lane>,
    links: Vec<LinkValues<f64>>,
    /// theta and d of the links that it was made with.
    still: Vec<[f64; 2]>,
}

impl OnePose {
    /// For the poses of a chain with parameters that are prepared, or that come with each pose.
    pub fn new(shared: &SharedParameters) -> OnePose {
        let link = |given: &SharedLink| LinkValues {
            theta: given.theta.sin_cos(),
            d: given.d,
            a: given.a,
            alpha: given.alpha,
            beta: given.beta,
            bent: given.bent,
        };
        let lanes = vec![Lane::ZERO; (3 * shared.links.len()).div_ceil(LANES)];
        OnePose {
            sines: lanes.clone(),
            cosines: lanes.clone(),
            angles: lanes,
            links: shared.links.iter().map(link).collect(),
            still: shared.links.iter().map(|link| [link.theta, link.d]).collect(),
        }
    }

    /// Takes 5 L absolute parameters, and of `joints`, J lanes, the first pose.
    #[inline(always)]
    pub fn set<I: Isa>(&mut self, chain: &Chain, joints: &[Lane], parameters: &[f64]) {
        let count = self.links.len();
        let angles = Lane::numbers(&mut self.angles);
        for (index, (link, p)) in self.links.iter_mut().zip(parameters.chunks_exact(5)).enumerate() {
            (angles[index], angles[count + index], angles[2 * count + index]) = (p[0], p[3], p[4]);
            (link.d, link.a, link.bent) = (p[1], p[2], p[4] != 0.0);
        }
        self.move_joints(chain, joints);
        self.turn::<I>(3 * count);
        let (sines, cosines) = (Lane::numbers(&mut self.sines), Lane::numbers(&mut self.cosines));
        for (index, link) in self.links.iter_mut().enumerate() {
            let turn = |k: usize| (sines[k * count + index], cosines[k * count + index]);
            (link.theta, link.alpha, link.beta) = (turn(0), turn(1), turn(2));
        }
    }

    /// The same with the parameters that it was made with, where no others were ever taken.
    #[inline(always)]
    pub fn move_to<I: Isa>(&mut self, chain: &Chain, joints: &[Lane]) {
        let angles = Lane::numbers(&mut self.angles);
        for (index, (link, [theta, d])) in self.links.iter_mut().zip(&self.still).enumerate() {
            (angles[index], link.d) = (*theta, *d);
        }
        self.move_joints(chain, joints);
        self.turn::<I>(self.links.len());
        let (sines, cosines) = (Lane::numbers(&mut self.sines), Lane::numbers(&mut self.cosines));
        for (index, link) in self.links.iter_mut().enumerate() {
            link.theta = (sines[index], cosines[index]);
        }
    }

    /// Adds the joints' values to the angles and lengths.
    #[inline(always)]
    fn move_joints(&mut self, chain: &Chain, joints: &[Lane]) {
        let angles = Lane::numbers(&mut self.angles);
        let mut values = joints.iter();
        for (index, link) in chain.links().iter().enumerate() {
            if link.joint == Joint::Fixed {
                continue;
            }
            let Some(value) = values.next() else { return };
            match link.joint {
                Joint::Prismatic => self.links[index].d += value.0[0],
                _ => angles[index] += value.0[0],
            }
        }
    }

    /// Sines and cosines of the first `count` angles.
    #[inline(always)]
    fn turn<I: Isa>(&mut self, count: usize) {
        let lanes = self.angles.iter().zip(&mut self.sines).zip(&mut self.cosines);
        for ((angle, sine), cosine) in lanes.take(count.div_ceil(LANES)) {
            (*sine, *cosine) = sin_cos::<I>(*angle);
        }
    }
}

impl LinkSource for &OnePose {
    #[inline(always)]
    fn link<I: Isa>(&self, index: usize, _joint: Joint, _value: Lane) -> LinkValues<Lane> {
        self.links[index].splat()
    }
}
