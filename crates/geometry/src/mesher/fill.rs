//! The tets of a graded lattice.
//!
//! After Labelle and Shewchuk (2007), section 4. Two leaves of the same size that share a face have
//! a tet for each edge of that face, between their centres. If smaller leaves put a vertex in the
//! middle of the edge, the tet is halved there. On a face with four smaller leaves behind it, the
//! larger leaf has eight tets (quarters of a lattice tet) and each smaller leaf has two halves of a
//! pyramid. All of them have the middle of the large face as a corner, so the diagonals agree.
//!
//! Every possible node has an id: slots of lattice points first, then cut points, then points deep
//! inside that have no slot.

use super::bcc::{Lattice, jumps};
use super::blocks::{At, BLOCK, BLOCK_POINTS, Blocks};
use super::cuts::Cuts;
use super::octree::Octree;
use super::points::{MapWith, Point};
use super::stencil::{Corner, Side, fill};
use crate::{Error, Result, TetMesh};
use rayon::prelude::*;

/// Ids of the points of a block that is one leaf or part of one: the corner and the middle along
/// each axis.
const LEAF_POINTS: usize = 8;
/// Level of a leaf as large as a block.
const BLOCK_LEVEL: u32 = BLOCK.ilog2();
/// Maximum number of ids.
const MAX_IDS: usize = 1 << 27;
/// Maximum number of elements.
const MAX_TETS: usize = 30_000_000;
/// Blocks filled in parallel before the elements are counted.
const BLOCKS_PER_BATCH: usize = 1024;
/// Marks a block whose points have no extra ids.
const NO_IDS: u32 = u32::MAX;

/// A warped lattice and its leaves, from which the tets are built.
pub(super) struct Filling<'a> {
    lattice: &'a Lattice,
    cuts: &'a Cuts,
    tree: Octree,
    /// First id of the points of each inside block without slots.
    first: Vec<u32>,
    /// Number of ids: slots, cut points, then the points without slots.
    ids: usize,
    /// The blocks with extra ids, in order of the ids.
    extra: Vec<u32>,
}

impl<'a> Filling<'a> {
    /// Prepares leaves of at most `coarsest` cells.
    pub(super) fn new(lattice: &'a Lattice, cuts: &'a Cuts, coarsest: u32) -> Result<Self> {
        let tree = Octree::over(lattice, coarsest);
        let blocks = lattice.blocks.count.iter().product();
        let mut ids = lattice.values.len() + cuts.len();
        let (mut first, mut extra) = (vec![NO_IDS; blocks], Vec::new());
        for block in (0..blocks).filter(|&block| lattice.blocks.block_at(block) == At::Inside) {
            first[block] = ids as u32;
            extra.push(block as u32);
            let whole = tree.level(lattice.blocks.first_cell(block).map(|c| c as i32)) >= BLOCK_LEVEL;
            ids += if whole { LEAF_POINTS } else { BLOCK_POINTS };
            // A uniform lattice has at least this many tets, whatever is at the surface.
            let at_least = if coarsest < 2 { 6 * BLOCK_POINTS * extra.len() } else { 0 };
            if ids > MAX_IDS || at_least > MAX_TETS {
                return Err(too_many(lattice));
            }
        }
        Ok(Self { lattice, cuts, tree, first, ids, extra })
    }

    /// All tets, with nodes numbered in the order of their first use.
    pub(super) fn tets(&self) -> Result<TetMesh> {
        let blocks: Vec<usize> =
            (0..self.first.len()).filter(|&block| self.lattice.blocks.block_at(block) != At::Outside).collect();
        let mut mesh = TetMesh::default();
        for some in blocks.chunks(BLOCKS_PER_BATCH) {
            let filled: Vec<Result<Vec<[u32; 4]>>> = some.par_iter().map(|&block| self.block(block)).collect();
            for tets in filled {
                mesh.tets.extend(tets?);
            }
            if mesh.tets.len() > MAX_TETS {
                return Err(too_many(self.lattice));
            }
        }
        let mut number = vec![u32::MAX; self.ids];
        for node in mesh.tets.iter_mut().flatten() {
            let id = *node as usize;
            if number[id] == u32::MAX {
                number[id] = mesh.vertices.len() as u32;
                let slots = self.lattice.values.len();
                mesh.vertices.push(if id < slots {
                    self.cuts.position_of_point(self.lattice, *node)
                } else if id < slots + self.cuts.len() {
                    self.cuts.position(self.lattice, id - slots)
                } else {
                    self.lattice.blocks.position(self.far_point(*node))
                });
            }
            *node = number[id];
        }
        Ok(mesh)
    }

    /// The tets of the leaves whose lower corner lies in a block.
    fn block(&self, block: usize) -> Result<Vec<[u32; 4]>> {
        let mut tets = Vec::new();
        let first = self.lattice.blocks.first_cell(block);
        for n in 0..BLOCK_POINTS / 2 {
            let cell = first.map_with([n % BLOCK, n / BLOCK % BLOCK, n / BLOCK / BLOCK], |a, b| (a + b) as i32);
            let level = self.tree.level(cell);
            if cell.iter().all(|c| c & ((1 << level) - 1) == 0) {
                self.leaf(cell, level, &mut tets)?;
            }
            if level >= BLOCK_LEVEL {
                break;
            }
        }
        Ok(tets)
    }

    /// The tets that belong to one leaf: those at its upper faces, and at its lower faces if the
    /// neighbour's size differs.
    fn leaf(&self, cell: Point, level: u32, tets: &mut Vec<[u32; 4]>) -> Result<()> {
        let size = 1 << level;
        for axis in 0..3 {
            for upper in [true, false] {
                let mut across = cell;
                across[axis] += if upper { size } else { -1 };
                let face = Face { centre: cell.map(|c| 2 * c + size), size, axis, upper };
                let beyond = self.tree.level(across);
                if beyond > level {
                    self.half_pyramids(&face, level, tets)?;
                } else if beyond < level {
                    self.quarters(&face, tets)?;
                } else if upper && level == 0 {
                    self.stuff(&face, tets);
                } else if upper {
                    self.lattice_tets(&face, cell, level, tets)?;
                }
            }
        }
        Ok(())
    }

    /// The four lattice tets at a face between two leaves of the same size, halved at edges with a
    /// middle vertex.
    fn lattice_tets(&self, face: &Face, cell: Point, level: u32, tets: &mut Vec<[u32; 4]>) -> Result<()> {
        let centres = [face.at(0, 0, 0), face.at(2, 0, 0)];
        for i in 0..4 {
            let [a, middle, b] = face.edge(i);
            // The two other leaves around the edge.
            let mut beside = cell;
            for other in (0..3).filter(|&other| other != face.axis) {
                beside[other] += match middle[other] - face.centre[other] {
                    0 => 0,
                    towards if towards > 0 => face.size,
                    _ => -1,
                };
            }
            let mut beyond = beside;
            beyond[face.axis] += face.size;
            if self.tree.level(beside) < level || self.tree.level(beyond) < level {
                self.push([centres[0], centres[1], a, middle], tets)?;
                self.push([centres[0], centres[1], middle, b], tets)?;
            } else {
                self.push([centres[0], centres[1], a, b], tets)?;
            }
        }
        Ok(())
    }

    /// The eight tets of a leaf at a face with smaller leaves behind it.
    fn quarters(&self, face: &Face, tets: &mut Vec<[u32; 4]>) -> Result<()> {
        for i in 0..4 {
            let [a, middle, b] = face.edge(i);
            self.push([face.centre, face.at(1, 0, 0), a, middle], tets)?;
            self.push([face.centre, face.at(1, 0, 0), middle, b], tets)?;
        }
        Ok(())
    }

    /// The two halves of the pyramid of a leaf at a face with a larger leaf behind it.
    fn half_pyramids(&self, face: &Face, level: u32, tets: &mut Vec<[u32; 4]>) -> Result<()> {
        // The middle of the large face is the corner at an odd multiple of this leaf's size along
        // both axes.
        let odd = |p: &Point| (0..3).filter(|&a| a != face.axis).all(|a| p[a] >> (level + 1) & 1 == 1);
        let rim = [0, 1, 2, 3].map(|i| face.edge(i)[0]);
        let middle = rim.iter().position(odd).unwrap_or(0);
        let [m, a, opposite, b] = [0, 1, 2, 3].map(|i| rim[(middle + i) % 4]);
        self.push([face.centre, m, a, opposite], tets)?;
        self.push([face.centre, m, opposite, b], tets)
    }

    /// Adds a tet that must lie entirely inside.
    fn push(&self, points: [Point; 4], tets: &mut Vec<[u32; 4]>) -> Result<()> {
        let mut tet = [0; 4];
        for (id, p) in tet.iter_mut().zip(points) {
            *id = match self.id(p) {
                Some(id) if self.lattice.is_inside(p) => id,
                _ => return Err(jumps(self.lattice.blocks.position(p))),
            };
        }
        tets.push(tet);
        Ok(())
    }

    /// Fills the four lattice tets at a face between two cells, which may cross the surface.
    fn stuff(&self, face: &Face, tets: &mut Vec<[u32; 4]>) {
        let rim = [0, 1, 2, 3].map(|i| face.edge(i)[0]);
        let points = [face.centre, face.at(2, 0, 0), rim[0], rim[1], rim[2], rim[3]];
        let sides = points.map(|p| match self.lattice.blocks.at(p) {
            At::Outside => Side::Outside,
            At::Inside => Side::Inside,
            At::Slot(slot) => match self.lattice.values[slot as usize] {
                value if value < 0.0 => Side::Inside,
                value if value > 0.0 => Side::Outside,
                _ => Side::Surface,
            },
        });
        if !sides.contains(&Side::Inside) {
            return;
        }
        for i in 0..4 {
            let of = [0, 1, 2 + i, 2 + (i + 1) % 4];
            let corners = of.map(|k| points[k]);
            fill(&corners, &of.map(|k| sides[k]), |tet| {
                // Inside and surface corners have an id, and every edge from inside to outside has
                // a cut.
                let id = |corner| match corner {
                    Corner::Point(k) => self.id(corners[k]),
                    Corner::Cut(k, l) => self
                        .cuts
                        .between(self.lattice, corners[k], corners[l])
                        .map(|cut| (self.lattice.values.len() + cut) as u32),
                };
                if let [Some(a), Some(b), Some(c), Some(d)] = tet.map(id) {
                    tets.push([a, b, c, d]);
                }
            });
        }
    }

    /// Id of a point that is not far outside.
    fn id(&self, p: Point) -> Option<u32> {
        match self.lattice.blocks.at(p) {
            At::Outside => None,
            At::Slot(slot) => Some(slot),
            At::Inside => {
                let cell = p.map(|c| (c >> 1) as usize);
                let first = self.first[self.lattice.blocks.block(cell)];
                let whole = self.tree.level(cell.map(|c| c as i32)) >= BLOCK_LEVEL;
                let [x, y, z] = cell.map(|c| usize::from(c % BLOCK != 0));
                Some(first + if whole { 4 * z + 2 * y + x } else { Blocks::local(p) } as u32)
            }
        }
    }

    /// The point without a slot that has this id.
    fn far_point(&self, id: u32) -> Point {
        let block = self.extra[self.extra.partition_point(|&block| self.first[block as usize] <= id) - 1] as usize;
        let (cell, local) = (self.lattice.blocks.first_cell(block), (id - self.first[block]) as usize);
        if self.tree.level(cell.map(|c| c as i32)) >= BLOCK_LEVEL {
            cell.map_with([local & 1, local >> 1 & 1, local >> 2], |c, middle| (2 * c + BLOCK * middle) as i32)
        } else {
            let inner = [local / 2 % BLOCK, local / 2 / BLOCK % BLOCK, local / 2 / BLOCK / BLOCK];
            cell.map_with(inner, |c, inner| (2 * (c + inner) + local % 2) as i32)
        }
    }
}

fn too_many(lattice: &Lattice) -> Error {
    let (cell, millions) = (lattice.blocks.cell, MAX_TETS / 1_000_000);
    Error::Mesh(format!("a cell of {cell} m gives more than about {millions} million elements; use a larger one"))
}

/// A face of a leaf. Lengths are in half cells.
struct Face {
    centre: Point,
    /// Edge of the leaf in cells, that is, half the edge in half cells.
    size: i32,
    /// The axis normal to the face.
    axis: usize,
    /// Whether the face is the upper one along that axis.
    upper: bool,
}

impl Face {
    /// The point at the given offsets from the leaf's centre, in half edges of the leaf: outward
    /// through the face, and along the two other axes.
    fn at(&self, out: i32, u: i32, v: i32) -> Point {
        let mut p = self.centre;
        p[self.axis] += if self.upper { out * self.size } else { -out * self.size };
        p[(self.axis + 1) % 3] += u * self.size;
        p[(self.axis + 2) % 3] += v * self.size;
        p
    }

    /// First corner, middle and second corner of the face's edge `i`, counterclockwise seen from
    /// outside. So the tet (centre, point beyond the face on the axis, first, second) is positive.
    fn edge(&self, i: usize) -> [Point; 3] {
        const RIM: [[i32; 2]; 4] = [[-1, -1], [1, -1], [1, 1], [-1, 1]];
        let [a, b] = [RIM[i], RIM[(i + 1) % 4]];
        // Swapping the two axes mirrors the order for a lower face.
        [a, [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2], b]
            .map(|[u, v]| if self.upper { self.at(1, u, v) } else { self.at(1, v, u) })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::SignedDistance;
    use crate::quality::dihedral_angles;
    use crate::shapes::Ball;
    use glam::DVec3;
    use std::collections::BTreeMap;

    /// Lattice tets have angles of 60 to 90 degrees. The graded tets (halves and quarters of
    /// lattice tets, half pyramids) have 45 to 120.
    #[test]
    fn the_inner_tets_are_of_four_kinds_with_good_angles() {
        let mut lattice = Lattice::sample(&Ball(1.0), (DVec3::splat(-1.0), DVec3::splat(1.0)), 0.03).unwrap();
        let mut cuts = Cuts::find(&lattice, &Ball(1.0)).unwrap();
        cuts.warp(&mut lattice);
        let filling = Filling::new(&lattice, &cuts, 64).unwrap();
        let slots = lattice.values.len();
        // Position of a point that is inside and has not moved.
        let inner = |id: u32| match id as usize {
            slot if slot < slots => {
                (lattice.values[slot] < 0.0).then(|| lattice.blocks.position(lattice.blocks.point(id)))
            }
            cut if cut < slots + cuts.len() => None,
            _ => Some(lattice.blocks.position(filling.far_point(id))),
        };
        let mut kinds: BTreeMap<[i64; 6], (usize, f64)> = BTreeMap::new();
        for block in (0..filling.first.len()).filter(|&block| lattice.blocks.block_at(block) != At::Outside) {
            for tet in filling.block(block).unwrap() {
                if let [Some(a), Some(b), Some(c), Some(d)] = tet.map(inner) {
                    let mut angles =
                        dihedral_angles(&[a, b, c, d]).map(|angle| (10.0 * angle.to_degrees()).round() as i64);
                    angles.sort_unstable();
                    let kind = kinds.entry(angles).or_default();
                    kind.0 += 1;
                    kind.1 += (b - a).cross(c - a).dot(d - a) / 6.0;
                }
            }
        }
        assert_eq!(kinds.len(), 4, "{kinds:?}");
        assert!(kinds.contains_key(&[600, 600, 600, 600, 900, 900]), "the lattice tet");
        assert!(kinds.keys().all(|angles| angles[0] >= 450 && angles[5] <= 1200));
        assert!(kinds.values().all(|&(count, volume)| count > 100 && volume > 0.0));
    }

    /// A field may hide an outside region from the surface search. If the lattice reaches it, the
    /// field is rejected.
    #[test]
    fn a_field_that_overestimates_distances_is_rejected() {
        struct Hole;
        impl SignedDistance for Hole {
            fn distance(&self, p: DVec3) -> f64 {
                // A straight hole from the surface that the distances around it do not show.
                if p.x > 0.0 && p.y.hypot(p.z) < 0.04 { 0.5 } else { p.length() - 1.0 }
            }
        }
        let rejection =
            Lattice::sample(&Hole, (DVec3::splat(-1.0), DVec3::splat(1.0)), 0.03).err().map(|e| e.to_string());
        assert!(rejection.as_ref().is_some_and(|words| words.contains("excludes one")), "{rejection:?}");
    }
}
