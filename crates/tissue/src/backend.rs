//! Which elements the tissue of a model is made of.

pub use trocar_lattice::Law;

/// The elements that bear a model's tissue.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Backend {
    /// The tetrahedra of the bodies. The default.
    #[default]
    Tetrahedra,
    /// A regular lattice of hexahedra around each body, in which its nodes are embedded: another
    /// mesh, another law and another solver, under the same contacts, supports and grasps.
    Lattice(LatticeSettings),
}

/// How the lattices of a model are made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LatticeSettings {
    /// Edge of a cell (m), 0.1 mm to 100 mm. Contacts, pins and grasps act on the nodes of the
    /// bodies: cells much smaller than the distances of these yield to single nodes.
    pub cell: f64,
    /// The law of the tissue, whatever the body's [`crate::ConstitutiveModel`].
    pub law: Law,
}

impl Default for LatticeSettings {
    /// Stable neo-Hookean tissue in cells of 4 mm. Corotated tissue turns inside out between jaws.
    fn default() -> Self {
        Self { cell: 4e-3, law: Law::StableNeoHookean }
    }
}
