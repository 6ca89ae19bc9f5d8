//! The demonstration, as a user runs it.

use std::process::Command;

#[test]
fn the_demo_lifts_the_appendix_of_a_reconstructed_phantom() {
    let dir = tempfile::tempdir().unwrap();
    let output = dir.path().join("demo");
    let run = Command::new(env!("CARGO_BIN_EXE_trocar"))
        .args(["demo", "--json", "--frames", "31", "-o", output.to_str().unwrap()])
        .output()
        .unwrap();
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    // A slow machine gets a plain line every half minute, but no bar is drawn into a pipe.
    let progress = String::from_utf8_lossy(&run.stderr);
    assert!(!progress.contains(['\r', '\u{1b}']), "no bars in a pipe: {progress}");
    let said: serde_json::Value = serde_json::from_slice(&run.stdout).unwrap();
    let number = |key: &str| said[key].as_f64().unwrap_or_else(|| panic!("no number '{key}' in {said}"));
    assert_eq!((number("organs"), number("watertight")), (6.0, 6.0));
    assert_eq!((number("inverted_rest"), number("inverted_peak")), (0.0, 0.0));
    assert_eq!((number("snap_mm"), number("pin_drift_mm")), (0.0, 0.0));
    assert!(number("lift_mm") >= 0.8 * 15.0 && number("slip_mm") < 3.0);
    assert_eq!((&said["diverged"], &said["held"], &said["settled"]), (&false.into(), &true.into(), &true.into()));
    for organ in said["reconstructed"]["organs"].as_array().unwrap() {
        assert!(organ["min_dihedral_deg"].as_f64().unwrap() >= 10.0, "{organ}");
        assert!(organ["depth_error_median_mm"].as_f64().unwrap() <= 1.0, "{organ}");
        assert!(organ["depth_error_signed_mm"].as_f64().unwrap().abs() <= 0.3, "{organ}");
    }
    let report = std::fs::read_to_string(said["report"].as_str().unwrap()).unwrap();
    assert!(report.starts_with("<!DOCTYPE html>") && report.contains("appendix"));
    let index = std::fs::read_to_string(output.join("index.html")).unwrap();
    assert!(index.contains("content=\"0; url=run/report.html\"") && output.join("run/report.html").is_file());
    for file in ["recording/recording.toml", "specimen/specimen.toml", "run/result.json", "run/channels.csv"] {
        assert!(output.join(file).is_file(), "{file}");
    }
}
