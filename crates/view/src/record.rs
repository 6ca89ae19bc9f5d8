//! Demonstrations: episodes that an operator keeps. Each is an ordinary episode file, with the
//! operator's input in files beside it.

use crate::error::{Error, Result};
use crate::hub::{Arrived, Hub};
use crate::operator::Actor;
use crate::policy::OPERATOR;
use crate::protocol::{ArmName, Servo};
use crate::show::Show;
use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use trocar_specimen::StagedFolder;
use trocar_task::{Column, RESULT_FILE};
use trocar_workflow::{SURFACES_FILE, SurfaceWatch};

/// The operator's input: one JSON object per line.
const INPUT_FILE: &str = "input.jsonl";
/// Who moved each arm in each control period.
const ACTORS_FILE: &str = "actors.csv";
/// The most inputs that an episode keeps: ten minutes of two devices at 500 Hz.
const MAX_INPUTS: usize = 600_000;

/// A folder of demonstrations, and the input of the episode that runs.
pub(crate) struct Recorder {
    pub folder: PathBuf,
    input: Vec<String>,
}

impl Recorder {
    pub fn new(folder: &Path) -> Self {
        Self { folder: folder.to_owned(), input: Vec::new() }
    }

    /// Forgets the input of the last episode: a new one begins.
    pub fn begin(&mut self) {
        self.input.clear();
    }

    /// Takes the input that has arrived; `time_s` is the simulated time (s).
    pub fn take(&mut self, hub: &Hub, time_s: f64) {
        for (arm, arrived) in hub.take_raw() {
            if self.input.len() < MAX_INPUTS {
                self.input.push(line(arm, &arrived, time_s, hub.wall_s(arrived.at)).to_string());
            }
        }
    }

    /// Writes the live episode of `show` into a new folder. `show` must stand at the newest period.
    /// Returns the folder, and whether all stages are passed.
    ///
    /// # Errors
    /// The episode shown is not live; a folder that cannot be written.
    pub fn keep(&self, show: &mut Show) -> Result<(PathBuf, bool)> {
        let Some(live) = &mut show.live else {
            return Err(Error::Source("an episode file is shown; only a live episode can be kept".to_owned()));
        };
        let number = (1..).find(|n| !self.folder.join(format!("{n:06}")).exists()).unwrap_or(0);
        let folder = self.folder.join(format!("{number:06}"));
        let mut kept = live.kept.clone();
        let by_operator = live.actors.iter().flatten().any(|a| *a != Actor::Policy);
        if by_operator && live.policy_name != OPERATOR {
            kept.rename(&format!("{}+{OPERATOR}", live.policy_name));
        }
        let mut recording = kept.finish(&show.episode)?;
        recording.beside = [ArmName::Left, ArmName::Right].map(|arm| actor_column(arm, &live.actors)).to_vec();
        let passed = recording.summary.passed;
        let staged = StagedFolder::create(&folder, RESULT_FILE).map_err(trocar_workflow::Error::from)?;
        recording.write_into(staged.path())?;
        let write = |name: &str, text: String| {
            let path = staged.path().join(name);
            std::fs::write(&path, text).map_err(|source| Error::Io { path, source })
        };
        let lines = |all: Vec<&str>| all.iter().map(|line| format!("{line}\n")).collect::<String>();
        write(INPUT_FILE, lines(self.input.iter().map(String::as_str).collect()))?;
        let rows = live.actors.iter().enumerate();
        let rows: String = rows.map(|(k, [l, r])| format!("{},{},{}\n", k + 1, l.name(), r.name())).collect();
        write(ACTORS_FILE, format!("step,left,right\n{rows}"))?;
        let surfaces = std::mem::replace(&mut live.surfaces, SurfaceWatch::new(false));
        if let Some(bytes) = surfaces.finish()? {
            let path = staged.path().join(SURFACES_FILE);
            std::fs::write(&path, bytes).map_err(|source| Error::Io { path, source })?;
        }
        staged.commit().map_err(trocar_workflow::Error::from)?;
        Ok((folder, passed))
    }
}

/// A column that says who moved an arm in each control period: 0 is the policy, 1 the operator, 2
/// nobody.
fn actor_column(arm: ArmName, actors: &[[Actor; 2]]) -> Column {
    let values = actors.iter().map(|both| f64::from(both[arm as usize] as u8)).collect();
    Column { name: format!("{}_actor", arm.name()), values }
}

/// An input as JSON. Times are in seconds.
fn line(arm: ArmName, arrived: &Arrived, time_s: f64, wall_s: f64) -> Value {
    let command = &arrived.command;
    let mut said = json!({
        "arm": arm.name(), "client": arrived.client, "seq": command.seq, "client_time_s": command.time_s,
        "arrived_s": wall_s, "before_s": time_s, "jaw": command.jaw,
    });
    match &command.servo {
        Servo::Relative { clutch, axes, camera, scale, translation, rotation } => {
            said["servo_cr"] = json!({
                "clutch": clutch, "frame": format!("{axes:?}").to_lowercase(), "camera": camera, "scale": scale,
                "translation_m": translation, "rotation_wxyz": rotation,
            });
        }
        Servo::Pose(pose) => said["servo_cp"] = json!(pose),
        Servo::Numbers(numbers) => said["servo_jp"] = json!(numbers),
        Servo::Jaw | Servo::Release => {}
    }
    said
}
