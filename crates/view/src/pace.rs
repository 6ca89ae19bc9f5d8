//! The pace of a simulation: simulated over wall time, as wanted and as it is.

use std::collections::VecDeque;
use std::time::{Duration, Instant};

/// Lateness after which lost time is given up (s of wall time).
const MAX_LATE: Duration = Duration::from_millis(50);
/// The wall time over which the actual rate is measured.
const WINDOW: Duration = Duration::from_millis(1000);

/// When what is to happen.
#[derive(Debug)]
pub(crate) struct Pace {
    /// Simulated over wall time; 0 for as fast as it goes.
    factor: f64,
    /// When the next period is due.
    next: Instant,
    /// Ends of periods, with the time simulated in each (s).
    done: VecDeque<(Instant, f64)>,
}

impl Pace {
    pub fn new(factor: f64) -> Self {
        Self { factor, next: Instant::now(), done: VecDeque::new() }
    }

    pub fn factor(&self) -> f64 {
        self.factor
    }

    pub fn set_factor(&mut self, factor: f64) {
        self.factor = factor;
        self.restart();
    }

    /// The next period is due now, and the rate is measured from here.
    pub fn restart(&mut self) {
        self.next = Instant::now();
        self.done.clear();
    }

    /// When the next period is due.
    pub fn due(&self) -> Instant {
        self.next
    }

    /// When what comes `seconds` of simulated time after the period's beginning is due.
    pub fn due_after(&self, begin: Instant, seconds: f64) -> Instant {
        if self.factor > 0.0 { begin + Duration::from_secs_f64(seconds / self.factor) } else { begin }
    }

    /// A period begins. Returns when it was due: what comes after is relative to that.
    pub fn begin(&mut self, now: Instant) -> Instant {
        if self.factor == 0.0 || now.saturating_duration_since(self.next) > MAX_LATE {
            self.next = now;
        }
        self.next
    }

    /// A period of `seconds` is over.
    pub fn end(&mut self, seconds: f64) {
        let now = Instant::now();
        if self.done.is_empty() {
            // The first period's own wall time is not known.
            self.done.push_back((now, 0.0));
        } else {
            self.done.push_back((now, seconds));
        }
        while self.done.len() > 2 && self.done.get(1).is_some_and(|(t, _)| now.duration_since(*t) > WINDOW) {
            self.done.pop_front();
        }
        self.next = if self.factor > 0.0 { self.next + Duration::from_secs_f64(seconds / self.factor) } else { now };
    }

    /// Simulated over wall time in the last second; 0 before it is known.
    pub fn actual(&self) -> f64 {
        let (Some((first, _)), Some((last, _))) = (self.done.front(), self.done.back()) else { return 0.0 };
        let wall = last.duration_since(*first).as_secs_f64();
        let simulated: f64 = self.done.iter().skip(1).map(|(_, s)| s).sum();
        if wall > 0.0 { simulated / wall } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn periods_follow_the_factor_and_lost_time_is_given_up() {
        let mut pace = Pace::new(2.0);
        let first = pace.due();
        assert_eq!(pace.begin(first), first);
        pace.end(0.1);
        assert_eq!(pace.due() - first, Duration::from_millis(50));
        let late = first + Duration::from_secs(3);
        assert_eq!(pace.begin(late), late);
        assert_eq!(pace.due_after(late, 0.1) - late, Duration::from_millis(50));
        pace.set_factor(0.0);
        assert_eq!(pace.due_after(late, 0.1), late);
    }
}
