//! `trocar scene`: its text and JSON; mistakes give one line and exit code 2.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use std::process::{Command, Output};

fn trocar(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_trocar")).args(arguments).output().unwrap()
}

fn printed(arguments: &[&str]) -> String {
    let output = trocar(arguments);
    assert!(output.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
fn what_is_shown_is_in_order() {
    assert!(printed(&["scene", "list"]).starts_with("cell-a: "));
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("mine.toml");
    let path = file.to_str().unwrap();
    for form in [&["scene", "show", "cell-a"][..], &["scene", "show", "cell-a", "--canonical"]] {
        std::fs::write(&file, printed(form)).unwrap();
        let text = printed(&["scene", "check", path]);
        assert!(text.contains("is valid: scene 'cell-a', task appendix-resection"), "{text}");
        let checked: serde_json::Value = serde_json::from_str(&printed(&["scene", "check", path, "--json"])).unwrap();
        assert_eq!(checked["arms"], serde_json::json!(["left", "right"]));
        assert_eq!(checked["organs"].as_array().unwrap().len(), 6);
    }
    let shown: serde_json::Value = serde_json::from_str(&printed(&["scene", "show", path, "--json"])).unwrap();
    assert_eq!(shown["port"][0]["hole_diameter_mm"], 6.0);
    let schema: serde_json::Value = serde_json::from_str(&printed(&["scene", "schema"])).unwrap();
    assert!(schema["properties"]["arm"].is_object());
}

#[test]
fn mistakes_are_one_line() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("bad.toml");
    let text = "name = 'bad'\n[specimen]\nphantom = 'phantom-a'\n[safety]\nrcm_abort_mm = 0.005\n";
    std::fs::write(&file, text).unwrap();
    let path = file.to_str().unwrap();
    let expected =
        format!("error: {path}: line 5: safety.rcm_abort_mm is 0.005; it must be in [0.01, 50] mm; 0.005 m is 5 mm\n");
    for action in ["check", "show"] {
        let output = trocar(&["scene", action, path]);
        assert_eq!(output.status.code(), Some(2));
        assert_eq!(String::from_utf8_lossy(&output.stderr), expected);
        assert!(output.stdout.is_empty());
    }
    let unknown = trocar(&["scene", "show", "cell-d"]);
    assert!(String::from_utf8_lossy(&unknown.stderr).contains("did you mean 'cell-a'?"));
}

/// `scene check` of a resection of a tube whose specimen is in this place (m).
fn checked(position: [f64; 3], insertion: Option<f64>) -> String {
    let dir = tempfile::tempdir().unwrap();
    let file = trocar_testing::tube::reach(dir.path(), "mine.toml", 1.0, &["endoscope"]);
    let mut scene = trocar_scene::Scene::read_file(&file).unwrap();
    scene.task.name = trocar_scene::TaskName::AppendixResection;
    scene.placement.position_m = position;
    if let Some(insertion) = insertion {
        scene.arms[0].start.insertion_mm = insertion;
    }
    std::fs::write(&file, scene.to_toml().unwrap()).unwrap();
    let output = trocar(&["scene", "check", file.to_str().unwrap()]);
    assert_eq!(output.status.code(), Some(2), "{}", String::from_utf8_lossy(&output.stdout));
    let said = String::from_utf8(output.stderr).unwrap();
    assert_eq!(said.lines().count(), 1, "{said}");
    assert!(said.starts_with(&format!("error: {}: ", file.display())), "{said}");
    said
}

#[test]
fn an_organ_that_is_out_of_reach_or_in_the_way_is_named() {
    // A metre aside, and 13 cm too high.
    let aside = checked([1.0, 0.46, 0.045], None);
    assert!(aside.contains("the left arm misses the tube by") && aside.contains("trocar scene new"), "{aside}");
    let high = checked([0.0, 0.46, 0.175], None);
    assert!(high.contains("the left arm misses the tube by"), "{high}");
    // Within reach, but the arm would start in the bed.
    let deep = checked([0.0, 0.46, 0.045], Some(160.0));
    let words = ["arm 'left', start.insertion_mm is 160 mm", " mm beyond ", "low at z = 2", "it must be in [", "] mm"];
    assert!(words.iter().all(|word| deep.contains(word)), "{deep}");
}

#[test]
#[cfg(target_os = "linux")]
fn a_result_that_cannot_be_printed_is_no_success() {
    let full = std::fs::File::options().write(true).open("/dev/full").unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_trocar")).args(["scene", "list"]).stdout(full).output().unwrap();
    assert_eq!(output.status.code(), Some(1));
    assert!(String::from_utf8_lossy(&output.stderr).starts_with("error: standard output: "));
}
