//! The tissue of an organ's elements: softer than the organ, to compensate for a mesh that is too
//! stiff.
//!
//! Linear tetrahedra bend as a stiffer body does, the more the fewer of them lie over its
//! thickness, and lock where they must keep their volume. Both are errors of the mesh, which no
//! solver sees (`trocar experiment mesh-convergence`).

use trocar_geometry::{TetMesh, TetQuality};
use trocar_tissue::Material;

/// Added stiffness in bending, over the squared ratio of the median edge to volume over area. The
/// error of linear elements grows with the square of their size. Found beside quadratic
/// tetrahedra, for two directions of bending each: 0.17 and 0.18 in phantom A's appendix, 0.15 to
/// 0.20 in its bowels.
const BENDING: f64 = 0.18;

/// Largest ratio of the edge to volume over area: a body of one element over its thickness.
const MAX_COARSENESS: f64 = 2.0;

/// Elements of tissue that keeps its volume better have this Poisson's ratio: linear ones lock
/// above it.
const MAX_POISSON_RATIO: f64 = 0.45;

/// The material of linear tetrahedra that makes `mesh` deflect as a body of `material` does.
///
/// Elements with a smaller Poisson's ratio than the body's keep the modulus of contact and of
/// plates, E / (1 - nu^2). A slender part then bends as if it were up to 6% stiffer.
pub fn element_material(material: Material, mesh: &TetMesh) -> Material {
    let area = mesh.boundary().0.area();
    let coarseness = (TetQuality::of(mesh).median_edge * area / mesh.volume()).min(MAX_COARSENESS);
    let poisson_ratio = material.poisson_ratio.min(MAX_POISSON_RATIO);
    let confined = (1.0 - poisson_ratio.powi(2)) / (1.0 - material.poisson_ratio.powi(2));
    Material {
        young_modulus: confined * material.young_modulus / (1.0 + BENDING * coarseness * coarseness),
        poisson_ratio,
        ..material
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trocar_tissue::ConstitutiveModel;

    /// A beam of cubes of `edge` (m), six tetrahedra each: 24 mm long, 6 mm high and wide.
    fn beam(edge: f64) -> TetMesh {
        let cells = [24e-3, 6e-3, 6e-3].map(|length: f64| (length / edge).round() as usize);
        trocar_testing::blocks::block(cells, edge)
    }

    #[test]
    fn elements_are_softened_by_the_square_of_their_size() {
        let model = ConstitutiveModel::StableNeoHookean;
        let own = Material { model, young_modulus: 12e3, poisson_ratio: 0.49, density: 1200.0, viscosity: 70.0 };
        let added = |edge: f64| {
            let found = element_material(own, &beam(edge));
            assert_eq!((found.density, found.viscosity, found.poisson_ratio), (1200.0, 70.0, 0.45));
            let plates = (1.0 - 0.45f64.powi(2)) / (1.0 - 0.49f64.powi(2));
            plates * own.young_modulus / found.young_modulus - 1.0
        };
        let (coarse, fine) = (added(1e-3), added(0.5e-3));
        assert!(coarse > 0.01 && (coarse / fine - 4.0).abs() < 0.2, "{coarse}, {fine}");
        let soft = Material { poisson_ratio: 0.3, ..own };
        assert_eq!(element_material(soft, &beam(1e-3)).poisson_ratio, 0.3);
        let finest = element_material(soft, &beam(0.25e-3)).young_modulus;
        assert!(finest < 12e3 && finest > 0.98 * 12e3, "{finest}");
    }
}
