//! Calibration files made for the tests: an arm with known errors, in the layout that truearm writes.
#![allow(dead_code, missing_docs, clippy::unwrap_used, reason = "each test binary uses a part of it")]

use std::ptr::{null, null_mut};

use safetensors::tensor::{Dtype, TensorView, serialize};
use serde_json::{Value, json};
use sha2::{Digest, Sha256};
use truearm::*;

pub const JOINTS: usize = 6;
pub const HOME: [f64; JOINTS] = [0.3, -1.2, 1.4, -0.7, 1.1, 0.2];
pub const BEYOND: [f64; JOINTS] = [3.5, -1.2, 1.4, -0.7, 1.1, 0.2];
const CELLS: usize = 40;

/// What stands in a file, to be changed before it is written.
pub struct File {
    pub content: Value,
    pub arrays: Vec<(String, Vec<usize>, Vec<f64>)>,
}

impl File {
    /// An arm with errors of a millirad, a curve on joint 2, and bounds of the standard deviation.
    pub fn new() -> Self {
        let half = std::f64::consts::FRAC_PI_2;
        let table = [
            [0.0, 0.1273, 0.0, half, 0.0],
            [0.0, 0.0, -0.612, 0.0, 0.0],
            [0.0, 0.0, -0.5723, 0.0, 0.0],
            [0.0, 0.1639, 0.0, half, 0.0],
            [0.0, 0.1157, 0.0, -half, 0.0],
            [0.0, 0.0922, 0.0, 0.0, 0.0],
        ];
        let constants: Vec<f64> = table
            .iter()
            .flatten()
            .enumerate()
            .map(|(k, value)| value + if k % 5 == 0 { 1e-3 * (k as f64).cos() } else { 0.0 })
            .collect();
        let curve: Vec<f64> = (0..CELLS).map(|cell| 3e-4 * (0.9 * cell as f64).sin()).collect();
        let unit = |size: usize| -> Vec<Vec<f64>> {
            (0..size).map(|i| (0..size).map(|j| f64::from(u8::from(i == j))).collect()).collect()
        };
        // The base turns about its z axis, and nothing else is uncertain.
        let mut factor = vec![0.0; 8 * (5 * JOINTS + 9)];
        factor[8 * (5 * JOINTS + 5) + 2] = 1.0;
        let spacing = std::f64::consts::TAU / CELLS as f64;
        let axis = json!([true, 1.0, -std::f64::consts::PI, spacing, CELLS, true, 2]);
        let mut tool = unit(4);
        tool[2][3] = 0.15;
        let content = json!({
            "schema": 1, "sha256": "0".repeat(64), "version": "0.1.0",
            "robot": {
                "name": "test arm", "convention": "standard", "joints": vec!["revolute"; JOINTS],
                "table": table, "base": unit(4), "flange": unit(4), "tool": tool, "base_row": null,
                "coupling": unit(JOINTS), "limits": vec![[-3.2, 3.2]; JOINTS],
            },
            "options": {"frame": "free", "features": [], "degree": 2},
            "models": {
                "nominal": {"blocks": null},
                "constant": {"blocks": null},
                "variable": {"blocks": [
                    {"name": "own", "inputs": [1], "axes": [axis.clone()], "outputs": [5]}
                ]},
            },
            "conservative": {
                "blocks": [{"name": "each", "inputs": [2], "axes": [axis], "outputs": [0, 1]}],
                "level": [-9.0, -8.0], "largest": [1e-3, 1e-3], "ranges": vec![Value::Null; JOINTS],
                "looseness": [1.1, 1.1], "leverage": true,
            },
        });
        let arrays = vec![
            ("variable.constants".to_owned(), vec![JOINTS, 5], constants.clone()),
            ("constant.constants".to_owned(), vec![JOINTS, 5], constants),
            ("variable.block0.weights".to_owned(), vec![CELLS, 1], curve),
            ("conservative.block0.weights".to_owned(), vec![CELLS, 2], vec![0.01; 2 * CELLS]),
            ("conservative.leverage".to_owned(), vec![5 * JOINTS + 9, 8], factor),
        ];
        Self { content, arrays }
    }

    /// The bytes of the file, its digest included.
    pub fn bytes(&self) -> Vec<u8> {
        let raw: Vec<Vec<u8>> =
            self.arrays.iter().map(|a| a.2.iter().flat_map(|x| x.to_le_bytes()).collect()).collect();
        let views = self.arrays.iter().zip(&raw).map(|((name, shape, _), bytes)| {
            (name.clone(), TensorView::new(Dtype::F64, shape.clone(), bytes).unwrap())
        });
        let metadata = [("truearm".to_owned(), ordered(&self.content))].into();
        let mut bytes = serialize(views, Some(metadata)).unwrap();
        let key = br#"\"sha256\":\""#;
        let first = bytes.windows(key.len()).position(|window| window == key).unwrap() + key.len();
        let digest: String = Sha256::digest(&bytes).iter().map(|byte| format!("{byte:02x}")).collect();
        bytes[first..first + 64].copy_from_slice(digest.as_bytes());
        bytes
    }
}

/// JSON text without spaces.
fn ordered(content: &Value) -> String {
    serde_json::to_string(content).unwrap()
}

/// Loads bytes; the status and the message where that fails.
pub fn load(bytes: &[u8]) -> Result<*mut Calibration, (Status, String)> {
    let (mut out, mut message) = (null_mut(), [0 as std::ffi::c_char; 300]);
    // SAFETY: all pointers are to memory of the sizes given.
    let status =
        unsafe { truearm_load_memory(bytes.as_ptr(), bytes.len(), &mut out, message.as_mut_ptr(), 300) };
    if status == Status::Ok { Ok(out) } else { Err((status, text(message.as_ptr()))) }
}

/// A text of C.
pub fn text(pointer: *const std::ffi::c_char) -> String {
    // SAFETY: texts of the library end with a zero.
    unsafe { std::ffi::CStr::from_ptr(pointer) }.to_str().unwrap().to_owned()
}

/// A corrector with a workspace for the test arm, and everything freed at the end.
pub struct Rig {
    pub calibration: *mut Calibration,
    pub corrector: *mut CorrectorHandle,
    pub workspace: *mut WorkspaceHandle,
}

impl Rig {
    pub fn new() -> Self {
        Self::of(&File::new().bytes(), &truearm_default_options())
    }

    pub fn of(bytes: &[u8], options: &CorrectorOptions) -> Self {
        let calibration = load(bytes).unwrap();
        let (mut corrector, mut workspace) = (null_mut(), null_mut());
        // SAFETY: all pointers are valid.
        unsafe {
            let status = truearm_corrector_new(calibration, null(), options, &mut corrector, null_mut(), 0);
            assert_eq!(status, Status::Ok);
            assert_eq!(truearm_workspace_new(corrector, &mut workspace), Status::Ok);
        }
        Self { calibration, corrector, workspace }
    }

    pub fn correct(&self, q: &[f64; JOINTS]) -> (Status, [f64; JOINTS], Waypoint) {
        let mut out = [-1.0; JOINTS];
        let mut found = std::mem::MaybeUninit::<Waypoint>::zeroed();
        // SAFETY: all pointers are to memory of the sizes given; zeros are a correction too.
        unsafe {
            let status = truearm_correct(
                self.corrector,
                self.workspace,
                q.as_ptr(),
                JOINTS,
                null(),
                0,
                out.as_mut_ptr(),
                JOINTS,
                found.as_mut_ptr(),
            );
            (status, out, found.assume_init())
        }
    }

    pub fn pose(&self, q: &[f64; JOINTS]) -> [f64; 16] {
        let mut pose = [0.0; 16];
        // SAFETY: all pointers are to memory of the sizes given.
        let status = unsafe {
            let (corrector, workspace) = (self.corrector, self.workspace);
            truearm_predict_pose(corrector, workspace, q.as_ptr(), JOINTS, null(), 0, pose.as_mut_ptr(), 16)
        };
        assert_eq!(status, Status::Ok);
        pose
    }

    pub fn stream(&self) -> *mut StreamHandle {
        let mut stream = null_mut();
        // SAFETY: all pointers are valid.
        let status = unsafe { truearm_stream_new(self.corrector, null(), &mut stream, null_mut(), 0) };
        assert_eq!(status, Status::Ok);
        stream
    }
}

impl Drop for Rig {
    fn drop(&mut self) {
        // SAFETY: they were made by `of` and are not used afterwards.
        unsafe {
            truearm_workspace_free(self.workspace);
            truearm_corrector_free(self.corrector);
            truearm_calibration_free(self.calibration);
        }
    }
}
