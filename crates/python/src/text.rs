//! Numbers in the text of programs.

use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArrayMethods, PyReadonlyArray1, PyReadonlyArray2,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyList};
use truearm_text::{
    Numbers, Values, Words, find, read_numbers as read, scan_lines as scan, splice_in_pieces,
};

use crate::chain::contiguous;
use crate::door::quick;

type Integers<'py> = Bound<'py, PyArray1<i32>>;
type Scanned<'py> = (Integers<'py>, Integers<'py>, Integers<'py>, Integers<'py>, Integers<'py>);
type Read<'py> = (Bound<'py, PyArray2<i32>>, Bound<'py, PyArray2<f64>>, Bound<'py, PyArray2<i16>>);

/// Where bytes stand in a text, see the stub.
#[pyfunction]
pub fn find_bytes(text: &[u8], word: &[u8]) -> Option<usize> {
    find(text, word)
}

/// Lines of a text and where its numbers are, see the stub.
#[pyfunction]
pub fn scan_lines<'py>(py: Python<'py>, text: &[u8]) -> PyResult<Scanned<'py>> {
    let lines = quick(py, || scan(text))?;
    let integers = |values: Vec<i32>| values.into_pyarray(py);
    Ok((
        integers(lines.starts),
        integers(lines.skeleton),
        integers(lines.representative),
        integers(lines.first_number),
        integers(lines.numbers),
    ))
}

/// What numbers say, see the stub.
#[pyfunction]
pub fn read_numbers<'py>(
    py: Python<'py>,
    text: &[u8],
    starts: PyReadonlyArray2<'py, i32>,
) -> PyResult<Read<'py>> {
    let shape = (starts.shape()[0], starts.shape()[1]);
    let starts = contiguous("starts", &starts)?;
    let ends = PyArray2::zeros(py, shape, false);
    let values = PyArray2::zeros(py, shape, false);
    let decimals = PyArray2::zeros(py, shape, false);
    {
        let (mut ends, mut values, mut decimals) =
            (ends.readwrite(), values.readwrite(), decimals.readwrite());
        let out = Values {
            ends: ends.as_slice_mut()?,
            values: values.as_slice_mut()?,
            decimals: decimals.as_slice_mut()?,
        };
        quick(py, move || read(text, starts, out))?;
    }
    Ok((ends, values, decimals))
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
) -> PyResult<Bound<'py, PyAny>> {
    let numbers = Numbers {
        starts: contiguous("starts", &spans.0)?,
        ends: contiguous("ends", &spans.1)?,
        values: contiguous("values", &values)?,
        decimals: contiguous("decimals", &decimals)?,
    };
    let words: Vec<Words<'_>> =
        words.iter().map(|(start, end, bytes)| Words { start: *start, end: *end, bytes }).collect();
    let pieces = quick(py, || splice_in_pieces(text, numbers, &words))?;
    let pieces = PyList::new(py, pieces.into_iter().map(|piece| piece.into_pyarray(py)))?;
    // Python joins them without filling the memory with zeros first.
    PyBytes::new(py, b"").call_method1("join", (pieces,))
}
