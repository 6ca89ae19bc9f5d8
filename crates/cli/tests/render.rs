//! `trocar render`: a specimen's picture with its files beside it, and mistakes in one line.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use glam::DVec3;
use std::path::Path;
use std::process::{Command, Output};
use trocar_camera::{ColorImage, DepthImage};

fn trocar(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_trocar")).args(arguments).output().unwrap()
}

/// A specimen from a ready surface: a box of 30 x 20 x 10 mm.
fn specimen(dir: &Path) -> String {
    let mut text = String::new();
    for c in 0..8 {
        let p = DVec3::new(f64::from(c & 1) * 30.0, f64::from(c >> 1 & 1) * 20.0, f64::from(c >> 2) * 10.0);
        text += &format!("v {} {} {}\n", p.x, p.y, p.z);
    }
    for [a, b, c, d] in [[1, 3, 4, 2], [5, 6, 8, 7], [1, 2, 6, 5], [3, 7, 8, 4], [1, 5, 7, 3], [2, 4, 8, 6]] {
        text += &format!("f {a} {b} {c}\nf {a} {c} {d}\n");
    }
    let (surface, out) = (dir.join("box.obj"), dir.join("specimen"));
    std::fs::write(&surface, text).unwrap();
    let (surface, out) = (surface.to_str().unwrap().to_owned(), out.to_str().unwrap().to_owned());
    let made = trocar(&["reconstruct", "--surface", &surface, "--units", "mm", "-o", &out, "-q"]);
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    out
}

#[test]
fn a_specimen_is_seen() {
    let dir = tempfile::tempdir().unwrap();
    let specimen = specimen(dir.path());
    let file = dir.path().join("seen.png");
    let out = file.to_str().unwrap();
    let options = ["--size", "96x64", "--depth", "--labels", "--json", "-q", "-o", out];
    let made = trocar(&[&["render", &specimen][..], &options].concat());
    assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
    let said: serde_json::Value = serde_json::from_slice(&made.stdout).unwrap();
    assert_eq!((&said["camera"], &said["width"], &said["frames"]), (&"outside".into(), &96.into(), &1.into()));
    let files: Vec<&str> = said["files"].as_array().unwrap().iter().map(|f| f.as_str().unwrap()).collect();
    assert_eq!(files.len(), 4);
    let organ = said["seen"].as_array().unwrap().iter().find(|s| s["label"] == 1).unwrap();
    let color: Vec<u8> = organ["color"].as_array().unwrap().iter().map(|c| c.as_u64().unwrap() as u8).collect();
    let labels = ColorImage::read(Path::new(files[3])).unwrap();
    let share = labels.pixels.iter().filter(|p| p[..] == color[..]).count() as f64 / (96.0 * 64.0);
    assert!(share > 0.05 && (share - organ["share"].as_f64().unwrap()).abs() < 1e-9, "{share}");
    let depth = DepthImage::read(Path::new(files[1]), 1e-4).unwrap();
    let middle = depth.depth[32 * 96 + 48];
    assert!((0.01..0.2).contains(&middle), "{middle}");
    let color = ColorImage::read(&file).unwrap();
    assert!((color.width, color.height) == (96, 64) && color.pixels[32 * 96 + 48].iter().any(|c| *c > 40));
}

#[test]
fn mistakes_are_one_line_and_leave_nothing() {
    let dir = tempfile::tempdir().unwrap();
    let refused = |arguments: &[&str], file: &str, words: &[&str]| {
        let out = dir.path().join(file);
        let output = trocar(&[&["render"][..], arguments, &["-q", "-o", out.to_str().unwrap()]].concat());
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(words.iter().all(|w| said.contains(w)) && said.starts_with("error: "), "{said}");
        assert!(!out.exists());
    };
    refused(&["cell-a"], "seen.bmp", &["seen.bmp", ".png", ".webp", ".mp4"]);
    refused(&["cell-d"], "seen.png", &["cell-d", "cell-a"]);
    refused(&["cell-a", "--at", "-1"], "seen.png", &["--at is -1", "[0, 600]"]);
    refused(&["cell-a", "--at", "1"], "seen.webp", &["--at", ".png"]);
    refused(&["cell-a"], "no/such/folder/seen.webp", &["the folder", "does not exist"]);
    refused(&["cell-a", "--size", "1280"], "seen.png", &["1280x720"]);
    refused(&["cell-a", "--samples", "4"], "seen.png", &["--path"]);
    let empty = tempfile::tempdir().unwrap();
    refused(&[empty.path().to_str().unwrap()], "seen.png", &["specimen.toml"]);
    refused(&[empty.path().to_str().unwrap()], "seen.webp", &["does not move"]);
    std::fs::write(empty.path().join("result.json"), "{}").unwrap();
    refused(&[empty.path().to_str().unwrap()], "seen.png", &["this run has no episode file", "--at"]);
}
