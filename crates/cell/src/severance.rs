//! An organ that blades part, a part of the way at a time, and figures of the cut.

use crate::{Gripper, JawRegion, Result, World};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use std::sync::Arc;
use trocar_geometry::TetMesh;
use trocar_tissue::{Piece, sides};

/// Corners of the face opposite each corner of an element, counter-clockwise seen from outside.
const FACES: [[usize; 3]; 4] = [[1, 2, 3], [0, 3, 2], [0, 1, 3], [0, 2, 1]];

/// Figures of a cut, at the instant of the cut.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Severance {
    /// `severed`, `cut in part` or `no tissue`.
    pub outcome: String,
    /// The same in a sentence.
    pub said: String,
    /// Organ coordinate of the cut: the mean over the separated nodes; 0 if nothing was cut.
    pub at: f64,
    /// The smallest of these organ coordinates: the elements' faces are not a plane.
    pub at_least: f64,
    /// The greatest of them.
    pub at_most: f64,
    /// Angle between the open blades (rad).
    pub opened_rad: f64,
    /// The angle at which they cut (rad).
    pub closed_rad: f64,
    /// Tissue of the organ between the open blades (mm3).
    pub between_blades_mm3: f64,
    /// Faces between elements that opened.
    pub faces: usize,
    /// Their area, of one side (mm2).
    pub area_mm2: f64,
    /// Their area projected on the plane of the cut (mm2): that of the section, because faces
    /// zigzag.
    #[serde(default)]
    pub section_mm2: f64,
    /// Work of the jaws (mJ).
    #[serde(default)]
    pub work_mj: f64,
    /// The largest force of tissue on the blades, at their middle (N).
    #[serde(default)]
    pub force_peak_n: f64,
    /// New nodes: copies of those on the cut.
    pub copies: usize,
    /// The pieces: the one that remains the organ, then the loose ones. Empty if nothing was cut.
    pub pieces: Vec<SeveredPiece>,
    /// Volume of the organ just before the cut (mm3).
    pub volume_before_mm3: f64,
    /// Volume of all pieces just after (mm3).
    pub volume_after_mm3: f64,
    /// The difference of the two over the first.
    pub volume_error: f64,
    /// Inverted elements of the organ just before the cut.
    pub inverted_before: usize,
    /// Inverted elements of the pieces just after.
    pub inverted_after: usize,
}

/// Figures of a piece of the organ.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct SeveredPiece {
    /// Its body's name.
    pub name: String,
    /// Nodes.
    pub nodes: usize,
    /// Elements.
    pub elements: usize,
    /// Pinned nodes.
    pub pinned: usize,
    /// Nodes in jaws.
    pub held: usize,
    /// Least organ coordinate of its nodes.
    pub s_from: f64,
    /// Greatest organ coordinate of its nodes.
    pub s_to: f64,
    /// Volume of its elements just before the cut (mm3).
    pub volume_before_mm3: f64,
    /// And just after (mm3).
    pub volume_after_mm3: f64,
    /// Height of its centroid at the cut (m).
    pub height_m: f64,
    /// Rise of its centroid from the cut to the end (mm).
    pub rise_mm: f64,
}

/// An organ that blades are parting.
#[derive(Clone, Debug, Default)]
pub(crate) struct Parting {
    before: Arc<BeforeCut>,
    /// The part of the blades along which it is open: distances from the pivot (m).
    pub part: [f64; 2],
    /// The organ in its pieces, if anything is open.
    pub pieces: Vec<Piece>,
    /// The figures when it parted last.
    pub figures: Severance,
    /// Number of faces that the last event reported.
    pub told: Option<usize>,
    /// Number of cuts of the world when it parted last.
    cuts: usize,
}

/// An organ before it is cut.
#[derive(Debug, Default)]
struct BeforeCut {
    organ: usize,
    tets: Vec<[u32; 4]>,
    /// Organ coordinates of its nodes.
    s: Vec<f64>,
    opened: f64,
    between_blades: f64,
    /// Normal of the cut.
    normal: DVec3,
    /// For each element, whether it comes to lie on the side that the normal points to.
    sides: Vec<bool>,
}

/// Volumes of the organ's elements (m3), negative where they are inverted.
type Volumes = Vec<f64>;

/// An organ in its pieces. Its nodes are numbered through the pieces, one after the other; its
/// elements keep the order of the whole organ.
struct CutMesh {
    mesh: TetMesh,
    /// For each node, the node of the whole organ that it is or is a copy of.
    parents: Vec<u32>,
    /// For each node, its piece.
    piece: Vec<usize>,
    /// Faces that the cut exposed, on both sides.
    faces: Vec<[u32; 3]>,
}

impl Parting {
    /// Body `organ` before the open blades of `open`, of `length` (m), cut it.
    ///
    /// # Errors
    /// An invalid cut.
    pub fn new(world: &World, organ: usize, open: &Gripper, length: f64) -> Result<Self> {
        let before = BeforeCut {
            organ,
            tets: world.model.bodies()[organ].tets().to_vec(),
            s: world.axes[organ].s.clone(),
            opened: open.jaw_angle,
            between_blades: JawRegion::of(open).tissue_of(world, organ).map_or(0.0, |tissue| tissue.volume),
            normal: open.pose.rotation * DVec3::Z,
            sides: sides(&world.model, &world.state, &open.cut_along(organ, length))?,
        };
        let part = [f64::INFINITY, f64::NEG_INFINITY];
        let before = Arc::new(before);
        let (pieces, figures) = (Vec::new(), Severance::default());
        Ok(Self { before, part, pieces, figures, told: None, cuts: world.cuts })
    }

    /// Whether nothing else has been cut since it parted last: pieces and sides are of the organ as
    /// it is.
    pub fn is_of(&self, world: &World) -> bool {
        self.cuts == world.cuts
    }

    /// The sides of the elements of the organ's body, which keeps one of the pieces.
    pub fn sides(&self) -> Vec<bool> {
        let (sides, organ) = (&self.before.sides, self.before.organ);
        match self.pieces.iter().find(|piece| piece.body == organ) {
            Some(piece) => piece.elements.iter().map(|t| sides[*t as usize]).collect(),
            None => sides.clone(),
        }
    }

    /// Volumes of the organ's elements now (m3).
    pub fn volumes(&self, world: &World) -> Volumes {
        let organ = self.before.organ;
        let mesh = match self.pieces.is_empty() {
            true => TetMesh { vertices: world.state.positions(&world.model, organ), tets: self.before.tets.clone() },
            false => CutMesh::new(&self.before.tets, &self.pieces, world).mesh,
        };
        volumes(&mesh)
    }

    /// Follows a further cut of the organ into `pieces`, at once. `volumes` were those of its
    /// elements before; `held` are bodies and numbers of nodes in jaws.
    pub fn follow(&mut self, world: &World, pieces: &[Piece], volumes: &Volumes, held: &[(usize, usize)]) {
        if let Some(at) = self.pieces.iter().position(|piece| piece.body == self.before.organ && !pieces.is_empty()) {
            let whole = self.pieces.remove(at);
            let of = |from: &[u32], to: &[u32]| to.iter().map(|i| from[*i as usize]).collect();
            let cut = pieces.iter().map(|piece| Piece {
                body: piece.body,
                nodes: of(&whole.nodes, &piece.nodes),
                elements: of(&whole.elements, &piece.elements),
            });
            self.pieces.extend(cut);
            self.pieces.sort_by_key(|piece| piece.body);
        } else if self.pieces.is_empty() {
            self.pieces = pieces.to_vec();
        }
        self.cuts = world.cuts;
        self.figures = self.before.after(world, &self.pieces, volumes, held);
    }

    /// The numbers of its state; the tissue is the world's.
    pub fn numbers(&self) -> impl Iterator<Item = f64> + use<> {
        let Self { before, part, pieces, figures, told, cuts } = self;
        let told = told.map_or(-1.0, |told| told as f64);
        let own = [before.organ as f64, before.opened, part[0], part[1], told];
        own.into_iter().chain([pieces.len() as f64, figures.area_mm2, *cuts as f64])
    }
}

/// Volumes of the elements of `mesh` (m3).
fn volumes(mesh: &TetMesh) -> Volumes {
    (0..mesh.tets.len()).map(|t| mesh.tet_volume(t)).collect()
}

impl BeforeCut {
    /// The figures once the organ, whose elements had the volumes `were`, is in `pieces`.
    fn after(&self, world: &World, pieces: &[Piece], were: &Volumes, held: &[(usize, usize)]) -> Severance {
        let inverted = |volumes: &Volumes| volumes.iter().filter(|v| **v <= 0.0).count();
        let volume = 1e9 * were.iter().sum::<f64>();
        let mut figures = Severance {
            outcome: "no tissue".to_owned(),
            opened_rad: self.opened,
            between_blades_mm3: 1e9 * self.between_blades,
            volume_before_mm3: volume,
            volume_after_mm3: volume,
            inverted_before: inverted(were),
            inverted_after: inverted(were),
            ..Severance::default()
        };
        let name = world.model.bodies()[self.organ].name();
        if pieces.is_empty() {
            figures.said =
                format!("the blades closed on the {name} and nothing was cut: too little of it lies beyond them");
            return figures;
        }
        let cut = CutMesh::new(&self.tets, pieces, world);
        let are = volumes(&cut.mesh);
        let area = |face: &[u32; 3]| {
            let [a, b, c] = face.map(|i| cut.mesh.vertices[i as usize]);
            0.5 * (b - a).cross(c - a)
        };
        figures.faces = cut.faces.len() / 2;
        figures.area_mm2 = 0.5e6 * cut.faces.iter().map(|face| area(face).length()).sum::<f64>();
        figures.section_mm2 = 0.5e6 * cut.faces.iter().map(|face| area(face).dot(self.normal).abs()).sum::<f64>();
        figures.copies = cut.parents.len() - self.s.len();
        self.place(&cut, &mut figures);
        (figures.volume_after_mm3, figures.inverted_after) = (1e9 * are.iter().sum::<f64>(), inverted(&are));
        figures.volume_error = (figures.volume_after_mm3 / figures.volume_before_mm3 - 1.0).abs();
        figures.pieces = pieces.iter().map(|piece| self.piece(world, piece, [were, &are], held)).collect();
        let end = |best: fn(&f64, &f64) -> bool| {
            let s = &self.s;
            (0..s.len()).fold(0, |found, i| if best(&s[i], &s[found]) { i } else { found }) as u32
        };
        let through = cut.parts(end(|a, b| a < b), end(|a, b| a > b));
        (figures.outcome, figures.said) = outcome(name, &figures, through);
        figures
    }

    /// Where the cut is, by the organ coordinates of the nodes that fell apart.
    fn place(&self, cut: &CutMesh, figures: &mut Severance) {
        let s = &self.s;
        let mut copies = vec![0; s.len()];
        cut.parents.iter().for_each(|i| copies[*i as usize] += 1);
        let mut split: Vec<f64> = (0..copies.len()).filter(|i| copies[*i] > 1).map(|i| s[i]).collect();
        // A single face that opens inside duplicates no node.
        if split.is_empty() {
            split = cut.faces.iter().flatten().map(|i| s[cut.parents[*i as usize] as usize]).collect();
        }
        figures.at = split.iter().sum::<f64>() / split.len().max(1) as f64;
        figures.at_least = split.iter().copied().fold(1.0, f64::min);
        figures.at_most = split.iter().copied().fold(0.0, f64::max);
    }

    fn piece(&self, world: &World, piece: &Piece, volumes: [&Volumes; 2], held: &[(usize, usize)]) -> SeveredPiece {
        let body = &world.model.bodies()[piece.body];
        let volume = |of: &Volumes| 1e9 * piece.elements.iter().map(|t| of[*t as usize]).sum::<f64>();
        let along = || piece.nodes.iter().map(|i| self.s[*i as usize]);
        let nodes: Vec<u32> = (0..body.len() as u32).collect();
        SeveredPiece {
            name: body.name().to_owned(),
            nodes: body.len(),
            elements: body.tets().len(),
            pinned: body.pinned().iter().filter(|p| **p).count(),
            held: held.iter().filter(|(body, _)| *body == piece.body).map(|(_, nodes)| nodes).sum(),
            s_from: along().fold(1.0, f64::min),
            s_to: along().fold(0.0, f64::max),
            volume_before_mm3: volume(volumes[0]),
            volume_after_mm3: volume(volumes[1]),
            height_m: world.state.centroid(&world.model, piece.body, &nodes).dot(world.up),
            rise_mm: 0.0,
        }
    }
}

impl CutMesh {
    /// The organ whose elements were `whole` in `world` after it fell into `pieces`.
    fn new(whole: &[[u32; 4]], pieces: &[Piece], world: &World) -> Self {
        let (mut tets, mut parents, mut piece_of) = (vec![[0; 4]; whole.len()], Vec::new(), Vec::new());
        let mut vertices: Vec<DVec3> = Vec::new();
        for (k, piece) in pieces.iter().enumerate() {
            let first = parents.len() as u32;
            for (element, tet) in piece.elements.iter().zip(world.model.bodies()[piece.body].tets()) {
                tets[*element as usize] = tet.map(|i| first + i);
            }
            parents.extend(&piece.nodes);
            piece_of.resize(parents.len(), k);
            vertices.extend(world.state.positions(&world.model, piece.body));
        }
        let neighbours = |tets: &[[u32; 4]]| TetMesh { vertices: Vec::new(), tets: tets.to_vec() }.neighbours();
        let (before, after) = (neighbours(whole), neighbours(&tets));
        let mut faces = Vec::new();
        for (t, tet) in tets.iter().enumerate() {
            let bared = (0..4).filter(|k| before[t][*k].is_some() && after[t][*k].is_none());
            faces.extend(bared.map(|k| FACES[k].map(|corner| tet[corner])));
        }
        Self { mesh: TetMesh { vertices, tets }, parents, piece: piece_of, faces }
    }

    /// Whether nodes `a` and `b` of the whole organ are in different pieces; false where they have
    /// copies in several.
    fn parts(&self, a: u32, b: u32) -> bool {
        let pieces = |node: u32| -> Vec<usize> {
            let copies = (0..self.parents.len()).filter(|i| self.parents[*i] == node);
            copies.map(|i| self.piece[i]).collect()
        };
        let (a, b) = (pieces(a), pieces(b));
        !a.iter().any(|piece| b.contains(piece))
    }
}

/// Name of the outcome, and a sentence of it. `through`: the ends of the organ are apart.
fn outcome(name: &str, figures: &Severance, through: bool) -> (String, String) {
    let area = format!("{} faces, {:.0} mm2", figures.faces, figures.area_mm2);
    if !through {
        let loose = match figures.pieces.len() {
            1 => "it is still one piece".to_owned(),
            2 => "its ends are still joined, though a bit came loose".to_owned(),
            _ => "its ends are still joined, though some bits came loose".to_owned(),
        };
        let said = format!("the blades closed at s = {:.2} and cut the {name} in part ({area}): {loose}", figures.at);
        return ("cut in part".to_owned(), said);
    }
    let pinned = figures.pieces.iter().filter(|p| p.pinned > 0).count();
    let hangs = if pinned > 1 { "; both sides are pinned" } else { "" };
    let (at, count) = (figures.at, figures.pieces.len());
    let said = format!("the blades closed at s = {at:.2} and parted the {name} into {count} pieces ({area}){hangs}");
    ("severed".to_owned(), said)
}
