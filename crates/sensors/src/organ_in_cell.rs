//! An organ of a specimen in a cell: its pieces among the cell's bodies, and its drawn surface.

use crate::organ::{BoundSurface, OrganSkin, Piece};
use crate::{Error, Result};
use glam::DVec3;
use std::sync::Arc;
use trocar_cell::World;
use trocar_specimen::Organ;

/// An organ, with its nodes as they were when it last followed a cell.
#[derive(Clone)]
pub(crate) struct OrganInCell {
    pub recorded: Arc<OrganSkin>,
    pub surface: Arc<BoundSurface>,
    /// Nodes of all pieces, numbered consecutively (m).
    pub nodes: Vec<DVec3>,
    /// Bodies of the cell that are pieces of this organ.
    pub bodies: Vec<usize>,
    /// Their elements.
    tets: Vec<Vec<[u32; 4]>>,
}

impl OrganInCell {
    /// As it was recorded, without a cell.
    pub fn new(organ: &Organ) -> Self {
        let recorded = OrganSkin::new(organ);
        let surface = Arc::new(recorded.whole_surface());
        let nodes = recorded.body.vertices.clone();
        Self { recorded: Arc::new(recorded), surface, nodes, bodies: Vec::new(), tets: Vec::new() }
    }

    /// Takes its nodes from a cell. Returns whether its surface has the same triangles as before.
    pub fn follow(&mut self, world: &World) -> Result<bool> {
        let bodies = world.model.bodies();
        let name = self.recorded.name.as_str();
        let of = |b: &str| b.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'));
        let same = !self.bodies.is_empty()
            && bodies.iter().filter(|b| of(b.name())).count() == self.bodies.len()
            && self
                .bodies
                .iter()
                .zip(&self.tets)
                .all(|(b, tets)| bodies.get(*b).is_some_and(|b| of(b.name()) && b.tets() == tets));
        if !same {
            self.bodies = (0..bodies.len()).filter(|b| of(bodies[*b].name())).collect();
            self.tets = self.bodies.iter().map(|b| bodies[*b].tets().to_vec()).collect();
            let piece = |b: &usize| Piece { rest: bodies[*b].rest_positions(), tets: bodies[*b].tets() };
            let pieces: Vec<Piece<'_>> = self.bodies.iter().map(piece).collect();
            let whole = pieces.len() == 1 && pieces[0].tets == self.recorded.body.tets;
            let surface =
                if whole { Some(self.recorded.whole_surface()) } else { self.recorded.surface_of_pieces(&pieces) };
            let surface = surface.ok_or_else(|| Error::Mismatch(format!("organ '{name}' has different elements")))?;
            self.surface = Arc::new(surface);
        }
        self.nodes.clear();
        for b in &self.bodies {
            self.nodes.extend((0..bodies[*b].len()).map(|i| world.state.position(&world.model, *b, i)));
        }
        Ok(same)
    }
}
