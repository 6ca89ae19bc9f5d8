//! The cube between its outermost layers of beads, and where it comes to rest when these layers go
//! where they were seen.

use super::data::{BEADS, Beads, Strain, bead};
use crate::Result;
use crate::experiment::block::block;
use crate::scenes::reference;
use glam::{DMat3, DVec2, DVec3};
use trocar_geometry::TetMesh;
use trocar_tissue::{ConstitutiveModel, Material};
use trocar_tissue_reference::oracle::Precision;
use trocar_tissue_reference::statics::{Elements, Loading};

/// Side of the cube (m).
const SIDE: f64 = 0.08;

/// Young's modulus that the authors of the data report (Pa). Where all loads are displacements, it
/// changes nothing.
pub(super) const YOUNG_MODULUS: f64 = 15.3e3;

/// Density of silicone (kg/m3). The weight is not part of the compression.
pub(super) const DENSITY: f64 = 980.0;

/// Steps in which a layer goes its way.
const PARTS: usize = 4;

/// Terms of the polynomial in the two coordinates of a layer: all up to the third degree.
const TERMS: usize = 10;

/// Share of the displacement that linear elasticity is solved with.
const SMALL: f64 = 1e-4;

/// A law and what is made of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Law {
    /// A hyperelastic law.
    Finite(ConstitutiveModel),
    /// Linear elasticity.
    Linear,
    /// Linear elasticity in a frame that turns with the tissue: the lattice's `corotated`. The
    /// tetrahedra's corotated law resists the change of volume J - 1 instead of tr(S - I).
    Rotated,
}

/// Kind of tetrahedra.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Kind {
    /// Linear tetrahedra: what the cell steps.
    Linear,
    /// Linear tetrahedra with a Poisson's ratio of 0.45 at most, as `[tissue] mesh_correction` has.
    Corrected,
    /// Linear tetrahedra in patches of eight that share their resistance to a change of volume.
    Patches,
    /// Quadratic tetrahedra.
    Quadratic,
}

/// The cube between two layers.
pub(super) struct Cube<'a> {
    beads: &'a Beads,
    /// Its middle, seen along the axis (m).
    middle: DVec2,
    /// Height of the first and the last layer (m).
    ends: [f64; 2],
}

/// The cube's motion if each column between the outer layers stays straight.
pub(super) struct Columns {
    motions: [LayerMotion; 2],
    ends: [f64; 2],
}

impl Columns {
    /// The displacement at a place (m).
    pub fn at(&self, p: DVec3) -> DVec3 {
        let [first, last] = &self.motions;
        let share = (p.z - self.ends[0]) / (self.ends[1] - self.ends[0]);
        first.at(p.truncate()).lerp(last.at(p.truncate()), share)
    }
}

/// The displacement of a layer over its plane: a polynomial, because each bead is known to the size
/// of a voxel only.
struct LayerMotion {
    middle: DVec2,
    terms: [DVec3; TERMS],
}

impl<'a> Cube<'a> {
    pub fn new(beads: &'a Beads) -> Self {
        let middles: Vec<DVec3> = (0..BEADS).map(|layer| beads.middle(layer)).collect();
        let middle = middles.iter().sum::<DVec3>() / BEADS as f64;
        Self { beads, middle: middle.truncate(), ends: [middles[0].z, middles[BEADS - 1].z] }
    }

    /// Distance of the outer layers (m).
    pub fn height(&self) -> f64 {
        (self.ends[0] - self.ends[1]).abs()
    }

    /// Layers of cells between the outer layers of beads, with `cells` cells across.
    pub fn layers(&self, cells: usize) -> usize {
        ((cells as f64 * self.height() / SIDE).round() as usize).max(1)
    }

    /// Tetrahedra: `cells` cells across.
    pub fn mesh(&self, cells: usize) -> TetMesh {
        let corner = (self.middle - DVec2::splat(0.5 * SIDE)).extend(self.ends[0].min(self.ends[1]));
        block(corner, DVec3::new(SIDE, SIDE, self.height()), [cells, cells, self.layers(cells)])
    }

    /// Which of the outer layers a point (m) is in.
    pub fn end_of(&self, p: DVec3) -> Option<usize> {
        self.ends.iter().position(|z| (p.z - z).abs() < 1e-9)
    }

    /// The motion of straight columns under a compression.
    pub fn columns(&self, strain: &Strain) -> Columns {
        let motions = [0, BEADS - 1].map(|layer| LayerMotion::of(self.beads, strain, layer, self.middle));
        Columns { motions, ends: self.ends }
    }

    /// Where the inner beads rest (m).
    pub fn rest(&self) -> impl Iterator<Item = DVec3> {
        inner().map(|bead| self.beads.rest[bead])
    }

    /// The elements.
    pub fn elements(&self, kind: Kind, cells: usize, law: Law, poisson_ratio: f64) -> Elements {
        let model = match law {
            Law::Finite(model) => model,
            Law::Linear | Law::Rotated => ConstitutiveModel::Corotated,
        };
        let material =
            Material { model, young_modulus: YOUNG_MODULUS, poisson_ratio, density: DENSITY, viscosity: 0.0 };
        let mesh = self.mesh(cells);
        match kind {
            Kind::Linear => Elements::linear(&mesh, material),
            Kind::Corrected => Elements::linear(&mesh, trocar_cell::element_material(material, &mesh)),
            Kind::Patches => Elements::patches(&mesh, material, 8, 0.5),
            Kind::Quadratic => Elements::quadratic(&mesh, material),
        }
    }

    /// Where the beads of the inner layers are under a compression (m).
    pub fn predict(&self, elements: &Elements, law: Law, strain: &Strain) -> Result<Vec<DVec3>> {
        let columns = self.columns(strain);
        let held = elements.held_by(|p| self.end_of(p).is_some());
        let scale = if law == Law::Linear { SMALL } else { 1.0 };
        let nodes = elements.rest().iter().enumerate();
        let moved = nodes.filter_map(|(i, p)| self.end_of(*p).map(|_| (i as u32, scale * columns.at(*p))));
        let loading = Loading { moved: moved.collect(), ..Loading::default() };
        let parts = if law == Law::Linear { 1 } else { PARTS };
        let found = elements.settle(&held, &loading, parts, Precision::default()).map_err(reference)?;
        let place = |rest: DVec3| rest + elements.locate(rest).of(&found.displacements) / scale;
        Ok(self.rest().map(place).collect())
    }
}

/// Distances (m) of the inner beads from where they were seen.
pub(super) fn distances(predicted: &[DVec3], strain: &Strain) -> Vec<f64> {
    inner().zip(predicted).map(|(bead, place)| place.distance(strain.at[bead])).collect()
}

/// The beads of all layers but the first and the last.
pub(super) fn inner() -> impl Iterator<Item = usize> {
    BEADS * BEADS..(BEADS - 1) * BEADS * BEADS
}

impl LayerMotion {
    /// The least squares of a layer's beads.
    fn of(beads: &Beads, strain: &Strain, layer: usize, middle: DVec2) -> Self {
        let mut normal = [[0.0; TERMS]; TERMS];
        let mut right = [DVec3::ZERO; TERMS];
        for k in layer * BEADS * BEADS..(layer + 1) * BEADS * BEADS {
            let terms = terms(beads.rest[k].truncate() - middle);
            for (i, a) in terms.iter().enumerate() {
                for (j, b) in terms.iter().enumerate() {
                    normal[i][j] += a * b;
                }
                right[i] += *a * (strain.at[k] - beads.rest[k]);
            }
        }
        Self { middle, terms: solve(normal, right) }
    }

    /// The displacement at a place in the plane (m).
    fn at(&self, p: DVec2) -> DVec3 {
        terms(p - self.middle).into_iter().zip(&self.terms).map(|(a, term)| a * *term).sum()
    }
}

/// How far the beads of the outer layers are from the polynomials: root of the mean square (m). It
/// is the noise of the measurement, for a layer moves smoothly.
pub(super) fn noise(beads: &Beads, strain: &Strain) -> f64 {
    let middle = Cube::new(beads).middle;
    let mut squares = Vec::new();
    for layer in [0, BEADS - 1] {
        let motion = LayerMotion::of(beads, strain, layer, middle);
        for k in layer * BEADS * BEADS..(layer + 1) * BEADS * BEADS {
            let off = strain.at[k] - beads.rest[k] - motion.at(beads.rest[k].truncate());
            squares.push(off.length_squared());
        }
    }
    let free = (squares.len() - 2 * TERMS) as f64;
    (squares.iter().sum::<f64>() / free).sqrt()
}

/// Products of the coordinates over half of the cube's side.
fn terms(p: DVec2) -> [f64; TERMS] {
    let DVec2 { x, y } = p / (0.5 * SIDE);
    [1.0, x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y]
}

/// Gaussian elimination of a positive definite system.
fn solve(mut a: [[f64; TERMS]; TERMS], mut b: [DVec3; TERMS]) -> [DVec3; TERMS] {
    for k in 0..TERMS {
        for i in k + 1..TERMS {
            let by = a[i][k] / a[k][k];
            let row = a[k];
            a[i].iter_mut().zip(row).for_each(|(x, y)| *x -= by * y);
            b[i] -= by * b[k];
        }
    }
    for k in (0..TERMS).rev() {
        let known: DVec3 = (k + 1..TERMS).map(|j| a[k][j] * b[j]).sum();
        b[k] = (b[k] - known) / a[k][k];
    }
    b
}

/// Simple guesses beside which a simulation is to be seen: where a bead goes if its column is
/// straight between its two ends (`interpolation`), if the cube moves as a whole (`rigid`), or if
/// all of it moves as the affine motion that fits both layers best (`affine`). Places of the inner
/// beads (m).
pub(super) fn guesses(beads: &Beads, strain: &Strain) -> [(&'static str, Vec<DVec3>); 3] {
    let by = |k: usize| strain.at[k] - beads.rest[k];
    let column = |k: usize| k % (BEADS * BEADS);
    let last = BEADS - 1;
    let ends = |k: usize| [column(k), bead(last, 0, 0) + column(k)];
    let straight = |k: usize| {
        let [a, b] = ends(k);
        let share = (beads.rest[k].z - beads.rest[a].z) / (beads.rest[b].z - beads.rest[a].z);
        by(a).lerp(by(b), share)
    };
    let outer: Vec<usize> = (0..BEADS * BEADS).flat_map(ends).collect();
    let mean = outer.iter().map(|k| by(*k)).sum::<DVec3>() / outer.len() as f64;
    // The affine motion: normal equations of 1, x, y, z.
    let middle = outer.iter().map(|k| beads.rest[*k]).sum::<DVec3>() / outer.len() as f64;
    let rows = |k: usize| beads.rest[k] - middle;
    let mut normal = DMat3::ZERO;
    let mut right = DMat3::ZERO;
    for k in &outer {
        let (p, u) = (rows(*k), by(*k));
        normal += DMat3::from_cols(p * p.x, p * p.y, p * p.z);
        right += DMat3::from_cols(u * p.x, u * p.y, u * p.z);
    }
    let gradient = right * normal.inverse();
    let places = |guess: &dyn Fn(usize) -> DVec3| inner().map(|k| beads.rest[k] + guess(k)).collect();
    [
        ("interpolation", places(&straight)),
        ("rigid", places(&|_| mean)),
        ("affine", places(&|k| mean + gradient * rows(k))),
    ]
}

#[cfg(test)]
mod tests {
    use super::super::data::tests::table;
    use super::super::method::Method;
    use super::*;

    /// A cube that is compressed evenly, and becomes wider so that its volume stays, has an exact
    /// equilibrium of that shape if it is nearly incompressible. Every kind of element finds it.
    #[test]
    fn an_even_compression_is_predicted() {
        let beads = Beads::parse(&table()).unwrap();
        let cube = Cube::new(&beads);
        let strain = &beads.strains[0];
        assert!(noise(&beads, strain) < 1e-9);
        assert!((cube.mesh(3).volume() / (SIDE * SIDE * 0.06) - 1.0).abs() < 1e-9);
        let kinds = [Kind::Linear, Kind::Patches, Kind::Quadratic].map(Method::Tetrahedra);
        for method in kinds.into_iter().chain([Method::Lattice]) {
            let law = Law::Finite(ConstitutiveModel::StableNeoHookean);
            let predicted = method.model(&cube, 3, law, 0.499).unwrap().predict(strain).unwrap();
            let worst = distances(&predicted, strain).into_iter().fold(0.0, f64::max);
            assert!(worst < 2e-5, "{method:?}: {worst} m");
        }
        let [straight, rigid, affine] =
            guesses(&beads, strain).map(|(_, places)| distances(&places, strain).into_iter().fold(0.0, f64::max));
        assert!(straight < 1e-12 && affine < 1e-12, "{straight}, {affine}");
        assert!(rigid > 5e-4);
    }

    /// The real cube, where its table is beside the project.
    #[test]
    fn the_real_cube_is_predicted_better_than_by_straight_columns() {
        let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..").join(super::super::DATA);
        if !path.is_file() {
            eprintln!("skipped: {} is not there", path.display());
            return;
        }
        let beads = Beads::read(&path).unwrap();
        let cube = Cube::new(&beads);
        let law = Law::Finite(ConstitutiveModel::StableNeoHookean);
        for (method, cells, poisson_ratio, bars) in [
            (Method::Tetrahedra(Kind::Linear), 6, 0.49, [0.33e-3, 0.51e-3]),
            (Method::Lattice, 4, 0.499, [0.27e-3, 0.32e-3]),
        ] {
            let model = method.model(&cube, cells, law, poisson_ratio).unwrap();
            for (strain, bar) in beads.strains.iter().zip(bars) {
                let error = crate::statistics::median(&mut distances(&model.predict(strain).unwrap(), strain));
                let [(_, straight), ..] = guesses(&beads, strain);
                let straight = crate::statistics::median(&mut distances(&straight, strain));
                let what = format!("{method:?}, {}%: {error} m, straight columns {straight} m", strain.percent);
                assert!(error < bar && error < straight, "{what}");
            }
        }
    }
}
