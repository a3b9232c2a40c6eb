//! Where the links and the tool of an arm are.

use truearm_kinematics::{Chain, Parameters, SharedParameters, Transform};

use crate::error::ClearanceError;
use crate::way::Way;

/// Where an arm is.
#[derive(Debug, Clone, PartialEq)]
pub struct Place {
    /// Ends of the links that have a length, the base first.
    pub links: Vec<[f64; 3]>,
    /// Points that the tool goes straight between, the flange first.
    pub tool: Vec<[f64; 3]>,
}

/// A chain up to something of the arm.
#[derive(Debug, Clone)]
struct Part {
    chain: Chain,
    nominal: SharedParameters,
}

/// An arm, as the chains up to the ends of its links and to points of its tool.
#[derive(Debug, Clone)]
pub struct Arm {
    links: Vec<Part>,
    tool: Vec<Part>,
    base: [f64; 3],
    joints: usize,
}

impl Arm {
    /// An arm with the joints of its last tool chain; the chains have the same base.
    ///
    /// # Errors
    /// [`ClearanceError::Joints`] if another chain has more of them.
    pub fn new(links: Vec<Chain>, tool: Vec<Chain>) -> Result<Arm, ClearanceError> {
        let last = tool.last().or(links.last());
        let (joints, base) =
            last.map_or((0, [0.0; 3]), |chain| (chain.joint_count(), chain.base().translation));
        for chain in links.iter().chain(&tool) {
            if chain.joint_count() > joints {
                return Err(ClearanceError::Joints { joints: chain.joint_count(), all: joints });
            }
        }
        let part = |chain: Chain| Part { nominal: SharedParameters::new(&chain.nominal()), chain };
        let parts = |chains: Vec<Chain>| chains.into_iter().map(part).collect();
        Ok(Arm { links: parts(links), tool: parts(tool), base, joints })
    }

    /// How many joints it has.
    pub fn joint_count(&self) -> usize {
        self.joints
    }

    /// Where it is on a way of joint values, when its base stands at `table_from_base`.
    ///
    /// # Errors
    /// If rows of the way have another width than there are joints, or `table_from_base` is no rigid motion.
    pub fn along(&self, way: &Way, table_from_base: &Transform) -> Result<Vec<Place>, ClearanceError> {
        if way.width != self.joints {
            return Err(ClearanceError::Width { got: way.width, wanted: self.joints });
        }
        table_from_base.check("table_from_base")?;
        let count = way.values.len() / way.width;
        let base = Place { links: vec![table_from_base.apply(self.base)], tool: Vec::new() };
        let mut places = vec![base; count];
        for part in &self.links {
            let ends = part.points(way, count)?;
            places.iter_mut().zip(ends).for_each(|(place, end)| place.links.push(table_from_base.apply(end)));
        }
        for part in &self.tool {
            let points = part.points(way, count)?;
            places.iter_mut().zip(points).for_each(|(place, at)| place.tool.push(table_from_base.apply(at)));
        }
        Ok(places)
    }
}

impl Part {
    /// Its end in the frame of the base, at each of `count` places.
    fn points(&self, way: &Way, count: usize) -> Result<Vec<[f64; 3]>, ClearanceError> {
        let first = self.chain.joint_count();
        let joints: Vec<f64> =
            way.values.chunks_exact(way.width).flat_map(|row| &row[..first]).copied().collect();
        let mut points = vec![[0.0; 3]; count];
        self.chain.positions(&joints, Parameters::Prepared(&self.nominal), points.as_flattened_mut())?;
        Ok(points)
    }
}
