//! Messages of clients (docs/guides/view-wire.md), checked.

use serde::Deserialize;
use serde_json::{Value, json};

/// Greatest size of a client's message (bytes).
pub(crate) const MAX_MESSAGE: usize = 65_536;
/// Most messages of a client in a second.
pub(crate) const MAX_RATE: u32 = 2000;
/// Errors after which a client is cut off.
pub(crate) const MAX_ERRORS: u32 = 50;
/// Range of a speed: simulated over wall time.
pub(crate) const SPEEDS: [f64; 7] = [0.125, 0.25, 0.5, 1.0, 2.0, 4.0, 8.0];
/// Range of the scale of motions.
pub(crate) const SCALES: std::ops::RangeInclusive<f64> = 0.1..=1.0;

/// The things that one client at a time may drive.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Seat {
    Controls,
    Left,
    Right,
}

impl Seat {
    pub const ALL: [Self; 3] = [Self::Controls, Self::Left, Self::Right];

    pub fn name(self) -> &'static str {
        match self {
            Self::Controls => "controls",
            Self::Left => "left",
            Self::Right => "right",
        }
    }
}

/// Name of an arm.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum ArmName {
    Left,
    Right,
}

impl ArmName {
    pub fn seat(self) -> Seat {
        match self {
            Self::Left => Seat::Left,
            Self::Right => Seat::Right,
        }
    }

    pub fn name(self) -> &'static str {
        self.seat().name()
    }
}

/// The values that are shown on the organs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Overlay {
    Stretch,
    Energy,
}

/// A client's subscription: the messages that it wants.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(default)]
pub(crate) struct Subscription {
    pub frames_hz: f64,
    pub value: Option<Overlay>,
    pub value_range: Option<[f32; 2]>,
    pub contacts: bool,
    pub held: bool,
    pub measured_hz: f64,
    pub haptic: bool,
}

impl Default for Subscription {
    fn default() -> Self {
        Self {
            frames_hz: 60.0,
            value: None,
            value_range: None,
            contacts: false,
            held: false,
            measured_hz: 0.0,
            haptic: false,
        }
    }
}

/// Axes of a relative motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Axes {
    Endoscope,
    Tool,
    World,
}

/// An operator's command to an arm.
#[derive(Clone, Debug, PartialEq)]
pub(crate) enum Servo {
    /// The whole motion since the clutch was pressed.
    Relative { clutch: u64, axes: Axes, camera: Option<String>, scale: f64, translation: [f64; 3], rotation: [f64; 4] },
    /// A pose in the cell.
    Pose([f64; 7]),
    /// The arm's numbers without the jaw.
    Numbers([f64; 4]),
    /// Nothing but the jaw.
    Jaw,
    /// The arm holds its place.
    Release,
}

/// A command for an arm.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Command {
    pub seq: u64,
    /// The client's clock (s).
    pub time_s: f64,
    pub servo: Servo,
    /// Opening of the jaw, 0 to 1; `None` leaves it.
    pub jaw: Option<f64>,
}

/// A command to the recorder.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum RecordAction {
    Keep,
    Discard,
    Redo,
}

/// How a picture is made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub(crate) enum Quality {
    Raster,
    #[default]
    Ray,
    Path,
}

/// A message as it is written.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "type", rename_all = "snake_case")]
pub(crate) enum Said {
    Subscribe(Subscription),
    Seats {
        #[serde(default)]
        take: Vec<Seat>,
        #[serde(default)]
        give: Vec<Seat>,
    },
    Play {},
    Pause {},
    Step {
        #[serde(default = "one")]
        periods: u32,
    },
    Speed {
        factor: f64,
    },
    Reset {
        seed: Option<u64>,
        policy: Option<String>,
    },
    Seek {
        time_s: f64,
    },
    Open {
        episode: String,
    },
    Live {},
    Record {
        action: RecordAction,
    },
    ServoCr {
        arm: ArmName,
        seq: u64,
        time_s: f64,
        clutch: u64,
        frame: Axes,
        camera: Option<String>,
        #[serde(default = "whole")]
        scale: f64,
        translation_m: [f64; 3],
        #[serde(default = "no_turn")]
        rotation_wxyz: [f64; 4],
        jaw: Option<f64>,
    },
    ServoCp {
        arm: ArmName,
        seq: u64,
        time_s: f64,
        pose: [f64; 7],
        jaw: Option<f64>,
    },
    ServoJp {
        arm: ArmName,
        seq: u64,
        time_s: f64,
        positions: Vec<f64>,
    },
    ServoJaw {
        arm: ArmName,
        seq: u64,
        time_s: f64,
        opening: f64,
    },
    Release {
        arm: ArmName,
    },
    HandBack {
        arm: ArmName,
    },
    History {
        channels: Vec<String>,
        #[serde(default)]
        from_s: f64,
    },
    Picture {
        camera: String,
        width: usize,
        height: usize,
        #[serde(default)]
        quality: Quality,
    },
    Table {},
    Ping {
        #[serde(default)]
        time_s: f64,
    },
}

fn one() -> u32 {
    1
}

fn whole() -> f64 {
    1.0
}

fn no_turn() -> [f64; 4] {
    [1.0, 0.0, 0.0, 0.0]
}

/// A mistake in a message: its code and a sentence.
pub(crate) struct Mistake(pub &'static str, pub String);

/// A message of a client with its number for the reply.
pub(crate) fn parse(text: &str) -> Result<(Option<i64>, Said), (Option<i64>, Mistake)> {
    let value: Value = serde_json::from_str(text)
        .map_err(|e| (None, Mistake("type", format!("the message is no JSON object: {e}"))))?;
    let request = value.get("request").and_then(Value::as_i64);
    let fail = |code, why| Err((request, Mistake(code, why)));
    let Some(kind) = value.get("type").and_then(Value::as_str).map(str::to_owned) else {
        return fail("type", "the message has no 'type'".to_owned());
    };
    match serde_json::from_value::<Said>(value) {
        Ok(said) => match check(&said) {
            None => Ok((request, said)),
            Some(why) => fail("value", format!("{kind:.20}: {why}")),
        },
        Err(why) if why.to_string().contains("unknown variant") && why.to_string().contains("`subscribe`") => {
            fail("type", format!("no message '{kind:.20}'"))
        }
        Err(why) => fail("value", format!("{kind:.20}: {why}")),
    }
}

/// The error in the numbers of a message, if any.
fn check(said: &Said) -> Option<String> {
    let finite = |name: &str, all: &[f64]| {
        let lost = all.iter().find(|x| !x.is_finite() || x.abs() > 1e6);
        lost.map(|x| format!("{name} has {x}; it must be finite and below 1e6"))
    };
    let within = |name: &str, x: f64, low: f64, high: f64| {
        (!(low..=high).contains(&x)).then(|| format!("{name} is {x}; it must be in [{low}, {high}]"))
    };
    let turn = |q: &[f64]| {
        let norm = q.iter().map(|x| x * x).sum::<f64>().sqrt();
        ((norm - 1.0).abs() > 1e-3).then(|| "the rotation must be a unit quaternion, scalar first".to_owned())
    };
    let jaw = |jaw: &Option<f64>| jaw.and_then(|x| within("jaw", x, 0.0, 1.0));
    match said {
        Said::Subscribe(wants) => within("frames_hz", wants.frames_hz, 0.0, 240.0)
            .or_else(|| within("measured_hz", wants.measured_hz, 0.0, 240.0))
            .or_else(|| {
                let range = wants.value_range?;
                let good = range.iter().all(|x| x.is_finite()) && range[1] > range[0];
                (!good).then(|| "value_range must be two finite numbers, the lower one first".to_owned())
            }),
        Said::Step { periods } => within("periods", f64::from(*periods), 1.0, 1000.0),
        Said::Speed { factor } if *factor == 0.0 => None,
        Said::Speed { factor } => within("factor", *factor, SPEEDS[0], SPEEDS[SPEEDS.len() - 1]),
        Said::Seek { time_s } | Said::Ping { time_s } => finite("time_s", &[*time_s]),
        Said::History { channels, from_s } => finite("from_s", &[*from_s])
            .or_else(|| (channels.is_empty() || channels.len() > 64).then(|| "channels: name 1 to 64".to_owned())),
        Said::Picture { width, height, .. } => {
            let side = |n: usize| within("a side", n as f64, 16.0, 1920.0);
            side(*width).or_else(|| side(*height))
        }
        Said::ServoCr { time_s, scale, translation_m, rotation_wxyz, jaw: opening, .. } => finite("time_s", &[*time_s])
            .or_else(|| finite("translation_m", translation_m))
            .or_else(|| within("scale", *scale, *SCALES.start(), *SCALES.end()))
            .or_else(|| turn(rotation_wxyz))
            .or_else(|| jaw(opening)),
        Said::ServoCp { time_s, pose, jaw: opening, .. } => finite("time_s", &[*time_s])
            .or_else(|| finite("pose", pose))
            .or_else(|| turn(&pose[3..]))
            .or_else(|| jaw(opening)),
        Said::ServoJp { time_s, positions, .. } => {
            finite("time_s", &[*time_s]).or_else(|| finite("positions", positions)).or_else(|| match positions.len() {
                4 => None,
                5 => jaw(&Some(positions[4])),
                n => Some(format!("positions has {n} numbers; 4, or 5 with the jaw")),
            })
        }
        Said::ServoJaw { time_s, opening, .. } => finite("time_s", &[*time_s]).or_else(|| jaw(&Some(*opening))),
        _ => None,
    }
}

impl Said {
    /// The command in a message, and its arm.
    pub fn command(&self) -> Option<(ArmName, Command)> {
        Some(match self.clone() {
            Self::ServoCr { arm, seq, time_s, clutch, frame, camera, scale, translation_m, rotation_wxyz, jaw } => {
                let servo = Servo::Relative {
                    clutch,
                    axes: frame,
                    camera,
                    scale,
                    translation: translation_m,
                    rotation: rotation_wxyz,
                };
                (arm, Command { seq, time_s, servo, jaw })
            }
            Self::ServoCp { arm, seq, time_s, pose, jaw } => {
                (arm, Command { seq, time_s, servo: Servo::Pose(pose), jaw })
            }
            Self::ServoJp { arm, seq, time_s, positions } => {
                let [a, b, c, d] = std::array::from_fn(|k| positions.get(k).copied().unwrap_or(0.0));
                (arm, Command { seq, time_s, servo: Servo::Numbers([a, b, c, d]), jaw: positions.get(4).copied() })
            }
            Self::ServoJaw { arm, seq, time_s, opening } => {
                (arm, Command { seq, time_s, servo: Servo::Jaw, jaw: Some(opening) })
            }
            _ => return None,
        })
    }

    /// The seat that a message needs.
    pub fn seat(&self) -> Option<Seat> {
        match self {
            Self::Play {}
            | Self::Pause {}
            | Self::Step { .. }
            | Self::Speed { .. }
            | Self::Reset { .. }
            | Self::Seek { .. }
            | Self::Open { .. }
            | Self::Live {}
            | Self::Record { .. } => Some(Seat::Controls),
            Self::ServoCr { arm, .. }
            | Self::ServoCp { arm, .. }
            | Self::ServoJp { arm, .. }
            | Self::ServoJaw { arm, .. }
            | Self::Release { arm }
            | Self::HandBack { arm } => Some(arm.seat()),
            _ => None,
        }
    }
}

/// The reply to a request that was done.
pub(crate) fn done(request: Option<i64>) -> Value {
    json!({"type": "done", "request": request})
}

/// The reply to a request that was not.
pub(crate) fn error(request: Option<i64>, mistake: &Mistake) -> Value {
    json!({"type": "error", "request": request, "code": mistake.0, "message": mistake.1})
}
