//! Threads from nodes to fixed points: adhesions and sheets that hold an organ.

use super::rub::outer;
use glam::{DMat3, DVec3};

/// A thread from a node to a fixed point. It is slack up to its length and elastic beyond it: its
/// energy is k/2 max(0, |x - anchor| - length)^2.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tether {
    /// The body.
    pub body: usize,
    /// Its node.
    pub node: u32,
    /// The fixed point, in the world (m).
    pub anchor: DVec3,
    /// Length up to which it is slack (m).
    pub length: f64,
    /// Stiffness k beyond that length (N/m).
    pub stiffness: f64,
}

impl Tether {
    /// Its energy with the node at `x` (J), and the gradient by `x` (N).
    pub(super) fn energy(&self, x: DVec3) -> (f64, DVec3) {
        let way = x - self.anchor;
        let (distance, stretch) = (way.length(), way.length() - self.length);
        if stretch <= 0.0 || distance <= 0.0 {
            return (0.0, DVec3::ZERO);
        }
        (0.5 * self.stiffness * stretch * stretch, self.stiffness * stretch / distance * way)
    }

    /// The second derivative by the node's position (N/m). It is never negative, because the thread
    /// only pulls.
    pub(super) fn hessian(&self, x: DVec3) -> DMat3 {
        let way = x - self.anchor;
        let (distance, stretch) = (way.length(), way.length() - self.length);
        if stretch <= 0.0 || distance <= 0.0 {
            return DMat3::ZERO;
        }
        let along = outer(way / distance);
        (along + (DMat3::IDENTITY - along) * (stretch / distance)) * self.stiffness
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tether() -> Tether {
        Tether { body: 0, node: 0, anchor: DVec3::new(0.01, -0.02, 0.0), length: 0.01, stiffness: 3.0 }
    }

    #[test]
    fn a_slack_thread_does_nothing() {
        let near = tether().anchor + DVec3::X * 0.0099;
        assert_eq!(tether().energy(near), (0.0, DVec3::ZERO));
        assert_eq!(tether().hessian(near), DMat3::ZERO);
    }

    #[test]
    fn derivatives_are_those_of_the_energy() {
        const H: f64 = 1e-6;
        let (t, x) = (tether(), DVec3::new(0.013, 0.004, 0.009));
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            let slope = (t.energy(x + H * axis).0 - t.energy(x - H * axis).0) / (2.0 * H);
            assert!((slope - t.energy(x).1.dot(axis)).abs() < 1e-8, "{axis}: {slope}");
            let change = (t.energy(x + H * axis).1 - t.energy(x - H * axis).1) / (2.0 * H);
            assert!(change.distance(t.hessian(x) * axis) < 1e-6, "{axis}: {change}");
        }
    }
}
