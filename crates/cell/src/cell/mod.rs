//! The two-arm cell of a scene: tissue, ports, instruments and dynamic arms, stepped by actions.
//!
//! A control period (1/30 s) is a number of tissue frames (1/60 s), each of them a number of
//! physics steps of the arms (1/480 s). In a frame the arms go first, under the load that tissue
//! had on them at the last frame's end, carried on with the tip (`exchange.rs`); then tissue is
//! stepped with tools that go from where the tips were measured at the frame's beginning to where
//! they are now. Instruments do not push each other: their clearance is measured, and an event
//! tells where they would have touched.

mod action;
mod build;
mod clearance;
mod crtk;
mod exchange;
mod figures;
mod guard;
mod look;
mod overstretch;
mod pierce;
mod placed;
mod report;
mod restart;
mod state;
mod station;

pub use action::{Action, ActionSpace, ROLL_SPEED, SWING_SPEED, TIP_SPEED};
pub use exchange::MOST_LOAD;
pub use figures::Carried;
pub use placed::Placed;
pub use report::{ArmObservation, CellEvent, CellReport, TaggedForce, TissueObservation};
pub use state::CellState;

use crate::hold::Moved;
use crate::{Error, FRAME, Gripper, Result, World};
use action::NUMBERS;
use glam::DVec3;
use overstretch::{Edges, FAR_TOO_MUCH, NEAR, PATIENCE, SQUEEZED};
use station::{Station, Wanted};
use std::time::{Duration, Instant};
use trocar_scene::Scene;
use trocar_specimen::Specimen;
use trocar_tissue::ToolMotion;

/// Frames of tissue a second [Hz].
const FRAMES_HZ: u32 = 60;

/// Wall time of the parts of what a cell has done since it was built.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Timing {
    /// The arms: controllers, ports, dynamics.
    pub arms: Duration,
    /// The tissue, contact included.
    pub tissue: Duration,
    /// All of it.
    pub all: Duration,
}

/// A two-arm cell.
pub struct Cell {
    world: World,
    stations: Vec<Station>,
    /// Control periods that are over.
    periods: u64,
    control_hz: u32,
    frames: u32,
    physics_steps: u32,
    sever: bool,
    motions: Vec<ToolMotion>,
    edges: Edges,
    /// By body, frames that it has been strained with no instrument at it.
    waits: Vec<u32>,
    /// The instruments are inside each other, and that was told.
    touch: bool,
    timing: Timing,
}

impl Cell {
    /// The cell of `scene` around `specimen`, whose tissue is stepped by `threads` threads (0: as
    /// many as the machine has). The arms stand in their start poses, the organs as they were
    /// recorded. Results do not depend on the threads.
    ///
    /// # Errors
    /// Names the field of the scene, or the organ, arm or instrument that cannot be.
    pub fn new(scene: &Scene, specimen: &Specimen, threads: usize) -> Result<Self> {
        Self::with_contact(scene, specimen, threads, true)
    }

    /// The same with organs that pass through each other where `organ_contact` is false: for
    /// measuring what their contact costs.
    ///
    /// # Errors
    /// As [`Cell::new`].
    pub fn with_contact(scene: &Scene, specimen: &Specimen, threads: usize, organ_contact: bool) -> Result<Self> {
        let (frames, physics_steps) = rates(scene)?;
        let Placed { specimen, mut surroundings, floor } = Placed::new(scene, specimen)?;
        let stations = build::stations(scene, floor)?;
        let colliders = stations.iter().flat_map(|s| s.fixed.blades.colliders(s.fixed.tools)).collect();
        if !organ_contact {
            surroundings.body_contact = None;
        }
        let schedule = build::schedule(scene.tissue.schedule);
        let world = World::surrounded(&specimen, &surroundings, colliders, schedule, threads)?;
        Ok(Self {
            motions: Vec::with_capacity(3 * stations.len()),
            edges: Edges::of(&world),
            waits: vec![0; world.model.bodies().len()],
            touch: false,
            world,
            stations,
            periods: 0,
            control_hz: scene.rates.control_hz,
            frames,
            physics_steps,
            sever: scene.task.sever,
            timing: Timing::default(),
        })
    }

    /// Does one control period.
    ///
    /// # Errors
    /// An action that cannot be done is refused with the number's place and name, and nothing has
    /// changed. An arm whose numbers are lost ends the run: restore a state.
    pub fn step(&mut self, action: &Action) -> Result<CellReport> {
        let needed = NUMBERS * self.stations.len();
        if action.numbers.len() != needed {
            return Err(Error::Action {
                index: action.numbers.len().min(needed),
                name: "length".to_owned(),
                reason: format!("is {}; {needed} numbers, {NUMBERS} an arm", action.numbers.len()),
            });
        }
        let targets = self.stations.iter().enumerate().map(|(k, s)| s.target(action, NUMBERS * k));
        let targets: Vec<Wanted> = targets.collect::<Result<_>>()?;
        for (station, target) in self.stations.iter_mut().zip(targets) {
            station.now.wanted = target;
        }
        self.advance()
    }

    /// Does one control period towards what the arms were last told.
    ///
    /// # Errors
    /// An arm whose numbers are lost.
    pub fn advance(&mut self) -> Result<CellReport> {
        let clock = Instant::now();
        let mut events = Vec::new();
        let mut tissue = TissueObservation::default();
        for station in &mut self.stations {
            station.command()?;
        }
        for _ in 0..self.frames {
            let arms = Instant::now();
            let dt = FRAME / f64::from(self.physics_steps);
            for station in &mut self.stations {
                for _ in 0..self.physics_steps {
                    station.step(dt)?;
                }
            }
            self.timing.arms += arms.elapsed();
            self.motions.clear();
            for station in &mut self.stations {
                self.motions.extend(station.motions(FRAME));
            }
            let stepping = Instant::now();
            let report = self.world.step(&self.motions);
            self.timing.tissue += stepping.elapsed();
            tissue.add(&report);
            for k in 0..self.stations.len() {
                if let Some((organ, open)) = self.stations[k].after_frame(&mut self.world, &mut events) {
                    self.cut(k, organ, &open, &mut events)?;
                }
            }
            self.look_after(report.min_volume_ratio, &mut events);
        }
        self.periods += 1;
        let arms = self.stations.iter().map(Station::observe).collect();
        self.timing.all += clock.elapsed();
        let clearance = self.clearance();
        let touch = clearance < 0.0;
        if touch && !self.touch {
            events.push(CellEvent::InstrumentsTouch { depth_mm: -1e3 * clearance });
        }
        self.touch = touch;
        Ok(CellReport { time: self.time(), arms, clearance, tissue, events })
    }

    /// The gap between the two instruments now [m]: negative where they are inside each other, for
    /// they do not push each other.
    pub fn clearance(&self) -> f64 {
        match &self.stations[..] {
            [one, other] => clearance::clearance(&one.rods(), &other.rods()),
            _ => f64::INFINITY,
        }
    }

    /// Unhooks instruments from what they pierced, hooked or crushed beyond what tissue bears, lets
    /// tissue feel them again when all is well, and puts right what does not come back by itself.
    /// `least` is the smallest share of its rest volume that an element has.
    fn look_after(&mut self, least: f64, events: &mut Vec<CellEvent>) {
        if least > SQUEEZED && !self.stations.iter().any(Station::meets_tissue) && self.waits.iter().all(|w| *w == 0) {
            return;
        }
        let strains = self.edges.strains(&self.world, least);
        self.waits.resize(strains.len(), 0);
        let calm = !strains.iter().any(|s| s.lasts());
        let mut relaxed = Vec::new();
        let mut unhook = |world: &mut World, station: &mut Station, organ: usize| {
            // What holds by a latch first keeps its hold and only presses no more.
            let bare = station.bare();
            if !bare {
                station.unhook(world, events);
            }
            let (arm, name) = (station.fixed.side, world.model.bodies()[organ].name().to_owned());
            let (stretch, volume) = (strains[organ].stretch, strains[organ].volume);
            events.push(match bare {
                true => CellEvent::Bared { arm, organ: name, stretch, volume },
                false => CellEvent::Unhooked { arm, organ: name, stretch, volume },
            });
        };
        for station in self.stations.iter_mut().filter(|s| s.meets_tissue()) {
            match (station.now.unhooked, station.pierces(&self.world)) {
                (false, Some(organ)) => unhook(&mut self.world, station, organ),
                (true, None) if calm => station.now.unhooked = false,
                _ => {}
            }
        }
        for (organ, strain) in strains.iter().enumerate() {
            let near = |s: &Station| s.distance(strain.at) < NEAR;
            // What an instrument left behind that has just let go is given time to come back.
            let left = self.stations.iter().any(|s| (s.now.unhooked || s.now.bare) && (near(s) || s.holds(organ)));
            let patient = left && self.waits[organ] < PATIENCE && strain.stretch < FAR_TOO_MUCH;
            let felt = self.stations.iter_mut().filter(|s| !s.now.unhooked && s.meets_tissue());
            let at = felt.filter(|s| near(s) || s.holds(organ));
            // What only presses gives way before what holds.
            let order = |s: &Station| (s.holds(organ), s.distance(strain.at));
            let nearest = at.map(|s| (order(s), s)).min_by(|a, b| a.0.0.cmp(&b.0.0).then(a.0.1.total_cmp(&b.0.1)));
            match nearest {
                Some(_) if patient && strain.is_too_much() => self.waits[organ] += 1,
                Some((_, station)) => {
                    self.waits[organ] = 0;
                    if strain.is_beyond(station.now.bare && station.holds(organ)) {
                        unhook(&mut self.world, station, organ);
                    }
                }
                None if strain.is_too_much() || strain.lasts() && self.waits[organ] >= PATIENCE => {
                    self.waits[organ] = 0;
                    self.world.state.relax(organ);
                    let name = self.world.model.bodies()[organ].name().to_owned();
                    relaxed.push(CellEvent::Relaxed { organ: name, stretch: strain.stretch, volume: strain.volume });
                }
                None if strain.lasts() => self.waits[organ] += 1,
                None => self.waits[organ] = 0,
            }
        }
        events.append(&mut relaxed);
    }

    /// The cutter of arm `k`, as wide as it is in `open`, has closed through `organ`.
    fn cut(&mut self, k: usize, organ: usize, open: &Gripper, events: &mut Vec<CellEvent>) -> Result<()> {
        let name = self.world.model.bodies()[organ].name().to_owned();
        let fixed = &self.stations[k].fixed;
        let arm = fixed.side;
        let mut count = 1;
        if self.sever {
            let cut = open.cut_along(organ, fixed.blades.length);
            let was: Vec<DVec3> = self.stations.iter().map(|s| s.held_now(&self.world)).collect();
            let pieces = self.world.sever(&cut)?;
            count = pieces.len().max(1);
            for (station, was) in self.stations.iter_mut().zip(was) {
                if station.now.held.as_ref().is_some_and(|h| h.organ == organ) && !pieces.is_empty() {
                    station.follow_cut(&self.world, &pieces, was);
                }
            }
        }
        events.push(CellEvent::Cut { arm, organ: name, pieces: count });
        Ok(())
    }

    /// What was observed of the arms at the end of the last period, the left one first.
    pub fn observe(&self) -> Vec<ArmObservation> {
        self.stations.iter().map(Station::observe).collect()
    }

    /// Simulated time [s].
    pub fn time(&self) -> f64 {
        self.periods as f64 / f64::from(self.control_hz)
    }

    /// Length of a control period [s].
    pub fn period(&self) -> f64 {
        1.0 / f64::from(self.control_hz)
    }

    /// The tissue, in the cell frame: privileged, no policy sees it.
    pub fn world(&self) -> &World {
        &self.world
    }

    /// Length of the most stretched edge of any organ now over that at rest: privileged, too. Takes
    /// a pass over all edges.
    pub fn max_stretch(&mut self) -> f64 {
        self.edges.strains(&self.world, 1.0).iter().fold(1.0, |most, s| s.stretch.max(most))
    }

    /// Wall time since the cell was built.
    pub fn timing(&self) -> Timing {
        self.timing
    }

    /// How far an arm's jaws and what they hold have gone since they closed on it; None while they
    /// hold nothing.
    pub(crate) fn moved(&self, k: usize) -> Option<Moved> {
        self.stations[k].moved(&self.world)
    }
}

/// Tissue frames a control period and physics steps a frame.
fn rates(scene: &Scene) -> Result<(u32, u32)> {
    let rates = scene.rates;
    let wrong = |field: &str, reason: String| Error::Scene { scene: scene.name.clone(), field: field.into(), reason };
    if rates.control_hz == 0 || !FRAMES_HZ.is_multiple_of(rates.control_hz) {
        let reason =
            format!("is {}; it must divide {FRAMES_HZ}, tissue's frames a second: 30, 20, 60", rates.control_hz);
        return Err(wrong("rates.control_hz", reason));
    }
    if rates.physics_hz == 0 || !rates.physics_hz.is_multiple_of(FRAMES_HZ) {
        let reason = format!("is {}; a multiple of {FRAMES_HZ}, tissue's frames a second: 480, 960", rates.physics_hz);
        return Err(wrong("rates.physics_hz", reason));
    }
    Ok((FRAMES_HZ / rates.control_hz, rates.physics_hz / FRAMES_HZ))
}
