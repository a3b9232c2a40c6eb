use proptest::prelude::*;

use super::{GAUSSIAN, inputs, made, network};
use crate::cmac::{Composition, Membership, Network, NetworkOptions, Sensor};

fn one(cells: usize, active: usize, membership: Membership) -> Network {
    network(&[cells], active, 1, membership)
}

fn nearest(cells: usize, active: usize, value: f64) -> Vec<u64> {
    let position = (value + 1.0) / 3.0 * (cells - 1) as f64;
    let mut order: Vec<u64> = (0..cells as u64).collect();
    order.sort_by(|&a, &b| {
        (a as f64 - position).abs().total_cmp(&(b as f64 - position).abs()).then(a.cmp(&b))
    });
    order.truncate(active);
    order.sort_unstable();
    order
}

proptest! {
    #[test]
    fn the_cells_with_the_largest_grades_are_active(cells in 9usize..30, active in 1usize..9, value in -1.0..2.0f64) {
        let (found, grades) = one(cells, active, GAUSSIAN).active(&[value]).unwrap();
        prop_assert_eq!(&found, &nearest(cells, active, value));
        let position = (value + 1.0) / 3.0 * (cells - 1) as f64;
        for (cell, grade) in found.iter().zip(&grades) {
            let expected = (-2.0 * (*cell as f64 - position).powi(2)).exp();
            prop_assert!((grade - expected).abs() < 1e-14);
        }
    }

    #[test]
    fn quantised_inputs_excite_the_same_cells_within_a_cell(level in 0usize..12, off in -0.49..0.49f64) {
        let network = one(12, 3, Membership::Quantised);
        let at = |position: f64| network.active(&[-1.0 + 3.0 * position / 11.0]).unwrap();
        let (cells, grades) = at(level as f64 + off);
        prop_assert_eq!(&cells, &at(level as f64).0);
        prop_assert_eq!(&cells, &nearest(12, 3, -1.0 + 3.0 * level as f64 / 11.0));
        prop_assert!(grades.iter().all(|&grade| grade == 1.0));
    }

    #[test]
    fn splines_are_smooth_and_add_up_to_one(active in 2usize..5, value in -1.0..2.0f64) {
        let network = one(11, active, Membership::BSpline);
        let sum: f64 = network.active(&[value]).unwrap().1.iter().sum();
        prop_assert!((sum - 1.0).abs() < 1e-12);
        let weights: Vec<f64> = (0..11).map(|k| f64::from(k * k % 7)).collect();
        let network = network.with_weights(&weights).unwrap();
        let mut out = [0.0; 2];
        network.output(&[value, value + 1e-9], &mut out).unwrap();
        prop_assert!((out[0] - out[1]).abs() < 1e-6);
    }

    #[test]
    fn splines_reproduce_a_straight_line(active in 2usize..5, value in -1.0..2.0f64) {
        let network = one(11, active, Membership::BSpline);
        let sensor = network.sensors()[0];
        let spacing = sensor.spacing(Membership::BSpline);
        let centre = |k: usize| sensor.low + (k as f64 - sensor.start(Membership::BSpline)) * spacing;
        let line = network.with_weights(&(0..11).map(centre).collect::<Vec<_>>()).unwrap();
        let mut out = [0.0];
        line.output(&[value], &mut out).unwrap();
        prop_assert!((out[0] - value).abs() < 1e-12);
    }

    #[test]
    fn beyond_the_range_the_nearest_end_counts(beyond in 0.0..1e6f64) {
        for membership in [GAUSSIAN, Membership::BSpline, Membership::Quantised] {
            let network = one(9, 3, membership);
            prop_assert_eq!(network.active(&[2.0 + beyond]).unwrap(), network.active(&[2.0]).unwrap());
            prop_assert_eq!(network.active(&[-1.0 - beyond]).unwrap(), network.active(&[-1.0]).unwrap());
        }
    }
}

#[test]
fn the_papers_network_has_its_numbers_of_cells() {
    let network = network(&[17, 11, 11], 3, 15, GAUSSIAN);
    assert_eq!(network.sensors().iter().map(|s| s.cells).sum::<usize>(), 39);
    assert_eq!((network.cell_count(), network.active_count(), network.row_count()), (2057, 27, 2057));
}

#[test]
fn output_is_the_centroid_of_the_active_weights() {
    for outputs in [1, 8, 15, 40] {
        let network = network(&[7, 6, 5], 3, outputs, GAUSSIAN);
        let weights: Vec<f64> = (0..210 * outputs).map(|k| (k as f64 * 0.37).sin()).collect();
        let network = network.with_weights(&weights).unwrap();
        assert_eq!(network.weights(), weights);
        let s = inputs(13, 3);
        let (cells, grades) = network.active(&s).unwrap();
        let mut out = vec![0.0; 13 * outputs];
        network.output(&s, &mut out).unwrap();
        for row in 0..13 {
            let (cells, grades) = (&cells[row * 27..][..27], &grades[row * 27..][..27]);
            for output in 0..outputs {
                let weight = |&cell: &u64| weights[cell as usize * outputs + output];
                let sum: f64 = cells.iter().zip(grades).map(|(cell, grade)| grade * weight(cell)).sum();
                let expected = sum / grades.iter().sum::<f64>();
                assert!((out[row * outputs + output] - expected).abs() < 1e-13);
            }
        }
    }
}

#[test]
fn threads_change_no_bit() {
    let network = network(&[17, 11, 11], 3, 15, GAUSSIAN);
    let weights: Vec<f64> = (0..2057 * 15).map(|k| (k as f64).cos()).collect();
    let network = network.with_weights(&weights).unwrap();
    let s = inputs(9000, 3);
    let by = |threads| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut out = vec![0.0; 9000 * 15];
        pool.install(|| network.output(&s, &mut out)).unwrap();
        out
    };
    assert!(by(1) == by(3));
}

#[test]
fn numbers_out_of_range_are_refused_with_their_value() {
    let sensor = Sensor { low: 0.0, high: 1.0, cells: 9, active: 3 };
    let options = NetworkOptions { membership: GAUSSIAN, composition: Composition::Min, hashed: None };
    let message = |sensor, outputs, options| {
        Network::new(vec![sensor], outputs, options).map(|_| ()).unwrap_err().to_string()
    };
    assert!(message(Sensor { high: 0.0, ..sensor }, 1, options).contains("upper end is 0"));
    assert!(message(Sensor { active: 9, ..sensor }, 1, options).contains("active cells is 9"));
    assert!(message(Sensor { cells: 3, ..sensor }, 1, options).contains("cells is 3"));
    assert!(message(sensor, 0, options).contains("outputs is 0"));
    let membership = Membership::Gaussian { sigma: 0.0 };
    assert!(message(sensor, 1, NetworkOptions { membership, ..options }).contains("sigma is 0"));
    let membership = Membership::BSpline;
    let wide = Sensor { active: 5, ..sensor };
    assert!(message(wide, 1, NetworkOptions { membership, ..options }).contains("B-spline is 5"));
    assert!(message(sensor, 1, NetworkOptions { hashed: Some(0), ..options }).contains("hash table is 0"));
    let six = Network::new(vec![Sensor { cells: 40, ..sensor }; 6], 1, options);
    assert!(six.unwrap_err().to_string().contains("hash table"));
    let network = network(&[9, 9], 3, 1, GAUSSIAN);
    assert!(network.output(&[0.0, f64::NAN], &mut [0.0]).is_err());
    assert!(network.output(&[0.0, 0.0, 1.0], &mut [0.0]).is_err());
    assert!(network.output(&[0.0, 0.0], &mut [0.0; 2]).is_err());
    assert!(network.with_weights(&[0.0; 80]).is_err());
}

#[test]
fn six_inputs_fit_a_hash_table() {
    let options = NetworkOptions { membership: GAUSSIAN, composition: Composition::Min, hashed: Some(4096) };
    let network = made(&[20; 6], 3, 18, options);
    assert_eq!((network.cell_count(), network.row_count(), network.active_count()), (64_000_000, 4096, 729));
    let (cells, _) = network.active(&inputs(3, 6)).unwrap();
    assert!(cells.iter().all(|&cell| cell < 64_000_000));
}
