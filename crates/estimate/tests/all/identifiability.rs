//! Which parameters the poses determine, and with what the others are confounded.
#![allow(clippy::unwrap_used, reason = "a test may stop")]

use crate::common::arms::{
    RV_M2_SPANS, columns, rv_m2, rv_m2_fifteen, ur10, ur10_columns, ur10_determined, ur10_plain_columns,
};
use crate::common::scene::{Plan, Scene};
use truearm_estimate::{FrameMode, Identifiability, Layout, identifiability};

fn ask(scene: &Scene) -> Identifiability {
    identifiability(&scene.problem(), &scene.chain.nominal(), &scene.setup).unwrap()
}

fn of(plan: &Plan) -> (Identifiability, Vec<usize>) {
    let answer = ask(&plan.make());
    let names = answer.determined.iter().map(|&k| plan.columns[k]).collect();
    (answer, names)
}

#[test]
fn ur10_from_positions_has_sixteen_of_twenty_four() {
    let (answer, determined) = of(&Plan::new(ur10(), ur10_plain_columns(), 60));
    assert_eq!((determined.len(), answer.total_rank), (16, 25));
}

#[test]
fn beta_in_place_of_d_on_parallel_axes_makes_it_eighteen_and_twenty_seven_in_all() {
    let (answer, determined) = of(&Plan::new(ur10(), ur10_columns(), 60));
    assert_eq!(answer.total_rank, 27);
    assert_eq!(determined, ur10_determined());
    assert!(answer.condition > 1.0 && answer.condition < 1e4, "{}", answer.condition);
}

#[test]
fn few_poses_among_many_count_wherever_they_stand() {
    let mut still = Plan::new(ur10(), ur10_columns(), 2500);
    still.spans = vec![2.5, 2.5, 2.5, 2.5, 0.0, 0.0];
    let moved = ask(&Plan::new(ur10(), ur10_columns(), 20).make());
    let mut scene = still.make();
    assert!(ask(&scene).determined.len() < moved.determined.len());
    let turned = Plan::new(ur10(), ur10_columns(), 20).make();
    for (k, joints) in turned.set.joints.chunks_exact(6).enumerate() {
        let pose = 1 + 2 * (60 * k + 1);
        scene.set.joints[6 * pose..6 * (pose + 1)].copy_from_slice(joints);
    }
    let found = ask(&scene);
    assert_eq!(found.determined, moved.determined);
    assert_eq!(found.total_rank, moved.total_rank);
}

#[test]
fn poses_tell_no_more_of_the_arm_than_positions_where_the_tool_s_orientation_is_unknown_too() {
    let plan = Plan::new(ur10(), ur10_columns(), 60);
    let (positions, _) = of(&plan);
    let (poses, _) = of(&Plan { rotations: true, ..plan });
    assert_eq!(poses.determined, positions.determined);
    assert_eq!(poses.total_rank, positions.total_rank + 3);
}

#[test]
fn a_known_world_determines_the_base_s_side_too() {
    let plan = Plan { frame: FrameMode::World, ..Plan::new(ur10(), ur10_columns(), 60) };
    let (answer, determined) = of(&plan);
    assert!(determined.contains(&0) && determined.contains(&1));
    assert_eq!(answer.total_rank, 3 + determined.len());
}

#[test]
fn the_paper_s_fifteen_are_twelve_and_a_free_target() {
    let plan = Plan {
        frame: FrameMode::World,
        spans: RV_M2_SPANS.to_vec(),
        ..Plan::new(rv_m2(), rv_m2_fifteen(), 200)
    };
    let (answer, determined) = of(&plan);
    assert_eq!(answer.total_rank, 15);
    assert_eq!(determined, rv_m2_fifteen()[..12]);
    assert!(answer.undetermined.iter().all(|column| column.with_setup && column.with.is_empty()));
}

#[test]
fn moving_the_wrist_and_measuring_its_orientation_determine_more_of_the_paper_s_arm() {
    let every = columns(&[[0, 1, 2, 3, 4].as_slice(); 6]);
    let spans = vec![2.6, 1.1, 1.0, 1.5, 2.5];
    let still =
        Plan { frame: FrameMode::World, spans: RV_M2_SPANS.to_vec(), ..Plan::new(rv_m2(), every, 200) };
    let moving = Plan { spans, ..still.clone() };
    let measured = Plan { rotations: true, ..moving.clone() };
    let ranks = [&still, &moving, &measured].map(|plan| of(plan).0.total_rank);
    assert!(ranks[0] == 15 && ranks[0] < ranks[1] && ranks[1] < ranks[2], "{ranks:?}");
}

#[test]
fn d_of_parallel_axes_is_confounded_with_the_d_before_it_one_to_one() {
    let offered = columns(&[&[2, 3], &[0, 1, 2, 3], &[0, 1, 2, 3]]);
    let scene = Plan::new(ur10(), offered.clone(), 60).make();
    let answer = ask(&scene);
    let found = answer.undetermined.iter().find(|entry| offered[entry.column] == 11).unwrap();
    assert!(!found.with_setup);
    let [(other, part)] = found.with[..] else { panic!("one partner: {:?}", found.with) };
    assert_eq!(offered[other], 6);
    assert!((part - 1.0).abs() < 1e-9, "{part}");
}

#[test]
fn link_1_is_confounded_with_the_frame_alone() {
    let offered = columns(&[&[0, 1]]);
    let answer = ask(&Plan::new(ur10(), offered, 60).make());
    assert_eq!(answer.determined, Vec::<usize>::new());
    assert!(answer.undetermined.iter().all(|entry| entry.with_setup && entry.with.is_empty()));
}

#[test]
fn what_a_confounded_column_does_its_combination_does_too() {
    // Moving d2 and d3 against each other leaves every measured point where it was.
    let scene = Plan { errors: 0.0, ..Plan::new(ur10(), ur10_plain_columns(), 30) }.make();
    let mut moved = scene.truth.clone();
    (moved[6], moved[11]) = (moved[6] + 0.01, moved[11] - 0.01);
    let point = truearm_estimate::Point { parameters: &moved, setup: &scene.setup };
    let residual = truearm_estimate::residuals(&scene.problem(), point).unwrap();
    assert!(residual.iter().all(|r| r.abs() < 1e-12));
}

#[test]
fn distances_between_poses_see_no_first_link_and_anchors_no_frame() {
    let plan = Plan::new(ur10(), ur10_columns(), 60);
    let between = plan.make().with_distances(&[], 0.0);
    let determined = |scene: &Scene| -> Vec<usize> {
        ask(scene).determined.into_iter().map(|k| scene.columns[k]).collect()
    };
    assert_eq!(determined(&between), ur10_determined());
    let anchors = [[1.5, 0.2, -0.4], [-0.3, 1.8, 0.9], [0.5, -1.5, 0.2]];
    let anchored = plan.make().with_distances(&anchors, 0.0);
    assert_eq!(determined(&anchored), ur10_determined());
    assert_eq!(ask(&anchored).total_rank, Layout::new(&anchored.problem()).len() - 6);
}
