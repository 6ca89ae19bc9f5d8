//! Phantom D: a small liver, seen from below, with a gallbladder that is folded over its neck.
//!
//! The gallbladder leaves the liver's lower edge, follows it and turns back, so that its fundus
//! lies in front of its neck for an eye that looks towards the liver from the fundus. Its sizes are
//! chosen, not measured: the fundus is slender enough for the jaws of a 5 mm instrument to go round
//! it, and the fold wide enough for a blade and for the view of the recording camera.

use crate::bed::{Bed, BedSpec};
use crate::blend::{Blend, BlendSpec, Part};
use crate::body::Body;
use crate::instruments::{InstrumentMotion, Sweep};
use crate::noise;
use crate::pack::shape;
use crate::spec::{Organ, PhantomSpec, PinRule, Resolution, TissueAppearance};
use crate::tube::Tube;
use glam::{DMat3, DVec3};
use std::f64::consts::PI;

pub(crate) const SPEC: PhantomSpec = PhantomSpec {
    name: "phantom-d",
    organs,
    organ_names: &["liver", "gallbladder"],
    density: 1050.0,
    bed: BedSpec {
        meat: DVec3::new(168.0, 92.0, 78.0),
        film: DVec3::new(204.0, 132.0, 110.0),
        fat: 0.7,
        ..BedSpec::MESENTERY
    },
    reach: InstrumentMotion {
        scale: 1.0,
        sweeps: [
            Sweep {
                port: DVec3::new(-0.30, 0.015, 0.045),
                centre: DVec3::new(-0.026, -0.008, 0.112),
                amplitude: DVec3::new(0.036, 0.038, 0.004),
            },
            Sweep {
                port: DVec3::new(0.30, -0.020, 0.045),
                centre: DVec3::new(0.028, -0.010, 0.112),
                amplitude: DVec3::new(0.036, 0.038, 0.004),
            },
        ],
    },
    resolution: Resolution { surface: 0.6e-3, bed: 0.8e-3 },
    lamp_distance: 0.15,
    occlusion_reach: 12e-3,
};

/// A lobe of the liver: centre, semi-axes (mm), direction in the plane of x and y.
struct Lobe {
    at: (f64, f64),
    radii: (f64, f64, f64),
    heading_deg: f64,
}

/// Four lobes below the central one.
const LOBES: [Lobe; 5] = [
    Lobe { at: (0.0, -36.0), radii: (34.0, 26.0, 14.0), heading_deg: 0.0 },
    Lobe { at: (-40.0, -30.0), radii: (34.0, 18.0, 11.0), heading_deg: 140.0 },
    Lobe { at: (-28.0, -32.0), radii: (26.0, 14.0, 12.0), heading_deg: 108.0 },
    Lobe { at: (36.0, -30.0), radii: (32.0, 19.0, 12.0), heading_deg: 48.0 },
    Lobe { at: (27.0, -31.0), radii: (24.0, 13.0, 13.0), heading_deg: 84.0 },
];
/// Height of the liver's middle above the bed (m). The rest sinks in.
const LIVER_LIFT: f64 = 3e-3;
/// Gap between gallbladder and liver (m).
const FOSSA: f64 = 0.4e-3;

/// Centreline of the gallbladder's base (mm).
const NECK: (f64, f64) = (12.0, -8.5);
/// Organ coordinates between which it turns back.
const TURN: (f64, f64) = (0.31, 0.70);
/// Semi-axis at the neck (mm), and that at the fundus relative to it.
const NECK_RADIUS: f64 = 2.5;
const TAPER: f64 = 2.0;
/// Height of the centreline above the bed relative to the radius, at the neck and at the fundus.
const LIFT: (f64, f64) = (0.6, 1.0);

fn organs(seed: u64, bed: &Bed) -> Vec<Organ> {
    let seeds = [0, 1].map(|index| noise::key(&[seed, 2, index]));
    let gallbladder = gallbladder(seeds[1], bed);
    vec![
        Organ {
            name: "liver",
            body: Body::Blend(liver(seeds[0], bed, gallbladder.clone())),
            young_modulus: 10e3,
            pins: PinRule::Band(0.42),
            look: TissueAppearance::Liver,
            seed: seeds[0],
        },
        Organ {
            name: "gallbladder",
            body: Body::Tube(gallbladder),
            young_modulus: 8e3,
            pins: PinRule::Band(0.066),
            look: TissueAppearance::Gallbladder,
            seed: seeds[1],
        },
    ]
}

/// A number of `seed` to either side of 0.
fn vary(seed: u64, k: u64, by: f64) -> f64 {
    by * (2.0 * noise::unit(noise::key(&[seed, k])) - 1.0)
}

/// The liver, with a groove for `gallbladder` in its lower edge.
fn liver(seed: u64, bed: &Bed, gallbladder: Tube) -> Blend {
    let middle = |x: f64, y: f64| DVec3::new(x * 1e-3, y * 1e-3, bed.smooth_height(x * 1e-3, y * 1e-3) - LIVER_LIFT);
    let parts = LOBES.iter().enumerate().map(|(i, &Lobe { at, radii, heading_deg })| {
        let vary = |k: u64, by: f64| vary(seed, 10 * i as u64 + k, by);
        let wider = |k: u64| 1.0 + vary(k, 0.06);
        Part::Ellipsoid {
            centre: middle(at.0 + vary(0, 3.0), at.1 + vary(1, 1.0)),
            turn: DMat3::from_rotation_z((heading_deg + vary(2, 5.0)).to_radians()),
            radii: DVec3::new(radii.0 * wider(3), radii.1, radii.2 * wider(4)) * 1e-3,
        }
    });
    Blend::new(BlendSpec {
        parts: parts.collect(),
        blend: 4e-3,
        bumps: [(0.9e-3, 20e-3), (0.15e-3, 6e-3)],
        seed: noise::key(&[seed, 90]),
        ends: [middle(36.0, -30.0), middle(-40.0, -30.0)],
        groove: Some((gallbladder, FOSSA)),
        sampling: 2.5e-3,
    })
}

/// The gallbladder: from its neck along the liver's edge, then back in front of the neck.
fn gallbladder(seed: u64, bed: &Bed) -> Tube {
    let vary = |k: u64, by: f64| vary(seed, k, by);
    let length = 64.0 + vary(0, 2.0);
    let shape = shape(length, NECK_RADIUS, NECK_RADIUS, TAPER + vary(1, 0.1), 0.10, (0.02, 20.0), [0.0; 2]);
    let neck = ((NECK.0 + vary(2, 1.5)) * 1e-3, NECK.1 * 1e-3);
    let start = PI + vary(3, 0.07);
    let turned = PI + vary(4, 0.07);
    Tube::wind(
        shape,
        seed,
        neck,
        |s| start - turned * ((s - TURN.0) / (TURN.1 - TURN.0)).clamp(0.0, 1.0),
        |s, x, y| {
            let radius = shape.high * (1.0 + (shape.taper - 1.0) * s) * (1.0 + shape.bulge * libm::sin(PI * s));
            bed.smooth_height(x, y) - (LIFT.0 + (LIFT.1 - LIFT.0) * s) * radius
        },
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use trocar_geometry::SignedDistance;

    /// Of the points of the neck that face `eye`, the share that the part behind the turn hides.
    fn hidden(tube: &Tube, eye: DVec3) -> f64 {
        let (mut facing, mut hidden) = (0, 0);
        for p in tube.samples().into_iter().filter(|p| tube.local(*p).s <= 0.3) {
            let to_eye = (eye - p).normalize();
            if tube.distance(p + 0.5e-3 * to_eye) < 0.2e-3 {
                continue;
            }
            facing += 1;
            let along = (1..160).map(|i| p + 0.25e-3 * f64::from(i) * to_eye);
            hidden += u32::from(along.into_iter().any(|q| tube.distance(q) < 0.0 && tube.local(q).s > 0.5));
        }
        f64::from(hidden) / f64::from(facing.max(1))
    }

    #[test]
    fn the_fundus_hides_the_neck_from_the_front_and_not_from_above() {
        for seed in 0..8 {
            let bed = Bed::new(SPEC.bed, noise::key(&[seed, 1]));
            let tube = gallbladder(noise::key(&[seed, 2, 1]), &bed);
            let (sin, cos) = 20_f64.to_radians().sin_cos();
            let front = tube.base() + 0.085 * DVec3::new(0.0, cos, -sin);
            assert!(hidden(&tube, front) > 0.6, "seed {seed}: {} from the front", hidden(&tube, front));
            assert_eq!(hidden(&tube, DVec3::ZERO), 0.0, "seed {seed}: the recording camera sees the neck");
        }
    }
}
