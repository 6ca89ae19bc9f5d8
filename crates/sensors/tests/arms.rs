//! Arms drawn from their descriptions, and the abdominal wall around the ports. Tests that need the
//! FR3's files print that they are skipped if the files are missing.

#![allow(clippy::unwrap_used, clippy::print_stdout, reason = "shared test helpers may panic")]

use glam::DVec3;
use std::path::{Path, PathBuf};
use trocar_camera::Camera;
use trocar_cell::{Action, Cell, Setpoint};
use trocar_core::Pose;
use trocar_geometry::TetMesh;
use trocar_render::RenderSettings;
use trocar_scene::{Scene, SpecimenSource};
use trocar_sensors::CameraRig;
use trocar_specimen::{Material, Organ, OrganFacts, Pins, Provenance, Specimen};

/// A cube of 40 mm, 150 mm in front of the recording camera.
fn specimen() -> Specimen {
    let mut body = TetMesh::default();
    for i in 0..27_u32 {
        let p = DVec3::new(f64::from(i / 9), f64::from(i / 3 % 3), f64::from(i % 3)) - 1.0;
        body.vertices.push(DVec3::new(0.0, 0.0, 0.13) + 0.02 * p);
    }
    let at = |i: u32, j: u32, k: u32| 9 * i + 3 * j + k;
    for cube in 0..8_u32 {
        let (i, j, k) = (cube & 1, cube >> 1 & 1, cube >> 2);
        let corner = |c: u32| at(i + (c & 1), j + (c >> 1 & 1), k + (c >> 2));
        for [a, b] in [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]] {
            body.tets.push([corner(0), corner(a), corner(b), corner(7)]);
        }
    }
    let (mut surface, _) = body.boundary();
    surface.colors = vec![[200, 120, 90]; surface.vertices.len()];
    let organ = Organ {
        name: "appendix".to_owned(),
        base: body.vertices[0],
        body,
        surface,
        material: Material::default(),
        pins: Pins::Band { share: 0.4 },
        threads: None,
        posterior: None,
        facts: OrganFacts::default(),
    };
    Specimen {
        name: "cube".to_owned(),
        up: -DVec3::Z,
        placement: Pose::IDENTITY,
        camera: Some(Camera::centred(212, 120, 1.5)),
        organs: vec![organ],
        background: None,
        provenance: Provenance::default(),
    }
}

fn scene() -> Scene {
    Scene::new("cube", SpecimenSource::phantom("phantom-a", 1))
}

fn menagerie() -> Option<PathBuf> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../../shared/data/franka_fr3/fr3.xml"));
    if !path.is_file() {
        println!("skipped: no {}", path.display());
        return None;
    }
    Some(path.to_owned())
}

fn with_model(model: &str, shapes: Option<&str>) -> Scene {
    let mut scene = scene();
    for arm in &mut scene.arms {
        (arm.model, arm.shapes) = (model.to_owned(), shapes.map(str::to_owned));
        arm.flange = model.ends_with(".xml").then(|| "attachment_site".to_owned());
    }
    scene
}

/// Share of the overview picture that shows an arm.
fn seen(rig: &mut CameraRig, cell: &Cell) -> f64 {
    let label = rig.labels().iter().find(|(_, n)| n == "left arm").unwrap().0;
    let picture = rig.render(cell, "outside", [192, 108], &RenderSettings::preview()).unwrap();
    picture.labels.iter().filter(|l| **l == label).count() as f64 / picture.labels.len() as f64
}

#[test]
fn cell_runs_and_draws_arms_described_in_mjcf() {
    let Some(file) = menagerie() else { return };
    let specimen = specimen();
    let run = |scene: &Scene| {
        let mut cell = Cell::new(scene, &specimen, 1).unwrap();
        for k in 0..15 {
            let deeper = |a: &trocar_cell::ArmObservation| {
                let insertion = a.commanded.0[2] - 4e-4 * f64::from(k % 5);
                let mut to = a.commanded.with_jaw(0.8);
                to.0[2] = insertion;
                to
            };
            let action: Vec<Setpoint> = cell.observe().iter().map(deeper).collect();
            let report = cell.step(&Action::targets(&action)).unwrap();
            assert!(report.tissue.divergence.is_none());
        }
        cell
    };
    let file = std::path::absolute(&file).unwrap();
    let described = with_model(file.to_str().unwrap(), None);
    described.validate().unwrap();
    let (plain, built_in) = (run(&described), run(&scene()));
    for arm in ["left", "right"] {
        let tips = [&plain, &built_in].map(|cell| cell.gripper(arm).unwrap().pose.translation);
        // The described arm has other friction and no rotor inertia: its motion is equal, its bits
        // are not.
        assert!(tips[0].distance(tips[1]) < 1e-3, "{arm}: {} m apart", tips[0].distance(tips[1]));
    }
    let mut rig = CameraRig::new(&described, &specimen, &plain).unwrap();
    let mut simple = CameraRig::new(&scene(), &specimen, &built_in).unwrap();
    assert!(rig.triangles() > simple.triangles() + 100_000, "{} triangles", rig.triangles());
    let shares = [seen(&mut rig, &plain), seen(&mut simple, &built_in)];
    assert!((shares[0] / shares[1] - 1.0).abs() < 0.25, "meshes {}, housings {}", shares[0], shares[1]);
    // The same meshes on the built-in arm, and no meshes on the described arm.
    let drawn = with_model("franka_fr3", file.to_str());
    let mut on_built_in = CameraRig::new(&drawn, &specimen, &built_in).unwrap();
    assert_eq!(on_built_in.triangles(), rig.triangles());
    assert!((seen(&mut on_built_in, &built_in) / shares[0] - 1.0).abs() < 0.02);
    let bare = CameraRig::new(&with_model(file.to_str().unwrap(), Some("simple")), &specimen, &plain).unwrap();
    assert!(bare.triangles() < rig.triangles());
}

#[test]
fn arms_share_shapes_only_if_drawn_identically() {
    let Some(file) = menagerie() else { return };
    // The same arm without visuals: simple shapes by default, no shapes if the scene requests those
    // of the file.
    let folder = tempfile::tempdir().unwrap();
    let bare = folder.path().join("bare.xml");
    let text = std::fs::read_to_string(file).unwrap();
    std::fs::write(&bare, text.replace("group=\"2\"", "group=\"3\"")).unwrap();
    let bare = bare.to_str().unwrap();
    let specimen = specimen();
    let cell = Cell::new(&with_model(bare, None), &specimen, 1).unwrap();
    let triangles = |asked: [bool; 2]| {
        let mut scene = with_model(bare, None);
        for (arm, asked) in scene.arms.iter_mut().zip(asked) {
            arm.shapes = asked.then(|| bare.to_owned());
        }
        CameraRig::new(&scene, &specimen, &cell).unwrap().triangles()
    };
    let [neither, left, right, both] = [[false, false], [true, false], [false, true], [true, true]].map(triangles);
    assert_eq!(left, right);
    assert_eq!(neither - left, left - both);
    assert!(neither > left, "{neither} triangles, {left} without one arm");
}

#[test]
fn missing_mesh_and_wrong_arm_give_one_line_errors() {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("arm.xml");
    let arm = |count: usize| {
        let body = |k: usize| {
            format!(
                "<body name='l{k}' pos='0 0 0.1'><inertial pos='0 0 0' mass='1' diaginertia='1 1 1'/><joint name='j{k}' axis='0 0 1'/><geom type='mesh' mesh='part' group='1'/>"
            )
        };
        let bodies: String = (1..=count).map(body).collect();
        format!(
            "<mujoco><asset><mesh name='part' file='part.obj'/></asset><worldbody>{bodies}{}</worldbody></mujoco>",
            "</body>".repeat(count)
        )
    };
    let (specimen, scene) = (specimen(), with_model("franka_fr3", file.to_str()));
    std::fs::write(&file, arm(7)).unwrap();
    let cell = Cell::new(&scene, &specimen, 1).unwrap();
    let refused = |count: usize, words: &[&str]| {
        std::fs::write(&file, arm(count)).unwrap();
        let said = CameraRig::new(&scene, &specimen, &cell).err().unwrap().to_string();
        assert!(words.iter().all(|w| said.contains(w)) && !said.contains('\n'), "{said}");
    };
    refused(7, &["arm 'left'", "link 'l1'", "arm.xml", "part.obj: no such file", "shapes = \"simple\""]);
    std::fs::write(folder.path().join("part.obj"), "v 0 0 0\nv 0.1 0 0\nv 0 0.1 0\nf 1 2 3\n").unwrap();
    refused(3, &["arm 'left'", "arm.xml", "3 links", "the arm has 7"]);
    std::fs::write(&file, arm(7)).unwrap();
    assert!(CameraRig::new(&scene, &specimen, &cell).is_ok());
}

#[test]
fn wall_is_at_the_position_of_the_scene() {
    let specimen = specimen();
    let mut scene = scene();
    let cell = Cell::new(&scene, &specimen, 1).unwrap();
    let bare = CameraRig::new(&scene, &specimen, &cell).unwrap();
    assert!(bare.labels().iter().all(|(_, n)| n != "wall"));
    scene.ports.iter_mut().for_each(|p| p.sheet_diameter_mm = 70.0);
    scene.validate().unwrap();
    let mut rig = CameraRig::new(&scene, &specimen, &cell).unwrap();
    let wall = rig.labels().iter().find(|(_, n)| n == "wall").unwrap().0;
    let port = DVec3::from(scene.ports[0].centre_m);
    let model = Camera::centred(101, 101, 0.6);
    for (name, eye, skin) in [("above", 0.2, true), ("below", -0.1, false)] {
        // Beside the shaft, 25 mm from the hole.
        let target = port + DVec3::new(0.0, 0.025, 0.0);
        rig.add_camera(name, model, Pose::look_at(target + eye * DVec3::Z, target, DVec3::Y));
        let picture = rig.render(&cell, name, [101, 101], &RenderSettings::preview()).unwrap();
        let middle = 50 * 101 + 50;
        assert_eq!(picture.labels[middle], wall, "{name}");
        let depth = f64::from(picture.depth.depth[middle]);
        assert!((depth - f64::from(eye as f32).abs()).abs() < 3e-3, "{name}: {depth} m");
        let [red, green, _] = picture.color.pixels[middle].map(f64::from);
        // Skin is paler than peritoneum.
        assert_eq!(green > 0.65 * red, skin, "{name}: {:?}", picture.color.pixels[middle]);
    }
    // The hole is open: the wall starts below the ring, 5 mm from the edge of the hole.
    for (name, eye) in [("in from above", 0.2), ("in from below", -0.1)] {
        rig.add_camera(name, model, Pose::look_at(port + eye * DVec3::Z, port, DVec3::Y));
        let picture = rig.render(&cell, name, [101, 101], &RenderSettings::preview()).unwrap();
        assert_ne!(picture.labels[50 * 101 + 50], wall, "{name}");
        let (labels, depth) = (picture.labels.clone(), picture.depth.depth.clone());
        let (model, pose) = rig.model(name, [101, 101]).unwrap();
        let shows = (0..labels.len()).filter(|k| labels[*k] == wall);
        let aside = shows.map(|k| {
            let ray = model.ray((k % 101) as f64, (k / 101) as f64);
            let away = pose.transform(ray / ray.z * f64::from(depth[k])) - port;
            away.truncate().length()
        });
        let nearest = aside.reduce(f64::min).unwrap();
        let hole = 0.5e-3 * scene.ports[0].hole_diameter_mm;
        assert!((hole + 0.004..hole + 0.012).contains(&nearest), "{name}: the wall is {nearest} m from the middle");
    }
}
