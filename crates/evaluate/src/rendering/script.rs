//! The scripted grasp-lift as something to film.

use crate::{Error, Result};
use trocar_cell::{Cell, CellLift, CellLiftPolicy, Policy};
use trocar_progress::Progress;
use trocar_scene::Scene;

/// The scripted grasp-lift, a control period at a time.
pub(crate) struct Script {
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

    /// Goes on to a time [s].
    pub fn until(&mut self, time: f64, progress: &dyn Progress) -> Result<()> {
        progress.begin("simulate", 1);
        while self.cell.time() < time - 1e-9 {
            if progress.interrupted() {
                return Err(Error::Interrupted);
            }
            if !self.advance()? {
                let end = self.cell.time();
                return Err(Error::Mismatch(format!("--at is {time} s; the grasp-lift ends after {end:.2} s")));
            }
        }
        progress.end();
        Ok(())
    }

    /// Does one control period; false when the task is over.
    pub fn advance(&mut self) -> Result<bool> {
        let Some(action) = self.policy.act(&self.cell)? else { return Ok(false) };
        let report = self.cell.step(&action)?;
        Ok(report.tissue.divergence.is_none())
    }
}
