//! How far jaws close on tissue: to a share of the opening at which they met it.
//!
//! Tissue between the blades is compressed to the same share of its thickness, whatever its
//! stiffness, and presses on them in proportion to its stiffness. So soft tissue is held with
//! little force and not crushed. Stiff tissue is held with all the force of the jaws, which do not
//! reach that share.

/// Force on the blades (N) from which on they have met something.
pub(super) const TOUCH: f64 = 0.002;

/// Share of the opening at the first touch to which the jaws close at first.
const SHARE: f64 = 0.36;

/// Range of that share.
const SHARES: [f64; 2] = [0.2, 0.5];

/// Smallest opening to which they close on what they have met: blades that are closer than the skin
/// of either hold nothing.
pub(super) const LEAST_OPENING: f64 = 0.15;

/// A fold of wide tissue is pressed to this multiple of that share: jaws that close further on it
/// push their tips through the surface beside it.
const FOLD: f64 = 1.4;

/// Force on the blades (N) with which a fold of soft tissue bears its weight. Jaws that feel less
/// force close further until they feel it, in steps of this opening a period. Jaws take hold when
/// they stop for 0.1 s, and shorter steps would count as stops.
const BEARS: f64 = 0.18;
const FOLD_STEP: f64 = 0.06;

/// Change of the opening after which jaws take hold where they stop.
const LEAST_MOTION: f64 = 0.005;

/// Change of the share for the next grasp: after tissue slipped or was missed, and after it was
/// strained too much.
const TIGHTER: f64 = 0.85;
const LOOSER: f64 = 1.3;

/// The closing of one pair of jaws.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Grip {
    share: f64,
    /// Whether this closing gathers a fold of wide tissue.
    folds: bool,
    /// Opening at which this closing met something.
    touched: Option<f64>,
    /// Opening at which it has gathered a fold that bears the weight.
    gathered: Option<f64>,
}

impl Default for Grip {
    fn default() -> Self {
        Self { share: SHARE, folds: false, touched: None, gathered: None }
    }
}

impl Grip {
    /// Begins a closing: around tissue or, with `folds`, on a fold of it.
    pub fn begin(&mut self, folds: bool) {
        (self.touched, self.gathered, self.folds) = (None, None, folds);
    }

    /// The commanded opening for jaws that are open by `opening` and pushed apart with `force` (N).
    pub fn opening(&mut self, opening: f64, force: f64) -> f64 {
        if self.touched.is_none() && force > TOUCH {
            self.touched = Some(opening);
        }
        let Some(touched) = self.touched else { return 0.0 };
        if self.folds {
            return self.fold(touched, opening, force);
        }
        (self.share * touched).max(LEAST_OPENING).min(opening)
    }

    /// The commanded opening on a fold.
    fn fold(&mut self, touched: f64, opening: f64, force: f64) -> f64 {
        let least = (FOLD * self.share * touched).max(LEAST_OPENING);
        // After tissue was strained, the share is larger and the force smaller.
        let bears = force >= BEARS * SHARE / self.share;
        if self.gathered.is_none() && opening <= least + FOLD_STEP && bears {
            // Jaws take hold only where they come to by closing.
            self.gathered = Some((opening - LEAST_MOTION).min(least).max(LEAST_OPENING));
        }
        self.gathered.unwrap_or_else(|| if opening > least { least } else { (opening - FOLD_STEP).max(LEAST_OPENING) })
    }

    /// The held tissue slipped: the next grasp is tighter.
    pub fn slipped(&mut self) {
        self.change(TIGHTER);
    }

    /// The grasp held nothing: the tissue was strained too much (`strained`), or the jaws did not
    /// close enough on it.
    pub fn missed(&mut self, strained: bool) {
        self.change(if strained { LOOSER } else { TIGHTER });
    }

    fn change(&mut self, factor: f64) {
        self.share = (factor * self.share).clamp(SHARES[0], SHARES[1]);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Closes at full speed on a spring of `stiffness` (N per opening) from opening 0.6 on: the
    /// opening and the force where the jaws stop, by their command or by their force of 0.5 N.
    fn close(grip: &mut Grip, stiffness: f64) -> (f64, f64) {
        grip.begin(false);
        let force = |opening: f64| stiffness * (0.6 - opening).max(0.0);
        let mut opening: f64 = 1.0;
        for _ in 0..60 {
            let wanted = grip.opening(opening, force(opening));
            opening = (opening - 0.05).max(wanted).max(0.6 - 0.5 / stiffness);
        }
        (opening, force(opening))
    }

    #[test]
    fn soft_tissue_is_squeezed_as_far_as_stiff_tissue_and_no_further() {
        let (soft, softer) = (close(&mut Grip::default(), 0.4), close(&mut Grip::default(), 0.1));
        assert!(soft.1 < 0.5 && (soft.0 - softer.0).abs() < 0.02, "{soft:?} {softer:?}");
        assert!((soft.1 / softer.1 - 4.0).abs() < 0.3, "force in proportion to stiffness: {soft:?} {softer:?}");
        let stiff = close(&mut Grip::default(), 10.0);
        assert!((stiff.1 - 0.5).abs() < 1e-9 && stiff.0 > 0.5, "all the force: {stiff:?}");
    }

    /// Closes at full speed on a fold of `stiffness` (N per opening) that fills the open jaws: the
    /// opening, the force, and the longest stop on the way (periods).
    fn gather(stiffness: f64) -> (f64, f64, usize) {
        let mut grip = Grip::default();
        grip.begin(true);
        let force = |opening: f64| stiffness * (1.02 - opening).max(0.0);
        let (mut opening, mut stops, mut longest): (f64, usize, usize) = (1.0, 0, 0);
        for _ in 0..40 {
            let wanted = grip.opening(opening, force(opening));
            // Two frames of tissue; a stop is a frame that ends where the jaws are to be.
            for _ in 0..2 {
                opening = (opening - 1.0 / 18.0).max(wanted);
                stops = if opening == wanted { stops + 1 } else { 0 };
            }
            longest = if grip.gathered.is_none() { longest.max(stops) } else { longest };
        }
        (opening, force(opening), longest)
    }

    #[test]
    fn a_fold_is_pressed_to_half_and_soft_tissue_until_it_bears_its_weight() {
        let (stiff, soft, softest) = (gather(2.0), gather(0.25), gather(0.1));
        assert!((stiff.0 - 0.5).abs() < 0.01, "{stiff:?}");
        assert!(soft.0 < 0.4 && (BEARS..1.3 * BEARS).contains(&soft.1), "{soft:?}");
        assert!((softest.0 - LEAST_OPENING).abs() < 1e-9, "no further: {softest:?}");
        assert!(stiff.2.max(soft.2) < 6, "the jaws took hold on the way: {stiff:?} {soft:?}");
    }

    #[test]
    fn it_learns_from_what_slipped_and_what_was_crushed() {
        let at = |learn: fn(&mut Grip)| {
            let mut grip = Grip::default();
            learn(&mut grip);
            close(&mut grip, 0.4).0
        };
        assert!(at(Grip::slipped) < at(|_| ()) && at(|g| g.missed(true)) > at(|_| ()));
        let mut grip = Grip::default();
        (0..20).for_each(|_| grip.slipped());
        assert!(close(&mut grip, 0.4).0 >= LEAST_OPENING);
        assert_eq!(close(&mut Grip::default(), 0.0).0, 0.0, "on nothing they close");
    }
}
