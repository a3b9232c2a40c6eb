//! `_core.Chain`: kinematics of NumPy arrays.

use std::num::NonZeroUsize;

use numpy::ndarray::{Dimension, Ix2, Ix3};
use numpy::{
    Element, PyArray, PyArrayMethods, PyReadonlyArray, PyReadonlyArray2, PyReadonlyArrayDyn,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use truearm_kinematics::{
    Batch, Chain as Core, Convention, Joint, KinematicsError, Link, Parameters, SharedParameters, Transform,
};

use crate::arrays::unknown;
use crate::door::{CoreError, Failure, quick};

type Rows<'py> = PyReadonlyArray2<'py, f64>;
type Array<'py, D> = Bound<'py, PyArray<f64, D>>;

/// A serial chain, see the stub for its arguments.
#[pyclass(frozen, module = "truearm._core")]
pub struct Chain {
    core: Core,
    nominal: SharedParameters,
}

impl Chain {
    /// The chain itself, for the other bindings.
    pub fn core(&self) -> &Core {
        &self.core
    }

    /// Poses in `q`, (n, J).
    fn poses(&self, q: &Rows<'_>) -> PyResult<usize> {
        let (shape, joints) = (q.shape(), self.core.joint_count());
        if shape[1] != joints {
            let text = format!("q has shape {shape:?}, it must be (n, {joints}): one column for each joint");
            return Err(CoreError::new_err(text));
        }
        Ok(shape[0])
    }

    fn parameters<'a>(
        &'a self,
        given: Option<&'a PyReadonlyArrayDyn<'_, f64>>,
        poses: usize,
    ) -> PyResult<Parameters<'a>> {
        let Some(array) = given else {
            return Ok(Parameters::Prepared(&self.nominal));
        };
        let (links, values) = (self.core.link_count(), contiguous("parameters", array)?);
        match array.shape() {
            [l, 5] if *l == links => Ok(Parameters::One(values)),
            [n, l, 5] if *n == poses && *l == links => Ok(Parameters::Each(values)),
            shape => Err(CoreError::new_err(format!(
                "parameters has shape {shape:?}, it must be ({links}, 5) or ({poses}, {links}, 5)"
            ))),
        }
    }
}

/// One of a batch's methods: joint values, parameters, results.
type Work<'a> = fn(&Batch<'a>, &[f64], Parameters<'_>, &mut [f64]) -> Result<(), KinematicsError>;

/// What a method was called with, beside q.
struct Call<'a, 'py, D> {
    parameters: Option<PyReadonlyArrayDyn<'py, f64>>,
    out: Option<Array<'py, D>>,
    shape: D,
    threads: Option<NonZeroUsize>,
    work: Work<'a>,
    chain: &'a Chain,
}

impl<'py, D: Dimension + Send> Call<'_, 'py, D> {
    fn run(self, py: Python<'py>, q: &Rows<'py>, poses: usize) -> PyResult<Array<'py, D>> {
        let parameters = self.chain.parameters(self.parameters.as_ref(), poses)?;
        let joints = contiguous("q", q)?;
        let out = prepared(py, self.out, self.shape)?;
        {
            let mut borrowed =
                out.try_readwrite().map_err(|error| CoreError::new_err(format!("out: {error}")))?;
            let values = borrowed.as_slice_mut().map_err(|_| not_contiguous("out"))?;
            let batch = self.chain.core.batch(self.threads);
            quick(py, || (self.work)(&batch, joints, parameters, values))?;
        }
        Ok(out)
    }
}

#[pymethods]
impl Chain {
    #[new]
    fn new(
        convention: &str,
        joints: Vec<String>,
        links: Rows<'_>,
        base: Rows<'_>,
        end: Rows<'_>,
    ) -> PyResult<Self> {
        let convention = match convention {
            "standard" => Convention::Standard,
            "modified" => Convention::Modified,
            other => return Err(unknown("convention", other, "'standard' or 'modified'")),
        };
        let (base, end) = (transform("base", &base)?, transform("end", &end)?);
        let links = table(&joints, &links)?;
        let core = Core::new(convention, links, base, end).map_err(Failure::into_exception)?;
        Ok(Self { nominal: SharedParameters::new(&core.nominal()), core })
    }

    #[getter]
    fn joint_count(&self) -> usize {
        self.core.joint_count()
    }

    #[pyo3(signature = (q, parameters=None, out=None, threads=None))]
    fn position<'py>(
        &self,
        py: Python<'py>,
        q: Rows<'py>,
        parameters: Option<PyReadonlyArrayDyn<'py, f64>>,
        out: Option<Array<'py, Ix2>>,
        threads: Option<NonZeroUsize>,
    ) -> PyResult<Array<'py, Ix2>> {
        let poses = self.poses(&q)?;
        let (shape, work) = (Ix2(poses, 3), Batch::positions as _);
        Call { parameters, out, shape, threads, work, chain: self }.run(py, &q, poses)
    }

    #[pyo3(signature = (q, parameters=None, out=None, threads=None))]
    fn pose<'py>(
        &self,
        py: Python<'py>,
        q: Rows<'py>,
        parameters: Option<PyReadonlyArrayDyn<'py, f64>>,
        out: Option<Array<'py, Ix3>>,
        threads: Option<NonZeroUsize>,
    ) -> PyResult<Array<'py, Ix3>> {
        let poses = self.poses(&q)?;
        let (shape, work) = (Ix3(poses, 4, 4), Batch::poses as _);
        Call { parameters, out, shape, threads, work, chain: self }.run(py, &q, poses)
    }

    #[pyo3(signature = (q, parameters=None, pose=false, out=None, threads=None))]
    fn parameter_jacobian<'py>(
        &self,
        py: Python<'py>,
        q: Rows<'py>,
        parameters: Option<PyReadonlyArrayDyn<'py, f64>>,
        pose: bool,
        out: Option<Array<'py, Ix3>>,
        threads: Option<NonZeroUsize>,
    ) -> PyResult<Array<'py, Ix3>> {
        let poses = self.poses(&q)?;
        let (rows, work) =
            if pose { (6, Batch::pose_jacobian as _) } else { (3, Batch::position_jacobian as _) };
        let shape = Ix3(poses, rows, self.core.parameter_count());
        Call { parameters, out, shape, threads, work, chain: self }.run(py, &q, poses)
    }

    #[pyo3(signature = (q, parameters=None, pose=false, out=None, threads=None))]
    fn joint_jacobian<'py>(
        &self,
        py: Python<'py>,
        q: Rows<'py>,
        parameters: Option<PyReadonlyArrayDyn<'py, f64>>,
        pose: bool,
        out: Option<Array<'py, Ix3>>,
        threads: Option<NonZeroUsize>,
    ) -> PyResult<Array<'py, Ix3>> {
        let poses = self.poses(&q)?;
        let (rows, work) = if pose {
            (6, Batch::joint_pose_jacobian as _)
        } else {
            (3, Batch::joint_position_jacobian as _)
        };
        let shape = Ix3(poses, rows, self.core.joint_count());
        Call { parameters, out, shape, threads, work, chain: self }.run(py, &q, poses)
    }
}

/// The given array if its shape is right, or a new one.
fn prepared<'py, D: Dimension>(
    py: Python<'py>,
    out: Option<Array<'py, D>>,
    shape: D,
) -> PyResult<Array<'py, D>> {
    let Some(array) = out else {
        return Ok(PyArray::zeros(py, shape, false));
    };
    if array.shape() != shape.slice() {
        let text = format!("out has shape {:?}, it must be {:?}", array.shape(), shape.slice());
        return Err(CoreError::new_err(text));
    }
    if !array.is_c_contiguous() {
        return Err(not_contiguous("out"));
    }
    Ok(array)
}

/// The numbers of an array, row by row.
pub fn contiguous<'a, T: Element, D: Dimension>(
    name: &str,
    array: &'a PyReadonlyArray<'_, T, D>,
) -> PyResult<&'a [T]> {
    if !array.is_c_contiguous() {
        return Err(not_contiguous(name));
    }
    array.as_slice().map_err(|_| not_contiguous(name))
}

pub fn not_contiguous(name: &str) -> PyErr {
    CoreError::new_err(format!(
        "{name} is not C-contiguous and aligned: pass numpy.require({name}, requirements=[\"C\", \"A\"])"
    ))
}

/// A transform of a homogeneous matrix.
pub fn transform(name: &'static str, matrix: &Rows<'_>) -> PyResult<Transform> {
    let shape = matrix.shape();
    let values = contiguous(name, matrix)?;
    let matrix: &[f64; 16] = values
        .try_into()
        .map_err(|_| CoreError::new_err(format!("{name} has shape {shape:?}, it must be (4, 4)")))?;
    if matrix[12..] != [0.0, 0.0, 0.0, 1.0] {
        let text = format!("the last row of {name} is {:?}, it must be [0, 0, 0, 1]", &matrix[12..]);
        return Err(CoreError::new_err(text));
    }
    Ok(Transform::from_matrix(matrix))
}

fn table(joints: &[String], links: &Rows<'_>) -> PyResult<Vec<Link>> {
    let shape = links.shape();
    if shape != [joints.len(), 5] {
        let rows = joints.len();
        return Err(CoreError::new_err(format!(
            "links has shape {shape:?}, it must be ({rows}, 5) for {rows} joints"
        )));
    }
    let rows = contiguous("links", links)?.chunks_exact(5);
    joints.iter().zip(rows).map(|(name, p)| link(name, p)).collect()
}

fn link(name: &str, p: &[f64]) -> PyResult<Link> {
    let joint = match name {
        "revolute" => Joint::Revolute,
        "prismatic" => Joint::Prismatic,
        "fixed" => Joint::Fixed,
        other => {
            return Err(unknown("joint", other, "'revolute', 'prismatic' or 'fixed'"));
        }
    };
    Ok(Link { joint, theta: p[0], d: p[1], a: p[2], alpha: p[3], beta: p[4] })
}
