//! Whole frames compared with the ground truth.

use crate::anatomy::Anatomy;
use crate::frame::{FrameSettings, record_frame};
use crate::sensor::Sensor;
use crate::spec::{PhantomSpec, Resolution};
use crate::static_view::StaticView;
use crate::{instruments, phantom_a, phantom_b, phantom_c, phantom_d};
use trocar_camera::{Camera, Mask};

const SPECS: [&PhantomSpec; 4] = [&phantom_a::SPEC, &phantom_b::SPEC, &phantom_c::SPEC, &phantom_d::SPEC];

/// Half the resolution of a recording.
fn coarse(spec: &PhantomSpec) -> Resolution {
    Resolution { surface: 2.0 * spec.resolution.surface, bed: 2.5 * spec.resolution.bed }
}

fn still(spec: &PhantomSpec, seed: u64, camera: &Camera) -> StaticView {
    StaticView::new(spec, &Anatomy::new(spec, seed), camera, coarse(spec))
}

/// The D405 with a quarter of the pixels per side.
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

/// Writes pictures for inspection to `$LOOK`: `cargo test --release -p trocar-phantom -- --ignored
/// look`, with optional `$SEED` and `$STEREO`.
#[test]
#[ignore = "writes pictures for inspection"]
fn look() {
    let Some(dir) = std::env::var_os("LOOK").map(std::path::PathBuf::from) else { return };
    let seed = std::env::var("SEED").ok().and_then(|s| s.parse().ok()).unwrap_or(0);
    let sensor = if std::env::var_os("STEREO").is_some() { Sensor::Stereo } else { Sensor::Plain };
    let camera = Camera::d405();
    for spec in SPECS {
        let start = std::time::Instant::now();
        let anatomy = Anatomy::new(spec, seed);
        println!("{}: anatomy {:.2} s", spec.name, start.elapsed().as_secs_f64());
        let still = StaticView::new(spec, &anatomy, &camera, spec.resolution);
        println!("still {:.2} s", start.elapsed().as_secs_f64());
        for (organ, surface) in anatomy.organs.iter().zip(&still.surfaces) {
            println!("  {}: {:.2} cm3, {:.1} cm2", organ.name, surface.volume() * 1e6, surface.area() * 1e4);
        }
        still.frame.color.write_png(&dir.join(format!("{}-still.png", spec.name))).unwrap();
        let arms = instruments::pair(&spec.reach, 0.0);
        let take = FrameSettings { instruments: &arms, camera: &camera, sensor, seed };
        let start = std::time::Instant::now();
        let (near, far) = (f64::from(spec.lamp_distance) - 0.05, f64::from(spec.lamp_distance) + 0.02);
        for index in [0, 40, 75] {
            let shot = record_frame(&still, &take, index);
            shot.color.write_png(&dir.join(format!("{}-frame{index}.png", spec.name))).unwrap();
            let mut picture = shot.color;
            for (p, d) in picture.pixels.iter_mut().zip(&shot.depth.depth) {
                let t = ((f64::from(*d) - near) / (far - near) * 255.0).clamp(0.0, 255.0) as u8;
                *p = if *d == 0.0 { [0, 0, 0] } else { [255 - t, (t.wrapping_mul(8)) / 2 + 60, t] };
            }
            picture.write_png(&dir.join(format!("{}-depth{index}.png", spec.name))).unwrap();
        }
        println!("3 frames {:.2} s", start.elapsed().as_secs_f64());
    }
}

#[test]
fn every_organ_pixel_is_visible_in_some_frame() {
    let camera = small();
    for spec in SPECS {
        let still = still(spec, 0, &camera);
        let arms = instruments::pair(&spec.reach, 1.0);
        let take = FrameSettings { instruments: &arms, camera: &camera, sensor: Sensor::Plain, seed: 0 };
        let mut free = vec![0; camera.width * camera.height];
        for index in (0..180).step_by(3) {
            let shot = record_frame(&still, &take, index);
            for (f, covered) in free.iter_mut().zip(&shot.instruments.set) {
                *f += usize::from(!covered);
            }
        }
        let covered_sometimes = free.iter().filter(|f| **f < 60).count();
        assert!(covered_sometimes > free.len() / 4, "{}: the instruments move over much of the picture", spec.name);
        for (organ, name) in spec.organ_names.iter().enumerate() {
            let mask = still.organ_mask(organ);
            assert!(mask.count() > 50, "{name} shows in {} pixels", mask.count());
            let under: Vec<usize> = mask.set.iter().zip(&free).filter(|(m, _)| **m).map(|(_, f)| *f).collect();
            let least = under.iter().min().unwrap();
            assert!(*least >= 2, "{}: a pixel of {name} is free in {least} frames only", spec.name);
        }
    }
}

#[test]
fn recorded_depth_is_within_its_noise_of_the_truth() {
    let camera = small();
    let still = still(&phantom_a::SPEC, 1, &camera);
    let arms = instruments::pair(&phantom_a::SPEC.reach, 0.0);
    let take = FrameSettings { instruments: &arms, camera: &camera, sensor: Sensor::Plain, seed: 1 };
    let shot = record_frame(&still, &take, 17);
    let (mut valid, mut free) = (0, 0);
    for i in 0..camera.width * camera.height {
        if shot.instruments.set[i] {
            continue;
        }
        free += 1;
        let (truth, recorded) = (still.frame.depth.depth[i], shot.depth.depth[i]);
        if recorded > 0.0 {
            valid += 1;
            // Noise is limited to 3.5 sigma, rounding to half a millimetre.
            let bound = 3.5 * 0.3e-3 * (truth / 0.2).powi(2) + 0.5e-3 + 1e-6;
            assert!((recorded - truth).abs() < bound, "pixel {i}: {recorded} for {truth}");
        }
    }
    let share = f64::from(valid) / f64::from(free);
    assert!(share > 0.8 && share < 0.995, "{share} of the free pixels have depth");
}

#[test]
fn true_depth_within_a_mask_is_on_that_organ() {
    use trocar_geometry::SignedDistance;
    let camera = small();
    for spec in [&phantom_b::SPEC, &phantom_c::SPEC, &phantom_d::SPEC] {
        let anatomy = Anatomy::new(spec, 2);
        let still =
            StaticView::new(spec, &anatomy, &camera, Resolution { surface: spec.resolution.surface, ..coarse(spec) });
        for (index, organ) in anatomy.organs.iter().enumerate() {
            let mask = still.organ_mask(index);
            let mut off = Vec::new();
            for i in (0..mask.set.len()).filter(|i| mask.set[*i]) {
                let ray = camera.ray((i % camera.width) as f64, (i / camera.width) as f64);
                let z = f64::from(still.frame.depth.depth[i]);
                off.push(organ.body.distance(ray * z).abs());
            }
            off.sort_by(f64::total_cmp);
            // The surface is a mesh, so the bottom of a crease can lie between its vertices.
            let (most, all) = (off[off.len() * 199 / 200], off[off.len() - 1]);
            assert!(most < 0.3e-3 && all < 0.6e-3, "{}: {most} m off, {all} m at most", organ.name);
            assert!(off[off.len() / 2] < 0.05e-3, "{}: {} m off in the median", organ.name, off[off.len() / 2]);
        }
    }
}

#[test]
fn stereo_changes_only_depth_and_moves_silhouettes_forward() {
    let camera = small();
    let still = still(&phantom_c::SPEC, 1, &camera);
    let shot = |sensor| record_frame(&still, &FrameSettings { instruments: &[], camera: &camera, sensor, seed: 1 }, 5);
    let (plain, stereo) = (shot(Sensor::Plain), shot(Sensor::Stereo));
    assert!(plain.color == stereo.color && plain.depth != stereo.depth);
    let pairs = plain.depth.depth.iter().zip(&stereo.depth.depth).filter(|(p, s)| **p > 0.0 && **s > 0.0);
    let forward = pairs.clone().filter(|(p, s)| *p - *s > 8e-3).count();
    let back = pairs.filter(|(p, s)| *s - *p > 8e-3).count();
    assert!(forward > 20 && back == 0, "{forward} pixels come forward, {back} go back");
}

#[test]
fn frames_do_not_depend_on_thread_count() {
    for (spec, sensor) in [(&phantom_a::SPEC, Sensor::Plain), (&phantom_b::SPEC, Sensor::Stereo)] {
        let film = || {
            let still = still(spec, 2, &small());
            let arms = instruments::pair(&spec.reach, 0.5);
            let take = FrameSettings { instruments: &arms, camera: &small(), sensor, seed: 2 };
            let shot = record_frame(&still, &take, 31);
            (still.surfaces, shot.color, shot.depth, shot.instruments)
        };
        let on = |threads| rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(film);
        assert!(on(1) == on(2));
    }
}

#[test]
fn recording_is_complete_and_reproducible() {
    use crate::record::{RecordOptions, record_with};
    let dir = tempfile::tempdir().unwrap();
    let spec = &phantom_a::SPEC;
    let write = |name: &str| {
        let to = dir.path().join(name);
        let options = RecordOptions { frames: 3, seed: 4, ..RecordOptions::default() };
        record_with(spec, &options, &small(), coarse(spec), &to, &trocar_core::Silent).unwrap();
        to
    };
    let folder = write("a");
    let again = write("b");
    let recording = trocar_recording::Recording::open(&folder).unwrap();
    assert_eq!(recording.len(), 3);
    let names: Vec<&str> = recording.info.organs.iter().map(|o| o.name.as_str()).collect();
    assert_eq!(names, ["cecum", "bowel-1", "bowel-2", "bowel-3", "stomach", "appendix"]);
    for organ in &recording.info.organs {
        let mask = Mask::read(&folder.join(format!("masks/{}.png", organ.name))).unwrap();
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
fn invalid_requests_are_rejected_and_leave_no_files() {
    use crate::{Error, RecordOptions, record};
    struct Stop;
    impl trocar_core::Progress for Stop {
        fn begin(&self, _: &str, _: u64) {}
        fn advance(&self, _: u64) {}
        fn end(&self) {}
        fn interrupted(&self) -> bool {
            true
        }
    }
    let dir = tempfile::tempdir().unwrap();
    let to = dir.path().join("out");
    let options = RecordOptions { frames: 2, ..RecordOptions::default() };
    let silent = &trocar_core::Silent;
    let unknown = record("fantom-c", &options, &to, silent).unwrap_err().to_string();
    assert_eq!(
        unknown,
        "no phantom 'fantom-c'; the phantoms are phantom-a, phantom-b, phantom-c, phantom-d; did you mean 'phantom-c'?"
    );
    let none = record("phantom-a", &RecordOptions { frames: 0, ..options }, &to, silent).unwrap_err().to_string();
    assert!(none.contains("frames is 0"), "{none}");
    let stopped = crate::record::record_with(SPECS[0], &options, &small(), coarse(SPECS[0]), &to, &Stop);
    assert!(matches!(stopped, Err(Error::Interrupted)));
    assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
}

/// Time to record 90 frames: `cargo test --release -p trocar-phantom -- --ignored --nocapture
/// speed`.
#[test]
#[ignore = "a measurement"]
fn speed() {
    let dir = tempfile::tempdir().unwrap();
    let start = std::time::Instant::now();
    let options = crate::RecordOptions { frames: 90, ..crate::RecordOptions::default() };
    crate::record("phantom-a", &options, &dir.path().join("a"), &trocar_core::Silent).unwrap();
    for mesh in ["cecum", "appendix"] {
        let mesh = dir.path().join(format!("a/truth/{mesh}.ply"));
        let mesh = trocar_geometry::io::read_surface(&mesh, trocar_geometry::io::Unit::Metre).unwrap();
        println!("{} triangles, {:.2} cm3", mesh.triangles.len(), mesh.volume() * 1e6);
    }
    println!("90 frames in {:.1} s", start.elapsed().as_secs_f64());
}
