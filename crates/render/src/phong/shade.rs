//! Blinn-Phong shading with hemispherical ambient light.

use glam::DVec3;

/// Ambient light on a surface that faces the sky. Half of the ambient light comes from below.
const AMBIENT: f32 = 0.22;
/// Direct light on a surface that faces the light.
const DIRECT: f32 = 0.85;
/// Exponent of the highlight: wet tissue.
const SHININESS: f32 = 90.0;

/// A point to shade.
pub(crate) struct Lit {
    /// Linear base colour.
    pub albedo: [f32; 3],
    /// Unit shading normal, towards the viewer.
    pub normal: DVec3,
    /// Unit direction towards the viewer.
    pub to_eye: DVec3,
    /// Unit direction towards the light.
    pub to_light: DVec3,
    /// Whether the light is occluded.
    pub shadowed: bool,
    /// Ambient visibility, in [0, 1].
    pub open: f32,
    /// Strength of the highlight.
    pub gloss: f32,
}

/// Linear radiance towards the viewer.
pub(crate) fn shade(lit: &Lit) -> [f32; 3] {
    let towards = lit.normal.dot(lit.to_light) as f32;
    let ambient = AMBIENT * (0.75 + 0.25 * towards) * lit.open;
    let (mut direct, mut highlight) = (0.0, 0.0);
    if !lit.shadowed && towards > 0.0 {
        // A light beside the lens casts no shadow, but less of its scattered light reaches
        // crevices.
        direct = DIRECT * towards * (0.5 + 0.5 * lit.open);
        let half = (lit.to_light + lit.to_eye).normalize_or_zero();
        highlight = lit.gloss * (lit.normal.dot(half).max(0.0) as f32).powf(SHININESS) * lit.open;
    }
    lit.albedo.map(|a| a * (ambient + direct) + highlight)
}
