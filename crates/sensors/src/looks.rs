//! Appearance of things: colours and surfaces of tissue, arms and instruments.

use trocar_render::{Appearance, SurfaceKind};
use trocar_scene::InstrumentKind;

/// Painted housings of arms.
pub(crate) fn shell() -> Appearance {
    Appearance {
        color: [232; 3],
        surface: SurfaceKind::Coated { roughness: 0.42, ior: 1.48, scattering_length: [0.0; 3] },
    }
}

/// Steel of instruments.
pub(crate) fn polished() -> Appearance {
    Appearance { surface: SurfaceKind::Metal { roughness: 0.3 }, ..Appearance::steel() }
}

/// The motor housing of an instrument: dark of a grasper.
pub(crate) fn housing(kind: InstrumentKind) -> Appearance {
    if kind == InstrumentKind::Grasper { Appearance { color: [58, 61, 66], ..shell() } } else { shell() }
}

/// Wet tissue with the given roughness of its film of water.
pub(crate) fn wet(roughness: f32) -> Appearance {
    let tissue = Appearance::tissue([190, 96, 88]);
    match tissue.surface {
        SurfaceKind::Coated { ior, scattering_length, .. } => {
            Appearance { surface: SurfaceKind::Coated { roughness, ior, scattering_length }, ..tissue }
        }
        _ => tissue,
    }
}

/// The appearance with its highlights scaled by `gloss`: the coat's refractive index for which the
/// reflectance at normal incidence, ((n - 1) / (n + 1))^2, is scaled so. A factor of 1 keeps every
/// bit.
pub(crate) fn glossed(appearance: Appearance, gloss: f64) -> Appearance {
    match appearance.surface {
        SurfaceKind::Coated { roughness, ior, scattering_length } if gloss != 1.0 => {
            let n = f64::from(ior);
            let root = ((n - 1.0) / (n + 1.0) * gloss.sqrt()).min(0.5);
            let ior = ((1.0 + root) / (1.0 - root)) as f32;
            Appearance { surface: SurfaceKind::Coated { roughness, ior, scattering_length }, ..appearance }
        }
        _ => appearance,
    }
}
