//! A calibration as models of an arm: the calibrated one and the one that programs are written for.

use std::sync::Arc;

use truearm_bank::{Axis, Bank, Block, Conservative, ConservativeParts, Grid, Leverage, Levers, UPRIGHT};
use truearm_compensate::{Limits, Model, Spread};
use truearm_kinematics::{Chain, Convention, Joint, Link, Transform};

use crate::container::Container;
use crate::content::{BlockContent, ConservativeContent, Content, Head, RobotContent};
use crate::load_error::LoadError;

/// Version of the layout that is read.
pub const SCHEMA: u64 = 1;
/// Names of the models, the best first.
const MODELS: [&str; 2] = ["variable", "constant"];

/// What a controller needs of a calibration.
#[derive(Debug, Clone)]
pub struct Loaded {
    /// Name of the arm.
    pub name: String,
    /// The identified arm.
    pub calibrated: Arc<Model>,
    /// The arm that programs are written for: the nominal one.
    pub programming: Arc<Model>,
    /// The robot file's own tool, flange_from_tool.
    pub tool: Transform,
    /// Lowest and highest reading of each joint.
    pub joint_limits: Vec<[f64; 2]>,
    /// Names of the features that predictions need.
    pub features: Vec<String>,
}

impl Loaded {
    /// Reads the bytes of a calibration file.
    ///
    /// # Errors
    /// [`LoadError`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, LoadError> {
        let container = Container::new(bytes)?;
        let head: Head = container.content()?;
        if head.schema != SCHEMA {
            return Err(LoadError::Schema { found: head.schema, known: SCHEMA, version: head.version });
        }
        let content: Content = container.content()?;
        if content.scheme.is_some() {
            return Err(LoadError::UnknownModel);
        }
        let robot = &content.robot;
        let coupling = square(&robot.coupling)?;
        let nominal = chain(robot, false)?;
        let programming = Model::new(nominal.clone(), &nominal.nominal(), &coupling)?;
        let limit =
            |row: &[Option<f64>; 2]| [row[0].unwrap_or(f64::NEG_INFINITY), row[1].unwrap_or(f64::INFINITY)];
        let joint_limits: Vec<[f64; 2]> = robot.limits.iter().map(limit).collect();
        if joint_limits.len() != nominal.joint_count() {
            return Err(incomplete("it has not one pair of limits a joint"));
        }
        Ok(Self {
            name: robot.name.clone(),
            calibrated: Arc::new(calibrated(&container, &content, &coupling)?),
            programming: Arc::new(programming),
            tool: transform(&robot.tool),
            joint_limits,
            features: content.options.features.clone(),
        })
    }

    /// Bounds of corrections: the defaults, with the robot's joint limits.
    pub fn limits(&self) -> Limits {
        Limits { joints: self.joint_limits.clone(), ..Limits::default() }
    }
}

fn calibrated(container: &Container, content: &Content, coupling: &[f64]) -> Result<Model, LoadError> {
    let name = MODELS.into_iter().find(|name| content.models.contains_key(*name));
    let name = name.ok_or_else(|| incomplete("it has no model"))?;
    let chain = chain(&content.robot, content.options.frame == "world")?;
    let (inputs, width) = (chain.joint_count() + content.options.features.len(), chain.parameter_count());
    let constants = container.numbers(&format!("{name}.constants"))?;
    let mut model = Model::new(chain, &constants, coupling)?;
    if let Some(stored) = &content.models[name].blocks {
        let blocks = blocks(container, stored, name)?;
        let up = stored.iter().find_map(|block| block.up).unwrap_or(UPRIGHT);
        let levers = Levers::new(model.chain()).along(up)?;
        let bank = Bank::restored(inputs, width, blocks, levers)?;
        model = model.with_field(bank.compiled(), content.options.features.len())?;
    }
    if let Some(stored) = &content.conservative {
        let conservative = conservative(container, stored, inputs, &self::chain(&content.robot, false)?)?;
        model = model.with_spread(Spread::Field(Box::new(conservative)))?;
    }
    Ok(model)
}

fn conservative(
    container: &Container,
    stored: &ConservativeContent,
    inputs: usize,
    to_flange: &Chain,
) -> Result<Conservative, LoadError> {
    let any = [f64::NEG_INFINITY, f64::INFINITY];
    let leverage = if stored.leverage {
        let factor = container.numbers("conservative.leverage")?;
        Some(Leverage::new(to_flange, stored.centre, &factor)?)
    } else {
        None
    };
    let blocks = blocks(container, &stored.blocks, "conservative")?;
    Ok(Conservative::new(ConservativeParts {
        tables: Bank { input_count: inputs, parameter_count: truearm_bank::BOUNDED, blocks, sag: None },
        leverage,
        level: stored.level,
        largest: stored.largest,
        ranges: stored.ranges.iter().map(|range| range.unwrap_or(any)).collect(),
        looseness: stored.looseness,
        centre: stored.centre,
    })?)
}

fn blocks(container: &Container, stored: &[BlockContent], name: &str) -> Result<Vec<Block>, LoadError> {
    let block = |(number, block): (usize, &BlockContent)| {
        let weights = container.numbers(&format!("{name}.block{number}.weights"))?;
        Ok(Block {
            name: block.name.clone(),
            grid: Grid {
                inputs: block.inputs.clone(),
                axes: block.axes.iter().copied().map(Axis::restored).collect(),
            },
            outputs: block.outputs.clone(),
            weights,
            reading: block.reading.clone(),
        })
    };
    stored.iter().enumerate().map(block).collect()
}

/// The chain to the flange; with `base_is_row` the base is its first row, and corrected like a link.
fn chain(robot: &RobotContent, base_is_row: bool) -> Result<Chain, LoadError> {
    let convention = match robot.convention.as_str() {
        "standard" => Convention::Standard,
        "modified" => Convention::Modified,
        _ => return Err(incomplete("its convention is neither standard nor modified")),
    };
    if robot.joints.len() != robot.table.len() {
        return Err(incomplete("its table has not one row a link"));
    }
    let mut links = Vec::new();
    if base_is_row {
        links.push(link("fixed", &robot.base_row.unwrap_or_default())?);
    }
    for (kind, row) in robot.joints.iter().zip(&robot.table) {
        links.push(link(kind, row)?);
    }
    let in_row = base_is_row && robot.base_row.is_some();
    let base = if in_row { Transform::IDENTITY } else { transform(&robot.base) };
    Ok(Chain::new(convention, links, base, transform(&robot.flange))?)
}

fn link(kind: &str, row: &[f64; 5]) -> Result<Link, LoadError> {
    let joint = match kind {
        "revolute" => Joint::Revolute,
        "prismatic" => Joint::Prismatic,
        "fixed" => Joint::Fixed,
        _ => return Err(incomplete("a joint is neither revolute, prismatic nor fixed")),
    };
    let [theta, d, a, alpha, beta] = *row;
    Ok(Link { joint, theta, d, a, alpha, beta })
}

fn transform(rows: &[[f64; 4]; 4]) -> Transform {
    let mut matrix = [0.0; 16];
    matrix.copy_from_slice(rows.as_flattened());
    Transform::from_matrix(&matrix)
}

/// A square matrix row by row.
fn square(rows: &[Vec<f64>]) -> Result<Vec<f64>, LoadError> {
    if rows.iter().any(|row| row.len() != rows.len()) {
        return Err(incomplete("its coupling is not square"));
    }
    Ok(rows.concat())
}

fn incomplete(what: &str) -> LoadError {
    LoadError::Content(what.to_owned())
}
