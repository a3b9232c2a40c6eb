//! Batches: the same bits however the work is divided, the same numbers on every instruction set, lengths refused.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use std::num::NonZeroUsize;

use crate::common::{assert_close, mixed, six_axis, spread};
use truearm_kinematics::{
    Batch, Chain, Convention, InstructionSet, Isa, Kernel, KinematicsError, LANES, Lane, LaneFrame,
    LaneParameters, Parameters, Screw, SharedParameters, Transform, dispatch_on, lane_room, load_lanes,
    store_lanes,
};

type Work<'a> = fn(&Batch<'a>, &[f64], Parameters<'_>, &mut [f64]) -> Result<(), KinematicsError>;

/// Every quantity with the length of its rows.
fn quantities(chain: &Chain) -> [(usize, Work<'_>); 6] {
    let (all, joints) = (chain.parameter_count(), chain.joint_count());
    [
        (3, Batch::positions as Work<'_>),
        (16, Batch::poses as Work<'_>),
        (3 * all, Batch::position_jacobian as Work<'_>),
        (6 * all, Batch::pose_jacobian as Work<'_>),
        (3 * joints, Batch::joint_position_jacobian as Work<'_>),
        (6 * joints, Batch::joint_pose_jacobian as Work<'_>),
    ]
}

fn joints(chain: &Chain, poses: usize) -> Vec<f64> {
    spread(poses * chain.joint_count(), 5).iter().map(|x| 3.0 * x).collect()
}

#[test]
fn threads_do_not_change_a_bit() {
    let pool = rayon::ThreadPoolBuilder::new().num_threads(4).build().unwrap();
    let chain = six_axis();
    let p = chain.nominal();
    for poses in [1, 8, 9, 1023, 20_003] {
        let q = joints(&chain, poses);
        for (width, work) in quantities(&chain) {
            let run = |threads: usize| {
                let mut out = vec![f64::NAN; poses * width];
                let batch = chain.batch(NonZeroUsize::new(threads));
                pool.install(|| work(&batch, &q, Parameters::One(&p), &mut out)).unwrap();
                out
            };
            let one = run(1);
            assert!(one.iter().all(|x| x.is_finite()));
            for threads in [2, 3, 4, 0] {
                assert_eq!(one, run(threads), "{poses} poses, {width} wide, {threads} threads");
            }
        }
    }
}

#[test]
fn a_pose_does_not_depend_on_its_neighbours_or_its_place() {
    let chain = mixed(Convention::Standard);
    let (poses, p) = (21, chain.nominal());
    let (q, each) = (joints(&chain, poses), p.repeat(poses));
    for (width, work) in quantities(&chain) {
        let batch = chain.batch(None);
        let mut together = vec![0.0; poses * width];
        work(&batch, &q, Parameters::Each(&each), &mut together).unwrap();
        for (i, row) in q.chunks(chain.joint_count()).enumerate() {
            let mut alone = vec![0.0; width];
            work(&batch, row, Parameters::Each(&p), &mut alone).unwrap();
            assert_eq!(alone, together[i * width..][..width]);
        }
    }
}

#[test]
fn prepared_parameters_are_the_same_parameters() {
    let chain = mixed(Convention::Modified);
    let (q, p) = (joints(&chain, 13), chain.nominal());
    for (width, work) in quantities(&chain) {
        let run = |parameters: Parameters<'_>| {
            let mut out = vec![0.0; 13 * width];
            work(&chain.batch(None), &q, parameters, &mut out).unwrap();
            out
        };
        assert_eq!(run(Parameters::One(&p)), run(Parameters::Prepared(&SharedParameters::new(&p))));
    }
}

/// Results so large that they are streamed, at every alignment of the array, are those of a small batch.
#[test]
fn streamed_results_are_the_plain_ones() {
    let chain = six_axis();
    let (block, p) = (1001, chain.nominal());
    let blocks = 24;
    let q = joints(&chain, block);
    let many = q.repeat(blocks);
    let width = 3 * chain.parameter_count();
    let mut plain = vec![0.0; block * width];
    chain.position_jacobian(&q, Parameters::One(&p), &mut plain).unwrap();
    for offset in 0..LANES {
        let mut room = vec![0.0; blocks * block * width + LANES];
        let out = &mut room[offset..][..blocks * block * width];
        chain.position_jacobian(&many, Parameters::One(&p), out).unwrap();
        for part in out.chunks(block * width) {
            assert!(part == plain, "offset {offset}");
        }
        assert!(room[..offset].iter().chain(&room[offset + blocks * block * width..]).all(|x| *x == 0.0));
    }
}

#[test]
fn lengths_that_do_not_fit_are_refused_with_nothing_written() {
    let chain = six_axis();
    let p = chain.nominal();
    let q = vec![0.1; 12];
    let short = SharedParameters::new(&p[5..]);
    for (width, work) in quantities(&chain) {
        let out = vec![7.0; 2 * width];
        let refused = |q: &[f64], parameters: Parameters<'_>, mut out: Vec<f64>, wanted: &str| {
            let before = out.clone();
            let error = work(&chain.batch(None), q, parameters, &mut out).unwrap_err();
            assert!(matches!(&error, KinematicsError::Length { name, .. } if *name == wanted), "{error}");
            assert_eq!(before, out);
        };
        refused(&q[..11], Parameters::One(&p), out.clone(), "joints");
        refused(&q, Parameters::One(&p[..29]), out.clone(), "parameters");
        refused(&q, Parameters::Prepared(&short), out.clone(), "parameters");
        refused(&q, Parameters::Each(&p), out.clone(), "parameters");
        refused(&q, Parameters::One(&p), out[1..].to_vec(), "out");
    }
}

#[test]
fn no_poses_are_no_work() {
    let chain = six_axis();
    let p = chain.nominal();
    for (_, work) in quantities(&chain) {
        assert_eq!(work(&chain.batch(None), &[], Parameters::One(&p), &mut []), Ok(()));
    }
}

struct Sweep<'a>(&'a Chain, &'a [Lane], &'a SharedParameters);

impl Kernel for Sweep<'_> {
    type Output = (Vec<f64>, [Lane; 3]);

    #[inline(always)]
    fn run<I: Isa>(self) -> Self::Output {
        let columns: Vec<usize> = (0..self.0.parameter_count()).collect();
        let mut screws = vec![Screw::ZERO; columns.len()];
        let mut frame = LaneFrame::splat(&Transform::IDENTITY);
        let parameters = LaneParameters::Shared(self.2);
        self.0.sweep::<I>(self.1, parameters, &columns, &mut frame, &mut screws);
        let mut all: Vec<f64> =
            frame.rotation.iter().chain(&frame.position).flat_map(|lane| lane.0).collect();
        all.extend(screws.iter().flat_map(|s| s.angular.iter().chain(&s.linear)).flat_map(|lane| lane.0));
        (all, self.0.end_point::<I>(self.1, parameters))
    }
}

#[test]
fn instruction_sets_agree() {
    for chain in [six_axis(), mixed(Convention::Standard), mixed(Convention::Modified)] {
        let q: Vec<Lane> =
            spread(chain.joint_count(), 2).iter().map(|x| Lane::from_fn(|i| x * i as f64)).collect();
        let shared = SharedParameters::new(&chain.nominal());
        let run = |set| dispatch_on(set, Sweep(&chain, &q, &shared));
        let (baseline, point) = run(InstructionSet::Baseline);
        for set in InstructionSet::ALL {
            let (other, there) = run(set);
            assert_close(&other, &baseline, 1e-12);
            for k in 0..3 {
                assert_close(&there[k].0, &point[k].0, 1e-12);
            }
        }
    }
}

#[test]
fn some_columns_are_those_of_all() {
    struct Some<'a>(&'a Chain, &'a [Lane], &'a [usize]);
    impl Kernel for Some<'_> {
        type Output = Vec<Screw>;
        #[inline(always)]
        fn run<I: Isa>(self) -> Vec<Screw> {
            let shared = SharedParameters::new(&self.0.nominal());
            // Of other columns before.
            let used = [Lane::splat(7.0); 3];
            let mut screws = vec![Screw { angular: used, linear: used }; self.2.len()];
            let mut frame = LaneFrame::splat(&Transform::IDENTITY);
            self.0.sweep::<I>(self.1, LaneParameters::Shared(&shared), self.2, &mut frame, &mut screws);
            screws
        }
    }
    for convention in [Convention::Standard, Convention::Modified] {
        let chain = mixed(convention);
        let q: Vec<Lane> =
            spread(chain.joint_count(), 2).iter().map(|x| Lane::from_fn(|i| x * i as f64)).collect();
        let every: Vec<usize> = (0..chain.parameter_count()).collect();
        let all = dispatch_on(InstructionSet::detected(), Some(&chain, &q, &every));
        for wanted in [vec![0], vec![3, 4, 7, 21, 44], vec![2, 10, 11, 12, 13, 14, 43]] {
            let few = dispatch_on(InstructionSet::detected(), Some(&chain, &q, &wanted));
            assert_eq!(few, wanted.iter().map(|c| all[*c]).collect::<Vec<_>>());
        }
    }
}

struct RoundTrip<'a>(&'a [f64], usize, usize);

impl Kernel for RoundTrip<'_> {
    type Output = (Vec<Lane>, Vec<f64>);

    #[inline(always)]
    fn run<I: Isa>(self) -> Self::Output {
        let RoundTrip(rows, width, first) = self;
        let mut lanes = vec![Lane::ZERO; lane_room(width)];
        load_lanes::<I>(rows, width, first, &mut lanes);
        let order: Vec<usize> = (0..width).collect();
        let mut back = vec![0.0; (rows.len() - first * width).min(LANES * width)];
        store_lanes::<I>(&lanes, &order, &mut back);
        (lanes, back)
    }
}

#[test]
fn rows_go_to_lanes_and_back() {
    for set in InstructionSet::ALL {
        for width in 1..20 {
            let rows: Vec<f64> = (0..19 * width).map(|i| i as f64).collect();
            for first in [0, 3, 8, 11, 16, 18] {
                let (lanes, back) = dispatch_on(set, RoundTrip(&rows, width, first));
                for (j, lane) in lanes[..width].iter().enumerate() {
                    let wanted = Lane::from_fn(|i| ((first + i).min(18) * width + j) as f64);
                    assert_eq!(*lane, wanted, "{set:?}, width {width}, from {first}");
                }
                assert_eq!(back, rows[first * width..][..back.len()], "{set:?}, width {width}, from {first}");
            }
        }
    }
}
