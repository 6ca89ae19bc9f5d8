//! What a cut left: the pieces of an organ in figures, and the organ as its report shows it.

use crate::World;
use glam::DVec3;
use serde::Serialize;
use trocar_geometry::TetMesh;
use trocar_tissue::Piece;

/// Corners of the face opposite each corner of an element, counter-clockwise seen from outside.
const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/// A cut in figures.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Severance {
    /// `severed`, `cut in part`, `no tissue`, or `not closed` where the run ended before the blades
    /// had.
    pub outcome: &'static str,
    /// The same in a sentence.
    pub said: String,
    /// Organ coordinate at which the cutter was put.
    pub aimed_at: f64,
    /// Organ coordinate of the cut: the mean over the nodes that fell apart; 0 where nothing was
    /// cut.
    pub at: f64,
    /// The least and greatest of these: elements' faces are no plane.
    pub at_least: f64,
    /// See [`at_least`](Self::at_least).
    pub at_most: f64,
    /// Time at which the blades closed [s].
    pub time_s: f64,
    /// How wide they were open [rad].
    pub opened_rad: f64,
    /// The angle at which they cut [rad].
    pub closed_rad: f64,
    /// Tissue of the organ between the open blades [mm3].
    pub between_blades_mm3: f64,
    /// Faces between elements that opened.
    pub faces: usize,
    /// Their area, of one side [mm2].
    pub area_mm2: f64,
    /// Nodes that came new, as copies of those on the cut.
    pub copies: usize,
    /// The pieces: the one that stays the organ, then those that came loose. Empty where nothing
    /// was cut.
    pub pieces: Vec<SeveredPiece>,
    /// Volume of the organ just before the cut [mm3].
    pub volume_before_mm3: f64,
    /// Volume of all pieces just after [mm3].
    pub volume_after_mm3: f64,
    /// How far the two are apart, over the first.
    pub volume_error: f64,
    /// Inverted elements of the organ just before the cut.
    pub inverted_before: usize,
    /// Inverted elements of the pieces just after.
    pub inverted_after: usize,
    /// Most inverted elements of all organs in any frame since.
    pub inverted_peak: usize,
    /// Rise of the jaws since the blades closed [mm].
    pub jaw_rise_mm: f64,
    /// Rise of the tissue in the jaws since then [mm].
    pub held_rise_mm: f64,
    /// The jaws still hold it: it has followed at least 0.80 of their rise, and slipped less than 3
    /// mm since. False where nothing was cut through.
    pub held: bool,
    /// Wall time of the cut: faces, new model, solver prepared [ms].
    pub cut_ms: f64,
}

/// A piece of the organ in figures.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SeveredPiece {
    /// Its body's name.
    pub name: String,
    /// Nodes.
    pub nodes: usize,
    /// Elements.
    pub elements: usize,
    /// Pinned nodes.
    pub pinned: usize,
    /// Nodes in the jaws.
    pub held: usize,
    /// Least organ coordinate of its nodes.
    pub s_from: f64,
    /// Greatest organ coordinate of its nodes.
    pub s_to: f64,
    /// Volume of its elements just before the cut [mm3].
    pub volume_before_mm3: f64,
    /// And just after [mm3].
    pub volume_after_mm3: f64,
    /// Rise of its centroid from the cut to the end [mm].
    pub rise_mm: f64,
}

/// An organ that was cut, for those who draw it. Its nodes are numbered through its pieces, one
/// after the other; its elements keep the specimen's order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CutOrgan {
    /// The organ's place in the specimen.
    pub organ: usize,
    /// Elements in the specimen's order.
    pub tets: Vec<[u32; 4]>,
    /// For each node, the specimen's that it is or is a copy of.
    pub parents: Vec<u32>,
    /// For each node, its piece.
    pub piece: Vec<u32>,
    /// Faces that the cut laid bare, of both sides; counter-clockwise seen from outside.
    pub faces: Vec<[u32; 3]>,
    /// Bodies of the pieces.
    bodies: Vec<usize>,
}

impl CutOrgan {
    /// The organ at `organ`, whose elements were `whole`, in `world` after it fell into `pieces`.
    pub(crate) fn new(organ: usize, whole: &[[u32; 4]], pieces: &[Piece], world: &World) -> Self {
        let mut cut = Self { organ, tets: vec![[0; 4]; whole.len()], ..Self::default() };
        for (k, piece) in pieces.iter().enumerate() {
            let first = cut.parents.len() as u32;
            let tets = world.model.bodies()[piece.body].tets();
            for (element, tet) in piece.elements.iter().zip(tets) {
                cut.tets[*element as usize] = tet.map(|i| first + i);
            }
            cut.parents.extend(&piece.nodes);
            cut.piece.resize(cut.parents.len(), k as u32);
            cut.bodies.push(piece.body);
        }
        let neighbours = |tets: &[[u32; 4]]| TetMesh { vertices: Vec::new(), tets: tets.to_vec() }.neighbours();
        let (before, after) = (neighbours(whole), neighbours(&cut.tets));
        for (t, tet) in cut.tets.iter().enumerate() {
            let bared = (0..4).filter(|k| before[t][*k].is_some() && after[t][*k].is_none());
            cut.faces.extend(bared.map(|k| FACES[k].map(|corner| tet[corner])));
        }
        cut
    }

    /// Where its nodes are now [m].
    pub(crate) fn positions(&self, world: &World) -> Vec<DVec3> {
        self.bodies.iter().flat_map(|body| world.state.positions(&world.model, *body)).collect()
    }

    /// Whether nodes `a` and `b` of the whole organ are in different pieces; false where they have
    /// copies in several.
    pub(crate) fn parts(&self, a: u32, b: u32) -> bool {
        let pieces = |node: u32| -> Vec<u32> {
            let copies = (0..self.parents.len()).filter(|i| self.parents[*i] == node);
            copies.map(|i| self.piece[i]).collect()
        };
        let (a, b) = (pieces(a), pieces(b));
        !a.iter().any(|piece| b.contains(piece))
    }
}
