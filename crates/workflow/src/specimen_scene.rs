//! Scenes for specimens: the specimen with ideal arms, or in the paper's cell.

use crate::{Error, Result};
use glam::{DQuat, DVec3};
use std::path::Path;
use trocar_cell::{ToolReach, check_starts, tool_reach};
use trocar_core::Pose;
use trocar_scene::{
    Arm, CellCamera, Frame, Gates, Instrument, InstrumentKind, Lens, Safety, SafetyRules, Scene, Side, SpecimenSource,
    Task, TaskName, Variation, View,
};
use trocar_specimen::Specimen;

/// Height at which the lowest tissue lies in the cell (m), as in the paper's cell.
const BED_HEIGHT: f64 = 0.02;

/// Maximum height of the organ's middle in the cell (m). Thick specimens are lowered to it.
const MAX_MIDDLE_HEIGHT: f64 = 0.055;

/// Number of tried turns about the vertical.
const TURNS: i32 = 24;

/// Place of the organ's middle in the cell, x and y (m): below the midpoint of the ports.
const MIDDLE: [f64; 2] = [0.0, 0.46];

/// Distance of a free instrument from the highest tissue at the start (m).
const START_ABOVE: f64 = 0.04;
/// Distance of a free cutter from the grasper at the start (m).
const CUTTER_BESIDE: f64 = 0.06;

/// Force limit of a free instrument (N): that of a strong hand.
const FREE_FORCE_LIMIT_N: f64 = 40.0;

/// The organ of a task on `specimen`: the one of this name, or by default the appendix or the first
/// organ.
///
/// # Errors
/// An organ that the specimen does not have; names those that it has.
pub fn task_organ<'a>(specimen: &'a Specimen, name: Option<&'a str>) -> Result<&'a str> {
    let names: Vec<&str> = specimen.organs.iter().map(|o| o.name.as_str()).collect();
    match name {
        Some(name) if names.contains(&name) => Ok(name),
        Some(name) => {
            let known = names.join(", ");
            Err(Error::Mismatch(format!("no organ '{name}' in the specimen; it has {known}")))
        }
        None => names
            .iter()
            .find(|n| **n == "appendix")
            .or(names.first())
            .copied()
            .ok_or_else(|| Error::Mismatch("the specimen has no organ".to_owned())),
    }
}

/// A scene of the specimen in `folder` and one or two ideal arms without ports: a grasper, and a
/// cutter if `sever`. Its task is a grasp-lift of `organ`.
///
/// # Errors
/// A specimen without that organ.
pub fn free_scene(specimen: &Specimen, folder: &Path, organ: &str, sever: bool) -> Result<Scene> {
    let placement = placed(specimen, organ, 0.0)?;
    let points = || specimen.organs.iter().flat_map(|o| &o.body.vertices).map(|p| placement.transform(*p));
    let top = points().map(|p| p.z).fold(f64::NEG_INFINITY, f64::max);
    let start = [MIDDLE[0], MIDDLE[1], top + START_ABOVE];
    let mut scene = Scene::new("specimen", source(folder));
    scene.description = format!("{} alone, with instruments that move freely", specimen.name);
    scene.placement = Frame::of(&placement);
    scene.ports = Vec::new();
    scene.arms = vec![Arm::free(Side::Left, "grasper", start)];
    scene.instruments = vec![Instrument::of(InstrumentKind::Grasper)];
    if sever {
        let beside = [start[0] + CUTTER_BESIDE, start[1], start[2]];
        scene.arms.push(Arm::free(Side::Right, "cutter", beside));
        scene.instruments.push(Instrument::of(InstrumentKind::Cutter));
    }
    scene.cameras = cameras(specimen, &placement, organ);
    // A study of the tissue alone: what it bears is seen, not cut short.
    let rules = SafetyRules { force_guard: true, strain_guard: false };
    scene.safety = Safety { force_limit_n: FREE_FORCE_LIMIT_N, rules, ..Safety::default() };
    scene.task = grasp_lift(organ);
    scene.task.sever = sever;
    Ok(scene)
}

/// The paper's cell with the specimen in `folder`, and the reach of its tools. The specimen is
/// placed within reach of both tools: the middle of `organ` is below the midpoint of the ports, and
/// the turn about the vertical is the one with the smallest miss of the tools.
///
/// # Errors
/// A specimen without that organ.
pub fn cell_scene(specimen: &Specimen, folder: &Path, organ: &str, name: &str) -> Result<(Scene, Vec<ToolReach>)> {
    let mut scene = Scene::new(name, source(folder));
    scene.description = format!("The paper's two-arm cell around {}", specimen.name);
    organ.clone_into(&mut scene.task.organ);
    scene.variation = Variation::starts();
    if specimen.camera.is_none() {
        scene.cameras.retain(|c| !matches!(c.lens, Lens::Recording {}));
    }
    let missed = |reach: &[ToolReach]| reach.iter().map(|r| r.missed_mm).fold(0.0, f64::max);
    let mut best: Option<(Scene, Vec<ToolReach>)> = None;
    for k in 0..TURNS {
        // Small turns come first: of equally good ones, the smallest is used.
        let turn = if k % 2 == 0 { k / 2 } else { -(k + 1) / 2 };
        let turn = std::f64::consts::TAU * f64::from(turn) / f64::from(TURNS);
        scene.placement = rounded(Frame::of(&placed(specimen, organ, turn)?));
        let reach = tool_reach(&scene, specimen)?;
        if best.as_ref().is_none_or(|(_, b)| missed(&reach) < missed(b) - 0.1) {
            best = Some((scene.clone(), reach));
        }
        if best.as_ref().is_some_and(|(_, reach)| missed(reach) < 0.1) {
            break;
        }
    }
    let (scene, reach) = best.ok_or_else(|| Error::Mismatch("the specimen cannot be placed".to_owned()))?;
    check_starts(&scene, specimen)?;
    Ok((scene, reach))
}

/// A grasp-lift of `organ` at any place along it, until its policy has finished.
pub fn grasp_lift(organ: &str) -> Task {
    Task {
        name: TaskName::GraspLift,
        organ: organ.to_owned(),
        episode_s: 60.0,
        stop_when_passed: false,
        gates: Gates { grasp_from: 0.0, grasp_to: 1.0, lift_s: 0.0, ..Gates::default() },
        ..Task::default()
    }
}

/// The pose of the specimen with the middle of `organ` below the midpoint of the ports, the lowest
/// tissue on the bed, and a turn of `turn` (rad) about the vertical.
fn placed(specimen: &Specimen, organ: &str, turn: f64) -> Result<Pose> {
    let name = task_organ(specimen, Some(organ))?;
    let upright = DQuat::from_rotation_arc(specimen.up.normalize(), DVec3::Z);
    let rotation = (DQuat::from_rotation_z(turn) * upright).normalize();
    let turned = |p: &DVec3| rotation * *p;
    let body = specimen.organs.iter().filter(|o| o.name == name).flat_map(|o| &o.body.vertices);
    let (sum, count) = body.fold((DVec3::ZERO, 0.0), |(sum, n), p| (sum + turned(p), n + 1.0));
    let middle = sum / f64::max(count, 1.0);
    let all = specimen.organs.iter().flat_map(|o| &o.body.vertices);
    let lowest = all.map(|p| turned(p).z).fold(f64::INFINITY, f64::min);
    let bed = BED_HEIGHT.min(MAX_MIDDLE_HEIGHT - (middle.z - lowest));
    let translation = DVec3::new(MIDDLE[0] - middle.x, MIDDLE[1] - middle.y, bed - lowest);
    Ok(Pose { rotation, translation })
}

/// The frame with nine decimals, for people to read and edit.
fn rounded(frame: Frame) -> Frame {
    // Adding zero makes a negative zero positive.
    let round = |x: f64| (x * 1e9).round() / 1e9 + 0.0;
    Frame { position_m: frame.position_m.map(round), rotation_wxyz: frame.rotation_wxyz.map(round) }
}

pub(crate) fn source(folder: &Path) -> SpecimenSource {
    let folder = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    SpecimenSource::folder(&folder.display().to_string())
}

/// Two cameras: one close to the organ, and one that sees the whole specimen. They are on the side
/// of the room from which its lamp shines (`trocar_sensors`).
fn cameras(specimen: &Specimen, placement: &Pose, organ: &str) -> Vec<CellCamera> {
    let bounds = |of: &dyn Fn(&str) -> bool| {
        let points = specimen.organs.iter().filter(|o| of(&o.name)).flat_map(|o| &o.body.vertices);
        let points = points.map(|p| placement.transform(*p));
        points.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(p), high.max(p)))
    };
    let look = |name: &str, (low, high): (DVec3, DVec3), near: f64| {
        let (middle, size) = (0.5 * (low + high), (high - low).length().max(0.04));
        let target = middle + 0.1 * size * DVec3::Z;
        let eye = target + near * size * DVec3::new(0.35, 0.75, 0.55);
        CellCamera {
            name: name.to_owned(),
            view: View::LookAt { eye_m: eye.to_array(), target_m: target.to_array(), up: [0.0, 0.0, 1.0] },
            lens: Lens::FieldOfView { width_deg: 58.0, height_deg: 34.6 },
            size_px: [1280, 720],
            policy_size_px: [224, 224],
            oblique_deg: 0.0,
            depth: false,
        }
    };
    vec![look("close-up", bounds(&|name| name == organ), 1.3), look("overview", bounds(&|_| true), 1.2)]
}
