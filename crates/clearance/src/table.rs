//! What the table carries: the column behind the panel, and the plate around it, seen from the carriage.

use crate::segment::{distance, dot, minus, plus};

/// The column that carries the panel, as a capsule.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Column {
    /// Where it begins, from the carriage.
    pub top: [f64; 3],
    /// From there to its end.
    pub down: [f64; 3],
    /// Its radius and that of a link together.
    pub radius: f64,
}

impl Column {
    /// From a link to the column of a carriage at a place; negative where they meet.
    pub fn gap(&self, link: [[f64; 3]; 2], carriage: [f64; 3]) -> f64 {
        let [begin, end] = link;
        distance(begin, minus(end, begin), plus(carriage, self.top), self.down) - self.radius
    }
}

/// The plate around the panel: flat, and as deep as one likes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Plate {
    /// From the carriage to the corner of the panel.
    pub corner: [f64; 3],
    /// Unit vectors of rows, of columns, and out of the face.
    pub axes: [[f64; 3]; 3],
    /// Size of the panel along rows and columns.
    pub area: [f64; 2],
    /// How far the plate reaches beyond the panel.
    pub rim: f64,
}

impl Plate {
    /// From a line to the plate of a carriage at a place; negative where it goes below its face.
    ///
    /// The greatest of distances that change evenly along the line is least at an end, or where two of them are equal.
    pub fn gap(&self, line: [[f64; 3]; 2], carriage: [f64; 3]) -> f64 {
        let [begin, end] = line.map(|point| self.off(point, carriage));
        let at = |share: f64| {
            let off = begin.iter().zip(&end).map(|(a, b)| a + share * (b - a));
            off.fold(f64::NEG_INFINITY, f64::max)
        };
        let mut least = at(0.0).min(at(1.0));
        for i in 0..begin.len() {
            for j in 0..i {
                let (before, behind) = (begin[i] - begin[j], end[i] - end[j]);
                if before * behind < 0.0 {
                    least = least.min(at(before / (before - behind)));
                }
            }
        }
        least
    }

    /// How far a point is off each of the planes between which the plate lies: its face, and two edges each way.
    fn off(&self, point: [f64; 3], carriage: [f64; 3]) -> [f64; 5] {
        let from_corner = minus(point, plus(carriage, self.corner));
        let [u, v, above] = self.axes.map(|axis| dot(axis, from_corner));
        let [rows, columns] = self.area;
        [above, -self.rim - u, u - rows - self.rim, -self.rim - v, v - columns - self.rim]
    }
}
