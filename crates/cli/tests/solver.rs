//! The commands that measure the stepping of tissue, on tiny organs.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use serde_json::Value;
use std::path::Path;
use std::process::{Command, Output};

fn trocar(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_trocar")).args(arguments).output().unwrap()
}

fn said(arguments: &[&str]) -> Value {
    let run = trocar(&[&["--json"], arguments].concat());
    assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    serde_json::from_slice(&run.stdout).unwrap()
}

fn number(value: &Value, key: &str) -> f64 {
    value[key].as_f64().unwrap_or_else(|| panic!("no number '{key}' in {value}"))
}

fn page(result: &Value) -> String {
    std::fs::read_to_string(result["report"].as_str().unwrap()).unwrap()
}

#[test]
fn speed_and_error_are_told_together() {
    let of = |schedule| {
        said(&[
            "bench",
            "organs",
            "--tets",
            "5400",
            "--schedule",
            schedule,
            "--threads",
            "1",
            "--frames",
            "8",
            "--settle",
            "1",
        ])
    };
    let (fast, paper) = (of("fast"), of("paper"));
    for r in [&fast, &paper] {
        for key in ["real_time_factor", "real_time_factor_moving", "frame_ms_median", "static_sag_um"] {
            assert!(number(r, key) > 0.0, "{key} in {r}");
        }
        assert_eq!((number(r, "threads"), number(r, "organs")), (1.0, 6.0));
        assert_eq!((r["appendix"].as_str(), r["isa"].is_string()), (Some("appendix"), true));
        let factor = 1e3 / 60.0 / number(r, "frame_ms_median");
        assert!((number(r, "real_time_factor") / factor - 1.0).abs() < 1e-9);
        let worst = r["step_errors"].as_array().unwrap().iter().map(|e| e.as_f64().unwrap()).fold(0.0, f64::max);
        assert_eq!(number(r, "step_error"), worst);
        assert_eq!(number(&r["drag"], "frames"), 8.0);
    }
    // The paper's start kicks a resting body; the default's does not.
    assert!(number(&fast, "static_sag_error") < 0.01, "{fast}");
    assert!(number(&paper, "static_sag_error") > 10.0 * number(&fast, "static_sag_error"), "{paper}");
    assert_eq!(number(&fast, "static_sag_um"), number(&paper, "static_sag_um"));
}

#[test]
fn scaling_leaves_out_what_would_take_too_long() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("scaling");
    let common = ["bench", "scaling", "--sizes", "1000,4000", "--threads", "1", "--many", "3", "--small", "250"];
    let run = |budget: &str| said(&[&common[..], &["--budget", budget, "-o", out.to_str().unwrap()]].concat());
    let all = run("1");
    let rows = all["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 4);
    assert!(rows.iter().all(|r| number(&r["timing"], "real_time_factor") > 0.0), "{all}");
    assert!(number(&rows[3], "tets") > 2.0 * number(&rows[0], "tets"));
    for many in all["many"].as_array().unwrap() {
        let loss = number(many, "many_ms") / number(many, "one_model_ms") - 1.0;
        assert!((number(many, "loss") - loss).abs() < 1e-9 && number(many, "models") == 3.0, "{many}");
    }
    assert!(page(&all).contains("Many small models") && out.join("scaling.json").is_file());
    // The folder is replaced by the next run; with no time only the first size is measured.
    let hurried = run("0.00001");
    let skipped: Vec<bool> = hurried["rows"].as_array().unwrap().iter().map(|r| r["skipped"].is_string()).collect();
    assert_eq!(skipped, [false, false, true, true]);
    assert!(page(&hurried).contains("expected"));
}

#[test]
fn convergence_goes_on_where_it_was_and_reaches_the_oracle() {
    let dir = tempfile::tempdir().unwrap();
    let out = dir.path().join("convergence");
    let run = || {
        said(&[
            "experiment",
            "convergence",
            "--tets",
            "500",
            "--scene",
            "drag",
            "--scene",
            "sag",
            "--young",
            "12",
            "--poisson",
            "0.45,0.3",
            "--iterations",
            "128",
            "-o",
            out.to_str().unwrap(),
        ])
    };
    let first = run();
    let cases = first["cases"].as_array().unwrap();
    assert_eq!((cases.len(), number(&first, "reused")), (4, 0.0));
    for case in cases {
        assert!(case["failure"].is_null(), "{case}");
        for schedule in ["paper", "fast"] {
            let rows: Vec<&Value> =
                case["rows"].as_array().unwrap().iter().filter(|r| r["schedule"] == schedule).collect();
            assert!(rows.len() >= 8 && rows.iter().filter(|r| r["own"] == true).count() == 1, "{case}");
            let error = |r: &Value| number(r, "energy_error");
            let (one, most) = (error(rows[0]), error(rows[rows.len() - 1]));
            assert!(most <= one && most.abs() < 1e-6, "{schedule}, {}: {one} after 1, {most} at last", case["scene"]);
        }
    }
    assert!(page(&first).contains("Energy error"));

    // Of the four finished cases two stay, and the third was cut off while it was written.
    let trials = out.join("trials.jsonl");
    let text = std::fs::read_to_string(&trials).unwrap();
    let lines: Vec<&str> = text.lines().collect();
    assert_eq!(lines.len(), 5, "a header and a line a case: {text}");
    std::fs::write(&trials, format!("{}\n{}", lines[..3].join("\n"), &lines[3][..20])).unwrap();
    let again = run();
    assert_eq!(number(&again, "reused"), 2.0);
    let errors = |result: &Value| -> Vec<f64> {
        let rows = result["cases"].as_array().unwrap().iter().flat_map(|c| c["rows"].as_array().unwrap());
        rows.map(|r| number(r, "position_error_um")).collect()
    };
    let (then, now) = (errors(&first), errors(&again));
    assert!(then.len() == now.len() && then.iter().zip(&now).all(|(a, b)| (a - b).abs() <= 1e-12 * a));
}

#[test]
fn bad_input_is_one_line() {
    let dir = tempfile::tempdir().unwrap();
    let mine = dir.path().join("mine");
    std::fs::create_dir(&mine).unwrap();
    std::fs::write(mine.join("letter.txt"), "dear").unwrap();
    let refused = |arguments: &[&str], words: &[&str]| {
        let run = trocar(arguments);
        let said = String::from_utf8_lossy(&run.stderr).into_owned();
        assert_eq!((run.status.code(), said.trim_end().lines().count()), (Some(2), 1), "{arguments:?}: {said}");
        assert!(words.iter().all(|w| said.contains(w)), "{arguments:?}: {said}");
    };
    let path = |p: &Path| p.to_str().unwrap().to_owned();
    refused(&["bench", "organs", "--mesh", &path(&dir.path().join("none.msh"))], &["none.msh"]);
    refused(&["bench", "organs", "--tets", "1000", "--young", "0.0001"], &["Young's modulus"]);
    refused(&["bench", "organs", "--tets", "1000", "--frames", "0"], &["frames"]);
    refused(&["bench", "scaling", "--sizes", "1000", "-o", &path(&mine)], &["mine"]);
    refused(&["experiment", "convergence", "--scene", "swim", "-o", &path(&dir.path().join("c"))], &["swim", "tube"]);
    refused(&["experiment", "convergence", "--tets", "500", "-o", &path(&mine)], &["mine", "convergence.json"]);
    assert_eq!(mine.read_dir().unwrap().count(), 1);
}
