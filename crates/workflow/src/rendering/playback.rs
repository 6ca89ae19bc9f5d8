//! Sources of videos: motions that advance one control period at a time.

use super::script::ScriptedLift;
use crate::episode_replay::EpisodeReplay;
use crate::{Error, Result, check_interrupted};
use trocar_cell::Cell;
use trocar_core::Progress;

/// A motion in a cell.
pub(crate) trait Playback {
    /// A noun for messages.
    fn name(&self) -> &'static str;
    /// The cell in its present state.
    fn cell(&self) -> &Cell;
    /// Number of control periods, if known.
    fn periods(&self) -> Option<usize>;
    /// Advances one control period. Returns false at the end.
    fn advance(&mut self) -> Result<bool>;
    /// The first difference from a recording, if there is one.
    fn difference(&self) -> Option<String>;
}

impl Playback for ScriptedLift {
    fn name(&self) -> &'static str {
        "grasp-lift"
    }

    fn cell(&self) -> &Cell {
        ScriptedLift::cell(self)
    }

    fn periods(&self) -> Option<usize> {
        None
    }

    fn advance(&mut self) -> Result<bool> {
        ScriptedLift::advance(self)
    }

    fn difference(&self) -> Option<String> {
        None
    }
}

impl Playback for EpisodeReplay<'_> {
    fn name(&self) -> &'static str {
        "episode"
    }

    fn cell(&self) -> &Cell {
        self.episode().cell()
    }

    fn periods(&self) -> Option<usize> {
        Some(self.steps())
    }

    fn advance(&mut self) -> Result<bool> {
        Ok(EpisodeReplay::advance(self))
    }

    fn difference(&self) -> Option<String> {
        EpisodeReplay::difference(self).map(str::to_owned)
    }
}

/// Advances to a time (s), or to the end.
pub(crate) fn until(play: &mut dyn Playback, time: Option<f64>, progress: &dyn Progress) -> Result<()> {
    let periods = play.periods();
    let period = play.cell().period();
    let wanted = time.map(|t| (t / period).ceil() as usize);
    let total = wanted.or(periods).map_or(1, |n| n.min(periods.unwrap_or(n)) as u64);
    stage(progress, "simulate", total, || {
        while time.is_none_or(|time| play.cell().time() < time - 1e-9) {
            check_interrupted(progress)?;
            if !play.advance()? {
                let (Some(time), end) = (time, play.cell().time()) else { break };
                let name = play.name();
                return Err(Error::Mismatch(format!("--at is {time} s; the {name} ends after {end:.2} s")));
            }
            progress.advance(1);
        }
        Ok(())
    })
}

/// Runs `work` as a stage of `progress`, which also ends if the work fails.
pub(crate) fn stage<T>(progress: &dyn Progress, name: &str, total: u64, work: impl FnOnce() -> Result<T>) -> Result<T> {
    progress.begin(name, total);
    let done = work();
    progress.end();
    done
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicI32, Ordering};

    /// Number of open stages.
    struct Open(AtomicI32);

    impl Progress for Open {
        fn begin(&self, _stage: &str, _total: u64) {
            self.0.fetch_add(1, Ordering::Relaxed);
        }
        fn advance(&self, _units: u64) {}
        fn end(&self) {
            self.0.fetch_sub(1, Ordering::Relaxed);
        }
        fn interrupted(&self) -> bool {
            true
        }
    }

    #[test]
    fn a_stage_ends_if_its_work_fails() {
        let open = Open(AtomicI32::new(0));
        let during = stage(&open, "simulate", 1, || Ok(open.0.load(Ordering::Relaxed)));
        assert_eq!(during.unwrap(), 1);
        assert!(stage::<()>(&open, "simulate", 1, || Err(Error::Interrupted)).is_err());
        assert_eq!(open.0.load(Ordering::Relaxed), 0);
    }
}
