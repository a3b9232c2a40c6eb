//! Noise from squared residuals, where weights and own sigmas take part.

use crate::common::stream::Stream;
use crate::noise::Squares;

fn squares(rows: impl IntoIterator<Item = (f64, f64, f64)>) -> Squares {
    let mut squares = Squares::default();
    rows.into_iter().for_each(|(square, own, weight)| squares.push(square, own, weight));
    squares
}

#[test]
fn noise_beside_own_sigmas_is_found_again() {
    let mut stream = Stream::new(3);
    let rows = (0..20_000).map(|i| {
        let own: f64 = [0.0, 0.5, 2.0][i % 3];
        (((1.0 + own * own).sqrt() * stream.normal()).powi(2), own * own, 1.0)
    });
    let noise = squares(rows).noise(0.0);
    assert!((noise - 1.0).abs() < 0.03, "{noise}");
}

#[test]
fn rows_of_weight_zero_do_not_count() {
    let plain: Vec<_> = (1..40).map(|i| (f64::from(i), 0.0, 1.0)).collect();
    let mut with_dead = plain.clone();
    with_dead.extend([(1e9, 0.0, 0.0); 7]);
    let of = |rows: Vec<_>| squares(rows).noise(5.0);
    assert_eq!(of(plain), of(with_dead));
}

#[test]
fn exact_data_has_no_noise() {
    assert_eq!(squares([(0.0, 0.0, 1.0); 9]).noise(3.0), 0.0);
    assert_eq!(Squares::default().noise(0.0), 0.0);
}
