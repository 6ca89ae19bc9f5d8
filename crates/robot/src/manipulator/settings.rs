//! Settings of the controller: the control law, its gains, and its model error.

use crate::error::within;
use crate::instrument::Limits;
use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use std::collections::BTreeMap;

/// A control law. All of them command joint torques and feed forward the model's torques for the
/// reference.
///
/// With the joint error e, and the model's mass matrix M and bias b (Coriolis, centrifugal,
/// gravity):
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Law {
    /// Constant stiffness and damping of each joint: M qdd_ref + b + K e + D e'. K and D follow
    /// from the bandwidth and the joint's diagonal inertia in the start posture.
    JointImpedance,
    /// Computed torque: M (qdd_ref + w^2 e + 2 z w e') + b (Siciliano et al. 2009, section 8.5.2).
    ComputedTorque,
    /// Computed torque with the integral of the error: M (... + w^2 w_i int e) + b.
    Integral,
    /// Computed torque with a disturbance observer: it adds the torque of the last steps beyond the
    /// model's, low-passed at w_o. For a constant M it is the momentum observer of De Luca and
    /// Mattone (2003).
    Observer,
    /// As [`Law::Observer`], with task errors: the tip's position, the shaft's distance from the
    /// port's centre (weighted by `port`) and the roll; the joint error in the null space. It
    /// halves the RCM deviation but is less robust: from 60 rad/s on it does not recover from 25 N.
    RcmImpedance,
}

impl Law {
    /// All laws.
    pub const ALL: [Self; 5] =
        [Self::JointImpedance, Self::ComputedTorque, Self::Integral, Self::Observer, Self::RcmImpedance];

    /// The name in scene files and reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::JointImpedance => "joint-impedance",
            Self::ComputedTorque => "computed-torque",
            Self::Integral => "computed-torque-integral",
            Self::Observer => "computed-torque-observer",
            Self::RcmImpedance => "rcm-impedance",
        }
    }

    /// Names of its gains.
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

/// Gains of a control law. A law ignores the gains that it does not have.
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
    /// Weight of the shaft's error in the port, relative to the tip's.
    pub port: f64,
}

/// The error of the controller's model: masses (the paper's gravity error) and friction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModelError {
    /// Share by which the model's links are too light.
    pub links: f64,
    /// Share by which the model's instrument is too light.
    pub instrument: f64,
    /// Coulomb friction in each joint of the actual arm (N m or N), instead of the arm's own, which
    /// `None` keeps. The model has none in either case.
    pub friction: Option<f64>,
}

impl Default for ModelError {
    fn default() -> Self {
        Self { links: 0.02, instrument: 0.05, friction: Some(0.2) }
    }
}

impl ModelError {
    /// An exact model, and joints without friction.
    pub const NONE: Self = Self { links: 0.0, instrument: 0.0, friction: Some(0.0) };
}

/// Settings of a manipulator's controller.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ControllerSettings {
    /// The control law.
    pub law: Law,
    /// The gains.
    pub gains: Gains,
    /// The error of its model.
    pub error: ModelError,
    /// Commands a second. The reference interpolates them by a spline.
    pub command_rate: f64,
    /// Maximum rate of a joint's torque (N m/s) or force (N/s).
    pub torque_rate: f64,
    /// Limits of the instrument's coordinates. `None`: those of the port for this instrument, with
    /// contact allowed, the jaw's pivot 20 mm inside and the shaft's base 20 mm outside.
    pub limits: Option<Limits>,
    /// Number of substeps of the arm's dynamics in a physics step.
    pub substeps: usize,
}

/// Maximum torque rate of an FR3 (N m/s), from Franka's control interface.
const FR3_TORQUE_RATE: f64 = 1000.0;

impl Default for ControllerSettings {
    /// The controller chosen by `trocar experiment controller-grid`.
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

impl ControllerSettings {
    /// The settings of a controller by its name in a scene file, `default` or a [`Law::name`], with
    /// other values of `gains`.
    ///
    /// # Errors
    /// An unknown name or gain, with the most similar one; a gain out of range.
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

    /// Checks the settings.
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
        format!("is unknown; the most similar is '{nearest}'; it must be one of {}", all.join(", ")),
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn named(name: &str, gains: &[(&str, f64)]) -> Result<ControllerSettings> {
        ControllerSettings::named(name, &gains.iter().map(|(n, v)| ((*n).to_owned(), *v)).collect())
    }

    #[test]
    fn controllers_and_gains_are_found_by_name() {
        assert_eq!(named("default", &[]).unwrap(), ControllerSettings::default());
        for law in Law::ALL {
            let gains: Vec<_> = law.gains().iter().map(|g| (*g, 3.0)).collect();
            let s = named(law.name(), &gains).unwrap();
            assert_eq!((s.law, s.gains.bandwidth, s.gains.damping), (law, 3.0, 3.0));
        }
    }

    #[test]
    fn unknown_names_are_refused_with_the_most_similar() {
        let said = |name: &str, gains: &[(&str, f64)]| named(name, gains).unwrap_err().to_string();
        assert!(said("computed_torque", &[]).contains("most similar is 'computed-torque'"));
        assert!(said("rcm", &[]).contains("most similar is 'rcm-impedance'"));
        assert!(said("computed-torque", &[("bandwith", 1.0)]).contains("most similar is 'bandwidth'"));
        assert!(said("computed-torque", &[("observer", 1.0)]).contains("unknown"), "gains without effect are refused");
        assert!(said("default", &[("bandwidth", f64::NAN)]).contains("bandwidth"));
        assert!(said("default", &[("damping", -1.0)]).contains("damping"));
    }
}
