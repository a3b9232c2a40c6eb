//! `_core.MeasurementSet` and `_core.Setup`: what was measured, and the unknowns of the measurement.

use numpy::ndarray::{Array1, Array2, Array3, ArrayView1};
use numpy::{
    IntoPyArray, PyArray1, PyArray2, PyArray3, PyReadonlyArray1, PyReadonlyArray2, PyReadonlyArray3,
    PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use truearm_estimate::{Distance, DistanceTo, GroupSetup, MeasurementSet as Core, Setup as CoreSetup, Sigma};
use truearm_kinematics::Transform;

use crate::door::{CoreError, Failure};

/// Measurements as the estimators read them, see the stub.
#[pyclass(frozen, module = "truearm._core")]
pub struct MeasurementSet {
    core: Core,
}

impl MeasurementSet {
    pub fn core(&self) -> &Core {
        &self.core
    }
}

/// Arguments of [`MeasurementSet`] that are arrays.
#[derive(FromPyObject)]
#[pyo3(from_item_all)]
struct Arrays<'py> {
    joints: PyReadonlyArray2<'py, f64>,
    group: PyReadonlyArray1<'py, i64>,
    targets: PyReadonlyArray3<'py, f64>,
    rotations: Option<PyReadonlyArray3<'py, f64>>,
    sigma: PyReadonlyArray2<'py, f64>,
    weight: PyReadonlyArray1<'py, f64>,
    distances: Vec<(usize, bool, usize, f64)>,
}

#[pymethods]
impl MeasurementSet {
    #[new]
    fn new(arrays: Arrays<'_>) -> PyResult<Self> {
        if arrays.sigma.shape()[1] != 4 {
            return Err(CoreError::new_err("sigma needs four columns: x, y, z and orientation"));
        }
        let sigma =
            |own: ArrayView1<'_, f64>| Sigma { position: [own[0], own[1], own[2]], orientation: own[3] };
        let distance = |&(pose, to_anchor, index, value): &(usize, bool, usize, f64)| Distance {
            pose,
            to: if to_anchor { DistanceTo::Anchor(index) } else { DistanceTo::Pose(index) },
            value,
        };
        let distances: Vec<Distance> = arrays.distances.iter().map(distance).collect();
        let anchors = arrays.distances.iter().filter(|d| d.1).map(|d| d.2 + 1);
        let group: Vec<usize> = arrays
            .group
            .as_array()
            .iter()
            .map(|&group| group.try_into())
            .collect::<Result<_, _>>()
            .map_err(|_| CoreError::new_err("a group is negative, groups count from 0"))?;
        let core = Core {
            joint_count: arrays.joints.shape()[1],
            target_count: arrays.targets.shape()[1],
            group_count: group.iter().max().map_or(0, |last| last + 1),
            joints: arrays.joints.as_array().iter().copied().collect(),
            group,
            targets: arrays.targets.as_array().iter().copied().collect(),
            rotations: arrays
                .rotations
                .map_or_else(Vec::new, |array| array.as_array().iter().copied().collect()),
            sigma: arrays.sigma.as_array().outer_iter().map(sigma).collect(),
            weight: arrays.weight.as_array().to_vec(),
            anchor_count: anchors.max().unwrap_or(0),
            distances,
        };
        core.check().map_err(Failure::into_exception)?;
        Ok(Self { core })
    }

    /// Rows of residuals that each pose has.
    #[getter]
    fn rows_per_pose(&self) -> usize {
        self.core.rows_per_pose()
    }
}

/// Frames, targets and anchors, see the stub.
#[pyclass(frozen, module = "truearm._core")]
pub struct Setup {
    core: CoreSetup,
}

impl Setup {
    pub fn wrap(core: CoreSetup) -> Self {
        Self { core }
    }

    pub fn core(&self) -> &CoreSetup {
        &self.core
    }
}

#[pymethods]
impl Setup {
    #[new]
    fn new(
        frames: PyReadonlyArray3<'_, f64>,
        targets: PyReadonlyArray3<'_, f64>,
        rotations: PyReadonlyArray3<'_, f64>,
        anchors: PyReadonlyArray2<'_, f64>,
    ) -> PyResult<Self> {
        let (count, points) = (frames.shape()[0], targets.shape()[1]);
        let fits = frames.shape()[1..] == [4, 4]
            && targets.shape() == [count, points, 3]
            && rotations.shape() == [count, 3, 3]
            && anchors.shape()[1] == 3;
        if !fits {
            return Err(CoreError::new_err(
                "a set-up needs frames (G, 4, 4), targets (G, T, 3), rotations (G, 3, 3) and anchors (A, 3)",
            ));
        }
        let (frames, targets, rotations) = (frames.as_array(), targets.as_array(), rotations.as_array());
        let group = |g: usize| GroupSetup {
            world_from_base: Transform::from_matrix(&std::array::from_fn(|k| frames[[g, k / 4, k % 4]])),
            targets: (0..points).map(|t| std::array::from_fn(|k| targets[[g, t, k]])).collect(),
            flange_from_target: std::array::from_fn(|k| rotations[[g, k / 3, k % 3]]),
        };
        let anchors = anchors.as_array();
        let core = CoreSetup {
            groups: (0..count).map(group).collect(),
            anchors: anchors.outer_iter().map(|a| [a[0], a[1], a[2]]).collect(),
        };
        Ok(Self { core })
    }

    /// world_from_base of each group, (G, 4, 4).
    #[getter]
    fn frames<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<f64>> {
        let groups = &self.core.groups;
        Array3::from_shape_fn((groups.len(), 4, 4), |(g, i, j)| {
            groups[g].world_from_base.to_matrix()[4 * i + j]
        })
        .into_pyarray(py)
    }

    /// Target points in the flange frame, (G, T, 3), m.
    #[getter]
    fn targets<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<f64>> {
        let groups = &self.core.groups;
        let points = groups.first().map_or(0, |group| group.targets.len());
        Array3::from_shape_fn((groups.len(), points, 3), |(g, t, k)| groups[g].targets[t][k]).into_pyarray(py)
    }

    /// flange_from_target rotations, (G, 3, 3).
    #[getter]
    fn rotations<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray3<f64>> {
        let groups = &self.core.groups;
        Array3::from_shape_fn((groups.len(), 3, 3), |(g, i, j)| groups[g].flange_from_target[3 * i + j])
            .into_pyarray(py)
    }

    /// Anchors in the base frame, (A, 3), m.
    #[getter]
    fn anchors<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let anchors = &self.core.anchors;
        Array2::from_shape_fn((anchors.len(), 3), |(a, k)| anchors[a][k]).into_pyarray(py)
    }
}

/// A vector as a new array.
pub fn vector<'py>(py: Python<'py>, values: &[f64]) -> Bound<'py, PyArray1<f64>> {
    Array1::from_vec(values.to_vec()).into_pyarray(py)
}

/// Rows of equal width as a new array.
pub fn matrix<'py>(py: Python<'py>, values: &[f64], width: usize) -> Bound<'py, PyArray2<f64>> {
    let rows = values.len().checked_div(width).unwrap_or(0);
    Array2::from_shape_fn((rows, width), |(i, j)| values[i * width + j]).into_pyarray(py)
}
