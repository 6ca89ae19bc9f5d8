//! Progress as occasional plain lines, for standard error that goes into a file.

use indicatif::HumanDuration;
use std::time::{Duration, Instant};

/// Minimum time between two lines.
const LINE_INTERVAL: Duration = Duration::from_secs(30);

/// The progress of a stage, and the time of its last line.
pub struct Lines {
    stage: String,
    total: u64,
    done: u64,
    start: Instant,
    last_line: Instant,
}

impl Lines {
    /// A stage that begins `now`. A short stage gets no line.
    pub fn begin(stage: &str, total: u64, now: Instant) -> Self {
        Self { stage: stage.to_owned(), total, done: 0, start: now, last_line: now }
    }

    /// Adds `units`. Returns a line if one is due `now`.
    pub fn advance(&mut self, units: u64, now: Instant) -> Option<String> {
        self.done = self.done.saturating_add(units);
        if now.saturating_duration_since(self.last_line) < LINE_INTERVAL || self.done == 0 {
            return None;
        }
        self.last_line = now;
        let passed = now.saturating_duration_since(self.start);
        let share = self.total.saturating_sub(self.done) as f64 / self.done as f64;
        let left = Duration::try_from_secs_f64(passed.as_secs_f64() * share).unwrap_or(Duration::MAX);
        let (stage, done, total) = (&self.stage, self.done, self.total);
        Some(format!("{stage}: {done} of {total} after {:#}, {:#} left", HumanDuration(passed), HumanDuration(left)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_is_due_twice_a_minute_with_the_time_left() {
        let begun = Instant::now();
        let at = |s: u64| begun + Duration::from_secs(s);
        let mut lines = Lines::begin("episodes", 100, begun);
        assert_eq!(lines.advance(5, at(20)), None);
        assert_eq!(lines.advance(5, at(40)).as_deref(), Some("episodes: 10 of 100 after 40s, 6m left"));
        assert_eq!(lines.advance(10, at(60)), None);
        assert_eq!(lines.advance(30, at(100)).as_deref(), Some("episodes: 50 of 100 after 2m, 2m left"));
        // More units than the total, and none.
        assert!(lines.advance(u64::MAX, at(1000)).unwrap().ends_with(" 0s left"));
        let mut long = Lines::begin("steps", u64::MAX, begun);
        assert_eq!(long.advance(0, at(50)), None);
        assert!(long.advance(1, at(1_000_000)).is_some());
    }
}
