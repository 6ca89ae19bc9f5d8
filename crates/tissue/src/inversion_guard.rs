//! The rule that keeps elements from inverting: how much volume a motion must leave to an element.

use glam::Vec3A;

/// A step leaves an element at least this share of the volume that it has.
pub(crate) const KEPT_SHARE: f32 = 0.1;

/// A step leaves an element at least this share of its rest volume. An element that has less
/// already may not lose any.
pub(crate) const MIN_VOLUME_RATIO: f32 = 1e-3;

/// Smallest squared length of an edge that has a dashpot (m2).
pub(crate) const MIN_SQUARED_LENGTH: f32 = 1e-30;

/// Held nodes go no farther from their neighbours than this many rest lengths of the edge between
/// them.
pub(crate) const HELD_STRETCH: f32 = 7.0;

/// The share of a step that leaves enough volume to an element of volume ratio `ratio`, if the
/// whole step changes the ratio by `change`.
#[inline(always)]
pub(crate) fn allowed_share(ratio: f32, change: f32) -> f32 {
    let floor = (KEPT_SHARE * ratio).max(MIN_VOLUME_RATIO).min(ratio);
    if ratio + change >= floor { 1.0 } else { ((floor - ratio) / change).max(0.0) }
}

/// Whether an element of volume ratio `ratio` is too small after it had the ratio `before`.
pub(crate) fn is_squeezed(ratio: f32, before: f32) -> bool {
    // NaN counts as too small. An inverted element may not get worse.
    ratio.is_nan() || ratio < (KEPT_SHARE * before).max(MIN_VOLUME_RATIO).min(before)
}

/// Volume of an element over its rest volume `rest` (m3), vertices at `x`.
#[inline(always)]
pub(crate) fn volume_ratio(tet: &[u32; 4], x: &[Vec3A], rest: f32) -> f32 {
    let [a, b, c, d] = tet.map(|i| x[i as usize]);
    (b - a).cross(c - a).dot(d - a) / (6.0 * rest)
}
