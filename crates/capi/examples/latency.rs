//! How long single calls of the C functions take: `latency CALIB [CALLS]` prints JSON, seconds.
//!
//! Random walk: each call's readings are near those of the one before, as in a servo cycle. Random poses: all caches are
//! cold for the tables. Times include two readings of the clock.
#![allow(clippy::unwrap_used, clippy::expect_used, reason = "a program that may stop")]

use std::ffi::CString;
use std::ptr::{null, null_mut};
use std::time::Instant;

use truearm::*;

const CALLS: usize = 1_000_000;
/// Step of the walk, rad: a joint at 1 rad/s in 2 ms.
const STEP: f64 = 2e-3;
/// Readings are drawn between minus and plus so much, rad.
const REACH: f64 = 2.0;

/// SplitMix64 (Steele, Lea and Flood 2014).
struct Random(u64);

impl Random {
    /// Uniform between -1 and 1.
    fn sign(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9E37_79B9_7F4A_7C15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xBF58_476D_1CE4_E5B9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94D0_49BB_1331_11EB);
        ((z ^ (z >> 31)) >> 11) as f64 / (1_u64 << 52) as f64 - 1.0
    }
}

/// What is timed.
struct Rig {
    corrector: *mut CorrectorHandle,
    workspace: *mut WorkspaceHandle,
    stream: *mut StreamHandle,
    joints: usize,
}

impl Rig {
    fn new(path: &str) -> Self {
        let path = CString::new(path).unwrap();
        let (mut calibration, mut message) = (null_mut(), [0 as std::ffi::c_char; 256]);
        let (mut corrector, mut workspace, mut stream) = (null_mut(), null_mut(), null_mut());
        // SAFETY: all pointers are valid and of the sizes given.
        unsafe {
            let status = truearm_load_file(path.as_ptr(), &mut calibration, message.as_mut_ptr(), 256);
            assert_eq!(status, Status::Ok, "{path:?}");
            let mut options = truearm_default_options();
            // Looked at as by default, but no reason to refuse poses beyond the measured ones.
            options.largest_std_m = f64::MAX;
            truearm_corrector_new(calibration, null(), &options, &mut corrector, null_mut(), 0);
            truearm_workspace_new(corrector, &mut workspace);
            truearm_stream_new(corrector, null(), &mut stream, null_mut(), 0);
            Self { corrector, workspace, stream, joints: truearm_joint_count(calibration) }
        }
    }

    fn correct(&self, q: &[f64], out: &mut [f64]) -> Status {
        let (n, features) = (self.joints, null());
        // SAFETY: all pointers are valid and of the sizes given.
        unsafe {
            let (corrector, workspace) = (self.corrector, self.workspace);
            truearm_correct(corrector, workspace, q.as_ptr(), n, features, 0, out.as_mut_ptr(), n, null_mut())
        }
    }

    fn predict(&self, q: &[f64], out: &mut [f64]) -> Status {
        let (n, features) = (self.joints, null());
        // SAFETY: all pointers are valid and of the sizes given.
        unsafe {
            let (corrector, workspace) = (self.corrector, self.workspace);
            truearm_predict_position(corrector, workspace, q.as_ptr(), n, features, 0, out.as_mut_ptr(), 3)
        }
    }

    fn step(&self, q: &[f64], out: &mut [f64]) -> Status {
        let (n, features) = (self.joints, null());
        // SAFETY: all pointers are valid and of the sizes given.
        unsafe {
            truearm_stream_step(
                self.stream,
                q.as_ptr(),
                n,
                features,
                0,
                2e-3,
                out.as_mut_ptr(),
                n,
                null_mut(),
            )
        }
    }
}

/// Median, 99.9 % and largest time of a call, and how many were refused.
fn timed(
    calls: usize,
    joints: usize,
    mut next: impl FnMut(&mut [f64]),
    mut call: impl FnMut(&[f64], &mut [f64]) -> Status,
) -> String {
    let (mut q, mut out) = (vec![0.0; joints], vec![0.0; joints.max(3)]);
    let mut times = Vec::with_capacity(calls);
    let mut refused = 0;
    for _ in 0..calls {
        next(&mut q);
        let begin = Instant::now();
        let status = call(&q, &mut out[..]);
        times.push(begin.elapsed().as_secs_f64());
        assert!(status as i32 >= 0, "{status:?}");
        refused += usize::from(status != Status::Ok);
    }
    times.sort_by(f64::total_cmp);
    let at = |share: f64| times[((calls - 1) as f64 * share) as usize];
    let (median, rare, largest) = (at(0.5), at(0.999), at(1.0));
    format!("{{\"median\":{median:e},\"p999\":{rare:e},\"max\":{largest:e},\"refused\":{refused}}}")
}

fn main() {
    let mut words = std::env::args().skip(1);
    let path = words.next().expect("usage: latency CALIB [CALLS]");
    let calls = words.next().map_or(CALLS, |count| count.parse().expect("CALLS is a number"));
    let rig = Rig::new(&path);
    let (joints, mut random) = (rig.joints, Random(1));
    let mut anywhere = Random(2);
    let mut walk = move |q: &mut [f64]| {
        for value in q {
            *value = (*value + STEP * random.sign()).clamp(-REACH, REACH);
        }
    };
    let mut jump = move |q: &mut [f64]| q.iter_mut().for_each(|value| *value = REACH * anywhere.sign());
    let trim = |out: &mut [f64]| out.len().min(joints);
    let correct = |q: &[f64], out: &mut [f64]| {
        let count = trim(out);
        rig.correct(q, &mut out[..count])
    };
    let found = [
        ("correct_walk", timed(calls, joints, &mut walk, correct)),
        ("correct_random", timed(calls, joints, &mut jump, correct)),
        ("predict_walk", timed(calls, joints, &mut walk, |q, out| rig.predict(q, out))),
        ("predict_random", timed(calls, joints, &mut jump, |q, out| rig.predict(q, out))),
        ("stream_walk", timed(calls, joints, &mut walk, |q, out| rig.step(q, out))),
    ];
    let lines: Vec<String> = found.iter().map(|(name, times)| format!("\"{name}\": {times}")).collect();
    println!("{{{}}}", lines.join(", "));
}
