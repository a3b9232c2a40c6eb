//! Residuals and their derivatives, eight poses at a time, in the robot's base frame.
//!
//! With p the predicted target in base, a change of the unknowns moves it by
//! `screw.linear + screw.angular x r` for a link parameter (r from flange origin to target),
//! `rho + phi x p` for a frame that is turned from the right by (rho, phi), and `base_from_flange dt` for
//! the target point. Orientation residuals are `log(R_measured R_predicted^T)`; their derivative is taken
//! at zero residual, where log's Jacobian is the identity.

use truearm_kinematics::{
    Isa, Kernel, Lane, LaneFrame, LaneParameters, Screw, SharedParameters, Transform, dispatch, lane_cross,
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

impl Point<'_> {
    /// Checks that parameters and set-ups are a problem's.
    ///
    /// # Errors
    /// [`EstimateError::Parameters`], [`EstimateError::Setup`].
    pub fn check(&self, problem: &Problem) -> Result<(), EstimateError> {
        let (found, expected) = (self.parameters.len(), problem.chain.parameter_count());
        if found != expected && found != expected * problem.measurements.pose_count() {
            return Err(EstimateError::Parameters { found, expected });
        }
        self.setup.check(&Layout::new(problem))
    }
}

/// Square roots of the weights of one packet's rows.
struct Weights {
    /// Along x, y and z: of the device where sigmas differ along these, else of the base, and all alike.
    position: [Lane; 3],
    orientation: Lane,
}

/// Scratch of a sweep through the chain, reused from packet to packet.
pub struct Sweep {
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
    /// Whether rows of positions are weighted along the axes of the device.
    by_device: bool,
}

/// Noise and weight of each pose (n,); `None` leaves the rows unweighted.
pub type Weighting<'a> = Option<(Noise, &'a [f64])>;

impl<'a> RowBuilder<'a> {
    /// Rows of a problem at a point, weighted or not.
    pub fn new(problem: &'a Problem<'a>, point: Point<'a>, weighting: Weighting<'a>) -> Self {
        let one = point.parameters.len() == problem.chain.parameter_count();
        let shared = one.then(|| SharedParameters::new(point.parameters));
        let by_device = weighting.is_some() && problem.measurements.differs_by_axis();
        Self { layout: Layout::new(problem), point, problem, weighting, shared, by_device }
    }

    /// Columns of a packet: arm, the group's unknowns, the residual.
    pub fn width(&self) -> usize {
        self.layout.arm + self.layout.group_width() + 1
    }

    /// Rows of a pose, m.
    pub fn rows(&self) -> usize {
        self.problem.measurements.rows_per_pose()
    }

    #[inline(always)]
    fn weights(&self, packet: &Packet) -> Weights {
        let Some((noise, weight)) = self.weighting else {
            return Weights { position: [Lane::splat(1.0); 3], orientation: Lane::splat(1.0) };
        };
        let of = |noise: f64, sigma: &Lane| {
            Lane(std::array::from_fn(|lane| {
                row_weight(noise, sigma.0[lane], weight[packet.poses[lane]]).sqrt()
            }))
        };
        let position = if self.by_device {
            std::array::from_fn(|k| of(noise.position, &packet.sigma[k]))
        } else {
            [of(noise.position, &packet.sigma[0]); 3]
        };
        Weights { position, orientation: of(noise.orientation, &packet.sigma[3]) }
    }

    /// Scratch for [`RowBuilder::fill`].
    pub fn scratch(&self) -> Sweep {
        let frame = LaneFrame::splat(&Transform::IDENTITY);
        Sweep { frame, screws: vec![Screw::ZERO; self.problem.columns.len()] }
    }

    #[inline(always)]
    fn sweep<I: Isa>(&self, packet: &Packet, sweep: &mut Sweep) {
        let columns = self.problem.columns;
        let chain = self.problem.chain;
        let lanes;
        let parameters = match &self.shared {
            Some(shared) => LaneParameters::Shared(shared),
            None => {
                lanes = self.lanes_of_parameters(packet);
                LaneParameters::Each(&lanes)
            }
        };
        chain.sweep_again::<I>(packet.joints, parameters, columns, &mut sweep.frame, &mut sweep.screws);
    }

    fn lanes_of_parameters(&self, packet: &Packet) -> Vec<Lane> {
        let width = self.problem.chain.parameter_count();
        (0..width).map(|k| Lane(packet.poses.map(|pose| self.point.parameters[pose * width + k]))).collect()
    }

    /// Writes the packet's rows from `row` on.
    #[inline(always)]
    pub fn fill<I: Isa>(
        &self,
        packet: &Packet,
        group: &GroupSetup,
        sweep: &mut Sweep,
        columns: &mut Columns,
        row: usize,
    ) {
        self.sweep::<I>(packet, sweep);
        let weights = self.weights(packet);
        for target in 0..self.problem.measurements.target_count {
            let (present, place) = (packet.present[target], row + 3 * target);
            let weight = if self.by_device { present } else { present * weights.position[0] };
            self.target_rows::<I>(packet, group, sweep, (target, weight), columns, place);
            if self.by_device {
                self.weigh_by_device::<I>(group, &weights.position, columns, place);
            }
        }
        if self.layout.rotation == 3 {
            let weight = packet.present[self.problem.measurements.target_count] * weights.orientation;
            self.rotation_rows::<I>(packet, group, sweep, weight, columns, row + 3 * self.layout.targets);
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
        let arm = rotate::<I>(&sweep.frame.rotation, &Lane::splat_all(&group.targets[target]));
        let mut point = sweep.frame.position;
        for (coordinate, offset) in point.iter_mut().zip(arm) {
            *coordinate += offset;
        }
        for (column, screw) in sweep.screws.iter().enumerate() {
            let turned = lane_cross::<I>(&screw.angular, &arm);
            for k in 0..3 {
                columns.set(column, row + k, weight * (screw.linear[k] + turned[k]));
            }
        }
        let mut column = self.layout.arm;
        let zero = Lane::splat(0.0);
        if self.layout.frame == 6 {
            let (x, y, z) = (weight * point[0], weight * point[1], weight * point[2]);
            let block = [
                [weight, zero, zero, zero, z, -y],
                [zero, weight, zero, -z, zero, x],
                [zero, zero, weight, y, -x, zero],
            ];
            set_block(columns, column, row, &block);
            column += 6;
        }
        for other in 0..self.layout.targets {
            let here = if other == target { weight } else { zero };
            set_rotation(columns, column + 3 * other, row, (here, &sweep.frame.rotation));
        }
        column += 3 * self.layout.targets;
        for _ in 0..self.layout.rotation {
            set_block(columns, column, row, &[[zero], [zero], [zero]]);
            column += 1;
        }
        let measured = into_base::<I>(&group.world_from_base, &packet.targets[3 * target..3 * target + 3]);
        for k in 0..3 {
            columns.set(column, row + k, weight * (measured[k] - point[k]));
        }
    }

    /// Turns a target's three rows from `row` on to the axes of the device, and weighs them along these.
    #[inline(always)]
    fn weigh_by_device<I: Isa>(
        &self,
        group: &GroupSetup,
        weights: &[Lane; 3],
        columns: &mut Columns,
        row: usize,
    ) {
        let world_from_base = Lane::splat_all(&group.world_from_base.rotation);
        for column in 0..self.width() {
            let in_base = std::array::from_fn(|k| columns.get(column, row + k));
            let in_world = rotate::<I>(&world_from_base, &in_base);
            for k in 0..3 {
                columns.set(column, row + k, weights[k] * in_world[k]);
            }
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
        let predicted = product::<I>(&sweep.frame.rotation, &Lane::splat_all(&group.flange_from_target));
        set_rotation(columns, column, row, (weight, &predicted));
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

/// Three columns: a weight times a rotation.
#[inline(always)]
fn set_rotation(columns: &mut Columns, column: usize, row: usize, (weight, rotation): (Lane, &[Lane; 9])) {
    for (k, &entry) in rotation.iter().enumerate() {
        columns.set(column + k % 3, row + k / 3, weight * entry);
    }
}

#[inline(always)]
fn rotate<I: Isa>(rotation: &[Lane; 9], vector: &[Lane; 3]) -> [Lane; 3] {
    let mut out = [Lane::ZERO; 3];
    for (i, value) in out.iter_mut().enumerate() {
        let partial = rotation[3 * i] * vector[0];
        let partial = I::mul_add(rotation[3 * i + 1], vector[1], partial);
        *value = I::mul_add(rotation[3 * i + 2], vector[2], partial);
    }
    out
}

#[inline(always)]
fn product<I: Isa>(left: &[Lane; 9], right: &[Lane; 9]) -> [Lane; 9] {
    let mut out = [Lane::ZERO; 9];
    for j in 0..3 {
        let column = rotate::<I>(left, &[right[j], right[3 + j], right[6 + j]]);
        for i in 0..3 {
            out[3 * i + j] = column[i];
        }
    }
    out
}

/// A world point in base coordinates.
#[inline(always)]
fn into_base<I: Isa>(world_from_base: &Transform, point: &[Lane]) -> [Lane; 3] {
    let inverse = world_from_base.inverse();
    let mut out = rotate::<I>(&Lane::splat_all(&inverse.rotation), &[point[0], point[1], point[2]]);
    for (value, shift) in out.iter_mut().zip(inverse.translation) {
        *value += Lane::splat(shift);
    }
    out
}

fn rotation_residual(packet: &Packet, world_from_base: &Transform, predicted: &[Lane; 9]) -> [Lane; 3] {
    let base_from_world = world_from_base.inverse();
    let mut residual = [Lane::splat(0.0); 3];
    for lane in 0..packet.count {
        let measured = Transform {
            rotation: std::array::from_fn(|k| packet.rotation[k].0[lane]),
            translation: [0.0; 3],
        };
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
    /// Derivatives too, not the residuals alone.
    derivatives: bool,
    out: &'a mut Linearised,
}

impl Kernel for Unpack<'_> {
    type Output = ();

    #[inline(always)]
    fn run<I: Isa>(self) {
        let Self { builder, packets, derivatives, out } = self;
        let (rows, width) = (builder.rows(), builder.width());
        let (arm, setup) = (builder.layout.arm, builder.layout.group_width());
        let mut columns = Columns::new(width, rows);
        let mut sweep = builder.scratch();
        for chunk in &packets.chunks {
            let group = &builder.point.setup.groups[chunk.group];
            for packet in packets.of(chunk) {
                builder.fill::<I>(&packet, group, &mut sweep, &mut columns, 0);
                for (lane, pose) in packet.poses[..packet.count].iter().enumerate() {
                    for row in 0..rows {
                        let at = pose * rows + row;
                        out.residual[at] = columns.get(arm + setup, row).0[lane];
                        if derivatives {
                            (0..arm).for_each(|c| out.arm[at * arm + c] = columns.get(c, row).0[lane]);
                            (0..setup)
                                .for_each(|c| out.setup[at * setup + c] = columns.get(arm + c, row).0[lane]);
                        }
                    }
                }
            }
        }
    }
}

/// Residuals and derivatives of all poses at a point, unweighted, in the base frame.
///
/// # Errors
/// [`EstimateError::Parameters`], [`EstimateError::Setup`] where the point is another problem's.
pub fn linearise(problem: &Problem, point: Point) -> Result<Linearised, EstimateError> {
    point.check(problem)?;
    if problem.measurements.is_distances() {
        return Err(EstimateError::Distances);
    }
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
    dispatch(Unpack { builder, packets: &packets, derivatives: true, out: &mut out });
    Ok(out)
}

/// Residuals measured - predicted of all poses, (n, m), unweighted, in the base frame; of distances (d,).
///
/// # Errors
/// [`EstimateError::Parameters`], [`EstimateError::Setup`] where the point is another problem's,
/// [`EstimateError::Kinematics`] where the chain refuses the joint values.
pub fn residuals(problem: &Problem, point: Point) -> Result<Vec<f64>, EstimateError> {
    point.check(problem)?;
    residuals_of(problem, &Packets::new(problem.measurements), point)
}

/// [`residuals`] of measurements that are sorted into lanes already.
///
/// # Errors
/// [`EstimateError::Kinematics`] where the chain refuses the joint values.
pub fn residuals_of(problem: &Problem, packets: &Packets, point: Point) -> Result<Vec<f64>, EstimateError> {
    if problem.measurements.is_distances() {
        return distance::residuals(problem, point);
    }
    let alone = problem.with_columns(&[]);
    let builder = RowBuilder::new(&alone, point, None);
    let (n, rows) = (problem.measurements.pose_count(), problem.measurements.rows_per_pose());
    let mut out = Linearised { rows, arm: Vec::new(), setup: Vec::new(), residual: vec![0.0; n * rows] };
    dispatch(Unpack { builder, packets, derivatives: false, out: &mut out });
    Ok(out.residual)
}
