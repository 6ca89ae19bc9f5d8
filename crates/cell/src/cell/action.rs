//! Actions: what both arms are told for one control period, and what is wrong with one.

use crate::{Error, Result};
use trocar_robot::instrument::{Coordinates, Limits};

/// Numbers an arm.
pub const NUMBERS: usize = 5;

/// Fastest that a tip is commanded to move [m/s]: twice as fast as the task moves it.
pub const TIP_SPEED: f64 = 0.1;

/// Fastest that a shaft is commanded to swing in its port [rad/s]: what the arms' reference follows
/// without falling behind.
pub const SWING_SPEED: f64 = 0.9;

/// Fastest that an instrument is commanded to roll [rad/s].
pub const ROLL_SPEED: f64 = 2.0;

/// What the numbers of an action are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ActionSpace {
    /// Per arm: two pivots [rad], insertion [m], roll [rad], jaw opening 0 to 1; absolute targets.
    Pivots,
    /// Per arm: motion of the tip along the cell's x, y and z [m], change of the roll [rad], both
    /// from what was commanded last; jaw opening 0 to 1.
    Tip,
}

/// What the arms are told for one control period; the left arm's numbers first.
#[derive(Clone, Debug, PartialEq)]
pub struct Action {
    /// What the numbers are.
    pub space: ActionSpace,
    /// Five an arm.
    pub numbers: Vec<f64>,
}

impl Action {
    /// Absolute targets, one an arm.
    pub fn pivots(targets: &[Coordinates]) -> Self {
        Self { space: ActionSpace::Pivots, numbers: targets.iter().flat_map(Coordinates::to_action).collect() }
    }
}

impl ActionSpace {
    /// The names of an arm's numbers in this space.
    pub fn names(self) -> [&'static str; NUMBERS] {
        match self {
            Self::Pivots => ["first pivot", "second pivot", "insertion", "roll", "jaw"],
            Self::Tip => ["tip x", "tip y", "tip z", "roll change", "jaw"],
        }
    }
}

/// The five numbers of an arm, checked for what can be said of them without knowing where the arm
/// is.
pub(super) struct Checker<'a> {
    pub space: ActionSpace,
    /// Name of the arm, and place of its first number.
    pub arm: &'a str,
    pub first: usize,
    pub limits: &'a Limits,
    /// Length of the control period [s].
    pub period: f64,
}

impl Checker<'_> {
    /// # Errors
    /// Names the number that is not finite or out of range.
    pub fn check(&self, numbers: &[f64]) -> Result<()> {
        if let Some(k) = numbers.iter().position(|a| !a.is_finite()) {
            return Err(self.refuse(k, format!("is {}; it must be finite", numbers[k])));
        }
        match self.space {
            ActionSpace::Pivots => self.check_pivots(numbers)?,
            ActionSpace::Tip => self.check_tip(numbers)?,
        }
        self.within(4, numbers[4], [0.0, 1.0], "")
    }

    fn check_pivots(&self, n: &[f64]) -> Result<()> {
        let tilt = Coordinates { pivots: [n[0], n[1]], ..Coordinates::default() }.tilt();
        let right = n[0].abs() < std::f64::consts::FRAC_PI_2 && n[1].abs() < std::f64::consts::FRAC_PI_2;
        // Rounding on the way through an action must not refuse what is at the limit.
        if !right || tilt > self.limits.tilt + 1e-9 {
            let k = usize::from(n[1].abs() > n[0].abs());
            let (is, most) = (tilt.to_degrees(), self.limits.tilt.to_degrees());
            let reason =
                format!("is {:.4} rad, with which the shaft tilts by {is:.1} degrees; at most {most:.1}", n[k]);
            return Err(self.refuse(k, reason));
        }
        self.within(2, n[2], self.limits.insertion, " m")?;
        self.within(3, n[3], self.limits.roll, " rad")
    }

    fn check_tip(&self, n: &[f64]) -> Result<()> {
        let most = TIP_SPEED * self.period;
        for k in 0..3 {
            self.within(k, n[k], [-most, most], " m a step")?;
        }
        let most = ROLL_SPEED * self.period;
        self.within(3, n[3], [-most, most], " rad a step")
    }

    fn within(&self, k: usize, value: f64, [low, high]: [f64; 2], unit: &str) -> Result<()> {
        if value >= low - 1e-9 && value <= high + 1e-9 {
            return Ok(());
        }
        Err(self.refuse(k, format!("is {value}{unit}; {low:.4} to {high:.4}{unit}")))
    }

    fn refuse(&self, k: usize, reason: String) -> Error {
        Error::Action { index: self.first + k, name: format!("{} {}", self.arm, self.space.names()[k]), reason }
    }
}

/// The coordinates on the way from `from` to `to` that can be commanded next, and whether that is
/// not all of the way: within a period of `period` [s] the tip goes no faster than [`TIP_SPEED`],
/// the shaft swings no faster than [`SWING_SPEED`] and rolls no faster than [`ROLL_SPEED`]. The jaw
/// has a drive of its own.
pub(super) fn paced(from: &Coordinates, to: &Coordinates, period: f64) -> (Coordinates, bool) {
    let swing = [0, 1].map(|k| to.pivots[k] - from.pivots[k]);
    let (push, turn) = (to.insertion - from.insertion, to.roll - from.roll);
    let arm = from.insertion.max(to.insertion);
    let angle = swing[0].hypot(swing[1]);
    let way = push.hypot(arm * angle);
    let share = [TIP_SPEED / way, SWING_SPEED / angle, ROLL_SPEED / turn.abs()].map(|s| s * period);
    let share = share.into_iter().fold(1.0, f64::min);
    if share >= 1.0 {
        return (*to, false);
    }
    let pivots = [0, 1].map(|k| from.pivots[k] + share * swing[k]);
    let (insertion, roll) = (from.insertion + share * push, from.roll + share * turn);
    (Coordinates { pivots, insertion, roll, jaw: to.jaw }, true)
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits { tilt: 0.5, insertion: [0.03, 0.12], roll: [-2.7, 2.7] };

    fn said(space: ActionSpace, numbers: [f64; 5]) -> Option<String> {
        let checker = Checker { space, arm: "right", first: 5, limits: &LIMITS, period: 1.0 / 30.0 };
        checker.check(&numbers).err().map(|e| e.to_string())
    }

    #[test]
    fn what_is_wrong_is_named() {
        use ActionSpace::{Pivots, Tip};
        assert_eq!(said(Pivots, [0.1, -0.2, 0.1, 1.0, 0.5]), None);
        assert_eq!(said(Tip, [0.001, -0.002, 0.003, 0.01, 0.0]), None);
        let bad = |space, numbers, words: &[&str]| {
            let text = said(space, numbers).unwrap_or_default();
            assert!(words.iter().all(|w| text.contains(w)), "{text:?}");
        };
        bad(Pivots, [f64::NAN, 0.0, 0.1, 0.0, 0.0], &["action[5]", "right first pivot", "finite"]);
        bad(Pivots, [0.2, 0.49, 0.1, 0.0, 0.0], &["action[6]", "tilts"]);
        bad(Pivots, [3.0, 0.0, 0.1, 0.0, 0.0], &["first pivot"]);
        bad(Pivots, [0.0, 0.0, 0.2, 0.0, 0.0], &["action[7]", "insertion", "0.12"]);
        bad(Pivots, [0.0, 0.0, 0.1, 3.0, 0.0], &["roll"]);
        bad(Pivots, [0.0, 0.0, 0.1, 0.0, 1.2], &["action[9]", "jaw"]);
        bad(Tip, [0.0, 0.0, -0.02, 0.0, 0.0], &["tip z", "a step"]);
        bad(Tip, [0.0, 0.0, 0.0, 0.5, 0.0], &["roll change"]);
        bad(Tip, [0.0, 0.0, 0.0, 0.0, f64::INFINITY], &["jaw"]);
    }

    #[test]
    fn far_targets_are_approached_at_the_greatest_speed() {
        let at = Coordinates { insertion: 0.1, ..Coordinates::default() };
        let near = Coordinates { pivots: [0.01, 0.0], insertion: 0.101, roll: 0.02, jaw: 1.0 };
        assert_eq!(paced(&at, &near, 1.0 / 30.0), (near, false));
        let far = Coordinates { pivots: [0.3, -0.2], insertion: 0.05, roll: 2.0, jaw: 1.0 };
        let (next, short) = paced(&at, &far, 1.0 / 30.0);
        assert!(short && next.jaw == 1.0 && next.roll < ROLL_SPEED / 30.0 + 1e-12);
        assert!((at.insertion - next.insertion) < TIP_SPEED / 30.0);
        let mut now = at;
        for _ in 0..100 {
            now = paced(&now, &far, 1.0 / 30.0).0;
        }
        assert_eq!(now, far);
    }
}
