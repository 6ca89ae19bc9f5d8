//! The drawn surfaces of a specimen's organs and the postures of the arms: what moves in pictures
//! of a cell. They need no renderer, and are therefore also recorded and sent.

use crate::organ::{BoundSurface, OrganSkin, Piece};
use crate::{Error, Result};
use glam::DVec3;
use std::sync::Arc;
use trocar_cell::{Cell, Gripper, Placed};
use trocar_core::Pose;
use trocar_geometry::TriMesh;
use trocar_scene::Scene;
use trocar_specimen::Specimen;

/// Where an arm's links and its instrument are.
#[derive(Clone, Debug, PartialEq)]
pub struct ArmPosture {
    /// Poses of base, links and flange; empty for an ideal arm.
    pub links: Vec<Pose>,
    /// The instrument with its jaws.
    pub gripper: Gripper,
}

impl ArmPosture {
    /// Of the arm `name` of `cell`.
    ///
    /// # Errors
    /// An arm that the cell does not have.
    pub fn of(cell: &Cell, name: &str) -> Result<Self> {
        Ok(Self { links: cell.link_poses(name)?, gripper: cell.gripper(name)? })
    }
}

/// The drawn surfaces of all organs, which move with a cell.
///
/// A copy shares everything but the positions.
#[derive(Clone)]
pub struct Skins {
    organs: Vec<SkinnedOrgan>,
}

/// The drawn surface of one organ.
#[derive(Clone)]
pub struct SkinnedOrgan {
    recorded: Arc<OrganSkin>,
    surface: Arc<BoundSurface>,
    /// Bodies of the cell that are pieces of this organ, and their elements.
    bodies: Vec<usize>,
    tets: Vec<Vec<[u32; 4]>>,
    nodes: Vec<DVec3>,
    /// The nodes that `positions` are of.
    posed: Vec<DVec3>,
    positions: Vec<DVec3>,
    moved: bool,
}

impl SkinnedOrgan {
    /// Its name.
    pub fn name(&self) -> &str {
        &self.recorded.name
    }

    /// Triangles and colours. Its vertices are those of the rest pose (m). After a cut it is
    /// another mesh.
    pub fn mesh(&self) -> &TriMesh {
        &self.surface.mesh
    }

    /// Positions of the mesh's vertices now (m), in the cell.
    pub fn positions(&self) -> &[DVec3] {
        &self.positions
    }

    /// Triangles and colours, and how its vertices follow the nodes.
    pub fn surface(&self) -> &Arc<BoundSurface> {
        &self.surface
    }

    /// Nodes of all its pieces now (m), numbered consecutively.
    pub fn nodes(&self) -> &[DVec3] {
        &self.nodes
    }

    /// Bodies of the cell that are its pieces, in the order of the nodes.
    pub fn bodies(&self) -> &[usize] {
        &self.bodies
    }

    /// Whether the last update moved it.
    pub fn moved(&self) -> bool {
        self.moved
    }

    /// The organ as it was recorded, and its nodes now; `None` if it is in pieces.
    pub(crate) fn whole(&self) -> Option<(&OrganSkin, &[DVec3])> {
        (self.nodes.len() == self.recorded.body.vertices.len()).then_some((&self.recorded, &self.nodes[..]))
    }

    /// Positions of the nodes at rest (m).
    pub(crate) fn rest(&self) -> &[DVec3] {
        &self.recorded.body.vertices
    }

    fn pose(&mut self) {
        self.surface.positions(&self.nodes, &mut self.positions);
        self.posed.clone_from(&self.nodes);
    }
}

impl Skins {
    /// The organs of `specimen` where `scene` places them.
    ///
    /// # Errors
    /// A scene that does not suit the specimen.
    pub fn new(scene: &Scene, specimen: &Specimen) -> Result<Self> {
        Ok(Self::placed(&Placed::new(scene, specimen)?.specimen))
    }

    /// The organs of a specimen in its own frame.
    pub(crate) fn placed(specimen: &Specimen) -> Self {
        let organ = |organ| {
            let recorded = OrganSkin::new(organ);
            let surface = Arc::new(recorded.whole_surface());
            let mut made = SkinnedOrgan {
                surface,
                nodes: recorded.body.vertices.clone(),
                recorded: Arc::new(recorded),
                bodies: Vec::new(),
                tets: Vec::new(),
                posed: Vec::new(),
                positions: Vec::new(),
                moved: true,
            };
            made.pose();
            made
        };
        Self { organs: specimen.organs.iter().map(organ).collect() }
    }

    /// The organs, in the order of the specimen.
    pub fn organs(&self) -> &[SkinnedOrgan] {
        &self.organs
    }

    /// Moves the surfaces to where the cell's organs are. Returns whether all meshes are those of
    /// the last update; the first update and cuts change them.
    ///
    /// # Errors
    /// The cell belongs to another specimen.
    pub fn update(&mut self, cell: &Cell) -> Result<bool> {
        let world = cell.world();
        let bodies = world.model.bodies();
        let mut all_same = true;
        for organ in &mut self.organs {
            let name = organ.recorded.name.as_str();
            let of = |b: &str| b.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'));
            let is_same = !organ.bodies.is_empty()
                && bodies.iter().filter(|b| of(b.name())).count() == organ.bodies.len()
                && organ
                    .bodies
                    .iter()
                    .zip(&organ.tets)
                    .all(|(b, tets)| bodies.get(*b).is_some_and(|b| of(b.name()) && b.tets() == tets));
            if !is_same {
                all_same = false;
                organ.bodies = (0..bodies.len()).filter(|b| of(bodies[*b].name())).collect();
                organ.tets = organ.bodies.iter().map(|b| bodies[*b].tets().to_vec()).collect();
                let pieces: Vec<Piece<'_>> = organ
                    .bodies
                    .iter()
                    .map(|b| Piece { rest: bodies[*b].rest_positions(), tets: bodies[*b].tets() })
                    .collect();
                let whole = pieces.len() == 1 && pieces[0].tets == organ.recorded.body.tets;
                let surface = if whole {
                    Some(organ.recorded.whole_surface())
                } else {
                    organ.recorded.surface_of_pieces(&pieces)
                };
                let surface =
                    surface.ok_or_else(|| Error::Mismatch(format!("organ '{name}' has different elements")))?;
                organ.surface = Arc::new(surface);
            }
            organ.nodes.clear();
            for b in &organ.bodies {
                organ.nodes.extend((0..bodies[*b].len()).map(|i| world.state.position(&world.model, *b, i)));
            }
            organ.moved = !is_same || organ.nodes != organ.posed;
            if organ.moved {
                organ.pose();
            }
        }
        Ok(all_same)
    }

    /// Shows recorded surfaces: for each organ its mesh, if it is another one, and its positions
    /// (m).
    ///
    /// # Errors
    /// Another number of organs or of positions.
    pub(crate) fn show(&mut self, shown: &[(Arc<TriMesh>, Vec<DVec3>)], other_meshes: bool) -> Result<()> {
        let wrong = |reason: String| Err(Error::Mismatch(reason));
        if shown.len() != self.organs.len() {
            return wrong(format!("{} organs are shown; the specimen has {}", shown.len(), self.organs.len()));
        }
        for (organ, (mesh, positions)) in self.organs.iter_mut().zip(shown) {
            if mesh.vertices.len() != positions.len() {
                let (name, has) = (organ.name(), mesh.vertices.len());
                return wrong(format!("organ '{name}' has {} positions for {has} vertices", positions.len()));
            }
            if other_meshes {
                organ.surface = Arc::new(BoundSurface::alone(mesh.as_ref().clone()));
                // Not in one piece of this specimen.
                (organ.bodies, organ.nodes) = (Vec::new(), Vec::new());
            }
            organ.moved = other_meshes || organ.positions != *positions;
            organ.positions.clone_from(positions);
        }
        Ok(())
    }
}
