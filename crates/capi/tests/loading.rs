//! Files that are read, and files that are refused with the right words.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

mod common;

use std::ffi::CString;
use std::ptr::{null, null_mut};

use common::{File, JOINTS, Rig, load, text};
use serde_json::json;
use truearm::*;

fn refused(bytes: &[u8]) -> (Status, String) {
    load(bytes).err().unwrap()
}

#[test]
fn a_file_is_read_from_disk_and_from_memory() {
    let bytes = File::new().bytes();
    let path = std::env::temp_dir().join(format!("truearm-{}.calib", std::process::id()));
    std::fs::write(&path, &bytes).unwrap();
    let name = CString::new(path.to_str().unwrap()).unwrap();
    let (mut out, mut arm) = (null_mut(), [1 as std::ffi::c_char; 5]);
    // SAFETY: all pointers are to memory of the sizes given.
    unsafe {
        assert_eq!(truearm_load_file(name.as_ptr(), &mut out, null_mut(), 0), Status::Ok);
        assert_eq!((truearm_joint_count(out), truearm_feature_count(out)), (JOINTS, 0));
        assert_eq!(truearm_robot_name(out, arm.as_mut_ptr(), arm.len()), Status::Ok);
        assert_eq!(truearm_calibration_free(out), Status::Ok);
    }
    std::fs::remove_file(path).unwrap();
    assert_eq!(text(arm.as_ptr()), "test");
}

#[test]
fn a_missing_file_is_said_to_be_missing() {
    let (mut out, mut message) = (null_mut(), [0 as std::ffi::c_char; 200]);
    // SAFETY: all pointers are to memory of the sizes given.
    let status =
        unsafe { truearm_load_file(c"/no/such/file.calib".as_ptr(), &mut out, message.as_mut_ptr(), 200) };
    assert_eq!((status, out), (Status::Unreadable, null_mut()));
    assert!(text(message.as_ptr()).contains("cannot be read"));
}

/// A path of this test in the system's folder for such.
fn scratch(name: &str) -> std::path::PathBuf {
    std::env::temp_dir().join(format!("truearm-{}-{name}", std::process::id()))
}

/// The status and the message of a file that is refused.
fn refused_file(path: &std::path::Path) -> (Status, String) {
    let name = CString::new(path.to_str().unwrap()).unwrap();
    let (mut out, mut message) = (null_mut(), [0 as std::ffi::c_char; 200]);
    // SAFETY: all pointers are to memory of the sizes given.
    let status = unsafe { truearm_load_file(name.as_ptr(), &mut out, message.as_mut_ptr(), 200) };
    assert_eq!(out, null_mut());
    (status, text(message.as_ptr()))
}

#[test]
#[cfg(unix)]
fn what_is_no_regular_file_is_refused_without_waiting_for_its_end() {
    let pipe = scratch("pipe");
    assert!(std::process::Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    for (path, what) in [
        (pipe.as_path(), "a pipe or a device"),
        ("/dev/zero".as_ref(), "a pipe or a device"),
        ("/".as_ref(), "a directory"),
    ] {
        let (status, said) = refused_file(path);
        assert_eq!(status, Status::Unreadable);
        assert!(said.contains(what) && said.contains("a regular file is needed"), "{said}");
    }
    std::fs::remove_file(pipe).unwrap();
}

#[test]
fn a_file_is_refused_by_its_first_bytes_however_long_it_is() {
    let path = scratch("long");
    let endless = 1_u64 << 40;
    for (first, status) in [
        (&b""[..], Status::NotACalibration),
        (b"\x02\0\0\0\0\0\0\0[", Status::NotACalibration),
        (b"\0\0\0\0\0\x01\0\0{", Status::NotACalibration),
    ] {
        std::fs::write(&path, first).unwrap();
        std::fs::OpenOptions::new().write(true).open(&path).unwrap().set_len(endless).unwrap();
        assert_eq!(refused_file(&path).0, status);
    }
    std::fs::write(&path, b"\0\x01\0\0\0\0\0\0{}").unwrap();
    let (status, said) = refused_file(&path);
    assert_eq!(status, Status::Altered);
    assert!(said.contains("it has 10 bytes, its header alone needs 264"), "{said}");
    std::fs::remove_file(path).unwrap();
}

#[test]
#[cfg(unix)]
fn a_name_is_whatever_the_system_takes() {
    let (mut out, mut message) = (null_mut(), [1 as std::ffi::c_char; 200]);
    // SAFETY: all pointers are to memory of the sizes given.
    let status =
        unsafe { truearm_load_file(c"/no/\xe9.calib".as_ptr(), &mut out, message.as_mut_ptr(), 200) };
    assert_eq!(status, Status::Unreadable);
}

#[test]
fn every_failure_has_a_message_and_success_an_empty_one() {
    let calibration = load(&File::new().bytes()).unwrap();
    let (mut out, mut message) = (null_mut(), [1 as std::ffi::c_char; 200]);
    let (no_motion, buffer) = ([0.0; 16], message.as_mut_ptr());
    // SAFETY: all pointers are to memory of the sizes given.
    unsafe {
        let made = truearm_corrector_new(calibration, no_motion.as_ptr(), null(), &mut out, buffer, 200);
        assert_eq!((made, out), (Status::BadOption, null_mut()));
        assert!(text(buffer).contains("0 0 0 1"));
        let made = truearm_corrector_new(null(), null(), null(), &mut out, buffer, 200);
        assert_eq!(made, Status::BadPointer);
        assert_eq!(text(buffer), text(truearm_status_text(made as i32)));
        let made = truearm_corrector_new(calibration, null(), null(), &mut out, buffer, 200);
        assert_eq!((made, text(buffer)), (Status::Ok, String::new()));
        assert_eq!(truearm_corrector_free(out), Status::Ok);
        assert_eq!(truearm_calibration_free(calibration), Status::Ok);
    }
}

#[test]
fn every_altered_byte_is_noticed() {
    let bytes = File::new().bytes();
    for place in (0..bytes.len()).step_by(101) {
        let mut other = bytes.clone();
        other[place] ^= 1;
        let (status, _) = refused(&other);
        assert!(matches!(status, Status::Altered | Status::NotACalibration), "{place}: {status:?}");
    }
    for length in [0, 1, 8, 9, 100, bytes.len() / 2, bytes.len() - 1] {
        let (status, _) = refused(&bytes[..length]);
        assert!(matches!(status, Status::Altered | Status::NotACalibration), "{length}: {status:?}");
    }
}

#[test]
fn other_files_and_layouts_are_refused_in_words() {
    assert!(refused(b"").1.contains("it is empty"));
    assert!(refused(b"PK\x03\x04 something else").1.contains("no safetensors file"));
    let mut file = File::new();
    file.content["schema"] = json!(7);
    let (status, words) = refused(&file.bytes());
    assert_eq!(status, Status::UnknownLayout);
    assert!(words.contains("version 7") && words.contains("0.1.0"), "{words}");
}

#[test]
fn a_whole_calibration_with_a_model_of_another_kind_is_not_called_altered() {
    let mut file = File::new();
    file.content["scheme"] = json!({"name": "fcmac"});
    let (status, words) = refused(&file.bytes());
    assert_eq!(status, Status::UnknownModel);
    assert!(words.contains("--model constant or --model variable"), "{words}");
}

/// A factor with a row less.
fn shortened(file: &mut File) {
    let (_, shape, values) = &mut file.arrays[4];
    shape[0] -= 1;
    values.truncate(shape[0] * shape[1]);
}

#[test]
fn contents_that_contradict_themselves_are_refused() {
    type Change = fn(&mut File);
    let changes: [(Change, &str); 12] = [
        (|file| drop(file.arrays.remove(2)), "variable.block0.weights"),
        (|file| file.arrays[0].2[3] = f64::NAN, "finite"),
        (|file| file.arrays[2].2[3] = f64::INFINITY, "finite"),
        (|file| file.content["robot"]["convention"] = json!("other"), "convention"),
        (|file| file.content["robot"]["limits"] = json!([]), "limits"),
        (|file| file.content["models"]["variable"]["blocks"][0]["inputs"] = json!([9]), "inputs of a block"),
        (|file| file.content["models"]["variable"]["blocks"][0]["outputs"] = json!([99]), "outputs"),
        (|file| file.content["models"]["variable"]["blocks"][0]["axes"][0][4] = json!(0), "axes of a block"),
        (|file| file.content["conservative"]["level"] = json!([1.0]), "length 1"),
        (|file| drop(file.arrays.remove(4)), "conservative.leverage"),
        (|file| file.arrays[4].2[7] = f64::NAN, "finite"),
        (shortened, "factor of the standard deviation"),
    ];
    for (change, words) in changes {
        let mut file = File::new();
        change(&mut file);
        let (status, said) = refused(&file.bytes());
        assert_eq!(status, Status::Altered, "{words}");
        assert!(said.contains(words), "{words}: {said}");
    }
}

#[test]
fn absurd_sizes_cost_nothing() {
    for count in [json!(u64::MAX), json!(100_001), json!(-1)] {
        let mut file = File::new();
        file.content["models"]["variable"]["blocks"][0]["axes"][0][4] = count;
        assert_eq!(refused(&file.bytes()).0, Status::Altered);
    }
}

#[test]
fn options_are_checked() {
    let rig = Rig::new();
    let options = |change: fn(&mut CorrectorOptions)| {
        let mut options = truearm_default_options();
        change(&mut options);
        let (mut out, mut message) = (null_mut(), [0 as std::ffi::c_char; 200]);
        // SAFETY: all pointers are to memory of the sizes given.
        let status = unsafe {
            let message = message.as_mut_ptr();
            truearm_corrector_new(rig.calibration, null(), &options, &mut out, message, 200)
        };
        assert_eq!(out, null_mut());
        (status, text(message.as_ptr()))
    };
    assert_eq!(options(|options| options.task = 3), (Status::BadOption, "the task must be 0, 1 or 2".into()));
    let (_, words) = options(|options| options.largest_slide_m = 0.0);
    assert!(words.contains("a prismatic joint is 0"), "{words}");
    let (status, words) = options(|options| options.largest_shift_m = -1.0);
    assert!(status == Status::BadOption && words.contains("largest shift is -1"), "{words}");
    assert_eq!(options(|options| options.moving = 1 << 40).0, Status::BadOption);
    let shear = [1.0, 0.2, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 1.0];
    let mut out = null_mut();
    // SAFETY: all pointers are to memory of the sizes given.
    let status =
        unsafe { truearm_corrector_new(rig.calibration, shear.as_ptr(), null(), &mut out, null_mut(), 0) };
    assert_eq!((status, out), (Status::BadOption, null_mut()));
}
