//! The grasp-lift task on a small analytic tube.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

mod common;

use common::{ONE_END, specimen};
use trocar_cell::{GraspDesign, GraspLift, GraspLiftRun};
use trocar_core::Silent;
use trocar_specimen::Pins;

fn run(task: &GraspLift, pins: Pins) -> GraspLiftRun {
    task.run(&specimen(pins), &Silent).unwrap()
}

#[test]
fn a_grasped_tube_follows_the_jaws() {
    for pins in [ONE_END, Pins::Band { share: 0.42 }] {
        let design = GraspDesign::LivePose;
        let run = run(&GraspLift { snapshot_every: 10, design, ..GraspLift::default() }, pins);
        let s = &run.summary;
        assert!(s.held && !s.diverged && s.settled, "{s:?}");
        assert!(s.attached && s.gap_mm > 1.5, "{s:?}");
        assert!((s.lift_mm - 15.0).abs() < 0.05 && s.slip_mm < 0.01, "{s:?}");
        assert_eq!(s.snap_mm, 0.0, "live-pose capture does not move the tissue");
        assert_eq!(s.pin_drift_mm, 0.0, "pinned nodes do not move");
        assert_eq!((s.inverted_rest, s.inverted_peak), (0, 0));
        assert!(s.activation_step_mm < 0.5, "closing moves nothing by itself: {} mm", s.activation_step_mm);
        assert_eq!(run.snapshots.len(), run.samples.len() / 10);
    }
}

#[test]
fn released_tissue_comes_back_down() {
    let run = run(&GraspLift::default(), ONE_END);
    let last = run.samples.last().unwrap();
    assert!(last.tissue_lift_mm.abs() < 2.0, "{} mm above where it was grasped", last.tissue_lift_mm);
}

#[test]
fn the_result_does_not_depend_on_the_run_or_the_number_of_threads() {
    let hash = |threads| run(&GraspLift { threads, ..GraspLift::default() }, ONE_END).summary.state_hash;
    let one = hash(1);
    assert_eq!(one, hash(1));
    assert_eq!(one, hash(2));
}

#[test]
fn bad_options_are_named() {
    let refuse = |task: GraspLift, pins| task.run(&specimen(pins), &Silent).unwrap_err().to_string();
    let unknown = refuse(GraspLift { organ: Some("liver".into()), ..GraspLift::default() }, ONE_END);
    assert!(unknown.contains("liver") && unknown.contains("tube"), "{unknown}");
    assert!(refuse(GraspLift { at: 1.5, ..GraspLift::default() }, ONE_END).contains("--at"));
    assert!(refuse(GraspLift { lift: f64::NAN, ..GraspLift::default() }, ONE_END).contains("--lift"));
    assert!(refuse(GraspLift { jaw_force: 0.0, ..GraspLift::default() }, ONE_END).contains("--jaw-force"));
    assert!(refuse(GraspLift { approach_offset: 1.0, ..GraspLift::default() }, ONE_END).contains("approach offset"));
    assert!(refuse(GraspLift { regrasp: Some(f64::NAN), ..GraspLift::default() }, ONE_END).contains("drag"));
    assert!("grip".parse::<GraspDesign>().unwrap_err().to_string().contains("live-pose"));
    assert!(refuse(GraspLift::default(), Pins::Band { share: 1.0 }).contains("pinned"));
}

#[test]
fn designs_have_their_names() {
    for design in GraspDesign::ALL {
        assert_eq!(design.to_string().parse::<GraspDesign>().unwrap(), design);
    }
    assert_eq!(GraspDesign::ALL.map(GraspDesign::name), ["friction", "rest-pose", "live-pose", "compliant"]);
}

#[test]
fn displacement_since_rest_is_the_snap_of_a_rest_pose_grasp_alone() {
    let grasp = |design| {
        run(&GraspLift { design, regrasp: Some(0.003), lower: false, ..GraspLift::default() }, ONE_END).summary
    };
    let (rest, live) = (grasp(GraspDesign::RestPose), grasp(GraspDesign::LivePose));
    assert!((rest.snap_mean_mm - rest.displaced_mm).abs() < 0.01, "equation (5): {rest:?}");
    assert_eq!((live.snap_mm, live.snap_mean_mm), (0.0, 0.0));
    assert!((rest.displaced_mm - live.displaced_mm).abs() < 1e-9, "the same state before the second grasp");
}

#[test]
fn jaws_that_press_hold_by_friction_and_compliantly() {
    for design in [GraspDesign::Friction, GraspDesign::Compliant] {
        let s = run(&GraspLift { design, lower: false, ..GraspLift::default() }, ONE_END).summary;
        assert!(s.attached && s.held && !s.torn && !s.diverged && s.inverted_peak == 0, "{s:?}");
        assert!((s.closing_force_n - s.jaw_force_n).abs() < 0.1 * s.jaw_force_n, "{s:?}");
        assert_eq!(s.snap_mm, 0.0);
        let loose = GraspLift { design, jaw_force: 0.02, lower: false, ..GraspLift::default() };
        assert!(!run(&loose, ONE_END).summary.held, "{design}: jaws that hardly press hold nothing");
    }
}
