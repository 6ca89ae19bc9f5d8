//! A real organ model becomes a body, settles, and is lifted.

use std::path::Path;
use trocar_core::Silent;
use trocar_geometry::io::Unit;
use trocar_reconstruct::Settings;
use trocar_scene::GraspDesignName;
use trocar_workflow::{Lift, reconstruct_surface};

#[test]
fn a_gallbladder_is_lifted() {
    let organs = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/data/lapgym_organs");
    let file = organs.join("grasp_lift_touch__gallbladder_collision.stl");
    if !file.is_file() {
        println!("skipped: {} is absent", file.display());
        return;
    }
    let dir = tempfile::tempdir().unwrap();
    let (specimen, run) = (dir.path().join("specimen"), dir.path().join("run"));
    // A coarse body: the test is of the way, not of the figures.
    let settings = Settings { max_tets: 8_000, ..Settings::default() };
    let made = reconstruct_surface(&file, Unit::Millimetre, &settings, &specimen, &Silent).unwrap();
    let facts = made.organs[0].facts;
    assert!(facts.watertight && facts.inverted == 0 && facts.min_dihedral_deg >= 10.0);
    // What the model's own triangles enclose.
    assert!((facts.volume_cm3 / 35.95 - 1.0).abs() < 0.05, "{} cm3", facts.volume_cm3);
    // Jaws of half a newton do not hold a gallbladder by friction.
    let lift = Lift { design: Some(GraspDesignName::LivePose), ..Lift::default() };
    let lifted = lift.run_specimen(&specimen, &run, &Silent).unwrap();
    let s = &lifted.episode.summary;
    assert!(s.held && s.details.settling.settled && !s.diverged && s.inverted_peak == 0, "{s:?}");
    assert!(run.join("report.html").is_file());
}
