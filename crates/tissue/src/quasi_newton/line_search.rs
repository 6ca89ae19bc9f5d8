//! The line search: how far an island goes along its direction for the slope to become small.

use super::island_system::IslandSystem;

/// A slope of this share of the first one, falling or rising, is small enough.
const SLOPE_SHARE: f32 = 0.5;

/// Greatest number of shares that a search tries after the first.
const MAX_LINE_SEARCH_TRIALS: usize = 8;

/// Greatest factor of a share that another one is inferred from.
const MAX_GROWTH: f32 = 5.0;

/// The result of a search.
pub(super) enum Found {
    /// A step was taken; gradient and history are up to date.
    Step,
    /// No step helps; positions are unchanged.
    Nothing,
}

impl IslandSystem<'_> {
    fn slope(&mut self) -> f32 {
        self.active().map(|body| body.slope()).fold(0.0, |sum, part| sum + part)
    }

    fn next_slope(&mut self) -> f32 {
        self.active().map(|body| body.next_slope()).fold(0.0, |sum, part| sum + part)
    }

    /// Moves along the direction: by all of it if the slope does not rise too much, else until the
    /// slope is small.
    pub(super) fn search(&mut self) -> Found {
        let mut slope = self.slope();
        if slope.is_nan() || slope >= 0.0 {
            // The history misleads; the preconditioner alone always gives a descent direction.
            self.history.clear();
            self.find_direction();
            slope = self.slope();
            if slope.is_nan() || slope >= 0.0 {
                return Found::Nothing;
            }
        }
        self.active().for_each(|body| body.iterate.base.copy_from_slice(&body.iterate.x[..body.layout.rows]));
        // The minimum lies between a share with a negative slope and one with a positive slope.
        let (mut share, mut below, mut above) = (1.0f32, (0.0f32, slope), None);
        for trial in 0..=MAX_LINE_SEARCH_TRIALS {
            let h = self.h;
            self.for_active(|body| body.progress.stepped = body.apply_step(share, h));
            if !self.active().all(|body| body.progress.stepped) {
                return self.turn_back();
            }
            // Steps of squeezed elements' nodes may have been shortened.
            slope = self.slope();
            if below.0 == 0.0 {
                below.1 = slope;
            }
            self.take_gradient();
            let there = self.next_slope();
            if !(slope < 0.0 && there.is_finite()) {
                return self.turn_back();
            }
            let last = trial == MAX_LINE_SEARCH_TRIALS;
            let falls = there <= SLOPE_SHARE * slope.abs();
            if falls && (above.is_none() || there >= -SLOPE_SHARE * slope.abs() || last) {
                // Where the slope would vanish if it were linear.
                let best = share * (slope / (slope - there).min(-f32::MIN_POSITIVE)).min(MAX_GROWTH);
                // Free bodies go as far as the coarse half of the preconditioner says.
                if !self.all().any(|body| body.is_free()) {
                    self.history.learn_scale(best);
                }
                break;
            }
            if last {
                return self.turn_back();
            }
            if falls {
                below = (share, there);
            } else {
                above = Some((share, there));
            }
            share = between(below, above.unwrap_or((share, there)));
        }
        self.active().for_each(|body| body.elements.accept());
        self.record_step(share);
        self.accept_gradient();
        self.active().for_each(|body| body.update_contacts());
        Found::Step
    }

    /// Restores the positions before the search.
    fn turn_back(&mut self) -> Found {
        self.active().for_each(|body| {
            let (free, iterate) = (body.layout.free, &mut body.iterate);
            iterate.x[..free].copy_from_slice(&iterate.base[..free]);
        });
        Found::Nothing
    }
}

/// A share between two at which the slope falls and rises: where it would vanish if it were linear,
/// but on a logarithmic scale while they are far apart.
fn between((low, falls): (f32, f32), (high, rises): (f32, f32)) -> f32 {
    let secant = low + (high - low) * (falls / (falls - rises)).clamp(0.1, 0.9);
    let least = 0.02 * high;
    if low > 0.0 && high > 4.0 * low { (low * high).sqrt() } else { secant.max(least) }
}
