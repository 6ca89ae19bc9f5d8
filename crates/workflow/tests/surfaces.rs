//! Surfaces of an episode: as exact as they say, through a cut, the same pictures as of the cell,
//! tied to their episode, and damaged files without a panic.

#![allow(clippy::unwrap_used, reason = "test helpers may panic")]
#![allow(clippy::print_stdout, reason = "what was measured, for those who ask with --nocapture")]

use std::path::Path;
use trocar_core::Silent;
use trocar_render::RenderSettings;
use trocar_scene::{Distribution, Factor, SpecimenSource};
use trocar_sensors::{ArmPosture, CameraRig, Skins};
use trocar_specimen::Specimen;
use trocar_task::{EPISODE_FILE, Episode, policy, run_watched};
use trocar_testing::tube::{ONE_END, resection, two_tubes};
use trocar_workflow::{RecordedEpisode, SURFACES_FILE, SurfaceWatch, write_gltf};

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
    scene.variation.factors.insert(Factor::LampScale, Distribution::Uniform([0.4, 0.5]));
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

/// The episode as glTF, opened by the reader of the `gltf` crate: shapes, poses and times are those
/// that were seen, and the organ that is cut has a mesh before and one after.
fn check_gltf(folder: &Path, seen: &Seen) {
    let path = folder.join("episode.glb");
    let refused = write_gltf(&mut open(folder).unwrap(), &path, 65, &Silent).unwrap_err().to_string();
    assert!(refused.contains("from 2 to 64"), "{refused}");
    let written = write_gltf(&mut open(folder).unwrap(), &path, 12, &Silent).unwrap();
    let bytes = std::fs::read(&path).unwrap();
    assert_eq!((written.keyframes, written.bytes), (12, bytes.len()));
    let read = gltf::Gltf::from_slice(&bytes).unwrap();
    let buffer = read.blob.as_deref().unwrap();
    let data = |_: gltf::Buffer<'_>| Some(buffer);
    let named = |name: &str| read.nodes().filter(|n| n.name() == Some(name)).collect::<Vec<_>>();
    // The second tube is cut: it has two meshes, one of which is shown at a time.
    let organs: Vec<_> = ["tube", "low"].iter().flat_map(|name| named(name)).collect();
    let last = seen.positions.len() - 1;
    let frames: Vec<usize> = (0..12).map(|k| k * last / 11).collect();
    let near = |a: [f32; 3], b: glam::DVec3| glam::Vec3::from(a).as_dvec3().distance(b) < 2e-5;
    let (mut shapes, mut hidden) = (0, 0);
    for node in &organs {
        let primitive = node.mesh().unwrap().primitives().next().unwrap();
        let start: Vec<[f32; 3]> = primitive.reader(data).read_positions().unwrap().collect();
        assert!(primitive.reader(data).read_colors(0).is_some() && primitive.reader(data).read_normals().is_some());
        let targets: Vec<Vec<[f32; 3]>> =
            primitive.reader(data).read_morph_targets().map(|(p, ..)| p.unwrap().collect()).collect();
        shapes += targets.len();
        // Every shape is a keyframe of an organ with as many vertices.
        for target in &targets {
            let moved: Vec<[f32; 3]> =
                start.iter().zip(target).map(|(a, b)| std::array::from_fn(|c| a[c] + b[c])).collect();
            let fits = |live: &Vec<glam::DVec3>| {
                live.len() == moved.len() && moved.iter().zip(live).all(|(a, b)| near(*a, *b))
            };
            assert!(frames.iter().any(|frame| seen.positions[*frame].iter().any(fits)), "{:?}", node.name());
        }
    }
    let animation = read.animations().next().unwrap();
    for channel in animation.channels() {
        let reader = channel.reader(data);
        let times: Vec<f32> = reader.read_inputs().unwrap().collect();
        assert!(times.len() >= 2 && times.windows(2).all(|w| w[1] > w[0]));
        assert!((f64::from(*times.last().unwrap()) - last as f64 / 30.0).abs() < 1e-3 || times.len() < 12);
        match reader.read_outputs().unwrap() {
            gltf::animation::util::ReadOutputs::Scales(scales) => {
                let shown: Vec<f32> = scales.map(|s| s[0]).collect();
                assert!(shown.contains(&0.0) && shown.contains(&1.0), "{shown:?}");
                hidden += 1;
            }
            gltf::animation::util::ReadOutputs::Translations(places) => {
                assert_eq!(places.count(), 12);
            }
            gltf::animation::util::ReadOutputs::Rotations(turns) => assert_eq!(turns.into_f32().count(), 12),
            gltf::animation::util::ReadOutputs::MorphTargetWeights(weights) => {
                let weights: Vec<f32> = weights.into_f32().collect();
                assert_eq!(weights.len(), times.len() * (times.len() - 1));
                let ones = weights.iter().filter(|w| **w == 1.0).count();
                assert_eq!(ones, times.len() - 1, "each shape has its moment");
            }
        }
    }
    assert!(shapes >= 10 && hidden == 2, "{shapes} shapes, {hidden} meshes are hidden at times");
    // The tip of the left instrument at the end.
    let gripper = seen.arms[last][0].gripper.pose;
    let shaft = named("left grasper");
    let of_shaft: Vec<_> = animation.channels().filter(|c| c.target().node().index() == shaft[0].index()).collect();
    let place = of_shaft.iter().find_map(|c| match c.reader(data).read_outputs().unwrap() {
        gltf::animation::util::ReadOutputs::Translations(places) => places.last(),
        _ => None,
    });
    assert!(near(place.unwrap(), gripper.translation), "{place:?} {gripper:?}");
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

    check_gltf(folder.path(), &seen);

    // The lamp was drawn; under the scene's own light the same frame is brighter.
    let sum = |episode: &mut RecordedEpisode| -> u64 {
        let picture = episode.picture("endoscope", SIZE, &SETTINGS).unwrap();
        picture.color.pixels.as_flattened().iter().map(|v| u64::from(*v)).sum()
    };
    let drawn = sum(&mut open(folder.path()).unwrap());
    let plain = sum(&mut open(folder.path()).unwrap().in_plain_light());
    assert!(plain as f64 > 1.2 * drawn as f64, "{plain} {drawn}");

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

    // Damaged bytes are an error at once; with a checksum that fits they are one when they are
    // read.
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
