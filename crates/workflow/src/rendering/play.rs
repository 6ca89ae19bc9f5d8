//! What moving pictures are of: something that goes on a control period at a time.

use super::script::ScriptedLift;
use crate::replayed::Replayed;
use crate::{Error, Result};
use trocar_cell::Cell;
use trocar_core::Progress;

/// A cell in which something goes on.
pub(crate) trait Play {
    /// What it is, in a word.
    fn name(&self) -> &'static str;
    /// The cell as it is now.
    fn cell(&self) -> &Cell;
    /// Control periods to its end, where that is known.
    fn periods(&self) -> Option<usize>;
    /// Does one control period; false when it is over.
    fn advance(&mut self) -> Result<bool>;
    /// Where it is not what was recorded, if anything was.
    fn differs(&self) -> Option<String>;
}

impl Play for ScriptedLift {
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

    fn differs(&self) -> Option<String> {
        None
    }
}

impl Play for Replayed<'_> {
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
        Ok(Replayed::advance(self))
    }

    fn differs(&self) -> Option<String> {
        Replayed::differs(self).map(str::to_owned)
    }
}

/// Goes on to a time [s], or to the end.
///
/// # Errors
/// A time after the end, a step that cannot be done, an interruption.
pub(crate) fn until(play: &mut dyn Play, time: Option<f64>, progress: &dyn Progress) -> Result<()> {
    let most = play.periods();
    let period = play.cell().period();
    let wanted = time.map(|t| (t / period).ceil() as usize);
    let total = wanted.or(most).map_or(1, |n| n.min(most.unwrap_or(n)) as u64);
    stage(progress, "simulate", total, || {
        while time.is_none_or(|time| play.cell().time() < time - 1e-9) {
            if progress.interrupted() {
                return Err(Error::Interrupted);
            }
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

/// Does the work of a stage, which is over also where the work fails.
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

    /// Stages that are begun and not over.
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
    fn a_stage_is_over_where_its_work_fails() {
        let open = Open(AtomicI32::new(0));
        let during = stage(&open, "simulate", 1, || Ok(open.0.load(Ordering::Relaxed)));
        assert_eq!(during.unwrap(), 1);
        assert!(stage::<()>(&open, "simulate", 1, || Err(Error::Interrupted)).is_err());
        assert_eq!(open.0.load(Ordering::Relaxed), 0);
    }
}
