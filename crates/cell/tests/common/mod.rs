//! A small analytic tube as a specimen.

#![allow(clippy::unwrap_used, reason = "helpers of tests may panic")]
#![allow(dead_code, reason = "not every test uses all of it")]

use glam::DVec3;
use trocar_geometry::{LatticeMesher, SignedDistance, TetQuality};
use trocar_specimen::{End, Material, Organ, OrganFacts, Pins, Provenance, Specimen};

/// A tube along x, 60 mm long and 9 mm thick: about the appendix.
struct Tube;

pub const RADIUS: f64 = 0.0045;
pub const HALF_LENGTH: f64 = 0.030;

impl SignedDistance for Tube {
    fn distance(&self, p: DVec3) -> f64 {
        (p - DVec3::X * p.x.clamp(RADIUS - HALF_LENGTH, HALF_LENGTH - RADIUS)).length() - RADIUS
    }
}

pub const ONE_END: Pins = Pins::End { end: End::Base, length: 0.15, band_length: 0.0, band_share: 0.0 };

/// The tube as a specimen under a camera that looks straight down.
pub fn specimen(pins: Pins) -> Specimen {
    let half = DVec3::new(HALF_LENGTH, RADIUS, RADIUS);
    let body = LatticeMesher::uniform(2.2e-3).mesh_shape(&Tube, (-half, half)).unwrap();
    let quality = TetQuality::of(&body);
    let surface = body.boundary().0;
    Specimen {
        name: "tube".into(),
        up: -DVec3::Z,
        placement: trocar_geometry::Pose::IDENTITY,
        camera: None,
        organs: vec![Organ {
            name: "tube".into(),
            surface,
            material: Material::default(),
            pins,
            base: -HALF_LENGTH * DVec3::X,
            facts: OrganFacts { nodes: body.vertices.len(), inverted: quality.inverted, ..OrganFacts::default() },
            body,
        }],
        background: None,
        provenance: Provenance::default(),
    }
}
