//! Energy of threads from nodes to fixed points.

use super::rub::outer;
use glam::{DMat3, DVec3};
use trocar_tissue::Tether;

/// Energy of a thread with its node at `x` (J), and the gradient by `x` (N).
pub(super) fn energy(tether: &Tether, x: DVec3) -> (f64, DVec3) {
    let way = x - tether.anchor;
    let (distance, stretch) = (way.length(), way.length() - tether.length);
    if stretch <= 0.0 || distance <= 0.0 {
        return (0.0, DVec3::ZERO);
    }
    (0.5 * tether.stiffness * stretch * stretch, tether.stiffness * stretch / distance * way)
}

/// The second derivative by the node's position (N/m). It is never negative, because the thread
/// only pulls.
pub(super) fn hessian(tether: &Tether, x: DVec3) -> DMat3 {
    let way = x - tether.anchor;
    let (distance, stretch) = (way.length(), way.length() - tether.length);
    if stretch <= 0.0 || distance <= 0.0 {
        return DMat3::ZERO;
    }
    let along = outer(way / distance);
    (along + (DMat3::IDENTITY - along) * (stretch / distance)) * tether.stiffness
}

#[cfg(test)]
mod tests {
    use super::*;

    fn tether() -> Tether {
        Tether { node: 0, anchor: DVec3::new(0.01, -0.02, 0.0), length: 0.01, stiffness: 3.0 }
    }

    #[test]
    fn a_slack_thread_does_nothing() {
        let near = tether().anchor + DVec3::X * 0.0099;
        assert_eq!(energy(&tether(), near), (0.0, DVec3::ZERO));
        assert_eq!(hessian(&tether(), near), DMat3::ZERO);
    }

    #[test]
    fn derivatives_are_those_of_the_energy() {
        const H: f64 = 1e-6;
        let (t, x) = (tether(), DVec3::new(0.013, 0.004, 0.009));
        for axis in [DVec3::X, DVec3::Y, DVec3::Z] {
            let slope = (energy(&t, x + H * axis).0 - energy(&t, x - H * axis).0) / (2.0 * H);
            assert!((slope - energy(&t, x).1.dot(axis)).abs() < 1e-8, "{axis}: {slope}");
            let change = (energy(&t, x + H * axis).1 - energy(&t, x - H * axis).1) / (2.0 * H);
            assert!(change.distance(hessian(&t, x) * axis) < 1e-6, "{axis}: {change}");
        }
    }
}
