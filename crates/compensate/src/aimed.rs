//! A model with a tool on its flange, evaluated for eight poses at once.

use std::sync::Arc;

use truearm_bank::{ConservativeScratch, FieldScratch};
use truearm_kinematics::{
    Chain, Isa, Kernel, LANES, Lane, LaneFrame, LaneParameters, OnePose, Screw, Transform, lane_room,
    load_lanes,
};

use crate::error::CompensateError;
use crate::model::Model;
use crate::spread::Spread;

/// A model that ends at a tool.
#[derive(Debug, Clone)]
pub(crate) struct Aimed {
    pub model: Arc<Model>,
    pub chain: Chain,
    /// Rotation of flange_from_tool.
    pub turned: [f64; 9],
    /// Distance of the tool from the point whose standard deviation is bounded, m.
    pub reach: f64,
}

impl Aimed {
    /// A model with a tool, flange_from_tool.
    ///
    /// # Errors
    /// [`CompensateError::Kinematics`] if it is no rigid motion.
    pub fn new(model: Arc<Model>, flange_from_tool: &Transform) -> Result<Self, CompensateError> {
        flange_from_tool.check("tool")?;
        let chain = model.chain.with_end(model.chain.end().compose(flange_from_tool))?;
        let reach = model.spread.as_ref().map_or(0.0, |spread| spread.reach(flange_from_tool.translation));
        Ok(Self { model, chain, turned: flange_from_tool.rotation, reach })
    }

    /// Room for one thread.
    pub fn scratch(&self) -> AimedScratch {
        let (joints, width) = (self.chain.joint_count(), self.chain.parameter_count());
        let spread = self.model.spread.as_ref().map_or(0, |spread| spread.column_count());
        AimedScratch {
            inputs: vec![Lane::ZERO; joints + self.model.feature_count],
            // One group of lanes more, so that whole blocks can be read.
            rows: vec![0.0; LANES * (width + LANES)],
            parameters: vec![Lane::ZERO; lane_room(width)],
            one: OnePose::new(&self.model.shared),
            screws: vec![Screw::ZERO; joints.max(spread)],
            slopes: vec![Lane::ZERO; joints],
            field: self.model.field.as_ref().map(|field| field.scratch()),
            bounds: self.model.spread.as_ref().and_then(Spread::scratch),
        }
    }
}

/// What an evaluation writes to.
#[derive(Debug, Clone)]
pub(crate) struct AimedScratch {
    /// Joint values and features.
    pub inputs: Vec<Lane>,
    rows: Vec<f64>,
    parameters: Vec<Lane>,
    one: OnePose,
    pub screws: Vec<Screw>,
    slopes: Vec<Lane>,
    field: Option<FieldScratch>,
    pub bounds: Option<ConservativeScratch>,
}

impl AimedScratch {
    /// The features of all poses to come.
    pub fn set_features(&mut self, joints: usize, features: &[f64]) {
        for (lane, value) in self.inputs[joints..].iter_mut().zip(features) {
            *lane = Lane::splat(*value);
        }
    }
}

impl Aimed {
    /// Puts the joint values of N readings into the inputs.
    #[inline(always)]
    pub fn set_joints<I: Isa>(&self, readings: &[Lane], scratch: &mut AimedScratch) {
        self.model.coupling.joints::<I>(readings, &mut scratch.inputs[..self.chain.joint_count()]);
    }

    /// The tool's frame of N readings, and its motions by the joint values in `scratch.screws`.
    ///
    /// Of a field what a joint's own lines add to its angle takes part in them: nearly all of what a field changes over
    /// a correction. `alone`: all lanes hold the same pose.
    #[inline(always)]
    pub fn sweep<I: Isa>(&self, readings: &[Lane], alone: bool, scratch: &mut AimedScratch) -> LaneFrame {
        let frame = self.sweep_columns::<I>(readings, alone, self.chain.joint_columns(), scratch);
        let AimedScratch { screws, slopes, field, .. } = scratch;
        if let (Some(bank), Some(room)) = (&self.model.field, field) {
            let poses = if alone { 1 } else { LANES };
            bank.own_slopes::<I>(self.chain.joint_columns(), poses, room, slopes);
            for (screw, slope) in screws.iter_mut().zip(slopes) {
                for i in 0..3 {
                    screw.angular[i] = I::mul_add(screw.angular[i], *slope, screw.angular[i]);
                    screw.linear[i] = I::mul_add(screw.linear[i], *slope, screw.linear[i]);
                }
            }
        }
        frame
    }

    /// The same by the parameters of the given columns alone.
    #[inline(always)]
    pub fn sweep_columns<I: Isa>(
        &self,
        readings: &[Lane],
        alone: bool,
        columns: &[usize],
        scratch: &mut AimedScratch,
    ) -> LaneFrame {
        self.set_joints::<I>(readings, scratch);
        I::call(Sweep { aimed: self, alone, columns: Some(columns), scratch })
    }

    /// The tool's frame alone.
    #[inline(always)]
    pub fn end<I: Isa>(&self, readings: &[Lane], alone: bool, scratch: &mut AimedScratch) -> LaneFrame {
        self.set_joints::<I>(readings, scratch);
        I::call(Sweep { aimed: self, alone, columns: None, scratch })
    }
}

/// An evaluation at `scratch.inputs`.
struct Sweep<'a> {
    aimed: &'a Aimed,
    alone: bool,
    columns: Option<&'a [usize]>,
    scratch: &'a mut AimedScratch,
}

impl Kernel for Sweep<'_> {
    type Output = LaneFrame;

    #[inline(always)]
    fn run<I: Isa>(self) -> LaneFrame {
        let Self { aimed: Aimed { model, chain, .. }, alone, columns, scratch } = self;
        let AimedScratch { inputs, rows, parameters, one, screws, field, .. } = scratch;
        let (count, width) = (if alone { 1 } else { LANES }, chain.parameter_count());
        let rows = &mut rows[..];
        if let (Some(bank), Some(room)) = (&model.field, field) {
            for row in rows.chunks_exact_mut(width).take(count) {
                row.copy_from_slice(&model.constants);
            }
            bank.excite_and_add::<I>(inputs, room, &mut rows[..count * width]);
        }
        let joints = &inputs[..chain.joint_count()];
        let parameters = match (&model.field, alone) {
            (None, false) => LaneParameters::Shared(&model.shared),
            (Some(_), false) => {
                load_lanes::<I>(rows, width, 0, parameters);
                LaneParameters::Each(&parameters[..width])
            }
            (None, true) => {
                one.move_to::<I>(chain, joints);
                LaneParameters::One(one)
            }
            (Some(_), true) => {
                one.set::<I>(chain, joints, &rows[..width]);
                LaneParameters::One(one)
            }
        };
        let Some(columns) = columns else { return chain.end_frame::<I>(joints, parameters) };
        let mut frame = LaneFrame::splat(&Transform::IDENTITY);
        chain.sweep::<I>(joints, parameters, columns, &mut frame, screws);
        frame
    }
}
