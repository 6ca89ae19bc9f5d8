//! Reconstruction as a user runs it: the experiment over all phantoms, a bag, masks, meshers.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use std::path::{Path, PathBuf};
use std::process::Command;
use trocar_camera::{Camera, ColorImage, DepthImage};
use trocar_recording::{OrganInfo, RecordingInfo, RecordingWriter};

/// Runs the command in `folder`, which must succeed and print one JSON object.
fn trocar(folder: &Path, arguments: &[&str]) -> serde_json::Value {
    let run =
        Command::new(env!("CARGO_BIN_EXE_trocar")).args(arguments).arg("--json").current_dir(folder).output().unwrap();
    assert!(run.status.success(), "{arguments:?}: {}", String::from_utf8_lossy(&run.stderr));
    serde_json::from_slice(&run.stdout).unwrap()
}

/// Thirteen organs of three phantoms with one set of settings and stereo noise, the harder one.
#[test]
fn every_organ_of_every_phantom_meets_its_limits() {
    let dir = tempfile::tempdir().unwrap();
    let arguments = ["experiment", "reconstruction", "--frames", "9", "--sensor", "stereo", "-o", "out"];
    let said = trocar(dir.path(), &arguments);
    let organs = said["organs"].as_array().unwrap();
    assert_eq!(organs.len(), 13);
    for organ in organs {
        let number = |key: &str| organ[key].as_f64().unwrap_or_else(|| panic!("no number '{key}' in {organ}"));
        assert_eq!((&organ["watertight"], number("inverted")), (&true.into(), 0.0), "{organ}");
        assert!(number("min_dihedral_deg") >= 10.7, "{organ}");
        assert!(number("depth_error_median_mm") <= 1.0, "{organ}");
        assert!(number("signed_error_median_mm").abs() <= 0.3, "{organ}");
        assert!(number("volume_error").abs() <= 0.1, "{organ}");
        assert!(number("covered") > 0.9 && number("paper_tets") > 0.0, "{organ}");
        // The paper's surface has the bias that the paper reports.
        assert!((-2.0..-0.6).contains(&number("binary_grid_signed_error_mm")), "{organ}");
    }
    let liver = organs.iter().find(|o| o["organ"] == "liver").unwrap();
    assert!((0.85..1.15).contains(&(liver["tets"].as_f64().unwrap() / 50_834.0)), "{liver}");
    let report = std::fs::read_to_string(dir.path().join("out/report.html")).unwrap();
    assert!(report.contains("gallbladder") && report.contains("Table I"));
    // An earlier recording is reused.
    let before = std::fs::metadata(dir.path().join("out/phantom-b/recording/frames.csv")).unwrap().modified().unwrap();
    let one =
        ["experiment", "reconstruction", "--frames", "9", "--sensor", "stereo", "--phantom", "phantom-b", "-o", "out"];
    let again = trocar(dir.path(), &one);
    assert_eq!(again["organs"][0], organs[6], "the same recording gives the same organs");
    let after = std::fs::metadata(dir.path().join("out/phantom-b/recording/frames.csv")).unwrap().modified().unwrap();
    assert_eq!(before, after);
}

#[test]
fn a_bag_is_inspected_and_gets_its_template() {
    let dir = tempfile::tempdir().unwrap();
    let fixture = Path::new(env!("CARGO_MANIFEST_DIR")).join("../recording/tests/fixtures/ros2_zstd.mcap");
    std::fs::copy(fixture, dir.path().join("session.mcap")).unwrap();
    let said = trocar(dir.path(), &["inspect", "session.mcap", "--template"]);
    assert_eq!((&said["frames"], &said["camera"]["width"]), (&4.into(), &16.into()));
    assert!(said["notes"][0].as_str().unwrap().contains("1 depth images"), "{said}");
    for file in ["session.toml", "session.png"] {
        assert!(dir.path().join(file).is_file(), "{file}");
    }
    let toml = dir.path().join("session.toml");
    let template = std::fs::read_to_string(&toml).unwrap();
    assert!(template.contains("# [[organ]]"), "an outline that nobody drew is no organ: {template}");
    std::fs::write(
        &toml,
        template
            .replace("# ", "")
            .replace("#\n", "\n")
            .replacen("Facts of", "# Facts of", 1)
            .replacen("depth scale come", "# depth scale come", 1)
            .replacen("by its outline", "# by its outline", 1),
    )
    .unwrap();
    let organs = &trocar(dir.path(), &["inspect", "session.mcap"])["organs"];
    assert_eq!(*organs, serde_json::json!(["organ"]), "the template is read again once it is filled in");
    let refused = Command::new(env!("CARGO_BIN_EXE_trocar"))
        .args(["inspect", "session.mcap", "--template"])
        .current_dir(dir.path())
        .output()
        .unwrap();
    assert_eq!(refused.status.code(), Some(2), "what the user wrote is not overwritten");
}

#[test]
fn meshers_are_measured_side_by_side() {
    let dir = tempfile::tempdir().unwrap();
    let said =
        trocar(dir.path(), &["bench", "meshing", "--sizes", "3000,30000", "--python", "no-such-python", "-o", "out"]);
    let rows = said["rows"].as_array().unwrap();
    assert_eq!(rows.len(), 5);
    for row in rows.iter().filter(|r| r["mesher"].as_str().unwrap().starts_with("lattice")) {
        assert!(row["min_dihedral_deg"].as_f64().unwrap() >= 10.7 && row["inverted"] == 0, "{row}");
        assert!(row["volume_error"].as_f64().unwrap().abs() < 0.05, "{row}");
    }
    let peer = rows.iter().find(|r| r["mesher"].as_str().unwrap().contains("fTetWild")).unwrap();
    assert!(peer["failure"].as_str().unwrap().contains("no-such-python"), "an absent peer says so: {peer}");
    assert!(dir.path().join("out/report.html").is_file());
}

#[test]
fn settings_of_the_mesh_are_kept() {
    let dir = tempfile::tempdir().unwrap();
    let made = trocar(dir.path(), &["record", "phantom-b", "--frames", "3", "-o", "rec"]);
    assert_eq!(made["frames"], 3);
    let tets = |arguments: &[&str]| -> (u64, PathBuf) {
        let name = format!("specimen{}", arguments.join("").replace('-', ""));
        let said = trocar(dir.path(), &[&["reconstruct", "rec", "-o", name.as_str()], arguments].concat());
        (said["organs"][4]["tets"].as_u64().unwrap(), dir.path().join(name))
    };
    let (normal, _) = tets(&[]);
    let (fine, folder) = tets(&["--element-size", "1.5"]);
    assert!(fine > 2 * normal, "{fine} and {normal}");
    let provenance = std::fs::read_to_string(folder.join("specimen.toml")).unwrap();
    assert!(provenance.contains("element_size_m = 0.0015"), "{provenance}");
    let (_, folder) = tets(&["--binary-grid", "--back", "fitted"]);
    let provenance = std::fs::read_to_string(folder.join("specimen.toml")).unwrap();
    assert!(provenance.contains("BinaryGrid") && provenance.contains("Fitted"), "{provenance}");
}

/// Text, JSON and page warn of a moving organ.
#[test]
fn a_moving_organ_is_warned_of() {
    let dir = tempfile::tempdir().unwrap();
    let (width, height) = (96, 72);
    let info = RecordingInfo {
        rate_hz: Some(30.0),
        depth_scale_m: Some(0.001),
        camera: Some(Camera::centred(width, height, 0.6)),
        source: None,
        organs: vec![OrganInfo {
            name: "mound".into(),
            polygon: vec![[30.0, 20.0], [66.0, 20.0], [66.0, 52.0], [30.0, 52.0]],
            ..OrganInfo::default()
        }],
        ..RecordingInfo::of_log("mound".as_ref())
    };
    let writer = RecordingWriter::create(&dir.path().join("recording"), &info).unwrap();
    for frame in 0..30 {
        let mut depth = DepthImage::new(width, height);
        let lift = 0.006 * (0.2 * frame as f32).sin();
        for (i, z) in depth.depth.iter_mut().enumerate() {
            let (x, y) = ((i % width) as f32 - 48.0, (i / width) as f32 - 36.0);
            let inside = 1.0 - (x / 18.0).powi(2) - (y / 16.0).powi(2);
            *z = if inside > 0.0 { 0.29 - 0.015 * inside.sqrt() - lift } else { 0.30 };
        }
        writer.frame(frame, &ColorImage::new(width, height, [170, 60, 50]), &depth, None).unwrap();
    }
    writer.finish().unwrap();
    let said = trocar(dir.path(), &["reconstruct", "recording", "-o", "specimen"]);
    assert!(said["warnings"][0].as_str().unwrap().contains("mound"), "{said}");
    assert!(said["organs"][0]["moving_share"].as_f64().unwrap() > 0.3, "{said}");
    let page = std::fs::read_to_string(dir.path().join("specimen/report.html")).unwrap();
    assert!(page.contains("<p class=\"warning\">"));
    let run = Command::new(env!("CARGO_BIN_EXE_trocar"))
        .args(["reconstruct", "recording", "-o", "specimen"])
        .current_dir(dir.path())
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&run.stdout).into_owned();
    assert!(text.contains("\nwarning: Tissue moves during the window: mound (") && text.contains("--window"), "{text}");
}

/// A phantom is made once in the folder that the environment names, for every working folder.
#[test]
fn a_phantom_is_kept_for_every_working_folder() {
    let cache = tempfile::tempdir().unwrap();
    let here = tempfile::tempdir().unwrap();
    let run = |arguments: &[&str]| {
        let run = Command::new(env!("CARGO_BIN_EXE_trocar"))
            .args(arguments)
            .args(["--quiet", "--json"])
            .env("TROCAR_PHANTOMS", cache.path())
            .current_dir(here.path())
            .output()
            .unwrap();
        assert!(run.status.success(), "{}", String::from_utf8_lossy(&run.stderr));
    };
    run(&["render", "cell-a", "--size", "32x24", "-o", "first.png"]);
    assert!(cache.path().join("phantom-a-1/specimen/specimen.toml").is_file());
    assert!(!here.path().join("trocar-phantoms").exists());
    assert!(!cache.path().join("phantom-a-1/recording").exists(), "it takes thirty times as much room");
    let made = std::fs::metadata(cache.path().join("phantom-a-1/specimen/specimen.toml")).unwrap().modified().unwrap();
    run(&["render", "cell-a", "--size", "32x24", "-o", "second.png"]);
    let kept = std::fs::metadata(cache.path().join("phantom-a-1/specimen/specimen.toml")).unwrap().modified().unwrap();
    assert_eq!(made, kept, "the second run uses the first one's phantom");
}

/// Sensor noise is not motion: no organ of any phantom moves.
#[test]
fn still_phantoms_get_no_warning() {
    let dir = tempfile::tempdir().unwrap();
    for phantom in ["phantom-a", "phantom-b", "phantom-c"] {
        trocar(dir.path(), &["record", phantom, "--frames", "17", "--sensor", "stereo", "-o", phantom]);
        let said = trocar(dir.path(), &["reconstruct", phantom, "--stride", "1", "-o", "specimen"]);
        assert_eq!(said["warnings"], serde_json::json!([]));
        for organ in said["organs"].as_array().unwrap() {
            assert!(organ["moving_share"].as_f64().unwrap() < 0.02, "{organ}");
        }
    }
}
