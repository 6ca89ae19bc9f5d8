//! Phantom B, which moves at 0.136 m/s in the paper, comes to rest within a second.
#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use trocar_core::Silent;
use trocar_studies::SettlingExperiment;
use trocar_studies::names::{Recorded, SolverName};
use trocar_studies::study::run;

#[test]
fn phantom_b_settles() {
    let folder = tempfile::tempdir().unwrap();
    let experiment = SettlingExperiment {
        phantoms: vec!["phantom-b".into()],
        recorded: Recorded { frames: 9, seed: 1 },
        schedule: SolverName::Adaptive,
        threads: 0,
    };
    let result = run(&experiment, folder.path(), &Silent).unwrap().0.figures;
    let b = &result.phantoms[0];
    assert!(b.settled && b.speed_m_s < 0.01 && b.paper_speed_m_s == Some(0.136), "{} m/s", b.speed_m_s);
    assert_eq!((b.organs.len(), b.speeds.len()), (5, 90));
    let fastest = b.organs.iter().map(|o| o.speed_m_s).fold(0.0, f64::max);
    assert!((fastest - b.speed_m_s).abs() < 1e-6, "{fastest} {}", b.speed_m_s);
    assert!(std::fs::read_to_string(folder.path().join("report.html")).unwrap().contains("phantom-b"));
    assert!(run(&SettlingExperiment { phantoms: vec!["none".into()], ..experiment }, folder.path(), &Silent).is_err());
}
