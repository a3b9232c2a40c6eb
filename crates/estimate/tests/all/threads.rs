//! The same bits whatever the threads, the same numbers whatever the instruction set.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use std::process::Command;

use crate::common::arms::{all_columns, ur10, ur10_columns};
use crate::common::assert_close;
use crate::common::scene::Plan;
use truearm_estimate::{ConstantFit, ConstantOptions, Prior, Robust, fit_constant, identifiability};

fn fit(poses: Vec<usize>, robust: Option<Robust>) -> ConstantFit {
    let plan =
        Plan { rotations: true, targets: 2, noise: (1e-4, 3e-4), ..Plan::new(ur10(), ur10_columns(), 0) };
    let scene = Plan { poses, ..plan }.make();
    let options = ConstantOptions { prior: Some(Prior::default()), robust, ..ConstantOptions::default() };
    fit_constant(&scene.problem(), &options).unwrap()
}

/// Every number of a fit, bit by bit.
fn bits(found: &ConstantFit) -> Vec<u64> {
    let n = found.covariance.nrows();
    let covariance = (0..n * n).map(|k| found.covariance[(k / n, k % n)]);
    let noise = [found.noise.position, found.noise.orientation, found.prior_scale];
    let groups = found.setup.groups.iter();
    let setup = groups.flat_map(|g| g.targets.iter().flatten().chain(&g.world_from_base.rotation).copied());
    let all = found.parameters.iter().chain(&found.residuals).chain(&found.weights).copied();
    all.chain(covariance).chain(noise).chain(setup).map(f64::to_bits).collect()
}

#[test]
fn the_same_bits_with_one_two_and_four_threads() {
    for robust in [None, Some(Robust::Huber)] {
        let with = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            bits(&pool.install(|| fit(vec![2000, 1000], robust)))
        };
        let one = with(1);
        assert!(one == with(2) && one == with(4));
    }
}

#[test]
fn what_is_determined_with_the_same_bits_too() {
    let columns = all_columns(&ur10());
    let plan = Plan { targets: 2, ..Plan::new(ur10(), columns, 0) };
    let scene = Plan { poses: vec![900, 400, 1300], ..plan }.make();
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let found = pool.install(|| identifiability(&scene.problem(), &scene.truth, &scene.setup)).unwrap();
        (found.condition.to_bits(), found)
    };
    let one = with(1);
    assert!(!one.1.undetermined.is_empty());
    assert!(one == with(2) && one == with(4));
}

#[test]
#[ignore = "run with each instruction set by the test below, in a process of its own"]
fn prints_its_parameters() {
    println!("parameters {:?}", fit(vec![29, 14], None).parameters);
}

#[test]
fn the_same_numbers_with_every_instruction_set() {
    let with = |level: &str| -> Vec<f64> {
        let output = Command::new(std::env::current_exe().unwrap())
            .args(["--exact", "threads::prints_its_parameters", "--ignored", "--nocapture"])
            .env("TRUEARM_ISA", level)
            .output()
            .unwrap();
        let text = String::from_utf8(output.stdout).unwrap();
        let (_, rest) = text.split_once("parameters [").unwrap();
        rest.split_once(']').unwrap().0.split(", ").map(|number| number.parse().unwrap()).collect()
    };
    let baseline = with("baseline");
    assert_eq!(baseline.len(), 30);
    for level in ["avx2", "avx512"] {
        assert_close(&with(level), &baseline, 1e-9);
    }
}
