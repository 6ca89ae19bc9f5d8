//! A small analytic tube as a specimen.

#![allow(clippy::unwrap_used, clippy::missing_panics_doc, reason = "helpers of tests may panic")]

use glam::DVec3;
use std::path::{Path, PathBuf};
use trocar_geometry::{LatticeMesher, SignedDistance, TetQuality};
use trocar_scene::{Scene, SpecimenSource, TaskName, Variation};
use trocar_specimen::{End, Material, Organ, OrganFacts, Pins, Provenance, Specimen};

/// A tube along x, 60 mm long and 9 mm thick: about the appendix.
struct Tube;

/// Its radius (m).
pub const RADIUS: f64 = 0.0045;
/// Half its length (m).
pub const HALF_LENGTH: f64 = 0.030;

impl SignedDistance for Tube {
    fn distance(&self, p: DVec3) -> f64 {
        (p - DVec3::X * p.x.clamp(RADIUS - HALF_LENGTH, HALF_LENGTH - RADIUS)).length() - RADIUS
    }
}

/// Pins of one end.
pub const ONE_END: Pins = Pins::End { end: End::Base, length: 0.15, band_length: 0.0, band_share: 0.0 };

/// The tube as a specimen under a camera that looks straight down.
pub fn specimen(pins: Pins) -> Specimen {
    meshed(pins, 2.2e-3)
}

/// The same in elements of edge `edge` (m).
pub fn meshed(pins: Pins, edge: f64) -> Specimen {
    let half = DVec3::new(HALF_LENGTH, RADIUS, RADIUS);
    let body = LatticeMesher::uniform(edge).mesh_shape(&Tube, (-half, half)).unwrap();
    let quality = TetQuality::of(&body);
    let surface = body.boundary().0;
    Specimen {
        name: "tube".into(),
        up: -DVec3::Z,
        placement: trocar_core::Pose::IDENTITY,
        camera: None,
        organs: vec![Organ {
            name: "tube".into(),
            surface,
            material: Material::default(),
            pins,
            base: -HALF_LENGTH * DVec3::X,
            threads: None,
            posterior: None,
            facts: OrganFacts { nodes: body.vertices.len(), inverted: quality.inverted, ..OrganFacts::default() },
            body,
        }],
        background: None,
        provenance: Provenance::default(),
    }
}

/// The tube in elements of edge `edge` (m), and a second one, 25 mm beside it and 12 mm lower,
/// which keeps the cell's floor away from the first.
pub fn two_tubes(pins: Pins, edge: f64) -> Specimen {
    let mut both = meshed(pins, edge);
    let mut low = meshed(Pins::Band { share: 0.42 }, 4e-3).organs.remove(0);
    let by = DVec3::new(0.0, 0.025, 0.012);
    low.name = "low".into();
    low.body.vertices.iter_mut().chain(&mut low.surface.vertices).for_each(|p| *p += by);
    low.base += by;
    both.organs.push(low);
    both
}

/// The paper's cell with the tube along x below the middle between the ports.
pub fn scene() -> Scene {
    let mut scene = Scene::new("tube-cell", SpecimenSource::phantom("phantom-a", 1));
    scene.placement.position_m = [0.0, 0.46, 0.045];
    scene
}

/// A resection of the tube: pinned at its base, no start varied but by the scene's variation.
pub fn resection() -> Scene {
    let mut scene = scene();
    scene.task.organ = "tube".to_owned();
    scene.task.episode_s = 20.0;
    scene.variation = Variation::starts();
    scene
}

/// Writes coarse tubes into `folder`, and the scene file `name` of them, in which arms reach for
/// `seconds` before these cameras.
pub fn reach(folder: &Path, name: &str, seconds: f64, cameras: &[&str]) -> PathBuf {
    let specimen = folder.join("tube");
    if !specimen.exists() {
        two_tubes(ONE_END, 4e-3).write(&specimen).unwrap();
    }
    let mut scene = resection();
    scene.specimen = SpecimenSource::folder("tube");
    scene.task.name = TaskName::PortReach;
    scene.task.episode_s = seconds;
    scene.cameras.retain(|c| cameras.contains(&c.name.as_str()));
    let file = folder.join(name);
    std::fs::write(&file, scene.to_toml().unwrap()).unwrap();
    file
}
