//! The jaw's drive: it closes until tissue pushes back with the force budget, and holds that force.
//! It opens with a small force: that of a handle's spring.
//!
//! A drive that is commanded by angle crushes soft tissue or loses it. This one is commanded by
//! force. It closes at a limited speed that falls as the force nears the budget, and opens when it
//! is above. At 60 commands a second against contact, which is stiff, a fixed gain would be
//! unstable or slow; so every step is at most half of the step that would meet the budget by the
//! stiffness seen so far (a secant through the last two frames).

use crate::FRAME;
use crate::gripper::MAX_ANGLE;

/// Default force of the jaws (N). It squeezes the appendix (9 mm, 12 kPa) to about 3 mm; two blades
/// with friction 0.6 then hold 0.6 N, and a lift of 15 mm needs 0.2 to 0.4 N. See
/// `docs/measurements/grasp.md`.
pub const JAW_FORCE: f64 = 0.5;

/// Largest force with which jaws open against tissue, the bed and pinned tissue (N), if the drive
/// has that much.
const OPENING_FORCE: f64 = 1.0;

/// Time from wide open to closed, without tissue (s).
const CLOSING_TIME: f64 = 0.3;

/// Share of the way to the budget that one step goes.
const GAIN: f64 = 0.5;

/// Within this share of the budget the jaw stands still, and held tissue comes to rest.
const DEADBAND: f64 = 0.02;

/// Decay of the stiffest secant from one frame to the next: the jaw stays slow for a while after it
/// met stiff tissue.
const FORGETTING: f64 = 0.8;

/// Minimum motion for a secant (rad); below it, creep would be mistaken for stiffness.
const LEAST_MOTION: f64 = 1e-4;

/// A force-controlled jaw.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Jaw {
    /// Force with which it presses (N).
    pub budget: f64,
    /// Widest angle (rad).
    max_angle: f64,
    /// Fastest motion (rad a frame).
    fastest: f64,
    /// Direction of the last press: -1 closed the jaw, 1 opened it.
    direction: f64,
    /// Stiffness seen so far in that direction: opening force per closing angle (N/rad).
    stiffness: f64,
    /// Angle (rad) and opening force (N) a frame ago.
    last: Option<(f64, f64)>,
}

impl Jaw {
    /// A jaw that presses with `budget` (N), opens to [`MAX_ANGLE`](crate::MAX_ANGLE) and closes in
    /// 0.3 s.
    pub fn new(budget: f64) -> Self {
        Self::sized(budget, MAX_ANGLE, CLOSING_TIME)
    }

    /// A jaw that presses with `budget` (N), opens to `max_angle` (rad) and closes in
    /// `closing_time` (s).
    pub fn sized(budget: f64, max_angle: f64, closing_time: f64) -> Self {
        Self {
            budget,
            max_angle,
            fastest: max_angle * FRAME / closing_time,
            direction: -1.0,
            stiffness: 0.0,
            last: None,
        }
    }

    /// The angle (rad) at the end of the next frame, for a jaw at `angle` that tissue pushes open
    /// with `force` (N). 0 to the widest.
    pub fn squeeze(&mut self, angle: f64, force: f64) -> f64 {
        self.press(angle, force, -1.0, self.budget)
    }

    /// Largest force with which the jaw opens (N).
    pub fn opening_force(&self) -> f64 {
        self.budget.min(OPENING_FORCE)
    }

    /// The same for a jaw that opens to `target` (rad).
    pub fn open(&mut self, angle: f64, target: f64, force: f64) -> f64 {
        self.press(angle, force, 1.0, self.opening_force()).min(target)
    }

    /// The angle (rad) after a frame in which the jaw presses with `budget` (N) in one `direction`:
    /// -1 closes it, 1 opens it.
    fn press(&mut self, angle: f64, force: f64, direction: f64, budget: f64) -> f64 {
        if self.direction != direction {
            (self.direction, self.stiffness, self.last) = (direction, 0.0, None);
        }
        self.stiffness *= FORGETTING;
        if let Some((then, was)) = self.last
            && (then - angle).abs() > LEAST_MOTION
        {
            self.stiffness = self.stiffness.max((force - was) / (then - angle));
        }
        self.last = Some((angle, force));
        let missing = budget + direction * force;
        if missing.abs() <= DEADBAND * budget {
            return angle;
        }
        let fastest = self.fastest * (missing.abs() / budget).min(1.0);
        let step = if self.stiffness > 0.0 { (GAIN * missing.abs() / self.stiffness).min(fastest) } else { fastest };
        (angle + direction * step.copysign(missing)).clamp(0.0, self.max_angle)
    }

    /// The numbers of its state.
    pub(crate) fn numbers(&self) -> impl Iterator<Item = f64> + use<> {
        let Self { budget, max_angle: _, fastest: _, direction, stiffness, last } = *self;
        let (angle, force) = last.unwrap_or((-1.0, 0.0));
        [budget, direction, stiffness, angle, force].into_iter()
    }

    /// Forgets the contact.
    pub fn rest(&mut self) {
        (self.direction, self.stiffness, self.last) = (-1.0, 0.0, None);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Closes on a spring with the force `spring(angle, change of angle in the last frame)`;
    /// returns the final angle and the forces of 90 frames.
    fn close_on(spring: impl Fn(f64, f64) -> f64, budget: f64) -> (f64, Vec<f64>) {
        let mut jaw = Jaw::new(budget);
        let (mut angle, mut force) = (MAX_ANGLE, 0.0);
        let mut forces = Vec::new();
        for _ in 0..90 {
            let next = jaw.squeeze(angle, force);
            assert!((next - angle).abs() <= jaw.fastest + 1e-12, "faster than the drive");
            force = spring(next, next - angle);
            angle = next;
            forces.push(force);
        }
        (angle, forces)
    }

    #[test]
    fn it_keeps_the_budget_on_soft_and_on_stiff_things() {
        // Newtons per radian: tissue 1 to 10, steel 100,000.
        for stiffness in [1.0, 5.0, 50.0, 1e3, 1e5] {
            for budget in [0.2, 1.0, 5.0] {
                let (angle, forces) = close_on(|a, _| stiffness * (0.7 - a).max(0.0), budget);
                let reached = (stiffness * 0.7).min(budget);
                let last = &forces[70..];
                assert!(last.iter().all(|f| (f - reached).abs() < 0.05 * budget), "{stiffness} {budget}: {last:?}");
                assert!((0.0..=MAX_ANGLE).contains(&angle));
            }
        }
    }

    #[test]
    fn it_does_not_overshoot_tissue_that_stiffens() {
        // An exponential spring that creeps, like squeezed tissue: its force depends on the speed,
        // too.
        let creeping = |a: f64, turn: f64| 0.02 * ((8.0 * (0.8 - a).max(0.0)).exp() - 1.0) - 3.0 * turn;
        let (_, forces) = close_on(|a, turn| if a < 0.8 { creeping(a, turn) } else { 0.0 }, 1.0);
        assert!(forces.iter().all(|f| *f < 1.3), "{forces:?}");
        assert!(forces[70..].iter().all(|f| (f - 1.0).abs() < 0.05), "{forces:?}");
    }

    #[test]
    fn it_opens_with_no_more_than_the_budget() {
        // Tissue of some stiffness (N/rad) around the blades from 0.3 rad on.
        for stiffness in [1.0, 5.0, 50.0, 1e3] {
            let (mut jaw, mut angle, mut force) = (Jaw::new(0.5), 0.0, 0.0);
            for _ in 0..90 {
                angle = jaw.open(angle, 0.9, force);
                force = -stiffness * (angle - 0.3).max(0.0);
            }
            let reached = (stiffness * 0.6).min(0.5);
            assert!((-force - reached).abs() < 0.025 && angle <= 0.9, "{stiffness}: {force} N at {angle} rad");
        }
    }

    #[test]
    fn on_nothing_it_closes() {
        let (angle, _) = close_on(|_, _| 0.0, 1.0);
        assert_eq!(angle, 0.0);
    }
}
