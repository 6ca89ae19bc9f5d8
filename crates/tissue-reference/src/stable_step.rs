//! The longest stable step of explicit integration.

use crate::mechanics::Mechanics;
use glam::{DMat3, DVec3};
use trocar_tissue::{Body, Model};

/// Power iterations; the greatest frequency is then known to about a percent.
const POWER_ITERATIONS: usize = 300;

/// The longest stable step of semi-implicit Euler near rest (s): 2/omega of the model's stiffest
/// mode, for free vertices and lumped masses, without dashpots. It is estimated by power iteration
/// on M^-1 K from a fixed start, which converges from above: the true one is about a percent
/// shorter.
pub fn stable_explicit_step(model: &Model) -> f64 {
    model.bodies().iter().map(|body| 2.0 / greatest_frequency(body)).fold(f64::INFINITY, f64::min)
}

/// (rad/s)
fn greatest_frequency(body: &Body) -> f64 {
    let m = Mechanics::new(body);
    let law = body.material().hyperelastic();
    let mut pinned = vec![false; body.len()];
    body.solver_numbers().iter().zip(body.pinned()).for_each(|(i, is)| pinned[*i as usize] = *is);
    let fixed = |i: usize| pinned[i];
    // A start without symmetry, the same every time. u is M^(1/2) x, which makes the matrix
    // symmetric.
    let mut u: Vec<DVec3> = (0..body.len())
        .map(|i| {
            let noise =
                |k: u64| ((i as u64 * 3 + k).wrapping_mul(0x9e37_79b9_7f4a_7c15) >> 40) as f64 / (1 << 24) as f64 - 0.5;
            if fixed(i) { DVec3::ZERO } else { DVec3::new(noise(0), noise(1), noise(2)) }
        })
        .collect();
    let mut force = vec![DVec3::ZERO; body.len()];
    let mut squared = 0.0;
    for _ in 0..POWER_ITERATIONS {
        let norm = u.iter().map(|u| u.length_squared()).sum::<f64>().sqrt();
        if norm == 0.0 {
            return 0.0;
        }
        u.iter_mut().for_each(|u| *u /= norm);
        force.fill(DVec3::ZERO);
        for (t, tet) in m.tets.iter().enumerate() {
            let mut change = DMat3::ZERO;
            for (i, g) in tet.iter().zip(&m.gradients[t]) {
                let x = u[*i as usize] / m.masses[*i as usize].sqrt();
                change += DMat3::from_cols(x * g.x, x * g.y, x * g.z);
            }
            let stress = law.stress_change(DMat3::IDENTITY, change) * m.volumes[t];
            for (i, g) in tet.iter().zip(&m.gradients[t]) {
                force[*i as usize] += stress * *g;
            }
        }
        for (i, u) in u.iter_mut().enumerate() {
            *u = if fixed(i) { DVec3::ZERO } else { force[i] / m.masses[i].sqrt() };
        }
        squared = u.iter().map(|u| u.length_squared()).sum::<f64>().sqrt();
    }
    squared.sqrt()
}
