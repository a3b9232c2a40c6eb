//! Gaps between the arm and what the table carries.

use crate::arm::Place;
use crate::error::ClearanceError;
use crate::table::{Column, Plate};

/// Distances to the nearest things, metres; negative where they meet.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Gaps {
    /// Between links and column.
    pub links: f64,
    /// Between tool and plate.
    pub tool: f64,
}

impl Gaps {
    /// Of nothing at all.
    const NONE: Gaps = Gaps { links: f64::INFINITY, tool: f64::INFINITY };

    fn or_less(self, other: Gaps) -> Gaps {
        Gaps { links: self.links.min(other.links), tool: self.tool.min(other.tool) }
    }
}

/// What the table carries.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Clearance {
    column: Column,
    plate: Plate,
}

impl Clearance {
    /// The column behind the panel, and the plate around it.
    ///
    /// # Errors
    /// [`ClearanceError::Value`] if a number is not finite, or a size is negative.
    pub fn new(column: Column, plate: Plate) -> Result<Clearance, ClearanceError> {
        finite("the column", &[column.top, column.down].concat())?;
        finite("the plate", &[plate.corner.as_slice(), plate.axes.as_flattened()].concat())?;
        size("the column's radius", &[column.radius])?;
        size("the plate", &[plate.area.as_slice(), &[plate.rim]].concat())?;
        Ok(Clearance { column, plate })
    }

    /// The least gaps with the arm and the carriage at their places.
    pub fn gaps(&self, arm: &Place, carriage: [f64; 3]) -> Gaps {
        let links = arm.links.windows(2).map(|link| self.column.gap([link[0], link[1]], carriage));
        // A last line without length, so that a tool of one point counts.
        let ends = arm.tool.iter().skip(1).chain(arm.tool.last());
        let tool = arm.tool.iter().zip(ends).map(|(&from, &to)| self.plate.gap([from, to], carriage));
        Gaps { links: links.fold(f64::INFINITY, f64::min), tool: tool.fold(f64::INFINITY, f64::min) }
    }

    /// The least gaps over all combinations of places of the one and of the other.
    pub fn least(&self, arm: &[Place], carriages: &[[f64; 3]]) -> Gaps {
        let all = arm.iter().flat_map(|place| carriages.iter().map(|&carriage| self.gaps(place, carriage)));
        all.fold(Gaps::NONE, Gaps::or_less)
    }
}

fn finite(what: &'static str, values: &[f64]) -> Result<(), ClearanceError> {
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(ClearanceError::Value { what, value, rule: "finite" }),
        None => Ok(()),
    }
}

fn size(what: &'static str, values: &[f64]) -> Result<(), ClearanceError> {
    match values.iter().find(|value| !value.is_finite() || **value < 0.0) {
        Some(&value) => Err(ClearanceError::Value { what, value, rule: "0 or more, and finite" }),
        None => Ok(()),
    }
}
