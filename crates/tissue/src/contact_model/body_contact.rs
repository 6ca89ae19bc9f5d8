//! How bodies touch each other.

/// Contact between the bodies of a model: from how near they press, how hard, and how they rub.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyContact {
    /// Gap at which surfaces begin to press (m); 1.5 mm by default. Bodies that were nearer than
    /// this at rest, or inside each other, begin to press when they come nearer than that.
    pub offset: f64,
    /// Coulomb friction coefficient; 0.6 by default.
    pub friction: f64,
    /// Stiffness of a node against another body, over Young's modulus times the node's size. At 0.5
    /// a pressure of a tenth of Young's modulus closes the gap by a fifth of an edge. Much more
    /// makes the solvers take many more iterations.
    pub stiffness: f64,
    /// Nodes deeper inside another body than this (m), counted from its surface or from where they
    /// were inside it at rest, do not touch it.
    pub depth: f64,
    /// Whether folded tissue touches itself.
    pub folds: bool,
}

impl Default for BodyContact {
    fn default() -> Self {
        Self { offset: 1.5e-3, friction: 0.6, stiffness: 0.5, depth: 3e-3, folds: false }
    }
}

impl BodyContact {
    /// Checks the contact.
    pub(crate) fn check(&self) -> Result<(), String> {
        for (name, length) in [("an offset", self.offset), ("a depth", self.depth)] {
            if !(0.0..=0.02).contains(&length) {
                return Err(format!("{name} of {length} m; must be in [0, 0.02]"));
            }
        }
        if !(self.friction >= 0.0 && self.friction.is_finite()) {
            return Err(format!("a friction coefficient of {}; must be finite and at least 0", self.friction));
        }
        if !(self.stiffness > 0.0 && self.stiffness <= 1e3) {
            return Err(format!("a stiffness of {} times the tissue's; must be in (0, 1000]", self.stiffness));
        }
        Ok(())
    }
}
