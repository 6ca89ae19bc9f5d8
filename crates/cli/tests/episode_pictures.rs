//! `trocar render EPISODE`: pictures and videos of a replayed episode, and one-line errors.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "what tests share may panic and tell what is skipped")]

use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use trocar_camera::ColorImage;
use trocar_testing::tube;

const SMALL: [&str; 4] = ["--size", "96x54", "--camera", "endoscope"];

fn trocar(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_trocar")).args(arguments).arg("-q").output().unwrap()
}

fn said(output: &Output) -> serde_json::Value {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    serde_json::from_slice(&output.stdout).unwrap()
}

/// An episode of half a second, in the folder `run`, whose specimen is the folder `tube`.
fn episode(folder: &Path) -> PathBuf {
    let file = tube::reach(folder, "reach.toml", 0.5, &["endoscope", "d405"]);
    let run = folder.join("run");
    let (file, out) = (file.to_str().unwrap(), run.to_str().unwrap());
    said(&trocar(&["episode", file, "--policy", "random", "--seed", "3", "-o", out, "--json"]));
    run
}

#[test]
fn an_episode_is_filmed_and_what_is_wrong_is_told() {
    let dir = tempfile::tempdir().unwrap();
    let run = episode(dir.path());
    let (run, file) = (run.to_str().unwrap().to_owned(), run.join("episode.trocar").to_str().unwrap().to_owned());
    let at = |name: &str| dir.path().join(name).to_str().unwrap().to_owned();
    let render = |source: &str, out: &str, more: &[&str]| {
        trocar(&[&["render", source, "-o", out, "--json"][..], &SMALL[..], more].concat())
    };

    // Pictures at the end, by the folder and by the file, and at a time.
    let end = said(&render(&run, &at("end.png"), &[]));
    assert_eq!((&end["frames"], &end["differs"]), (&1.into(), &serde_json::Value::Null));
    assert!((end["time_s"].as_f64().unwrap() - 0.5).abs() < 0.02, "{end}");
    said(&render(&file, &at("again.png"), &["--threads", "1"]));
    let read = |name: &str| ColorImage::read(&dir.path().join(name)).unwrap();
    assert_eq!(read("end.png"), read("again.png"));
    let early = said(&render(&run, &at("early.png"), &["--at", "0.1", "--depth", "--labels"]));
    assert!((early["time_s"].as_f64().unwrap() - 0.1).abs() < 0.02 && early["files"].as_array().unwrap().len() == 4);
    assert_ne!(read("end.png"), read("early.png"));

    // The video has 15 frames per second.
    let film = said(&render(&run, &at("film.webp"), &[]));
    assert_eq!(film["frames"], 8, "{film}");
    let bytes = std::fs::read(at("film.webp")).unwrap();
    assert!(bytes.starts_with(b"RIFF") && bytes.windows(4).filter(|w| *w == b"ANMF").count() == 8);
    let mp4 = render(&run, &at("film.mp4"), &[]);
    if Command::new("ffmpeg").arg("-version").output().is_ok() {
        assert_eq!(said(&mp4)["frames"], 16);
        let bytes = std::fs::read(at("film.mp4")).unwrap();
        assert_eq!(&bytes[4..8], b"ftyp");
    } else {
        println!("skipped: no ffmpeg");
        assert!(String::from_utf8_lossy(&mp4.stderr).contains(".mp4 needs the program ffmpeg, which is not installed"));
    }

    let refused = |source: &str, out: &str, more: &[&str], words: &[&str]| {
        let output = render(source, &at(out), more);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{said}");
        assert!(said.starts_with("error: ") && said.lines().count() == 1, "{said}");
        assert!(words.iter().all(|w| said.contains(w)), "{said}");
        assert!(!dir.path().join(out).exists());
    };
    refused(&run, "no.png", &["--at", "7"], &["--at is 7 s", "the episode ends after 0.50 s"]);
    refused(&run, "no.webp", &["--at", "0.1"], &["--at", ".png"]);
    refused("cell-a", "no.png", &["--specimen", "tube"], &["--specimen is only for episodes"]);
    refused(&at("none.trocar"), "no.png", &[], &["none.trocar", "no such file"]);
    // The specimen is in another folder, then another specimen.
    std::fs::rename(dir.path().join("tube"), dir.path().join("moved")).unwrap();
    refused(&run, "no.png", &[], &["tube"]);
    let found = said(&render(&run, &at("found.png"), &["--specimen", &at("moved")]));
    assert_eq!(found["time_s"], end["time_s"]);
    assert_eq!(read("found.png"), read("end.png"));
    tube::two_tubes(tube::ONE_END, 5e-3).write(&dir.path().join("other")).unwrap();
    refused(&run, "no.png", &["--specimen", &at("other")], &["the specimen is another one", "--specimen"]);
    // A damaged file.
    let mut bytes = std::fs::read(&file).unwrap();
    let last = bytes.len() - 20;
    bytes[last] ^= 1;
    std::fs::write(at("bad.trocar"), bytes).unwrap();
    refused(&at("bad.trocar"), "no.png", &[], &["bad.trocar", "checksum"]);
    // No partial file is left.
    let hidden = std::fs::read_dir(dir.path())
        .unwrap()
        .filter(|e| e.as_ref().unwrap().file_name().to_string_lossy().starts_with('.'));
    assert_eq!(hidden.count(), 0);
}
