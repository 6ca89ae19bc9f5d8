//! Landmarks every 5 mm along an organ's centreline (paper section VII-F).

use glam::DVec3;

/// A landmark of the front above the centreline.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Landmark {
    /// Its place along the organ (m).
    pub along: f64,
    /// Where it is at rest (m).
    pub rest: DVec3,
    /// How far it has moved at the peak (m); `None` where it is hidden.
    pub moved: Option<DVec3>,
    /// The same in the frame beside the peak.
    pub beside: Option<DVec3>,
}

/// The motions of landmarks at the peak (m).
pub fn displacements(landmarks: &[Landmark]) -> Vec<Option<DVec3>> {
    landmarks.iter().map(|l| l.moved).collect()
}

/// Root mean square distance between predicted and measured motions (m), over the pairs that are
/// known; `None` without any.
pub fn rmse(predicted: &[Option<DVec3>], measured: &[Option<DVec3>]) -> Option<f64> {
    let pairs = predicted.iter().zip(measured).filter_map(|(a, b)| Some((*a)?.distance_squared((*b)?)));
    let squares: Vec<f64> = pairs.collect();
    (!squares.is_empty()).then(|| (squares.iter().sum::<f64>() / squares.len() as f64).sqrt())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_error_is_over_the_pairs_that_are_known() {
        let measured = [Some(DVec3::X * 0.003), None, Some(DVec3::Y * 0.004), Some(DVec3::ZERO)];
        let predicted = [Some(DVec3::ZERO), Some(DVec3::X), Some(DVec3::ZERO), None];
        let error = rmse(&predicted, &measured).unwrap();
        assert!((error - (12.5e-6_f64).sqrt()).abs() < 1e-12, "{error}");
        assert_eq!(rmse(&[None], &[Some(DVec3::ZERO)]), None);
    }
}
