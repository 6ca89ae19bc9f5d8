//! Whether the start poses of a scene are within what the ports and the tissue below them allow.

use super::build;
use super::placed::Placed;
use super::workspace::Workspace;
use crate::{Error, Result};
use trocar_scene::{Scene, Tool};
use trocar_specimen::{Organ, Specimen};

/// Checks that every arm of `scene` can start where the scene says, with `specimen` in its place.
///
/// # Errors
/// Names scene, arm and key, the limit with its unit, the organ that is in the way, and what would
/// be right.
pub fn check_starts(scene: &Scene, specimen: &Specimen) -> Result<()> {
    check(scene, &Placed::new(scene, specimen)?)
}

/// The same for a specimen that is placed.
pub(super) fn check(scene: &Scene, placed: &Placed) -> Result<()> {
    scene.tools().iter().try_for_each(|tool| check_tool(scene, tool, placed))
}

fn check_tool(scene: &Scene, tool: &Tool<'_>, placed: &Placed) -> Result<()> {
    let wanted = &tool.arm.start;
    let workspace = build::workspace_of(scene, tool, placed.floor)?;
    let Workspace::Port(space) = &workspace else { return Ok(()) };
    let (_, excess) = space.limits.clamp(&build::start(wanted, tool.port, &workspace).in_port());
    let wrong = |key: &str, reason: String| {
        let field = format!("arm '{}', start.{key}", tool.arm.name.name());
        Err(Error::Scene { scene: scene.label(), field, reason })
    };
    let (tilt, roll) = (space.limits.tilt.to_degrees(), space.limits.roll.map(f64::to_degrees));
    if excess.tilt != 0.0 {
        let reason = format!("is {}; it must be at most {tilt:.1} degrees, which the port allows", wanted.tilt_deg);
        return wrong("tilt_deg", reason);
    }
    if excess.insertion != 0.0 {
        let [least, most] = space.limits.insertion.map(|depth| 1e3 * (depth + space.blade_length));
        let by = 1e3 * excess.insertion;
        let own = space.instrument.reach() - build::MARGIN;
        let range = format!("it must be in [{least:.0}, {most:.0}] mm");
        let reason = match lowest(placed).filter(|_| by > 0.0 && space.limits.insertion[1] < own) {
            Some(organ) => {
                let height = 1e3 * placed.floor;
                let right = "place the specimen lower, or make the scene by `trocar scene new SPECIMEN`";
                let right = if most - least < 1.0 { right.to_owned() } else { format!("{range}, or {right}") };
                format!(
                    "is {} mm, {by:.0} mm beyond the cell's floor, which is the lowest tissue ({} at z = {height:.0} mm); \
                     {right}",
                    wanted.insertion_mm, organ.name
                )
            }
            None => format!("is {} mm; {range}, between the port and the end of the shaft", wanted.insertion_mm),
        };
        return wrong("insertion_mm", reason);
    }
    if excess.roll != 0.0 {
        let [least, most] = roll;
        return wrong("roll_deg", format!("is {}; it must be in [{least:.0}, {most:.0}] degrees", wanted.roll_deg));
    }
    if excess.jaw != 0.0 {
        return wrong("jaw", format!("is {}; it must be in [0, 1]", wanted.jaw));
    }
    Ok(())
}

/// The organ with the lowest node.
fn lowest(placed: &Placed) -> Option<&Organ> {
    let height = |o: &Organ| o.body.vertices.iter().map(|p| p.z).fold(f64::INFINITY, f64::min);
    placed.specimen.organs.iter().min_by(|a, b| height(a).total_cmp(&height(b)))
}
