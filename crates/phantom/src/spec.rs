//! Specification of a phantom: organs with their positions, bed, lamp, and motion of the
//! instruments.

use crate::bed::{Bed, BedSpec};
use crate::body::Body;
use crate::instruments::InstrumentMotion;
use glam::DVec3;
use trocar_specimen::{End, Material, Pins};

/// A phantom. Each phantom is a file with one constant of this type.
pub(crate) struct PhantomSpec {
    pub name: &'static str,
    /// Places the organs for a seed on a bed without imprints.
    pub organs: fn(u64, &Bed) -> Vec<Organ>,
    /// Names of the organs in the order of the paper, which is the order of the recording.
    pub organ_names: &'static [&'static str],
    /// Density of the organs (kg/m³).
    pub density: f64,
    pub bed: BedSpec,
    pub reach: InstrumentMotion,
    pub resolution: Resolution,
    /// Distance at which the lamp has brightness 1 (m).
    pub lamp_distance: f32,
    /// Reach of the ambient occlusion that darkens creases (m).
    pub occlusion_reach: f64,
}

/// Resolution of the organs' surfaces and of the bed (m).
#[derive(Clone, Copy)]
pub(crate) struct Resolution {
    pub surface: f64,
    pub bed: f64,
}

/// A placed organ.
pub(crate) struct Organ {
    pub name: &'static str,
    pub body: Body,
    pub young_modulus: f64,
    pub pins: PinRule,
    pub look: TissueAppearance,
    pub seed: u64,
}

/// Rule for the pinned nodes, independent of the organ's position.
#[derive(Clone, Copy)]
pub(crate) enum PinRule {
    /// The lowest share of the nodes.
    Band(f64),
    /// The left arm grasps: the right end is pinned, and most of the 30% next to it.
    RightEnd,
}

/// Colours of an organ.
#[derive(Clone, Copy)]
pub(crate) enum TissueAppearance {
    /// Two tones in patches, and vessels.
    Bowel { base: DVec3, flush: DVec3, vessels: Vessels },
    /// Dark and smooth, with lobules.
    Liver,
    /// Green, with branching vessels.
    Gallbladder,
}

/// Course of the vessels.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Vessels {
    /// A branching network.
    Network,
    /// From the mesentery up around the wall.
    Rungs,
}

impl Organ {
    /// Material of the organ in the paper.
    pub fn material(&self, spec: &PhantomSpec) -> Material {
        Material { young_modulus_pa: self.young_modulus, density_kg_m3: spec.density, ..Material::default() }
    }

    /// Pinned nodes of the organ in the paper.
    pub fn pins(&self) -> Pins {
        match self.pins {
            PinRule::Band(share) => Pins::Band { share },
            PinRule::RightEnd => {
                // 0.14 + 0.30 * 0.93 = 0.42 of the length; the free part starts before the middle.
                let end = if self.body.base().x > self.body.tip().x { End::Base } else { End::Tip };
                Pins::End { end, length: 0.14, band_length: 0.30, band_share: 0.93 }
            }
        }
    }
}
