//! From row-major arrays to lanes and back.

use crate::isa::Isa;
use crate::lane::{LANES, Lane};

/// Lanes of the rows from `first` on of a row-major array, `width` numbers a row.
///
/// `lanes[j].0[i]` is column j of row `first + i`; past the end of `rows` the last row is repeated. `rows`
/// must reach `first` and `lanes` be `width` long.
#[inline(always)]
pub fn load_lanes<I: Isa>(rows: &[f64], width: usize, first: usize, lanes: &mut [Lane]) {
    // A block reads eight columns of eight rows, so that the last row's reach past the columns wanted must exist.
    let reach = (first + LANES - 1) * width + width.next_multiple_of(LANES);
    if reach > rows.len() {
        return load_last(rows, width, first, lanes);
    }
    for (block, lanes) in lanes.chunks_mut(LANES).enumerate() {
        let start = first * width + block * LANES;
        let mut square = [Lane::ZERO; LANES];
        for (i, row) in square.iter_mut().enumerate() {
            row.0.copy_from_slice(&rows[start + i * width..][..LANES]);
        }
        I::transpose(&mut square);
        lanes.copy_from_slice(&square[..lanes.len()]);
    }
}

/// The same number by number, repeating the last row.
#[inline(never)]
fn load_last(rows: &[f64], width: usize, first: usize, lanes: &mut [Lane]) {
    let last = rows.len() / width - 1;
    for i in 0..LANES {
        let row = &rows[(first + i).min(last) * width..][..width];
        for (lane, value) in lanes.iter_mut().zip(row) {
            lane.0[i] = *value;
        }
    }
}

/// Write lanes as rows of `order.len()` numbers, column k from `lanes[order[k]]`; eight rows, or fewer if `rows` is
/// shorter.
#[inline(always)]
pub fn store_lanes<I: Isa>(lanes: &[Lane], order: &[usize], rows: &mut [f64]) {
    let width = order.len();
    if width < LANES || rows.len() < LANES * width {
        return store_few(lanes, order, rows);
    }
    let mut start = 0;
    loop {
        let mut square = [Lane::ZERO; LANES];
        for (lane, index) in square.iter_mut().zip(&order[start..start + LANES]) {
            *lane = lanes[*index];
        }
        I::transpose(&mut square);
        for (i, row) in square.iter().enumerate() {
            rows[i * width + start..][..LANES].copy_from_slice(&row.0);
        }
        if start + LANES == width {
            return;
        }
        start = (start + LANES).min(width - LANES);
    }
}

/// The same number by number.
#[inline(never)]
fn store_few(lanes: &[Lane], order: &[usize], rows: &mut [f64]) {
    for (i, row) in rows.chunks_exact_mut(order.len()).take(LANES).enumerate() {
        for (value, index) in row.iter_mut().zip(order) {
            *value = lanes[*index].0[i];
        }
    }
}
