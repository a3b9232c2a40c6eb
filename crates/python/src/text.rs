//! Numbers in the text of programs.

use numpy::{IntoPyArray, PyArray1, PyReadonlyArray1};
use pyo3::prelude::*;
use pyo3::types::PyBytes;
use truearm_text::{Numbers, TextError, Words, scan_lines as scan, splice};

use crate::door::{CoreError, Failure, quick};

type Integers<'py> = Bound<'py, PyArray1<i64>>;
type Scanned<'py> = (
    Integers<'py>,
    Integers<'py>,
    Integers<'py>,
    Integers<'py>,
    Integers<'py>,
    Integers<'py>,
    Bound<'py, PyArray1<f64>>,
    Integers<'py>,
);

impl Failure for TextError {
    fn into_exception(self) -> PyErr {
        CoreError::new_err(self.to_string())
    }
}

/// Lines and numbers of a text, see the stub.
#[pyfunction]
pub fn scan_lines<'py>(py: Python<'py>, text: &[u8]) -> Scanned<'py> {
    let lines = py.detach(|| scan(text));
    let integers = |values: Vec<i64>| values.into_pyarray(py);
    let places = |values: Vec<usize>| integers(values.into_iter().map(|value| value as i64).collect());
    let numbers = &lines.numbers;
    (
        places(lines.starts),
        integers(lines.skeleton.into_iter().map(i64::from).collect()),
        places(lines.representative),
        places(lines.first_number),
        integers(numbers.iter().map(|number| number.start as i64).collect()),
        integers(numbers.iter().map(|number| number.end as i64).collect()),
        numbers.iter().map(|number| number.value).collect::<Vec<f64>>().into_pyarray(py),
        integers(numbers.iter().map(|number| i64::from(number.decimals)).collect()),
    )
}

/// A text with other numbers and words, see the stub.
#[pyfunction]
pub fn splice_numbers<'py>(
    py: Python<'py>,
    text: &[u8],
    spans: (PyReadonlyArray1<'py, i64>, PyReadonlyArray1<'py, i64>),
    values: PyReadonlyArray1<'py, f64>,
    decimals: PyReadonlyArray1<'py, i64>,
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
    let out = quick(py, || splice(text, numbers, &words))?;
    Ok(PyBytes::new(py, &out))
}
