//! Numbers in the text of programs.

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use truearm_text::{Numbers, Words, scan_lines as scan, splice_in_pieces};

use crate::door::quick;

type Integers<'py> = Bound<'py, PyArray1<i32>>;
type Scanned<'py> = (
    Integers<'py>,
    Integers<'py>,
    Integers<'py>,
    Integers<'py>,
    Integers<'py>,
    Integers<'py>,
    Bound<'py, PyArray1<f64>>,
    Bound<'py, PyArray1<i16>>,
);

/// Lines and numbers of a text, see the stub.
#[pyfunction]
pub fn scan_lines<'py>(py: Python<'py>, text: &[u8]) -> PyResult<Scanned<'py>> {
    let lines = quick(py, || scan(text))?;
    let integers = |values: Vec<i32>| values.into_pyarray(py);
    let numbers = lines.numbers;
    Ok((
        integers(lines.starts),
        integers(lines.skeleton),
        integers(lines.representative),
        integers(lines.first_number),
        integers(numbers.starts),
        integers(numbers.ends),
        numbers.values.into_pyarray(py),
        numbers.decimals.into_pyarray(py),
    ))
}

/// A text with other numbers and words, see the stub.
#[pyfunction]
pub fn splice_numbers<'py>(
    py: Python<'py>,
    text: &[u8],
    spans: (PyReadonlyArray1<'py, i32>, PyReadonlyArray1<'py, i32>),
    values: PyReadonlyArray1<'py, f64>,
    decimals: PyReadonlyArray1<'py, i16>,
    words: Vec<(usize, usize, Vec<u8>)>,
) -> PyResult<Bound<'py, PyBytes>> {
    let numbers = Numbers {
        starts: spans.0.as_slice()?,
        ends: spans.1.as_slice()?,
        values: values.as_slice()?,
        decimals: decimals.as_slice()?,
    };
    let words: Vec<Words<'_>> =
        words.iter().map(|(start, end, bytes)| Words { start: *start, end: *end, bytes }).collect();
    let pieces = quick(py, || splice_in_pieces(text, numbers, &words))?;
    PyBytes::new_with(py, pieces.iter().map(Vec::len).sum(), |out| {
        let mut rest = out;
        for piece in &pieces {
            let (here, behind) = rest.split_at_mut(piece.len());
            here.copy_from_slice(piece);
            rest = behind;
        }
        Ok(())
    })
}
