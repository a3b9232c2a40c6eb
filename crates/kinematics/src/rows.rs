//! From row-major arrays to lanes and back.

use crate::lane::{LANES, Lane};

/// Lanes of the rows from `first` on of a row-major array, `width` numbers a row.
///
/// `lanes[j].0[i]` is column j of row `first + i`; past the end of `rows` the last row is repeated. `rows`
/// must reach `first` and `lanes` be `width` long.
#[inline(always)]
pub fn load_lanes(rows: &[f64], width: usize, first: usize, lanes: &mut [Lane]) {
    let last = rows.len() / width - 1;
    for i in 0..LANES {
        let row = &rows[(first + i).min(last) * width..][..width];
        for (lane, value) in lanes.iter_mut().zip(row) {
            lane.0[i] = *value;
        }
    }
}

/// Write lanes as rows of `lanes.len()` numbers; as many rows as `rows` holds, eight at most.
#[inline(always)]
pub fn store_lanes(lanes: &[Lane], rows: &mut [f64]) {
    for (i, row) in rows.chunks_exact_mut(lanes.len()).take(LANES).enumerate() {
        for (value, lane) in row.iter_mut().zip(lanes) {
            *value = lane.0[i];
        }
    }
}
