//! The page of a campaign: outcome, failures, policies, stages, distributions, gates and pairs of
//! policies.

use crate::bars;
use crate::manifest::Manifest;
use crate::outcomes::repeats;
use crate::plots;
use crate::store::{EpisodeRecord, Store};
use crate::table::{CampaignResult, PolicyRow};
use crate::variation_page;
use crate::videos;
use trocar_report::document::Table;
use trocar_report::figures;
use trocar_report::page::{self, Card, Columns};
use trocar_report::table::{fixed, or_dash};
use trocar_task::Warnings;
use trocar_workflow::{Result, counted};

/// Maximum number of failures in the list.
const MAX_LISTED: usize = 40;

/// The page of a campaign.
pub(crate) fn campaign(
    manifest: &Manifest,
    result: &CampaignResult,
    records: &[EpisodeRecord],
    store: &Store,
) -> Result<String> {
    let title = format!("{}: {}", manifest.scene, manifest.task);
    let failed: usize = result.policies.iter().map(|p| p.ends.policy_error).sum();
    let again = match failed {
        0 => String::new(),
        1 => "; in one the policy failed, and --retry-failed runs it again".to_owned(),
        n => format!("; in {n} the policy failed, and --retry-failed runs them again"),
    };
    let subtitle = format!(
        "Campaign of {}, split {}, from number {}, variation {}{again}",
        counted(result.episodes, "episode"),
        manifest.split.name(),
        manifest.seed,
        manifest.variation.set.name()
    );
    Ok(page::page(&title, &subtitle, &body(manifest, result, records, store)?))
}

fn body(manifest: &Manifest, r: &CampaignResult, records: &[EpisodeRecord], store: &Store) -> Result<String> {
    if records.is_empty() {
        return Ok(page::section("No episodes", "No episode has finished yet.", ""));
    }
    let failed = failures(manifest, records, store)?;
    let lead = format!(
        "{} of {} of {} by {}. {}Intervals: Wilson, 95%.",
        r.episodes,
        counted(r.planned, "episode"),
        manifest.task,
        r.policies.iter().map(|p| page::escape(&p.policy)).collect::<Vec<_>>().join(", "),
        if r.policies.len() > 1 { "All policies have the same seeds. " } else { "" }
    );
    let warning =
        repeats(r.distinct_outcomes, r.episodes).map_or_else(String::new, |why| page::warning(&sentence(&why)));
    let overview = page::section("Outcome", &lead, &(warning + &cards(manifest, r)));
    let varied = variation_page::varied(manifest, r, records);
    let curves = variation_page::curves(r)?;
    let policies = page::section("Policies", "", &outcome(r));
    let stages = page::section(
        "Stages",
        "Stages pass in order. Each counts the episodes that passed it and all stages before it.",
        &(page::figure(
            &bars::stages(r),
            "<b>Passed stages.</b> Filled: share of episodes that passed. Whiskers: 95% intervals.",
        ) + &stage_table(r)),
    );
    let spread = page::section(
        "Distributions",
        "Share of episodes at or below a value. Contact force acts from tissue on the instrument. The pull of held tissue is a constraint force and not part of it.",
        &page::grid(Columns::Two, &plots::distributions(manifest, records)?),
    );
    let gates = page::section(
        "Gates",
        "Stored channels scored at other gates, without simulation. An episode ends when it passes the scene\u{2019}s gates, so a stricter gate may miss what would have followed.",
        &page::grid(Columns::Two, &plots::sweeps(manifest, records, store)?),
    );
    let episodes = variation_page::episodes(records);
    Ok([
        overview,
        varied,
        curves,
        failed,
        successes(manifest, records, store),
        policies,
        stages,
        spread,
        gates,
        pairs(r),
        episodes,
    ]
    .concat())
}

fn sentence(words: &str) -> String {
    let mut letters = words.chars();
    letters.next().map_or_else(String::new, |first| format!("{}{}.", first.to_uppercase(), letters.as_str()))
}

fn cards(manifest: &Manifest, r: &CampaignResult) -> String {
    let mut all: Vec<Card> = Vec::new();
    if let [only] = r.policies.as_slice() {
        all.push(Card::new("Passed", format!("{} of {}", only.passed, only.episodes), only.interval.in_percent()));
    // The reverse makes the first of equals win.
    } else if let Some(best) = r.policies.iter().rev().max_by(|a, b| a.mean_score.total_cmp(&b.mean_score)) {
        let note = format!("passed {} of {}", best.passed, best.episodes);
        all.push(Card::new("Best mean score", format!("{}: {}", best.policy, fixed(best.mean_score, 2)), note));
    }
    let attached: usize = r.policies.iter().map(|p| p.attached).sum();
    let held: usize = r.policies.iter().map(|p| p.held_to_end).sum();
    if attached > 0 {
        let note = "of the episodes with a grasp";
        all.push(Card::new("Held to the end", format!("{held} of {attached}"), note));
        let within: usize = r.policies.iter().map(|p| p.rcm_within).sum();
        all.push(Card::new(
            "RCM within the threshold",
            format!("{within} of {attached}"),
            format!("largest deviation at most {} mm, of the episodes with a grasp", manifest.rcm_threshold_mm),
        ));
    }
    let note = "differ from each other by more than 0.01 mm, 0.001 N or one control period";
    let distinct = Card::new("Distinct outcomes", format!("{} of {}", r.distinct_outcomes, r.episodes), note);
    all.push(distinct.met(r.distinct_outcomes == r.episodes));
    let inverted = r.policies.iter().map(|p| p.inverted_peak).max().unwrap_or(0);
    let diverged: usize = r.policies.iter().map(|p| p.ends.diverged).sum();
    all.push(Card::new("Inverted elements", inverted.to_string(), "maximum of any frame").met(inverted == 0));
    all.push(Card::new("Diverged", diverged.to_string(), "episodes").met(diverged == 0));
    all.push(Card::new("Warnings", r.warnings.to_string(), Warnings::LEGEND).met(r.warnings.is_empty()));
    page::cards(&all)
}

fn outcome(r: &CampaignResult) -> String {
    let at = |[m, l, h]: [f64; 3]| format!("{m:.2} ({l:.2}\u{2013}{h:.2})");
    let dash = || "\u{2013}".to_owned();
    let table = Table::of(
        &r.policies,
        &[
            ("policy", &|p| p.policy.clone()),
            ("episodes", &|p| p.episodes.to_string()),
            ("distinct", &|p| p.distinct_outcomes.to_string()),
            ("passed", &|p| format!("{}, {}", p.passed, p.interval.in_percent())),
            ("mean score", &|p| fixed(p.mean_score, 2)),
            ("not passed in time", &|p| (p.ends.time_out + p.ends.finished + p.ends.aborted).to_string()),
            ("RCM abort", &|p| p.ends.rcm_abort.to_string()),
            ("diverged", &|p| p.ends.diverged.to_string()),
            ("policy failed", &|p| p.ends.policy_error.to_string()),
            ("attached", &|p| p.attached.to_string()),
            ("held", &|p| if p.attached > 0 { p.held_to_end.to_string() } else { dash() }),
            ("lift (mm)", &|p| or_dash(p.lift_median_mm, 1)),
            ("RCM under load, median (mm)", &|p| or_dash(p.rcm_median_mm, 3)),
            ("RCM, max (mm)", &|p| or_dash(p.rcm_max_mm, 3)),
            ("lag (ms)", &|p| or_dash(p.lag_ms, 0)),
            ("jaw force (N)", &|p| or_dash(p.peak_jaw_n, 2)),
            ("grasp at s", &|p| p.grasp_at.map_or_else(dash, at)),
            ("warnings", &|p| p.warnings.to_string()),
        ],
    );
    table.html()
}

fn failures(manifest: &Manifest, records: &[EpisodeRecord], store: &Store) -> Result<String> {
    let failed = videos::failures(manifest, records);
    if failed.is_empty() {
        return Ok(page::section("Failures", "There were none.", ""));
    }
    let stopped = |k: &EpisodeRecord| format!("stopped at {}: {}", k.summary.next, k.why());
    let videos: Vec<String> = failed.iter().filter_map(|k| video(store, k, &stopped(k))).collect();
    let table = Table::of(
        failed.iter().take(MAX_LISTED),
        &[
            ("policy", &|k| k.name.clone()),
            ("seed", &|k| k.seed.to_string()),
            ("stages", &|k| format!("{} of {}", k.summary.stage, k.summary.progress.stages.len())),
            ("stopped at", &|k| k.summary.next.clone()),
            ("score", &|k| fixed(k.summary.score, 2)),
            ("why", &|k| k.why()),
            ("folder", &|k| format!("episodes/{}/{:06}", k.name, k.index)),
        ],
    );
    let lead = format!(
        "{} did not pass{}; lowest scores first, policies in turn. <code>trocar render FOLDER</code> shows one, \
         <code>trocar replay FOLDER --verify</code> verifies it.",
        counted(failed.len(), "episode"),
        if failed.len() > MAX_LISTED { format!("; {MAX_LISTED} are listed") } else { String::new() }
    );
    Ok(page::section("Failures", &lead, &(page::grid(Columns::Two, &videos) + &table.html())))
}

/// The section of successes; empty without a video of one.
fn successes(manifest: &Manifest, records: &[EpisodeRecord], store: &Store) -> String {
    let passed = |k: &EpisodeRecord| {
        let held = k.summary.slip_mm.map_or(String::new(), |mm| format!(", slip {} mm", fixed(mm, 1)));
        format!("passed after {} s{held}", fixed(k.summary.duration_s, 1))
    };
    let videos: Vec<String> =
        videos::successes(manifest, records).into_iter().filter_map(|k| video(store, k, &passed(k))).collect();
    if videos.is_empty() {
        return String::new();
    }
    page::section("Successes", "First seeds first, policies in turn.", &page::grid(Columns::Two, &videos))
}

/// The video of an episode with its `caption`; `None` if there is no video.
fn video(store: &Store, k: &EpisodeRecord, caption: &str) -> Option<String> {
    let bytes = std::fs::read(videos::path(store, k)).ok()?;
    let [width, height] = videos::SIZE;
    let name = format!("{} with seed {}", k.name, k.seed);
    let img = figures::img_of_bytes("webp", &bytes, width, height, &name);
    Some(page::figure(&img, &format!("<b>{}</b> {}", page::escape(&name), page::escape(caption))))
}

/// Median times at which the stages passed.
fn stage_table(r: &CampaignResult) -> String {
    let Some(first) = r.policies.first() else { return String::new() };
    let head = ["median time (s)"].into_iter().chain(first.stages.iter().map(|s| s.stage.as_str()));
    let row = |p: &PolicyRow| {
        let times = p.stages.iter().map(|s| or_dash(s.median_s, 2));
        [p.policy.clone()].into_iter().chain(times).collect()
    };
    Table::new(head, r.policies.iter().map(row).collect()).html()
}

fn pairs(r: &CampaignResult) -> String {
    if r.comparisons.is_empty() {
        return String::new();
    }
    let table = Table::of(
        &r.comparisons,
        &[
            ("policies", &|c| format!("{} against {}", c.a, c.b)),
            ("seeds", &|c| c.seeds.to_string()),
            ("only the first passed", &|c| c.only_a.to_string()),
            ("only the second passed", &|c| c.only_b.to_string()),
            ("p (McNemar)", &|c| if c.p < 1e-3 { "< 0.001".to_owned() } else { fixed(c.p, 3) }),
            ("difference of mean scores", &|c| format!("{:+.2}", c.score_difference)),
        ],
    );
    let lead = "Policies on the same seeds, so that differences between seeds cancel. p: probability of a split at least as uneven by chance.";
    page::section("Policies in pairs", lead, &table.html())
}
