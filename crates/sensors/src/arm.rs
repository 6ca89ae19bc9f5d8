//! Shapes of an arm's links: from its description file, from the published dimensions of the FR3,
//! or as rods between the joints for any other arm.

use crate::solid::{Part, Solid};
use crate::{Error, Result, visuals};
use glam::DVec3;
use trocar_core::Pose;
use trocar_geometry::TriMesh;
use trocar_scene::{Arm, Scene};

/// Cell size of the links' surfaces (m).
const SPACING: f64 = 0.0045;

const SHELL: [u8; 3] = [208, 210, 210];
const JOINT: [u8; 3] = [86, 92, 99];

/// Radius of the rods of an unknown arm (m).
const ROD: f64 = 0.045;

fn v(x: f64, y: f64, z: f64) -> DVec3 {
    DVec3::new(x, y, z)
}

fn can(from: DVec3, to: DVec3, radius: f64) -> Part {
    Part::Cylinder { from, to, radius, edge: 0.012 }
}

fn cone(from: DVec3, to: DVec3, a: f64, b: f64) -> Part {
    Part::Cone { from, to, radii: [a, b] }
}

/// Shapes of the base and the seven links of a Franka FR3, each in its own frame. Housings and
/// their radii follow the coarse collision bodies of `franka_description` (`robots/common`,
/// cylinders of 60, 50 and 40 mm radius). The shapes between the housings are invented.
fn fr3() -> Vec<TriMesh> {
    let blend = 0.03;
    let shell = || Solid::new(blend);
    let links = [
        shell()
            .with(SHELL, can(v(0.0, 0.0, 0.0), v(0.0, 0.0, 0.135), 0.072))
            .with(SHELL, Part::Block { centre: v(-0.06, 0.0, 0.035), half: v(0.095, 0.085, 0.035), edge: 0.02 })
            .with(SHELL, Part::Block { centre: v(-0.10, 0.0, 0.055), half: v(0.05, 0.055, 0.05), edge: 0.02 }),
        shell()
            .with(JOINT, can(v(0.0, 0.0, -0.20), v(0.0, 0.0, -0.18), 0.061))
            .with(SHELL, can(v(0.0, 0.0, -0.182), v(0.0, 0.0, -0.08), 0.062))
            .with(SHELL, cone(v(0.0, 0.0, -0.10), v(0.0, -0.045, 0.0), 0.058, 0.054))
            .with(SHELL, can(v(0.0, -0.100, 0.0), v(0.0, -0.004, 0.0), 0.061)),
        shell()
            .with(JOINT, can(v(0.0, 0.0, -0.004), v(0.0, 0.0, 0.016), 0.0595))
            .with(SHELL, can(v(0.0, 0.0, 0.012), v(0.0, 0.0, 0.100), 0.061))
            .with(SHELL, cone(v(0.0, -0.02, 0.05), v(0.0, -0.115, 0.0), 0.054, 0.055)),
        shell()
            .with(JOINT, can(v(0.0, 0.0, -0.20), v(0.0, 0.0, -0.18), 0.056))
            .with(SHELL, can(v(0.0, 0.0, -0.184), v(0.0, 0.0, -0.09), 0.058))
            .with(SHELL, cone(v(0.0, 0.0, -0.10), v(0.0825, 0.040, 0.0), 0.056, 0.052))
            .with(SHELL, can(v(0.0825, 0.004, 0.0), v(0.0825, 0.095, 0.0), 0.060)),
        shell()
            .with(JOINT, can(v(0.0, 0.0, -0.004), v(0.0, 0.0, 0.016), 0.0585))
            .with(SHELL, can(v(0.0, 0.0, 0.012), v(0.0, 0.0, 0.095), 0.060))
            .with(SHELL, cone(v(0.0, 0.0, 0.045), v(-0.0825, 0.10, 0.0), 0.052, 0.055)),
        shell()
            .with(JOINT, can(v(0.0, 0.0, -0.30), v(0.0, 0.0, -0.275), 0.056))
            .with(SHELL, can(v(0.0, 0.0, -0.279), v(0.0, 0.0, -0.205), 0.058))
            .with(SHELL, cone(v(0.0, 0.012, -0.22), v(0.0, 0.062, -0.05), 0.053, 0.036))
            .with(SHELL, can(v(0.0, 0.010, 0.0), v(0.0, 0.090, 0.0), 0.050)),
        shell()
            .with(JOINT, can(v(0.0, 0.0, -0.012), v(0.0, 0.0, 0.008), 0.0485))
            .with(SHELL, can(v(0.0, 0.0, 0.004), v(0.0, 0.0, 0.075), 0.050))
            .with(SHELL, cone(v(0.02, 0.0, 0.035), v(0.088, 0.0, 0.0), 0.044, 0.042))
            .with(SHELL, can(v(0.088, 0.045, 0.0), v(0.088, -0.045, 0.0), 0.046)),
        shell()
            .with(JOINT, can(v(0.0, 0.0, 0.040), v(0.0, 0.0, 0.062), 0.0445))
            .with(SHELL, can(v(0.0, 0.0, 0.058), v(0.0, 0.0, 0.096), 0.045))
            .with(JOINT, can(v(0.0, 0.0, 0.070), v(0.0, 0.0, 0.108), 0.032)),
    ];
    links.iter().map(|link| link.surface(SPACING)).collect()
}

/// Shapes of an arm's base and links, each in its own frame: one per entry of `poses` (base, links,
/// flange) except the flange. The mesh of an invisible link is empty.
pub(crate) fn links(scene: &Scene, arm: &Arm, model: &str, poses: &[Pose]) -> Result<Vec<TriMesh>> {
    let Some(said) = arm.drawn() else { return Ok(simple(model, poses)) };
    let file = scene.resolve(said);
    let links = visuals::links(arm.name.name(), &file, arm.flange.as_deref())?;
    if arm.shapes.is_none() && links.iter().all(|link| link.triangles.is_empty()) {
        // The description contains no visuals.
        return Ok(simple(model, poses));
    }
    if links.len() + 1 == poses.len() {
        return Ok(links);
    }
    let (found, has) = (links.len().saturating_sub(1), poses.len().saturating_sub(2));
    let reason = format!("{} has shapes for {found} links; the arm has {has} moving links", file.display());
    Err(Error::Shapes { arm: arm.name.name().to_owned(), reason })
}

/// Shapes of an arm without a description.
fn simple(model: &str, poses: &[Pose]) -> Vec<TriMesh> {
    if model == "fr3" && poses.len() == 9 {
        return fr3();
    }
    let own = |pair: &[Pose]| {
        let to = pair[0].inverse().transform(pair[1].translation);
        let rod = Solid::new(0.02)
            .with(JOINT, cone(DVec3::ZERO, v(0.0, 0.0, 1e-6), 1.15 * ROD, 1.15 * ROD))
            .with(SHELL, cone(DVec3::ZERO, to, ROD, ROD));
        rod.surface(SPACING)
    };
    poses.windows(2).map(own).collect()
}
