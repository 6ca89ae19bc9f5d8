//! The manifest of a campaign: scene, policies and seeds, and one job for each policy and seed.

use crate::policy_spec::PolicySpec;
use crate::remote;
use serde::{Deserialize, Serialize};
use trocar_scene::{BackendName, Scene, SpecimenSource, Split, Variation};
use trocar_specimen::Specimen;
use trocar_task::{scene_hash, specimen_hash};
use trocar_workflow::{Error, Result, counted};

/// Maximum number of episodes per policy.
const MAX_EPISODES: usize = 100_000;

/// One episode of a campaign.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Job {
    /// The policy.
    pub policy: PolicySpec,
    /// Index among the policy's episodes.
    pub index: usize,
    /// The seed.
    pub seed: u64,
}

/// Version of this program and hash of the sources that an episode depends on.
pub(super) fn program() -> String {
    format!("{} {}", env!("CARGO_PKG_VERSION"), trocar_workflow::EPISODE_SOURCE_HASH)
}

/// The specimen by whose hash a campaign of `scene` is identified: the first one that episodes of
/// `split` draw from. Each episode file knows its own.
pub fn named_specimen(scene: &Scene, split: Split) -> SpecimenSource {
    split.of_specimens(&scene.specimens()).first().unwrap_or(&scene.specimen).clone()
}

/// Checks the options of a campaign, without its specimen. `max_episodes` is the value of
/// `--rollouts`, from which `experiment rollouts` computes `episodes`.
pub(super) fn check(policies: &[PolicySpec], episodes: usize, seed: u64, max_episodes: Option<usize>) -> Result<()> {
    check_policies(policies)?;
    let wrong = |why: String| Err(Error::Mismatch(why));
    if !(1..=MAX_EPISODES).contains(&episodes) {
        return wrong(match max_episodes {
            Some(count) => {
                format!("--rollouts {count}: it must be in [1, {}]", MAX_EPISODES.saturating_mul(policies.len()))
            }
            None => format!("--episodes {episodes}: it must be in [1, {MAX_EPISODES}]"),
        });
    }
    let most = Split::FIRST_UNSEEN - episodes as u64;
    if seed > most {
        return wrong(format!(
            "--seed {seed}: it must be at most {most} for {}; --split unseen has the seeds from {}",
            counted(episodes, "episode"),
            Split::FIRST_UNSEEN
        ));
    }
    Ok(())
}

/// Checks the policies of a campaign.
pub(super) fn check_policies(policies: &[PolicySpec]) -> Result<()> {
    let wrong = |why: String| Err(Error::Mismatch(why));
    if policies.is_empty() {
        return wrong("a campaign needs a --policy".to_owned());
    }
    for (k, policy) in policies.iter().enumerate() {
        let name = &policy.name;
        if policies[..k].iter().any(|p| p.name == *name) {
            let source = policy.display_source();
            return wrong(format!("two policies are named '{name}'; name one, as in --policy b={source}"));
        }
        if policy.is_remote() {
            remote::endpoint(policy)?;
        }
    }
    Ok(())
}

/// Checks the policy and the seed of a single episode.
pub(super) fn check_episode(policy: &PolicySpec, seed: u64) -> Result<()> {
    check_policies(std::slice::from_ref(policy))?;
    if policy.is_remote() && i64::try_from(seed).is_err() {
        let max = i64::MAX;
        let why = format!("--seed {seed}: seeds for servers and Python policies must be at most {max}");
        return Err(Error::Mismatch(why));
    }
    Ok(())
}

/// The contents of `campaign.json`, which identifies a campaign.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Manifest {
    /// Version of the program and hash of the sources that an episode depends on. Different
    /// programs cannot write one table.
    pub program: String,
    /// Name of the scene.
    pub scene: String,
    /// Its task.
    pub task: String,
    /// Hash of the scene and the models of its arms, hexadecimal.
    pub scene_hash: String,
    /// Hash of the simulated parts of the specimen, hexadecimal; of the first one where several are
    /// drawn from.
    pub specimen_hash: String,
    /// RCM threshold of the scene (mm).
    pub rcm_threshold_mm: f64,
    /// The policies.
    pub policies: Vec<PolicySpec>,
    /// Number of episodes per policy.
    pub episodes: usize,
    /// Which episodes they are.
    #[serde(default)]
    pub split: Split,
    /// Number of the first episode in its split. Of seen episodes it is the seed.
    pub seed: u64,
    /// The variation between episodes.
    #[serde(default)]
    pub variation: Variation,
    /// The model of the tissue.
    #[serde(default)]
    pub backend: BackendName,
    /// Control period of the scene (s).
    #[serde(default)]
    pub control_period_s: f64,
    /// Maximum number of episodes of all policies together; `None` for all. Policies take turns, so
    /// the first may have one episode more than the last.
    #[serde(default, alias = "most")]
    pub max_episodes: Option<usize>,
}

impl Manifest {
    /// The manifest of `episodes` episodes per policy, from number `seed` of `split` on.
    ///
    /// # Errors
    /// No policy, two of one name, an address that is invalid, too many episodes, seeds out of
    /// range, an arm model that cannot be read.
    pub fn new(
        scene: &Scene,
        specimen: &Specimen,
        policies: &[PolicySpec],
        episodes: usize,
        (split, seed): (Split, u64),
    ) -> Result<Self> {
        check(policies, episodes, seed, None)?;
        let hash = specimen_hash(specimen);
        Ok(Self {
            program: program(),
            scene: scene.name.clone(),
            task: scene.task.name.name().to_owned(),
            scene_hash: format!("{:016x}", scene_hash(scene, hash)?),
            specimen_hash: format!("{hash:016x}"),
            rcm_threshold_mm: scene.safety.rcm_threshold_mm,
            policies: policies.to_vec(),
            episodes,
            split,
            seed,
            variation: scene.variation.clone(),
            backend: scene.tissue.backend,
            control_period_s: 1.0 / f64::from(scene.rates.control_hz),
            max_episodes: None,
        })
    }

    /// Total number of episodes.
    pub fn count(&self) -> usize {
        let all = self.episodes.saturating_mul(self.policies.len());
        self.max_episodes.map_or(all, |max| max.min(all))
    }

    /// The number of the first episode. Both splits begin at the same number.
    fn first_index(&self) -> u64 {
        if self.split == Split::Both { 2 * self.seed } else { self.seed }
    }

    /// The seed of the first episode.
    pub fn first_seed(&self) -> u64 {
        self.split.seed(self.first_index())
    }

    /// The seeds in the order of the episodes.
    pub fn seeds(&self) -> impl Iterator<Item = u64> + '_ {
        let first = self.first_index();
        (0..self.episodes as u64).map(move |index| self.split.seed(first + index))
    }

    /// All jobs. Policies take turns: an interrupted campaign can still compare them.
    pub fn jobs(&self) -> impl Iterator<Item = Job> + '_ {
        let all = self.seeds().enumerate().flat_map(move |(index, seed)| {
            self.policies.iter().map(move |policy| Job { policy: policy.clone(), index, seed })
        });
        all.take(self.count())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use trocar_task::policy::POLICIES;

    #[test]
    fn the_first_policies_have_one_episode_more() {
        let policies = POLICIES.map(|p| PolicySpec::parse(p).unwrap()).to_vec();
        let manifest = Manifest {
            program: String::new(),
            scene: String::new(),
            task: String::new(),
            scene_hash: String::new(),
            specimen_hash: String::new(),
            rcm_threshold_mm: 3.0,
            policies,
            episodes: 24,
            split: Split::Seen,
            seed: 7,
            variation: Variation::default(),
            backend: BackendName::default(),
            control_period_s: 1.0 / 30.0,
            max_episodes: None,
        };
        assert_eq!((manifest.count(), manifest.jobs().count()), (144, 144));
        let manifest = Manifest { max_episodes: Some(140), ..manifest };
        let jobs: Vec<Job> = manifest.jobs().collect();
        let of = |name: &str| jobs.iter().filter(|j| j.policy.name == name).count();
        assert_eq!(POLICIES.map(of), [24, 24, 23, 23, 23, 23]);
        assert!(jobs.iter().all(|j| j.seed == 7 + j.index as u64));
        let seeds = |split| Manifest { split, ..manifest.clone() }.seeds().take(4).collect::<Vec<_>>();
        assert_eq!(seeds(Split::Unseen), [1_000_007, 1_000_008, 1_000_009, 1_000_010]);
        assert_eq!(seeds(Split::Both), [7, 1_000_007, 8, 1_000_008]);
        // An earlier name of a key is read.
        let text = serde_json::to_string(&manifest).unwrap();
        assert!(text.contains("\"max_episodes\":140"), "{text}");
        let older: Manifest = serde_json::from_str(&text.replace("max_episodes", "most")).unwrap();
        assert_eq!(older, manifest);
    }

    #[test]
    fn wrong_options_are_refused_by_name() {
        let spec = |text: &str| PolicySpec::parse(text).unwrap();
        let (scripted, server) = (vec![spec("scripted")], vec![spec("a=ws://127.0.0.1:1")]);
        let said = |policies: &[PolicySpec], episodes, seed, most| {
            check(policies, episodes, seed, most).map_err(|e| e.to_string()).err().unwrap_or_default()
        };
        assert_eq!(said(&scripted, 2, Split::FIRST_UNSEEN - 2, None), "");
        assert_eq!(check_episode(&server[0], i64::MAX as u64).map_err(|e| e.to_string()), Ok(()));
        assert!(said(&scripted, 0, 0, None).starts_with("--episodes 0"));
        // The option that the user wrote is named.
        assert!(said(&scripted, 900_000, 0, Some(900_000)).starts_with("--rollouts 900000: "));
        assert!(said(&scripted, 2, Split::FIRST_UNSEEN - 1, None).starts_with("--seed 999999: "));
        assert!(said(&scripted, 2, u64::MAX, None).starts_with("--seed 18446744073709551615: "));
        let why = check_episode(&server[0], i64::MAX as u64 + 1).unwrap_err().to_string();
        assert!(why.starts_with("--seed 9223372036854775808: "), "{why}");
        assert!(said(&[&scripted[..], &scripted].concat(), 1, 0, None).contains("two policies"));
        assert!(said(&[], 1, 0, None).contains("--policy"));
        let made_by_hand = PolicySpec { name: "a".to_owned(), source: "ws://".to_owned() };
        assert!(said(&[made_by_hand], 1, 0, None).contains("--policy a: "));
    }

    #[test]
    fn the_hash_covers_every_crate_that_an_episode_depends_on() {
        let hashed: Vec<&str> = trocar_workflow::EPISODE_SOURCES.split(' ').collect();
        for file in ["remote/src", "campaign/src/remote.rs", "../Cargo.lock"] {
            assert!(hashed.contains(&file), "{file} is not among {hashed:?}");
        }
        // All crates that episodes, remote policies and camera pictures depend on.
        let crates = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("..");
        let mut open = vec!["task".to_owned(), "sensors".to_owned(), "remote".to_owned()];
        let mut seen = Vec::new();
        while let Some(name) = open.pop() {
            let text = std::fs::read_to_string(crates.join(&name).join("Cargo.toml")).unwrap();
            let table: toml::Table = text.parse().unwrap();
            let own = table["dependencies"].as_table().unwrap().keys().filter_map(|k| k.strip_prefix("trocar-"));
            open.extend(own.filter(|k| !seen.iter().any(|s| s == k)).map(str::to_owned));
            assert!(hashed.contains(&format!("{name}/src").as_str()), "{name} is not hashed");
            seen.push(name);
        }
    }
}
