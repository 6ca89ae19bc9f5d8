//! Bad input gives one clear line, exit code 2, and leaves nothing behind.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use tempfile::TempDir;

fn trocar(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_trocar")).args(arguments).output().unwrap()
}

/// Runs the command, which must fail with one line that contains all `words`, without `output`.
fn refused(arguments: &[&str], output: &Path, words: &[&str]) {
    let parent = output.parent().unwrap();
    let entries = || parent.read_dir().map_or(0, Iterator::count);
    let before = entries();
    let result = trocar(&[arguments, &["-o", output.to_str().unwrap()]].concat());
    let said = String::from_utf8_lossy(&result.stderr);
    assert_eq!(result.status.code(), Some(2), "{arguments:?} said: {said}");
    assert_eq!(said.trim_end().lines().count(), 1, "{arguments:?} said more than a line: {said}");
    for word in words {
        assert!(said.contains(word), "{arguments:?} did not say '{word}': {said}");
    }
    assert!(!output.exists(), "{arguments:?} left {output:?}");
    assert_eq!(entries(), before, "{arguments:?} left something beside {output:?}");
}

/// A valid recording of a few small frames, which tests damage.
struct Fixture {
    dir: TempDir,
}

impl Fixture {
    fn new() -> Self {
        let dir = tempfile::tempdir().unwrap();
        let recording = dir.path().join("recording");
        let made = trocar(&["record", "phantom-a", "--frames", "3", "-o", recording.to_str().unwrap()]);
        assert!(made.status.success(), "{}", String::from_utf8_lossy(&made.stderr));
        Self { dir }
    }

    fn file(&self, name: &str) -> PathBuf {
        self.dir.path().join("recording").join(name)
    }

    /// Damages the recording, expects an error, and restores it.
    fn spoiled(&self, name: &str, spoil: impl FnOnce(&Path), words: &[&str]) {
        let file = self.file(name);
        let kept = fs::read(&file).unwrap();
        spoil(&file);
        let recording = self.file("");
        refused(&["reconstruct", recording.to_str().unwrap()], &self.dir.path().join("specimen"), words);
        fs::write(&file, kept).unwrap();
    }
}

#[test]
fn spoiled_recordings_are_refused() {
    let fixture = Fixture::new();
    let truncate = |file: &Path| fs::write(file, &fs::read(file).unwrap()[..400]).unwrap();
    fixture.spoiled("color/000001.png", truncate, &["000001.png"]);
    fixture.spoiled("depth/000001.png", truncate, &["000001.png"]);
    let other_size = |file: &Path| fs::write(file, gray_png(16, 9, true)).unwrap();
    fixture.spoiled("depth/000001.png", other_size, &["000001.png", "848", "16"]);
    fixture.spoiled("masks/appendix.png", |file| fs::remove_file(file).unwrap(), &["appendix"]);
    let empty = |file: &Path| fs::write(file, gray_png(848, 480, false)).unwrap();
    fixture.spoiled("masks/appendix.png", empty, &["appendix"]);
    let add = |line: &'static str| {
        move |file: &Path| fs::write(file, format!("{line}\n{}", fs::read_to_string(file).unwrap())).unwrap()
    };
    fixture.spoiled("recording.toml", add("depth_scale = 0.001"), &["recording.toml", "depth_scale", "depth_scale_m"]);
    fixture.spoiled("recording.toml", |file| fs::write(file, "name = \"x\"").unwrap(), &["recording.toml"]);
}

#[test]
fn missing_and_empty_folders_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let output = dir.path().join("specimen");
    refused(&["reconstruct", "/no/such/folder"], &output, &["/no/such/folder"]);
    let empty = tempfile::tempdir().unwrap();
    refused(&["reconstruct", empty.path().to_str().unwrap()], &output, &["recording.toml"]);
    refused(&["simulate", empty.path().to_str().unwrap()], &output, &["specimen.toml"]);
    refused(&["record", "phantom-z"], &output, &["phantom-z", "phantom-a"]);
    refused(&["record", "phantom-a", "--frames", "0"], &output, &["frames"]);
}

#[test]
fn unusable_surfaces_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("organ.obj");
    let output = dir.path().join("specimen");
    let check = |content: &str, words: &[&str]| {
        fs::write(&file, content).unwrap();
        refused(&["reconstruct", "--surface", file.to_str().unwrap(), "--units", "mm"], &output, words);
    };
    check("v 0 0 0\nv nan 0 0\nv 0 10 0\nf 1 2 3\n", &["organ.obj", "vertex 1"]);
    check("v 0 0 0\nv 10 0 0\nv 0 10 0\nf 1 2 3\n", &["organ.obj", "no volume"]);
    check("nothing\n", &["organ.obj"]);
    let missing = dir.path().join("missing.stl");
    refused(&["reconstruct", "--surface", missing.to_str().unwrap(), "--units", "mm"], &output, &["missing.stl"]);
    fs::write(dir.path().join("organ.step"), "x").unwrap();
    let step = dir.path().join("organ.step");
    refused(&["reconstruct", "--surface", step.to_str().unwrap(), "--units", "mm"], &output, &["organ.step", ".stl"]);
}

#[test]
fn an_unwritable_output_is_refused_and_nothing_is_overwritten() {
    let dir = tempfile::tempdir().unwrap();
    let file = dir.path().join("file");
    fs::write(&file, "precious").unwrap();
    refused(&["record", "phantom-a", "--frames", "3"], &file.join("recording"), &["file"]);
    // A folder that is no recording is not replaced.
    let folder = dir.path().join("thesis");
    fs::create_dir(&folder).unwrap();
    fs::write(folder.join("chapter.tex"), "precious").unwrap();
    let result = trocar(&["record", "phantom-a", "--frames", "3", "-o", folder.to_str().unwrap()]);
    assert_eq!(result.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&result.stderr).contains("thesis"));
    assert_eq!(fs::read_to_string(folder.join("chapter.tex")).unwrap(), "precious");
    assert_eq!(fs::read_to_string(&file).unwrap(), "precious");
}

#[test]
fn the_input_is_never_replaced() {
    let fixture = Fixture::new();
    let home = fixture.dir.path();
    let (recording, inside) = (fixture.file(""), fixture.file("specimen"));
    for output in [home, recording.as_path(), inside.as_path()] {
        let result = trocar(&["reconstruct", recording.to_str().unwrap(), "-o", output.to_str().unwrap()]);
        let said = String::from_utf8_lossy(&result.stderr);
        assert_eq!(result.status.code(), Some(2), "{said}");
        assert!(said.contains("overlaps the input"), "{said}");
    }
    assert!(fixture.file("recording.toml").is_file() && !inside.exists());
    // A folder beside it is valid, also by a relative path.
    let beside = Command::new(env!("CARGO_BIN_EXE_trocar"))
        .args(["reconstruct", "recording", "-o", "specimen", "--quiet"])
        .current_dir(home)
        .output()
        .unwrap();
    assert!(beside.status.success(), "{}", String::from_utf8_lossy(&beside.stderr));
    assert!(home.join("specimen/specimen.toml").is_file());
    // A recording without truth is not one of ours.
    fs::remove_dir_all(fixture.file("truth")).unwrap();
    let result = trocar(&["record", "phantom-a", "--frames", "1", "-o", recording.to_str().unwrap()]);
    assert_eq!(result.status.code(), Some(2));
    assert!(String::from_utf8_lossy(&result.stderr).contains("not a phantom"));
    assert!(fixture.file("color/000002.png").is_file());
}

#[test]
fn figures_are_printed_only_for_what_was_measured() {
    let fixture = Fixture::new();
    let (recording, output) = (fixture.file(""), fixture.dir.path().join("specimen"));
    let made = trocar(&["reconstruct", recording.to_str().unwrap(), "--window", "0", "-o", output.to_str().unwrap()]);
    let said = String::from_utf8_lossy(&made.stdout).into_owned();
    assert!(said.contains("The window holds only 1 frame."), "{said}");
    assert!(said.contains("against the truth") && !said.contains("- mm"), "{said}");
}

/// A replay of an episode with another specimen, which differs, gives the reason once.
#[test]
fn a_difference_is_reported_once() {
    let dir = tempfile::tempdir().unwrap();
    let scene = trocar_testing::tube::reach(dir.path(), "reach.toml", 0.2, &["endoscope"]);
    let at = |name: &str| dir.path().join(name).display().to_string();
    let episode = trocar(&["episode", scene.to_str().unwrap(), "--policy", "random", "-o", &at("episode")]);
    assert!(episode.status.success(), "{}", String::from_utf8_lossy(&episode.stderr));
    trocar_testing::tube::two_tubes(trocar_testing::tube::ONE_END, 3e-3).write(&dir.path().join("other")).unwrap();
    let replayed = trocar(&["--quiet", "replay", &at("episode"), "--verify", "--specimen", &at("other")]);
    let said = String::from_utf8_lossy(&replayed.stderr).into_owned();
    assert_eq!(replayed.status.code(), Some(2), "{said}");
    assert!(replayed.stdout.is_empty() && said.lines().count() == 1, "{said}");
}

/// A greyscale PNG of one value, 16-bit or 8-bit.
fn gray_png(width: usize, height: usize, deep: bool) -> Vec<u8> {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("image.png");
    if deep {
        trocar_camera::DepthImage { width, height, depth: vec![0.2; width * height] }.write_png(&path, 0.001).unwrap();
    } else {
        trocar_camera::Mask::new(width, height).write_png(&path).unwrap();
    }
    fs::read(path).unwrap()
}
