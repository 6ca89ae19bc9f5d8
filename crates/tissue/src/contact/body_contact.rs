//! How bodies touch each other.

/// Contact between the bodies of a model: from how near they press, how hard, and how they rub.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BodyContact {
    /// Gap at which surfaces begin to press [m] (SPEC C1: 1.5 mm). Where bodies were nearer than this at rest, or inside each other, they begin to press when they come nearer than that.
    pub offset: f64,
    /// Coulomb friction coefficient (SPEC C1: 0.6).
    pub friction: f64,
    /// Stiffness of a node against another body, over Young's modulus times the node's size. Half of it lets a pressure of a tenth of Young's modulus close the gap by a fifth of an edge;
    /// much more makes the solvers take many more iterations.
    pub stiffness: f64,
    /// Nodes this much deeper inside another body [m] than its surface, or than where they were inside it at rest, are left alone.
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
    /// Says what is wrong, if anything.
    pub(crate) fn check(&self) -> Result<(), String> {
        for (name, length) in [("an offset", self.offset), ("a depth", self.depth)] {
            if !(0.0..=0.02).contains(&length) {
                return Err(format!("{name} of {length} m; 0 to 0.02 m make sense"));
            }
        }
        if !(self.friction >= 0.0 && self.friction.is_finite()) {
            return Err(format!("a friction coefficient of {}; 0 or more makes sense", self.friction));
        }
        if !(self.stiffness > 0.0 && self.stiffness <= 1e3) {
            return Err(format!(
                "a stiffness of {} times the tissue's; above 0 and at most 1000 make sense",
                self.stiffness
            ));
        }
        Ok(())
    }
}
