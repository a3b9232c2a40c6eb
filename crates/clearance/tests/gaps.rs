//! Distances against a search over both segments, ways against their rule, gaps against what a drawing shows.

#![allow(clippy::expect_used, reason = "a test may stop")]

use proptest::prelude::*;
use truearm_clearance::{Arm, Clearance, ClearanceError, Column, Gaps, Place, Plate, Way, distance};
use truearm_kinematics::{Chain, Convention, Joint, Link, Transform};

const PARTS: usize = 200;

fn vector(reach: f64) -> impl Strategy<Value = [f64; 3]> {
    [-reach..reach, -reach..reach, -reach..reach]
}

/// The least distance between points spread over both segments.
fn searched(begin: [f64; 3], along: [f64; 3], top: [f64; 3], down: [f64; 3]) -> f64 {
    let at = |from: [f64; 3], way: [f64; 3], k: usize| {
        [0, 1, 2].map(|i| from[i] + k as f64 / PARTS as f64 * way[i])
    };
    let pairs = (0..=PARTS).flat_map(|a| (0..=PARTS).map(move |b| (a, b)));
    let apart = pairs.map(|(a, b)| {
        let (p, q) = (at(begin, along, a), at(top, down, b));
        [0, 1, 2].map(|i: usize| (p[i] - q[i]).powi(2)).iter().sum::<f64>().sqrt()
    });
    apart.fold(f64::INFINITY, f64::min)
}

proptest! {
    #[test]
    fn distances_are_those_that_a_search_finds(
        begin in vector(1.0), along in vector(0.5), top in vector(1.0), down in vector(0.5)
    ) {
        prop_assume!(down.iter().map(|x| x * x).sum::<f64>() > 1e-3);
        let (found, most) = (distance(begin, along, top, down), searched(begin, along, top, down));
        // Half a part of each segment at the most lies between the nearest points and those searched.
        prop_assert!(found <= most + 1e-12 && most - found < 0.5 * 1.8 / PARTS as f64);
    }

    #[test]
    fn the_line_of_a_tool_is_as_near_as_its_nearest_point(begin in vector(0.3), end in vector(0.3)) {
        let gap = |tool: Vec<[f64; 3]>| clearance().gaps(&Place { links: Vec::new(), tool }, [0.0; 3]).tool;
        let point = |k: usize| [0, 1, 2].map(|i| begin[i] + k as f64 / PARTS as f64 * (end[i] - begin[i]));
        let most = (0..=PARTS).map(|k| gap(vec![point(k)])).fold(f64::INFINITY, f64::min);
        let found = gap(vec![begin, end]);
        prop_assert!(found <= most + 1e-12 && most - found < 0.6 / PARTS as f64);
    }

    #[test]
    fn ways_go_through_their_stops_in_steps(stops in prop::collection::vec([-2.0..2.0, -2.0..2.0], 1..5)) {
        let way = Way::through(stops.as_flattened(), 2, 0.1).expect("sound");
        let rows = way.values.as_chunks::<2>().0;
        prop_assert_eq!(rows[0], stops[0]);
        for stop in &stops {
            prop_assert!(rows.iter().any(|row| row.iter().zip(stop).all(|(a, b)| (a - b).abs() < 1e-12)));
        }
        for pair in rows.windows(2) {
            prop_assert!(pair[0].iter().zip(pair[1]).all(|(a, b)| (a - b).abs() <= 0.1));
        }
    }
}

/// A link of 1 m that turns about z, and a tool at its end.
fn arm() -> Arm {
    let link = Link { joint: Joint::Revolute, theta: 0.0, d: 0.0, a: 1.0, alpha: 0.0, beta: 0.0 };
    let chain = |end| Chain::new(Convention::Standard, vec![link], Transform::IDENTITY, end).expect("sound");
    let tool = Transform { translation: [0.5, 0.0, 0.0], ..Transform::IDENTITY };
    Arm::new(vec![chain(Transform::IDENTITY)], vec![chain(tool)]).expect("sound")
}

/// A column of 1 m below the carriage, and a plate of 0.2 by 0.4 m at it, with a rim of 0.1 m, that faces up.
fn clearance() -> Clearance {
    let axes = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]];
    Clearance::new(
        Column { top: [0.0; 3], down: [0.0, 0.0, -1.0], radius: 0.1 },
        Plate { corner: [0.0; 3], axes, area: [0.2, 0.4], rim: 0.1 },
    )
    .expect("sound")
}

#[test]
fn what_is_no_number_or_no_size_is_refused_and_not_taken_for_far_away() {
    let column = Column { top: [0.0; 3], down: [0.0; 3], radius: 0.1 };
    let plate = Plate { corner: [0.0; 3], axes: [[0.0; 3]; 3], area: [0.2, 0.4], rim: 0.1 };
    for radius in [f64::NAN, f64::INFINITY, -0.1] {
        assert!(Clearance::new(Column { radius, ..column }, plate).is_err(), "{radius}");
    }
    assert!(Clearance::new(column, Plate { corner: [f64::NAN; 3], ..plate }).is_err());
    let moved = Transform { translation: [f64::NAN; 3], ..Transform::IDENTITY };
    let way = Way::places(&[0.0], 1).expect("sound");
    assert!(arm().along(&way, &moved).is_err());
    let tiny = Way::through(&[0.0, 1.0], 1, 1e-9).expect_err("too many places");
    assert!(tiny.to_string().contains("larger step"), "{tiny}");
}

#[test]
fn a_column_without_a_length_is_a_ball() {
    let column = Column { top: [0.0; 3], down: [0.0; 3], radius: 0.1 };
    assert!((column.gap([[1.0, 0.0, 0.0], [1.0, 1.0, 0.0]], [0.0; 3]) - 0.9).abs() < 1e-12);
}

#[test]
fn gaps_are_those_of_the_nearest_link_and_of_the_nearest_point_of_the_tool() {
    let stretched =
        arm().along(&Way::places(&[0.0], 1).expect("sound"), &Transform::IDENTITY).expect("sound");
    assert_eq!(stretched[0].links, [[0.0; 3], [1.0, 0.0, 0.0]]);
    assert_eq!(stretched[0].tool, [[1.5, 0.0, 0.0]]);
    let found = |carriage| clearance().gaps(&stretched[0], carriage);
    let near = |found: Gaps, links: f64, tool: f64| {
        assert!((found.links - links).abs() < 1e-12 && (found.tool - tool).abs() < 1e-12, "{found:?}");
    };
    // Beside the link, and the tool 1.2 m beyond the plate; beyond its end; below the tool; through the link.
    near(found([0.1, 0.3, 0.5]), 0.2, 1.1);
    near(found([1.3, 0.0, 0.5]), 0.2, -0.1);
    near(found([1.4, -0.1, -0.2]), (0.16_f64 + 0.01 + 0.04).sqrt() - 0.1, 0.2);
    near(found([0.5, 0.0, 0.5]), -0.1, 0.7);
}

#[test]
fn a_way_is_as_near_as_its_nearest_place() {
    let arm = arm();
    let turned =
        arm.along(&Way::through(&[0.0, 1.0], 1, 0.05).expect("sound"), &Transform::IDENTITY).expect("sound");
    let table = Way::through(&[2.0, 0.0, 0.5, 1.2, 0.0, 0.5], 3, 0.05).expect("sound");
    let least = clearance().least(&turned, table.points().expect("points"));
    assert!((least.links - 0.1).abs() < 1e-12, "{least:?}");
    let each = table
        .points()
        .expect("points")
        .iter()
        .flat_map(|&at| turned.iter().map(move |place| clearance().gaps(place, at).tool));
    assert_eq!(least.tool, each.fold(f64::INFINITY, f64::min));
}

#[test]
fn what_is_no_way_is_refused() {
    assert!(matches!(Way::through(&[], 2, 0.1), Err(ClearanceError::Rows { got: 0, width: 2 })));
    assert!(matches!(Way::through(&[0.0; 3], 2, 0.1), Err(ClearanceError::Rows { got: 3, .. })));
    assert!(matches!(Way::places(&[f64::NAN], 1), Err(ClearanceError::NotFinite { .. })));
    assert!(matches!(Way::through(&[0.0], 1, f64::NAN), Err(ClearanceError::Step { .. })));
    let wide = Way::places(&[0.0; 2], 2).expect("sound");
    assert!(matches!(
        arm().along(&wide, &Transform::IDENTITY),
        Err(ClearanceError::Width { got: 2, wanted: 1 })
    ));
}
