//! The spring between two solids.
//!
//! Instruments are far stiffer at their surface than along their shaft and in the arm's gears: a
//! steel tube of 5 mm and 0.5 mm wall that sticks out by 0.1 m yields at its end by 1 mm under 10 N
//! (3 E I / L^3), and gears of 10 kN m/rad by about as much at the instrument. The spring stands
//! for these. Let R be the depth at which the two axes would meet. At depths d beyond 3/4 R the
//! spring hardens to k / (4 (1 - d/R))^2: no axis passes another.

/// Stiffness of solids at first touch (N/m).
const STIFFNESS: f64 = 1e4;

/// Damping of solids that press on each other (N s/m). Masses at the tips are 0.2 kg across the
/// shaft to 3 kg along it.
const DAMPING: f64 = 40.0;

/// The spring hardens from this share of the greatest depth on.
const HARDENING: f64 = 0.75;

/// The share of the greatest depth beyond which the spring hardens no more.
const MAX_SHARE: f64 = 0.995;

/// A spring, linear about the present depth: -(`stiffness` x `gap` + `damping` x rate of the gap).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Spring {
    /// Stiffness (N/m).
    pub stiffness: f64,
    /// The gap of a linear spring of this stiffness with the present force (m).
    pub gap: f64,
    /// Damping (N s/m); 0 before solids touch.
    pub damping: f64,
}

impl Spring {
    /// The spring at `gap` (m), negative where solids press, whose axes would meet at the depth
    /// `room` (m).
    pub fn at(gap: f64, room: f64) -> Self {
        if gap >= 0.0 {
            return Self { stiffness: STIFFNESS, gap, damping: 0.0 };
        }
        let share = (-gap / room).min(MAX_SHARE);
        if share <= HARDENING {
            return Self { stiffness: STIFFNESS, gap, damping: DAMPING };
        }
        let left = (1.0 - HARDENING) / (1.0 - share);
        let force = STIFFNESS * room * (HARDENING + (1.0 - HARDENING) * (left - 1.0));
        let stiffness = STIFFNESS * left * left;
        Self { stiffness, gap: -force / stiffness, damping: DAMPING }
    }

    /// Its force at rest (N).
    pub fn force(&self) -> f64 {
        (-self.stiffness * self.gap).max(0.0)
    }

    /// The spring in series with the inertia of a free `mass` (kg) at its other end, over an
    /// implicit step of `dt` (s). The force F moves that mass by dt^2 F / mass. So the spring
    /// yields by the factor 1 / (1 + (k dt^2 + d dt) / mass).
    pub fn against(self, mass: f64, dt: f64) -> Self {
        let yielding = 1.0 + (self.stiffness * dt * dt + self.damping * dt) / mass;
        Self { stiffness: self.stiffness / yielding, damping: self.damping / yielding, ..self }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_spring_is_tangent_to_its_law_and_hardens() {
        let room = 4e-3;
        let law = |depth: f64| {
            let hard = |d: f64| room / 16.0 * (1.0 / (1.0 - d / room) - 4.0);
            STIFFNESS * if depth < 3e-3 { depth } else { 3e-3 + hard(depth) }
        };
        for depth in [1e-6, 5e-4, 3.1e-3, 3.9e-3] {
            let spring = Spring::at(-depth, room);
            assert!((spring.force() / law(depth) - 1.0).abs() < 1e-12);
            let slope = (law(depth + 1e-9) - law(depth - 1e-9)) / 2e-9;
            assert!((spring.stiffness / slope - 1.0).abs() < 1e-5, "{} {slope}", spring.stiffness);
        }
        assert_eq!((Spring::at(1e-3, room).force(), Spring::at(1e-3, room).damping), (0.0, 0.0));
        assert!(Spring::at(-room, room).force() > 400.0 && Spring::at(-2.0 * room, room).force().is_finite());
    }

    #[test]
    fn two_masses_on_a_yielding_spring_swing_no_more_than_they_did() {
        // The first is implicit, the second gets the reaction, as in a step of two arms.
        let dt = 1.0 / 480.0;
        for masses in [[1.0, 1.0], [2.0, 0.05], [0.05, 2.0], [0.01, 0.01]] {
            let ([a, b], mut x, mut v) = (masses, [0.0, 0.0], [0.1, -0.1]);
            let mut most: f64 = 0.0;
            for _ in 0..480 {
                let spring = Spring::at(x[1] - x[0], 5e-3).against(b, dt);
                let (k, d) = (spring.stiffness, spring.damping);
                let gap = spring.gap + dt * v[1] + d / k * v[1];
                let pushed = (v[0] - dt / a * (-k * gap)) / (1.0 + dt / a * (k * dt + d));
                let force = (-(k * (gap - dt * pushed) - d * pushed)).max(0.0);
                v = [v[0] - dt / a * force, v[1] + dt / b * force];
                x = [x[0] + dt * v[0], x[1] + dt * v[1]];
                most = most.max((v[1] - v[0]).abs());
            }
            assert!(v[1] - v[0] > 0.0 && most < 0.201, "{masses:?}: {v:?}, {most}");
            assert!((a * v[0] + b * v[1] - 0.1 * (a - b)).abs() < 1e-12, "{masses:?}: momentum");
        }
    }
}
