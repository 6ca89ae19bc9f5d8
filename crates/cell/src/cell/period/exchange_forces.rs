//! Stage 4: the arms get the forces of the frame, jaws grasp and release, and blades cut.

use crate::cell::Cell;
use crate::cell::arm::ArmUnit;
use crate::cell::report::{CellEvent, PeriodLog};
use crate::severance::Severance;
use crate::{Gripper, Result, World};
use glam::DVec3;
use trocar_scene::InstrumentKind;
use trocar_tissue::Event;

impl Cell {
    pub(super) fn exchange_forces(&mut self, log: &mut PeriodLog) -> Result<()> {
        for k in 0..self.arms.len() {
            if let Some((organ, open)) = self.arms[k].take_forces(&mut self.world, &mut log.events) {
                self.cut(k, organ, &open, &mut log.events)?;
            }
        }
        Ok(())
    }

    /// Cuts: the cutter of arm `k`, as wide as it is in `open`, has closed through `organ`.
    fn cut(&mut self, k: usize, organ: usize, open: &Gripper, events: &mut Vec<CellEvent>) -> Result<()> {
        let name = self.world.model.bodies()[organ].name().to_owned();
        let arm = self.arms[k].model.side;
        let (mut count, mut parted) = (1, None);
        if self.sever {
            let (before, closed) = (Severance::before(&self.world, organ, open), self.arms[k].state.gripper.jaw_angle);
            let cut = open.cut_along(organ, self.arms[k].model.blades.length);
            let was: Vec<DVec3> = self.arms.iter().map(|s| s.held_now(&self.world)).collect();
            let pieces = self.world.sever(&cut)?;
            count = pieces.len().max(1);
            for (arm, was) in self.arms.iter_mut().zip(was) {
                if arm.holds(organ) && !pieces.is_empty() {
                    arm.follow_cut(&self.world, &pieces, was);
                }
            }
            let held: Vec<(usize, usize)> = self.arms.iter().filter_map(ArmUnit::held_nodes).collect();
            parted = Some(Box::new(before.after(&self.world, &pieces, &held, closed)));
        }
        events.push(CellEvent::Cut { arm, organ: name, pieces: count, parted });
        Ok(())
    }
}

impl ArmUnit {
    /// Takes the forces of the frame, and lets the jaws grasp and release. Returns the organ
    /// through which a cutter has closed, and the cutter as wide as it was open.
    fn take_forces(&mut self, world: &mut World, events: &mut Vec<CellEvent>) -> Option<(usize, Gripper)> {
        let Self { model, state, .. } = self;
        state.forces = model.tools.forces(world.forces());
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
        if let Some(force_n) = state.guard.newly_exceeded(model.force_limit) {
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
