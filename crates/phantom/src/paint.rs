//! Tissue colours per vertex: base colours, mottling, branching vessels, fat.

use crate::bed::{Bed, BedSpec};
use crate::body::Body;
use crate::noise::{fractal, smooth};
use crate::spec::{Organ, TissueAppearance, Vessels};
use glam::DVec3;
use rayon::prelude::*;
use trocar_core::interpolate::smoothstep;
use trocar_geometry::{SignedDistance, TriMesh};
use trocar_render::phong::Shading;

const VEIN: DVec3 = DVec3::new(112.0, 28.0, 40.0);
const FAT: DVec3 = DVec3::new(226.0, 176.0, 104.0);

/// Computes the vertex colours of an organ.
pub(crate) fn organ(organ: &Organ, mesh: &mut TriMesh) {
    mesh.colors = mesh.vertices.par_iter().map(|p| bytes(organ_color(organ, *p))).collect();
}

/// Computes the vertex colours of the bed.
pub(crate) fn bed(bed: &Bed, mesh: &mut TriMesh) {
    mesh.colors = mesh.vertices.par_iter().map(|p| bytes(bed_color(bed, *p))).collect();
}

fn bytes(color: DVec3) -> [u8; 3] {
    color.to_array().map(|c| c.round().clamp(0.0, 255.0) as u8)
}

/// Shading of an organ.
pub(crate) fn shading(look: TissueAppearance) -> Shading {
    Shading { color: [200, 120, 110], gloss: gloss(look), wireframe: false }
}

/// Strength of the highlights on an organ.
fn gloss(look: TissueAppearance) -> f32 {
    match look {
        TissueAppearance::Bowel { .. } => 0.4,
        TissueAppearance::Liver => 0.5,
        TissueAppearance::Gallbladder => 0.45,
    }
}

fn organ_color(organ: &Organ, p: DVec3) -> DVec3 {
    match organ.look {
        TissueAppearance::Bowel { base, flush, vessels } => bowel_color(organ, p, [base, flush], vessels),
        TissueAppearance::Liver => liver_color(organ, p),
        TissueAppearance::Gallbladder => gallbladder_color(organ, p),
    }
}

fn bowel_color(organ: &Organ, p: DVec3, [base, flush]: [DVec3; 2], vessels: Vessels) -> DVec3 {
    let seed = organ.seed;
    let local = organ.body.local(p);
    let along = local.s * organ.body.length();
    // Flushed patches, then fine mottling.
    let patches = 0.5 + 0.7 * fractal(seed + 1, p / 9e-3, 3);
    let mut color = base.lerp(flush, patches.clamp(0.0, 1.0));
    color *= 1.0 + 0.09 * fractal(seed + 2, p / 2e-3, 2);
    // Fat lies on the side of the mesentery.
    let fat = fractal(seed + 3, p / 5e-3, 3) + 0.1 - 0.8 * libm::sin(local.angle);
    color = color.lerp(FAT, 0.8 * step(0.0, 0.25, fat));
    let vessels = match vessels {
        Vessels::Network => network(seed + 4, p, 11e-3, 0.95e-3).max(0.7 * network(seed + 5, p, 5e-3, 0.6e-3)),
        Vessels::Rungs => rungs(seed + 4, along, local.angle, p).max(0.55 * network(seed + 5, p, 5e-3, 0.5e-3)),
    };
    color.lerp(VEIN, 0.7 * vessels)
}

fn liver_color(organ: &Organ, p: DVec3) -> DVec3 {
    let seed = organ.seed;
    let dark = DVec3::new(80.0, 32.0, 28.0);
    let warm = DVec3::new(114.0, 52.0, 41.0);
    let mut color = dark.lerp(warm, (0.5 + 0.6 * fractal(seed + 1, p / 35e-3, 3)).clamp(0.0, 1.0));
    color *= 1.0 + 0.07 * fractal(seed + 2, p / 5e-3, 2);
    // Pale septa around the lobules of a pig's liver, visible through the capsule.
    let septum = 1.0 - step(0.0, 0.22, fractal(seed + 3, p / 6e-3, 2).abs());
    color = color.lerp(DVec3::new(158.0, 84.0, 66.0), 0.2 * septum);
    let vessels = network(seed + 4, p, 45e-3, 2.4e-3).max(0.6 * network(seed + 5, p, 20e-3, 1.6e-3));
    color = color.lerp(DVec3::new(66.0, 18.0, 24.0), 0.5 * vessels);
    // Connective tissue where the gallbladder is attached.
    let beside = match &organ.body {
        Body::Blend(blend) => blend.groove().map_or(f64::INFINITY, |tube| tube.distance(p)),
        Body::Tube(_) => f64::INFINITY,
    };
    let ragged = 4e-3 * (1.0 + 0.7 * fractal(seed + 6, p / 8e-3, 2));
    color.lerp(DVec3::new(186.0, 134.0, 104.0), 0.6 * (1.0 - step(0.3 * ragged, ragged, beside)))
}

fn gallbladder_color(organ: &Organ, p: DVec3) -> DVec3 {
    let seed = organ.seed;
    let bile = DVec3::new(72.0, 92.0, 54.0);
    let wall = DVec3::new(134.0, 138.0, 86.0);
    let mut color = bile.lerp(wall, (0.45 + 0.7 * fractal(seed + 1, p / 22e-3, 3)).clamp(0.0, 1.0));
    color *= 1.0 + 0.06 * fractal(seed + 2, p / 5e-3, 2);
    // The neck is paler, with some fat.
    let s = organ.body.local(p).s;
    let fat = fractal(seed + 3, p / 12e-3, 3) + 0.25 - 1.6 * s;
    color = color.lerp(FAT, 0.7 * step(0.0, 0.3, fat));
    let vessels = network(seed + 4, p, 28e-3, 2.2e-3).max(0.5 * network(seed + 5, p, 14e-3, 1.8e-3));
    color.lerp(VEIN, 0.55 * vessels)
}

fn bed_color(bed: &Bed, p: DVec3) -> DVec3 {
    let seed = bed.seed;
    let flat = p.with_z(0.0);
    let BedSpec { meat, film, fat, scale, .. } = bed.spec;
    let mut color = meat.lerp(film, (0.5 + 0.8 * fractal(seed + 31, flat / (0.018 * scale), 3)).clamp(0.0, 1.0));
    // Lobules of fat with red seams between them.
    let much = step(0.0, 0.6, fractal(seed + 32, flat / (0.04 * scale), 3));
    let seam = bed.seams(p.x, p.y);
    color = color.lerp(FAT * 0.86, 0.7 * fat * much * step(0.03, 0.22, seam));
    color *= 1.0 + 0.08 * fractal(seed + 33, flat / (2e-3 * scale), 2);
    let large = network(seed + 34, flat, 0.030 * scale, 1.5e-3 * scale);
    let vessels = large.max(0.7 * network(seed + 35, flat, 0.012 * scale, 0.8e-3 * scale));
    color.lerp(VEIN, 0.7 * vessels)
}

/// Smooth step: 0 below `low`, 1 above `high`.
fn step(low: f64, high: f64, x: f64) -> f64 {
    smoothstep((x - low) / (high - low))
}

/// Branching lines at zero crossings of warped noise of feature size `size` (m): about `width` (m)
/// wide, with interruptions.
fn network(seed: u64, p: DVec3, size: f64, width: f64) -> f64 {
    let warp = |k: u64| fractal(seed.wrapping_add(100 + k), p / (0.6 * size), 2);
    let q = p / size + 0.35 * DVec3::new(warp(0), warp(1), warp(2));
    let field = |q: DVec3| smooth(seed, q);
    // The distance to a zero crossing is the value divided by the slope.
    let h = 0.02;
    let value = field(q);
    let slope =
        DVec3::new(field(q + DVec3::X * h) - value, field(q + DVec3::Y * h) - value, field(q + DVec3::Z * h) - value)
            / h;
    let distance = value.abs() / slope.length().max(0.25) * size;
    let wide = width * (0.55 + 0.45 * smooth(seed + 7, p / (1.7 * size)));
    let present = step(-0.35, 0.1, smooth(seed + 8, p / (2.2 * size)));
    present * (1.0 - step(0.4 * wide, wide, distance))
}

/// Vessels that climb around a bowel from its mesenteric side, branch and taper.
fn rungs(seed: u64, along: f64, angle: f64, p: DVec3) -> f64 {
    // Position on the wall: 0 at the mesentery, 1 on top.
    let up = 0.5 + 0.5 * libm::sin(angle);
    let phase = along / 5.5e-3 + 0.45 * fractal(seed, p / 4e-3, 3);
    let fork = if up > 0.72 { 2.0 } else { 1.0 };
    let to_line = |phase: f64| (phase - phase.round()).abs();
    let spread = (fork - 1.0) * (0.25 - 0.8 * (up - 0.72)).max(0.0);
    let distance = to_line(phase - spread).min(to_line(phase + spread)) * 5.5e-3;
    let rung = smooth(seed + 9, DVec3::new(phase.round() * 1.7, 0.5, f64::from(libm::cos(angle) > 0.0) * 3.0));
    let reach = 0.75 + 0.35 * rung;
    let width = 0.62e-3 * (1.3 - up);
    (1.0 - step(0.5 * width, 1.6 * width, distance)) * (1.0 - step(reach - 0.15, reach, up))
}
