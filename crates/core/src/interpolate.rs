//! Interpolation between two numbers.

/// Linear interpolation: `from` at `t` = 0, `to` at `t` = 1.
///
/// ```
/// assert_eq!(trocar_core::interpolate::linear(2.0, 4.0, 0.25), 2.5);
/// ```
pub fn linear(from: f64, to: f64, t: f64) -> f64 {
    from + t * (to - from)
}

/// The cubic 3 t^2 - 2 t^3 for `t` clamped to [0, 1]: 0 and 1 at the ends, with zero slope there.
///
/// ```
/// use trocar_core::interpolate::smoothstep;
/// assert_eq!([smoothstep(0.0), smoothstep(0.5), smoothstep(2.0)], [0.0, 0.5, 1.0]);
/// ```
pub fn smoothstep(t: f64) -> f64 {
    let t = t.clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}
