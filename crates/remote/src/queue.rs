//! Plays chunks of actions at a constant rate and requests the next chunk in time.

use crate::actions::Actions;
use crate::error::{Error, Result};

/// Rate and length of playback.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Playback {
    /// Actions a second.
    pub rate_hz: f64,
    /// Number of actions of a chunk that are played before the next chunk is requested. The rest is
    /// dropped; a shorter chunk is played whole.
    pub replan: usize,
}

impl Default for Playback {
    fn default() -> Self {
        Self { rate_hz: 30.0, replan: 8 }
    }
}

/// Plays chunks by simulation time, which does not advance while the policy computes.
#[derive(Clone, Debug)]
pub struct ActionQueue {
    playback: Playback,
    chunk: Option<Actions>,
    /// Start time of the chunk (s).
    start: f64,
}

impl ActionQueue {
    /// An empty queue.
    ///
    /// # Errors
    /// [`Error::Endpoint`] for a rate that is not positive or a replan interval of 0.
    pub fn new(playback: Playback) -> Result<Self> {
        let wrong = |field, reason: &str| Err(Error::Endpoint { field, reason: reason.into() });
        if !(playback.rate_hz.is_finite() && playback.rate_hz > 0.0) {
            return wrong("rate_hz", "must be a positive number of actions a second");
        }
        if playback.replan == 0 {
            return wrong("replan", "must be at least 1 action");
        }
        Ok(Self { playback, chunk: None, start: 0.0 })
    }

    /// Drops the chunk, at the start of an episode. The next call requests a new one.
    pub fn clear(&mut self) {
        self.chunk = None;
    }

    /// The action at simulation time `time` (s). Calls `infer` when the chunk has been played or
    /// when time has gone back.
    ///
    /// # Errors
    /// Those of `infer`. The queue is then empty.
    pub fn at(&mut self, time: f64, infer: impl FnOnce() -> Result<Actions>) -> Result<&[f64]> {
        let rate = self.playback.rate_hz;
        // Rounding must not delay an action that starts with a frame.
        let tick = |start: f64| ((time - start) * rate + 1e-6).floor();
        let played = self.chunk.as_ref().map_or(0, |c| c.horizon().min(self.playback.replan));
        let mut step = tick(self.start);
        if !(step >= 0.0 && step < played as f64) {
            self.chunk = None;
            let next = self.start + played as f64 / rate;
            // A frame may lie between two actions: the next chunk starts where the last one ended.
            self.start = if played > 0 && tick(next) == 0.0 { next } else { time };
            step = 0.0;
            self.chunk = Some(infer()?);
        }
        let chunk = self.chunk.as_ref().and_then(|c| c.step(step as usize));
        chunk.ok_or(Error::EmptyChunk { at: "queue".into(), shape: "[0]".into() })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;

    /// Plays `frames` frames at `fps`. Returns the actions and the number of inferences.
    fn play(playback: Playback, horizon: usize, fps: f64, frames: usize) -> (Vec<f64>, usize) {
        let mut queue = ActionQueue::new(playback).unwrap();
        let mut inferences = 0;
        let actions = (0..frames).map(|f| {
            let infer = || {
                inferences += 1;
                Actions::new(1, (0..horizon).map(|i| (100 * inferences + i) as f64).collect())
            };
            queue.at(f as f64 / fps, infer).unwrap()[0]
        });
        (actions.collect(), inferences)
    }

    #[test]
    fn eight_actions_at_thirty_hertz() {
        let (actions, inferences) = play(Playback::default(), 50, 60.0, 960);
        assert_eq!(inferences, 60);
        for (f, action) in actions.iter().enumerate() {
            let tick = f / 2;
            assert_eq!(*action, (100 * (tick / 8 + 1) + tick % 8) as f64, "frame {f}");
        }
    }

    #[test]
    fn short_chunks_and_odd_rates_keep_time() {
        assert_eq!(play(Playback::default(), 3, 30.0, 90).1, 30);
        // 7 s at 50 frames a second are 210 actions that do not start with frames.
        assert_eq!(play(Playback { rate_hz: 30.0, replan: 7 }, 16, 50.0, 350).1, 30);
        // With fewer frames than actions some actions are skipped.
        let (actions, inferences) = play(Playback { rate_hz: 30.0, replan: 6 }, 16, 10.0, 20);
        assert_eq!((&actions[..4], inferences), (&[100.0, 103.0, 200.0, 203.0][..], 10));
    }

    #[test]
    fn time_that_goes_back_requests_a_new_chunk() {
        let mut queue = ActionQueue::new(Playback::default()).unwrap();
        let mut inferences = 0;
        for time in [0.0, 0.1, 0.05, 0.02, f64::NAN, 0.0] {
            let infer = || {
                inferences += 1;
                Actions::new(2, vec![0.0; 16])
            };
            queue.at(time, infer).unwrap();
        }
        assert_eq!(inferences, 3);
        assert!(queue.at(9.0, || Err(Error::Interrupted)).is_err());
        assert!(ActionQueue::new(Playback { rate_hz: 0.0, replan: 8 }).is_err());
        assert!(ActionQueue::new(Playback { rate_hz: 30.0, replan: 0 }).is_err());
    }
}
