//! The scenes: which nodes are pinned, which are carried, and how.

use super::organs::{Organ, Organs};
use crate::{Error, Result};
use glam::DVec3;
use std::f64::consts::TAU;
use trocar_cell::VISCOSITY_TIME;
use trocar_core::Pose;
use trocar_geometry::OrganAxis;
use trocar_tissue::{Backend, BodyDescription, ConstitutiveModel, Material, Model, ModelBuilder, pins};

/// Length of a frame (s).
pub const FRAME: f64 = 1.0 / 60.0;

/// Standard gravity (m/s²).
pub(crate) const GRAVITY: f64 = 9.80665;

/// Share of pinned nodes of each organ: the lowest ones.
const PINNED: f64 = 0.42;

/// Radius of a patch around an organ's highest point (m).
const PATCH: f64 = 4e-3;

/// A patch is at the highest point among this share of an organ's nodes nearest to its middle.
const MIDDLE: f64 = 0.25;

/// Drag: speed (m/s) and distance to the turning point (m).
const DRAG: (f64, f64) = (10e-3, 10e-3);

/// Shake: amplitude (m) and frequency (Hz).
const SHAKE: (f64, f64) = (1e-3, 7.3);

/// Tube: length of the pinned end (m).
const TUBE_END: f64 = 10e-3;
/// Tube: half length of the lifted part (m).
const TUBE_GRIP: f64 = 5e-3;
/// Tube: speed (m/s) and duration (s) of the lift.
const TUBE_LIFT: (f64, f64) = (30e-3, 1.0);

/// Names of the scenes with one moving organ, in the order of experiments.
pub const SCENES: [&str; 5] = ["sag", "drag", "shake", "tube", "fall"];

/// Motion of a patch along z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// Up and down repeatedly at constant speed.
    Drag {
        /// Speed (m/s).
        speed: f64,
        /// Height of the turning point (m).
        reach: f64,
    },
    /// Up and down as a sine.
    Shake {
        /// Amplitude (m).
        amplitude: f64,
        /// Frequency (Hz).
        frequency: f64,
    },
    /// Up, and then still.
    Lift {
        /// Speed (m/s).
        speed: f64,
        /// Duration (s).
        seconds: f64,
    },
}

impl Motion {
    /// Height above the start after `time` (s).
    pub fn height(&self, time: f64) -> f64 {
        match *self {
            Self::Drag { speed, reach } => {
                let distance = (speed * time).rem_euclid(2.0 * reach);
                distance.min(2.0 * reach - distance)
            }
            Self::Shake { amplitude, frequency } => amplitude * (TAU * frequency * time).sin(),
            Self::Lift { speed, seconds } => speed * time.min(seconds),
        }
    }

    /// Pose of the tool after `time` (s).
    pub fn pose(&self, time: f64) -> Pose {
        Pose { translation: DVec3::Z * self.height(time), ..Pose::IDENTITY }
    }
}

/// Nodes of a body that move with a tool.
#[derive(Clone, Debug)]
pub struct Patch {
    /// The body.
    pub body: usize,
    /// Its nodes.
    pub nodes: Vec<u32>,
    /// The motion.
    pub motion: Motion,
}

/// A model with moving patches.
#[derive(Clone, Debug)]
pub struct BenchScene {
    /// Its name.
    pub name: &'static str,
    /// The model.
    pub model: Model,
    /// The moving patches; the index is that of the tool.
    pub patches: Vec<Patch>,
    /// Index of the appendix, which is measured.
    pub appendix: usize,
}

/// Stable neo-Hookean tissue of 1200 kg/m³ with the viscosity of the cell.
pub fn material(young_modulus: f64, poisson_ratio: f64) -> Material {
    Material {
        model: ConstitutiveModel::StableNeoHookean,
        young_modulus,
        poisson_ratio,
        density: 1200.0,
        viscosity: VISCOSITY_TIME * young_modulus,
    }
}

impl BenchScene {
    /// The scene of this name, one of [`SCENES`].
    ///
    /// # Errors
    /// An unknown name; the errors of the scenes.
    pub fn named(name: &str, organs: &Organs, material: Material) -> Result<Self> {
        match name {
            "sag" => Self::sag(organs, material),
            "drag" => Self::drag(organs, material),
            "shake" => Self::shake(organs, material),
            "tube" => Self::tube(organs, material),
            "fall" => Self::fall(organs, material),
            _ => Err(Error::Mismatch(format!("there is no scene '{name}'; it must be one of {}", SCENES.join(", ")))),
        }
    }

    /// The organs under gravity, the lowest 42% of each one's nodes pinned.
    ///
    /// # Errors
    /// Organs or a material that cannot be simulated.
    pub fn sag(organs: &Organs, material: Material) -> Result<Self> {
        let banded = |o: &Organ| pins::lowest_band(&o.mesh.vertices, DVec3::Z, PINNED);
        Self::of("sag", &organs.organs, organs.appendix, (material, Backend::Tetrahedra), banded)
    }

    /// As [`Self::sag`], with a patch of the appendix that moves up and down by 10 mm at 10 mm/s.
    ///
    /// # Errors
    /// As [`Self::sag`].
    pub fn drag(organs: &Organs, material: Material) -> Result<Self> {
        Self::drag_on(organs, material, Backend::Tetrahedra)
    }

    /// As [`Self::drag`], on a backend.
    ///
    /// # Errors
    /// As [`Self::sag`].
    pub fn drag_on(organs: &Organs, material: Material, backend: Backend) -> Result<Self> {
        let (speed, reach) = DRAG;
        let banded = |o: &Organ| pins::lowest_band(&o.mesh.vertices, DVec3::Z, PINNED);
        let mut scene = Self::of("drag", &organs.organs, organs.appendix, (material, backend), banded)?;
        scene.patches = vec![scene.patch(scene.appendix, Motion::Drag { speed, reach })];
        Ok(scene)
    }

    /// As [`Self::sag`], with a patch of the appendix that oscillates by 1 mm at 7.3 Hz.
    ///
    /// # Errors
    /// As [`Self::sag`].
    pub fn shake(organs: &Organs, material: Material) -> Result<Self> {
        let mut scene = Self { name: "shake", ..Self::sag(organs, material)? };
        scene.patches = vec![scene.patch(scene.appendix, Motion::SHAKE)];
        Ok(scene)
    }

    /// As [`Self::shake`], with an oscillating patch on every organ, so that none is at rest.
    ///
    /// # Errors
    /// As [`Self::sag`].
    pub fn moving(organs: &Organs, material: Material) -> Result<Self> {
        let mut scene = Self { name: "moving", ..Self::sag(organs, material)? };
        scene.patches = (0..scene.model.bodies().len()).map(|body| scene.patch(body, Motion::SHAKE)).collect();
        Ok(scene)
    }

    /// Only the appendix, pinned within 10 mm of one end. Its nodes within 5 mm of mid-length are
    /// lifted at 30 mm/s for a second, which is the large and slow motion of a grasped appendix.
    ///
    /// # Errors
    /// As [`Self::sag`]; an appendix whose axis cannot be found or that is too short.
    pub fn tube(organs: &Organs, material: Material) -> Result<Self> {
        let organ = &organs.organs[organs.appendix];
        let first = organ.mesh.vertices.iter().copied().min_by(|a, b| a.x.total_cmp(&b.x)).unwrap_or_default();
        let axis = OrganAxis::of(&organ.mesh, first)?;
        let chosen = |near: &dyn Fn(f64) -> bool| -> Vec<u32> {
            (0..axis.s.len() as u32).filter(|i| near(axis.s[*i as usize] * axis.length)).collect()
        };
        let end = chosen(&|along| along <= TUBE_END);
        let grip = chosen(&|along| (along - 0.5 * axis.length).abs() <= TUBE_GRIP);
        if end.is_empty() || grip.is_empty() || 0.5 * axis.length <= TUBE_END + TUBE_GRIP {
            return Err(Error::Mismatch(format!(
                "'{}' is {:.1} mm long with {} nodes at its end and {} at its middle; a tube must be over 30 mm and finely meshed",
                organ.name,
                1e3 * axis.length,
                end.len(),
                grip.len()
            )));
        }
        let on = (material, Backend::Tetrahedra);
        let mut scene = Self::of("tube", std::slice::from_ref(organ), 0, on, |_| end.clone())?;
        let (speed, seconds) = TUBE_LIFT;
        scene.patches = vec![Patch { body: 0, nodes: grip, motion: Motion::Lift { speed, seconds } }];
        Ok(scene)
    }

    /// Only the appendix, without pins.
    ///
    /// # Errors
    /// As [`Self::sag`].
    pub fn fall(organs: &Organs, material: Material) -> Result<Self> {
        let organ = std::slice::from_ref(&organs.organs[organs.appendix]);
        Self::of("fall", organ, 0, (material, Backend::Tetrahedra), |_| Vec::new())
    }

    /// The appendix `count` times in one model. Each has its lowest 42% of nodes pinned and
    /// oscillates.
    ///
    /// # Errors
    /// As [`Self::sag`].
    pub fn many(organs: &Organs, count: usize, material: Material) -> Result<Self> {
        let all = vec![organs.organs[organs.appendix].clone(); count];
        let organs = Organs { organs: all, appendix: 0, source: organs.source.clone() };
        Ok(Self { name: "many", ..Self::moving(&organs, material)? })
    }

    fn of(
        name: &'static str,
        organs: &[Organ],
        appendix: usize,
        (material, backend): (Material, Backend),
        pinned: impl Fn(&Organ) -> Vec<u32>,
    ) -> Result<Self> {
        let mut builder = ModelBuilder::new().gravity(DVec3::Z * -GRAVITY).backend(backend);
        for organ in organs {
            let name = organ.name.clone();
            let pinned = pinned(organ);
            builder.body(BodyDescription { name, mesh: &organ.mesh, material, pinned, supports: Vec::new() })?;
        }
        Ok(Self { name, model: builder.build()?, patches: Vec::new(), appendix })
    }

    /// Free nodes around the highest point near the middle of a body, without nodes of elements
    /// that have pinned nodes. If there are none, the highest free node.
    fn patch(&self, body: usize, motion: Motion) -> Patch {
        let b = &self.model.bodies()[body];
        let (nodes, pinned) = (b.rest_positions(), b.pinned());
        let mut beside_pins = pinned.to_vec();
        for tet in b.tets().iter().filter(|t| t.iter().any(|i| pinned[*i as usize])) {
            tet.iter().for_each(|i| beside_pins[*i as usize] = true);
        }
        let middle = nodes.iter().sum::<DVec3>() / nodes.len() as f64;
        let off = |i: usize| (nodes[i] - middle).truncate().length();
        let mut order: Vec<usize> = (0..nodes.len()).collect();
        order.sort_by(|a, b| off(*a).total_cmp(&off(*b)));
        order.truncate((MIDDLE * nodes.len() as f64).ceil() as usize);
        let highest = |all: &mut dyn Iterator<Item = usize>| all.max_by(|a, b| nodes[*a].z.total_cmp(&nodes[*b].z));
        let Some(top) = highest(&mut order.into_iter()) else { return Patch { body, nodes: Vec::new(), motion } };
        let within = |i: &usize| !beside_pins[*i] && nodes[*i].distance(nodes[top]) <= PATCH;
        let mut chosen: Vec<u32> = (0..nodes.len()).filter(within).map(|i| i as u32).collect();
        if chosen.is_empty() {
            chosen = highest(&mut (0..nodes.len()).filter(|i| !pinned[*i])).map(|i| i as u32).into_iter().collect();
        }
        Patch { body, nodes: chosen, motion }
    }
}

impl Motion {
    const SHAKE: Self = Self::Shake { amplitude: SHAKE.0, frequency: SHAKE.1 };
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn scenes_hold_what_they_say() {
        let organs = Organs::analytic(6_000).unwrap();
        let material = material(12e3, 0.45);
        let moving = BenchScene::moving(&organs, material).unwrap();
        assert_eq!(moving.patches.len(), 6);
        for (patch, body) in moving.patches.iter().zip(moving.model.bodies()) {
            let share = body.pinned().iter().filter(|p| **p).count() as f64 / body.len() as f64;
            assert!((share - 0.42).abs() < 0.01, "{}: {share}", body.name());
            assert!(
                !patch.nodes.is_empty() && patch.nodes.iter().all(|i| !body.pinned()[*i as usize]),
                "{}",
                body.name()
            );
        }
        let drag = BenchScene::drag(&organs, material).unwrap();
        assert_eq!((drag.patches[0].body, drag.model.bodies()[drag.appendix].name()), (organs.appendix, "appendix"));
        let tube = BenchScene::tube(&organs, material).unwrap();
        let pinned = tube.model.bodies()[0].pinned().iter().filter(|p| **p).count();
        let share = pinned as f64 / tube.model.bodies()[0].len() as f64;
        assert!((0.08..0.25).contains(&share), "10 mm of 85: {share}");
        assert!(tube.patches[0].nodes.len() > 3);
        assert!(!BenchScene::fall(&organs, material).unwrap().model.bodies()[0].pinned().contains(&true));
    }

    #[test]
    fn motions_keep_their_speed_and_reach() {
        let drag = Motion::Drag { speed: 0.01, reach: 0.01 };
        assert!((drag.height(0.7) - 7e-3).abs() < 1e-12 && (drag.height(1.7) - 3e-3).abs() < 1e-12);
        assert!(
            (0..400)
                .all(|k| (drag.height(0.01 * f64::from(k + 1)) - drag.height(0.01 * f64::from(k))).abs() < 1.001e-4)
        );
        let lift = Motion::Lift { speed: 0.03, seconds: 1.0 };
        assert!((lift.height(0.5) - 0.015).abs() < 1e-12 && lift.height(3.0) == lift.height(1.0));
    }
}
