//! What a phantom is: its organs and how they lie, the bed, the lamp, the instruments' reach. A phantom is a file with a [`Plan`].

use crate::bed::{Bed, BedPlan};
use crate::body::Body;
use crate::instruments::Reach;
use crate::still::Fineness;
use crate::{Error, Result, phantom_a, phantom_b, phantom_c};
use glam::DVec3;
use trocar_specimen::{End, Material, Pins, nearest};

/// The phantoms there are.
const PLANS: [&Plan; 3] = [&phantom_a::PLAN, &phantom_b::PLAN, &phantom_c::PLAN];

/// Names of the phantoms: `phantom-a` and `phantom-b` are rabbits, `phantom-c` is a porcine liver with its gallbladder.
pub const NAMES: [&str; 3] = [PLANS[0].name, PLANS[1].name, PLANS[2].name];

/// A phantom.
pub(crate) struct Plan {
    pub name: &'static str,
    /// What to lay where, for a seed, on a bed that nothing has pressed on yet.
    pub organs: fn(u64, &Bed) -> Vec<Organ>,
    /// The organs' names in the paper's order, which is that of the recording.
    pub listed: &'static [&'static str],
    /// Density of the organs [kg/m3].
    pub density: f64,
    pub bed: BedPlan,
    pub reach: Reach,
    pub fineness: Fineness,
    /// Depth at which the lamp is as bright as the colours mean [m].
    pub lit_at: f32,
    /// How near surroundings must be to darken a crease [m].
    pub crease: f64,
}

/// An organ in its place.
pub(crate) struct Organ {
    pub name: &'static str,
    pub body: Body,
    pub young_modulus: f64,
    pub pins: PinRule,
    pub look: Look,
    pub seed: u64,
}

/// Which nodes are held, before it is known how the organ lies.
#[derive(Clone, Copy)]
pub(crate) enum PinRule {
    /// The lowest share.
    Band(f64),
    /// The left arm grasps: the end on the right is held, and most of the 30% next to it.
    RightEnd,
}

/// What an organ looks like.
#[derive(Clone, Copy)]
pub(crate) enum Look {
    /// Two tones in patches, and vessels.
    Bowel { base: DVec3, flush: DVec3, vessels: Vessels },
    /// Dark, smooth, with lobules.
    Liver,
    /// Green, with vessels that branch.
    Gallbladder,
}

/// How vessels run.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Vessels {
    /// A branching network.
    Network,
    /// Up from the mesentery around the wall.
    Rungs,
}

impl Plan {
    /// The phantom of that name.
    pub fn named(name: &str) -> Result<&'static Self> {
        let known = || Error::Unknown { name: name.to_owned(), nearest: nearest(name, NAMES), known: NAMES.join(", ") };
        PLANS.into_iter().find(|p| p.name == name).ok_or_else(known)
    }
}

impl Organ {
    /// Its material, the paper's.
    pub fn material(&self, plan: &Plan) -> Material {
        Material { young_modulus_pa: self.young_modulus, density_kg_m3: plan.density, ..Material::default() }
    }

    /// Its pins, the paper's.
    pub fn pins(&self) -> Pins {
        match self.pins {
            PinRule::Band(share) => Pins::Band { share },
            PinRule::RightEnd => {
                // 0.14 + 0.30 * 0.93 = 0.42 of the length; the free part begins before the middle.
                let end = if self.body.base().x > self.body.tip().x { End::Base } else { End::Tip };
                Pins::End { end, length: 0.14, band_length: 0.30, band_share: 0.93 }
            }
        }
    }
}
