//! By how much the joints lift the links: what a joint's drive carries of the links' weights.

use crate::chain::Chain;
use crate::frame::Carried;
use crate::isa::Isa;
use crate::lane::Lane;
use crate::parameters::LaneParameters;
use crate::sweep::Axes;

/// Directions from the end in which a load's centre of gravity may lie beside it.
pub const BESIDE: usize = 3;

/// Number of levers of so many joints: one for each joint with itself and with each one behind it, and [`BESIDE`] more for
/// each joint.
pub const fn lever_count(joints: usize) -> usize {
    joints * (joints + 1) / 2 + BESIDE * joints
}

/// What levers are worked out in.
#[derive(Debug, Clone)]
pub struct LeverScratch {
    /// Axis and origin of each joint's frame.
    frames: Vec<[[Lane; 3]; 2]>,
    /// Way from each joint's origin to the next one's or to the end, along x and y.
    ways: Vec<[Lane; 2]>,
    /// The x, y and z axis of the end, along x and y; on the heap as all lanes of scratches are, which may be part of objects
    /// whose allocator knows no alignment of lanes.
    beside: Vec<[Lane; 2]>,
}

impl LeverScratch {
    /// Room for a chain.
    pub fn new(chain: &Chain) -> Self {
        let joints = chain.joint_count();
        Self {
            frames: vec![[[Lane::ZERO; 3]; 2]; joints],
            ways: vec![[Lane::ZERO; 2]; joints],
            beside: vec![[Lane::ZERO; 2]; BESIDE],
        }
    }
}

impl Chain {
    /// Derivatives of heights by the joints, for a group of eight poses; `joints` and `parameters` as for
    /// [`Chain::sweep`].
    ///
    /// `out` holds [`lever_count`] lanes: for each joint j and each k from j on the derivative, by joint j, of the
    /// height (z in the base frame, m) at which the link that joint k moves ends; m/rad, for a prismatic joint m/m.
    /// A weight there loads joint j with so much of itself. Behind those of joint j come the derivatives of what a metre
    /// along the end's x, y and z axis adds to the height: what the weight does that hangs so far beside the end.
    #[inline(always)]
    pub fn levers<I: Isa>(
        &self,
        joints: &[Lane],
        parameters: LaneParameters<'_>,
        scratch: &mut LeverScratch,
        out: &mut [Lane],
    ) {
        self.find_ways::<I, true>(joints, parameters, scratch);
        let mut at = 0;
        for j in 0..self.joint_count() {
            let mut arm = [Lane::ZERO; 2];
            for way in &scratch.ways[j..] {
                arm = [arm[0] + way[0], arm[1] + way[1]];
                out[at] = lift::<I>(self.slides(j), &scratch.frames[j][0], &arm, 1.0);
                at += 1;
            }
            for way in &scratch.beside {
                out[at] = lift::<I>(self.slides(j), &scratch.frames[j][0], way, 0.0);
                at += 1;
            }
        }
    }

    /// Sums of the levers of each joint, each times its weight, into `out`, J lanes; else as for [`Chain::levers`].
    ///
    /// `heights` are in the order of levers: for each joint j and each k from j on the sum of the weights of joint j's
    /// levers from k on, and behind them those of the levers beside the end.
    #[inline(always)]
    pub fn loads<I: Isa>(
        &self,
        joints: &[Lane],
        parameters: LaneParameters<'_>,
        heights: &[f64],
        scratch: &mut LeverScratch,
        out: &mut [Lane],
    ) {
        if (0..self.joint_count()).any(|j| self.slides(j)) {
            self.find_loads::<I, true>(joints, parameters, heights, scratch, out);
        } else {
            self.find_loads::<I, false>(joints, parameters, heights, scratch, out);
        }
    }

    #[inline(always)]
    fn find_loads<I: Isa, const SLIDES: bool>(
        &self,
        joints: &[Lane],
        parameters: LaneParameters<'_>,
        heights: &[f64],
        scratch: &mut LeverScratch,
        out: &mut [Lane],
    ) {
        self.find_ways::<I, SLIDES>(joints, parameters, scratch);
        let mut heights = heights;
        for (j, out) in out.iter_mut().enumerate().take(self.joint_count()) {
            let (own, rest) = heights.split_at(scratch.ways.len() - j + BESIDE);
            let mut arm = [Lane::ZERO; 2];
            for (way, weight) in scratch.ways[j..].iter().chain(&scratch.beside).zip(own) {
                arm[0] = I::mul_add(way[0], Lane::splat(*weight), arm[0]);
                arm[1] = I::mul_add(way[1], Lane::splat(*weight), arm[1]);
            }
            *out = lift::<I>(SLIDES && self.slides(j), &scratch.frames[j][0], &arm, own[0]);
            heights = rest;
        }
    }

    /// Frames and ways into the scratch, without the heights unless `SLIDES`.
    #[inline(always)]
    fn find_ways<I: Isa, const SLIDES: bool>(
        &self,
        joints: &[Lane],
        parameters: LaneParameters<'_>,
        scratch: &mut LeverScratch,
    ) {
        let LeverScratch { frames, ways, beside } = scratch;
        let mut seen = Frames::<SLIDES> { columns: self.joint_columns(), link: 0, next: 0, frames };
        let end = self.walk::<I, _>(joints, parameters, &mut seen);
        for (j, way) in ways.iter_mut().enumerate() {
            let (tip, point) = (frames.get(j + 1).map_or(&end.position, |frame| &frame[1]), &frames[j][1]);
            *way = [tip[0] - point[0], tip[1] - point[1]];
        }
        for (k, way) in beside.iter_mut().enumerate() {
            let axis = end.axis(k);
            *way = [axis[0], axis[1]];
        }
    }
}

/// How fast a joint lifts what is at the end of an arm, `weight` times where it slides and all else is lifted with it.
#[inline(always)]
fn lift<I: Isa>(slides: bool, axis: &[Lane; 3], arm: &[Lane; 2], weight: f64) -> Lane {
    if slides { axis[2] * weight } else { I::mul_add(axis[0], arm[1], -(axis[1] * arm[0])) }
}

/// Gathers the frame of each joint, without the heights unless `SLIDES`.
struct Frames<'a, const SLIDES: bool> {
    columns: &'a [usize],
    link: usize,
    next: usize,
    frames: &'a mut [[[Lane; 3]; 2]],
}

impl<const SLIDES: bool> Frames<'_, SLIDES> {
    #[inline(always)]
    fn take(&mut self, k: usize, frame: &impl Carried) {
        if self.columns.get(self.next) == Some(&(5 * self.link + k)) {
            let frame = frame.here();
            let (axis, point) = (frame.axis(2), frame.position);
            let [to_axis, to_point] = &mut self.frames[self.next];
            for i in 0..if SLIDES { 3 } else { 2 } {
                (to_axis[i], to_point[i]) = (axis[i], point[i]);
            }
            self.next += 1;
        }
    }
}

impl<const SLIDES: bool> Axes for Frames<'_, SLIDES> {
    #[inline(always)]
    fn enter(&mut self, link: usize) {
        self.link = link;
    }

    #[inline(always)]
    fn turns<F: Carried>(&mut self, k: usize, frame: &F, _axis: usize) {
        self.take(k, frame);
    }

    #[inline(always)]
    fn shifts<F: Carried>(&mut self, k: usize, frame: &F, _axis: usize) {
        self.take(k, frame);
    }
}
