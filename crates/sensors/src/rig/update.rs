//! The stage follows the cell: organs as they are now, whole or in pieces, arms and instruments at their poses.

use super::{CameraRig, wet};
use crate::organ::Piece;
use crate::section::section;
use crate::{Error, Result};
use trocar_cell::Cell;

impl CameraRig {
    /// Brings the stage to where the cell is; [`Self::render`] does it itself.
    ///
    /// # Errors
    /// A cell of another scene.
    pub fn update(&mut self, cell: &Cell) -> Result<()> {
        let world = cell.world();
        let bodies = world.model.bodies();
        let mut same = true;
        for organ in &mut self.organs {
            let name = organ.whole.name.as_str();
            let of = |b: &str| b.strip_prefix(name).is_some_and(|rest| rest.is_empty() || rest.starts_with('.'));
            let is_same = organ.shape.is_some()
                && bodies.iter().filter(|b| of(b.name())).count() == organ.bodies.len()
                && organ
                    .bodies
                    .iter()
                    .zip(&organ.tets)
                    .all(|(b, tets)| bodies.get(*b).is_some_and(|b| of(b.name()) && b.tets() == tets));
            if !is_same {
                same = false;
                organ.bodies = (0..bodies.len()).filter(|b| of(bodies[*b].name())).collect();
                organ.tets = organ.bodies.iter().map(|b| bodies[*b].tets().to_vec()).collect();
                let pieces: Vec<Piece<'_>> = organ
                    .bodies
                    .iter()
                    .map(|b| Piece { rest: bodies[*b].rest_positions(), tets: bodies[*b].tets() })
                    .collect();
                let whole = pieces.len() == 1 && pieces[0].tets == organ.whole.body.tets;
                let draped = if whole { Some(organ.whole.draped()) } else { organ.whole.in_pieces(&pieces) };
                organ.draped =
                    draped.ok_or_else(|| Error::Mismatch(format!("its organ '{name}' has other elements")))?;
            }
            organ.nodes.clear();
            for b in &organ.bodies {
                organ.nodes.extend((0..bodies[*b].len()).map(|i| world.state.position(&world.model, *b, i)));
            }
        }
        if same && self.section.is_none() {
            for organ in &mut self.organs {
                if organ.nodes == organ.before {
                    continue;
                }
                organ.draped.positions(&organ.nodes, &mut organ.skin);
                if let Some(shape) = organ.shape {
                    self.stage.deform(shape, &organ.skin)?;
                }
                organ.before.clone_from(&organ.nodes);
            }
            self.pose_arms(cell)
        } else {
            self.rebuild(Some(cell))
        }
    }

    /// Puts everything on a new stage: what stays the same is copied, organs are added.
    pub(super) fn rebuild(&mut self, cell: Option<&Cell>) -> Result<()> {
        self.stage = self.base.clone();
        for organ in &mut self.organs {
            organ.draped.positions(&organ.nodes, &mut organ.skin);
            let mut mesh = organ.draped.mesh.clone();
            mesh.vertices.clone_from(&organ.skin);
            let in_one = organ.nodes.len() == organ.whole.body.vertices.len();
            if let Some((point, normal)) = self.section.filter(|_| in_one) {
                mesh = section(&organ.whole, &organ.skin, &organ.nodes, point, normal);
            }
            let (shape, _) = self.stage.add_mesh(&mesh, organ.label, &wet(0.3))?;
            organ.shape = Some(shape);
            organ.before.clone_from(&organ.nodes);
        }
        cell.map_or(Ok(()), |cell| self.pose_arms(cell))
    }

    fn pose_arms(&mut self, cell: &Cell) -> Result<()> {
        for arm in &self.arms {
            for (body, pose) in arm.links.iter().zip(cell.link_poses(arm.name)?) {
                self.stage.place(*body, &pose)?;
            }
            let gripper = cell.gripper(arm.name)?;
            self.stage.place(arm.shaft, &gripper.pose)?;
            self.stage.place(arm.motor, &gripper.pose)?;
            for (body, side) in arm.blades.iter().zip([1.0, -1.0]) {
                self.stage.place(*body, &gripper.blade(side))?;
            }
        }
        Ok(())
    }
}
