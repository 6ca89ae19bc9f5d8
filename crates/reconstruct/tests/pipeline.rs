//! Reconstructs recordings with known truth.
#![allow(clippy::unwrap_used, clippy::expect_used)]

use glam::DVec3;
use std::path::Path;
use trocar_core::{Silent, StopAfter};
use trocar_geometry::io::Unit;
use trocar_reconstruct::{Settings, from_surface, reconstruct};
use trocar_recording::Recording;
use trocar_specimen::Specimen;
use trocar_testing::sphere::{self, CENTRE, RADIUS, info, write, write_moving};

#[test]
fn a_sphere_comes_back_from_behind_the_instrument() {
    let root = tempfile::tempdir().unwrap();
    let dir = root.path().join("recording");
    write(&dir, &info(), 24);
    let recording = Recording::open(&dir).unwrap();
    let made = reconstruct(&recording, &Settings::default(), &Silent).unwrap();

    // The composite has no trace of the bar, which covered an eighth of the image.
    let (color, depth, mask) = sphere::scene(&recording.camera());
    assert_eq!(made.composite.color, color);
    assert_eq!(made.composite.frames_used, 12, "stride 2");
    assert_eq!(made.composite.coverage, 1.0);
    assert_eq!(made.composite.recovered_share, 0.125);
    assert_eq!(made.composite.depth_range_median, 0.0);
    assert_eq!((made.warnings.len(), made.organs[0].moving_share), (0, 0.0));
    for (z, truth) in made.composite.depth.depth.iter().zip(&depth.depth) {
        assert!((z - truth).abs() <= 0.5001e-3);
    }

    let organ = &made.specimen.organs[0];
    let facts = organ.facts;
    assert!(facts.watertight && facts.inverted == 0);
    assert!(facts.depth_error_median_mm.unwrap() < 0.6);
    assert!(facts.depth_error_signed_mm.unwrap().abs() < 0.2);
    assert!(facts.covered.unwrap() > 0.97);
    let truth = 4.0 / 3.0 * std::f64::consts::PI * (100.0 * RADIUS).powi(3);
    assert!((0.88..1.02).contains(&(facts.volume_cm3 / truth)), "{} of {truth} cm3", facts.volume_cm3);
    let (low, high) = organ.body.bounds().unwrap();
    // The modelled back of a sphere is up to a fifth of R short; its front and outline are
    // measured.
    assert!((0.5 * (low + high) - CENTRE).length() < 0.15 * RADIUS);
    assert_eq!(made.organs[0].mask, mask);
    let red = organ.surface.colors.iter().filter(|c| **c == [180, 60, 50]).count();
    assert_eq!(red, organ.surface.vertices.len());

    // Written and read again, and a second time with the same bits.
    let out = root.path().join("specimen");
    made.specimen.write(&out).unwrap();
    assert_eq!(Specimen::read(&out).unwrap().organs[0].body, organ.body);
    let single = rayon::ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let again = single.install(|| reconstruct(&recording, &Settings::default(), &Silent)).unwrap();
    assert_eq!(again.specimen.organs[0].body, organ.body);
    assert_eq!(again.specimen.organs[0].surface, organ.surface);
    assert_eq!(again.specimen.provenance, made.specimen.provenance);
}

/// An organ that is lifted, swings or breathes during the window gets a warning that names it and
/// `--window`; a window in which it is still gets none.
#[test]
fn an_organ_that_moves_is_warned_of() {
    let root = tempfile::tempdir().unwrap();
    let dir = root.path().join("recording");
    let lifted = |f: usize| CENTRE - DVec3::Z * if f < 40 { 0.0 } else { 0.006 };
    let swinging = |f: usize| CENTRE + DVec3::X * 0.008 * (0.1 * f as f64).sin();
    let breathing = |f: usize| CENTRE + DVec3::Z * 0.004 * (0.2 * f as f64).sin();
    let ways: [(&str, &dyn Fn(usize) -> DVec3); 3] =
        [("lifted", &lifted), ("swinging", &swinging), ("breathing", &breathing)];
    for (way, centre) in ways {
        write_moving(&dir, &info(), 80, centre);
        let recording = Recording::open(&dir).unwrap();
        let made = reconstruct(&recording, &Settings::default(), &Silent).unwrap();
        let [warning] = &made.warnings[..] else { panic!("{way}: {:?}", made.warnings) };
        assert!(warning.contains("ball") && warning.contains("--window below 90"), "{warning}");
    }
    write_moving(&dir, &info(), 80, lifted);
    let recording = Recording::open(&dir).unwrap();
    let still = Settings { centre: Some(20), window: 18, ..Settings::default() };
    let made = reconstruct(&recording, &still, &Silent).unwrap();
    assert_eq!((made.warnings.len(), made.organs[0].moving_share), (0, 0.0));
}

#[test]
fn interruptions_and_wrong_settings_are_named() {
    let root = tempfile::tempdir().unwrap();
    let dir = root.path().join("recording");
    write(&dir, &info(), 4);
    let recording = Recording::open(&dir).unwrap();
    for units in [0, 1, 2] {
        let error = reconstruct(&recording, &Settings::default(), &StopAfter::new(units)).err().unwrap();
        assert_eq!(error.to_string(), "interrupted", "after {units}");
    }
    let failure = |settings: Settings| reconstruct(&recording, &settings, &Silent).err().unwrap().to_string();
    assert!(failure(Settings { centre: Some(4), ..Settings::default() }).contains("frame 4; the recording has 4"));
    assert!(failure(Settings { stride: 0, ..Settings::default() }).contains("stride is 0"));
    assert!(failure(Settings { finest_cell: 0.0, ..Settings::default() }).contains("finest cell is 0 mm"));

    let failed = failure(Settings { window: 99_999_999_999_999, ..Settings::default() });
    assert!(failed.contains("the window is 99999999999999 frames") && failed.contains("has 4 frames"), "{failed}");

    // An organ where no depth was measured.
    let mut blind = info();
    blind.depth_max_m = Some(0.1);
    write(&dir, &blind, 2);
    let recording = Recording::open(&dir).unwrap();
    let error = reconstruct(&recording, &Settings::default(), &Silent).err().unwrap().to_string();
    assert!(error.contains("organ 'ball'") && error.contains("no depth"), "{error}");
}

#[test]
fn real_organs_become_bodies() {
    let data = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data"));
    let files = [
        "openhelp/Bladder_half.stl",
        "openhelp/Duodenum.stl",
        "openhelp/Kidney_left.stl",
        "openhelp/Liver.stl",
        "openhelp/Spleen.stl",
        "openhelp/Stomach.stl",
        "lapgym_organs/grasp_lift_touch__gallbladder_collision.stl",
        "lapgym_organs/grasp_lift_touch__gallbladder_visual.stl",
        "lapgym_organs/grasp_lift_touch__liver_collision.stl",
        "lapgym_organs/grasp_lift_touch__liver_visual.stl",
    ];
    for file in files {
        let path = data.join(file);
        if !path.is_file() {
            println!("skipped: {} absent", path.display());
            continue;
        }
        let (specimen, _) = from_surface(&path, Unit::Millimetre, &Settings::default(), &Silent).unwrap();
        let organ = &specimen.organs[0];
        let f = organ.facts;
        assert!(f.watertight && f.inverted == 0 && f.min_dihedral_deg > 5.0, "{file}");
        assert!((f.volume_cm3 / (1e6 * organ.surface.volume()) - 1.0).abs() < 0.05, "{file}");
        assert!(f.tets < 2 * Settings::default().max_tets, "{file}");
    }
}
