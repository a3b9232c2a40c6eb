//! Residuals and their derivatives, eight poses at a time, in the robot's base frame.
//!
//! With p the predicted target in base, a change of the unknowns moves it by
//! `screw.linear + screw.angular x r` for a link parameter (r from flange origin to target),
//! `rho + phi x p` for a frame that is turned from the right by (rho, phi), and `base_from_flange dt` for
//! the target point. Orientation residuals are `log(R_measured R_predicted^T)`; their derivative is taken
//! at zero residual, where log's Jacobian is the identity.

use truearm_kinematics::{
    Isa, Kernel, Lane, LaneFrame, LaneParameters, Screw, SharedParameters, Transform, dispatch,
};

use crate::EstimateError;
use crate::distance;
use crate::layout::{Layout, Problem};
use crate::measurements::Noise;
use crate::noise::row_weight;
use crate::normal::Columns;
use crate::packets::{Packet, Packets};
use crate::setup::{GroupSetup, Setup};

/// What the derivatives are taken at.
#[derive(Clone, Copy)]
pub struct Point<'a> {
    /// Link parameters, absolute: (5 L,) for all poses, or (n, 5 L) when they vary.
    pub parameters: &'a [f64],
    /// The set-ups.
    pub setup: &'a Setup,
}

/// Square roots of the weights of one packet's rows.
struct Weights {
    position: Lane,
    orientation: Lane,
}

/// Scratch of a sweep through the chain.
struct Sweep {
    frame: LaneFrame,
    screws: Vec<Screw>,
}

/// Fills the columns of the rows of one packet.
pub struct RowBuilder<'a> {
    pub layout: Layout,
    pub point: Point<'a>,
    problem: &'a Problem<'a>,
    weighting: Weighting<'a>,
    shared: Option<SharedParameters>,
}

/// Noise and weight of each pose (n,); `None` leaves the rows unweighted.
pub type Weighting<'a> = Option<(Noise, &'a [f64])>;

impl<'a> RowBuilder<'a> {
    pub fn new(problem: &'a Problem<'a>, point: Point<'a>, weighting: Weighting<'a>) -> Self {
        let one = point.parameters.len() == problem.chain.parameter_count();
        let shared = one.then(|| SharedParameters::new(point.parameters));
        Self { layout: Layout::new(problem), point, problem, weighting, shared }
    }

    /// Columns of a packet: arm, the group's unknowns, the residual.
    pub fn width(&self) -> usize {
        self.layout.arm + self.layout.group_width() + 1
    }

    pub fn rows(&self) -> usize {
        self.problem.measurements.rows_per_pose()
    }

    #[inline(always)]
    fn weights(&self, packet: &Packet) -> Weights {
        let Some((noise, weight)) = self.weighting else {
            return Weights { position: Lane::splat(1.0), orientation: Lane::splat(1.0) };
        };
        let of = |noise: f64, sigma: &dyn Fn(usize) -> f64| {
            Lane(std::array::from_fn(|lane| {
                row_weight(noise, sigma(lane), weight[packet.poses[lane]]).sqrt()
            }))
        };
        Weights {
            position: of(noise.position, &|lane| packet.sigma.0[lane]),
            orientation: of(noise.orientation, &|_| 0.0),
        }
    }

    #[inline(always)]
    fn sweep<I: Isa>(&self, packet: &Packet) -> Sweep {
        let columns = self.problem.columns;
        let start = LaneFrame::splat(&Transform::IDENTITY);
        let mut sweep = Sweep { frame: start, screws: vec![Screw::ZERO; columns.len()] };
        let chain = self.problem.chain;
        let parameters = match &self.shared {
            Some(shared) => LaneParameters::Shared(shared),
            None => LaneParameters::Each(&self.lanes_of_parameters(packet)),
        };
        chain.sweep::<I>(&packet.joints, parameters, columns, &mut sweep.frame, &mut sweep.screws);
        sweep
    }

    fn lanes_of_parameters(&self, packet: &Packet) -> Vec<Lane> {
        let width = self.problem.chain.parameter_count();
        (0..width).map(|k| Lane(packet.poses.map(|pose| self.point.parameters[pose * width + k]))).collect()
    }

    /// Writes the packet's rows from `row` on.
    #[inline(always)]
    pub fn fill<I: Isa>(&self, packet: &Packet, group: &GroupSetup, columns: &mut Columns, row: usize) {
        let sweep = self.sweep::<I>(packet);
        let weights = self.weights(packet);
        for target in 0..self.problem.measurements.target_count {
            let weight = packet.present[target] * weights.position;
            self.target_rows::<I>(packet, group, &sweep, (target, weight), columns, row + 3 * target);
        }
        if self.layout.rotation == 3 {
            let weight = packet.present[self.problem.measurements.target_count] * weights.orientation;
            self.rotation_rows::<I>(packet, group, &sweep, weight, columns, row + 3 * self.layout.targets);
        }
    }

    #[inline(always)]
    fn target_rows<I: Isa>(
        &self,
        packet: &Packet,
        group: &GroupSetup,
        sweep: &Sweep,
        (target, weight): (usize, Lane),
        columns: &mut Columns,
        row: usize,
    ) {
        let arm = rotate::<I>(&sweep.frame.rotation, &group.targets[target].map(Lane::splat));
        let point: [Lane; 3] = std::array::from_fn(|k| sweep.frame.position[k] + arm[k]);
        for (column, screw) in sweep.screws.iter().enumerate() {
            let turned = cross::<I>(&screw.angular, &arm);
            for k in 0..3 {
                columns.set(column, row + k, weight * (screw.linear[k] + turned[k]));
            }
        }
        let mut column = self.layout.arm;
        let zero = Lane::splat(0.0);
        if self.layout.frame == 6 {
            let [x, y, z] = point.map(|coordinate| weight * coordinate);
            let block = [
                [weight, zero, zero, zero, z, zero - y],
                [zero, weight, zero, zero - z, zero, x],
                [zero, zero, weight, y, zero - x, zero],
            ];
            set_block(columns, column, row, &block);
            column += 6;
        }
        for other in 0..self.layout.targets {
            let here = if other == target { weight } else { zero };
            let block: [[Lane; 3]; 3] =
                std::array::from_fn(|i| std::array::from_fn(|j| here * sweep.frame.rotation[3 * i + j]));
            set_block(columns, column + 3 * other, row, &block);
        }
        column += 3 * self.layout.targets;
        for _ in 0..self.layout.rotation {
            set_block(columns, column, row, &[[zero], [zero], [zero]]);
            column += 1;
        }
        let measured = into_base::<I>(&group.world_from_base, &packet.targets[target]);
        for k in 0..3 {
            columns.set(column, row + k, weight * (measured[k] - point[k]));
        }
    }

    #[inline(always)]
    fn rotation_rows<I: Isa>(
        &self,
        packet: &Packet,
        group: &GroupSetup,
        sweep: &Sweep,
        weight: Lane,
        columns: &mut Columns,
        row: usize,
    ) {
        let zero = Lane::splat(0.0);
        for (column, screw) in sweep.screws.iter().enumerate() {
            for k in 0..3 {
                columns.set(column, row + k, weight * screw.angular[k]);
            }
        }
        let mut column = self.layout.arm;
        if self.layout.frame == 6 {
            let turn = |i: usize| std::array::from_fn(|j| if j == i + 3 { weight } else { zero });
            set_block(columns, column, row, &[turn(0), turn(1), turn(2)] as &[[Lane; 6]; 3]);
            column += 6;
        }
        for _ in 0..3 * self.layout.targets {
            set_block(columns, column, row, &[[zero], [zero], [zero]]);
            column += 1;
        }
        let predicted = product::<I>(&sweep.frame.rotation, &group.flange_from_target.map(Lane::splat));
        let block: [[Lane; 3]; 3] =
            std::array::from_fn(|i| std::array::from_fn(|j| weight * predicted[3 * i + j]));
        set_block(columns, column, row, &block);
        let residual = rotation_residual(packet, &group.world_from_base, &predicted);
        for k in 0..3 {
            columns.set(column + 3, row + k, weight * residual[k]);
        }
    }
}

#[inline(always)]
fn set_block<const W: usize>(columns: &mut Columns, column: usize, row: usize, block: &[[Lane; W]; 3]) {
    for (i, line) in block.iter().enumerate() {
        for (j, &value) in line.iter().enumerate() {
            columns.set(column + j, row + i, value);
        }
    }
}

#[inline(always)]
fn rotate<I: Isa>(rotation: &[Lane; 9], vector: &[Lane; 3]) -> [Lane; 3] {
    std::array::from_fn(|i| {
        let partial = rotation[3 * i] * vector[0];
        let partial = I::mul_add(rotation[3 * i + 1], vector[1], partial);
        I::mul_add(rotation[3 * i + 2], vector[2], partial)
    })
}

#[inline(always)]
fn product<I: Isa>(left: &[Lane; 9], right: &[Lane; 9]) -> [Lane; 9] {
    let columns: [[Lane; 3]; 3] =
        std::array::from_fn(|j| rotate::<I>(left, &[right[j], right[3 + j], right[6 + j]]));
    std::array::from_fn(|k| columns[k % 3][k / 3])
}

#[inline(always)]
fn cross<I: Isa>(a: &[Lane; 3], b: &[Lane; 3]) -> [Lane; 3] {
    std::array::from_fn(|k| {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        I::mul_add(a[i], b[j], Lane::splat(0.0) - a[j] * b[i])
    })
}

/// A world point in base coordinates.
#[inline(always)]
fn into_base<I: Isa>(world_from_base: &Transform, point: &[Lane; 3]) -> [Lane; 3] {
    let inverse = world_from_base.inverse();
    let rotated = rotate::<I>(&inverse.rotation.map(Lane::splat), point);
    std::array::from_fn(|k| rotated[k] + Lane::splat(inverse.translation[k]))
}

fn rotation_residual(packet: &Packet, world_from_base: &Transform, predicted: &[Lane; 9]) -> [Lane; 3] {
    let base_from_world = world_from_base.inverse();
    let mut residual = [Lane::splat(0.0); 3];
    for lane in 0..packet.count {
        let measured =
            Transform { rotation: packet.rotation.map(|entry| entry.0[lane]), translation: [0.0; 3] };
        if measured.rotation.iter().all(|&entry| entry == 0.0) {
            continue;
        }
        let predicted = Transform { rotation: predicted.map(|entry| entry.0[lane]), translation: [0.0; 3] };
        let difference = base_from_world.compose(&measured).compose(&predicted.inverse());
        for (k, value) in difference.rotation_vector().into_iter().enumerate() {
            residual[k].0[lane] = value;
        }
    }
    residual
}

/// Unweighted rows of all poses, (n, m, ...), m rows a pose: three a target, then three of orientation.
#[derive(Debug, Clone)]
pub struct Linearised {
    /// Rows of each pose, m.
    pub rows: usize,
    /// d prediction / d link parameter, (n, m, P), base frame; zero where nothing was measured.
    pub arm: Vec<f64>,
    /// d prediction / d the group's unknowns, (n, m, W).
    pub setup: Vec<f64>,
    /// measured - predicted, (n, m), base frame; zero where nothing was measured.
    pub residual: Vec<f64>,
}

struct Unpack<'a> {
    builder: RowBuilder<'a>,
    packets: &'a Packets,
    out: &'a mut Linearised,
}

impl Kernel for Unpack<'_> {
    type Output = ();

    fn run<I: Isa>(self) {
        let Self { builder, packets, out } = self;
        let (rows, width) = (builder.rows(), builder.width());
        let (arm, setup) = (builder.layout.arm, builder.layout.group_width());
        let mut columns = Columns::new(width, rows);
        for chunk in &packets.chunks {
            let group = &builder.point.setup.groups[chunk.group];
            for packet in packets.of(chunk) {
                builder.fill::<I>(packet, group, &mut columns, 0);
                for lane in 0..packet.count {
                    for row in 0..rows {
                        let at = packet.poses[lane] * rows + row;
                        let value = |column| columns.get(column, row).0[lane];
                        (0..arm).for_each(|c| out.arm[at * arm + c] = value(c));
                        (0..setup).for_each(|c| out.setup[at * setup + c] = value(arm + c));
                        out.residual[at] = value(arm + setup);
                    }
                }
            }
        }
    }
}

/// Residuals and derivatives of all poses at a point, unweighted, in the base frame.
pub fn linearise(problem: &Problem, point: Point) -> Linearised {
    let layout = Layout::new(problem);
    let (n, rows) = (problem.measurements.pose_count(), problem.measurements.rows_per_pose());
    let mut out = Linearised {
        rows,
        arm: vec![0.0; n * rows * layout.arm],
        setup: vec![0.0; n * rows * layout.group_width()],
        residual: vec![0.0; n * rows],
    };
    let builder = RowBuilder::new(problem, point, None);
    let packets = Packets::new(problem.measurements);
    dispatch(Unpack { builder, packets: &packets, out: &mut out });
    out
}

/// Residuals measured - predicted of all poses, (n, m), unweighted, in the base frame; of distances (d,).
///
/// # Errors
/// [`EstimateError::Kinematics`] where the chain refuses the joint values.
pub fn residuals(problem: &Problem, point: Point) -> Result<Vec<f64>, EstimateError> {
    if problem.measurements.is_distances() {
        return distance::residuals(problem, point);
    }
    Ok(linearise(&problem.with_columns(&[]), point).residual)
}
