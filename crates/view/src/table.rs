//! Tables of episodes: of a campaign, or of a folder of demonstrations; failures first.

use serde_json::{Value, json};
use std::path::{Path, PathBuf};
use trocar_task::{EPISODE_FILE, RESULT_FILE};

/// Most episodes of a table.
const MAX_EPISODES: usize = 20_000;

/// The message `table` where there is none.
pub(crate) fn no_episodes(number: Option<i64>) -> Value {
    json!({"type": "table", "request": number, "kind": "none", "name": "", "episodes": []})
}

/// Names of the folders in `folder`, in order.
fn folders(folder: &Path) -> Vec<String> {
    let entries = std::fs::read_dir(folder).into_iter().flatten().flatten();
    let named = entries.filter(|e| e.path().is_dir()).filter_map(|e| e.file_name().into_string().ok());
    let mut all: Vec<String> = named.filter(|name| !name.starts_with('.')).collect();
    all.sort();
    all
}

/// Names of the episodes in a folder of demonstrations.
pub(crate) fn demonstrations(folder: &Path) -> Vec<String> {
    let mut all = folders(folder);
    all.retain(|name| folder.join(name).join(EPISODE_FILE).is_file());
    all
}

/// Names of the episodes of a campaign: policy and number.
fn campaign(folder: &Path) -> Vec<String> {
    let episodes = folder.join("episodes");
    let of = |policy: String| folders(&episodes.join(&policy)).into_iter().map(move |n| format!("{policy}/{n}"));
    let mut all: Vec<String> = folders(&episodes).into_iter().flat_map(of).collect();
    all.retain(|name| episodes.join(name).join(RESULT_FILE).is_file());
    all
}

/// A folder of episodes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Folder {
    Campaign(PathBuf),
    Demonstrations(PathBuf),
}

impl Folder {
    fn path(&self) -> &Path {
        match self {
            Self::Campaign(path) | Self::Demonstrations(path) => path,
        }
    }

    fn names(&self) -> Vec<String> {
        match self {
            Self::Campaign(path) => campaign(path),
            Self::Demonstrations(path) => demonstrations(path),
        }
    }

    /// The folder of the episode of that name, if it is one of the table's.
    pub fn episode(&self, name: &str) -> Option<PathBuf> {
        let known = self.names().iter().any(|own| own == name);
        known.then(|| match self {
            Self::Campaign(path) => path.join("episodes").join(name),
            Self::Demonstrations(path) => path.join(name),
        })
    }

    /// The first episode of the table.
    pub fn first(&self) -> Option<String> {
        self.rows().first().and_then(|row| row["id"].as_str().map(str::to_owned))
    }

    fn rows(&self) -> Vec<Value> {
        let mut rows: Vec<Value> = self.names().into_iter().take(MAX_EPISODES).map(|id| self.row(&id)).collect();
        rows.sort_by_key(|row| row["passed"].as_bool().unwrap_or(false));
        rows
    }

    fn row(&self, id: &str) -> Value {
        let folder = self.episode_path(id);
        let read = || serde_json::from_slice::<Value>(&std::fs::read(folder.join(RESULT_FILE)).ok()?).ok();
        let Some(result) = read() else {
            return json!({"id": id, "passed": false, "why": format!("its {RESULT_FILE} cannot be read")});
        };
        // Of a campaign, the folder names the policy.
        let policy = id.split_once('/').map_or(result["policy"].clone(), |(policy, _)| json!(policy));
        json!({
            "id": id, "policy": policy, "seed": result["seed"], "passed": result["passed"],
            "end": result["end"]["end"], "score": result["score"], "stage": result["next"],
            "duration_s": result["duration_s"], "why": result["why"],
        })
    }

    fn episode_path(&self, id: &str) -> PathBuf {
        match self {
            Self::Campaign(path) => path.join("episodes").join(id),
            Self::Demonstrations(path) => path.join(id),
        }
    }

    /// The message `table`; `open` is the episode that is shown.
    pub fn message(&self, request: Option<i64>, open: Option<&str>) -> Value {
        let kind = match self {
            Self::Campaign(_) => "campaign",
            Self::Demonstrations(_) => "demonstrations",
        };
        let name = self.path().display().to_string();
        json!({"type": "table", "request": request, "kind": kind, "name": name, "open": open, "episodes": self.rows()})
    }
}
