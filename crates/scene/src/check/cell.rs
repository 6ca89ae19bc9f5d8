//! Checks of arms, ports and instruments: ranges, references, and whether they fit together.

use super::unit::{hint, show};
use super::{Checked, join, name, names, number, numbers, one_of, point, problem, quaternion, unit};
use crate::cell::SIMPLE;
use crate::{Arm, ArmModel, Drive, Factor, Frame, Instrument, Port, Scene, Start};
use glam::DVec3;

/// Height of the FR3's shoulder above its base (m).
const FR3_SHOULDER: f64 = 0.333;
/// Reach of the FR3's flange from its shoulder (m), from Franka's data sheet.
const FR3_REACH: f64 = 0.855;

/// Limits of the FR3's joints (rad), from Franka's data sheet.
const FR3_LIMITS: [(f64, f64); 7] = [
    (-2.7437, 2.7437),
    (-1.7837, 1.7837),
    (-2.9007, 2.9007),
    (-3.0421, -0.1518),
    (-2.8065, 2.8065),
    (0.5445, 4.5169),
    (-3.0159, 3.0159),
];

/// Minimum distance of bases (m): the width of the FR3's base.
const BASE_WIDTH: f64 = 0.2;

/// Minimum tilt other than 0 (degrees). A smaller one is most likely in radians.
const MIN_TILT: f64 = 1.0;

/// Maximum number of joints of an arm.
const MAX_JOINTS: usize = 16;

pub(super) fn check(scene: &Scene) -> Checked {
    rates(scene)?;
    names("port", scene.ports.iter().map(|p| p.name.as_str()))?;
    names("instrument", scene.instruments.iter().map(|i| i.name.as_str()))?;
    for (i, p) in scene.ports.iter().enumerate() {
        port(&format!("port[{i}]"), p)?;
    }
    for (i, one) in scene.instruments.iter().enumerate() {
        instrument(&format!("instrument[{i}]"), one)?;
    }
    let g = &scene.gravity_error;
    numbers(
        "gravity_error",
        &[
            ("link_mass_share", g.link_mass_share, -0.5..=0.5),
            ("instrument_mass_share", g.instrument_mass_share, -0.5..=0.5),
            ("joint_friction_nm", g.joint_friction_nm, 0.0..=20.0),
        ],
    )?;
    if !(1..=2).contains(&scene.arms.len()) {
        return Err(problem("arm", format!(" has {} entries; it must have one or two", scene.arms.len())));
    }
    names("arm", scene.arms.iter().map(|a| a.name.name()))?;
    for (i, one) in scene.arms.iter().enumerate() {
        arm(&format!("arm[{i}]"), one, scene)?;
    }
    apart(scene)
}

fn rates(scene: &Scene) -> Checked {
    let rates = scene.rates;
    let (control, physics) = (f64::from(rates.control_hz), f64::from(rates.physics_hz));
    numbers(
        "rates",
        &[
            ("control_hz", control, 1.0..=1000.0),
            ("physics_hz", physics, 1.0..=100_000.0),
            ("control_delay_ms", rates.control_delay_ms, Factor::ControlDelay.range()),
        ],
    )?;
    if rates.physics_hz.is_multiple_of(rates.control_hz) {
        return Ok(());
    }
    let below = (rates.physics_hz / rates.control_hz).max(1) * rates.control_hz;
    let reason = format!(
        " is {}, which is no multiple of control_hz ({}); it must be a multiple, such as {below}",
        rates.physics_hz, rates.control_hz
    );
    Err(problem("rates.physics_hz", reason))
}

fn port(at: &str, p: &Port) -> Checked {
    point(&join(at, "centre_m"), p.centre_m)?;
    unit(&join(at, "normal"), &p.normal, "a unit vector")?;
    numbers(
        at,
        &[
            ("hole_diameter_mm", p.hole_diameter_mm, 1.0..=50.0),
            ("sheet_thickness_mm", p.sheet_thickness_mm, 0.0..=50.0),
            ("sheet_diameter_mm", p.sheet_diameter_mm, 0.0..=400.0),
        ],
    )
}

fn instrument(at: &str, one: &Instrument) -> Checked {
    numbers(
        at,
        &[
            ("shaft_diameter_mm", one.shaft_diameter_mm, 0.5..=50.0),
            ("shaft_length_mm", one.shaft_length_mm, 20.0..=1000.0),
            ("blade_length_mm", one.blade_length_mm, 2.0..=100.0),
            ("mass_kg", one.mass_kg, 0.005..=10.0),
            ("jaw_max_angle_deg", one.jaw_max_angle_deg, 5.0..=120.0),
            ("jaw_force_n", one.jaw_force_n, 0.01..=40.0),
        ],
    )?;
    for (k, v) in one.centre_of_mass_mm.iter().enumerate() {
        number(&format!("{at}.centre_of_mass_mm[{k}]"), *v, &(-1000.0..=1000.0))?;
    }
    frame(&join(at, "mount"), &one.mount)
}

fn frame(at: &str, frame: &Frame) -> Checked {
    point(&join(at, "position_m"), frame.position_m)?;
    quaternion(&join(at, "rotation_wxyz"), frame.rotation_wxyz)
}

fn arm(at: &str, one: &Arm, scene: &Scene) -> Checked {
    model(at, one, scene)?;
    shapes(&join(at, "shapes"), one, scene)?;
    if let Some(base) = &one.base {
        frame(&join(at, "base"), base)?;
    }
    if one.drive == Drive::Dynamics && one.base.is_none() {
        let reason = " is missing; it must be the pose of the arm's base in the cell, unless drive = \"ideal\"";
        return Err(problem(join(at, "base"), reason.to_owned()));
    }
    posture(&join(at, "posture_deg"), one)?;
    name(&join(at, "controller.name"), &one.controller.name)?;
    for (gain, value) in &one.controller.gains {
        let field = format!("{at}.controller.gains.{gain}");
        name(&format!("{at}.controller.gains"), gain)?;
        // Gains have the units of their controller, so they have no common range.
        if !(0.0..=1e12).contains(value) {
            return Err(problem(field, format!(" is {}; it must be at least 0 and finite", show(*value))));
        }
    }
    if let Some(port) = &one.port {
        let ports: Vec<&str> = scene.ports.iter().map(|p| p.name.as_str()).collect();
        one_of(&join(at, "port"), port, "the ports are", &ports)?;
    } else if one.drive == Drive::Dynamics {
        let reason = " is missing; it must be the name of a port, unless drive = \"ideal\"";
        return Err(problem(join(at, "port"), reason.to_owned()));
    }
    let held: Vec<&str> = scene.instruments.iter().map(|i| i.name.as_str()).collect();
    one_of(&join(at, "instrument"), &one.instrument, "the instruments are", &held)?;
    let Some(instrument) = scene.instrument(&one.instrument) else { return Ok(()) };
    match one.port.as_deref().and_then(|port| scene.port(port)) {
        Some(port) => fits(at, one, port, instrument, scene.variation.most(Factor::Tilt)),
        None => free(at, one),
    }
}

fn model(at: &str, one: &Arm, scene: &Scene) -> Checked {
    let field = join(at, "model");
    let shown: String = one.model.chars().take(200).flat_map(char::escape_default).collect();
    match one.source() {
        None => Err(problem(
            field,
            format!(" is '{shown}'; it must be franka_fr3 or a file that ends in .urdf, .xml or .mjcf"),
        )),
        Some(ArmModel::Urdf(file) | ArmModel::Mjcf(file)) if !scene.resolve(file).is_file() => {
            let path = scene.resolve(file).display().to_string().replace(['\n', '\r'], " ");
            Err(problem(field, format!(" is {path}, which is no file; it must be a path from the scene file's folder")))
        }
        _ => Ok(()),
    }
}

/// Checks the shapes of an arm: the word for simple ones, or an existing file.
fn shapes(field: &str, one: &Arm, scene: &Scene) -> Checked {
    let Some(said) = one.shapes.as_deref().filter(|said| *said != SIMPLE) else { return Ok(()) };
    let shown: String = said.chars().take(200).flat_map(char::escape_default).collect();
    let end = said.to_ascii_lowercase();
    if ![".urdf", ".xml", ".mjcf"].iter().any(|e| end.ends_with(e)) {
        return Err(problem(
            field,
            format!(" is '{shown}'; it must be simple or a file that ends in .urdf, .xml or .mjcf"),
        ));
    }
    if scene.resolve(said).is_file() {
        return Ok(());
    }
    let path = scene.resolve(said).display().to_string().replace(['\n', '\r'], " ");
    Err(problem(field, format!(" is {path}, which is no file; it must be a path from the scene file's folder")))
}

fn posture(field: &str, one: &Arm) -> Checked {
    let given = &one.posture_deg;
    if given.is_empty() {
        return Ok(());
    }
    let fr3 = one.source() == Some(ArmModel::FrankaFr3);
    if fr3 && given.len() != FR3_LIMITS.len() || given.len() > MAX_JOINTS {
        let right =
            if fr3 { "it must have 7 for an FR3".to_owned() } else { format!("it must have at most {MAX_JOINTS}") };
        return Err(problem(field, format!(" has {} angles; {right}", given.len())));
    }
    for (k, angle) in given.iter().enumerate() {
        let (low, high) = if fr3 { FR3_LIMITS[k] } else { (-2.0 * std::f64::consts::PI, 2.0 * std::f64::consts::PI) };
        number(&format!("{field}[{k}]"), *angle, &(low.to_degrees()..=high.to_degrees()))?;
    }
    Ok(())
}

/// Checks an arm without a port, which has a direction and a start.
fn free(at: &str, one: &Arm) -> Checked {
    if let Some(direction) = &one.direction {
        unit(&join(at, "direction"), direction, "a unit vector")?;
    }
    let at = join(at, "start");
    let Some(position) = one.start.position_m else {
        let reason = " is missing; it must be the start of the jaw's pivot in the cell, because the arm has no port";
        return Err(problem(join(&at, "position_m"), reason.to_owned()));
    };
    point(&join(&at, "position_m"), position)?;
    numbers(&at, &[("roll_deg", one.start.roll_deg, -180.0..=180.0), ("jaw", one.start.jaw, 0.0..=1.0)])
}

/// Checks that the instrument fits through the port, that its tilt is possible in the hole, and
/// that the arm reaches the port.
fn fits(at: &str, one: &Arm, port: &Port, instrument: &Instrument, varies_deg: f64) -> Checked {
    let (shaft, hole) = (instrument.shaft_diameter_mm, port.hole_diameter_mm);
    let Some(limit) = port.tilt_limit(shaft) else {
        let reason = format!(
            " is '{}', whose shaft of {} mm does not go through the hole of {} mm of port '{}'; choose a thinner shaft or a larger hole",
            instrument.name,
            show(shaft),
            show(hole),
            port.name
        );
        return Err(problem(join(at, "instrument"), reason));
    };
    let at = join(at, "start");
    for (key, given) in [("direction", one.direction.is_some()), ("start.position_m", one.start.position_m.is_some())] {
        if given {
            let reason = format!(" is only for arms without a port; this arm has port '{}'", port.name);
            return Err(problem(join(at.trim_end_matches(".start"), key), reason));
        }
    }
    start(&at, &one.start, limit.to_degrees(), varies_deg, instrument)?;
    let Some(base) = one.base.filter(|_| one.drive == Drive::Dynamics) else { return Ok(()) };
    if one.source() != Some(ArmModel::FrankaFr3) {
        return Ok(());
    }
    // The flange is at the other end of the instrument. A mount moves it by at most the mount's
    // length.
    let flange = one.start.tip(port) - instrument.length() * one.start.direction(port);
    let shoulder = base.pose().transform(FR3_SHOULDER * DVec3::Z);
    let far = flange.distance(shoulder) - DVec3::from(instrument.mount.position_m).length();
    if far > FR3_REACH {
        let reason = format!(
            " is '{}', which is out of reach: the flange would start {} m from the shoulder; it must be at most {FR3_REACH} m",
            port.name,
            show((far * 1e3).round() / 1e3)
        );
        return Err(problem(join(at.trim_end_matches(".start"), "port"), reason));
    }
    Ok(())
}

fn start(at: &str, start: &Start, limit_deg: f64, varies_deg: f64, instrument: &Instrument) -> Checked {
    let max = limit_deg - varies_deg;
    let tilt = start.tilt_deg;
    if tilt != 0.0 && !(MIN_TILT..=max).contains(&tilt) {
        let tenths = |degrees: f64| show((degrees * 10.0).floor() / 10.0);
        let variation =
            if varies_deg > 0.0 { format!(", and the variation is {}", show(varies_deg)) } else { String::new() };
        let reason = format!(
            " is {}; it must be 0 or in [{MIN_TILT}, {}] degrees: the shaft touches the hole at {}{variation}{}",
            show(tilt),
            tenths(max),
            tenths(limit_deg),
            hint("degrees", tilt, &(MIN_TILT..=max))
        );
        return Err(problem(join(at, "tilt_deg"), reason));
    }
    numbers(
        at,
        &[
            ("azimuth_deg", start.azimuth_deg, -360.0..=360.0),
            ("roll_deg", start.roll_deg, -360.0..=360.0),
            ("insertion_mm", start.insertion_mm, instrument.blade_length_mm..=1e3 * instrument.length()),
            ("jaw", start.jaw, 0.0..=1.0),
        ],
    )
}

/// Checks that no two arms share a place, a port or an instrument, and that holes do not overlap.
///
/// Where ports or bases are drawn, the least distance that they may have counts.
fn apart(scene: &Scene) -> Checked {
    // Both may move along x and y, towards each other.
    let moved_mm = |factor| 2.0 * std::f64::consts::SQRT_2 * scene.variation.reach(factor);
    let drawn = |mm: f64| {
        if mm > 0.0 { format!(", and the variation takes up to {} mm of it", show(mm)) } else { String::new() }
    };
    let ports_mm = moved_mm(Factor::PortShift);
    for (i, port) in scene.ports.iter().enumerate() {
        for (k, other) in scene.ports[..i].iter().enumerate() {
            let far = 1e3 * DVec3::from(port.centre_m).distance(other.centre_m.into());
            if far - ports_mm < 0.5 * (port.hole_diameter_mm + other.hole_diameter_mm) {
                let (far, drawn) = (show(far), drawn(ports_mm));
                let reason = format!(" is {far} mm from that of port[{k}]{drawn}; holes must not overlap");
                return Err(problem(format!("port[{i}].centre_m"), reason));
            }
        }
    }
    let [one, other] = scene.arms.as_slice() else { return Ok(()) };
    if let (Some(one), Some(other)) = (&one.base, &other.base) {
        let far = DVec3::from(one.position_m).distance(other.position_m.into());
        let bases_mm = moved_mm(Factor::BaseShift);
        if far - 1e-3 * bases_mm < BASE_WIDTH {
            let (far, drawn) = (show(far), drawn(bases_mm));
            let reason = format!(" is {far} m from that of arm[0]{drawn}; it must be at least {BASE_WIDTH} m");
            return Err(problem("arm[1].base.position_m", reason));
        }
    }
    let names = |arm: &Arm| [("port", arm.port.clone()), ("instrument", Some(arm.instrument.clone()))];
    for ((key, first), (_, second)) in names(one).into_iter().zip(names(other)) {
        let (Some(first), Some(second)) = (first, second) else { continue };
        if first == second {
            return Err(problem(
                format!("arm[1].{key}"),
                format!(" is '{second}', which arm[0] already has; each arm needs its own"),
            ));
        }
    }
    Ok(())
}
