//! Where the weights of an association cell are kept: in a row of its own, or in one found by hash coding.

use truearm_estimate::EstimateError;

use crate::mixed::mixed;

/// Rows of a dense table at most; larger networks need hash coding.
const MOST_ROWS: u64 = 1 << 24;

/// Rows of weights.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Table {
    /// A row for each association cell.
    Dense,
    /// So many rows, shared by hash coding (Albus 1975).
    Hashed {
        /// Rows.
        rows: usize,
    },
}

impl Table {
    /// Rows for so many association cells.
    ///
    /// # Errors
    /// [`EstimateError::Option`] where there are too many cells for a dense table, or no rows.
    pub fn rows(self, cells: u64) -> Result<usize, EstimateError> {
        match self {
            Table::Dense if cells > MOST_ROWS => Err(EstimateError::Option {
                what: "the number of association cells",
                value: cells as f64,
                rule: "a dense table holds 16777216 at most: give the size of a hash table",
            }),
            Table::Dense => Ok(cells as usize),
            Table::Hashed { rows } if rows == 0 || rows as u64 > MOST_ROWS => Err(EstimateError::Option {
                what: "the size of the hash table",
                value: rows as f64,
                rule: "it must be 1 to 16777216",
            }),
            Table::Hashed { rows } => Ok(rows),
        }
    }

    /// The row of an association cell.
    #[inline(always)]
    pub fn row(self, cell: u64) -> usize {
        match self {
            Table::Dense => cell as usize,
            Table::Hashed { rows } => ((u128::from(mixed(cell)) * rows as u128) >> 64) as usize,
        }
    }
}
