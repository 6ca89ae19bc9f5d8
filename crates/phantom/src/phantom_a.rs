//! Phantom A: a rabbit's cecum, three bowel segments, stomach and appendix.

use crate::bed::{Bed, BedSpec};
use crate::instruments::{InstrumentMotion, Sweep};
use crate::pack::{Form, OrganPlacement, pack, shape};
use crate::spec::{Organ, PhantomSpec, PinRule, Resolution, TissueAppearance, Vessels};
use glam::DVec3;

pub(crate) const SPEC: PhantomSpec = PhantomSpec {
    name: "phantom-a",
    organs,
    organ_names: &["cecum", "bowel-1", "bowel-2", "bowel-3", "stomach", "appendix"],
    density: 1200.0,
    bed: BedSpec::MESENTERY,
    reach: InstrumentMotion {
        scale: 1.0,
        sweeps: [
            Sweep {
                port: DVec3::new(-0.30, 0.015, 0.055),
                centre: DVec3::new(-0.022, 0.004, 0.168),
                amplitude: DVec3::new(0.034, 0.036, 0.005),
            },
            Sweep {
                port: DVec3::new(0.30, -0.020, 0.055),
                centre: DVec3::new(0.030, -0.002, 0.168),
                amplitude: DVec3::new(0.032, 0.036, 0.005),
            },
        ],
    },
    resolution: Resolution { surface: 0.6e-3, bed: 0.8e-3 },
    lamp_distance: 0.15,
    occlusion_reach: 12e-3,
};

/// Sizes give about the mesh sizes of Table I of the paper at 1.5 mm voxels.
#[rustfmt::skip]
fn organs(seed: u64, bed: &Bed) -> Vec<Organ> {
    let look = |base: [f64; 3], flush: [f64; 3], vessels| TissueAppearance::Bowel { base: base.into(), flush: flush.into(), vessels };
    let band = PinRule::Band(0.42);
    let items = [
        OrganPlacement { name: "cecum", young_modulus: 30e3, base: (-34.0, -20.0), heading_deg: -24.0, slide_deg: 0.0, pins: band,
               form: Form::Tube(shape(69.88, 8.235, 7.02, 0.80, 0.02, (0.15, 11.0), [0.2, 1.8])),
               look: look([158.0, 92.0, 88.0], [120.0, 70.0, 66.0], Vessels::Network) },
        OrganPlacement { name: "bowel-1", young_modulus: 30e3, base: (-33.0, 0.0), heading_deg: -16.0, slide_deg: -90.0, pins: band,
               form: Form::Tube(shape(59.16, 6.0, 4.92, 0.95, 0.0, (0.09, 10.0), [-0.6, 2.0])),
               look: look([214.0, 134.0, 120.0], [196.0, 100.0, 92.0], Vessels::Rungs) },
        OrganPlacement { name: "bowel-3", young_modulus: 15e3, base: (-30.0, 20.0), heading_deg: -18.0, slide_deg: -84.0, pins: band,
               form: Form::Tube(shape(51.34, 5.52, 4.6, 0.95, 0.0, (0.09, 9.0), [0.0, 1.3])),
               look: look([222.0, 152.0, 134.0], [206.0, 120.0, 106.0], Vessels::Rungs) },
        OrganPlacement { name: "appendix", young_modulus: 12e3, base: (44.0, -4.0), heading_deg: 78.0, slide_deg: 205.0,
               pins: PinRule::RightEnd,
               form: Form::Tube(shape(84.79, 4.55, 4.55, 0.85, 0.0, (0.04, 9.0), [2.9, 2.1])),
               look: look([236.0, 196.0, 146.0], [220.0, 150.0, 112.0], Vessels::Rungs) },
        OrganPlacement { name: "stomach", young_modulus: 30e3, base: (-48.0, -14.0), heading_deg: 84.0, slide_deg: 0.0, pins: band,
               form: Form::Tube(shape(29.24, 5.98, 4.68, 0.70, 0.14, (0.03, 12.0), [-0.9, -0.5])),
               look: look([226.0, 172.0, 156.0], [208.0, 138.0, 128.0], Vessels::Network) },
        OrganPlacement { name: "bowel-2", young_modulus: 15e3, base: (-4.0, -40.0), heading_deg: -6.0, slide_deg: 96.0, pins: band,
               form: Form::Tube(shape(20.78, 5.125, 4.5, 0.95, 0.0, (0.08, 9.0), [0.4, 0.4])),
               look: look([206.0, 112.0, 104.0], [184.0, 84.0, 80.0], Vessels::Rungs) },
    ];
    pack(items, seed, bed)
}
