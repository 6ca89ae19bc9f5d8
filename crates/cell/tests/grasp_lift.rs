//! The grasp-lift task on a small analytic tube.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use glam::DVec3;
use trocar_cell::{GraspLift, GraspLiftRun};
use trocar_geometry::{LatticeMesher, SignedDistance, TetQuality};
use trocar_progress::Silent;
use trocar_specimen::{End, Material, Organ, OrganFacts, Pins, Provenance, Specimen};

/// A tube along x, 60 mm long and 9 mm thick: about the appendix.
struct Tube;

const RADIUS: f64 = 0.0045;
const HALF_LENGTH: f64 = 0.030;

impl SignedDistance for Tube {
    fn distance(&self, p: DVec3) -> f64 {
        (p - DVec3::X * p.x.clamp(RADIUS - HALF_LENGTH, HALF_LENGTH - RADIUS)).length() - RADIUS
    }
}

/// The tube as a specimen under a camera that looks straight down.
fn specimen(pins: Pins) -> Specimen {
    let half = DVec3::new(HALF_LENGTH, RADIUS, RADIUS);
    let body = LatticeMesher::uniform(2.2e-3).mesh_shape(&Tube, (-half, half)).unwrap();
    let quality = TetQuality::of(&body);
    let surface = body.boundary().0;
    Specimen {
        name: "tube".into(),
        up: -DVec3::Z,
        placement: trocar_geometry::Pose::IDENTITY,
        camera: None,
        organs: vec![Organ {
            name: "tube".into(),
            surface,
            material: Material::default(),
            pins,
            base: -HALF_LENGTH * DVec3::X,
            facts: OrganFacts { nodes: body.vertices.len(), inverted: quality.inverted, ..OrganFacts::default() },
            body,
        }],
        background: None,
        provenance: Provenance::default(),
    }
}

const ONE_END: Pins = Pins::End { end: End::Base, length: 0.15, band_length: 0.0, band_share: 0.0 };

fn run(task: &GraspLift, pins: Pins) -> GraspLiftRun {
    task.run(&specimen(pins), &Silent).unwrap()
}

#[test]
fn a_grasped_tube_follows_the_jaws() {
    for pins in [ONE_END, Pins::Band { share: 0.42 }] {
        let run = run(&GraspLift { snapshot_every: 10, ..GraspLift::default() }, pins);
        let s = &run.summary;
        assert!(s.held && !s.diverged && s.settled, "{s:?}");
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
    assert!(refuse(GraspLift::default(), Pins::Band { share: 1.0 }).contains("pinned"));
}
