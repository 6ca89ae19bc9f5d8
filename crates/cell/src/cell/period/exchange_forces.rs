//! Stage 4: the arms get the forces of the frame, jaws grasp and release, and blades cut.

use crate::cell::Cell;
use crate::cell::arm::{ArmUnit, Sheared};
use crate::cell::report::{CellEvent, PeriodLog};
use crate::{Result, World};
use trocar_scene::InstrumentKind;
use trocar_tissue::Event;

impl Cell {
    pub(super) fn exchange_forces(&mut self, log: &mut PeriodLog) -> Result<()> {
        for k in 0..self.arms.len() {
            if let Some(sheared) = self.arms[k].take_forces(&mut self.world, self.physics_steps, &mut log.events) {
                self.cut(k, &sheared, &mut log.events)?;
            }
        }
        Ok(())
    }
}

impl ArmUnit {
    /// Applies the forces of the frame of `steps` physics steps, and lets the jaws grasp and
    /// release. Returns the work of a cutter.
    fn take_forces(&mut self, world: &mut World, steps: u32, events: &mut Vec<CellEvent>) -> Option<Sheared> {
        let Self { model, state, .. } = self;
        state.forces = model.tools.forces(world.forces());
        let organs = 0..world.model.bodies().len();
        state.pressed.end_frame(steps, organs.map(|organ| model.tools.all().map(|tool| world.force_of(organ, tool))));
        state.exchange.end_frame(state.gripper.pose.translation, &state.forces);
        for event in world.events() {
            match *event {
                Event::Slipped { tool, .. } if tool == model.tools.gripper => {
                    events.push(CellEvent::Slipped { arm: model.side });
                }
                Event::Torn { tool, force, .. } if tool == model.tools.gripper => {
                    events.push(CellEvent::Torn { arm: model.side, force_n: force });
                    self.let_go(world, events);
                    break;
                }
                _ => {}
            }
        }
        self.report_rcm(events);
        let Self { model, state, .. } = self;
        if let Some(force_n) = state.guard.newly_exceeded(state.exchange.force().length(), model.force_limit) {
            events.push(CellEvent::ForceLimit { arm: model.side, force_n });
        }
        match self.model.kind {
            InstrumentKind::Grasper => {
                self.grasp(world, events);
                None
            }
            InstrumentKind::Cutter => self.cut(world),
        }
    }

    fn report_rcm(&mut self, events: &mut Vec<CellEvent>) {
        let (arm, deviation_mm) = (self.model.side, 1e3 * self.state.rcm_peak);
        for k in 0..2 {
            let over = self.state.rcm_peak > self.model.rcm_limits[k];
            if over && !self.state.rcm_reported[k] {
                events.push(match k {
                    0 => CellEvent::RcmThreshold { arm, deviation_mm },
                    _ => CellEvent::RcmAbort { arm, deviation_mm },
                });
            }
            self.state.rcm_reported[k] = over;
        }
    }
}
