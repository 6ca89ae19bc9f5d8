//! Surfaces of organs that the scene chooses: what touches, what jaws take, what stops an
//! instrument, and what pictures show.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]
#![allow(clippy::print_stdout, reason = "what was measured, for those who ask with --nocapture")]

mod common;

use common::{close, shift};
use glam::DVec3;
use trocar_cell::{Cell, Gripper, JawRegion, MAX_ANGLE, Placed, Surroundings, World};
use trocar_geometry::TriMesh;
use trocar_geometry::io::write_ply;
use trocar_scene::{Arm, BackendName, CollisionMesh, RenderMesh, Scene, Side, Surfaces};
use trocar_specimen::{Pins, Specimen};
use trocar_testing::tube::{ONE_END, RADIUS, meshed, scene, specimen};
use trocar_tissue::SolverSettings;

/// Height of the middle of the tube, which lies on its bed (m).
const TUBE_HEIGHT: f64 = 0.045;
/// Distance of the blades' tips from the tip frame (m).
const BLADE: f64 = 0.021;

/// A scene of the tube with one free ideal arm above it, whose organ has these `surfaces`.
fn above(surfaces: Surfaces, backend: BackendName) -> Scene {
    let mut scene: Scene = scene();
    scene.task.organ = "tube".to_owned();
    scene.tissue = scene.tissue.on(backend);
    scene.arms = vec![Arm::free(Side::Left, "grasper", [0.0, 0.46, TUBE_HEIGHT + BLADE + 0.015])];
    scene.instruments.truncate(1);
    scene.safety.rules.force_guard = false;
    scene.organs.entry("tube".to_owned()).or_default().surfaces = surfaces;
    scene
}

fn touching(collision: CollisionMesh) -> Surfaces {
    Surfaces { collision, ..Surfaces::default() }
}

fn closed(scene: &Scene, specimen: &Specimen) -> Cell {
    let mut cell = Cell::new(scene, specimen, 1).unwrap();
    close(&mut cell, 30);
    cell
}

/// A mesh with its distance from the axis of the tube times `factor`, in the tube's own frame.
fn thicker(mesh: &TriMesh, factor: f64) -> TriMesh {
    let scaled = |p: &DVec3| DVec3::new(p.x, factor * p.y, factor * p.z);
    TriMesh { vertices: mesh.vertices.iter().map(scaled).collect(), ..mesh.clone() }
}

/// Writes a mesh; the scene names it by its whole path.
fn file(dir: &tempfile::TempDir, mesh: &TriMesh) -> String {
    let path = dir.path().join("organ.ply");
    write_ply(&path, mesh).unwrap();
    path.display().to_string()
}

/// The force of tissue while the blades press the tube by a millimetre, on both backends with the
/// boundary of its elements, and with coarser and finer surfaces.
#[test]
fn an_instrument_meets_the_surface_that_the_scene_chooses() {
    for backend in BackendName::ALL {
        let press = |collision: CollisionMesh| {
            let own = collision != CollisionMesh::Elements;
            let mut cell = closed(&above(touching(collision), backend), &specimen(ONE_END));
            assert_eq!(cell.world().model.bodies()[0].collision_surface().is_some(), own);
            shift(&mut cell, "left", DVec3::Z * -0.013, 40);
            let still = shift(&mut cell, "left", DVec3::ZERO, 10);
            assert_eq!(still.iter().map(|r| r.rules.pierced + r.rules.punctures).sum::<usize>(), 0);
            assert_eq!(cell.axes_inside(), [false]);
            // A saved cell goes on with the same bits.
            let saved = cell.save();
            shift(&mut cell, "left", DVec3::Z * -0.0005, 5);
            let hash = cell.hash();
            cell.restore(&saved).unwrap();
            shift(&mut cell, "left", DVec3::Z * -0.0005, 5);
            assert_eq!(cell.hash(), hash, "{backend:?}");
            still[9].arms[0].contact.length()
        };
        let plain = press(CollisionMesh::Elements);
        // Coarse triangles of a thin tube are stiffer under a blade, as coarse elements are.
        for (edge, most) in [(1.2, 0.1), (3.0, 0.3)] {
            let force = press(CollisionMesh::EdgeMm(edge));
            println!("{backend:?}: {plain:.3} N, {force:.3} N with triangles of {edge} mm");
            assert!(plain > 0.05 && (force / plain - 1.0).abs() < most, "{backend:?}, {edge} mm: {force} N, {plain} N");
        }
    }
}

#[test]
fn an_instrument_that_comes_through_a_surface_of_its_own_punctures_the_organ() {
    let mut scene = above(touching(CollisionMesh::EdgeMm(3.0)), BackendName::Tetrahedra);
    scene.safety.puncture_force_n = 10.0;
    let mut cell = closed(&scene, &meshed(ONE_END, 2.2e-3));
    let down = shift(&mut cell, "left", DVec3::Z * -0.026, 10);
    assert_eq!(down.iter().map(|r| r.rules.punctures).sum::<usize>(), 1);
    assert_eq!((cell.punctured_by(0), cell.axes_inside()), (vec![0], vec![false]));
    let out = shift(&mut cell, "left", DVec3::Z * 0.03, 60);
    assert!(cell.punctured_by(0).is_empty());
    assert_eq!(out[55..].iter().map(|r| r.arms[0].contact.length()).fold(0.0, f64::max), 0.0);
}

/// Jaws beside the elements, in a surface that is thicker by a third, take hold of it.
#[test]
fn jaws_take_what_they_touch() {
    let specimen = specimen(ONE_END);
    let world = |factor: Option<f64>| {
        let surface = factor.map(|factor| thicker(&specimen.organs[0].surface, factor));
        let surroundings = Surroundings { collision: vec![surface], ..Surroundings::default() };
        World::surrounded(&specimen, &surroundings, Vec::new(), SolverSettings::default(), 1).unwrap()
    };
    let jaws = |aside: f64| {
        let mut gripper = Gripper::over(DVec3::ZERO, -DVec3::Z, DVec3::X, MAX_ANGLE);
        gripper.pose.translation += gripper.pose.rotation * (aside * DVec3::Y);
        JawRegion::of(&gripper)
    };
    let (plain, thick) = (world(None), world(Some(1.3)));
    let beside = jaws(RADIUS + 0.0005);
    assert!(beside.tissue_of(&plain, 0).is_none());
    let tissue = beside.tissue_of(&thick, 0).unwrap();
    assert!(tissue.centroid.x.abs() < 1e-3 && tissue.volume > 0.0, "{tissue:?}");
    assert!(jaws(1.3 * RADIUS + 0.0005).tissue_of(&thick, 0).is_none());
    let [few, more] = [&plain, &thick].map(|world| beside.nodes_of(world, 0).len());
    assert!(more > few, "{few} and {more} nodes");
}

/// Tissue that cannot move stops an instrument at its collision surface.
#[test]
fn pinned_tissue_stops_an_instrument_at_the_chosen_surface() {
    let dir = tempfile::tempdir().unwrap();
    let pinned = specimen(Pins::Band { share: 1.0 });
    let path = file(&dir, &thicker(&pinned.organs[0].surface, 1.3));
    let lowest = |collision: CollisionMesh| {
        let mut cell = closed(&above(touching(collision), BackendName::Tetrahedra), &pinned);
        shift(&mut cell, "left", DVec3::Z * -0.02, 60);
        cell.measured_cp("left").unwrap().translation.z
    };
    let (plain, thick) = (lowest(CollisionMesh::Elements), lowest(CollisionMesh::File(path)));
    let off = thick - plain;
    println!("{:.2} mm higher", 1e3 * off);
    assert!((off - 0.3 * RADIUS).abs() < 0.3e-3, "{off} m");
}

#[test]
fn pictures_show_the_surface_that_the_scene_chooses() {
    let dir = tempfile::tempdir().unwrap();
    let mut specimen = specimen(ONE_END);
    let organ = &mut specimen.organs[0];
    organ.surface.colors = organ.surface.vertices.iter().map(|p| [(p.x > 0.0) as u8 * 200, 90, 80]).collect();
    let mut painted = thicker(&organ.surface, 1.1);
    painted.colors.fill([1, 2, 3]);
    let path = file(&dir, &painted);
    let shown = |collision: CollisionMesh, render: RenderMesh| {
        let scene = above(Surfaces { collision, render }, BackendName::Tetrahedra);
        let placed = Placed::new(&scene, &specimen).unwrap();
        placed.specimen.organs[0].surface.clone()
    };
    let skin = shown(CollisionMesh::EdgeMm(3.0), RenderMesh::Skin);
    assert_eq!(skin.triangles, specimen.organs[0].surface.triangles);
    let elements = shown(CollisionMesh::EdgeMm(3.0), RenderMesh::Elements);
    assert_eq!(elements.triangles, specimen.organs[0].body.boundary().0.triangles);
    let coarse = shown(CollisionMesh::EdgeMm(3.0), RenderMesh::Collision);
    assert!(coarse.triangles.len() < elements.triangles.len() && coarse.colors.len() == coarse.vertices.len());
    assert!(coarse.colors.contains(&[200, 90, 80]) && coarse.colors.contains(&[0, 90, 80]));
    assert_eq!(shown(CollisionMesh::Elements, RenderMesh::Collision).triangles, elements.triangles);
    let from_file = shown(CollisionMesh::Elements, RenderMesh::File(path));
    assert!(from_file.triangles == painted.triangles && from_file.colors == painted.colors);
}

#[test]
fn meshes_that_do_not_fit_are_refused_with_the_field() {
    let dir = tempfile::tempdir().unwrap();
    let specimen = specimen(ONE_END);
    let good = &specimen.organs[0].surface;
    let said = |surfaces: Surfaces| {
        Cell::new(&above(surfaces, BackendName::Lattice), &specimen, 1).map(|_| ()).unwrap_err().to_string()
    };
    let far = TriMesh { vertices: good.vertices.iter().map(|p| *p + DVec3::Y * 0.2).collect(), ..good.clone() };
    let path = file(&dir, &far);
    let text = said(touching(CollisionMesh::File(path.clone())));
    assert!(text.contains("body 'tube': its collision surface has vertex 0 1"), "{text}");
    let text = said(Surfaces { render: RenderMesh::File(path.clone()), ..Surfaces::default() });
    assert!(text.contains("organ.tube.surfaces.render has vertex 0 1"), "{text}");
    let text = said(touching(CollisionMesh::EdgeMm(40.0)));
    assert!(text.contains("organ.tube.surfaces.collision.edge_mm is 40: ") && text.contains("shorter edge"), "{text}");
    std::fs::write(&path, "ply\nformat ascii 1.0\nend_header\n").unwrap();
    let text = said(touching(CollisionMesh::File(path)));
    assert!(text.contains("organ.tube.surfaces.collision.file is unusable: "), "{text}");
}
