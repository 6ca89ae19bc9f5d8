//! Every integrator that can be compared, behind one stepper.

use crate::comparator::Comparator;
use crate::oracle::{Newton, NewtonIntegrator};
use crate::semi_implicit::SemiImplicit;
use crate::xpbd_settings::{Xpbd, XpbdSweep};
use crate::{Error, Result};
use trocar_tissue::{Body, Integrator, Model, SolverSettings, Stepper};

/// More substeps or iterations than a study needs.
const MAX_COUNT: usize = 1_000_000;

/// An integrator with its settings: one of `trocar-tissue`'s solvers or one of this crate's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scheme {
    /// A solver of `trocar-tissue`.
    Tissue(SolverSettings),
    /// Semi-implicit Euler.
    SemiImplicit(SemiImplicit),
    /// Extended position-based dynamics.
    Xpbd(Xpbd),
    /// Implicit Euler in double precision, converged.
    Newton(Newton),
}

impl From<SolverSettings> for Scheme {
    fn from(settings: SolverSettings) -> Self {
        Self::Tissue(settings)
    }
}

impl Scheme {
    /// Substeps a frame.
    pub fn substeps(&self) -> usize {
        match self {
            Self::Tissue(settings) => settings.substeps(),
            Self::SemiImplicit(settings) => settings.substeps,
            Self::Xpbd(settings) => settings.substeps,
            Self::Newton(settings) => settings.substeps,
        }
    }

    /// A stepper of `model` by frames of `dt` (s) with `threads` worker threads (0: one for each
    /// core), as [`Stepper::new`].
    ///
    /// # Errors
    /// Settings out of range, and the errors of [`Stepper::new`].
    pub fn stepper(self, model: &Model, dt: f64, threads: usize) -> Result<Stepper> {
        self.check()?;
        let stepper = match self {
            Self::Tissue(settings) => Stepper::new(model, settings, dt, threads),
            Self::SemiImplicit(settings) => {
                let make =
                    move |body: &Body| Box::new(Comparator::semi_implicit(settings, body)) as Box<dyn Integrator>;
                Stepper::with_integrator(model, make, dt, threads)
            }
            Self::Xpbd(settings) => {
                let make = move |body: &Body| Box::new(Comparator::xpbd(settings, body)) as Box<dyn Integrator>;
                Stepper::with_integrator(model, make, dt, threads)
            }
            Self::Newton(settings) => {
                let make = move |body: &Body| Box::new(NewtonIntegrator::new(settings, body)) as Box<dyn Integrator>;
                Stepper::with_integrator(model, make, dt, threads)
            }
        };
        Ok(stepper?)
    }

    fn check(&self) -> Result<()> {
        let iterations = match self {
            Self::Xpbd(Xpbd { sweep: XpbdSweep::Jacobi { relaxation }, .. })
                if !(*relaxation > 0.0 && *relaxation <= 1.0) =>
            {
                return Err(Error::Invalid(format!("a relaxation of {relaxation}; it must be in (0, 1]")));
            }
            Self::Xpbd(settings) => settings.iterations,
            Self::Tissue(_) | Self::SemiImplicit(_) | Self::Newton(_) => 1,
        };
        for (name, count) in [("substeps", self.substeps()), ("iterations", iterations)] {
            if !(1..=MAX_COUNT).contains(&count) {
                return Err(Error::Invalid(format!("{count} {name}; must be in [1, {MAX_COUNT}]")));
            }
        }
        Ok(())
    }
}
