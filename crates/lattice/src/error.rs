//! Errors: input that cannot be used, and minima that are not found.

/// Result of this crate.
pub type Result<T, E = Error> = std::result::Result<T, E>;

/// An input that cannot be used, or a minimum that was not found.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    /// A shape from which no lattice can be made, or lattice options out of range.
    #[error("lattice: {0}")]
    Lattice(String),
    /// A body is unusable. Names the body and the parameter.
    #[error("body '{body}': {reason}")]
    Body {
        /// Its name.
        body: String,
        /// The reason and the remedy.
        reason: String,
    },
    /// Conditions, settings or a state that do not fit.
    #[error("{0}")]
    Invalid(String),
    /// Newton's method did not reach the minimum.
    #[error("body '{body}': {failure}")]
    Unsolved {
        /// Its name.
        body: String,
        /// Why.
        failure: Failure,
    },
}

/// Why Newton's method stopped.
#[derive(Clone, Copy, Debug, PartialEq, thiserror::Error)]
pub enum Failure {
    /// The greatest number of iterations was reached.
    #[error("no minimum after {iterations} iterations: the gradient is {gradient:.2e} N, wanted {tolerance:.2e} N")]
    NotConverged {
        /// Iterations done.
        iterations: usize,
        /// Norm of the gradient (N).
        gradient: f64,
        /// The wanted norm (N).
        tolerance: f64,
    },
    /// No step along the search direction lowers the energy.
    #[error("no step lowers the energy: the gradient is {gradient:.2e} N, wanted {tolerance:.2e} N")]
    Stuck {
        /// Norm of the gradient (N).
        gradient: f64,
        /// The wanted norm (N).
        tolerance: f64,
    },
    /// The Hessian cannot be factorised, even when it is projected.
    #[error("the stiffness is singular: pin a part of the body, or give it a time step")]
    Singular,
    /// Energy or gradient are not finite.
    #[error("energy or forces are not finite: positions, loads or moduli are too large")]
    NotFinite,
}
