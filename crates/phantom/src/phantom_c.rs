//! Phantom C: a pig's liver of 815 cm³, seen from below, with its gallbladder in a fossa.
//!
//! The gallbladder has the 45 cm³ of a pig's. Its count in Table I of the paper does not determine
//! its volume: the paper's meshes have one element per 16 mm³ of liver but one per 0.7 mm³ of a
//! rabbit's organs.

use crate::bed::{Bed, BedSpec};
use crate::blend::{Blend, BlendSpec, Part};
use crate::body::Body;
use crate::instruments::{InstrumentMotion, Sweep};
use crate::noise;
use crate::pack::shape;
use crate::spec::{Organ, PhantomSpec, PinRule, Resolution, TissueAppearance};
use crate::tube::Tube;
use glam::{DMat3, DVec3};
use trocar_geometry::SignedDistance;

/// Volume of the liver in the paper (m³).
pub(crate) const LIVER_VOLUME: f64 = 815e-6;
/// Size of the surroundings relative to a rabbit's.
const SCALE: f64 = 2.6;

pub(crate) const SPEC: PhantomSpec = PhantomSpec {
    name: "phantom-c",
    organs,
    organ_names: &["liver", "gallbladder"],
    density: 1050.0,
    bed: BedSpec {
        depth: 0.410,
        scale: SCALE,
        meat: DVec3::new(168.0, 92.0, 78.0),
        film: DVec3::new(204.0, 132.0, 110.0),
        fat: 0.7,
    },
    reach: InstrumentMotion {
        scale: 2.0,
        sweeps: [
            Sweep {
                port: DVec3::new(-0.78, 0.040, 0.140),
                centre: DVec3::new(-0.062, 0.008, 0.325),
                amplitude: DVec3::new(0.095, 0.096, 0.008),
            },
            Sweep {
                port: DVec3::new(0.78, -0.050, 0.140),
                centre: DVec3::new(0.070, -0.004, 0.325),
                amplitude: DVec3::new(0.095, 0.096, 0.008),
            },
        ],
    },
    resolution: Resolution { surface: 1.0e-3, bed: 2.0e-3 },
    lamp_distance: 0.40,
    occlusion_reach: 30e-3,
};

/// A lobe before scaling: centre, direction in the plane of x and y, semi-axes (mm).
struct Lobe {
    at: (f64, f64),
    heading_deg: f64,
    radii: (f64, f64, f64),
}

/// Four lobes that start at the central lobe on top.
#[rustfmt::skip]
const LOBES: [Lobe; 5] = [
    Lobe { at: (4.0, -26.0), heading_deg: 2.0, radii: (76.0, 35.0, 23.0) },
    Lobe { at: (-74.0, 12.0), heading_deg: 133.0, radii: (68.0, 36.0, 18.0) },
    Lobe { at: (-25.0, 32.0), heading_deg: 103.0, radii: (64.0, 29.0, 20.0) },
    Lobe { at: (40.0, 30.0), heading_deg: 73.0, radii: (64.0, 30.0, 20.0) },
    Lobe { at: (86.0, 4.0), heading_deg: 41.0, radii: (66.0, 38.0, 20.0) },
];
/// Semi-axis of the thickest lobe (mm). A quarter of it sinks into the bed.
const THICKEST_LOBE: f64 = 23.0;
/// Position of the gallbladder's neck before scaling (mm).
const NECK: (f64, f64) = (9.0, -12.0);

/// Gap between gallbladder and liver (m).
const FOSSA: f64 = 0.4e-3;

fn organs(seed: u64, bed: &Bed) -> Vec<Organ> {
    let seeds = [0, 1].map(|index| noise::key(&[seed, 2, index]));
    let mut scale = 1.0;
    // Bumps and fossa do not scale with the parts, so the scale takes a few iterations.
    for _ in 0..3 {
        let gallbladder = gallbladder(seeds[1], scale, &liver(seeds[0], scale, bed, None), bed);
        let carved = Body::Blend(liver(seeds[0], scale, bed, Some(gallbladder)));
        scale *= libm::cbrt(LIVER_VOLUME / carved.volume(4e-3));
    }
    let gallbladder = gallbladder(seeds[1], scale, &liver(seeds[0], scale, bed, None), bed);
    let liver = liver(seeds[0], scale, bed, Some(gallbladder.clone()));
    let pins = PinRule::Band(0.066);
    vec![
        Organ {
            name: "liver",
            body: Body::Blend(liver),
            young_modulus: 10e3,
            pins,
            look: TissueAppearance::Liver,
            seed: seeds[0],
        },
        Organ {
            name: "gallbladder",
            body: Body::Tube(gallbladder),
            young_modulus: 5e3,
            pins,
            look: TissueAppearance::Gallbladder,
            seed: seeds[1],
        },
    ]
}

/// The liver at `scale`, with a fossa for `gallbladder`.
fn liver(seed: u64, scale: f64, bed: &Bed, gallbladder: Option<Tube>) -> Blend {
    let vary = |k: u64, by: f64| by * (2.0 * noise::unit(noise::key(&[seed, k])) - 1.0);
    let mm = scale * 1e-3;
    let middle = bed.smooth_height(0.0, 0.0) - 0.75 * THICKEST_LOBE * mm;
    let parts = LOBES.iter().enumerate().map(|(i, lobe)| {
        let k = 10 * i as u64;
        let at = DVec3::new(lobe.at.0 + vary(k, 4.0), lobe.at.1 + vary(k + 1, 4.0), 0.0) * mm;
        let radii = DVec3::new(
            lobe.radii.0 * (1.0 + vary(k + 2, 0.07)),
            lobe.radii.1 * (1.0 + vary(k + 3, 0.07)),
            lobe.radii.2 * (1.0 + vary(k + 4, 0.06)),
        ) * mm;
        let heading = (lobe.heading_deg + vary(k + 5, 6.0)).to_radians();
        // Lobes droop outwards and lean slightly, so that they overlap.
        let (droop, lean) = (0.10 + vary(k + 6, 0.04), vary(k + 7, 0.07));
        let turn = DMat3::from_rotation_z(heading) * DMat3::from_rotation_y(-droop) * DMat3::from_rotation_x(lean);
        Part::Ellipsoid { centre: at.with_z(middle), turn, radii }
    });
    Blend::new(BlendSpec {
        parts: parts.collect(),
        blend: 9.0 * mm,
        bumps: [(2.2e-3, 40e-3), (0.25e-3, 9e-3)],
        seed: noise::key(&[seed, 90]),
        ends: [DVec3::new(-30.0, -30.0, 0.0), DVec3::new(-100.0, 45.0, 0.0)].map(|p| (p * mm).with_z(middle)),
        groove: gallbladder.map(|tube| (tube, FOSSA)),
        sampling: 5e-3,
    })
}

/// The gallbladder: half sunk into the liver's face at its neck, with its fundus beyond the liver's
/// edge.
fn gallbladder(seed: u64, scale: f64, liver: &Blend, bed: &Bed) -> Tube {
    let vary = |k: u64, by: f64| by * (2.0 * noise::unit(noise::key(&[seed, k])) - 1.0);
    let shape = shape(76.0, 6.4, 6.1, 2.2, 0.34, (0.02, 30.0), [0.35 + vary(0, 0.1), -0.5 + vary(1, 0.1)]);
    let neck = (NECK.0 * scale * 1e-3, NECK.1 * scale * 1e-3);
    let heading = (84.0 + vary(2, 4.0)).to_radians();
    let (sin, cos) = libm::sincos(heading);
    let start = face(liver, neck.0, neck.1, bed) + 1.5e-3;
    let end = bed.smooth_height(neck.0 + shape.length * cos, neck.1 + shape.length * sin) - 20e-3;
    Tube::lay(shape, seed, neck, heading, |x, y| {
        let along = ((x - neck.0) * cos + (y - neck.1) * sin) / shape.length;
        start + (end - start) * along.clamp(0.0, 1.0).powi(2)
    })
}

/// Depth of the liver's face at (x, y) (m), or of the bed beside the liver.
fn face(liver: &Blend, x: f64, y: f64, bed: &Bed) -> f64 {
    let floor = bed.smooth_height(x, y);
    let mut z = floor - 0.15;
    for _ in 0..200 {
        let d = liver.distance(DVec3::new(x, y, z));
        if d < 1e-5 || z > floor {
            break;
        }
        z += d.max(1e-5);
    }
    z.min(floor)
}
