//! Lifts of a small recording of a phantom, measured beside their truth.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]

use std::path::Path;
use trocar_core::Silent;
use trocar_phantom::{LiftOptions, RecordOptions, Sensor, record};
use trocar_workflow::measure::{Measured, Measuring};

fn measure(folder: &Path) -> Result<Measured, String> {
    let measuring = Measuring { source: folder.to_owned(), ..Measuring::default() };
    measuring.run(&Silent).map_err(|e| e.to_string())
}

#[test]
fn a_filmed_lift_is_measured_as_it_was() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("lifted");
    let lifts = LiftOptions { count: 1, cell: 3e-3, ..LiftOptions::default() };
    let options = RecordOptions { frames: 1, seed: 2, sensor: Sensor::Stereo, lifts };
    record("phantom-a", &options, &folder, &Silent).unwrap();

    let measured = measure(&folder).unwrap();
    let [row] = &measured.lifts[..] else { panic!("one lift") };
    let (figures, truth) = (row.figures.as_ref().unwrap(), row.truth.as_ref().unwrap());
    println!("{figures:?}\n{truth:?}");
    assert!(measured.tracking_error_mm_median.unwrap() < 1.0, "{truth:?}");
    assert!((figures.lift_mm.unwrap() - truth.lift_mm.unwrap()).abs() < 2.0, "{figures:?}");
    assert!((figures.d50_mm.unwrap() - truth.d50_mm.unwrap()).abs() < 3.0, "{figures:?}");
    assert!(figures.landmarks_seen >= 6 && figures.landmark_floor_mm.unwrap() < 1.0, "{figures:?}");
    assert!(figures.static_rmse_mm.unwrap() > 5.0 * figures.landmark_floor_mm.unwrap(), "{figures:?}");
    assert!(measured.line.is_none(), "one lift gives no line");

    // The measurement does not read the truth.
    std::fs::rename(folder.join("truth"), dir.path().join("truth")).unwrap();
    let again = measure(&folder).unwrap();
    assert_eq!(again.lifts[0].figures.as_ref(), Some(figures));
    assert!(again.tracking_error_mm_median.is_none() && again.lifts[0].truth.is_none());

    // A click beside every organ is refused, by file and field.
    let toml = folder.join("recording.toml");
    let text = std::fs::read_to_string(&toml).unwrap();
    let at = text.find("click = ").unwrap();
    let end = at + text[at..].find('\n').unwrap();
    std::fs::write(&toml, format!("{}click = [3.0, 3.0]{}", &text[..at], &text[end..])).unwrap();
    let error = measure(&folder).unwrap_err();
    assert!(error.contains("recording.toml: lift[0].click is [3, 3]"), "{error}");

    // A recording without lifts says what is missing.
    let without = text.find("[[lift]]").unwrap();
    std::fs::write(&toml, &text[..without]).unwrap();
    let error = measure(&folder).unwrap_err();
    assert!(error.contains("there is no [[lift]]"), "{error}");
}
