//! From row-major arrays to lanes and back.

use crate::isa::Isa;
use crate::lane::{LANES, Lane};

/// Lanes of the rows from `first` on of a row-major array, `width` numbers a row.
///
/// `lanes[j].0[i]` is column j of row `first + i`; past the end of `rows` the last row is repeated. `rows` must
/// reach `first`; `lanes` must be as long as [`lane_room`] says, and what lies beyond `width` is of no meaning.
#[inline(always)]
pub fn load_lanes<I: Isa>(rows: &[f64], width: usize, first: usize, lanes: &mut [Lane]) {
    let blocks = lanes.as_chunks_mut::<LANES>().0;
    let start = first * width;
    // A block reads eight columns of eight rows, so what the last row reads past its end must exist.
    let Some(source) = rows.get(start..start + (LANES - 1) * width + LANES * blocks.len()) else {
        return load_last(rows, width, first, lanes);
    };
    for (index, block) in blocks.iter_mut().enumerate() {
        for i in 0..LANES {
            block[i].0.copy_from_slice(&source[i * width + index * LANES..][..LANES]);
        }
        I::transpose(block);
    }
}

/// Lanes that [`load_lanes`] needs for rows of `width` numbers.
pub const fn lane_room(width: usize) -> usize {
    width.next_multiple_of(LANES)
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
