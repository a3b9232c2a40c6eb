//! `_core.Clearance`: gaps between an arm and what a table carries.

use numpy::{PyArray2, PyArrayMethods, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use truearm_clearance::{Arm, Clearance as Core, ClearanceError, Column, Plate, Way};

use crate::chain::{Chain, contiguous, transform};
use crate::door::{CoreError, Failure, quick};

type Rows<'py> = PyReadonlyArray2<'py, f64>;
type Point = [f64; 3];

/// Gaps between an arm and a table, see the stub.
#[pyclass(frozen, module = "truearm._core")]
pub struct Clearance {
    arm: Arm,
    core: Core,
}

#[pymethods]
impl Clearance {
    #[new]
    fn new(
        links: Vec<PyRef<'_, Chain>>,
        tool: Vec<PyRef<'_, Chain>>,
        column: (Point, Point, f64),
        plate: (Point, [Point; 3], [f64; 2], f64),
    ) -> PyResult<Self> {
        let cores = |chains: Vec<PyRef<'_, Chain>>| chains.iter().map(|chain| chain.core().clone()).collect();
        let arm = Arm::new(cores(links), cores(tool)).map_err(Failure::into_exception)?;
        let (top, down, radius) = column;
        let (corner, axes, area, rim) = plate;
        let core = Core::new(Column { top, down, radius }, Plate { corner, axes, area, rim });
        Ok(Self { arm, core: core.map_err(Failure::into_exception)? })
    }

    fn gaps<'py>(
        &self,
        py: Python<'py>,
        joints: Rows<'py>,
        carriages: Rows<'py>,
        table_from_base: Rows<'py>,
    ) -> PyResult<Bound<'py, PyArray2<f64>>> {
        if joints.shape()[0] != carriages.shape()[0] {
            let (n, m) = (joints.shape()[0], carriages.shape()[0]);
            return Err(CoreError::new_err(format!("{n} places of the arm with {m} of the carriage")));
        }
        let frame = transform("table_from_base", &table_from_base)?;
        let (joints, width) = (contiguous("joints", &joints)?, joints.shape()[1]);
        let (carriages, three) = (contiguous("carriages", &carriages)?, carriages.shape()[1]);
        let found = quick(py, || {
            let (arm, table) = (Way::places(joints, width)?, Way::places(carriages, three)?);
            let (places, points) = (self.arm.along(&arm, &frame)?, table.points()?);
            let gaps = places.iter().zip(points).map(|(place, &at)| self.core.gaps(place, at));
            Ok::<_, ClearanceError>(gaps.map(|gap| [gap.links, gap.tool]).collect::<Vec<_>>())
        })?;
        let out = PyArray2::zeros(py, [found.len(), 2], false);
        {
            let mut borrowed = out.try_readwrite().map_err(|error| CoreError::new_err(error.to_string()))?;
            let values = borrowed.as_slice_mut().map_err(|error| CoreError::new_err(error.to_string()))?;
            values.copy_from_slice(found.as_flattened());
        }
        Ok(out)
    }

    fn least(
        &self,
        py: Python<'_>,
        arm: (Rows<'_>, f64),
        table: (Rows<'_>, f64),
        table_from_base: Rows<'_>,
    ) -> PyResult<(f64, f64)> {
        let frame = transform("table_from_base", &table_from_base)?;
        let (joints, width) = (contiguous("arm", &arm.0)?, arm.0.shape()[1]);
        let (carriages, three) = (contiguous("table", &table.0)?, table.0.shape()[1]);
        let (arm_step, table_step) = (arm.1, table.1);
        let least = quick(py, || {
            let way = Way::through(joints, width, arm_step)?;
            let points = Way::through(carriages, three, table_step)?;
            Ok::<_, ClearanceError>(self.core.least(&self.arm.along(&way, &frame)?, points.points()?))
        })?;
        Ok((least.links, least.tool))
    }
}
