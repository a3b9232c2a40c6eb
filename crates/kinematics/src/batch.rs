//! Many poses at once: checks, threads, and the loop over groups of eight.

use std::num::NonZeroUsize;

use rayon::prelude::*;

use crate::chain::Chain;
use crate::error::KinematicsError;
use crate::isa::dispatch;
use crate::lane::LANES;
use crate::parameters::{Parameters, SharedParameters};
use crate::piece::{Piece, Source};
use crate::quantity::{Jacobian, Pose, Position, Quantity};

/// Numbers of a result too large to stay in the caches until it is read: 16 MB.
///
/// Smaller results gain nothing by being streamed, and whoever reads them next would wait for the memory.
const STREAM_FROM: usize = 1 << 21;

/// A chain with a bound on the threads to use.
#[derive(Debug, Clone, Copy)]
pub struct Batch<'a> {
    chain: &'a Chain,
    threads: usize,
}

impl Chain {
    /// Batches on at most `threads` threads; `None`: as many as rayon has. Small batches use one.
    pub fn batch(&self, threads: Option<NonZeroUsize>) -> Batch<'_> {
        Batch { chain: self, threads: threads.map_or(usize::MAX, NonZeroUsize::get) }
    }

    /// See [`Batch::positions`].
    ///
    /// # Errors
    /// [`KinematicsError::Length`].
    pub fn positions(
        &self,
        joints: &[f64],
        parameters: Parameters<'_>,
        out: &mut [f64],
    ) -> Result<(), KinematicsError> {
        self.batch(None).positions(joints, parameters, out)
    }

    /// See [`Batch::poses`].
    ///
    /// # Errors
    /// [`KinematicsError::Length`].
    pub fn poses(
        &self,
        joints: &[f64],
        parameters: Parameters<'_>,
        out: &mut [f64],
    ) -> Result<(), KinematicsError> {
        self.batch(None).poses(joints, parameters, out)
    }

    /// See [`Batch::position_jacobian`].
    ///
    /// # Errors
    /// [`KinematicsError::Length`].
    pub fn position_jacobian(
        &self,
        joints: &[f64],
        parameters: Parameters<'_>,
        out: &mut [f64],
    ) -> Result<(), KinematicsError> {
        self.batch(None).position_jacobian(joints, parameters, out)
    }

    /// See [`Batch::pose_jacobian`].
    ///
    /// # Errors
    /// [`KinematicsError::Length`].
    pub fn pose_jacobian(
        &self,
        joints: &[f64],
        parameters: Parameters<'_>,
        out: &mut [f64],
    ) -> Result<(), KinematicsError> {
        self.batch(None).pose_jacobian(joints, parameters, out)
    }

    /// See [`Batch::joint_position_jacobian`].
    ///
    /// # Errors
    /// [`KinematicsError::Length`].
    pub fn joint_position_jacobian(
        &self,
        joints: &[f64],
        parameters: Parameters<'_>,
        out: &mut [f64],
    ) -> Result<(), KinematicsError> {
        self.batch(None).joint_position_jacobian(joints, parameters, out)
    }

    /// See [`Batch::joint_pose_jacobian`].
    ///
    /// # Errors
    /// [`KinematicsError::Length`].
    pub fn joint_pose_jacobian(
        &self,
        joints: &[f64],
        parameters: Parameters<'_>,
        out: &mut [f64],
    ) -> Result<(), KinematicsError> {
        self.batch(None).joint_pose_jacobian(joints, parameters, out)
    }
}

/// `joints` are n x J joint values, row-major; a joint's value is added to theta or d of its link. The results
/// do not depend on the number of threads. Every method fails with [`KinematicsError::Length`] if the length
/// of an array does not fit, with nothing written.
impl Batch<'_> {
    /// Origin of the end in the base frame, n x 3, metres.
    ///
    /// # Errors
    /// [`KinematicsError::Length`].
    pub fn positions(
        &self,
        joints: &[f64],
        parameters: Parameters<'_>,
        out: &mut [f64],
    ) -> Result<(), KinematicsError> {
        self.run(Position, joints, parameters, out)
    }

    /// base_from_end as homogeneous matrices, n x 4 x 4.
    ///
    /// # Errors
    /// [`KinematicsError::Length`].
    pub fn poses(
        &self,
        joints: &[f64],
        parameters: Parameters<'_>,
        out: &mut [f64],
    ) -> Result<(), KinematicsError> {
        self.run(Pose, joints, parameters, out)
    }

    /// Derivative of the position with respect to all parameters, n x 3 x 5 L, base frame.
    ///
    /// # Errors
    /// [`KinematicsError::Length`].
    pub fn position_jacobian(
        &self,
        joints: &[f64],
        parameters: Parameters<'_>,
        out: &mut [f64],
    ) -> Result<(), KinematicsError> {
        self.jacobian(3, joints, parameters, out)
    }

    /// Derivative of the pose with respect to all parameters, n x 6 x 5 L.
    ///
    /// Rows 0 to 2 are the position, 3 to 5 the rotation vector w in the base frame: R becomes exp(w) R.
    ///
    /// # Errors
    /// [`KinematicsError::Length`].
    pub fn pose_jacobian(
        &self,
        joints: &[f64],
        parameters: Parameters<'_>,
        out: &mut [f64],
    ) -> Result<(), KinematicsError> {
        self.jacobian(6, joints, parameters, out)
    }

    /// Derivative of the position with respect to the joint values, n x 3 x J, base frame.
    ///
    /// # Errors
    /// [`KinematicsError::Length`].
    pub fn joint_position_jacobian(
        &self,
        joints: &[f64],
        parameters: Parameters<'_>,
        out: &mut [f64],
    ) -> Result<(), KinematicsError> {
        let quantity = Jacobian { columns: self.chain.joint_columns(), rows: 3 };
        self.run(quantity, joints, parameters, out)
    }

    /// Derivative of the pose with respect to the joint values, n x 6 x J, rows as in [`Batch::pose_jacobian`].
    ///
    /// # Errors
    /// [`KinematicsError::Length`].
    pub fn joint_pose_jacobian(
        &self,
        joints: &[f64],
        parameters: Parameters<'_>,
        out: &mut [f64],
    ) -> Result<(), KinematicsError> {
        let quantity = Jacobian { columns: self.chain.joint_columns(), rows: 6 };
        self.run(quantity, joints, parameters, out)
    }

    fn jacobian(
        &self,
        rows: usize,
        joints: &[f64],
        parameters: Parameters<'_>,
        out: &mut [f64],
    ) -> Result<(), KinematicsError> {
        let columns: Vec<usize> = (0..self.chain.parameter_count()).collect();
        self.run(Jacobian { columns: &columns, rows }, joints, parameters, out)
    }

    fn run<Q: Quantity>(
        &self,
        quantity: Q,
        joints: &[f64],
        parameters: Parameters<'_>,
        out: &mut [f64],
    ) -> Result<(), KinematicsError> {
        let poses = self.check(quantity.width(), joints, parameters, out)?;
        let prepared;
        let source = match parameters {
            Parameters::One(values) => {
                prepared = SharedParameters::new(values);
                Source::Shared(&prepared)
            }
            Parameters::Prepared(shared) => Source::Shared(shared),
            Parameters::Each(values) => Source::Each(values),
        };
        let width = quantity.width();
        let stream = out.len() >= STREAM_FROM;
        let work = |first: usize, out: &mut [f64]| {
            dispatch(Piece { chain: self.chain, quantity, joints, source, first, out, stream });
        };
        if poses < quantity.parallel_from() || self.threads == 1 {
            work(0, out);
            return Ok(());
        }
        let groups = poses.div_ceil(LANES).div_ceil(self.threads.min(rayon::current_num_threads()));
        let pieces = out.par_chunks_mut(groups * LANES * width).enumerate();
        pieces.for_each(|(index, out)| work(index * groups * LANES, out));
        Ok(())
    }

    /// The number of poses, if all lengths fit.
    fn check(
        &self,
        width: usize,
        joints: &[f64],
        parameters: Parameters<'_>,
        out: &[f64],
    ) -> Result<usize, KinematicsError> {
        let (count, all) = (self.chain.joint_count(), self.chain.parameter_count());
        let poses = joints.len() / count;
        if joints.len() != poses * count {
            return Err(length(
                "joints",
                joints.len(),
                format!("it must be a multiple of the {count} joints"),
            ));
        }
        let (got, wanted, rule) = match parameters {
            Parameters::One(values) => (values.len(), all, five_a_link(all)),
            Parameters::Prepared(shared) => (shared.len(), all, five_a_link(all)),
            Parameters::Each(values) => (
                values.len(),
                poses * all,
                format!("it must be {poses} x {all}, five for each link of each pose"),
            ),
        };
        if got != wanted {
            return Err(length("parameters", got, rule));
        }
        if out.len() != poses * width {
            return Err(length("out", out.len(), format!("it must be {poses} x {width}")));
        }
        Ok(poses)
    }
}

fn five_a_link(all: usize) -> String {
    format!("it must be {all}, five for each link")
}

fn length(name: &'static str, got: usize, rule: String) -> KinematicsError {
    KinematicsError::Length { name, got, rule }
}
