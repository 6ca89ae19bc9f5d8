//! Ramification: each connected part of the material in a cell becomes a hexahedron of its own.
//!
//! Two pieces in a cell are connected if their tetrahedra share a face inside the cell. Hexahedra
//! of neighbouring cells share the four nodes of the side between them where material crosses that
//! side, and only there. So parts that merely lie near each other share neither cells nor nodes.
//! Nesme, Kry, Jerabkova and Faure, "Preserving topology and elasticity for embedded deformable
//! models", 2009, section 4.

use crate::pieces::Pieces;
use trocar_geometry::TetMesh;

/// Corners of a tetrahedron's face opposite each corner.
const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 2, 3], [0, 1, 3], [0, 1, 2]];

/// Corners of a cell on its upper side across each axis; the lower corner is without the axis' bit.
const UPPER: [[usize; 4]; 3] = [[1, 3, 5, 7], [2, 3, 6, 7], [4, 5, 6, 7]];

/// Hexahedra, by their pieces and nodes.
pub(crate) struct Ramified {
    /// The hexahedron of each piece. Hexahedra are numbered by cell, then by tetrahedron.
    pub hex_of_piece: Vec<u32>,
    /// The eight nodes of each hexahedron.
    pub nodes: Vec<[u32; 8]>,
    /// The cell of each hexahedron.
    pub cells: Vec<usize>,
    /// The grid corner of each node.
    pub corners: Vec<[usize; 3]>,
}

impl Ramified {
    pub fn new(pieces: &Pieces, mesh: &TetMesh) -> Self {
        let neighbours = mesh.neighbours();
        let (hex_of_piece, cells) = hexahedra(pieces, mesh, &neighbours);
        let mut same = Sets::new(8 * cells.len());
        for (p, piece) in pieces.list.iter().enumerate() {
            let tet = mesh.tets[piece.tet as usize];
            for axis in 0..3 {
                let Some(next) = pieces.next(piece.cell, axis) else { continue };
                let mut join = |other: u32| {
                    if let Some(q) = pieces.find(next, other) {
                        join_side(&mut same, axis, hex_of_piece[p], hex_of_piece[q]);
                    }
                };
                if pieces.crosses(tet, piece.cell, axis) {
                    join(piece.tet);
                }
                // A face may lie in the side itself: then different tetrahedra touch across it.
                let plane = pieces.grid.at(piece.cell)[axis] + 1;
                for (f, across) in neighbours[piece.tet as usize].iter().enumerate() {
                    let face = FACES[f].map(|corner| tet[corner]);
                    if let Some(other) = across
                        && pieces.plane_of(face) == Some((axis, plane))
                        && pieces.face_reaches(face, piece.cell)
                    {
                        join(*other);
                    }
                }
            }
        }
        let (nodes, corners) = number(&mut same, pieces, &cells);
        Self { hex_of_piece, nodes, cells, corners }
    }
}

/// The hexahedron of each piece, and the cell of each hexahedron.
fn hexahedra(pieces: &Pieces, mesh: &TetMesh, neighbours: &[[Option<u32>; 4]]) -> (Vec<u32>, Vec<usize>) {
    let mut parts = Sets::new(pieces.list.len());
    for (p, piece) in pieces.list.iter().enumerate() {
        for (f, across) in neighbours[piece.tet as usize].iter().enumerate() {
            // Each pair is seen from both sides; one is enough.
            let Some(other) = across.filter(|other| *other > piece.tet) else { continue };
            let Some(q) = pieces.find(piece.cell, other) else { continue };
            let face = FACES[f].map(|corner| mesh.tets[piece.tet as usize][corner]);
            if parts.root(p) != parts.root(q) && pieces.face_reaches(face, piece.cell) {
                parts.join(p, q);
            }
        }
    }
    let mut hex_of_piece = vec![0; pieces.list.len()];
    let mut cells = Vec::new();
    for p in 0..pieces.list.len() {
        let root = parts.root(p);
        if root == p {
            hex_of_piece[p] = cells.len() as u32;
            cells.push(pieces.list[p].cell);
        } else {
            hex_of_piece[p] = hex_of_piece[root];
        }
    }
    (hex_of_piece, cells)
}

/// Makes the nodes of `lower`'s upper side those of `upper`'s lower side.
fn join_side(same: &mut Sets, axis: usize, lower: u32, upper: u32) {
    for corner in UPPER[axis] {
        same.join(8 * lower as usize + corner, 8 * upper as usize + corner - (1 << axis));
    }
}

/// Numbers the sets of joined corners: the nodes of each hexahedron, the grid corner of each node.
fn number(same: &mut Sets, pieces: &Pieces, cells: &[usize]) -> (Vec<[u32; 8]>, Vec<[usize; 3]>) {
    let mut node_of = vec![0; 8 * cells.len()];
    let mut corners = Vec::new();
    for i in 0..node_of.len() {
        let root = same.root(i);
        if root == i {
            node_of[i] = corners.len() as u32;
            let ([x, y, z], c) = (pieces.grid.at(cells[i / 8]), i % 8);
            corners.push([x + (c & 1), y + (c >> 1 & 1), z + (c >> 2)]);
        } else {
            node_of[i] = node_of[root];
        }
    }
    let nodes = (0..cells.len()).map(|hex| std::array::from_fn(|c| node_of[8 * hex + c])).collect();
    (nodes, corners)
}

/// Disjoint sets. The root of a set is its smallest member.
struct Sets(Vec<usize>);

impl Sets {
    fn new(n: usize) -> Self {
        Self((0..n).collect())
    }

    fn root(&mut self, mut i: usize) -> usize {
        while self.0[i] != i {
            self.0[i] = self.0[self.0[i]];
            i = self.0[i];
        }
        i
    }

    fn join(&mut self, i: usize, j: usize) {
        let (a, b) = (self.root(i), self.root(j));
        self.0[a.max(b)] = a.min(b);
    }
}
