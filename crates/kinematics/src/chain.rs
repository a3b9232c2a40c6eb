//! The chain: its links, and the fixed transforms before and after them.

use crate::error::KinematicsError;
use crate::parameters::is_length;
use crate::transform::Transform;

/// Names of the parameters of a link, in their order.
const PARAMETER_NAMES: [&str; 5] = ["theta", "d", "a", "alpha", "beta"];

/// What a link's joint value is added to.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Joint {
    /// To theta.
    Revolute,
    /// To d.
    Prismatic,
    /// To nothing: a row of the table without a joint.
    Fixed,
}

/// Order of the elementary motions of a link.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Convention {
    /// A = Rz(theta) Tz(d) Tx(a) Rx(alpha) Ry(beta), Denavit-Hartenberg with Hayati's beta.
    Standard,
    /// A = Rx(alpha) Tx(a) Ry(beta) Rz(theta) Tz(d), after Craig.
    Modified,
}

/// One row of the Denavit-Hartenberg table, metres and radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Link {
    /// Kind of joint.
    pub joint: Joint,
    /// Angle about z, to which a revolute joint's value is added.
    pub theta: f64,
    /// Offset along z, to which a prismatic joint's value is added.
    pub d: f64,
    /// Length along x.
    pub a: f64,
    /// Twist about x.
    pub alpha: f64,
    /// Hayati's twist about y.
    pub beta: f64,
}

impl Link {
    /// theta, d, a, alpha, beta.
    pub fn parameters(&self) -> [f64; 5] {
        [self.theta, self.d, self.a, self.alpha, self.beta]
    }
}

/// A serial chain: `base`, the links in order, `end` (flange and tool together).
#[derive(Debug, Clone, PartialEq)]
pub struct Chain {
    convention: Convention,
    links: Vec<Link>,
    base: Transform,
    end: Transform,
    joint_columns: Vec<usize>,
    end_turns: bool,
}

impl Chain {
    /// A chain of links between two fixed transforms.
    ///
    /// # Errors
    /// If there are no links or no joints, a parameter is not finite, or a transform is not rigid.
    pub fn new(
        convention: Convention,
        links: Vec<Link>,
        base: Transform,
        end: Transform,
    ) -> Result<Chain, KinematicsError> {
        if links.is_empty() {
            return Err(KinematicsError::NoLinks);
        }
        for (index, link) in links.iter().enumerate() {
            check_finite(index, link)?;
        }
        base.check("base")?;
        end.check("end")?;
        let joint_columns = joint_columns(&links);
        if joint_columns.is_empty() {
            return Err(KinematicsError::NoJoints { links: links.len() });
        }
        let end_turns = turns(&end);
        Ok(Chain { convention, links, base, end, joint_columns, end_turns })
    }

    /// Number of joints, J.
    pub fn joint_count(&self) -> usize {
        self.joint_columns.len()
    }

    /// Number of links, L; fixed rows count.
    pub fn link_count(&self) -> usize {
        self.links.len()
    }

    /// Number of parameters, 5 L.
    pub fn parameter_count(&self) -> usize {
        5 * self.links.len()
    }

    /// The links, base to end.
    pub fn links(&self) -> &[Link] {
        &self.links
    }

    /// Order of the elementary motions of the links.
    pub fn convention(&self) -> Convention {
        self.convention
    }

    /// For each joint, the index of the parameter that its value is added to.
    pub fn joint_columns(&self) -> &[usize] {
        &self.joint_columns
    }

    /// Whether a joint, from 0, is a prismatic one.
    #[inline(always)]
    pub fn slides(&self, joint: usize) -> bool {
        is_length(self.joint_columns[joint])
    }

    /// The parameters of the links as given, 5 L.
    pub fn nominal(&self) -> Vec<f64> {
        self.links.iter().flat_map(Link::parameters).collect()
    }

    /// The transform before the first link.
    pub fn base(&self) -> &Transform {
        &self.base
    }

    /// The transform after the last link.
    pub fn end(&self) -> &Transform {
        &self.end
    }

    /// Whether the end is turned with respect to the last link, or only shifted.
    pub(crate) fn end_turns(&self) -> bool {
        self.end_turns
    }

    /// The same chain with another end.
    ///
    /// # Errors
    /// [`KinematicsError::NotRigid`] if the transform is not rigid.
    pub fn with_end(&self, end: Transform) -> Result<Chain, KinematicsError> {
        end.check("end")?;
        Ok(Chain { end, end_turns: turns(&end), ..self.clone() })
    }

    /// The same chain with another base.
    ///
    /// # Errors
    /// [`KinematicsError::NotRigid`] if the transform is not rigid.
    pub fn with_base(&self, base: Transform) -> Result<Chain, KinematicsError> {
        base.check("base")?;
        Ok(Chain { base, ..self.clone() })
    }

    /// The same chain as a base frame sees it whose z axis is `up`, a direction in the present one of any length.
    ///
    /// # Errors
    /// [`KinematicsError::NoDirection`].
    pub fn with_up(&self, up: [f64; 3]) -> Result<Chain, KinematicsError> {
        let [x, y, z] = up;
        if !up.iter().all(|value| value.is_finite()) || up == [0.0; 3] {
            return Err(KinematicsError::NoDirection { name: "up", value: up });
        }
        let across = x.hypot(y);
        let angle = across.atan2(z);
        let shortest = if across > 0.0 { [y / across, -x / across, 0.0] } else { [1.0, 0.0, 0.0] };
        let turned = Transform::from_rotation_vector(shortest.map(|part| angle * part), [0.0; 3]);
        self.with_base(turned.compose(&self.base))
    }
}

fn turns(transform: &Transform) -> bool {
    transform.rotation != Transform::IDENTITY.rotation
}

fn check_finite(index: usize, link: &Link) -> Result<(), KinematicsError> {
    for (name, value) in PARAMETER_NAMES.into_iter().zip(link.parameters()) {
        if !value.is_finite() {
            return Err(KinematicsError::LinkNotFinite { link: index, name, value });
        }
    }
    Ok(())
}

fn joint_columns(links: &[Link]) -> Vec<usize> {
    links
        .iter()
        .enumerate()
        .filter_map(|(index, link)| match link.joint {
            Joint::Revolute => Some(5 * index),
            Joint::Prismatic => Some(5 * index + 1),
            Joint::Fixed => None,
        })
        .collect()
}
