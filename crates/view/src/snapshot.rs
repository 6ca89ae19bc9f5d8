//! The copy of the cell for a frame. The simulation does this and no more; the frame is made in
//! another thread.

use crate::arm_columns::ARM_COLUMNS;
use crate::error::Result;
use crate::hub::Wants;
use crate::readings::Readings;
use crate::shapes::{Topology, fresh, pose_numbers, scene_message};
use glam::DVec3;
use serde_json::Value;
use std::sync::Arc;
use std::time::Instant;
use trocar_cell::Cell;
use trocar_sensors::DrawnCell;
use trocar_task::Episode;

/// A copy of an organ.
#[derive(Clone)]
pub(crate) struct OrganShot {
    /// Grows when a node moves.
    pub version: u64,
    /// Vertices of its surface (m).
    pub skin: Arc<Vec<DVec3>>,
    /// Its nodes (m), for values on it.
    pub nodes: Arc<Vec<DVec3>>,
}

/// A copy of what a frame shows.
pub(crate) struct Snapshot {
    pub topology: Arc<Topology>,
    /// The message `scene`, if it is new.
    pub scene: Arc<Vec<u8>>,
    pub organs: Vec<OrganShot>,
    pub poses: Vec<f32>,
    pub arms: Vec<f32>,
    pub arm_count: usize,
    pub contacts: Option<Vec<f32>>,
    pub held: Option<Vec<f32>>,
    /// Row and stages, as they were at the end of the last period.
    pub row: Vec<f32>,
    pub stages: Vec<f32>,
    /// The other fields of the frame's header.
    pub header: Value,
    pub wants: Wants,
    pub taken: Instant,
}

/// Takes snapshots of a cell.
pub(crate) struct Taker {
    pub drawn: DrawnCell,
    pub topology: Arc<Topology>,
    pub scene: Arc<Vec<u8>>,
    organs: Vec<OrganShot>,
}

impl Taker {
    /// For the cell of `episode`, whose scene gets a new number.
    ///
    /// # Errors
    /// Shapes that cannot be read.
    pub fn of(episode: &Episode) -> Result<Self> {
        let cell = episode.cell();
        let drawn = DrawnCell::new(episode.arranged_scene(), episode.specimen(), cell)?;
        let number = fresh();
        let topology = Topology::of(number, cell, &drawn);
        let scene = scene_message(number, episode, &drawn)?;
        Ok(Self { drawn, topology: Arc::new(topology), scene: Arc::new(scene), organs: Vec::new() })
    }

    /// Follows the organs of `cell`. After a cut they have new surfaces.
    fn follow(&mut self, cell: &Cell) -> Result<()> {
        if !self.drawn.skins.update(cell)? {
            self.topology = Arc::new(Topology::of(self.topology.scene, cell, &self.drawn));
            self.organs.clear();
        }
        let had = std::mem::take(&mut self.organs);
        for (k, organ) in self.drawn.skins.organs().iter().enumerate() {
            let known = had.get(k).filter(|_| !organ.moved()).cloned();
            self.organs.push(known.unwrap_or_else(|| OrganShot {
                version: fresh(),
                skin: Arc::new(organ.positions().to_vec()),
                nodes: Arc::new(organ.nodes().to_vec()),
            }));
        }
        Ok(())
    }

    /// A snapshot of `cell`; readings and header are the caller's.
    pub fn take(&mut self, cell: &Cell, wants: Wants, header: Value, readings: &Readings) -> Result<Snapshot> {
        self.follow(cell)?;
        let poses = self.drawn.poses(cell)?;
        let observed = cell.observe();
        let mut arms = Vec::with_capacity(ARM_COLUMNS.len() * observed.len());
        for (k, arm) in observed.iter().enumerate() {
            self.push_arm(cell, k, arm, &mut arms)?;
        }
        Ok(Snapshot {
            topology: Arc::clone(&self.topology),
            scene: Arc::clone(&self.scene),
            organs: self.organs.clone(),
            poses: poses.iter().flat_map(pose_numbers).map(|x| x as f32).collect(),
            arms,
            arm_count: observed.len(),
            contacts: wants.contacts.then(|| self.contacts(cell)),
            held: wants.held.then(|| held(cell, observed.len())),
            row: readings.row.clone(),
            stages: readings.stages.clone(),
            header,
            wants,
            taken: Instant::now(),
        })
    }

    fn push_arm(&self, cell: &Cell, k: usize, arm: &trocar_cell::ArmObservation, out: &mut Vec<f32>) -> Result<()> {
        let name = arm.side.name();
        let gripper = cell.gripper(name)?;
        let commanded = cell.workspace(name)?.tip(&arm.commanded);
        let flag = |on: bool| f64::from(u8::from(on));
        let carried = cell.carried(k);
        let organ = carried.and_then(|c| self.topology.bodies.iter().position(|own| own.contains(&c.organ)));
        let follow = carried.map_or(0.0, |c| if c.jaw_lift.abs() > 1e-4 { c.tissue_lift / c.jaw_lift } else { 0.0 });
        let numbers = [
            &pose_numbers(&arm.tip)[..],
            &[arm.measured.jaw(), gripper.jaw_angle],
            &pose_numbers(&commanded),
            &arm.measured.0,
            &arm.commanded.0,
            &arm.contact.to_array(),
            &arm.constraint.to_array(),
            &[arm.jaw_force, 1e3 * arm.rcm_deviation, 1e3 * arm.rcm_peak],
            &[arm.attached, arm.held_back, arm.guarded, arm.load_limited, cell.pierces(name)?].map(flag),
            &[organ.map_or(-1.0, |k| k as f64), carried.map_or(0.0, |c| c.s)],
            &[follow, carried.map_or(0.0, |c| 1e3 * c.slip)],
        ];
        out.extend(numbers.into_iter().flatten().map(|x| *x as f32));
        Ok(())
    }

    /// Place, force and organ of each contact.
    fn contacts(&self, cell: &Cell) -> Vec<f32> {
        let world = cell.world();
        let mut all = Vec::new();
        for load in world.contact_loads() {
            let place = world.state.position(&world.model, load.body, load.node);
            let organ = self.topology.bodies.iter().position(|own| own.contains(&load.body));
            all.extend(place.as_vec3().to_array());
            all.extend(load.force.as_vec3().to_array());
            all.extend([organ.map_or(-1.0, |k| k as f32), 0.0]);
        }
        all
    }
}

/// Place of each held node, and the arm that holds it.
fn held(cell: &Cell, arms: usize) -> Vec<f32> {
    let world = cell.world();
    let mut all = Vec::new();
    for arm in 0..arms {
        if let Some((body, nodes)) = cell.carried_nodes(arm) {
            for node in nodes {
                all.extend(world.state.position(&world.model, body, *node as usize).as_vec3().to_array());
                all.push(arm as f32);
            }
        }
    }
    all
}
