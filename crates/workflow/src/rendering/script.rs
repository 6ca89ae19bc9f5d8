//! The scripted grasp-lift as something to film.

use crate::Result;
use trocar_cell::{Cell, CellLift, CellLiftPolicy, Policy};
use trocar_scene::Scene;

/// The scripted grasp-lift, a control period at a time.
pub struct Script {
    /// The cell.
    pub cell: Cell,
    policy: CellLiftPolicy,
}

impl Script {
    /// The task of `scene`: its organ, grasped in the middle, lifted 15 mm.
    pub fn new(scene: &Scene, cell: Cell) -> Result<Self> {
        let mut task = CellLift::default();
        if let Some(arm) = scene.grasping_arm() {
            task.arm = arm.name.name().to_owned();
        }
        let organ = &scene.task.organ;
        task.organ = cell.world().model.bodies().iter().any(|b| b.name() == organ).then(|| organ.clone());
        task.design = Some(cell.grasp_design(&task.arm)?);
        Ok(Self { policy: CellLiftPolicy::new(&task, &cell)?, cell })
    }

    /// Does one control period; false when the task is over.
    pub fn advance(&mut self) -> Result<bool> {
        let Some(action) = self.policy.act(&self.cell)? else { return Ok(false) };
        let report = self.cell.step(&action)?;
        Ok(report.tissue.divergence.is_none())
    }
}
