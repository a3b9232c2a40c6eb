//! Where an arm's axes are with all joint values at zero.

use truearm_kinematics::{Chain, Convention, Joint, KinematicsError, Link, Parameters, Transform};

use crate::vector::Line;

/// The axes of a chain's joints and its end, all joint values zero, in the base frame.
///
/// Each axis is given at its point nearest to that of the axis before: where nearly parallel axes are described
/// by their common normal, the origins of the chain's frames may be hundreds of metres away.
#[derive(Debug, Clone)]
pub struct Axes {
    pub lines: Vec<Line>,
    pub all_revolute: bool,
    pub end: Transform,
}

impl Axes {
    /// The axes of a chain.
    ///
    /// # Errors
    /// [`KinematicsError`] of the chain's parts.
    pub fn of(chain: &Chain) -> Result<Axes, KinematicsError> {
        let before = match chain.convention() {
            Convention::Standard => 0,
            Convention::Modified => 1,
        };
        let mut lines = Vec::new();
        for (index, link) in chain.links().iter().enumerate() {
            if link.joint != Joint::Fixed {
                let r = frame_after(chain, index + before)?;
                let direction = [2, 5, 8].map(|k| r.rotation[k]);
                let line = Line { point: r.translation, direction };
                let before = lines.last().map_or(chain.base().translation, |before: &Line| before.point);
                lines.push(Line { point: line.nearest(before), direction });
            }
        }
        let all_revolute = chain.links().iter().all(|link| link.joint == Joint::Revolute);
        let end = frame_after(chain, chain.links().len())?.compose(chain.end());
        Ok(Axes { lines, all_revolute, end })
    }
}

/// The frame behind the first `count` links.
fn frame_after(chain: &Chain, count: usize) -> Result<Transform, KinematicsError> {
    // At zero all kinds of joints are alike, and a chain of none but fixed rows would be refused.
    let turning = |link: &Link| Link { joint: Joint::Revolute, ..*link };
    let links: Vec<Link> = chain.links()[..count].iter().map(turning).collect();
    if links.is_empty() {
        return Ok(*chain.base());
    }
    let part = Chain::new(chain.convention(), links, *chain.base(), Transform::IDENTITY)?;
    let mut matrix = [0.0; 16];
    let nominal = part.nominal();
    part.poses(&vec![0.0; part.joint_count()], Parameters::One(&nominal), &mut matrix)?;
    Ok(Transform::from_matrix(&matrix))
}
