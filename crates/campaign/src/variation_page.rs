//! The sections of a campaign's page on variation: the factors, success by factor, and the drawn
//! values of every episode.

use crate::curves::{Curve, significant};
use crate::drawn_result::words;
use crate::manifest::Manifest;
use crate::plots;
use crate::store::EpisodeRecord;
use crate::table::CampaignResult;
use std::collections::BTreeMap;
use trocar_report::document::Table;
use trocar_report::page::{self, Columns};
use trocar_report::table::yes_or_no;
use trocar_scene::{Split, VariationSet};
use trocar_workflow::{Result, counted};

/// Maximum number of episodes in the table.
const MAX_LISTED: usize = 400;

/// The varied factors and their ranges.
pub(super) fn varied(manifest: &Manifest, r: &CampaignResult, records: &[EpisodeRecord]) -> String {
    let factors = manifest.variation.all_factors();
    let drawn: Vec<_> = records.iter().filter_map(|k| k.summary.drawn.as_ref()).collect();
    let mut specimens: BTreeMap<(usize, String), usize> = BTreeMap::new();
    for drawn in &drawn {
        let label = drawn.specimen.label();
        *specimens.entry((label.len(), label)).or_default() += 1;
    }
    let listed: Vec<String> = specimens.iter().map(|((_, label), n)| format!("{label} ({n})")).collect();
    let mut rows = vec![vec![
        "specimen".to_owned(),
        "The anatomy, with the number of its episodes.".to_owned(),
        if specimens.len() > 1 { "each as likely" } else { "the same" }.to_owned(),
        listed.join(", "),
    ]];
    for (factor, distribution) in &factors {
        let values = || drawn.iter().flat_map(|d| &d.values).filter(|v| v.factor == *factor).map(|v| v.value);
        let Some(low) = values().reduce(f64::min) else { continue };
        let high = values().reduce(f64::max).unwrap_or(low);
        rows.push(vec![
            factor.name().to_owned(),
            factor.about().to_owned(),
            words(distribution),
            format!("{} to {}", significant(low, 3), significant(high, 3)),
        ]);
    }
    let set = match manifest.variation.set {
        VariationSet::None => "What the scene itself names varies".to_owned(),
        set => format!("The set {} varies, and what the scene itself names", set.name()),
    };
    let split = match manifest.split {
        Split::Seen => format!(
            "Episodes are seen ones: seeds below {}, without the last quarter of the specimens.",
            Split::FIRST_UNSEEN
        ),
        Split::Unseen => format!(
            "Episodes are unseen ones: seeds from {} on, with the last quarter of the specimens.",
            Split::FIRST_UNSEEN
        ),
        Split::Both => "Seen and unseen episodes take turns.".to_owned(),
    };
    let names = ["factor", "what it is", "distribution", "drawn"];
    let lead =
        format!("{set}, drawn by the seed of each episode ({}). {split}", counted(r.variation.episodes.len(), "seed"));
    page::section("Variation", &lead, &Table::new(names, rows).html())
}

/// Success by factor; empty if nothing varied. A factor with a single bin of episodes is left out:
/// nothing can be compared in it.
pub(super) fn curves(r: &CampaignResult) -> Result<String> {
    let shown: Vec<&Curve> = r.by.iter().filter(|curve| curve.bins.len() > 1).collect();
    if shown.is_empty() {
        return Ok(String::new());
    }
    let mut figures = Vec::new();
    let policies: Vec<&str> = r.policies.iter().map(|p| p.policy.as_str()).collect();
    let (mut wide, mut tables) = (String::new(), String::new());
    for curve in &shown {
        if curve.bins.iter().all(|bin| bin.numbers.is_some()) {
            figures.push(plots::success_over(&policies, curve)?);
        } else {
            wide += &plots::success_by_name(curve);
        }
        tables += &by_value(curve);
    }
    let lead = "Share of episodes that passed, over what was drawn. Numbers are in bins of equally many episodes; a \
                point is at the median of its bin. Whiskers: Wilson, 95%. Several factors vary at once, so a curve is \
                over all values of the others.";
    let body = weakest(r, &shown) + &wide + &page::grid(Columns::Two, &figures) + &page::fold("All values", &tables);
    Ok(page::section("Success by factor", lead, &body))
}

/// For each policy and factor the value with the least success.
fn weakest(r: &CampaignResult, curves: &[&Curve]) -> String {
    let cell = |curve: &Curve, policy: usize| {
        let shares = curve.bins.iter().filter_map(|bin| Some((bin, bin.policies.get(policy)?)));
        // The first of equals.
        let least = shares
            .filter(|(_, s)| s.episodes > 0)
            .reduce(|least, next| if next.1.interval.share < least.1.interval.share { next } else { least });
        least.map_or("\u{2013}".to_owned(), |(bin, s)| format!("{}: {}/{}", bin.value, s.passed, s.episodes))
    };
    let head = ["least success at"].into_iter().chain(r.policies.iter().map(|p| p.policy.as_str()));
    let row = |curve: &&Curve| {
        std::iter::once(curve.label.clone()).chain((0..r.policies.len()).map(|k| cell(curve, k))).collect::<Vec<_>>()
    };
    Table::new(head, curves.iter().map(row).collect()).html()
}

fn by_value(curve: &Curve) -> String {
    let Some(first) = curve.bins.first() else { return String::new() };
    let names = first.policies.iter().map(|s| s.policy.as_str());
    let head = std::iter::once(curve.label.as_str()).chain(names);
    let row = |bin: &crate::curves::Bin| {
        let cells = bin.policies.iter().map(|s| format!("{}/{}, {}", s.passed, s.episodes, s.interval.in_percent()));
        std::iter::once(bin.value.clone()).chain(cells).collect::<Vec<_>>()
    };
    Table::new(head, curve.bins.iter().map(row).collect()).html()
}

/// Every episode with its drawn values, folded.
pub(super) fn episodes(records: &[EpisodeRecord]) -> String {
    let names: Vec<String> = records
        .iter()
        .find_map(|k| k.summary.drawn.as_ref())
        .map_or_else(Vec::new, |drawn| drawn.values.iter().map(|v| v.name()).collect());
    let fixed = ["policy", "seed", "split", "passed", "stages", "end", "warnings", "specimen"];
    let head = fixed.into_iter().chain(names.iter().map(String::as_str));
    let row = |k: &EpisodeRecord| {
        let s = &k.summary;
        let drawn = s.drawn.as_ref();
        let number = |name: &String| {
            let value = drawn.and_then(|d| d.values.iter().find(|v| v.name() == *name));
            value.map_or("\u{2013}".to_owned(), |v| significant(v.value, 3))
        };
        let first = [
            k.name.clone(),
            k.seed.to_string(),
            Split::of_seed(k.seed).name().to_owned(),
            yes_or_no(s.passed),
            format!("{} of {}", s.stage, s.progress.stages.len()),
            if s.passed { "passed".to_owned() } else { k.why() },
            s.warnings.to_string(),
            drawn.map_or("\u{2013}".to_owned(), |d| d.specimen.label()),
        ];
        first.into_iter().chain(names.iter().map(number)).collect::<Vec<_>>()
    };
    let rows: Vec<Vec<String>> = records.iter().take(MAX_LISTED).map(row).collect();
    let note = if records.len() > MAX_LISTED { format!("the first {MAX_LISTED} of ") } else { String::new() };
    let title = format!("{note}{}", counted(records.len(), "episode"));
    let lead = "What was drawn for each episode, and how it ended. Warnings: punctures, instruments that pierced an organ, \
                organs overstretched, organs that stayed folded. <code>table.csv</code> has all figures.";
    page::section("Episodes", lead, &page::fold(&title, &Table::new(head, rows).html()))
}
