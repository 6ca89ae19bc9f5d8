//! Control delay: actions wait before they reach the arms.

use super::action::{Action, ActionSpace};
use std::collections::VecDeque;

/// How long actions wait: whole control periods, and physics steps of the arms beyond them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Delay {
    pub periods: usize,
    /// The step of a control period at which the arms get their commands.
    pub step: u32,
}

impl Delay {
    /// Of `seconds`, to the nearest of the arms' physics steps, of which there are `physics_hz` a
    /// second and `steps` in a control period.
    pub fn new(seconds: f64, physics_hz: u32, steps: u32) -> Self {
        let all = (seconds.max(0.0) * f64::from(physics_hz)).round() as u32;
        Self { periods: (all / steps.max(1)) as usize, step: all % steps.max(1) }
    }
}

/// Actions that have been given and have not reached the arms, the oldest first; `None` for a
/// period without one.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Waiting(pub VecDeque<Option<Action>>);

impl Waiting {
    /// The action that arrives after `periods` of waiting. Before the first there is none.
    pub fn arrived(&mut self, periods: usize) -> Option<Action> {
        if self.0.len() > periods { self.0.pop_front().flatten() } else { None }
    }

    /// All its numbers, for the hash; none if no command waits.
    pub fn numbers(&self) -> impl Iterator<Item = f64> {
        let Self(waiting) = self;
        waiting.iter().flat_map(|action| match action {
            Some(Action { space, numbers }) => {
                let space = 1.0 + f64::from(u8::from(*space == ActionSpace::Tip));
                std::iter::once(space).chain(numbers.iter().copied())
            }
            None => std::iter::once(0.0).chain([].iter().copied()),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_delay_is_whole_periods_and_steps() {
        let of = |ms: f64| {
            let Delay { periods, step } = Delay::new(1e-3 * ms, 480, 16);
            (periods, step)
        };
        assert_eq!(
            [0.0, 1.0, 2.0, 33.0, 1000.0 / 30.0, 50.0].map(of),
            [(0, 0), (0, 0), (0, 1), (1, 0), (1, 0), (1, 8)]
        );
    }

    #[test]
    fn actions_arrive_in_order_after_their_wait() {
        let action = |n: f64| Some(Action { space: ActionSpace::Tip, numbers: vec![n] });
        let mut waiting = Waiting::default();
        let mut got = Vec::new();
        for given in [action(1.0), None, action(3.0), action(4.0)] {
            waiting.0.push_back(given);
            got.push(waiting.arrived(2));
        }
        assert_eq!(got, [None, None, action(1.0), None]);
        assert_eq!(waiting.numbers().collect::<Vec<_>>(), [2.0, 3.0, 2.0, 4.0]);
        assert_eq!(Waiting::default().arrived(0), None);
    }
}
