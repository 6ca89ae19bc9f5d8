//! Light at a point: Lambert, hemispheric ambient, Blinn-Phong.

use glam::DVec3;

/// Light that arrives from everywhere, seen from a surface that faces the sky; half of it from below.
const AMBIENT: f32 = 0.22;
/// Light of the lamp on a surface that faces it.
const DIRECT: f32 = 0.85;
/// Exponent of the highlight: wet tissue.
const SHININESS: f32 = 90.0;

/// What is known of a lit point.
pub(crate) struct Lit {
    /// Linear base colour.
    pub albedo: [f32; 3],
    /// Unit shading normal, towards the viewer.
    pub normal: DVec3,
    /// Unit direction towards the viewer.
    pub to_eye: DVec3,
    /// Unit direction towards the light.
    pub to_light: DVec3,
    /// The light does not reach the point.
    pub shadowed: bool,
    /// Share of the surroundings that the point sees, 0 to 1.
    pub open: f32,
    /// Strength of the highlight.
    pub gloss: f32,
}

/// Linear light towards the viewer.
pub(crate) fn shade(lit: &Lit) -> [f32; 3] {
    let towards = lit.normal.dot(lit.to_light) as f32;
    let ambient = AMBIENT * (0.75 + 0.25 * towards) * lit.open;
    let (mut direct, mut highlight) = (0.0, 0.0);
    if !lit.shadowed && towards > 0.0 {
        // A lamp beside the lens casts no shadow, yet crevices get less of its light after scattering.
        direct = DIRECT * towards * (0.5 + 0.5 * lit.open);
        let half = (lit.to_light + lit.to_eye).normalize_or_zero();
        highlight = lit.gloss * (lit.normal.dot(half).max(0.0) as f32).powf(SHININESS) * lit.open;
    }
    lit.albedo.map(|a| a * (ambient + direct) + highlight)
}
