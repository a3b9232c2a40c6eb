//! The examples in C and C++, compiled with the header and run against the library.
//!
//! `TRUEARM_SANITIZE=1` compiles them with the address and undefined-behaviour sanitizers, as `make check-capi` does.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

mod common;

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::sync::atomic::{AtomicUsize, Ordering};

use common::{BEYOND, File, HOME, JOINTS, Rig};

const STRICT: [&str; 5] = ["-Wall", "-Wextra", "-Wpedantic", "-Werror", "-O1"];
const SANITIZERS: [&str; 3] = ["-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g"];

static MADE: AtomicUsize = AtomicUsize::new(0);

struct Example {
    program: PathBuf,
    calibration: PathBuf,
}

impl Example {
    /// Compiles an example; None, said in words, where there is no compiler.
    fn new(compiler: &str, standard: &str, source: &str) -> Option<Self> {
        if Command::new(compiler).arg("--version").output().is_err() {
            eprintln!("skipped: there is no {compiler}");
            return None;
        }
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let number = MADE.fetch_add(1, Ordering::Relaxed);
        let folder = std::env::temp_dir().join(format!("truearm-{}-{number}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        let (program, calibration) = (folder.join("example"), folder.join("arm.calib"));
        std::fs::write(&calibration, File::new().bytes()).unwrap();
        let mut command = Command::new(compiler);
        command.arg(standard).args(STRICT).arg("-I").arg(root.join("include"));
        command.arg(root.join("../../examples/c").join(source)).arg("-o").arg(&program).arg(library());
        command.args(["-lpthread", "-ldl", "-lm"]);
        if std::env::var_os("TRUEARM_SANITIZE").is_some() {
            command.args(SANITIZERS);
        }
        let done = command.output().unwrap();
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        Some(Self { program, calibration })
    }

    fn run(&self, q: &[f64]) -> Output {
        let words = q.iter().map(f64::to_string);
        Command::new(&self.program).arg(&self.calibration).args(words).output().unwrap()
    }

    fn says(&self, q: &[f64]) -> String {
        let done = self.run(q);
        assert!(done.status.success(), "{}", String::from_utf8_lossy(&done.stderr));
        String::from_utf8(done.stdout).unwrap()
    }
}

impl Drop for Example {
    fn drop(&mut self) {
        std::fs::remove_dir_all(self.program.parent().unwrap()).unwrap();
    }
}

/// The static library, which cargo leaves beside the tests.
fn library() -> PathBuf {
    let beside = std::env::current_exe().unwrap();
    let folders = [beside.parent().unwrap(), beside.parent().unwrap().parent().unwrap()];
    let found = folders.into_iter().map(|folder| folder.join("libtruearm.a")).find(|path| path.exists());
    found.unwrap()
}

/// The numbers of the line that begins with a word.
fn numbers(said: &str, word: &str) -> Vec<f64> {
    let line = said.lines().find_map(|line| line.strip_prefix(word)).unwrap();
    line.split_whitespace().map(|number| number.parse().unwrap()).collect()
}

#[test]
fn the_c_example_corrects_as_the_library_does() {
    let Some(example) = Example::new("cc", "-std=c11", "correct.c") else { return };
    let (_, expected, found) = Rig::new().correct(&HOME);
    let said = example.says(&HOME);
    assert_eq!(numbers(&said, "corrected"), expected);
    assert_eq!(numbers(&said, "std"), [found.std_m]);
    let pose = Rig::new().pose(&expected);
    assert_eq!(numbers(&said, "position"), [pose[3], pose[7], pose[11]]);
    let streamed = numbers(&said, "streamed");
    assert!(streamed.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-9));
    assert!(said.contains("phase 2 gain 1"), "{said}");
    assert!(example.says(&BEYOND).contains("refused 4: a corrected joint would be beyond its limits"));
}

#[test]
fn the_c_example_says_what_is_wrong() {
    let Some(example) = Example::new("cc", "-std=c11", "correct.c") else { return };
    assert_eq!(example.run(&HOME[..3]).status.code(), Some(2));
    std::fs::write(&example.calibration, b"{\"no\": \"calibration\"}").unwrap();
    let done = example.run(&HOME);
    assert_eq!(done.status.code(), Some(1));
    assert!(String::from_utf8(done.stderr).unwrap().contains("this is no calibration"));
}

#[test]
fn the_cpp_example_corrects_in_threads() {
    let Some(example) = Example::new("c++", "-std=c++17", "correct.cpp") else { return };
    let (_, expected, _) = Rig::new().correct(&HOME);
    let said = example.says(&HOME);
    assert_eq!(numbers(&said, "corrected"), expected);
    assert!(said.contains("threads agree: yes"), "{said}");
    assert!(!example.run(&HOME[..JOINTS - 1]).status.success());
}
