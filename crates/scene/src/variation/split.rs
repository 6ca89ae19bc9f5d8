//! Which episodes a policy may learn from, and which are kept apart to judge it by.

use crate::SpecimenSource;
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

/// Part of all episodes. The seed of an episode decides which part it belongs to: an episode can be
/// run again by its seed alone.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Split {
    /// Seeds below [`FIRST_UNSEEN`](Self::FIRST_UNSEEN), with the first specimens.
    #[default]
    Seen,
    /// Seeds from [`FIRST_UNSEEN`](Self::FIRST_UNSEEN) on, with the last quarter of the specimens.
    Unseen,
    /// Both; a campaign takes turns.
    Both,
}

impl Split {
    /// All of them.
    pub const ALL: [Self; 3] = [Self::Seen, Self::Unseen, Self::Both];

    /// The first seed of unseen episodes. The seeds of a split start at 0 and at this.
    pub const FIRST_UNSEEN: u64 = 1_000_000;

    /// Its name in files and on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Self::Seen => "seen",
            Self::Unseen => "unseen",
            Self::Both => "both",
        }
    }

    /// The split of that name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|split| split.name() == name)
    }

    /// The split of the episode of `seed`.
    pub fn of_seed(seed: u64) -> Self {
        if seed < Self::FIRST_UNSEEN { Self::Seen } else { Self::Unseen }
    }

    /// Whether the episode of `seed` is part of it.
    pub fn contains(self, seed: u64) -> bool {
        self == Self::Both || self == Self::of_seed(seed)
    }

    /// The seed of episode `index`. Both splits take turns, seen first.
    pub fn seed(self, index: u64) -> u64 {
        match self {
            Self::Seen => index,
            Self::Unseen => Self::FIRST_UNSEEN.saturating_add(index),
            Self::Both => index / 2 + (index % 2) * Self::FIRST_UNSEEN,
        }
    }

    /// Its part of all specimens. The last quarter (at least one) is unseen; a single specimen
    /// belongs to both splits.
    pub fn of_specimens(self, all: &[SpecimenSource]) -> &[SpecimenSource] {
        let unseen = if all.len() < 2 { 0 } else { all.len().div_ceil(4) };
        match self {
            Self::Seen => &all[..all.len() - unseen],
            Self::Unseen if unseen > 0 => &all[all.len() - unseen..],
            Self::Unseen | Self::Both => all,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn splits_share_no_seed_and_no_specimen() {
        for count in 2..20 {
            let all: Vec<SpecimenSource> = (0..count).map(|k| SpecimenSource::phantom("phantom-a", k)).collect();
            let (seen, unseen) = (Split::Seen.of_specimens(&all), Split::Unseen.of_specimens(&all));
            assert!(!seen.is_empty() && !unseen.is_empty() && seen.iter().all(|s| !unseen.contains(s)), "{count}");
            assert_eq!(seen.len() + unseen.len(), all.len());
        }
        let eight: Vec<SpecimenSource> = (1..=8).map(|k| SpecimenSource::phantom("phantom-a", k)).collect();
        assert_eq!(Split::Unseen.of_specimens(&eight), &eight[6..]);
        let one = &eight[..1];
        assert_eq!((Split::Seen.of_specimens(one), Split::Unseen.of_specimens(one)), (one, one));
        for index in [0, 1, 999_999] {
            for split in [Split::Seen, Split::Unseen] {
                assert_eq!(Split::of_seed(split.seed(index)), split);
            }
        }
        assert_eq!([0, 1, 2, 3].map(|k| Split::Both.seed(k)), [0, 1_000_000, 1, 1_000_001]);
    }
}
