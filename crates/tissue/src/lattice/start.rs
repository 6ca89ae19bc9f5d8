//! Where a lattice begins a substep: what would become of it without forces, the loads on it, and
//! where the search starts.

use super::LatticeSolver;
use crate::body_slot::BodySlot;
use crate::frame::Frame;
use glam::DVec3;
use trocar_lattice::BodyState as LatticeState;

/// The beginning of a substep. All lists are empty for a body that cannot move.
#[derive(Default)]
pub(super) struct Start {
    /// Acceleration times time that free flight adds to the velocity (m/s), and the predictor (m).
    flight: DVec3,
    pub predictor: Vec<DVec3>,
    /// Forces on the nodes (N); none without loads.
    pub loads: Vec<DVec3>,
    /// Where the search starts (m).
    pub guess: Vec<DVec3>,
}

impl Start {
    /// Begins a substep of `h` (s) of a body.
    ///
    /// A body in free flight falls exactly: gravity's part of its motion is h^2/2 g. Elsewhere it
    /// is implicit Euler's h^2 g.
    pub fn begin(slot: &mut BodySlot<LatticeSolver>, frame: &Frame<'_>, h: f64) {
        let BodySlot { index, body, solver, state, .. } = slot;
        let LatticeSolver { start: Self { flight, predictor, loads, guess }, precision, contacts, held, .. } = solver;
        let (Some(embedding), Some(lattice)) = (&body.lattice, &state.lattice) else { return };
        loads.clear();
        frame.of(*index).for_loads(body, |vertex, force| {
            if let Some(point) = &embedding.points[vertex] {
                loads.resize(lattice.positions.len(), DVec3::ZERO);
                point.spread(force, loads);
            }
        });
        let free = loads.is_empty() && !solver.pressed && held.is_empty() && embedding.body.pins().is_empty();
        let flies = free && contacts.is_idle(|i| state.x[i]);
        *flight = h * frame.gravity;
        let reach = if flies { 0.5 * h } else { h };
        let nodes = || lattice.positions.iter().zip(&lattice.velocities);
        predictor.clear();
        predictor.extend(nodes().map(|(x, v)| *x + h * *v + reach * *flight));
        if flies {
            guess.clone_from(predictor);
        } else {
            // A body that hardly moves starts where it is, and may come to rest.
            let fastest = lattice.velocities.iter().map(|v| v.length_squared()).fold(0.0, f64::max).sqrt();
            let share = if h * fastest > precision.tolerance { h } else { 0.0 };
            guess.clear();
            guess.extend(nodes().map(|(x, v)| *x + share * *v));
        }
    }

    /// Ends the substep at `x`: v + h g + (x - y)/h, which equals (x - x0)/h for implicit Euler,
    /// and is exact in free flight. Returns whether any number changed.
    pub fn end(&self, x: &[DVec3], h: f64, lattice: &mut LatticeState) -> bool {
        let mut changed = false;
        for (i, x) in x.iter().enumerate() {
            let v = lattice.velocities[i] + (self.flight + (*x - self.predictor[i]) / h);
            changed |= v != lattice.velocities[i] || *x != lattice.positions[i];
            lattice.velocities[i] = v;
            lattice.positions[i] = *x;
        }
        changed
    }
}
