//! Mechanical energy of a state. Motion without work may never gain any.

use crate::oracle::{OracleState, elastic_energy};
use trocar_tissue::Model;

/// Mechanical energies of all bodies (J), in double precision.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Energy {
    /// Of motion.
    pub kinetic: f64,
    /// Stored in the tissue; 0 at rest. NaN where corotated tissue is inverted.
    pub elastic: f64,
    /// Of the masses in gravity's field; 0 for a mass at the world's origin.
    pub gravity: f64,
    /// Stored in the supports' penalty, and in the springs by which friction holds.
    pub supports: f64,
}

impl Energy {
    /// The energies of `state`, which must be one of `model`.
    pub fn of(model: &Model, state: &OracleState) -> Self {
        let mut sum = Self::default();
        for (body, nodes) in model.bodies().iter().zip(&state.bodies) {
            sum.elastic += elastic_energy(body, &nodes.x);
            for (i, (x, v)) in nodes.x.iter().zip(&nodes.v).enumerate() {
                let mass = body.mass(i);
                sum.kinetic += 0.5 * mass * v.length_squared();
                sum.gravity -= mass * model.gravity().dot(*x);
                let stiffness = body.contact_stiffness(i);
                for (s, support) in body.supports().iter().enumerate() {
                    let touch = support.contact(*x);
                    sum.supports += 0.5 * stiffness * touch.height.min(0.0).powi(2);
                    if let Some(Some(place)) = nodes.anchors.get(s * body.len() + i) {
                        let (normal, off) = (touch.gradient.normalize(), x - place);
                        let slide = off - off.dot(normal) * normal;
                        sum.supports += 0.5 * stiffness * touch.gradient.length_squared() * slide.length_squared();
                    }
                }
            }
        }
        sum
    }

    /// All of it (J).
    pub fn total(&self) -> f64 {
        self.kinetic + self.elastic + self.gravity + self.supports
    }
}
