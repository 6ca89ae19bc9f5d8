//! How well a minimum is found, how it was found, and why it was not.

/// How well the minimum is found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Precision {
    /// Greatest norm of the gradient, over the weight the body has on earth (its mass times 9.81
    /// m/s2).
    pub gradient: f64,
    /// Greatest number of Newton steps.
    pub iterations: usize,
}

impl Default for Precision {
    /// 1e-9 of the weight within 200 steps.
    fn default() -> Self {
        Self { gradient: 1e-9, iterations: 200 }
    }
}

/// How one body's minimum was found.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Solution {
    /// Newton steps taken (each is one factorisation or more).
    pub iterations: usize,
    /// Steps in which the Hessian was not positive definite and was made so.
    pub projected: usize,
    /// Parts in which held nodes were moved to their targets.
    pub load_steps: usize,
    /// Norm of the gradient over free nodes at the end (N).
    pub gradient: f64,
}

/// Why a minimum was not found.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Failure {
    /// The gradient is still too large after all iterations.
    #[error("after {iterations} Newton steps the gradient is {gradient:.3e} N; it should be {tolerance:.3e} N or less")]
    NotConverged {
        /// Steps taken.
        iterations: usize,
        /// Norm of the gradient (N).
        gradient: f64,
        /// Tolerance (N).
        tolerance: f64,
    },
    /// No step along the Newton direction decreases the energy, and the gradient is too large.
    #[error("no step decreases the energy at a gradient of {gradient:.3e} N; {tolerance:.3e} N or less was asked for")]
    Stuck {
        /// Norm of the gradient (N).
        gradient: f64,
        /// What it should have been (N).
        tolerance: f64,
    },
    /// An element has no volume where the solve begins.
    #[error("element {element} has a volume ratio of {ratio:.3e} at the beginning; it must be positive")]
    Inverted {
        /// The element.
        element: usize,
        /// Volume over rest volume.
        ratio: f64,
    },
    /// The Hessian could not be factorised, even made positive definite.
    #[error("the Hessian cannot be factorised; is the body held, and are its numbers finite?")]
    Singular,
    /// Held nodes cannot reach their targets without an element losing its volume.
    #[error("held nodes reached {share:.3} of their way; an element loses its volume beyond")]
    Unreachable {
        /// Share of the way.
        share: f64,
    },
    /// Friction's limits and the motion found no balance.
    #[error("friction is off balance by {gradient:.3e} N; {tolerance:.3e} N or less was asked for")]
    Friction {
        /// Norm of the gradient with friction's true limits (N).
        gradient: f64,
        /// What it should have been (N).
        tolerance: f64,
    },
    /// Gravity acts on a body that nothing holds: it has no equilibrium.
    #[error("nothing holds it against gravity; pin nodes, hold some or give it a support")]
    Unheld,
}
