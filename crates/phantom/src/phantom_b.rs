//! Phantom B: a second rabbit. A mass of bowel loops with a piece of small bowel, the appendix, and
//! the visible parts of cecum and stomach.
//!
//! Volumes of small bowel, bloc and appendix follow from their counts in Table I of the paper and
//! from the nodes and elements per volume and per surface area of phantom A (least squares over its
//! six organs). The two smallest organs are outside that range. They have 0.66 mm³ per element, as
//! has the paper's smallest organ, a stomach of 0.59 cm³.

use crate::bed::{Bed, BedSpec};
use crate::instruments::{InstrumentMotion, Sweep};
use crate::pack::{Coil, Form, OrganPlacement, pack, shape};
use crate::spec::{Organ, PhantomSpec, PinRule, Resolution, TissueAppearance, Vessels};
use glam::DVec3;

pub(crate) const SPEC: PhantomSpec = PhantomSpec {
    name: "phantom-b",
    organs,
    organ_names: &["cecum", "small-bowel", "bowel-bloc", "stomach", "appendix"],
    density: 1050.0,
    bed: BedSpec {
        depth: 0.140,
        meat: DVec3::new(150.0, 62.0, 54.0),
        film: DVec3::new(190.0, 104.0, 84.0),
        fat: 0.8,
        ..BedSpec::MESENTERY
    },
    reach: InstrumentMotion {
        scale: 1.0,
        sweeps: [
            Sweep {
                port: DVec3::new(-0.29, 0.030, 0.050),
                centre: DVec3::new(-0.018, 0.002, 0.110),
                amplitude: DVec3::new(0.034, 0.034, 0.003),
            },
            Sweep {
                port: DVec3::new(0.29, 0.010, 0.050),
                centre: DVec3::new(0.024, 0.000, 0.110),
                amplitude: DVec3::new(0.034, 0.034, 0.003),
            },
        ],
    },
    resolution: Resolution { surface: 0.5e-3, bed: 0.75e-3 },
    lamp_distance: 0.14,
    occlusion_reach: 11e-3,
};

#[rustfmt::skip]
fn organs(seed: u64, bed: &Bed) -> Vec<Organ> {
    let look = |base: [f64; 3], flush: [f64; 3], vessels| TissueAppearance::Bowel { base: base.into(), flush: flush.into(), vessels };
    let band = PinRule::Band(0.21);
    let items = [
        OrganPlacement { name: "bowel-bloc", young_modulus: 20e3, base: (-3.0, -2.0), heading_deg: 14.0, slide_deg: 0.0, pins: band,
               form: Form::Coil(Coil { runs: 4, width: 0.038, radius: 4.33e-3, pitch: 7.25e-3 }),
               look: look([218.0, 142.0, 124.0], [196.0, 104.0, 94.0], Vessels::Rungs) },
        OrganPlacement { name: "small-bowel", young_modulus: 20e3, base: (-28.0, 30.0), heading_deg: 10.0, slide_deg: -82.0, pins: band,
               form: Form::Tube(shape(37.0, 5.6, 5.0, 0.92, 0.0, (0.09, 9.5), [-0.5, 0.7])),
               look: look([212.0, 122.0, 110.0], [188.0, 92.0, 86.0], Vessels::Rungs) },
        OrganPlacement { name: "appendix", young_modulus: 12e3, base: (34.0, -24.0), heading_deg: 50.0, slide_deg: 178.0,
               pins: PinRule::RightEnd,
               form: Form::Tube(shape(48.0, 4.45, 4.45, 0.85, 0.0, (0.04, 9.0), [1.2, 1.5])),
               look: look([234.0, 190.0, 152.0], [216.0, 146.0, 116.0], Vessels::Rungs) },
        OrganPlacement { name: "cecum", young_modulus: 20e3, base: (-34.0, 4.0), heading_deg: -78.0, slide_deg: 8.0, pins: band,
               form: Form::Tube(shape(14.6, 4.25, 3.75, 0.85, 0.10, (0.12, 8.0), [0.3, 0.9])),
               look: look([150.0, 96.0, 84.0], [116.0, 74.0, 64.0], Vessels::Network) },
        OrganPlacement { name: "stomach", young_modulus: 20e3, base: (0.0, -34.0), heading_deg: 16.0, slide_deg: 84.0, pins: band,
               form: Form::Tube(shape(11.0, 3.9, 3.45, 0.75, 0.14, (0.03, 9.0), [0.5, 0.9])),
               look: look([224.0, 176.0, 164.0], [206.0, 144.0, 136.0], Vessels::Network) },
    ];
    pack(items, seed, bed)
}
