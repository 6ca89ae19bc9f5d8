//! Builds the arms of a cell from its scene.

use super::arm::{ArmModel, ArmState, ArmUnit};
use super::drive::Drive;
use super::setpoint::Setpoint;
use super::workspace::{FreeSpace, PortSpace, Workspace};
use crate::blades::{Blades, Tools};
use crate::{Error, GraspDesign, Jaw, Result, Scissors};
use glam::DVec3;
use trocar_robot::chain::{InverseOptions, Joints, MassProperties, SerialArm};
use trocar_robot::instrument::{Coordinates, Instrument, Jaw as JawDrive, Limits};
use trocar_robot::manipulator::{ControllerSettings, Manipulator, ModelError};
use trocar_robot::port::Port;
use trocar_scene::{
    ArmModel as Source, Drive as DriveKind, GraspDesignName, InstrumentKind, Scene, ScheduleName, Start, Tool,
};
use trocar_tissue::{Descent, SolverSettings, Start as SolverStart};

/// Clearance at the limit of the tilt (m).
const MIN_CLEARANCE: f64 = 2e-5;

/// Minimum depth of the jaw's pivot in the body, and minimum height of the shaft's base outside
/// (m).
pub(super) const MARGIN: f64 = 0.02;

/// The blades' tips stay this far above the lowest tissue (m).
const ABOVE_FLOOR: f64 = 0.001;

/// Radius and length of the cylinder over which an instrument's mass is distributed (m): about its
/// motor's housing. Only the moments of inertia depend on it, and they are small compared with the
/// arm's.
const HOUSING: [f64; 2] = [0.028, 0.09];

/// Time that a grasper's and a cutter's jaws take from open to closed (s).
const CLOSING: [f64; 2] = [0.3, 0.2];

/// Margin at the limits of the wrist (rad).
const ROLL_MARGIN: f64 = 0.2;

/// Tilt up to which all rolls must be reachable (rad): the task's.
const LEAN: f64 = 0.35;

/// Number of postures from which the start is searched.
const START_SEARCHES: usize = 24;
/// Steps of a path along which an arm is followed.
const WALK_STEPS: u32 = 24;

/// Length of the shaft that tissue can touch (m): more than enters the body.
const MAX_TOUCHED_SHAFT: f64 = 0.2;

/// The schedule of that name.
pub(super) fn schedule(name: ScheduleName) -> SolverSettings {
    match name {
        ScheduleName::Fast => SolverSettings::FAST,
        ScheduleName::Paper => SolverSettings::PAPER,
        ScheduleName::Adaptive => {
            SolverSettings::Descent(Descent { substeps: 8, iterations: 10, start: SolverStart::Adaptive })
        }
    }
}

/// The design of that name.
pub(super) fn design(name: GraspDesignName) -> GraspDesign {
    match name {
        GraspDesignName::Friction => GraspDesign::Friction,
        GraspDesignName::RestPose => GraspDesign::RestPose,
        GraspDesignName::LivePose => GraspDesign::LivePose,
        GraspDesignName::Compliant => GraspDesign::Compliant,
    }
}

/// The arms of a scene, the left one first, over tissue whose lowest node is at height `floor` (m).
/// Starts beyond a limit are put at it; [`start::check`](super::start::check) refuses them.
pub(super) fn arms(scene: &Scene, floor: f64) -> Result<Vec<ArmUnit>> {
    scene.tools().iter().enumerate().map(|(k, tool)| arm(scene, k, tool, floor)).collect()
}

fn arm(scene: &Scene, k: usize, tool: &Tool<'_>, floor: f64) -> Result<ArmUnit> {
    let (arm, held) = (tool.arm, tool.instrument);
    let closing = closing(held);
    let blades = blades(scene, held);
    let mut workspace = workspace(tool, closing, &blades, floor)?;
    let start = workspace.clamp(&start(&arm.start, tool.port, &workspace));
    let drive = match (&mut workspace, arm.drive) {
        (Workspace::Port(space), DriveKind::Dynamics) => dynamic(scene, arm, space, &start)?,
        _ => {
            let steps = scene.rates.physics_hz / scene.rates.control_hz;
            Drive::ideal(workspace.clone(), start, steps)
        }
    };
    let gates = &scene.task.gates;
    let scissors = Scissors::new(gates.cut_open * blades.max_angle, gates.cut_closed * blades.max_angle);
    let jaw = Jaw::sized(held.jaw_force_n, blades.max_angle, closing);
    let model = ArmModel {
        side: arm.name,
        kind: held.kind,
        workspace,
        tools: Tools::of(k),
        blades,
        parts: blades.colliders(Tools::of(k)),
        force_limit: if scene.safety.rules.force_guard { scene.safety.force_limit_n } else { f64::INFINITY },
        stop_force: scene.safety.force_limit_n,
        puncture_force: scene.safety.puncture_force_n,
        rcm_limits: [1e-3 * scene.safety.rcm_threshold_mm, 1e-3 * scene.safety.rcm_abort_mm],
        tear_force: scene.tissue.tear_force_n,
        period: 1.0 / f64::from(scene.rates.control_hz),
        design: design(scene.task.grasp),
    };
    let first_design = design(scene.task.first_grasp.unwrap_or(scene.task.grasp));
    let state = ArmState::new(drive.tip(), &model, start, first_design, jaw, scissors);
    Ok(ArmUnit { model, drive, state })
}

/// The time that the instrument's jaws take from open to closed (s).
fn closing(held: &trocar_scene::Instrument) -> f64 {
    CLOSING[usize::from(held.kind == InstrumentKind::Cutter)]
}

fn blades(scene: &Scene, held: &trocar_scene::Instrument) -> Blades {
    Blades {
        length: 1e-3 * held.blade_length_mm,
        ridges: if held.kind == InstrumentKind::Cutter { 1 } else { 3 },
        max_angle: held.jaw_max_angle_deg.to_radians(),
        shaft_radius: 0.5e-3 * held.shaft_diameter_mm,
        shaft_length: (1e-3 * held.shaft_length_mm).min(MAX_TOUCHED_SHAFT),
        rest_offset: 1e-3 * scene.tissue.tip_rest_offset_mm,
        friction: scene.tissue.friction,
    }
}

/// The workspace of a tool over tissue whose lowest node is at height `floor` (m).
pub(super) fn workspace_of(scene: &Scene, tool: &Tool<'_>, floor: f64) -> Result<Workspace> {
    workspace(tool, closing(tool.instrument), &blades(scene, tool.instrument), floor)
}

/// The workspace of the instrument: its port, or a box around its start.
fn workspace(tool: &Tool<'_>, closing: f64, blades: &Blades, floor: f64) -> Result<Workspace> {
    let Some(port) = tool.port else {
        let start = DVec3::from(tool.arm.start.position_m.unwrap_or_default());
        let direction = tool.arm.direction.map_or(-DVec3::Z, DVec3::from);
        return Ok(Workspace::Free(FreeSpace::around(start, direction)));
    };
    let hole = hole(port)?;
    let instrument = described(tool.instrument, closing);
    instrument.check()?;
    let floor = floor + ABOVE_FLOOR;
    let limits = limits(&hole, &instrument, blades, floor)?;
    let blade_length = blades.length;
    Ok(Workspace::Port(Box::new(PortSpace { port: hole, instrument, limits, floor, blade_length })))
}

/// The controlled arm of a scene. Narrows the rolls of `space` to those that it reaches.
fn dynamic(scene: &Scene, arm: &trocar_scene::Arm, space: &mut PortSpace, start: &Setpoint) -> Result<Drive> {
    let start = start.in_port();
    let chain = chain(scene, arm)?;
    space.limits.roll = roll_of(&chain, &space.port, &space.instrument, &space.limits, &start)?;
    let mut settings = ControllerSettings::named(&arm.controller.name, &arm.controller.gains)?;
    let error = scene.gravity_error;
    settings.error = ModelError {
        links: error.link_mass_share,
        instrument: error.instrument_mass_share,
        friction: Some(error.joint_friction_nm),
    };
    settings.command_rate = f64::from(scene.rates.control_hz);
    settings.limits = Some(space.limits);
    let manipulator = Manipulator::new(chain, space.instrument.clone(), space.port, settings, start)?;
    Ok(Drive::Dynamic(Box::new(manipulator)))
}

/// The scene's port for the arm: normal into the body.
fn hole(port: &trocar_scene::Port) -> Result<Port> {
    let frame = port.frame();
    let mut hole = Port::new(frame.translation, -(frame.rotation * DVec3::Z), frame.rotation * DVec3::X)?;
    hole.hole_diameter = 1e-3 * port.hole_diameter_mm;
    hole.thickness = 1e-3 * port.sheet_thickness_mm;
    hole.check()?;
    Ok(hole)
}

fn described(held: &trocar_scene::Instrument, closing: f64) -> Instrument {
    let max_angle = held.jaw_max_angle_deg.to_radians();
    let [radius, length] = HOUSING;
    let centre = 1e-3 * DVec3::from(held.centre_of_mass_mm);
    Instrument {
        name: held.name.clone(),
        shaft_radius: 0.5e-3 * held.shaft_diameter_mm,
        shaft_length: 1e-3 * held.shaft_length_mm,
        mount: held.mount.pose(),
        pivot_offset: 0.0,
        jaw: JawDrive { max_angle, blade_length: 1e-3 * held.blade_length_mm, speed: max_angle / closing },
        mass: MassProperties::tube(held.mass_kg, radius, 0.0, length, centre),
    }
}

/// The limits of the port, and of the floor at the largest tilt.
fn limits(port: &Port, instrument: &Instrument, blades: &Blades, floor: f64) -> Result<Limits> {
    let mut limits = port.limits(instrument, MIN_CLEARANCE, MARGIN)?;
    let down = port.normal().dot(-DVec3::Z);
    if down > 0.1 {
        let room = (port.centre().z - floor) / (down * libm::cos(limits.tilt)) - blades.length;
        limits.insertion[1] = limits.insertion[1].min(room.max(limits.insertion[0]));
    }
    Ok(limits)
}

/// The numbers of a start pose.
pub(super) fn start(start: &Start, port: Option<&trocar_scene::Port>, workspace: &Workspace) -> Setpoint {
    let roll = start.roll_deg.to_radians();
    let roll = roll - std::f64::consts::TAU * (roll / std::f64::consts::TAU).round();
    match workspace {
        Workspace::Port(space) => {
            let direction = port.map_or(-DVec3::Z, |port| start.direction(port));
            let u = space.port.pose.rotation.inverse() * direction;
            // The pivots rotate the port's z about x, then about the rotated y.
            let pivots = [libm::atan2(-u.y, u.z), libm::atan2(u.x, libm::hypot(u.y, u.z))];
            let insertion = 1e-3 * start.insertion_mm - space.blade_length;
            Coordinates { pivots, insertion, roll, jaw: start.jaw }.into()
        }
        Workspace::Free(_) => {
            let [x, y, z] = start.position_m.unwrap_or_default();
            Setpoint([x, y, z, roll, start.jaw])
        }
    }
}

/// The range of roll (rad) that an arm reaches from its start within its joint limits, at any tilt
/// of the shaft up to [`LEAN`]: the wrist's range less the part that the tilt uses. Tilts that the
/// arm cannot reach even at the start's roll are left out: commands there are held back.
fn roll_of(
    arm: &SerialArm,
    port: &Port,
    instrument: &Instrument,
    limits: &Limits,
    start: &Coordinates,
) -> Result<[f64; 2]> {
    let options = InverseOptions { tolerance: [1e-6, 1e-5], posture_tolerance: 1e-2, ..InverseOptions::default() };
    let first = InverseOptions { restarts: START_SEARCHES, ..options };
    let posture = arm.inverse(&port.flange(instrument, start), &arm.home(), &first)?;
    let mut range = limits.roll;
    // Steps towards `to`, each from the posture before it. Returns the last posture and the share
    // of the way.
    let walk = |from: &Coordinates, q: &Joints, to: &Coordinates| -> Result<(Joints, f64)> {
        let (mut q, mut share) = (*q, 0.0);
        for step in 1..=WALK_STEPS {
            let s = f64::from(step) / f64::from(WALK_STEPS);
            let mix = |a: f64, b: f64| a + s * (b - a);
            let at = Coordinates {
                pivots: [mix(from.pivots[0], to.pivots[0]), mix(from.pivots[1], to.pivots[1])],
                insertion: mix(from.insertion, to.insertion),
                roll: mix(from.roll, to.roll),
                jaw: 0.0,
            };
            let found = arm.inverse(&port.flange(instrument, &at), &q, &options)?;
            if !found.reached || !found.at_limit.is_empty() {
                break;
            }
            (q, share) = (found.q, s);
        }
        Ok((q, share))
    };
    let lean = LEAN.min(0.9 * limits.tilt);
    let [shallow, deep] = limits.insertion;
    let insertions = [start.insertion, deep.min(shallow.max(0.5 * (start.insertion + deep)))];
    for pivots in [start.pivots, [lean, 0.0], [-lean, 0.0], [0.0, lean], [0.0, -lean]] {
        for insertion in insertions {
            let there = Coordinates { pivots, insertion, ..*start };
            let (q, share) = walk(start, &posture.q, &there)?;
            if share < 1.0 {
                continue;
            }
            for (k, end) in limits.roll.into_iter().enumerate() {
                let (_, share) = walk(&there, &q, &Coordinates { roll: end, ..there })?;
                let reached = start.roll + share * (end - start.roll);
                range[k] = if k == 0 { range[0].max(reached) } else { range[1].min(reached) };
            }
        }
    }
    // A limit of the wrist, not of the port: the arm's reference may choose another elbow than this
    // search.
    let ends =
        [0, 1].map(|k| if range[k] == limits.roll[k] { range[k] } else { range[k] - ROLL_MARGIN.copysign(range[k]) });
    Ok([ends[0].min(start.roll), ends[1].max(start.roll)])
}

fn chain(scene: &Scene, arm: &trocar_scene::Arm) -> Result<SerialArm> {
    let flange = arm.flange.as_deref();
    let model = match arm.source() {
        Some(Source::Urdf(file)) => SerialArm::from_urdf(&scene.resolve(file), None, flange)?,
        Some(Source::Mjcf(file)) => {
            let tip = flange.ok_or_else(|| Error::Scene {
                scene: scene.label(),
                field: format!("arm '{}', flange", arm.name.name()),
                reason: "is missing; an MJCF file needs it: the body or site that carries the instrument".to_owned(),
            })?;
            SerialArm::from_mjcf(&scene.resolve(file), tip)?
        }
        Some(Source::FrankaFr3) | None => SerialArm::franka_fr3()?,
    };
    let posture: Vec<f64> = arm.posture_deg.iter().map(|d| d.to_radians()).collect();
    let model = if posture.is_empty() { model } else { model.with_home(&posture)? };
    Ok(model.with_base(arm.base.unwrap_or_default().pose())?)
}
