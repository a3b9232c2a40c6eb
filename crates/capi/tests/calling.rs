//! The C functions as C calls them: what they compute, and what they refuse.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

mod common;

use std::ptr::{null, null_mut};

use common::{BEYOND, File, HOME, JOINTS, Rig, text};
use serde_json::json;
use truearm::*;

#[test]
fn a_correction_brings_the_tool_to_where_the_program_means_it() {
    let mut nominal = File::new();
    nominal.content["models"]["variable"]["blocks"] = json!(null);
    let table: Vec<f64> = nominal.content["robot"]["table"]
        .as_array()
        .unwrap()
        .iter()
        .flat_map(|row| row.as_array().unwrap().iter().map(|value| value.as_f64().unwrap()))
        .collect();
    nominal.arrays[0].2 = table;
    let (rig, nominal) = (Rig::new(), Rig::of(&nominal.bytes(), &truearm_default_options()));
    let (status, corrected, found) = rig.correct(&HOME);
    assert_eq!((status, found.reason), (Status::Ok, 0));
    let (meant, reached) = (nominal.pose(&HOME), rig.pose(&corrected));
    for (a, b) in meant.iter().zip(reached) {
        assert!((a - b).abs() < 1e-9, "{a} {b}");
    }
    assert!(found.residual_m < 1e-9 && found.shift_m.iter().any(|x| x.abs() > 1e-4));
    let tool = nominal.pose(&corrected);
    let flange = [3, 7].map(|at| tool[at] - 0.15 * tool[at - 1]);
    let flange = flange[0].hypot(flange[1]) * (-9.0_f64 + 0.01).exp();
    assert!((found.std_m - (flange + 0.15 * (-8.0_f64 + 0.01).exp())).abs() < 1e-12);
}

#[test]
fn positions_are_those_of_poses() {
    let (rig, mut position) = (Rig::new(), [0.0; 3]);
    // SAFETY: all pointers are to memory of the sizes given.
    let status = unsafe {
        let (corrector, workspace) = (rig.corrector, rig.workspace);
        truearm_predict_position(
            corrector,
            workspace,
            HOME.as_ptr(),
            JOINTS,
            null(),
            0,
            position.as_mut_ptr(),
            3,
        )
    };
    let pose = rig.pose(&HOME);
    assert_eq!((status, position), (Status::Ok, [pose[3], pose[7], pose[11]]));
}

#[test]
fn what_is_refused_is_not_written() {
    let rig = Rig::new();
    let (status, out, found) = rig.correct(&BEYOND);
    assert_eq!((status, out), (Status::Refused, [-1.0; JOINTS]));
    assert_eq!((found.reason, found.joint, found.limit), (4, 1, 3.2));
    assert!(text(truearm_reason_text(found.reason)).contains("limits"));
    for bad in [f64::NAN, f64::INFINITY] {
        let mut q = HOME;
        q[3] = bad;
        let (status, out, found) = rig.correct(&q);
        assert_eq!((status, out, found.reason), (Status::NotFinite, [-1.0; JOINTS], 1));
    }
}

#[test]
fn a_bound_of_the_standard_deviation_refuses() {
    let mut options = truearm_default_options();
    options.largest_std_m = 1e-5;
    let (status, _, found) = Rig::of(&File::new().bytes(), &options).correct(&HOME);
    assert_eq!((status, found.reason, found.limit), (Status::Refused, 8, 1e-5));
}

#[test]
fn readings_may_be_overwritten_in_place() {
    let rig = Rig::new();
    let (_, apart, _) = rig.correct(&HOME);
    let mut q = HOME;
    let place = q.as_mut_ptr();
    // SAFETY: all pointers are to memory of the sizes given.
    let status = unsafe {
        let (corrector, workspace) = (rig.corrector, rig.workspace);
        truearm_correct(corrector, workspace, place, JOINTS, null(), 0, place, JOINTS, null_mut())
    };
    assert_eq!((status, q), (Status::Ok, apart));
}

#[test]
fn pointers_sizes_and_handles_are_checked() {
    let rig = Rig::new();
    let mut out = [0.0; JOINTS];
    let mut call = |corrector, workspace, q: *const f64, joints, features: *const f64, count, size| {
        let out = if size == 99 { null_mut() } else { out.as_mut_ptr() };
        let size = if size == 99 { JOINTS } else { size };
        // SAFETY: what is not null has the sizes given, or is refused before it is read.
        unsafe { truearm_correct(corrector, workspace, q, joints, features, count, out, size, null_mut()) }
    };
    let (c, w, q) = (rig.corrector, rig.workspace, HOME.as_ptr());
    assert_eq!(call(c, w, q, JOINTS, null(), 0, JOINTS), Status::Ok);
    assert_eq!(call(null_mut(), w, q, JOINTS, null(), 0, JOINTS), Status::BadPointer);
    assert_eq!(call(c, null_mut(), q, JOINTS, null(), 0, JOINTS), Status::BadPointer);
    assert_eq!(call(c, w, null(), JOINTS, null(), 0, JOINTS), Status::BadPointer);
    assert_eq!(
        call(c, w, q.cast::<u8>().wrapping_add(1).cast(), JOINTS, null(), 0, JOINTS),
        Status::BadPointer
    );
    assert_eq!(call(c, w, q, JOINTS, null(), 0, 99), Status::BadPointer);
    assert_eq!(call(c, w, q, 5, null(), 0, JOINTS), Status::WrongSize);
    assert_eq!(call(c, w, q, JOINTS, q, 1, JOINTS), Status::WrongSize);
    assert_eq!(call(c, w, q, JOINTS, null(), 0, 7), Status::WrongSize);
    assert_eq!(call(w.cast(), w, q, JOINTS, null(), 0, JOINTS), Status::BadHandle);
    assert_eq!(call(c, c.cast(), q, JOINTS, null(), 0, JOINTS), Status::BadHandle);
}

#[test]
fn null_is_freed_and_strangers_are_not() {
    let rig = Rig::new();
    // SAFETY: null, and handles of other kinds, which are left alone.
    unsafe {
        assert_eq!(truearm_stream_free(null_mut()), Status::Ok);
        assert_eq!(truearm_corrector_free(null_mut()), Status::Ok);
        assert_eq!(truearm_stream_free(rig.corrector.cast()), Status::BadHandle);
        assert_eq!(truearm_calibration_free(rig.corrector.cast()), Status::BadHandle);
        assert_eq!(truearm_joint_count(null()), 0);
    }
    assert_eq!(rig.correct(&HOME).0, Status::Ok);
}

#[test]
fn threads_share_a_corrector() {
    let rig = Rig::new();
    let (_, expected, _) = rig.correct(&HOME);
    let corrector = rig.corrector as usize;
    std::thread::scope(|scope| {
        for _ in 0..4 {
            scope.spawn(move || {
                let corrector = corrector as *const CorrectorHandle;
                let (mut workspace, mut out) = (null_mut(), [0.0; JOINTS]);
                // SAFETY: all pointers are valid; the workspace is this thread's own.
                unsafe {
                    assert_eq!(truearm_workspace_new(corrector, &mut workspace), Status::Ok);
                    for _ in 0..200 {
                        let (q, to) = (HOME.as_ptr(), out.as_mut_ptr());
                        let status = truearm_correct(
                            corrector,
                            workspace,
                            q,
                            JOINTS,
                            null(),
                            0,
                            to,
                            JOINTS,
                            null_mut(),
                        );
                        assert_eq!((status, out), (Status::Ok, expected));
                    }
                    truearm_workspace_free(workspace);
                }
            });
        }
    });
}

#[test]
fn streams_ramp_up_and_hold() {
    let rig = Rig::new();
    let stream = rig.stream();
    let (_, whole, _) = rig.correct(&HOME);
    let mut out = [0.0; JOINTS];
    let mut step = |q: *const f64, elapsed: f64| {
        let mut state = StreamState { phase: 99, reason: 99, gain: 0.0, lag: 0.0 };
        // SAFETY: all pointers are to memory of the sizes given.
        let status = unsafe {
            truearm_stream_step(stream, q, JOINTS, null(), 0, elapsed, out.as_mut_ptr(), JOINTS, &mut state)
        };
        (status, out, state)
    };
    assert_eq!(step(null(), 0.0).0, Status::NotStarted);
    assert_eq!(step(HOME.as_ptr(), 0.0).1, HOME);
    for _ in 0..600 {
        assert_eq!(step(HOME.as_ptr(), 0.002).0, Status::Ok);
    }
    let (_, out, state) = step(HOME.as_ptr(), 0.002);
    assert_eq!(state.phase, 2);
    assert!(out.iter().zip(whole).all(|(a, b)| (a - b).abs() < 1e-9));
    let (status, held, state) = step(null(), 0.002);
    assert_eq!((status, state.phase, state.reason), (Status::Held, 3, 1));
    assert!(held.iter().zip(whole).all(|(a, b)| (a - b).abs() < 1e-6));
    let (status, _, state) = step(BEYOND.as_ptr(), 0.002);
    assert_eq!((status, state.reason), (Status::Held, 4));
    assert_eq!(step(HOME.as_ptr(), 3.0).2.reason, 100);
    // SAFETY: made above and not used afterwards.
    unsafe {
        assert_eq!(truearm_stream_switch(stream, 0), Status::Ok);
        assert_eq!(truearm_stream_free(stream), Status::Ok);
    }
}

#[test]
fn every_status_and_reason_has_words() {
    let known = |text: String| !text.starts_with("no ");
    assert!((-15..=2).all(|status| known(text(truearm_status_text(status)))));
    assert!((0..=11).chain([100]).all(|reason| known(text(truearm_reason_text(reason)))));
    assert!(!known(text(truearm_status_text(77))) && !known(text(truearm_reason_text(77))));
    assert_eq!(truearm_abi_version(), TRUEARM_ABI_VERSION);
    assert_eq!(text(truearm_version()), env!("CARGO_PKG_VERSION"));
}

#[test]
fn a_workspace_serves_the_corrector_that_it_was_made_for() {
    let (mut rig, mut other) = (Rig::new(), Rig::new());
    std::mem::swap(&mut rig.workspace, &mut other.workspace);
    assert_eq!(rig.correct(&HOME).0, Status::OtherWorkspace);
    std::mem::swap(&mut rig.workspace, &mut other.workspace);
    assert_eq!(rig.correct(&HOME).0, Status::Ok);
}

#[test]
fn a_stranger_is_told_by_its_first_eight_bytes() {
    let mut word = 7_u64;
    let stranger = &raw mut word;
    // SAFETY: eight bytes are read, and found to be no handle.
    unsafe {
        let (q, out) = (HOME.as_ptr(), [0.0; JOINTS].as_mut_ptr());
        let step = truearm_stream_step(stranger.cast(), q, JOINTS, null(), 0, 0.0, out, JOINTS, null_mut());
        assert_eq!(step, Status::BadHandle);
        assert_eq!(truearm_stream_switch(stranger.cast(), 0), Status::BadHandle);
        assert_eq!(truearm_joint_count(stranger.cast()), 0);
        assert_eq!(truearm_stream_free(stranger.cast()), Status::BadHandle);
        assert_eq!(truearm_workspace_free(stranger.cast()), Status::BadHandle);
        assert_eq!(truearm_corrector_free(stranger.cast()), Status::BadHandle);
        assert_eq!(truearm_calibration_free(stranger.cast()), Status::BadHandle);
        let mut made = null_mut();
        assert_eq!(truearm_workspace_new(stranger.cast(), &mut made), Status::BadHandle);
    }
}

#[test]
fn what_is_too_large_to_be_computed_is_not_finite() {
    let mut file = File::new();
    for link in [1, 2] {
        file.arrays[0].2[5 * link + 2] = 1.7e308;
    }
    let (rig, mut pose) = (Rig::of(&file.bytes(), &truearm_default_options()), [-1.0; 16]);
    // SAFETY: all pointers are to memory of the sizes given.
    unsafe {
        let (corrector, workspace, q, to) = (rig.corrector, rig.workspace, [0.0; JOINTS], pose.as_mut_ptr());
        let status = truearm_predict_pose(corrector, workspace, q.as_ptr(), JOINTS, null(), 0, to, 16);
        assert_eq!(status, Status::NotFinite);
        let status = truearm_predict_position(corrector, workspace, q.as_ptr(), JOINTS, null(), 0, to, 3);
        assert_eq!(status, Status::NotFinite);
    }
    assert_eq!(pose, [-1.0; 16]);
}

#[test]
#[cfg(all(target_arch = "x86_64", target_os = "linux"))]
fn a_thread_that_does_not_round_to_nearest_gets_no_numbers() {
    // SAFETY: as the C library declares it.
    unsafe extern "C" {
        fn fesetround(mode: i32) -> i32;
    }
    let (rig, bytes) = (Rig::new(), File::new().bytes());
    let (stream, mut out, mut calibration) = (rig.stream(), [-1.0; JOINTS], null_mut());
    for (mode, expected) in [
        (0x400, Status::BadRounding),
        (0x800, Status::BadRounding),
        (0xc00, Status::BadRounding),
        (0, Status::Ok),
    ] {
        let (c, w, q, to) = (rig.corrector, rig.workspace, HOME.as_ptr(), out.as_mut_ptr());
        // SAFETY: all pointers are to memory of the sizes given; the last mode is the usual one.
        let found = unsafe {
            assert_eq!(fesetround(mode), 0);
            let found = [
                truearm_correct(c, w, q, JOINTS, null(), 0, to, JOINTS, null_mut()),
                truearm_predict_position(c, w, q, JOINTS, null(), 0, to, 3),
                truearm_stream_step(stream, q, JOINTS, null(), 0, 0.0, to, JOINTS, null_mut()),
                truearm_load_memory(bytes.as_ptr(), bytes.len(), &mut calibration, null_mut(), 0),
            ];
            fesetround(0);
            found
        };
        assert_eq!(found, [expected; 4]);
        assert_eq!(out == [-1.0; JOINTS], expected == Status::BadRounding);
    }
    // SAFETY: made above and not used afterwards.
    unsafe {
        truearm_stream_free(stream);
        truearm_calibration_free(calibration);
    }
}

#[test]
fn nothing_happens_to_a_stream_whose_state_has_no_place() {
    let rig = Rig::new();
    let (stream, mut out, mut states) = (rig.stream(), [0.0; JOINTS], [0_u64; 8]);
    let askew = states.as_mut_ptr().cast::<u8>().wrapping_add(1).cast();
    let mut step = |q: *const f64, state| {
        // SAFETY: all pointers are to memory of the sizes given; one that is askew is refused.
        unsafe { truearm_stream_step(stream, q, JOINTS, null(), 0, 0.0, out.as_mut_ptr(), JOINTS, state) }
    };
    assert_eq!(step(HOME.as_ptr(), askew), Status::BadPointer);
    assert_eq!(step(null(), null_mut()), Status::NotStarted);
    // SAFETY: made above and not used afterwards.
    unsafe { truearm_stream_free(stream) };
}

#[test]
fn a_missing_set_point_needs_no_features() {
    let mut file = File::new();
    file.content["options"]["features"] = json!(["temperature_C"]);
    file.content["conservative"]["ranges"] = json!(vec![json!(null); JOINTS + 1]);
    let rig = Rig::of(&file.bytes(), &truearm_default_options());
    let (stream, warm, mut out) = (rig.stream(), [25.0], [0.0; JOINTS]);
    let mut step = |q: *const f64, features: *const f64, count| {
        let to = out.as_mut_ptr();
        // SAFETY: all pointers are to memory of the sizes given.
        unsafe { truearm_stream_step(stream, q, JOINTS, features, count, 0.002, to, JOINTS, null_mut()) }
    };
    assert_eq!(step(HOME.as_ptr(), warm.as_ptr(), 1), Status::Ok);
    assert_eq!(step(null(), null(), 1), Status::Held);
    assert_eq!(step(null(), null(), 0), Status::Held);
    assert_eq!(step(HOME.as_ptr(), null(), 1), Status::BadPointer);
    assert_eq!(step(HOME.as_ptr(), null(), 0), Status::WrongSize);
    assert!(text(truearm_status_text(Status::WrongSize as i32)).contains("truearm_feature_count"));
    // SAFETY: made above and not used afterwards.
    unsafe { truearm_stream_free(stream) };
}
