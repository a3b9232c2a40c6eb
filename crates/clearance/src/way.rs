//! Straight ways through places, looked at in steps.

use crate::error::ClearanceError;

/// Places of a way at the most.
const MOST_PLACES: usize = 1_000_000;

/// Places one after another: of an arm its joint values, of a carriage its three coordinates.
#[derive(Debug, Clone, PartialEq)]
pub struct Way {
    /// Rows of `width` numbers.
    pub values: Vec<f64>,
    /// How many numbers a row has.
    pub width: usize,
}

impl Way {
    /// Along straight lines through stops of `width` numbers, no number changing by more than `step` at once.
    ///
    /// # Errors
    /// If there is no stop, a number is not finite, the step is not above 0, or so small that a million places
    /// do not reach.
    pub fn through(stops: &[f64], width: usize, step: f64) -> Result<Way, ClearanceError> {
        check(stops, width)?;
        if step.is_nan() || step <= 0.0 {
            return Err(ClearanceError::Step { value: step });
        }
        let mut values = stops[..width].to_vec();
        let rows = stops.chunks_exact(width);
        for (a, b) in rows.clone().zip(rows.skip(1)) {
            let longest = a.iter().zip(b).fold(0.0, |most: f64, (x, y)| most.max((y - x).abs()));
            let count = (longest / step).ceil() + 1.0;
            let places = (values.len() / width) as f64 + count;
            if places > MOST_PLACES as f64 {
                return Err(ClearanceError::TooLong { count: places, most: MOST_PLACES });
            }
            for k in 1..=count as usize {
                let share = k as f64 / count;
                values.extend(a.iter().zip(b).map(|(x, y)| x + share * (y - x)));
            }
        }
        Ok(Way { values, width })
    }

    /// Just these places.
    ///
    /// # Errors
    /// If there is none, or a number is not finite.
    pub fn places(values: &[f64], width: usize) -> Result<Way, ClearanceError> {
        check(values, width)?;
        Ok(Way { values: values.to_vec(), width })
    }

    /// The places of a carriage, whose rows have three numbers.
    ///
    /// # Errors
    /// If rows have another width.
    pub fn points(&self) -> Result<&[[f64; 3]], ClearanceError> {
        match self.width {
            3 => Ok(self.values.as_chunks::<3>().0),
            got => Err(ClearanceError::Width { got, wanted: 3 }),
        }
    }
}

fn check(values: &[f64], width: usize) -> Result<(), ClearanceError> {
    if width == 0 || values.is_empty() || !values.len().is_multiple_of(width) {
        return Err(ClearanceError::Rows { got: values.len(), width });
    }
    match values.iter().find(|value| !value.is_finite()) {
        Some(&value) => Err(ClearanceError::NotFinite { value }),
        None => Ok(()),
    }
}
