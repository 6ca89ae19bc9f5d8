//! The built-in scenes are whole, come back from their canonical form, and know the phantoms.
#![allow(clippy::unwrap_used, reason = "tests")]

use trocar_phantom::RecordOptions;
use trocar_scene::{BUILTINS, CollisionMesh, PHANTOMS, RenderMesh, Scene, SpecimenSource, Surfaces, Variation};

#[test]
fn cell_a_writes_out_the_defaults() {
    let cell = Scene::builtin("cell-a").unwrap();
    let plain = Scene::new("cell-a", SpecimenSource::phantom("phantom-a", 1));
    assert_eq!(cell.variation, Variation::starts());
    let (organs, description, variation) = (cell.organs.clone(), cell.description.clone(), cell.variation.clone());
    let said = Scene { organs, description, variation, ..plain };
    assert_eq!(cell, said, "a default differs from what cell-a says of it");
    assert_eq!(cell.organs.len(), 6);
}

#[test]
fn every_scene_comes_back_from_its_canonical_form() {
    for builtin in BUILTINS {
        let scene = Scene::builtin(builtin.name).unwrap();
        assert_eq!(scene.name, builtin.name);
        let text = scene.to_toml().unwrap();
        let again = Scene::parse(&text, "canonical", "".as_ref()).unwrap();
        assert_eq!(again, scene);
        assert_eq!(again.to_toml().unwrap(), text);
        assert_eq!(Scene::read(builtin.name).unwrap(), scene);
        scene.validate().unwrap();
    }
}

/// What is said of surfaces comes back, and a scene that says nothing is written as before.
#[test]
fn surfaces_come_back_from_the_canonical_form() {
    let minimal = "name = 'a'\n[specimen]\nphantom = 'phantom-a'\n";
    let plain = Scene::parse(minimal, "a", "".as_ref()).unwrap();
    assert!(!plain.to_toml().unwrap().contains("surfaces"));
    for (said, collision, render) in [
        ("collision = 'elements'\nrender = 'skin'", CollisionMesh::Elements, RenderMesh::Skin),
        ("collision = { edge_mm = 3 }", CollisionMesh::EdgeMm(3.0), RenderMesh::Skin),
        ("collision = { edge_mm = 3.5 }\nrender = 'collision'", CollisionMesh::EdgeMm(3.5), RenderMesh::Collision),
        ("render = 'elements'", CollisionMesh::Elements, RenderMesh::Elements),
    ] {
        let scene = Scene::parse(&format!("{minimal}[organ.cecum.surfaces]\n{said}"), "a", "".as_ref()).unwrap();
        assert_eq!(scene.organs["cecum"].surfaces, Surfaces { collision, render });
        let canonical = scene.to_toml().unwrap();
        assert_eq!(Scene::parse(&canonical, "a", "".as_ref()).unwrap(), scene, "{canonical}");
    }
}

#[test]
fn a_minimal_scene_is_three_lines() {
    let text = "name = 'mine'\n[specimen]\nphantom = 'phantom-b'";
    let scene = Scene::parse(text, "mine.toml", "".as_ref()).unwrap();
    assert_eq!(scene, Scene::new("mine", SpecimenSource::phantom("phantom-b", 1)));
}

#[test]
fn the_papers_clearances() {
    let scene = Scene::builtin("cell-a").unwrap();
    let mut clearances = Vec::new();
    for tool in scene.tools() {
        let (arm, instrument) = (tool.arm, tool.instrument);
        let Some(port) = tool.port else { panic!("{} has no port", arm.name.name()) };
        let cos = arm.start.tilt_deg.to_radians().cos();
        clearances.push(0.5 * (port.hole_diameter_mm - instrument.shaft_diameter_mm / cos));
        let limit = port.tilt_limit(instrument.shaft_diameter_mm).unwrap().to_degrees();
        assert!((limit - 33.557).abs() < 1e-3, "{limit}");
        // The tilt is the angle between shaft and normal, and both tips lean inwards.
        let direction = arm.start.direction(port);
        assert!((-direction.z - cos).abs() < 1e-12);
        assert!(direction.x * port.centre_m[0] < 0.0);
    }
    assert!((clearances[0] - 0.43).abs() < 0.005 && (clearances[1] - 0.37).abs() < 0.005, "{clearances:?}");
    let middle = 0.5 * (scene.ports[0].centre_m[1] + scene.ports[1].centre_m[1]);
    assert_eq!(middle, 0.46);
}

#[test]
fn the_endoscope_is_the_towers() {
    let scene = Scene::builtin("cell-a").unwrap();
    let endoscope = &scene.cameras[0];
    let camera = endoscope.model(None).unwrap();
    let (left, top) = (camera.ray(-0.5, camera.cy), camera.ray(camera.cx, -0.5));
    assert!((2.0 * (-left.x).atan().to_degrees() - 86.2).abs() < 1e-9);
    assert!((2.0 * (-top.y).atan().to_degrees() - 54.6).abs() < 1e-9);
    let (shaft, view) = (endoscope.shaft(&scene.placement), endoscope.view.pose(&scene.placement));
    let (along, ahead) = (shaft.rotation * glam::DVec3::Z, view.rotation * glam::DVec3::Z);
    assert!((along.dot(ahead).acos().to_degrees() - 30.0).abs() < 1e-9);
    assert!(along.dot(view.rotation * glam::DVec3::Y) < 0.0, "the picture looks below the shaft");
    assert!(scene.cameras[2].model(None).is_none(), "the recording's lens is the specimen's");
    assert!(scene.cameras[2].model(Some(&camera)) == Some(camera));
}

#[test]
fn the_hash_knows_what_counts() {
    let scene = Scene::builtin("cell-a").unwrap();
    let hash = scene.hash(&[1]).unwrap();
    assert_eq!(Scene::builtin("cell-a").unwrap().hash(&[1]).unwrap(), hash);
    assert_ne!(scene.hash(&[2]).unwrap(), hash);
    assert_eq!(Scene { description: "other words".into(), ..scene.clone() }.hash(&[1]).unwrap(), hash);
    let mut other = scene.clone();
    other.ports[0].hole_diameter_mm += 1e-9;
    assert_ne!(other.hash(&[1]).unwrap(), hash);
    let at = |path: &str| Scene { specimen: SpecimenSource::folder(path), ..scene.clone() }.hash(&[1]).unwrap();
    assert_eq!(at("a"), at("b/c"));
    assert_ne!(at("a"), hash);
}

#[test]
fn phantoms_are_those_that_can_be_filmed() {
    assert_eq!(PHANTOMS.map(|p| p.name), trocar_phantom::NAMES);
    for phantom in PHANTOMS {
        let info = trocar_phantom::describe(phantom.name, &RecordOptions::default()).unwrap();
        let organs: Vec<&str> = info.organs.iter().map(|o| o.name.as_str()).collect();
        assert_eq!(organs, phantom.organs);
    }
}

#[test]
fn the_example_of_the_page_is_a_scene() {
    let page = include_str!("../../../docs/guides/scenes.md");
    let example = page.split("```toml\n").nth(1).unwrap().split("```").next().unwrap();
    let text = example.replace("path = \"../specimens/rabbit\"", "phantom = \"phantom-a\"");
    let scene = Scene::parse(&text, "example", "".as_ref()).unwrap();
    assert_eq!(scene.ports[0].hole_diameter_mm, 8.0);
}
