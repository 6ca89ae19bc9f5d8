//! Hyperelastic materials.

/// Constitutive model by name.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum ConstitutiveModel {
    /// Stable neo-Hookean; the default.
    #[default]
    StableNeoHookean,
    /// St. Venant-Kirchhoff, the paper's.
    StVenantKirchhoff,
}

/// Material of a body.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Material {
    /// Constitutive model.
    pub model: ConstitutiveModel,
    /// Young's modulus [Pa].
    pub young_modulus: f64,
    /// Poisson's ratio.
    pub poisson_ratio: f64,
    /// Density [kg/m3].
    pub density: f64,
    /// Viscosity against deformation rate [Pa s]; rigid motion is not damped.
    pub viscosity: f64,
}
