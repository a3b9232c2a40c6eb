//! What numbers of a text say.

use rayon::prelude::*;

use crate::error::TextError;
use crate::number::number_from;

/// Numbers that are read at a time; the result does not depend on it.
const PIECE: usize = 1 << 14;

/// Columns that numbers are read into; all have the same length.
#[derive(Debug)]
pub struct Values<'a> {
    /// Behind the last byte of each.
    pub ends: &'a mut [i32],
    /// What they say.
    pub values: &'a mut [f64],
    /// Digits behind the point, a negative exponent counted, as in [`crate::Number`].
    pub decimals: &'a mut [i16],
}

/// Read the numbers that begin at `starts`, signs included.
///
/// # Errors
/// If the columns differ in length or there is no number at a place.
pub fn read_numbers(text: &[u8], starts: &[i32], out: Values<'_>) -> Result<(), TextError> {
    let first = starts.len();
    for other in [out.ends.len(), out.values.len(), out.decimals.len()] {
        if other != first {
            return Err(TextError::Lengths { first, other });
        }
    }
    let columns = (starts.par_chunks(PIECE), out.ends.par_chunks_mut(PIECE))
        .into_par_iter()
        .zip(out.values.par_chunks_mut(PIECE))
        .zip(out.decimals.par_chunks_mut(PIECE));
    columns.try_for_each(|(((starts, ends), values), decimals)| {
        for (row, &start) in starts.iter().enumerate() {
            let known = usize::try_from(start).ok().and_then(|start| number_from(text, start));
            let number = known.ok_or(TextError::NoNumber { start })?;
            (ends[row], values[row], decimals[row]) = (number.end as i32, number.value, number.decimals);
        }
        Ok(())
    })
}
