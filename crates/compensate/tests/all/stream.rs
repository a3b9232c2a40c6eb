//! Corrections of a stream: bounded in rate and acceleration whatever happens, and whole where nothing does.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use proptest::prelude::*;
use truearm_compensate::{
    CompensateError, Corrector, Fault, Limits, Model, Options, Phase, Stream, StreamOptions,
};
use truearm_kinematics::{Chain, Convention, Joint, Link, Transform};

const JOINTS: usize = 6;
const CYCLE: f64 = 0.002;
const START: [f64; JOINTS] = [0.3, -1.2, 1.4, -0.7, 1.1, 0.2];

fn chain() -> Chain {
    let rows = [
        [0.0, 0.1273, 0.0, FRAC_PI_2],
        [0.0, 0.0, -0.612, 0.0],
        [0.0, 0.0, -0.5723, 0.0],
        [0.0, 0.1639, 0.0, FRAC_PI_2],
        [0.0, 0.1157, 0.0, -FRAC_PI_2],
        [0.0, 0.0922, 0.0, 0.0],
    ];
    let link =
        |[theta, d, a, alpha]: [f64; 4]| Link { joint: Joint::Revolute, theta, d, a, alpha, beta: 0.0 };
    let links = rows.into_iter().map(link).collect();
    Chain::new(Convention::Standard, links, Transform::IDENTITY, Transform::IDENTITY).unwrap()
}

/// Corrects an arm with errors of a millirad in every angle.
fn corrector() -> Arc<Corrector> {
    let (chain, mut unit) = (chain(), vec![0.0; JOINTS * JOINTS]);
    (0..JOINTS).for_each(|joint| unit[joint * (JOINTS + 1)] = 1.0);
    let nominal = chain.nominal();
    let erring = |(k, value): (usize, &f64)| {
        value + if k % 5 == 0 || k % 5 == 3 { 1e-3 * (k as f64).cos() } else { 0.0 }
    };
    let actual: Vec<f64> = nominal.iter().enumerate().map(erring).collect();
    let model = |constants: &[f64]| Arc::new(Model::new(chain.clone(), constants, &unit).unwrap());
    let limits = Limits { joints: vec![[-3.0, 3.0]; JOINTS], ..Limits::default() };
    let options = Options { limits, ..Options::default() };
    Arc::new(Corrector::new(model(&actual), model(&nominal), &Transform::IDENTITY, options).unwrap())
}

fn stream() -> Stream {
    Stream::new(corrector(), StreamOptions::default()).unwrap()
}

fn moved(time: f64) -> [f64; JOINTS] {
    std::array::from_fn(|joint| START[joint] + 0.3 * (1.3 * time + joint as f64).sin())
}

/// Runs a stream for some time without anything bad.
fn run(stream: &mut Stream, from: f64, seconds: f64) -> f64 {
    let mut out = [0.0; JOINTS];
    let steps = (seconds / CYCLE).round() as usize;
    for k in 0..steps {
        stream.step(Some(&moved(from + CYCLE * k as f64)), &[], CYCLE, &mut out);
    }
    from + CYCLE * steps as f64
}

#[test]
fn after_the_ramp_set_points_are_corrected_as_single_ones() {
    let (mut stream, corrector) = (stream(), corrector());
    let mut workspace = corrector.workspace();
    let time = run(&mut stream, 0.0, 1.5);
    for k in 0..500 {
        let readings = moved(time + CYCLE * f64::from(k));
        let (mut out, mut alone) = ([0.0; JOINTS], [0.0; JOINTS]);
        let step = stream.step(Some(&readings), &[], CYCLE, &mut out);
        assert_eq!((step.phase, step.gain, step.fault), (Phase::On, 1.0, None));
        assert!(corrector.correct(&readings, &[], true, &mut alone, &mut workspace).refusal.is_none());
        for (a, b) in out.iter().zip(alone) {
            assert!((a - b).abs() < 1e-9, "{a} {b}");
        }
    }
}

#[test]
fn the_first_set_point_is_given_out_as_it_is() {
    let mut stream = stream();
    let mut out = [7.0; JOINTS];
    assert_eq!(stream.step(None, &[], 0.0, &mut out).fault, Some(Fault::NotStarted));
    assert_eq!(out, [7.0; JOINTS]);
    assert_eq!(stream.step(Some(&[f64::NAN; JOINTS]), &[], 0.0, &mut out).fault, Some(Fault::NotStarted));
    stream.step(Some(&START), &[], 0.0, &mut out);
    assert_eq!(out, START);
}

#[test]
fn nothing_becomes_of_a_set_point_that_cannot_be_given_out() {
    let (mut stream, mut out) = (stream(), [7.0; JOINTS]);
    for wrong in [JOINTS - 1, JOINTS + 1] {
        let step = stream.step(Some(&START), &[], 0.0, &mut vec![0.0; wrong]);
        assert_eq!(step.fault, Some(Fault::NotFinite));
        assert_eq!(stream.step(None, &[], 0.0, &mut out).fault, Some(Fault::NotStarted));
    }
    assert_eq!(out, [7.0; JOINTS]);
}

#[test]
fn switched_off_it_ramps_down_to_nothing() {
    let mut stream = stream();
    let time = run(&mut stream, 0.0, 2.0);
    let full = stream.applied().fold(0.0_f64, |a, b| a.max(b.abs()));
    stream.switch(false);
    let time = run(&mut stream, time, 0.5);
    let half = stream.applied().fold(0.0_f64, |a, b| a.max(b.abs()));
    assert!(full > 1e-4 && half > 0.2 * full && half < 0.8 * full, "{full} {half}");
    let time = run(&mut stream, time, 1.0);
    let mut out = [0.0; JOINTS];
    let step = stream.step(Some(&moved(time)), &[], CYCLE, &mut out);
    assert_eq!((step.phase, out), (Phase::Off, moved(time)));
}

#[test]
fn a_refused_set_point_holds_the_correction_then_ramps_it_down_and_up_again() {
    let mut stream = stream();
    let time = run(&mut stream, 0.0, 2.0);
    let before: Vec<f64> = stream.applied().collect();
    let beyond: [f64; JOINTS] =
        std::array::from_fn(|joint| if joint == 0 { 3.5 } else { moved(time)[joint] });
    let mut out = [0.0; JOINTS];
    let step = stream.step(Some(&beyond), &[], CYCLE, &mut out);
    assert!(matches!(step.fault, Some(Fault::Refused(_))));
    assert_eq!(step.phase, Phase::Holding);
    for (joint, before) in before.iter().enumerate() {
        assert!((out[joint] - beyond[joint] - before).abs() < 1e-5);
    }
    let mut phases = vec![step.phase];
    for _ in 0..800 {
        phases.push(stream.step(Some(&beyond), &[], CYCLE, &mut out).phase);
    }
    phases.dedup();
    assert_eq!(phases, [Phase::Holding, Phase::Falling, Phase::Off]);
    assert_eq!(out, beyond);
    let step = stream.step(Some(&moved(time)), &[], CYCLE, &mut out);
    assert_eq!((step.phase, step.fault), (Phase::Rising, None));
}

#[test]
fn missing_late_and_broken_set_points_keep_the_last_one_corrected() {
    let mut stream = stream();
    let time = run(&mut stream, 0.0, 2.0);
    let mut good = [0.0; JOINTS];
    stream.step(Some(&moved(time)), &[], CYCLE, &mut good);
    let broken: [f64; JOINTS] = [0.0, f64::INFINITY, 0.0, 0.0, 0.0, 0.0];
    for readings in [None, Some(&broken[..]), Some(&good[..3])] {
        let mut out = [0.0; JOINTS];
        let step = stream.step(readings, &[], CYCLE, &mut out);
        assert_eq!((step.phase, step.fault), (Phase::Holding, Some(Fault::NotFinite)));
        for (a, b) in out.iter().zip(good) {
            assert!((a - b).abs() < 1e-5, "{a} {b}");
        }
    }
    for elapsed in [0.2, -1.0, f64::NAN] {
        let mut out = [0.0; JOINTS];
        let step = stream.step(Some(&moved(time)), &[], elapsed, &mut out);
        assert_eq!(step.fault, Some(Fault::Late));
        assert!(out.iter().all(|value| value.is_finite()));
    }
}

#[test]
fn options_that_bound_nothing_are_refused() {
    for bad in [0.0, -1.0, f64::NAN] {
        let options = StreamOptions { hold: bad, ..StreamOptions::default() };
        assert!(matches!(Stream::new(corrector(), options), Err(CompensateError::Bound { .. })));
        let options = StreamOptions { rate: [0.1, bad], ..StreamOptions::default() };
        let said = Stream::new(corrector(), options).unwrap_err().to_string();
        assert!(said.contains("a prismatic joint's correction") && said.contains("infinity"), "{said}");
    }
}

/// Anything that may happen to a stream in one cycle.
#[derive(Debug, Clone)]
enum Event {
    Good,
    Jump(f64),
    Broken,
    Missing,
    Late(f64),
    /// Of the joint's limit: positive above, negative below.
    Beyond(f64),
    Switch(bool),
}

fn event() -> impl Strategy<Value = Event> {
    prop_oneof![
        20 => Just(Event::Good),
        1 => (-1.0..1.0f64).prop_map(Event::Jump),
        2 => Just(Event::Broken),
        2 => Just(Event::Missing),
        2 => (0.0..1.0f64).prop_map(Event::Late),
        4 => prop_oneof![Just(Event::Beyond(1.0)), Just(Event::Beyond(-1.0))],
        2 => any::<bool>().prop_map(Event::Switch),
    ]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    #[test]
    fn rate_and_acceleration_stay_bounded(events in proptest::collection::vec((event(), 1..120usize), 1..30)) {
        let (options, mut stream) = (StreamOptions::default(), stream());
        let (mut time, mut offset, mut side) = (0.0, 0.0, 0.0);
        let (mut applied, mut rates) = (vec![0.0; JOINTS], vec![[0.0; 2]; JOINTS]);
        for (event, times) in events {
            for _ in 0..times {
                let mut readings = moved(time);
                readings[1] += offset;
                let (mut given, mut elapsed) = (true, CYCLE);
                match event {
                    Event::Good => {}
                    Event::Jump(by) => offset = by,
                    Event::Broken => readings[2] = f64::NAN,
                    Event::Missing => given = false,
                    Event::Late(by) => elapsed = by,
                    Event::Beyond(side) => readings[0] = 3.2 * side,
                    Event::Switch(on) => stream.switch(on),
                }
                // What is not given or not finite leaves the set-point where it was.
                side = match event {
                    Event::Beyond(side) => side,
                    Event::Broken | Event::Missing => side,
                    _ => 0.0,
                };
                let mut out = [0.0; JOINTS];
                stream.step(given.then_some(&readings[..]), &[], elapsed, &mut out);
                prop_assert!(out.iter().all(|value| value.is_finite()));
                time += CYCLE;
                let dt = elapsed.min(options.deadline);
                let now: Vec<f64> = stream.applied().collect();
                for joint in 0..JOINTS {
                    let beyond = if joint == 0 { side } else { 0.0 };
                    let step = Moved { from: applied[joint], to: now[joint], dt };
                    prop_assert!(step.is_bounded(&mut rates[joint], beyond, &options), "{joint} {event:?}");
                }
                applied = now;
            }
        }
    }
}

/// What one cycle did to the correction of a joint.
struct Moved {
    from: f64,
    to: f64,
    dt: f64,
}

impl Moved {
    /// Whether rate and acceleration are within bounds, or the joint's limit ended the correction sooner.
    ///
    /// `rates` are what its rate may be, before and afterwards: at a limit it may have come to rest, or have been
    /// stopped. `beyond` is the side on which the set-point is beyond the limit, 0 where it is not.
    fn is_bounded(&self, rates: &mut [f64; 2], beyond: f64, options: &StreamOptions) -> bool {
        let change = self.to - self.from;
        let (rate, gain) = (change / self.dt, options.acceleration[0] * self.dt + 1e-6);
        let even = self.dt <= 1e-6 || (rates[0] - gain..=rates[1] + gain).contains(&rate);
        let slow = change.abs() <= options.rate[0] * self.dt + 1e-12;
        if self.to * beyond > 0.0 {
            return false;
        }
        let led_back = self.from * beyond > 0.0;
        let stopped = beyond != 0.0 && self.to == 0.0;
        if self.dt > 1e-6 {
            *rates = [rate; 2];
        }
        if stopped {
            *rates = if even { [rates[0].min(0.0), rates[1].max(0.0)] } else { [0.0; 2] };
        }
        (slow || led_back) && (even || stopped)
    }
}

#[test]
fn a_held_correction_leads_no_joint_out_of_its_limits() {
    let mut stream = stream();
    let (mut out, mut readings) = ([0.0; JOINTS], START);
    run(&mut stream, 0.0, 2.0);
    let wanted: Vec<f64> = stream.applied().collect();
    let joint = (0..JOINTS).find(|&joint| wanted[joint].abs() > 1e-5).unwrap();
    let limit = 3.0 * wanted[joint].signum();
    for k in 0..400 {
        let share = f64::from(k) / 399.0;
        readings[joint] = START[joint] + share * (limit - START[joint]);
        let step = stream.step(Some(&readings), &[], CYCLE, &mut out);
        assert!(out[joint].abs() <= 3.0, "{} at {k}", out[joint]);
        if k == 399 {
            assert!(step.lag > 0.0);
        }
    }
}

#[test]
fn nothing_leads_farther_out_beyond_a_limit_or_jumps_about_it() {
    for speed in [5e-4, 0.01, 0.1, 0.5, 2.0] {
        let (mut stream, by) = (stream(), speed * CYCLE);
        run(&mut stream, 0.0, 2.0);
        let wanted: Vec<f64> = stream.applied().collect();
        let joint = (0..JOINTS).find(|&joint| wanted[joint].abs() > 1e-5).unwrap();
        let (limit, sign) = (3.0 * wanted[joint].signum(), wanted[joint].signum());
        let (mut out, mut readings, mut before) = ([0.0; JOINTS], START, None);
        for k in 0..1600 {
            // 0.3 steps, so that no set-point is the limit itself.
            readings[joint] = limit + sign * by * (100.3 - f64::from(k - 800).abs());
            stream.step(Some(&readings), &[], CYCLE, &mut out);
            let applied = stream.applied().nth(joint).unwrap();
            let room = (limit - readings[joint]) * sign;
            assert!(applied * sign <= room.max(0.0), "{applied} at {room} with {speed} rad/s");
            let change = before.map_or(0.0, |before: f64| (out[joint] - before).abs());
            assert!(change <= by + StreamOptions::default().rate[0] * CYCLE + 1e-12, "{change} at {k}");
            before = Some(out[joint]);
        }
    }
}

#[test]
fn a_set_point_that_jumps_beyond_a_limit_is_led_no_farther() {
    for side in [-1.0, 1.0] {
        let mut stream = stream();
        let (mut out, mut readings) = ([0.0; JOINTS], moved(run(&mut stream, 0.0, 2.0)));
        readings.fill(3.1 * side);
        let before: Vec<f64> = stream.applied().collect();
        stream.step(Some(&readings), &[], CYCLE, &mut out);
        for (joint, before) in before.iter().enumerate() {
            let outward = before * side > 0.0;
            assert!(if outward { out[joint] == readings[joint] } else { out[joint] != readings[joint] });
        }
    }
}

#[test]
fn the_rate_is_bounded_where_the_acceleration_is_not() {
    let options = StreamOptions { acceleration: [f64::INFINITY; 2], ..StreamOptions::default() };
    let mut stream = Stream::new(corrector(), options).unwrap();
    run(&mut stream, 0.0, 2.0);
    let (mut out, mut readings) = ([0.0; JOINTS], moved(2.0));
    readings[1] += 0.8;
    let mut before: Vec<f64> = stream.applied().collect();
    let mut last = f64::INFINITY;
    for _ in 0..200 {
        last = stream.step(Some(&readings), &[], CYCLE, &mut out).lag;
        for (joint, (now, before)) in stream.applied().zip(&mut before).enumerate() {
            assert!((now - *before).abs() <= options.rate[0] * CYCLE + 1e-15, "joint {joint}");
            *before = now;
        }
    }
    assert_eq!(last, 0.0);
}

#[test]
fn a_clock_that_gives_no_times_is_late_and_ends_in_nothing() {
    let clocks = [f64::NAN, f64::INFINITY, -1.0]
        .map(|broken| [0.05, f64::INFINITY].map(|deadline| (broken, deadline)));
    for (broken, deadline) in clocks.into_iter().flatten() {
        let options = StreamOptions { deadline, ..StreamOptions::default() };
        let mut stream = Stream::new(corrector(), options).unwrap();
        run(&mut stream, 0.0, 2.0);
        let (mut out, mut steps) = ([0.0; JOINTS], Vec::new());
        for _ in 0..2000 {
            let before: Vec<f64> = stream.applied().collect();
            steps.push(stream.step(Some(&moved(2.0)), &[], broken, &mut out));
            let changes = stream.applied().zip(before).map(|(now, before)| (now - before).abs());
            assert!(changes.fold(0.0, f64::max) <= options.rate[0] * CYCLE + 1e-15, "{broken}");
        }
        assert!(steps.iter().all(|step| step.fault == Some(Fault::Late)));
        assert_eq!((steps[0].phase, steps[1999].phase), (Phase::Holding, Phase::Off), "{broken}");
        assert!(stream.applied().all(|applied| applied == 0.0));
    }
}

#[test]
fn a_ramp_that_takes_no_time_or_never_ends_is_refused() {
    for bad in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let options = StreamOptions { ramp: bad, ..StreamOptions::default() };
        let said = Stream::new(corrector(), options).unwrap_err().to_string();
        assert_eq!(said, format!("the time of the ramp is {bad}, it must be positive and finite"));
    }
}
