//! Without ONNX Runtime nothing panics, and everything that does not need it works. This is a
//! program of its own, because a process with an open library cannot show it.

#![allow(clippy::print_stdout, reason = "it says when it is skipped")]

use std::path::Path;
use trocar_camera::ColorImage;
use trocar_segment::{MetalDetector, Picture, Sam2, Segmenter, Target, wanted_files};

#[test]
fn a_missing_or_wrong_library_is_an_error_of_one_line() {
    if std::env::var_os("ORT_DYLIB_PATH").is_some() {
        println!("skipped: ORT_DYLIB_PATH is set");
        return;
    }
    let networks = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures/plain");
    let dir = tempfile::tempdir().unwrap();
    let text = dir.path().join("libonnxruntime.so");
    std::fs::write(&text, "no library").unwrap();
    let mut runtimes = vec![None, Some(dir.path().join("none")), Some(text)];
    // A library, but not ONNX Runtime's.
    runtimes.extend(["/lib/x86_64-linux-gnu/libm.so.6"].map(|p| Some(p.into())).into_iter().filter(exists));
    for runtime in runtimes {
        let message = Sam2::open(&networks, runtime.as_deref()).unwrap_err().to_string();
        assert!(message.contains("pip install onnxruntime") && !message.contains('\n'), "{message}");
    }
    assert!(wanted_files(Some(&networks)).iter().any(|w| w.found.is_none()));

    let color = ColorImage::new(40, 30, [180, 60, 60]);
    let picture = Picture { color: &color, depth: None, name: "frame 1" };
    assert_eq!(MetalDetector::default().segment(&picture, &Target::default()).unwrap().count(), 0);
}

fn exists(path: &Option<std::path::PathBuf>) -> bool {
    path.as_ref().is_some_and(|p| p.is_file())
}
