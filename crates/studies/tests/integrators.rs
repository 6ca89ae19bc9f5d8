//! The comparison of integrators on a small mesh: which diverge, which stay bounded, and the files.
#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use trocar_core::Silent;
use trocar_studies::IntegratorsExperiment;
use trocar_studies::names::Recorded;
use trocar_studies::scenes::Organs;
use trocar_studies::study::run;

#[test]
fn the_papers_finding_depends_on_settings() {
    let folder = tempfile::tempdir().unwrap();
    let mesh = folder.path().join("appendix.msh");
    let organs = Organs::analytic_appendix(1200).unwrap();
    trocar_geometry::io::write_msh(&mesh, &organs.organs[0].mesh).unwrap();
    let experiment = IntegratorsExperiment {
        mesh: Some(mesh),
        recorded: Recorded { frames: 181, seed: 1 },
        seconds: 0.2,
        undamped: false,
        threads: 1,
    };
    let output = folder.path().join("out");
    let result = run(&experiment, &output, &Silent).unwrap().0.figures;
    let row = |name: &str| result.integrators.iter().find(|r| r.name == name).unwrap();
    assert!(!row("Semi-implicit Euler").bounded);
    assert_eq!(row("XPBD as in Newton 1.8").ended_at_s, Some(1.0 / 60.0));
    let stable = row("Semi-implicit Euler, stable steps");
    assert!(stable.bounded && stable.sag_error.unwrap() < 0.02, "{:?}", stable.sag_error);
    let small = row("XPBD, neo-Hookean, small steps");
    assert!(small.bounded && small.sag_error.unwrap() < 0.1, "{:?}", small.sag_error);
    assert!(row("Vertex Block Descent as in the paper").bounded);
    assert!(result.findings.iter().any(|f| f.contains("XPBD: whether it stays bounded depends on its settings")));
    let page = std::fs::read_to_string(output.join("report.html")).unwrap();
    assert!(page.contains("<svg") && page.contains("six strains"));
    let json: serde_json::Value =
        serde_json::from_slice(&std::fs::read(output.join("integrators.json")).unwrap()).unwrap();
    assert_eq!(json["integrators"].as_array().unwrap().len(), result.integrators.len());

    // A folder with other content is refused.
    let foreign = folder.path().join("foreign");
    std::fs::create_dir(&foreign).unwrap();
    std::fs::write(foreign.join("thesis.txt"), "mine").unwrap();
    assert!(run(&experiment, &foreign, &Silent).is_err());
    assert!(run(&IntegratorsExperiment { seconds: f64::NAN, ..experiment }, &output, &Silent).is_err());
}
