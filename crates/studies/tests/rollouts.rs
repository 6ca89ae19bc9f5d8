//! Invalid options of the rollouts.

use tempfile::TempDir;
use trocar_core::Silent;
use trocar_studies::RolloutsExperiment;
use trocar_studies::names::SceneChoice;
use trocar_studies::study::run;

#[test]
fn too_many_rollouts_are_refused() {
    let dir = TempDir::new().unwrap();
    let rollouts = RolloutsExperiment {
        scene: SceneChoice { scene: "cell-a".to_owned(), phantoms: dir.path().join("phantoms") },
        rollouts: 900_000_000,
        seed: 0,
        jobs: 1,
    };
    let folder = dir.path().join("campaign");
    let why = run(&rollouts, &folder, &Silent).unwrap_err().to_string();
    assert!(why.starts_with("--rollouts 900000000: "), "names the option: {why}");
    assert!(!folder.exists(), "no folder is created");
}
