//! L-BFGS (Nocedal 1980): which of the last steps are in use.

/// Which pairs of steps and changes of the gradient are in use, and the numbers that all bodies of
/// an island share.
pub(crate) struct History {
    /// Room for so many pairs.
    pairs: usize,
    /// Pairs in use; the newest is that of this number.
    count: usize,
    newest: usize,
    /// The preconditioner's solutions are taken times this, as in Nocedal and Wright 2006,
    /// "Numerical Optimization", equation 7.20, but learned from the line search, which needs no
    /// other solve: the matrix at rest is too soft for squeezed and pressed tissue.
    pub scale: f32,
    /// The numbers of the pairs in use, newest first.
    pub used: Vec<usize>,
    /// Scratch of the two loops: factors of the pairs in use.
    pub shares: Vec<f64>,
}

/// A pair whose curvature is below this share of its lengths is not used.
const MIN_CURVATURE_SHARE: f64 = 1e-6;

/// Smallest scale of the preconditioner's solutions.
const MIN_SCALE: f32 = 0.3;

impl History {
    /// Room for `pairs`.
    pub fn new(pairs: usize) -> Self {
        let (used, shares) = (Vec::with_capacity(pairs), Vec::with_capacity(pairs));
        Self { pairs, count: 0, newest: 0, scale: 1.0, used, shares }
    }

    /// Forgets all pairs.
    pub fn clear(&mut self) {
        self.count = 0;
    }

    /// Forgets all pairs. Returns whether there was any.
    pub fn forget(&mut self) -> bool {
        std::mem::take(&mut self.count) > 0
    }

    /// Learns which share of a direction would have been `best`. What the pairs know already has
    /// the right length, so it is the rest that was too long or too short.
    pub fn learn_scale(&mut self, best: f32) {
        self.scale = (self.scale * best).clamp(MIN_SCALE, 1.0);
    }

    /// Lists the pairs in use. They end before one whose `curvature` is not positive, as when
    /// bodies have fallen asleep.
    pub fn list(&mut self, curvature: impl Fn(usize) -> f64) {
        self.used.clear();
        for age in 0..self.count {
            let at = (self.newest + self.pairs - age) % self.pairs;
            let positive = curvature(at) > f64::from(f32::MIN_POSITIVE);
            if !positive {
                break;
            }
            self.used.push(at);
        }
        self.count = self.used.len();
    }

    /// The number of the next pair, of which the list is free from now on; None without memory.
    pub fn next(&mut self) -> Option<usize> {
        let next = (self.newest + 1) % self.pairs.max(1);
        self.used.retain(|at| *at != next);
        (self.pairs > 0).then_some(next)
    }

    /// Takes the pair `next` into use if its step and its change fit: step . change, step . step
    /// and change . change.
    pub fn take(&mut self, next: usize, [curvature, steps, changes]: [f64; 3]) {
        let least = (MIN_CURVATURE_SHARE * (steps * changes).sqrt()).max(f64::from(f32::MIN_POSITIVE));
        if curvature > least {
            self.newest = next;
            self.count = (self.count + 1).min(self.pairs);
        } else {
            // The oldest pair was written over.
            self.count = self.count.min(self.pairs - 1);
        }
    }
}
