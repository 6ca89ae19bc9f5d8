//! Surfaces of an episode: as exact as they say, through a cut, the same pictures as of the cell,
//! tied to their episode, and damaged files without a panic.

#![allow(clippy::unwrap_used, reason = "test helpers may panic")]
#![allow(clippy::print_stdout, reason = "what was measured, for those who ask with --nocapture")]

use std::path::Path;
use trocar_core::Silent;
use trocar_render::RenderSettings;
use trocar_scene::SpecimenSource;
use trocar_sensors::{ArmPosture, CameraRig, Skins};
use trocar_specimen::Specimen;
use trocar_task::{EPISODE_FILE, Episode, policy, run_watched};
use trocar_testing::tube::{ONE_END, resection, two_tubes};
use trocar_workflow::{RecordedEpisode, SURFACES_FILE, SurfaceWatch};

const SETTINGS: RenderSettings = RenderSettings::Preview { shadows: false };
const SIZE: [usize; 2] = [64, 48];

/// What was seen of the cell itself.
#[derive(Default)]
struct Seen {
    positions: Vec<Vec<Vec<glam::DVec3>>>,
    arms: Vec<Vec<ArmPosture>>,
    pixels: Vec<Vec<[u8; 3]>>,
    states: Vec<Vec<f64>>,
}

/// A resection in `folder` by the scripted controller, with its surfaces.
fn recorded(folder: &Path) -> (Seen, Vec<u8>) {
    two_tubes(ONE_END, 3e-3).write(&folder.join("tube")).unwrap();
    let specimen = Specimen::read(&folder.join("tube")).unwrap();
    let mut scene = resection();
    scene.specimen = SpecimenSource::folder("tube");
    scene.task.sever = true;
    scene.folder = folder.to_owned();
    scene.cameras.retain(|c| c.name == "endoscope");
    scene.validate().unwrap();
    let mut episode = Episode::new(&scene, &specimen, 1).unwrap();
    episode.reset(3).unwrap();
    let (mut seen, mut watch) = (Seen::default(), SurfaceWatch::new(true));
    let mut skins = Skins::new(episode.arranged_scene(), &specimen).unwrap();
    let mut rig = CameraRig::new(episode.arranged_scene(), &specimen, episode.cell()).unwrap();
    let mut scripted = policy::named("scripted").unwrap();
    let recording = run_watched(&mut episode, scripted.as_mut(), 3, &mut |episode, step| {
        watch.see(episode, step);
        let cell = episode.cell();
        skins.update(cell).unwrap();
        seen.positions.push(skins.organs().iter().map(|o| o.positions().to_vec()).collect());
        seen.arms.push(["left", "right"].map(|name| ArmPosture::of(cell, name).unwrap()).to_vec());
        seen.pixels.push(rig.render(cell, "endoscope", SIZE, &SETTINGS).unwrap().color.pixels.clone());
        seen.states.push(episode.observe().to_vec());
        true
    });
    let recording = recording.unwrap();
    assert!(recording.summary.passed, "{:?}", recording.summary.why);
    recording.write_into(folder).unwrap();
    let bytes = watch.finish().unwrap().unwrap();
    (seen, bytes)
}

fn open(folder: &Path) -> trocar_workflow::Result<RecordedEpisode> {
    RecordedEpisode::open(folder, None, &folder.join("phantoms"), &Silent)
}

#[test]
fn surfaces_give_what_was_seen() {
    let folder = tempfile::tempdir().unwrap();
    let (seen, bytes) = recorded(folder.path());
    let path = folder.path().join(SURFACES_FILE);
    std::fs::write(&path, &bytes).unwrap();
    let mut episode = open(folder.path()).unwrap();
    assert_eq!((episode.header().frames, &episode.note), (seen.positions.len(), &None));
    assert_eq!(episode.file.steps.len() + 1, seen.positions.len());
    let (mut meshes, mut worst, mut differ) = (0, 0.0_f64, 0.0_f64);
    for k in 0..seen.positions.len() {
        assert!(k == 0 || episode.advance().unwrap());
        let now = episode.now();
        meshes += usize::from(now.other_meshes);
        assert!((now.time_s - k as f64 / 30.0).abs() < 1e-9);
        for (a, b) in now.state.iter().zip(&seen.states[k]) {
            assert!((f64::from(*a) - b).abs() <= 1e-6 * b.abs().max(1.0), "{a} {b}");
        }
        for ((_, positions), live) in now.organs.iter().zip(&seen.positions[k]) {
            assert_eq!(positions.len(), live.len());
            for (a, b) in positions.iter().zip(live) {
                worst = worst.max((*a - *b).abs().max_element());
            }
        }
        for (a, b) in now.arms.iter().zip(&seen.arms[k]) {
            assert_eq!(a.links.len(), b.links.len());
            for (a, b) in a.links.iter().zip(&b.links).chain([(&a.gripper.pose, &b.gripper.pose)]) {
                assert!(a.translation.distance(b.translation) < 2e-7, "{a:?} {b:?}");
                assert!(a.rotation.dot(b.rotation).abs() > 1.0 - 1e-12);
            }
            assert!((a.gripper.jaw_angle - b.gripper.jaw_angle).abs() < 1e-6);
        }
        // Every tenth picture, so that meshes also change between two.
        if k % 10 == 0 || k + 1 == seen.positions.len() {
            let picture = episode.picture("endoscope", SIZE, &SETTINGS).unwrap();
            let pairs = picture.color.pixels.as_flattened().iter().zip(seen.pixels[k].as_flattened());
            let sum: f64 = pairs.map(|(a, b)| f64::from(a.abs_diff(*b))).sum();
            differ = differ.max(sum / (3 * SIZE[0] * SIZE[1]) as f64);
        }
    }
    assert!(!episode.advance().unwrap());
    println!(
        "{worst:.2e} m, {differ:.4} of 255, {} bytes in {} frames, {meshes} meshes",
        bytes.len(),
        seen.positions.len()
    );
    assert!(meshes >= 2, "the cut changes the meshes");
    assert!(worst > 0.0 && worst < 5e-6, "{worst} m");
    assert!(differ < 0.05, "pictures differ by {differ} of 255");

    // Without surfaces the episode is replayed, which gives the same file.
    std::fs::remove_file(&path).unwrap();
    let mut again = open(folder.path()).unwrap();
    assert!(again.advance().unwrap() && again.header() == episode.header());

    // Surfaces of another episode, or of fewer steps, are refused.
    let line = bytes.iter().position(|b| *b == b'\n').unwrap();
    let text = String::from_utf8(bytes[..line].to_vec()).unwrap();
    let refused = |from: &str, to: &str| {
        let mut changed = text.replacen(from, to, 1).into_bytes();
        changed.extend(&bytes[line..bytes.len() - 8]);
        let sum = xxhash_rust::xxh3::xxh3_64(&changed);
        changed.extend(sum.to_le_bytes());
        std::fs::write(&path, changed).unwrap();
        open(folder.path()).err().unwrap().to_string()
    };
    let said = refused("\"seed\":3", "\"seed\":4");
    assert!(said.contains("another episode") && said.contains(SURFACES_FILE), "{said}");
    let said = refused(&format!("\"frames\":{}", seen.positions.len()), "\"frames\":7");
    assert!(said.contains("has 7 frames"), "{said}");
    let said = refused("\"version\":1", "\"version\":9");
    assert!(said.contains("version 9; trocar-surfaces version 1 is read"), "{said}");

    // Damaged bytes are an error at once; with a checksum that fits they are one when they are read.
    for k in 0..60 {
        let mut damaged = bytes[..bytes.len() - 8].to_vec();
        let at = line + 1 + (k * 7919) % (damaged.len() - line - 1);
        if k % 3 == 0 {
            damaged.truncate(at);
        } else {
            damaged[at] ^= 1 << (k % 8);
        }
        if k == 1 {
            std::fs::write(&path, [&damaged[..], &[0; 8]].concat()).unwrap();
            assert!(open(folder.path()).err().unwrap().to_string().contains("checksum"));
        }
        let sum = xxhash_rust::xxh3::xxh3_64(&damaged);
        damaged.extend(sum.to_le_bytes());
        std::fs::write(&path, damaged).unwrap();
        let read = open(folder.path()).and_then(|mut e| {
            let mut count = 1;
            while e.advance()? {
                count += 1;
            }
            Ok(count)
        });
        if let Err(why) = read {
            assert!(why.to_string().contains(SURFACES_FILE), "{why}");
        } else {
            assert!(k % 3 != 0, "a file that was cut off at {at} was read");
        }
    }

    // An episode without surfaces that this program replays differently says what is wrong.
    std::fs::remove_file(&path).unwrap();
    let file = folder.path().join(EPISODE_FILE);
    let mut other = trocar_task::EpisodeFile::read(&file).unwrap();
    other.steps[5].1 ^= 1;
    other.write(&file).unwrap();
    let said = open(folder.path()).err().unwrap().to_string();
    assert!(said.contains("has no surfaces.trocar and cannot be replayed: step 6"), "{said}");
}
