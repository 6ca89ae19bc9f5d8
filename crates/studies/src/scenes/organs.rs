//! Organs of scenes: read from a mesh file, or procedural.

use super::shapes::{self, BentTube};
use crate::{Error, Result};
use glam::DVec3;
use std::path::Path;
use trocar_geometry::io::read_msh_groups;
use trocar_geometry::{LatticeMesher, TetMesh};

const APPENDIX: &str = "appendix";

/// Maximum size of an organ (m); a larger one is in another unit.
const MAX_SIZE: f64 = 3.0;

/// One organ.
#[derive(Clone, Debug)]
pub struct Organ {
    /// Its name; a number if the file has none.
    pub name: String,
    /// Its rest shape (m), z up.
    pub mesh: TetMesh,
}

/// Organs, one of which is the appendix.
#[derive(Clone, Debug)]
pub struct Organs {
    /// The organs.
    pub organs: Vec<Organ>,
    /// Index of the appendix: the organ of that name, or without one the most slender organ.
    pub appendix: usize,
    /// Their source, for people.
    pub source: String,
}

/// Procedural organs: name, share of the elements, half axes of an ellipsoid (m), after the paper's
/// specimen A.
const ELLIPSOIDS: [(&str, f64, [f64; 3]); 5] = [
    ("cecum", 0.34, [0.0350, 0.0110, 0.0076]),
    ("bowel 1", 0.18, [0.0290, 0.0065, 0.0056]),
    ("bowel 2", 0.07, [0.0120, 0.0060, 0.0052]),
    ("bowel 3", 0.145, [0.0260, 0.0062, 0.0052]),
    ("stomach", 0.08, [0.0170, 0.0085, 0.0051]),
];

/// Procedural appendix: share of the elements, length (m), radius at the base (m), taper, bend
/// (rad).
const TUBE: (f64, f64, f64, f64, f64) = (0.185, 0.085, 0.00455, 0.85, 1.8);

/// Minimum number of elements per procedural organ; with fewer, there are fewer organs.
const MIN_TETS: usize = 900;

/// Gap between procedural organs (m).
const GAP: f64 = 4e-3;

/// Edge of the triangles of procedural surfaces (m).
const SPACING: f64 = 1e-3;

impl Organs {
    /// Reads a Gmsh file in metres: one organ per physical group, or per connected part in a file
    /// without groups.
    ///
    /// # Errors
    /// A file that cannot be read or is not in metres.
    pub fn read(path: &Path) -> Result<Self> {
        let mut organs = Vec::new();
        for (name, mesh) in read_msh_groups(path)? {
            match name {
                Some(name) => organs.push(Organ { name, mesh }),
                None => organs.extend(
                    parts(&mesh).into_iter().enumerate().map(|(k, mesh)| Organ { name: format!("organ {k}"), mesh }),
                ),
            }
        }
        let source = path.file_name().map(|n| n.to_string_lossy().into_owned()).unwrap_or_default();
        if let Some((low, high)) =
            organs.iter().find_map(|o| o.mesh.bounds().filter(|(a, b)| (b - a).max_element() > MAX_SIZE))
        {
            let size = high - low;
            return Err(Error::Mismatch(format!(
                "{}: an organ of {:.3} x {:.3} x {:.3} m; the file must be in metres",
                path.display(),
                size.x,
                size.y,
                size.z
            )));
        }
        Self::of(organs, source)
    }

    /// Procedural organs of about `tets` elements in total, side by side: a bent tube of the
    /// appendix's size and up to five ellipsoids, from the lattice mesher. An organ of less than
    /// some hundred elements falls apart, so there are fewer ellipsoids for a small `tets`.
    ///
    /// # Errors
    /// Too few elements to mesh an organ.
    pub fn analytic(tets: usize) -> Result<Self> {
        let count = (tets / MIN_TETS).clamp(1, ELLIPSOIDS.len() + 1);
        let ellipsoids = &ELLIPSOIDS[ELLIPSOIDS.len() + 1 - count..];
        let whole = TUBE.0 + ellipsoids.iter().map(|e| e.1).sum::<f64>();
        let share = |share: f64| (share / whole * tets as f64).round() as usize;
        let mut organs = Vec::new();
        let mut beside = 0.0;
        for (name, part, half) in ellipsoids {
            let surface = shapes::ellipsoid(DVec3::from(*half), SPACING);
            organs.push(Organ { name: (*name).into(), mesh: mesh(&surface, share(*part))? });
        }
        organs.push(Organ { name: APPENDIX.into(), mesh: analytic_appendix(share(TUBE.0))? });
        for organ in &mut organs {
            let Some((low, high)) = organ.mesh.bounds() else { continue };
            let shift = DVec3::new(-low.x, beside - low.y, -low.z);
            organ.mesh.vertices.iter_mut().for_each(|v| *v += shift);
            beside += high.y - low.y + GAP;
        }
        Self::of(organs, "our own organs".into())
    }

    /// Only the procedural appendix, of about `tets` elements.
    ///
    /// # Errors
    /// Too few elements to mesh it.
    pub fn analytic_appendix(tets: usize) -> Result<Self> {
        Self::of(vec![Organ { name: APPENDIX.into(), mesh: analytic_appendix(tets)? }], "our own appendix".into())
    }

    /// Only the largest procedural organ, of about `tets` elements.
    ///
    /// # Errors
    /// Too few elements to mesh it.
    pub fn analytic_largest(tets: usize) -> Result<Self> {
        let (name, _, half) = ELLIPSOIDS[0];
        let mesh = mesh(&shapes::ellipsoid(DVec3::from(half), SPACING), tets)?;
        Self::of(vec![Organ { name: name.into(), mesh }], "our own cecum".into())
    }

    /// Only the appendix.
    pub fn only_appendix(&self) -> Self {
        Self { organs: vec![self.organs[self.appendix].clone()], appendix: 0, source: self.source.clone() }
    }

    /// Number of nodes of all organs.
    pub fn nodes(&self) -> usize {
        self.organs.iter().map(|o| o.mesh.vertices.len()).sum()
    }

    /// Number of elements of all organs.
    pub fn tets(&self) -> usize {
        self.organs.iter().map(|o| o.mesh.tets.len()).sum()
    }

    fn of(organs: Vec<Organ>, source: String) -> Result<Self> {
        let named = organs.iter().position(|o| o.name.eq_ignore_ascii_case(APPENDIX));
        let most_slender = || {
            let slender: Vec<f64> = organs.iter().map(|o| slenderness(&o.mesh)).collect();
            (0..organs.len()).max_by(|a, b| slender[*a].total_cmp(&slender[*b]))
        };
        match named.or_else(most_slender) {
            Some(appendix) => Ok(Self { organs, appendix, source }),
            None => Err(Error::Mismatch(format!("{source}: the file has no organ; it must have at least one"))),
        }
    }
}

fn analytic_appendix(tets: usize) -> Result<TetMesh> {
    let (_, length, radius, taper, bend) = TUBE;
    mesh(&shapes::tube(&BentTube::new(length, radius, taper, bend), SPACING), tets)
}

fn mesh(surface: &trocar_geometry::TriMesh, tets: usize) -> Result<TetMesh> {
    Ok(LatticeMesher::fit(surface, 0.0, tets)?.1)
}

/// Area cubed over volume squared: 8 pi times length over radius for a long tube, and 36 pi for a
/// ball of any size.
fn slenderness(mesh: &TetMesh) -> f64 {
    mesh.boundary().0.area().powi(3) / mesh.volume().powi(2)
}

/// The connected parts of a mesh, in the order of their first nodes.
fn parts(mesh: &TetMesh) -> Vec<TetMesh> {
    let mut parent: Vec<u32> = (0..mesh.vertices.len() as u32).collect();
    fn root(parent: &mut [u32], mut i: u32) -> u32 {
        while parent[i as usize] != i {
            parent[i as usize] = parent[parent[i as usize] as usize];
            i = parent[i as usize];
        }
        i
    }
    for tet in &mesh.tets {
        for i in &tet[1..] {
            let (a, b) = (root(&mut parent, tet[0]), root(&mut parent, *i));
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let mut part_of_root = vec![usize::MAX; mesh.vertices.len()];
    let mut within = vec![0; mesh.vertices.len()];
    let mut parts: Vec<TetMesh> = Vec::new();
    for (i, position) in mesh.vertices.iter().enumerate() {
        // The root of a part is its smallest node, so it comes first.
        let r = root(&mut parent, i as u32) as usize;
        if part_of_root[r] == usize::MAX {
            part_of_root[r] = parts.len();
            parts.push(TetMesh::default());
        }
        let part = &mut parts[part_of_root[r]];
        within[i] = part.vertices.len() as u32;
        part.vertices.push(*position);
    }
    for tet in &mesh.tets {
        let part = part_of_root[root(&mut parent, tet[0]) as usize];
        parts[part].tets.push(tet.map(|i| within[i as usize]));
    }
    parts.retain(|p| !p.tets.is_empty());
    parts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn parts_come_apart_and_the_most_slender_is_the_appendix() {
        let made = Organs::analytic(6_000).unwrap();
        assert_eq!(made.organs.len(), 6);
        assert!((4_000..7_000).contains(&made.tets()), "{} elements", made.tets());
        let mut together = TetMesh::default();
        for organ in &made.organs {
            let first = together.vertices.len() as u32;
            together.vertices.extend(&organ.mesh.vertices);
            together.tets.extend(organ.mesh.tets.iter().map(|t| t.map(|i| i + first)));
        }
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("all.msh");
        trocar_geometry::io::write_msh(&path, &together).unwrap();
        let read = Organs::read(&path).unwrap();
        assert_eq!(read.organs.len(), 6);
        assert_eq!(read.appendix, made.appendix);
        for (a, b) in read.organs.iter().zip(&made.organs) {
            assert_eq!(a.mesh, b.mesh);
        }
        let in_millimetres =
            TetMesh { vertices: together.vertices.iter().map(|v| 1e3 * *v).collect(), tets: together.tets };
        trocar_geometry::io::write_msh(&path, &in_millimetres).unwrap();
        let said = Organs::read(&path).unwrap_err().to_string();
        assert!(said.contains("metres") && said.contains("all.msh"), "{said}");
    }
}
