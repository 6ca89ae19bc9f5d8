//! A small recording with a lift, beside its truth.

use super::{HiddenSupport, LiftsTruth};
use crate::lifts::LiftOptions;
use crate::record::{RecordOptions, record_with};
use crate::spec::Resolution;
use crate::{Error, Sensor, phantom_a, phantom_c};
use glam::DVec3;
use std::path::Path;
use trocar_camera::Camera;
use trocar_core::Silent;
use trocar_recording::Recording;

/// The D405 with a quarter of the pixels per side.
fn small() -> Camera {
    let d405 = Camera::d405();
    let fourth = |c: f64| (c + 0.5) / 4.0 - 0.5;
    Camera {
        width: 212,
        height: 120,
        fx: d405.fx / 4.0,
        fy: d405.fy / 4.0,
        cx: fourth(d405.cx),
        cy: fourth(d405.cy),
        ..d405
    }
}

fn options(support: HiddenSupport) -> RecordOptions {
    let lifts = LiftOptions { count: 1, support, cell: 3e-3 };
    RecordOptions { frames: 1, seed: 3, sensor: Sensor::Stereo, lifts }
}

fn film(support: HiddenSupport, to: &Path) {
    let spec = &phantom_a::SPEC;
    let coarse = Resolution { surface: 1.5e-3, bed: 2.5e-3 };
    record_with(spec, &options(support), &small(), coarse, to, &Silent).unwrap();
}

/// Frame, place, centreline, front.
type Row = (usize, f64, f64, f64, f64, f64, f64, f64);

fn tracks(folder: &Path) -> Vec<Row> {
    let mut reader = csv::Reader::from_path(folder.join("truth/lift-0/centreline.csv")).unwrap();
    reader.deserialize().map(|row| row.unwrap()).collect()
}

#[test]
fn a_filmed_lift_shows_its_truth() {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("lifted");
    film(HiddenSupport::Mesentery, &folder);
    let recording = Recording::open(&folder).unwrap();
    assert_eq!(recording.len(), 81);
    let [info] = &recording.info.lifts[..] else { panic!("one lift is marked") };
    assert!((info.rest, info.first, info.last) == (4, 21, 80), "{info:?}");
    let truth = LiftsTruth::read(&folder.join("truth")).unwrap().unwrap();
    let [lift] = &truth.lifts[..] else { panic!("one lift is known") };
    assert!((lift.rest, lift.first, lift.last) == (info.rest, info.first, info.last));
    let way = DVec3::from(lift.displacement_m).length();
    assert!((0.011..=0.038).contains(&way) && lift.displacement_m[2] < -0.8 * way, "{way} m");
    assert!(truth.young_modulus_pa > 1.3 * 12e3 && truth.threads.is_some());

    // The click is on the organ's mask, and the recorded depth there is that of the front.
    let mask = trocar_camera::Mask::read(&recording.organ_mask_file("appendix")).unwrap();
    let [u, v] = info.click.map(|c| c.round() as usize);
    assert!(mask.set[v * mask.width + u]);
    let rows = tracks(&folder);
    for frame in [info.rest, 60, info.last] {
        let shot = recording.frame(frame).unwrap();
        let (mut close, mut seen) = (0, 0);
        for (_, _, _, _, _, x, y, z) in rows.iter().filter(|row| row.0 == frame) {
            let pixel = recording.camera().project(DVec3::new(*x, *y, *z)).unwrap().round();
            let i = pixel.y as usize * 212 + pixel.x as usize;
            let depth = f64::from(shot.depth.depth[i]);
            if depth > 0.0 && !shot.instruments.set[i] {
                seen += 1;
                close += usize::from((depth - z).abs() < 2e-3);
            }
        }
        assert!(seen > 40 && close * 10 > 8 * seen, "frame {frame}: {close} of {seen} points are where they are known");
        assert!(frame == info.rest || shot.instruments.count() > 60, "frame {frame}: an instrument is in the picture");
    }
    // The last surface is the first one, lifted: by the whole way at the grasp.
    let surfaces = lift.surfaces(&folder.join("truth"), 0).unwrap();
    assert_eq!(surfaces.len(), lift.keys.len());
    let (first, last) = (&surfaces[0], &surfaces[surfaces.len() - 1]);
    let moved = first.vertices.iter().zip(&last.vertices).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    assert!((moved / way - 1.0).abs() < 0.25, "{moved} m for {way} m");
    assert_eq!(lift.between(lift.rest), (0, 1, 0.0));
    assert_eq!(lift.between(lift.last), (lift.keys.len() - 2, lift.keys.len() - 1, 1.0));
}

#[test]
fn lifts_do_not_depend_on_threads_but_on_the_support() {
    let dir = tempfile::tempdir().unwrap();
    let on = |threads: usize, support, name: &str| {
        let folder = dir.path().join(name);
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| film(support, &folder));
        let bytes = |file: &str| std::fs::read(folder.join(file)).unwrap();
        [bytes("color/000080.png"), bytes("depth/000080.png"), bytes("truth/lift-0/centreline.csv")]
    };
    let one = on(1, HiddenSupport::Base, "one");
    assert!(one == on(2, HiddenSupport::Base, "two"));
    assert!(one[2] != on(2, HiddenSupport::Adhesion, "three")[2], "the adhesion holds the tip");
}

#[test]
fn impossible_lifts_are_refused() {
    let dir = tempfile::tempdir().unwrap();
    let to = dir.path().join("out");
    let refused = |name: &str, lifts: LiftOptions| {
        let options = RecordOptions { frames: 1, lifts, ..RecordOptions::default() };
        crate::record(name, &options, &to, &Silent).unwrap_err().to_string()
    };
    let one = LiftOptions { count: 1, ..LiftOptions::default() };
    let text = refused(phantom_c::SPEC.name, one);
    assert_eq!(text, "phantom-c has no appendix to lift; phantom-a and phantom-b have one");
    assert!(refused("phantom-a", LiftOptions { count: 101, ..one }).contains("lifts is 101"));
    assert!(refused("phantom-a", LiftOptions { cell: 1e-4, ..one }).contains("0.1 mm"));
    assert!(!to.exists());
}

#[test]
fn a_damaged_truth_names_file_and_field() {
    let dir = tempfile::tempdir().unwrap();
    let truth = LiftsTruth {
        organ: "appendix".into(),
        length_m: 0.08,
        model: "corotated".into(),
        young_modulus_pa: 2e4,
        poisson_ratio: 0.45,
        density_kg_m3: 1200.0,
        cell_m: 1e-3,
        nodes: 1,
        tets: 1,
        support: HiddenSupport::Base,
        threads: None,
        lifts: vec![super::LiftTruth {
            rest: 3,
            first: 4,
            last: 5,
            grasp_s: 0.6,
            grasp_m: [0.0; 3],
            displacement_m: [0.0, 0.0, -0.02],
            keys: vec![0.0, 1.0],
            progress: vec![0.0, 0.5, 1.0],
        }],
    };
    assert_eq!(LiftsTruth::read(dir.path()).unwrap(), None);
    super::truth::write(dir.path(), &truth).unwrap();
    assert_eq!(LiftsTruth::read(dir.path()).unwrap(), Some(truth));
    let path = dir.path().join(super::LIFTS_FILE);
    let good = std::fs::read_to_string(&path).unwrap();
    for (from, to, expected) in [
        ("0.5, 1.0]\n", "1.0]\n", "lift[0].progress"),
        ("keys = [0.0, 1.0]", "keys = [0.0]", "lift[0].keys"),
        ("grasp_s", "grasp", "grasp"),
    ] {
        assert!(good.contains(from), "{good}");
        std::fs::write(&path, good.replacen(from, to, 1)).unwrap();
        let error = LiftsTruth::read(dir.path()).unwrap_err();
        let text = error.to_string();
        assert!(
            !matches!(error, Error::Interrupted) && text.contains("lifts.toml") && text.contains(expected),
            "{text}"
        );
    }
}
