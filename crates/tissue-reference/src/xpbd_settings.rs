//! Settings of XPBD, and the forms of it that are compared.

/// Settings of XPBD.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Xpbd {
    /// Substeps a frame.
    pub substeps: usize,
    /// Iterations a substep.
    pub iterations: usize,
    /// How an iteration goes through the elements.
    pub sweep: XpbdSweep,
    /// Constraints of an element.
    pub constraints: XpbdConstraints,
}

/// How an iteration goes through the elements.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum XpbdSweep {
    /// One after another in the mesh's order, each from where the ones before left the vertices.
    GaussSeidel,
    /// All from the same positions; their corrections are added up, times a relaxation. A vertex of
    /// 24 elements is then corrected many times over unless the relaxation is small: the stiffer
    /// the elements over the substep, the smaller.
    Jacobi {
        /// Factor of every correction.
        relaxation: f64,
    },
}

/// The deformation that an element resists.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum XpbdConstraints {
    /// The six Green strains together, with the compliance matrix of linear elasticity (XPBD's for
    /// finite elements), and with the material's own stress: a body at rest has no multipliers, and
    /// every strain is resisted implicitly.
    Strains,
    /// |F| with compliance 1/(mu V) and J - alpha with 1/(lambda V), solved together (Macklin and
    /// Mueller 2021; Ton-That, Kry and Andrews 2023). Their energies sum to that of stable
    /// neo-Hookean tissue (without its barrier below a fifth of the rest volume). At rest both
    /// multipliers are large and balance each other. Shear stiffness lies in the change of their
    /// gradients, which XPBD leaves out of its linearisation, so it is explicit: without dashpots
    /// it limits the step. Bodies of other materials use [`Self::Strains`].
    NeoHookean,
    /// tr(F'F) - 3 and J - 1 with compliances 1/(mu V) and 1/(lambda V), as in Newton 1.8
    /// (`solve_tetrahedra`). To first order both constraints are volume changes: small shear costs
    /// nothing.
    StrainTrace,
}

impl Xpbd {
    /// Newton's solver (the physics engine, 1.8) at the paper's 8 substeps of 10 iterations, with
    /// its default relaxation.
    pub const NEWTON: Self = Self {
        substeps: 8,
        iterations: 10,
        sweep: XpbdSweep::Jacobi { relaxation: 0.9 },
        constraints: XpbdConstraints::StrainTrace,
    };
}

impl Default for Xpbd {
    /// The best form: 80 substeps of one Gauss-Seidel iteration (as many iterations a frame as the
    /// paper's 8 x 10), with Macklin and Mueller's constraints.
    fn default() -> Self {
        Self { substeps: 80, iterations: 1, sweep: XpbdSweep::GaussSeidel, constraints: XpbdConstraints::NeoHookean }
    }
}
