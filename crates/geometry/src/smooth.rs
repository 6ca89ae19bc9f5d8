//! Surface smoothing.

use crate::TriMesh;

/// Taubin smoothing: `iterations` pairs of a shrinking (`lambda` > 0) and an inflating (`mu` < -`lambda`) umbrella step.
/// Taubin, "A signal processing approach to fair surface design", 1995.
pub fn taubin(mesh: &mut TriMesh, lambda: f64, mu: f64, iterations: usize) {
    let _ = (mesh, lambda, mu, iterations);
    todo!()
}
