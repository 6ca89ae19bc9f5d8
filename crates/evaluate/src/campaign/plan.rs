//! What a campaign consists of: policies, seeds, and one job for each pair.

use crate::{Error, Result};
use serde::{Deserialize, Serialize};
use trocar_scene::Scene;
use trocar_specimen::Specimen;
use trocar_task::policy::POLICIES;
use trocar_task::{scene_hash, specimen_hash};

/// Most episodes of a policy.
const MOST_EPISODES: usize = 100_000;

/// A policy of a campaign, by what the user wrote: `scripted`, `ws://HOST:PORT`, `python:MODULE:NAME` or `python:FILE.py:NAME`, or `NAME=` and one of those.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct PolicySpec {
    /// Its name in tables and folders.
    pub name: String,
    /// What it is.
    pub source: String,
}

impl PolicySpec {
    /// # Errors
    /// Says what can be written.
    pub fn parse(text: &str) -> Result<Self> {
        let (name, source) = match text.split_once('=') {
            Some((name, source)) if !name.contains([':', '/']) => (Some(name), source),
            _ => (None, text),
        };
        let remote = source.starts_with("ws://") || source.starts_with("wss://");
        let python = source.strip_prefix("python:");
        if !(remote || python.is_some_and(|p| p.contains(':')) || POLICIES.contains(&source)) {
            return Err(Error::Mismatch(format!(
                "--policy {text:.80}: is none of {}, ws://HOST:PORT, python:FILE.py:NAME, python:MODULE:NAME; or NAME= and one of those",
                POLICIES.join(", ")
            )));
        }
        let plain = |c: char| if c.is_ascii_alphanumeric() || "-_.".contains(c) { c } else { '-' };
        let name: String = name.unwrap_or(source).chars().map(plain).collect();
        if name.is_empty() || name.len() > 80 || name.starts_with('.') {
            return Err(Error::Mismatch(format!(
                "--policy {text:.80}: its name must have 1 to 80 letters, not a dot first"
            )));
        }
        Ok(Self { name, source: source.to_owned() })
    }
}

/// One episode of a campaign.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Job {
    /// The policy.
    pub policy: PolicySpec,
    /// Its place among the policy's episodes.
    pub index: usize,
    /// The seed.
    pub seed: u64,
}

/// What a campaign is: its folder's `campaign.json`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plan {
    /// Version of the program, and hash of the sources that decide what an episode is: one table is not made by two programs.
    pub program: String,
    /// Name of the scene.
    pub scene: String,
    /// Its task.
    pub task: String,
    /// Hash of scene and arms' models, hexadecimal.
    pub scene_hash: String,
    /// Hash of what is simulated of the specimen.
    pub specimen_hash: String,
    /// RCM threshold of the scene [mm].
    pub rcm_threshold_mm: f64,
    /// The policies.
    pub policies: Vec<PolicySpec>,
    /// Episodes of each.
    pub episodes: usize,
    /// Seed of the first.
    pub seed: u64,
    /// Most episodes of all policies together; None for all. Policies take turns, so that the first have one more than the last.
    #[serde(default)]
    pub most: Option<usize>,
}

impl Plan {
    /// # Errors
    /// No policy, two of one name, too many episodes, an arm's model that cannot be read.
    pub fn new(
        scene: &Scene,
        specimen: &Specimen,
        policies: &[PolicySpec],
        episodes: usize,
        seed: u64,
    ) -> Result<Self> {
        if !(1..=MOST_EPISODES).contains(&episodes) {
            return Err(Error::Mismatch(format!("--episodes {episodes}: 1 to {MOST_EPISODES} can be run")));
        }
        if policies.is_empty() {
            return Err(Error::Mismatch("a campaign needs a --policy".to_owned()));
        }
        for (k, policy) in policies.iter().enumerate() {
            if policies[..k].iter().any(|p| p.name == policy.name) {
                let name = &policy.name;
                return Err(Error::Mismatch(format!(
                    "two policies are named '{name}'; name one, as in --policy b={name}"
                )));
            }
        }
        let hash = specimen_hash(specimen);
        Ok(Self {
            program: format!("{} {}", env!("CARGO_PKG_VERSION"), env!("TROCAR_EPISODE_MAKERS")),
            scene: scene.name.clone(),
            task: scene.task.name.name().to_owned(),
            scene_hash: format!("{:016x}", scene_hash(scene, hash)?),
            specimen_hash: format!("{hash:016x}"),
            rcm_threshold_mm: scene.safety.rcm_threshold_mm,
            policies: policies.to_vec(),
            episodes,
            seed,
            most: None,
        })
    }

    /// The same with no more than `most` episodes of all policies together.
    #[must_use]
    pub fn at_most(self, most: usize) -> Self {
        Self { most: Some(most), ..self }
    }

    /// How many episodes there are in all.
    pub fn count(&self) -> usize {
        let all = self.episodes.saturating_mul(self.policies.len());
        self.most.map_or(all, |most| most.min(all))
    }

    /// All jobs; the policies take turns, so that a campaign that was stopped compares what it has.
    pub fn jobs(&self) -> impl Iterator<Item = Job> + '_ {
        let all = (0..self.episodes).flat_map(move |index| {
            let seed = self.seed.wrapping_add(index as u64);
            self.policies.iter().map(move |policy| Job { policy: policy.clone(), index, seed })
        });
        all.take(self.count())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_first_policies_have_one_episode_more() {
        let policies = POLICIES.map(|p| PolicySpec::parse(p).unwrap()).to_vec();
        let plan = Plan {
            program: String::new(),
            scene: String::new(),
            task: String::new(),
            scene_hash: String::new(),
            specimen_hash: String::new(),
            rcm_threshold_mm: 3.0,
            policies,
            episodes: 24,
            seed: 7,
            most: None,
        };
        assert_eq!((plan.count(), plan.jobs().count()), (144, 144));
        let plan = plan.at_most(140);
        let jobs: Vec<Job> = plan.jobs().collect();
        let of = |name: &str| jobs.iter().filter(|j| j.policy.name == name).count();
        assert_eq!(POLICIES.map(of), [24, 24, 23, 23, 23, 23]);
        assert!(jobs.iter().all(|j| j.seed == 7 + j.index as u64));
    }

    #[test]
    fn policies_are_named_for_folders() {
        let name = |text| PolicySpec::parse(text).map(|p| (p.name, p.source));
        let pair = |a: &str, b: &str| (a.to_owned(), b.to_owned());
        assert_eq!(name("scripted").unwrap(), pair("scripted", "scripted"));
        assert_eq!(name("mine=ws://127.0.0.1:8000").unwrap(), pair("mine", "ws://127.0.0.1:8000"));
        assert_eq!(name("ws://h:1/a?b=c").unwrap(), pair("ws---h-1-a-b-c", "ws://h:1/a?b=c"));
        assert_eq!(name("python:policies.lift:make").unwrap().1, "python:policies.lift:make");
        for bad in ["", "genius", "=scripted", "..=scripted", "python:lift"] {
            assert!(name(bad).is_err(), "{bad}");
        }
    }
}
