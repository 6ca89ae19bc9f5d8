//! Extended position-based dynamics.
//!
//! Macklin, Mueller and Chentanez, "XPBD", 2016; small steps of one iteration each, Macklin and
//! others, "Small steps in physics simulation", 2019; stable neo-Hookean tissue as two constraints
//! an element, Macklin and Mueller, "A constraint-based formulation of stable neo-Hookean
//! materials", 2021, solved together (Ton-That, Kry and Andrews, "Parallel block neo-Hookean XPBD
//! using graph clustering", 2023). Support planes are constraints too. Dashpots act on the
//! velocities after each substep, one pair at a time: as constraints they are a hundred times
//! stiffer than the elements and undo their corrections, and the same meshes diverge.

use crate::mechanics::{Mechanics, Particles, Span, too_fast};
use crate::xpbd_constraints::{Elements, Multipliers, Planes};
use crate::xpbd_settings::{Xpbd, XpbdSweep};
use glam::DVec3;
use trocar_tissue::Material;

/// Scratch memory of a body.
pub(crate) struct Scratch {
    /// Positions at the substep's beginning.
    start: Vec<DVec3>,
    /// Inverse masses, 0 where fixed.
    inverse_mass: Vec<f64>,
    /// Corrections of a Jacobi iteration.
    correction: Vec<DVec3>,
    elements: Vec<Multipliers>,
    planes: Vec<f64>,
}

impl Scratch {
    pub fn new(mechanics: &Mechanics) -> Self {
        let nodes = mechanics.masses.len();
        Self {
            start: vec![DVec3::ZERO; nodes],
            inverse_mass: vec![0.0; nodes],
            correction: vec![DVec3::ZERO; nodes],
            elements: vec![[0.0; 6]; mechanics.tets.len()],
            planes: vec![0.0; mechanics.supports.len() * nodes],
        }
    }
}

/// Advances a body by `span`. Returns false if a vertex reached the speed limit; the body is then
/// as it was at that instant.
pub(crate) fn advance(
    settings: &Xpbd,
    mechanics: &Mechanics,
    material: &Material,
    particles: &mut Particles,
    span: Span<'_>,
    scratch: &mut Scratch,
) -> bool {
    let h = span.dt / settings.substeps as f64;
    let elements = Elements::new(mechanics, material, settings.constraints, h);
    let planes = Planes { mechanics, h };
    let Particles { x, v } = particles;
    let Scratch { start, inverse_mass, correction, .. } = scratch;
    for (i, w) in inverse_mass.iter_mut().enumerate() {
        *w = if span.fixed[i] { 0.0 } else { 1.0 / mechanics.masses[i] };
    }
    for substep in 1..=settings.substeps {
        start.copy_from_slice(x);
        // The remaining way of a fixed vertex is spread over the rest of the span.
        let share = 1.0 / (settings.substeps + 1 - substep) as f64;
        for (i, x) in x.iter_mut().enumerate() {
            *x = if span.fixed[i] {
                span.prescribed(i, *x, share)
            } else {
                *x + h * v[i] + h * h * span.accelerations[i]
            };
        }
        scratch.elements.fill([0.0; 6]);
        scratch.planes.fill(0.0);
        for _ in 0..settings.iterations {
            match settings.sweep {
                XpbdSweep::GaussSeidel => elements.sweep(x, inverse_mass, &mut scratch.elements),
                XpbdSweep::Jacobi { relaxation } => {
                    correction.fill(DVec3::ZERO);
                    elements.gather(relaxation, x, inverse_mass, &mut scratch.elements, correction);
                    x.iter_mut().zip(correction.iter()).for_each(|(x, d)| *x += *d);
                }
            }
            planes.sweep(x, start, inverse_mass, &mut scratch.planes);
        }
        for (i, v) in v.iter_mut().enumerate() {
            *v = if span.fixed[i] { DVec3::ZERO } else { (x[i] - start[i]) / h };
        }
        mechanics.damp(h, x, v, span.fixed);
        if too_fast(v, span.fixed) {
            return false;
        }
    }
    true
}
