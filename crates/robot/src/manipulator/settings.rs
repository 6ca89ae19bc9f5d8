//! What drives an arm: which controller, its gains, and what it believes wrongly.

use crate::error::within;
use crate::instrument::Limits;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A control law. All of them command joint torques, and all feed forward what their model says
/// that the reference takes.
///
/// With e the error of the joints behind the reference, M and b the believed mass matrix and bias
/// (Coriolis, centrifugal, gravity):
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Law {
    /// Constant stiffness and damping a joint: M qdd_ref + b + K e + D e'. K and D are those of the
    /// bandwidth for the joint's own inertia in the start posture.
    JointImpedance,
    /// Computed torque: M (qdd_ref + w^2 e + 2 z w e') + b (Siciliano et al. 2009, section 8.5.2).
    ComputedTorque,
    /// Computed torque with the integral of the error: M (... + w^2 w_i int e) + b.
    Integral,
    /// Computed torque less what a disturbance observer finds: what torque the last steps took
    /// beyond the model's, low-passed at w_o. For a constant M it is the momentum observer of De
    /// Luca and Mattone (2003).
    Observer,
    /// As [`Law::Observer`], with errors where they matter: the tip's place, the shaft's distance
    /// from the port's centre (weighed by `port`) and the roll, the elbow in what these leave free.
    /// It halves the RCM deviation and bears no knocks: from 60 rad/s on it does not come back from
    /// 25 N.
    RcmImpedance,
}

impl Law {
    /// All laws.
    pub const ALL: [Self; 5] =
        [Self::JointImpedance, Self::ComputedTorque, Self::Integral, Self::Observer, Self::RcmImpedance];

    /// Its name in scene files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::JointImpedance => "joint-impedance",
            Self::ComputedTorque => "computed-torque",
            Self::Integral => "computed-torque-integral",
            Self::Observer => "computed-torque-observer",
            Self::RcmImpedance => "rcm-impedance",
        }
    }

    /// Names of the gains that it has.
    pub fn gains(self) -> &'static [&'static str] {
        match self {
            Self::JointImpedance | Self::ComputedTorque => &["bandwidth", "damping"],
            Self::Integral => &["bandwidth", "damping", "integral"],
            Self::Observer => &["bandwidth", "damping", "observer"],
            Self::RcmImpedance => &["bandwidth", "damping", "observer", "port"],
        }
    }

    pub(super) fn observes(self) -> bool {
        matches!(self, Self::Observer | Self::RcmImpedance)
    }
}

/// Gains of a control law. Those that a law does not have do nothing.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Gains {
    /// Bandwidth w of the error (rad/s): the stiffness is w^2 times the inertia.
    pub bandwidth: f64,
    /// Damping ratio z.
    pub damping: f64,
    /// Bandwidth w_i of the integral action (rad/s).
    pub integral: f64,
    /// Bandwidth w_o of the disturbance observer (rad/s).
    pub observer: f64,
    /// How many times as stiff the shaft is held in the port as the tip in its place.
    pub port: f64,
}

/// What a controller believes wrongly (SPEC's gravity error).
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModelError {
    /// Share by which every link is believed lighter than it is.
    pub links: f64,
    /// Share by which the instrument is believed lighter than it is.
    pub instrument: f64,
    /// Coulomb friction in each joint of the arm, of which the controller knows nothing (N m or N).
    /// It takes the place of the arm's own. None: the arm's own stays, and is as unknown.
    pub friction: Option<f64>,
}

impl Default for ModelError {
    fn default() -> Self {
        Self { links: 0.02, instrument: 0.05, friction: Some(0.2) }
    }
}

impl ModelError {
    /// A controller that knows everything, and joints without friction.
    pub const NONE: Self = Self { links: 0.0, instrument: 0.0, friction: Some(0.0) };
}

/// How a manipulator is driven.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Settings {
    /// The control law.
    pub law: Law,
    /// Its gains.
    pub gains: Gains,
    /// What it believes wrongly.
    pub error: ModelError,
    /// Commands a second. The reference passes between them on a spline.
    pub command_rate: f64,
    /// Fastest change of a joint's torque (N m/s), or of a force (N/s).
    pub torque_rate: f64,
    /// Limits of the instrument's coordinates. None: the port's for this instrument, touching
    /// allowed, pivot and shaft's base 20 mm inside and outside.
    pub limits: Option<Limits>,
    /// Parts into which the arm's dynamics divide a physics step.
    pub substeps: usize,
}

/// Highest rate of torque of an FR3 (N m/s) (Franka's control interface).
const FR3_TORQUE_RATE: f64 = 1000.0;

impl Default for Settings {
    /// The controller that `trocar experiment controller-grid` chose.
    fn default() -> Self {
        let gains = Gains { bandwidth: 80.0, damping: 1.0, integral: 15.0, observer: 45.0, port: 2.0 };
        Self {
            law: Law::Observer,
            gains,
            error: ModelError::default(),
            command_rate: 30.0,
            torque_rate: FR3_TORQUE_RATE,
            limits: None,
            substeps: 1,
        }
    }
}

impl Settings {
    /// The settings of a controller by its name in a scene file, `default` or a [`Law::name`], with
    /// some gains set otherwise.
    ///
    /// # Errors
    /// A name or gain that the controller does not have, with the nearest that exists; a gain out
    /// of range.
    pub fn named(name: &str, gains: &BTreeMap<String, f64>) -> Result<Self> {
        let mut settings = Self::default();
        if name != "default" {
            let law = Law::ALL.into_iter().find(|law| law.name() == name);
            let names = std::iter::once("default").chain(Law::ALL.map(Law::name));
            settings.law = law.ok_or_else(|| unknown("controller", name, names))?;
        }
        let known = settings.law.gains();
        for (gain, &value) in gains {
            let g = &mut settings.gains;
            let place = match gain.as_str() {
                _ if !known.contains(&gain.as_str()) => {
                    let what = format!("gain of controller '{}'", settings.law.name());
                    return Err(unknown(&what, gain, known.iter().copied()));
                }
                "bandwidth" => &mut g.bandwidth,
                "damping" => &mut g.damping,
                "integral" => &mut g.integral,
                "observer" => &mut g.observer,
                _ => &mut g.port,
            };
            *place = value;
        }
        settings.check()?;
        Ok(settings)
    }

    /// Says whether the settings can be used.
    ///
    /// # Errors
    /// A gain, rate or share out of range.
    pub fn check(&self) -> Result<()> {
        let g = &self.gains;
        within("controller, gain 'bandwidth'", g.bandwidth, 0.1, 2000.0, "rad/s")?;
        within("controller, gain 'damping'", g.damping, 0.0, 10.0, "")?;
        within("controller, gain 'integral'", g.integral, 0.0, 1000.0, "rad/s")?;
        within("controller, gain 'observer'", g.observer, 0.0, 2000.0, "rad/s")?;
        within("controller, gain 'port'", g.port, 0.01, 100.0, "")?;
        within("gravity error, links", self.error.links, -0.5, 0.5, "")?;
        within("gravity error, instrument", self.error.instrument, -0.5, 0.5, "")?;
        within("gravity error, friction", self.error.friction.unwrap_or(0.0), 0.0, 20.0, "N m")?;
        within("controller, command_rate", self.command_rate, 1.0, 1000.0, "Hz")?;
        within("controller, torque_rate", self.torque_rate, 1.0, 1e9, "N m/s")?;
        within("controller, substeps", self.substeps as f64, 1.0, 64.0, "")?;
        self.limits.map_or(Ok(()), |l| l.check())
    }
}

fn unknown<'a>(what: &str, given: &str, names: impl Iterator<Item = &'a str> + Clone) -> Error {
    let shown: String = given.chars().take(60).flat_map(char::escape_default).collect();
    let near = |name: &&str| (1e6 * strsim::jaro_winkler(given, name)) as i64;
    let nearest = names.clone().max_by_key(near).unwrap_or_default();
    let all: Vec<&str> = names.collect();
    Error::invalid(
        format!("{what} '{shown}'"),
        format!("is unknown; '{nearest}' is nearest (there are {})", all.join(", ")),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(name: &str, gains: &[(&str, f64)]) -> Result<Settings> {
        Settings::named(name, &gains.iter().map(|(n, v)| ((*n).to_owned(), *v)).collect())
    }

    #[test]
    fn controllers_and_gains_go_by_name() {
        assert_eq!(named("default", &[]).unwrap(), Settings::default());
        for law in Law::ALL {
            let gains: Vec<_> = law.gains().iter().map(|g| (*g, 3.0)).collect();
            let s = named(law.name(), &gains).unwrap();
            assert_eq!((s.law, s.gains.bandwidth, s.gains.damping), (law, 3.0, 3.0));
        }
    }

    #[test]
    fn what_is_unknown_is_refused_with_the_nearest() {
        let said = |name: &str, gains: &[(&str, f64)]| named(name, gains).unwrap_err().to_string();
        assert!(said("computed_torque", &[]).contains("'computed-torque' is nearest"));
        assert!(said("rcm", &[]).contains("'rcm-impedance' is nearest"));
        assert!(said("computed-torque", &[("bandwith", 1.0)]).contains("'bandwidth' is nearest"));
        assert!(said("computed-torque", &[("observer", 1.0)]).contains("unknown"), "gains that would do nothing");
        assert!(said("default", &[("bandwidth", f64::NAN)]).contains("bandwidth"));
        assert!(said("default", &[("damping", -1.0)]).contains("damping"));
    }
}
