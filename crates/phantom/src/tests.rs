//! Whole frames, checked against the truth they were made from.

use crate::anatomy::Anatomy;
use crate::film::shoot;
use crate::instruments;
use crate::still::{Fineness, Still};
use trocar_camera::{Camera, Mask};

const COARSE: Fineness = Fineness { surface: 1.2e-3, bed: 2e-3 };

/// The D405 with a quarter of the pixels a side.
fn small() -> Camera {
    let d405 = Camera::d405();
    Camera {
        width: 212,
        height: 120,
        fx: d405.fx / 4.0,
        fy: d405.fy / 4.0,
        cx: (d405.cx + 0.5) / 4.0 - 0.5,
        cy: (d405.cy + 0.5) / 4.0 - 0.5,
        ..d405
    }
}

/// Pictures to look at: `cargo test --release -p trocar-phantom -- --ignored look`, written to `$LOOK`.
#[test]
#[ignore = "for people"]
fn look() {
    let Some(dir) = std::env::var_os("LOOK").map(std::path::PathBuf::from) else { return };
    let seed = std::env::var("SEED").ok().and_then(|s| s.parse().ok()).unwrap_or(0);
    let camera = Camera::d405();
    let start = std::time::Instant::now();
    let anatomy = Anatomy::new(seed);
    println!("anatomy {:.2} s", start.elapsed().as_secs_f64());
    let still = Still::new(&anatomy, &camera, Fineness { surface: 0.6e-3, bed: 0.8e-3 });
    println!("still {:.2} s", start.elapsed().as_secs_f64());
    still.frame.color.write_png(&dir.join("still.png")).unwrap();
    let arms = instruments::pair(0.0);
    let start = std::time::Instant::now();
    for index in [0, 40, 75] {
        let shot = shoot(&still, &arms, &camera, seed, index);
        shot.color.write_png(&dir.join(format!("frame{index}.png"))).unwrap();
        let mut picture = shot.color;
        for (p, d) in picture.pixels.iter_mut().zip(&shot.depth.depth) {
            let t = ((f64::from(*d) - 0.12) / 0.10 * 255.0).clamp(0.0, 255.0) as u8;
            *p = if *d == 0.0 { [0, 0, 0] } else { [255 - t, (t.wrapping_mul(8)) / 2 + 60, t] };
        }
        picture.write_png(&dir.join(format!("depth{index}.png"))).unwrap();
    }
    println!("3 frames {:.2} s", start.elapsed().as_secs_f64());
}

#[test]
fn every_organ_pixel_is_seen_through_the_instruments_motion() {
    let camera = small();
    let still = Still::new(&Anatomy::new(0), &camera, COARSE);
    let arms = instruments::pair(1.0);
    let mut free = vec![0; camera.width * camera.height];
    for index in (0..180).step_by(2) {
        let shot = shoot(&still, &arms, &camera, 0, index);
        for (f, covered) in free.iter_mut().zip(&shot.instruments.set) {
            *f += usize::from(!covered);
        }
    }
    let covered_sometimes = free.iter().filter(|f| **f < 90).count();
    assert!(covered_sometimes > free.len() / 4, "the instruments move over much of the picture");
    for organ in 0..6 {
        let mask = still.organ_mask(organ);
        assert!(mask.count() > 50, "organ {organ} shows in {} pixels", mask.count());
        let least = mask.set.iter().zip(&free).filter(|(m, _)| **m).map(|(_, f)| *f).min().unwrap();
        assert!(least >= 3, "a pixel of organ {organ} is free in {least} frames only");
    }
}

#[test]
fn recorded_depth_is_the_truth_within_its_noise() {
    let camera = small();
    let still = Still::new(&Anatomy::new(1), &camera, COARSE);
    let shot = shoot(&still, &instruments::pair(0.0), &camera, 1, 17);
    let (mut valid, mut free) = (0, 0);
    for i in 0..camera.width * camera.height {
        if shot.instruments.set[i] {
            continue;
        }
        free += 1;
        let (truth, recorded) = (still.frame.depth.depth[i], shot.depth.depth[i]);
        if recorded > 0.0 {
            valid += 1;
            // Noise stays within 3.5 sigma, rounding within half a millimetre.
            let bound = 3.5 * 0.3e-3 * (truth / 0.2).powi(2) + 0.5e-3 + 1e-6;
            assert!((recorded - truth).abs() < bound, "pixel {i}: {recorded} for {truth}");
        }
    }
    let share = f64::from(valid) / f64::from(free);
    assert!(share > 0.8 && share < 0.995, "{share} of the free pixels have depth");
}

#[test]
fn one_thread_and_many_film_the_same() {
    let film = || {
        let still = Still::new(&Anatomy::new(2), &small(), COARSE);
        let shot = shoot(&still, &instruments::pair(0.5), &small(), 2, 31);
        (still.surfaces, shot.color, shot.depth, shot.instruments)
    };
    let on = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(film);
    assert!(on(1) == on(2));
}

#[test]
fn a_recording_is_whole_and_replays() {
    use crate::record::{RecordOptions, record_with};
    let dir = tempfile::tempdir().unwrap();
    let write = |name: &str| {
        let to = dir.path().join(name);
        let options = RecordOptions { frames: 3, seed: 4 };
        record_with("phantom-a", &options, &small(), COARSE, &to, &trocar_progress::Silent).unwrap();
        to
    };
    let folder = write("a");
    let again = write("b");
    let recording = trocar_recording::Recording::open(&folder).unwrap();
    assert_eq!(recording.len(), 3);
    let names: Vec<&str> = recording.info.organs.iter().map(|o| o.name.as_str()).collect();
    assert_eq!(names, ["cecum", "bowel-1", "bowel-2", "bowel-3", "stomach", "appendix"]);
    for (index, organ) in recording.info.organs.iter().enumerate() {
        let name = &recording.info.organs[index].name;
        let mask = Mask::read(&folder.join(format!("masks/{name}.png"))).unwrap();
        let [u, v] = organ.base_px.unwrap();
        assert!(mask.set[v.round() as usize * mask.width + u.round() as usize], "{}'s base is in its mask", organ.name);
        let surface = folder.join(format!("truth/{}.ply", organ.name));
        let surface = trocar_geometry::io::read_surface(&surface, trocar_geometry::io::Unit::Metre).unwrap();
        assert!(surface.is_watertight() && surface.volume() > 0.5e-6, "{}", organ.name);
    }
    let truth = trocar_camera::DepthImage::read(&folder.join("truth/depth.png"), 0.0001).unwrap();
    assert!(truth.depth.iter().all(|d| *d > 0.1), "the bed fills the picture");
    for file in ["recording.toml", "color/000002.png", "depth/000001.png", "masks/appendix.png", "truth/cecum.ply"] {
        let bytes = |folder: &std::path::Path| std::fs::read(folder.join(file)).unwrap();
        assert!(bytes(&folder) == bytes(&again), "{file} differs between two recordings of one seed");
    }
}

#[test]
fn bad_requests_are_refused_and_leave_nothing() {
    use crate::{Error, RecordOptions, record};
    struct Stop;
    impl trocar_progress::Progress for Stop {
        fn begin(&self, _: &str, _: u64) {}
        fn advance(&self, _: u64) {}
        fn end(&self) {}
        fn interrupted(&self) -> bool {
            true
        }
    }
    let dir = tempfile::tempdir().unwrap();
    let to = dir.path().join("out");
    let options = RecordOptions { frames: 2, seed: 0 };
    let silent = &trocar_progress::Silent;
    let unknown = record("phantom-z", &options, &to, silent).unwrap_err().to_string();
    assert!(unknown.contains("phantom-z") && unknown.contains("phantom-a"), "{unknown}");
    let none = record("phantom-a", &RecordOptions { frames: 0, ..options }, &to, silent).unwrap_err().to_string();
    assert!(none.contains("frames is 0"), "{none}");
    let stopped = crate::record::record_with("phantom-a", &options, &small(), COARSE, &to, &Stop);
    assert!(matches!(stopped, Err(Error::Interrupted)));
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
}

/// How long 90 frames take: `cargo test --release -p trocar-phantom -- --ignored --nocapture speed`.
#[test]
#[ignore = "a measurement"]
fn speed() {
    let dir = tempfile::tempdir().unwrap();
    let start = std::time::Instant::now();
    let options = crate::RecordOptions { frames: 90, seed: 0 };
    crate::record("phantom-a", &options, &dir.path().join("a"), &trocar_progress::Silent).unwrap();
    for mesh in ["cecum", "appendix"] {
        let mesh = dir.path().join(format!("a/truth/{mesh}.ply"));
        let mesh = trocar_geometry::io::read_surface(&mesh, trocar_geometry::io::Unit::Metre).unwrap();
        println!("{} triangles, {:.2} cm3", mesh.triangles.len(), mesh.volume() * 1e6);
    }
    println!("90 frames in {:.1} s", start.elapsed().as_secs_f64());
}
