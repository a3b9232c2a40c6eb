//! Evaluation of a bank: one by one, in batches, by many threads, and what a bank must hold.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use crate::common::{Random, Truth, six_axes, with_threads};
use truearm_bank::{Axis, Bank, BankError, Block, Compiled, Grid, Input, Levers};
use truearm_kinematics::{Isa, Kernel, LANES, Lane, dispatch};

const INPUTS: usize = 3;
const PARAMETERS: usize = 10;
/// Share of what is added that tables of single precision may be off by: a unit in the last place for each of the products and
/// sums that follow each other.
const ROUNDING: f64 = 8.0 * f32::EPSILON as f64;

fn block(name: &str, inputs: &[usize], outputs: &[usize], degree: usize, random: &mut Random) -> Block {
    let axis = |&k: &usize| {
        let input = if k == 2 { Input::line(2.0) } else { Input::ANGLE };
        let reach = if k == 0 { 6.2 } else { 2.0 };
        let values = (0..100).map(|i| reach * f64::from(i) / 99.0);
        Axis::covering(input, values.collect::<Vec<_>>().into_iter(), 0.7, 0.35, degree)
    };
    let grid = Grid { inputs: inputs.to_vec(), axes: inputs.iter().map(axis).collect() };
    let weights = (0..grid.cell_count() * outputs.len()).map(|_| random.normal()).collect();
    Block { name: name.to_owned(), grid, outputs: outputs.to_vec(), weights, reading: None }
}

fn bank(degree: usize) -> Bank {
    let mut random = Random::new(1);
    let blocks = vec![
        block("own", &[0], &[0], degree, &mut random),
        block("smooth", &[2], &[1, 4, 9], degree, &mut random),
        block("major", &[0, 1], &[2, 3], degree, &mut random),
        block("wrist", &[2, 0, 1], &[5, 0], degree, &mut random),
    ];
    Bank { blocks, ..Bank::empty(INPUTS, PARAMETERS) }
}

/// Whole turns only: a block over one input is over one of those of larger ones, and single outputs are among theirs.
fn turning_bank(degree: usize) -> Bank {
    let (mut random, outputs) = (Random::new(3), [7, 0, 3, 8, 9, 1, 4, 5, 6]);
    let mut blocks: Vec<Block> = [vec![0], vec![1], vec![0, 1], vec![1, 2, 0], vec![2]]
        .iter()
        .map(|inputs| block("turning", inputs, &outputs, degree, &mut random))
        .collect();
    for block in &mut blocks {
        for axis in &mut block.grid.axes {
            let turn = (0..100).map(|i| 0.063 * f64::from(i)).collect::<Vec<_>>();
            *axis = Axis::covering(Input::ANGLE, turn.into_iter(), 0.7, 0.35, degree);
            assert!(axis.closed);
        }
        let cells = block.grid.cell_count() * outputs.len();
        block.weights = (0..cells).map(|_| random.normal()).collect();
    }
    blocks.push(block("own", &[1], &[8], degree, &mut random));
    blocks.push(block("own", &[0], &[8], degree, &mut random));
    blocks.push(block("own", &[2], &[3], degree, &mut random));
    Bank { blocks, ..Bank::empty(INPUTS, PARAMETERS) }
}

/// More outputs than the sums of one pass, some of them twice.
fn bank_of_many_outputs(degree: usize) -> Bank {
    let mut random = Random::new(4);
    let outputs: Vec<usize> = (0..47).map(|k| (3 * k + k / 9) % PARAMETERS).collect();
    let blocks = vec![block("major", &[0, 1], &outputs, degree, &mut random)];
    Bank { blocks, ..Bank::empty(INPUTS, PARAMETERS) }
}

fn values(poses: usize) -> Vec<f64> {
    let mut random = Random::new(2);
    (0..poses * INPUTS).map(|_| random.between(-7.0, 7.0)).collect()
}

fn evaluate(bank: &Bank, values: &[f64]) -> Vec<f64> {
    let mut out = vec![0.0; values.len() / INPUTS * PARAMETERS];
    bank.add(values, &mut out).unwrap();
    out
}

/// Membership of the cell with the given centre, by the divided differences of truncated powers.
fn membership(degree: usize, distance: f64) -> f64 {
    let n = degree as i32;
    if distance.abs() >= 0.5 * f64::from(n + 1) {
        return 0.0;
    }
    let mut binomial = 1.0;
    let mut sum = 0.0;
    for k in 0..=n + 1 {
        let knot = f64::from(k) - 0.5 * f64::from(n + 1);
        let sign = if k % 2 == 0 { 1.0 } else { -1.0 };
        sum += sign * binomial * (distance - knot).max(0.0).powi(n);
        binomial *= f64::from(n + 1 - k) / f64::from(k + 1);
    }
    sum / f64::from((1..=n).product::<i32>())
}

/// Grade of every cell at a value, with as many turns as reach it.
fn grades(axis: &Axis, value: f64) -> Vec<f64> {
    let scaled = axis.input.scale * value;
    let turns: Vec<f64> = match axis.input == Input::ANGLE {
        true => (-4..=4).map(|turn| f64::from(turn) * std::f64::consts::TAU).collect(),
        false => vec![0.0],
    };
    let of = |cell: usize| {
        let apart = |turn: &f64| (scaled + turn - axis.origin) / axis.spacing - cell as f64;
        turns.iter().map(|turn| membership(axis.degree, apart(turn))).sum()
    };
    (0..axis.count).map(of).collect()
}

/// What a bank should give for one configuration, of every block every cell, and the sum of the sizes of what is added.
fn summed(bank: &Bank, q: &[f64]) -> Vec<(f64, f64)> {
    let mut wanted = vec![(0.0, 0.0); PARAMETERS];
    for block in &bank.blocks {
        let axes = block.grid.inputs.iter().zip(&block.grid.axes);
        let memberships = axes.fold(vec![1.0], |so_far: Vec<f64>, (&input, axis)| {
            let along = grades(axis, q[input]);
            so_far.iter().flat_map(|a| along.iter().map(move |b| a * b)).collect()
        });
        for (grade, weights) in memberships.iter().zip(block.weights.chunks(block.outputs.len())) {
            for (&output, weight) in block.outputs.iter().zip(weights) {
                wanted[output].0 += grade * weight;
                wanted[output].1 += (grade * weight).abs();
            }
        }
    }
    wanted
}

#[test]
fn a_block_over_a_reading_is_one_over_an_input_of_its_value() {
    let mut random = Random::new(5);
    for outputs in [&[4][..], &[0, 7]] {
        let mut blocks =
            vec![block("own", &[1], &[3], 2, &mut random), block("own", &[0], outputs, 2, &mut random)];
        let plain = Bank { blocks: blocks.clone(), ..Bank::empty(INPUTS, PARAMETERS) };
        blocks[1].reading = Some(vec![-1.0, 1.0]);
        let read = Bank { blocks: blocks.clone(), ..Bank::empty(INPUTS, PARAMETERS) };
        read.check().unwrap();
        let given = values(20);
        let shifted: Vec<f64> = given.chunks(INPUTS).flat_map(|q| [q[1] - q[0], q[1], q[2]]).collect();
        assert_eq!(evaluate(&read, &given), evaluate(&plain, &shifted));
        let second = blocks[0].grid.axes[0].clone();
        blocks[1].grid.axes.push(second);
        blocks[1].grid.inputs.push(1);
        let wrong = Bank { blocks, ..Bank::empty(INPUTS, PARAMETERS) };
        assert!(wrong.check().is_err());
    }
}

#[test]
fn readings_that_are_no_sums_of_joint_values_are_refused() {
    let mut random = Random::new(6);
    for factors in [vec![], vec![1.0; INPUTS + 1], vec![f64::NAN, 1.0]] {
        let mut block = block("own", &[0], &[4], 2, &mut random);
        block.reading = Some(factors.clone());
        let bank = Bank { blocks: vec![block], ..Bank::empty(INPUTS, PARAMETERS) };
        assert!(bank.check().is_err(), "{factors:?}");
    }
}

#[test]
fn a_bank_is_the_sum_of_its_cells_weights_times_b_splines() {
    for degree in [2, 3] {
        for bank in [bank(degree), turning_bank(degree), bank_of_many_outputs(degree)] {
            for q in values(20).chunks(INPUTS) {
                for (found, (wanted, size)) in evaluate(&bank, q).iter().zip(summed(&bank, q)) {
                    assert!((found - wanted).abs() <= ROUNDING * size, "{found} {wanted} {size}");
                }
            }
        }
    }
}

#[test]
fn single_outputs_over_single_inputs_are_exact() {
    let mut bank = bank(2);
    bank.blocks.truncate(1);
    for q in values(20).chunks(INPUTS) {
        let (found, (wanted, _)) = (evaluate(&bank, q)[0], summed(&bank, q)[0]);
        assert!((found - wanted).abs() < 1e-13, "{found} {wanted}");
    }
}

#[test]
fn weights_too_small_for_single_precision_are_none() {
    let (mut bank, q) = (bank_of_many_outputs(2), [0.5, 0.7, 0.0]);
    let of_size = |bank: &mut Bank, size: f64| {
        bank.blocks[0].weights.iter_mut().for_each(|weight| *weight = size * weight.signum());
        evaluate(bank, &q)
    };
    assert!(of_size(&mut bank, 1e-19).iter().any(|value| value.abs() > 1e-21));
    assert_eq!(of_size(&mut bank, 1e-21), vec![0.0; PARAMETERS]);
}

#[test]
fn a_batch_is_one_by_one_and_threads_change_nothing() {
    for degree in [2, 3] {
        let (bank, values) = (bank(degree), values(5000));
        let alone: Vec<f64> = values.chunks(INPUTS).flat_map(|q| evaluate(&bank, q)).collect();
        for threads in [1, 2, 4] {
            assert!(with_threads(threads, || evaluate(&bank, &values)) == alone, "{threads} threads");
        }
    }
}

#[test]
fn seams_do_not_show() {
    let pi = std::f64::consts::PI;
    for degree in [2, 3] {
        let bank = bank(degree);
        let (left, right) = (evaluate(&bank, &[-pi, 0.5, 1.0]), evaluate(&bank, &[pi, 0.5, 1.0]));
        for (a, b) in left.iter().zip(&right) {
            assert!((a - b).abs() < 1e-10, "{a} {b}");
        }
        let near = evaluate(&bank, &[pi - 1e-7, 0.5, 1.0]);
        assert!(near.iter().zip(&left).all(|(a, b)| (a - b).abs() < 1e-5));
    }
}

#[test]
fn beyond_an_open_axis_a_block_is_zero() {
    let bank = bank(2);
    let far = evaluate(&bank, &[0.3, 0.5, 40.0]);
    assert_eq!([far[1], far[4], far[9], far[5]], [0.0; 4]);
    assert!(far[2] != 0.0 && far[3] != 0.0);
}

#[test]
fn banks_that_contradict_themselves_are_refused() {
    assert_eq!(bank(2).check(), Ok(()));
    let refused = |change: &dyn Fn(&mut Bank), what: &str| {
        let mut bank = bank(2);
        change(&mut bank);
        let Err(BankError::Length { what: found, .. }) = bank.check() else { panic!("{what} was accepted") };
        assert_eq!(found, what);
    };
    refused(&|bank| bank.blocks[1].weights.truncate(1), "weights of a block");
    refused(&|bank| bank.blocks[0].grid.inputs[0] = INPUTS, "inputs of a block");
    refused(&|bank| bank.blocks[0].grid.inputs.push(1), "inputs of a block");
    refused(&|bank| bank.blocks[2].outputs[1] = PARAMETERS, "outputs of a block");
}

#[test]
fn arrays_that_do_not_fit_are_refused() {
    let bank = bank(2);
    assert!(bank.add(&[0.0; 4], &mut [0.0; PARAMETERS]).is_err());
    assert!(bank.add(&[0.0; 3], &mut [0.0; PARAMETERS + 1]).is_err());
}

/// Slopes of a group of eight, or of its first pose alone, by each input of the parameter that is its own.
struct Slopes<'a> {
    bank: &'a Compiled,
    inputs: &'a [Lane],
    poses: usize,
}

const OWN: [usize; INPUTS] = [0, 5, 6];

impl Kernel for Slopes<'_> {
    type Output = Vec<Lane>;

    #[inline(always)]
    fn run<I: Isa>(self) -> Vec<Lane> {
        let (mut scratch, mut slopes) = (self.bank.scratch(), vec![Lane::splat(7.0); INPUTS]);
        let mut rows = vec![0.0; self.poses * PARAMETERS];
        self.bank.excite_and_add::<I>(self.inputs, &mut scratch, &mut rows);
        self.bank.own_slopes::<I>(&OWN, self.poses, &scratch, &mut slopes);
        slopes
    }
}

#[test]
fn slopes_are_derivatives_of_what_inputs_add_to_their_own_parameters() {
    for degree in [2, 3] {
        let mut random = Random::new(5);
        let blocks = [(0, 0), (1, 5), (1, 5), (2, 6), (0, 5), (2, 0)]
            .map(|(input, output)| block("own", &[input], &[output], degree, &mut random));
        let mut bank = Bank { blocks: blocks.to_vec(), ..Bank::empty(INPUTS, PARAMETERS) };
        bank.blocks.push(block("smooth", &[1], &[1, 2, 9], degree, &mut random));
        let compiled = bank.compiled();
        let group = values(LANES);
        let mut inputs = [Lane::ZERO; INPUTS];
        for (k, value) in group.iter().enumerate() {
            inputs[k % INPUTS].0[k / INPUTS] = *value;
        }
        let slopes = dispatch(Slopes { bank: &compiled, inputs: &inputs, poses: LANES });
        let same = inputs.map(|lane| Lane::splat(lane.0[0]));
        let alone = dispatch(Slopes { bank: &compiled, inputs: &same, poses: 1 });
        let step = 1e-6;
        for (k, &value) in group.iter().enumerate() {
            let (input, pose) = (k % INPUTS, k / INPUTS);
            let added = |value: f64| {
                let mut moved = group.clone();
                moved[k] = value;
                evaluate(&bank, &moved)[pose * PARAMETERS + OWN[input]]
            };
            let expected = (added(value + step) - added(value - step)) / (2.0 * step);
            let found = slopes[input].0[pose];
            assert!((found - expected).abs() < 1e-6, "degree {degree}, {input}, {pose}: {found} {expected}");
            if pose == 0 {
                assert_eq!(alone[input].0, [found; LANES]);
            }
        }
        assert!(slopes.iter().all(|slope| slope.0.iter().any(|value| value.abs() > 0.1)));
    }
}

#[test]
fn a_sag_that_no_fit_makes_is_refused() {
    let arm = six_axes(Truth::RIGID);
    let (levers, parameters) = (Levers::new(&arm.chain), arm.chain.parameter_count());
    let outputs: Vec<usize> = levers.joints().map(|joint| 5 * joint).collect();
    let restored = |inputs: &[usize], outputs: &[usize]| {
        let times = inputs.len().saturating_sub(5);
        let block = Block {
            name: "sag".to_owned(),
            grid: Grid { inputs: inputs.to_vec(), axes: Vec::new() },
            outputs: outputs.repeat(times),
            weights: vec![1e-4; outputs.len() * times],
            reading: None,
        };
        Bank::restored(8, parameters, vec![block], levers.clone())
    };
    let payload = restored(&[0, 1, 2, 3, 4, 5, 7], &outputs).unwrap();
    assert_eq!(payload.sag.unwrap().stored().grid.inputs, [0, 1, 2, 3, 4, 5, 7]);
    for inputs in [
        &[6, 1, 2, 3, 4, 5][..],
        &[0, 1, 2, 3, 4],
        &[0, 1, 2, 3, 4, 5, 5],
        &[0, 1, 2, 3, 4, 5, 7, 6],
        &[0, 1, 2, 3, 4, 5, 8],
        &[0, 1, 2, 3, 4, 5, usize::MAX],
    ] {
        let refused = restored(inputs, &outputs).unwrap_err();
        assert!(matches!(refused, BankError::Block { .. }), "{inputs:?}: {refused}");
    }
    for weight in [f64::NAN, f64::INFINITY, 1e39] {
        let mut block = Block {
            name: "sag".to_owned(),
            grid: Grid { inputs: (0..6).collect(), axes: Vec::new() },
            outputs: outputs.clone(),
            weights: vec![1e-4; outputs.len()],
            reading: None,
        };
        block.weights[2] = weight;
        let refused = Bank::restored(8, parameters, vec![block], levers.clone()).unwrap_err();
        assert!(matches!(refused, BankError::NotFinite { .. }), "{weight}: {refused}");
    }
    let mut elsewhere = outputs.clone();
    elsewhere[1] = 5;
    assert!(matches!(restored(&[0, 1, 2, 3, 4, 5], &elsewhere), Err(BankError::Block { .. })));
}

#[test]
fn a_sag_that_knows_nothing_beside_the_end_has_no_weights_there() {
    let arm = six_axes(Truth::RIGID);
    let (levers, parameters) = (Levers::new(&arm.chain), arm.chain.parameter_count());
    let restored = |outputs: Vec<usize>, weights: Vec<f64>| {
        let grid = Grid { inputs: vec![0, 1, 2, 3, 4, 5, 7], axes: Vec::new() };
        let block = Block { name: "sag".to_owned(), grid, outputs, weights, reading: None };
        Bank::restored(8, parameters, vec![block], levers.clone()).unwrap().sag.unwrap()
    };
    let (mut outputs, mut weights, mut links_alone) = (Vec::new(), Vec::new(), (Vec::new(), Vec::new()));
    for joint in (0..6).cycle().take(12) {
        for link in joint..6 {
            let weight = 1e-4 * f64::from(u8::try_from(10 * joint + link).unwrap());
            outputs.push(5 * joint);
            weights.push(weight);
            links_alone.0.push(5 * joint);
            links_alone.1.push(weight);
        }
        outputs.extend([5 * joint; 3]);
        weights.extend([0.0; 3]);
    }
    assert_eq!(restored(links_alone.0, links_alone.1), restored(outputs, weights));
}

#[test]
fn a_sag_adds_the_sum_of_its_levers_times_their_weights() {
    let arm = six_axes(Truth::RIGID);
    let parameters = arm.chain.parameter_count();
    let levers = Levers::new(&arm.chain).along([0.6, 0.0, 0.8]).unwrap();
    let carrying = levers.clone().carrying([(7, 1.0)]);
    let outputs: Vec<usize> = carrying.joints().map(|joint| 5 * joint).collect();
    let mut random = Random::new(8);
    let weights: Vec<f64> = outputs.iter().map(|_| 1e-3 * random.normal()).collect();
    let block = Block {
        name: "sag".to_owned(),
        grid: Grid { inputs: vec![0, 1, 2, 3, 4, 5, 7], axes: Vec::new() },
        outputs: outputs.clone(),
        weights: weights.clone(),
        reading: None,
    };
    let bank = Bank::restored(8, parameters, vec![block], levers).unwrap();
    for _ in 0..5 {
        let values: Vec<f64> = (0..8).map(|_| random.normal()).collect();
        let mut wanted = vec![0.0; parameters];
        for ((lever, weight), output) in carrying.at(&values).iter().zip(&weights).zip(&outputs) {
            wanted[*output] += lever * weight;
        }
        let mut found = vec![0.0; parameters];
        bank.add(&values, &mut found).unwrap();
        for (found, wanted) in found.iter().zip(&wanted) {
            assert!((found - wanted).abs() < 1e-12, "{found} is not {wanted}");
        }
    }
}
