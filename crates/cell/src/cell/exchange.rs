//! The load of tissue on an instrument between two frames of tissue.
//!
//! Tissue is stepped 60 times a second, arms 480 times. In a frame, the tip moves for the tissue
//! from its place at the beginning to its place at the end. Over the next frame, the arm feels the
//! force at that frame's end. Such a force is a spring with a delay of one frame, and a delayed
//! spring of stiffness k does work: the arm oscillates unless its damping exceeds about k T / 2,
//! with the frame time T (Colgate and Schenkel 1997). So the force is extrapolated with the tip: at
//! every step of the arm it changes by the stiffness seen so far (a secant, as in [`crate::Jaw`])
//! times the tip's motion since the frame. With the right secant, the arm feels the true spring.
//! With a larger one, the difference resists motion and vanishes at the next frame: it damps.
//! Nothing is added at rest.
//!
//! Contact that is deep, on tissue that is squeezed or half pinned, is far stiffer along the force
//! than tissue is otherwise. That stiffness counts along the force only: across it, it would hold
//! the arm.

use glam::DVec3;
use trocar_core::Wrench;
use trocar_tissue::ToolForce;

/// Maximum load of tissue on an arm (N): a joint of the wrist would yield beyond it.
pub const MAX_LOAD: f64 = 40.0;

/// Maximum assumed stiffness of tissue in every direction, and along its force (N/m). A tip has a
/// mass of at least 0.2 kg, with which an explicit spring of 1.8e5 N/m is stable at 480 Hz.
const MAX_STIFFNESS: f64 = 2e4;
const MAX_STIFFNESS_ALONG: f64 = 1e5;

/// Decay of the stiffness from one frame to the next.
const FORGETTING: f64 = 0.8;

/// Minimum motion for a secant (m); below it, creep would be mistaken for stiffness.
const LEAST_MOTION: f64 = 2e-5;

/// The last frame's force on an instrument, and its extrapolation.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Exchange {
    /// Force (N) and torque about the tip (N m) in the cell frame at the end of the last frame.
    load: Wrench,
    /// Position of the tip then (m).
    at: DVec3,
    /// Stiffness seen so far (N/m), and what it is more along the force.
    stiffness: f64,
    more: f64,
    /// The last frame's force was more than [`MAX_LOAD`].
    pub limited: bool,
}

impl Exchange {
    /// Without load, the tip at `at` (m).
    pub fn new(at: DVec3) -> Self {
        Self { at, ..Self::default() }
    }

    /// Ends a frame with the tip at `at` (m) and `forces` on its tools.
    pub fn end_frame(&mut self, at: DVec3, forces: &[ToolForce; 3]) {
        let mut load = Wrench::default();
        for force in forces {
            for part in [force.contact, force.constraint] {
                load += part;
            }
        }
        let over = load.force.length() / MAX_LOAD;
        self.limited = over > 1.0;
        if self.limited {
            load = Wrench { force: load.force / over, torque: load.torque / over };
        }
        let way = at - self.at;
        self.stiffness *= FORGETTING;
        if way.length() > LEAST_MOTION {
            let secant = (self.load.force - load.force).dot(way) / way.length_squared();
            self.stiffness = self.stiffness.max(secant).min(MAX_STIFFNESS);
        }
        self.more *= FORGETTING;
        let out = load.force.normalize_or_zero();
        let along = way.dot(out);
        if along.abs() > LEAST_MOTION {
            let secant = ((self.load.force - load.force).dot(out) / along).min(MAX_STIFFNESS_ALONG);
            self.more = self.more.max(secant - self.stiffness);
        }
        (self.load, self.at) = (load, at);
    }

    /// The force at the end of the last frame (N).
    pub fn force(&self) -> DVec3 {
        self.load.force
    }

    /// The force (N), and the torque about the tip (N m), at the end of the last frame.
    pub fn wrench(&self) -> Wrench {
        self.load
    }

    /// The stiffness seen so far (N/m).
    pub fn stiffness(&self) -> f64 {
        self.stiffness
    }

    /// The load on a tip that has moved to `at` (m).
    pub fn load(&self, at: DVec3) -> Wrench {
        let way = at - self.at;
        let mut force = self.load.force - self.stiffness * way;
        if self.more > 0.0 {
            let out = self.load.force.normalize_or_zero();
            // Contact does not pull back what leaves it.
            force -= (self.more * way.dot(out)).min(force.dot(out).max(0.0)) * out;
        }
        Wrench { force: force.clamp_length_max(MAX_LOAD), torque: self.load.torque }
    }

    pub fn numbers(&self) -> impl Iterator<Item = f64> + use<> {
        let Self { load, at, stiffness, more, limited } = *self;
        let vectors = [load.force, load.torque, at].map(|v| v.to_array());
        vectors.into_iter().flatten().chain([stiffness, more, f64::from(u8::from(limited))])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tip of `mass` (kg) with `damping` (N s/m), held at x = 0 by a spring of 3000 N/m and
    /// released 1 mm inside a wall of `stiffness` (N/m) that responds 60 times a second. Returns
    /// the largest distance from equilibrium in the last of three seconds (m).
    fn swing(mass: f64, damping: f64, stiffness: f64, carried_on: bool) -> f64 {
        let (mut x, mut v, dt) = (0.001, 0.0, 1.0 / 480.0);
        let mut exchange = Exchange::new(DVec3::ZERO);
        let mut worst: f64 = 0.0;
        for step in 0..1440 {
            if step % 8 == 0 {
                let mut forces = [ToolForce::default(); 3];
                forces[1].contact.force.x = -stiffness * x;
                exchange.end_frame(x * DVec3::X, &forces);
            }
            let at = if carried_on { x * DVec3::X } else { exchange.at };
            v += dt * (exchange.load(at).force.x - damping * v - 3000.0 * x) / mass;
            x += dt * v;
            if step > 960 {
                worst = worst.max(x.abs());
            }
        }
        worst
    }

    #[test]
    fn carried_on_the_exchange_is_stable_where_it_would_swing() {
        let late = swing(3.0, 60.0, 2e4, false);
        assert!(late > 1e-3, "the late spring alone swings: {late} m");
        for stiffness in [100.0, 1e3, 8e3, 2e4] {
            let left = swing(3.0, 60.0, stiffness, true);
            assert!(left < 5e-5, "{stiffness} N/m: {left} m");
        }
    }

    /// A tip of 3 kg with a damping of 60 N s/m on a spring of 3000 N/m that presses with 5 N on a
    /// wall of `stiffness` (N/m), which only pushes. It is released 0.1 mm too deep. Returns the
    /// largest distance from where it is in balance in the last of three seconds (m).
    fn pressed(stiffness: f64, along: bool) -> f64 {
        let balance = 5.0 / (stiffness + 3000.0);
        let (mut x, mut v, dt) = (balance + 1e-4, 0.0, 1.0 / 480.0);
        let mut exchange = Exchange::new(DVec3::ZERO);
        let mut worst: f64 = 0.0;
        for step in 0..1440 {
            if step % 8 == 0 {
                let mut forces = [ToolForce::default(); 3];
                forces[1].contact.force.x = -stiffness * f64::max(x, 0.0);
                exchange.end_frame(x * DVec3::X, &forces);
                if !along {
                    exchange.more = 0.0;
                }
            }
            v += dt * (5.0 + exchange.load(x * DVec3::X).force.x - 60.0 * v - 3000.0 * x) / 3.0;
            x += dt * v;
            if step > 960 {
                worst = worst.max((x - balance).abs());
            }
        }
        worst
    }

    #[test]
    fn what_is_pressed_on_hard_contact_does_not_swing() {
        for stiffness in [4e4, 6e4, 9e4] {
            let (without, with) = (pressed(stiffness, false), pressed(stiffness, true));
            assert!(without > 2e-4 && with < 5e-5, "{stiffness} N/m: {without} m, then {with} m");
        }
    }

    #[test]
    fn at_rest_it_is_the_frames_force_and_never_beyond_the_limit() {
        let mut forces = [ToolForce::default(); 3];
        forces[0].constraint.force = DVec3::new(0.0, 0.3, -0.4);
        forces[2].contact.force = DVec3::Y;
        let mut exchange = Exchange::new(DVec3::ZERO);
        exchange.end_frame(DVec3::X, &forces);
        assert_eq!(exchange.load(DVec3::X).force, DVec3::new(0.0, 1.3, -0.4));
        forces[2].contact.force = 1e4 * DVec3::Y;
        exchange.end_frame(DVec3::X, &forces);
        assert!(exchange.limited && exchange.load(DVec3::X).force.length() <= MAX_LOAD + 1e-9);
    }
}
