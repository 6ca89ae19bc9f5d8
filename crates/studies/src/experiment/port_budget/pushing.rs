//! A shaft pushed sideways through the contact model of a port.

use super::result::{PortBudgetRow, SHEETS};
use crate::Result;
use glam::{DVec2, DVec3};
use std::f64::consts::{FRAC_PI_2, PI};
use trocar_robot::instrument::Instrument;
use trocar_robot::port::{Port, RimState, Shaft, Twist};

/// Number of directions over half a turn; the other half is symmetric.
pub(super) const DIRECTIONS: usize = 90;

/// Maximum push, as a share of the hole's diameter.
const MAX_PUSH: f64 = 1.0;

/// Steps of a bisection: to full precision.
const BISECTIONS: usize = 60;

/// A port and the shaft in it.
pub(super) struct Pushing {
    pub port: Port,
    pub radius: f64,
}

impl Pushing {
    /// A port with a hole of diameter `hole` (m) in a sheet of `thickness` (m), and a shaft of
    /// diameter `shaft` (m).
    pub fn new(hole: f64, shaft: f64, thickness: f64) -> Result<Self> {
        let port = Port { hole_diameter: hole, thickness, ..Port::new(DVec3::ZERO, DVec3::Z, DVec3::X)? };
        port.check()?;
        let radius = 0.5 * shaft;
        Instrument { shaft_radius: radius, ..Instrument::grasper() }.check()?;
        if shaft >= hole {
            let reason = format!("{} mm must be thinner than the hole of {} mm", 1e3 * shaft, 1e3 * hole);
            return Err(trocar_robot::Error::Invalid { what: "shaft".into(), reason }.into());
        }
        Ok(Self { port, radius })
    }

    /// A shaft tilted towards x; its axis crosses the plane of the port at `at`.
    fn shaft(&self, tilt: f64, at: DVec2) -> Shaft {
        let direction = DVec3::new(tilt.sin(), 0.0, tilt.cos());
        Shaft { base: at.extend(0.0) - 0.2 * direction, direction, radius: self.radius, length: 0.33 }
    }

    /// Force of the rim on a shaft at rest at `at`, in the plane of the port (N), and whether it
    /// touches.
    fn rim(&self, tilt: f64, at: DVec2) -> (DVec2, bool) {
        let shaft = self.shaft(tilt, at);
        let contacts = self.port.contacts(&shaft, &Twist::default(), &RimState::default());
        (contacts.on_shaft(shaft.base).0.truncate(), contacts.touching().next().is_some())
    }

    /// Largest push from the centre without contact (m), in a direction given from that of the tilt
    /// (rad); none if the centred shaft touches. Bisection is exact because the free region is
    /// convex.
    pub fn clearance(&self, tilt: f64, direction: f64) -> Option<f64> {
        let along = DVec2::from_angle(direction);
        let touches = |d: f64| self.rim(tilt, d * along).1;
        (!touches(0.0)).then(|| bisect(0.0, MAX_PUSH * self.port.hole_diameter, touches))
    }

    /// Deviation under a lateral force of `force` (N) in the direction of the tilt (m).
    fn pushed(&self, tilt: f64, force: f64) -> f64 {
        bisect(0.0, MAX_PUSH * self.port.hole_diameter, |d| -self.rim(tilt, d * DVec2::X).0.x >= force)
    }

    /// Tilt at which a centred shaft touches (rad).
    pub fn limit(&self) -> Option<f64> {
        let touches = |tilt: f64| self.rim(tilt, DVec2::ZERO).1;
        (!touches(0.0)).then(|| bisect(0.0, 85_f64.to_radians(), touches))
    }

    pub fn row(&self, tilt_deg: f64, push: f64) -> PortBudgetRow {
        let tilt = tilt_deg.to_radians();
        let clearance = |direction: f64| self.clearance(tilt, direction).map(|r| 1e3 * r);
        let all = (0..=DIRECTIONS).filter_map(|k| clearance(PI * k as f64 / DIRECTIONS as f64));
        let thicker = |mm: f64| 1e3 * Port { thickness: 1e-3 * mm, ..self.port }.clearance(self.radius, tilt);
        PortBudgetRow {
            tilt_deg,
            clearance_mm: 1e3 * self.port.clearance(self.radius, tilt),
            measured_mm: clearance(0.0),
            measured_against_mm: clearance(PI),
            measured_across_mm: clearance(FRAC_PI_2),
            measured_least_mm: all.reduce(f64::min),
            pushed_mm: 1e3 * self.pushed(tilt, push),
            thicker_mm: SHEETS.map(thicker),
        }
    }
}

/// The largest value in [low, high] before `holds`, by bisection.
fn bisect(mut low: f64, mut high: f64, holds: impl Fn(f64) -> bool) -> f64 {
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (low + high);
        if holds(middle) { high = middle } else { low = middle }
    }
    low
}
