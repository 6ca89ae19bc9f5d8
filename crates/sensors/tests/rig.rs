//! Pictures of a small cell: bit-identical on any number of threads, moving parts at the right
//! place, cuts, sections, noise.

#![allow(clippy::unwrap_used, reason = "test helpers may panic")]

use glam::{DQuat, DVec3};
use trocar_camera::{Camera, ColorImage};
use trocar_cell::{Action, Cell};
use trocar_core::Pose;
use trocar_geometry::{TetMesh, TriMesh};
use trocar_render::{Picture, RenderSettings};
use trocar_scene::{Scene, SpecimenSource};
use trocar_sensors::{CameraNoise, CameraRig, DepthNoise};
use trocar_specimen::{Material, Organ, OrganFacts, Pins, Provenance, Specimen};

/// A bar of cubes along x, six elements each, in the frame of the recording camera, on a bed at a
/// distance of 150 mm.
fn bar(name: &str, middle: DVec3, cubes: usize, edge: f64) -> Organ {
    let mut body = TetMesh::default();
    let at = |i: usize, j: usize, k: usize| (i * 9 + j * 3 + k) as u32;
    for i in 0..=cubes {
        for j in 0..3 {
            for k in 0..3 {
                let p = DVec3::new(i as f64 - 0.5 * cubes as f64, j as f64 - 1.0, k as f64 - 1.0);
                body.vertices.push(middle + edge * p);
            }
        }
    }
    for i in 0..cubes {
        for (j, k) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let corner = |c: usize| at(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2));
            for [a, b] in [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]] {
                body.tets.push([corner(0), corner(a), corner(b), corner(7)]);
            }
        }
    }
    let (mut surface, _): (TriMesh, _) = body.boundary();
    surface.colors = vec![[200, 120, 90]; surface.vertices.len()];
    Organ {
        name: name.to_owned(),
        base: body.vertices[0],
        body,
        surface,
        material: Material::default(),
        pins: Pins::Band { share: 0.4 },
        threads: None,
        posterior: None,
        facts: OrganFacts::default(),
    }
}

fn specimen() -> Specimen {
    let mut picture = ColorImage::new(212, 120, [150, 60, 50]);
    picture.pixels.iter_mut().enumerate().for_each(|(i, p)| p[0] = 100 + (i % 90) as u8);
    Specimen {
        name: "bars".to_owned(),
        up: -DVec3::Z,
        placement: Pose::IDENTITY,
        camera: Some(Camera::centred(212, 120, 1.5)),
        organs: vec![
            bar("appendix", DVec3::new(0.012, 0.012, 0.145), 12, 0.004),
            bar("bowel", DVec3::new(0.0, -0.02, 0.145), 8, 0.005),
        ],
        background: Some(picture),
        provenance: Provenance::default(),
    }
}

fn scene() -> Scene {
    let mut scene = Scene::new("bars", SpecimenSource::phantom("phantom-a", 1));
    scene.task.organ = "appendix".to_owned();
    scene
}

fn share(picture: &Picture, label: u16) -> f64 {
    picture.labels.iter().filter(|l| **l == label).count() as f64 / picture.labels.len() as f64
}

fn label(rig: &CameraRig, name: &str) -> u16 {
    rig.labels().iter().find(|(_, n)| n == name).unwrap().0
}

#[test]
fn every_camera_sees_the_scene_independent_of_threads() {
    let (scene, specimen) = (scene(), specimen());
    let mut cell = Cell::new(&scene, &specimen, 1).unwrap();
    let mut rig = CameraRig::new(&scene, &specimen, &cell).unwrap();
    rig.noise = CameraNoise { color: Some([0.02, 0.004]), depth: Some(DepthNoise::default()), seed: 7 };
    assert_eq!(rig.cameras(), ["endoscope", "d405", "recording", "outside"]);
    rig.update(&cell).unwrap();
    let mut run = |threads: usize| -> Vec<Picture> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        let mut seen = Vec::new();
        for camera in ["endoscope", "d405", "recording", "outside"] {
            for settings in [RenderSettings::preview(), RenderSettings::path(2)] {
                seen.push(pool.install(|| rig.render_still(camera, [96, 64], &settings).unwrap().clone()));
            }
        }
        seen
    };
    let (one, two) = (run(1), run(2));
    assert_eq!(one, two);
    let organs = [label(&rig, "appendix"), label(&rig, "bowel")];
    for (k, picture) in one.iter().step_by(2).take(3).enumerate() {
        for organ in organs {
            assert!(share(picture, organ) > 0.0003, "camera {k} does not see organ {organ}");
        }
        assert!(share(picture, label(&rig, "grasper")) > 0.003, "camera {k} sees no grasper");
        assert!(
            picture
                .normals
                .iter()
                .zip(&picture.labels)
                .all(|(n, l)| *l == 0 || (glam::Vec3::from(*n).length() - 1.0).abs() < 1e-3)
        );
    }
    assert!(share(&one[6], label(&rig, "left arm")) > 0.01);
    // Without noise, depth is exact: the bed is 150 mm in front of the recording camera.
    rig.noise = CameraNoise::default();
    let size = rig.size("recording").unwrap();
    let picture = rig.render(&cell, "recording", size, &RenderSettings::preview()).unwrap();
    let bed = picture.depth.depth[100 * size[0] + 20];
    assert!((0.145..0.153).contains(&bed), "{bed}");
    // After the arms moved, the picture shows the instruments at the position that the cell
    // reports.
    let still = rig.render(&cell, "endoscope", [96, 64], &RenderSettings::preview()).unwrap().clone();
    let action: Vec<_> = cell.observe().iter().map(|a| trocar_cell_coordinates(a, 0.004)).collect();
    for _ in 0..10 {
        cell.step(&Action::targets(&action)).unwrap();
    }
    let moved = rig.render(&cell, "endoscope", [96, 64], &RenderSettings::preview()).unwrap().clone();
    assert_ne!(still.labels, moved.labels);
    let (model, pose) = rig.model("endoscope", [96, 64]).unwrap();
    let gripper = cell.gripper("right").unwrap();
    let tip = pose.inverse().transform(gripper.blade(1.0).transform(DVec3::new(0.012, 0.0008, 0.0)));
    let pixel = model.project(tip).unwrap().round();
    if (0.0..96.0).contains(&pixel.x) && (0.0..64.0).contains(&pixel.y) {
        let at = pixel.y as usize * 96 + pixel.x as usize;
        assert_eq!(moved.labels[at], label(&rig, "cutter"), "the blade is at {pixel}");
    }
}

fn trocar_cell_coordinates(arm: &trocar_cell::ArmObservation, deeper: f64) -> trocar_cell::Setpoint {
    let mut to = arm.commanded.with_jaw(1.0);
    to.0[2] -= deeper;
    to
}

#[test]
fn section_shows_half_and_can_be_removed() {
    let (scene, specimen) = (scene(), specimen());
    let cell = Cell::new(&scene, &specimen, 1).unwrap();
    let mut rig = CameraRig::new(&scene, &specimen, &cell).unwrap();
    let camera = ("recording", [212, 120]);
    let whole = rig.render(&cell, camera.0, camera.1, &RenderSettings::preview()).unwrap().clone();
    let triangles = rig.triangles();
    // A section hides the part on the normal's side. Removing it shows whole organs again.
    let organ = label(&rig, "appendix");
    let middle = specimen.organs[0].body.vertices.iter().sum::<DVec3>() / specimen.organs[0].body.vertices.len() as f64;
    let middle = scene.placement.pose().transform(middle);
    rig.set_section(Some((middle + 1e-4 * DVec3::X, DVec3::X)));
    let half = rig.render(&cell, camera.0, camera.1, &RenderSettings::preview()).unwrap().clone();
    let ratio = share(&half, organ) / share(&whole, organ);
    assert!((0.35..0.65).contains(&ratio), "{ratio}");
    rig.set_section(None);
    assert_eq!(*rig.render(&cell, camera.0, camera.1, &RenderSettings::preview()).unwrap(), whole);
    assert_eq!(rig.triangles(), triangles);
}

#[test]
fn specimen_renders_alone_and_errors_name_the_cause() {
    let mut specimen = specimen();
    let mut rig = CameraRig::from_specimen(&specimen).unwrap();
    assert_eq!(rig.cameras(), ["recording", "outside"]);
    let seen = rig.render_still("recording", [212, 120], &RenderSettings::preview()).unwrap().clone();
    assert!(share(&seen, 1) > 0.01 && share(&seen, 2) > 0.01);
    // The centre of the organ is where the recording camera sees it.
    let at = Camera::centred(212, 120, 1.5).project(DVec3::new(0.012, 0.012, 0.141)).unwrap().round();
    assert_eq!(seen.labels[at.y as usize * 212 + at.x as usize], 1);
    assert!(
        matches!(rig.render_still("endoscope", [96, 64], &RenderSettings::preview()), Err(e) if e.to_string() == "there is no camera 'endoscope'; the cameras are recording, outside")
    );
    assert!(
        matches!(rig.render_still("outside", [4, 64], &RenderSettings::preview()), Err(e) if e.to_string().contains("[8, 8192]"))
    );
    // Tilted specimens are set upright. Those without a camera are seen from the side.
    specimen.up = (DQuat::from_rotation_x(0.6) * specimen.up).normalize();
    (specimen.camera, specimen.background) = (None, None);
    let mut rig = CameraRig::from_specimen(&specimen).unwrap();
    assert_eq!(rig.cameras(), ["outside"]);
    let seen = rig.render_still("outside", [120, 80], &RenderSettings::preview()).unwrap();
    assert!(share(seen, 1) > 0.01, "{}", share(seen, 1));
}

#[test]
fn imaging_changes_pictures_as_it_says() {
    let (plain, specimen) = (scene(), specimen());
    let cell = Cell::new(&plain, &specimen, 1).unwrap();
    let see = |change: &dyn Fn(&mut trocar_scene::Imaging)| {
        let mut scene = plain.clone();
        change(&mut scene.imaging);
        let mut rig = CameraRig::new(&scene, &specimen, &cell).unwrap();
        assert!(rig.is_of(&scene) && (scene == plain || !rig.is_of(&plain)));
        rig.noise = CameraNoise { color: Some([0.02, 0.004]), depth: Some(DepthNoise::default()), seed: 7 };
        let organ = label(&rig, "appendix");
        let picture = rig.render(&cell, "d405", [96, 64], &RenderSettings::preview()).unwrap().clone();
        let on = |all: bool, channel: usize| -> f64 {
            let pixels = picture.color.pixels.iter().zip(&picture.labels).filter(|(_, l)| all || **l == organ);
            let values: Vec<f64> = pixels.map(|(p, _)| f64::from(p[channel])).collect();
            values.iter().sum::<f64>() / values.len() as f64
        };
        (on(true, 0), [0, 1, 2].map(|channel| on(false, channel)), picture)
    };
    let (bright, organ, same) = see(&|_| {});
    let (_, _, louder) = see(&|i| i.noise = 3.0);
    assert!(louder.color != same.color && louder.depth.depth != same.depth.depth && louder.labels == same.labels);
    assert!(see(&|i| i.lamp = 0.5).0 < 0.9 * bright);
    assert!(see(&|i| i.exposure = 0.5).0 < 0.9 * bright);
    assert_ne!(see(&|i| i.gloss = 3.0).2.color, same.color);
    let (_, tinted, picture) = see(&|i| i.tint = [1.0, 0.6, 1.0]);
    assert!(tinted[1] < 0.9 * organ[1] && (tinted[0] - organ[0]).abs() < 2.0, "{tinted:?} {organ:?}");
    assert_eq!(picture.labels, same.labels);
}

#[test]
fn previews_equal_traced_pictures() {
    let (scene, specimen) = (scene(), specimen());
    let mut cell = Cell::new(&scene, &specimen, 1).unwrap();
    let mut rig = CameraRig::new(&scene, &specimen, &cell).unwrap();
    let action: Vec<_> = cell.observe().iter().map(|a| trocar_cell_coordinates(a, 0.004)).collect();
    for _ in 0..3 {
        for _ in 0..5 {
            cell.step(&Action::targets(&action)).unwrap();
        }
        for camera in ["endoscope", "d405", "recording", "outside"] {
            let mut see = |settings| rig.render(&cell, camera, [224, 160], &settings).unwrap().clone();
            let raster = see(RenderSettings::Preview { shadows: false });
            let traced = see(RenderSettings::Traced { shadows: false });
            let bytes = |p: &Picture| p.color.pixels.as_flattened().to_vec();
            let apart = bytes(&raster).into_iter().zip(bytes(&traced)).map(|(a, b)| f64::from(a.abs_diff(b)));
            let color = apart.sum::<f64>() / (3 * 224 * 160) as f64;
            assert!(color < 0.2, "{camera}: colours differ by {color} of 255");
            let pixels = raster.labels.len();
            let other = (0..pixels).filter(|i| raster.labels[*i] != traced.labels[*i]).count();
            assert!(other < pixels / 1000, "{camera}: {other} labels differ");
            let pairs = raster.depth.depth.iter().zip(&traced.depth.depth);
            let off = pairs.filter(|(a, b)| (*a - *b).abs() > 1e-4).count();
            assert!(off < pixels / 1000, "{camera}: {off} depths differ");
        }
    }
}

#[test]
fn copies_of_a_rig_show_their_own_cells() {
    let (scene, specimen) = (scene(), specimen());
    let still = Cell::new(&scene, &specimen, 1).unwrap();
    let mut moved = Cell::new(&scene, &specimen, 1).unwrap();
    let mut rig = CameraRig::new(&scene, &specimen, &still).unwrap();
    let mut copy = rig.clone();
    let action: Vec<_> = moved.observe().iter().map(|a| trocar_cell_coordinates(a, 0.004)).collect();
    for _ in 0..10 {
        moved.step(&Action::targets(&action)).unwrap();
    }
    let see = |rig: &mut CameraRig, cell: &Cell| {
        rig.render(cell, "d405", [96, 64], &RenderSettings::preview()).unwrap().clone()
    };
    let (first, other) = (see(&mut rig, &still), see(&mut copy, &moved));
    assert_ne!(first.labels, other.labels);
    assert_eq!(see(&mut rig, &still), first);
    assert_eq!(see(&mut CameraRig::new(&scene, &specimen, &moved).unwrap(), &moved), other);
}
