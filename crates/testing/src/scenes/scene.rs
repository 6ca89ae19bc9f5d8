//! The scenes: which nodes are pinned, which are carried, and how.

use super::error::{Error, Result};
use super::organs::{Organ, Organs};
use glam::DVec3;
use std::f64::consts::TAU;
use trocar_cell::VISCOSITY_TIME;
use trocar_core::Pose;
use trocar_geometry::OrganAxis;
use trocar_tissue::{BodyDescription, ConstitutiveModel, Material, Model, ModelBuilder, pins};

/// Length of a frame [s].
pub const FRAME: f64 = 1.0 / 60.0;

/// Standard gravity [m/s2].
const GRAVITY: f64 = 9.80665;

/// Share of each organ's nodes, the lowest, that are pinned.
const PINNED: f64 = 0.42;

/// Radius of a patch around an organ's highest point [m].
const PATCH: f64 = 4e-3;

/// A patch is at the highest point of this share of an organ's nodes, the nearest to its middle.
const MIDDLE: f64 = 0.25;

/// Drag: speed [m/s] and how far before it turns back [m].
const DRAG: (f64, f64) = (10e-3, 10e-3);

/// Shake: amplitude [m] and frequency [Hz].
const SHAKE: (f64, f64) = (1e-3, 7.3);

/// Tube: length of the pinned end, half length of the lifted part [m], speed [m/s], time [s].
const TUBE_END: f64 = 10e-3;
const TUBE_GRIP: f64 = 5e-3;
const TUBE_LIFT: (f64, f64) = (30e-3, 1.0);

/// The names of the scenes with one moving organ, as experiments go through them.
pub const SCENES: [&str; 5] = ["sag", "drag", "shake", "tube", "fall"];

/// How a patch moves along z.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Motion {
    /// Up, and back down, again and again, at one speed.
    Drag {
        /// Speed [m/s].
        speed: f64,
        /// Height at which it turns back [m].
        reach: f64,
    },
    /// Up and down as a sine.
    Shake {
        /// Amplitude [m].
        amplitude: f64,
        /// Frequency [Hz].
        frequency: f64,
    },
    /// Up, and then held.
    Lift {
        /// Speed [m/s].
        speed: f64,
        /// How long [s].
        seconds: f64,
    },
}

impl Motion {
    /// Height over the beginning after `time` [s].
    pub fn height(&self, time: f64) -> f64 {
        match *self {
            Self::Drag { speed, reach } => {
                let way = (speed * time).rem_euclid(2.0 * reach);
                way.min(2.0 * reach - way)
            }
            Self::Shake { amplitude, frequency } => amplitude * (TAU * frequency * time).sin(),
            Self::Lift { speed, seconds } => speed * time.min(seconds),
        }
    }

    /// Pose of the tool after `time` [s].
    pub fn pose(&self, time: f64) -> Pose {
        Pose { translation: DVec3::Z * self.height(time), ..Pose::IDENTITY }
    }
}

/// Nodes of a body that a tool carries.
#[derive(Clone, Debug)]
pub struct Patch {
    /// The body.
    pub body: usize,
    /// Its nodes.
    pub nodes: Vec<u32>,
    /// The way.
    pub motion: Motion,
}

/// A model and what is done to it.
#[derive(Clone, Debug)]
pub struct Scene {
    /// Its name.
    pub name: &'static str,
    /// The model.
    pub model: Model,
    /// What is carried; the tool's number is the place in this list.
    pub patches: Vec<Patch>,
    /// The body that is looked at: the appendix.
    pub appendix: usize,
}

/// Stable neo-Hookean tissue of 1200 kg/m3, damped as in the cell.
pub fn material(young_modulus: f64, poisson_ratio: f64) -> Material {
    Material {
        model: ConstitutiveModel::StableNeoHookean,
        young_modulus,
        poisson_ratio,
        density: 1200.0,
        viscosity: VISCOSITY_TIME * young_modulus,
    }
}

impl Scene {
    /// The scene of this name, out of [`SCENES`].
    ///
    /// # Errors
    /// Another name; as the scenes.
    pub fn named(name: &str, organs: &Organs, material: Material) -> Result<Self> {
        match name {
            "sag" => Self::sag(organs, material),
            "drag" => Self::drag(organs, material),
            "shake" => Self::shake(organs, material),
            "tube" => Self::tube(organs, material),
            "fall" => Self::fall(organs, material),
            _ => Err(Error::Mismatch(format!("there is no scene '{name}'; there are {}", SCENES.join(", ")))),
        }
    }

    /// The organs under gravity, the lowest 42% of each one's nodes pinned.
    ///
    /// # Errors
    /// Organs or a material that cannot be simulated.
    pub fn sag(organs: &Organs, material: Material) -> Result<Self> {
        let banded = |o: &Organ| pins::lowest_band(&o.mesh.vertices, DVec3::Z, PINNED);
        Self::of("sag", &organs.organs, organs.appendix, material, banded)
    }

    /// As [`Self::sag`], with a patch of the appendix pulled up at 10 mm/s by 10 mm, back down, and again.
    ///
    /// # Errors
    /// As [`Self::sag`].
    pub fn drag(organs: &Organs, material: Material) -> Result<Self> {
        let (speed, reach) = DRAG;
        let mut scene = Self { name: "drag", ..Self::sag(organs, material)? };
        scene.patches = vec![scene.patch(scene.appendix, Motion::Drag { speed, reach })];
        Ok(scene)
    }

    /// As [`Self::sag`], with a patch of the appendix shaken up and down by 1 mm at 7.3 Hz.
    ///
    /// # Errors
    /// As [`Self::sag`].
    pub fn shake(organs: &Organs, material: Material) -> Result<Self> {
        let mut scene = Self { name: "shake", ..Self::sag(organs, material)? };
        scene.patches = vec![scene.patch(scene.appendix, Motion::SHAKE)];
        Ok(scene)
    }

    /// As [`Self::shake`], but a patch of every organ is shaken, so that none is ever at rest.
    ///
    /// # Errors
    /// As [`Self::sag`].
    pub fn moving(organs: &Organs, material: Material) -> Result<Self> {
        let mut scene = Self { name: "moving", ..Self::sag(organs, material)? };
        scene.patches = (0..scene.model.bodies().len()).map(|body| scene.patch(body, Motion::SHAKE)).collect();
        Ok(scene)
    }

    /// The appendix alone, pinned within 10 mm of one end only, its nodes within 5 mm of mid-length lifted at 30 mm/s for a second: the large,
    /// slow, global motion of a grasped appendix.
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
        let mut scene = Self::of("tube", std::slice::from_ref(organ), 0, material, |_| end.clone())?;
        let (speed, seconds) = TUBE_LIFT;
        scene.patches = vec![Patch { body: 0, nodes: grip, motion: Motion::Lift { speed, seconds } }];
        Ok(scene)
    }

    /// The appendix alone, free.
    ///
    /// # Errors
    /// As [`Self::sag`].
    pub fn fall(organs: &Organs, material: Material) -> Result<Self> {
        Self::of("fall", std::slice::from_ref(&organs.organs[organs.appendix]), 0, material, |_| Vec::new())
    }

    /// The appendix `count` times in one model, the lowest 42% of each one's nodes pinned, each one shaken.
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
        material: Material,
        pinned: impl Fn(&Organ) -> Vec<u32>,
    ) -> Result<Self> {
        let mut builder = ModelBuilder::new().gravity(DVec3::Z * -GRAVITY);
        for organ in organs {
            let name = organ.name.clone();
            let pinned = pinned(organ);
            builder.body(BodyDescription { name, mesh: &organ.mesh, material, pinned, supports: Vec::new() })?;
        }
        Ok(Self { name, model: builder.build()?, patches: Vec::new(), appendix })
    }

    /// Free nodes around the highest point near the middle of a body, none of them in an element with a pinned one; the highest free node where there are no such.
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
        let moving = Scene::moving(&organs, material).unwrap();
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
        let drag = Scene::drag(&organs, material).unwrap();
        assert_eq!((drag.patches[0].body, drag.model.bodies()[drag.appendix].name()), (organs.appendix, "appendix"));
        let tube = Scene::tube(&organs, material).unwrap();
        let pinned = tube.model.bodies()[0].pinned().iter().filter(|p| **p).count();
        let share = pinned as f64 / tube.model.bodies()[0].len() as f64;
        assert!((0.08..0.25).contains(&share), "10 mm of 85: {share}");
        assert!(tube.patches[0].nodes.len() > 3);
        assert!(!Scene::fall(&organs, material).unwrap().model.bodies()[0].pinned().contains(&true));
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
