//! Exposure matching with one gain per channel.

use super::error::{Error, Result};
use crate::Mask;

/// A picture with exposure gains applied.
#[derive(Clone, Debug, PartialEq)]
pub struct Matched {
    /// Gain of each channel.
    pub gains: [f64; 3],
    /// The picture, not rounded, clamped to 255.
    pub picture: Vec<[f64; 3]>,
}

/// Scales each channel of `picture` to match `target` by least squares over the mask's pixels: g =
/// sum(target picture) / sum(picture^2). The gain of an entirely black channel is 1.
///
/// # Errors
/// An empty mask. Sizes are not checked; pixels missing in one input are ignored.
pub fn match_exposure(picture: &[[f64; 3]], target: &[[f64; 3]], mask: &Mask) -> Result<Matched> {
    let (mut own, mut common) = ([0.0; 3], [0.0; 3]);
    let mut any = false;
    for ((p, t), _) in picture.iter().zip(target).zip(&mask.set).filter(|(_, set)| **set) {
        any = true;
        for c in 0..3 {
            own[c] += p[c] * p[c];
            common[c] += p[c] * t[c];
        }
    }
    if !any {
        return Err(Error::Empty);
    }
    let gains: [f64; 3] = std::array::from_fn(|c| if own[c] > 0.0 { common[c] / own[c] } else { 1.0 });
    let scaled = |p: &[f64; 3]| std::array::from_fn(|c| (p[c] * gains[c]).min(255.0));
    Ok(Matched { gains, picture: picture.iter().map(scaled).collect() })
}
