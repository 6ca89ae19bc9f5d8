//! `trocar evaluate`.

use crate::cli;
use crate::commands::scene::note_reach;
use crate::output;
use trocar_campaign::{Bin, Campaign, CampaignResult, PolicySpec, Share, repeats};
use trocar_core::Progress;
use trocar_report::document::Table;
use trocar_workflow::{Result, counted};

pub fn run(arguments: &cli::Evaluate, json: bool, progress: &dyn Progress) -> Result<()> {
    let policies = arguments.policies.iter().map(|p| PolicySpec::parse(p)).collect::<Result<_>>()?;
    let campaign = Campaign {
        scene: arguments.scene.clone(),
        policies,
        episodes: arguments.episodes,
        split: arguments.split,
        seed: arguments.seed,
        variation: arguments.variation,
        tissue: arguments.tissue,
        backend: arguments.backends.first().copied(),
        cell_mm: None,
        by: arguments.by.clone(),
        jobs: arguments.jobs,
        retry_failed: arguments.retry_failed,
        surfaces: arguments.surfaces,
        phantoms: arguments.phantoms.clone(),
    };
    note_reach(&arguments.scene);
    if arguments.backends.len() > 1 {
        let result = campaign.run_on(&arguments.backends, None, &arguments.output, progress)?;
        output::print(json, &result, |r| {
            format!("{}\n{}\n{}report {}", r.policies().text(), r.differences().text(), r.agreement().text(), r.report)
        });
        return Ok(());
    }
    let result = campaign.run(&arguments.output, progress)?;
    if let Some(why) = repeats(result.distinct_outcomes, result.episodes) {
        eprintln!("warning: {why}");
    }
    output::print(json, &result, |r| if arguments.by.is_empty() { text(r, "") } else { text(r, &curves(r)) });
    Ok(())
}

/// Success by the factors of `--by`.
fn curves(r: &CampaignResult) -> String {
    let mut lines = String::new();
    for curve in &r.by {
        let Some(first) = curve.bins.first() else { continue };
        let header = std::iter::once(curve.label.as_str()).chain(first.policies.iter().map(|s| s.policy.as_str()));
        let said = |s: &Share| {
            format!("{}/{} ({:.0}-{:.0}%)", s.passed, s.episodes, 1e2 * s.interval.low, 1e2 * s.interval.high)
        };
        let row = |bin: &Bin| std::iter::once(bin.value.clone()).chain(bin.policies.iter().map(said)).collect();
        lines += &Table::new(header, curve.bins.iter().map(row).collect()).text();
    }
    lines
}

fn text(r: &CampaignResult, curves: &str) -> String {
    let or_dash = |v: Option<f64>, decimals: usize| v.map_or("-".to_owned(), |v| format!("{v:.decimals$}"));
    let table = Table::of(
        &r.policies,
        &[
            ("policy", &|p| p.policy.clone()),
            ("passed", &|p| format!("{}/{}", p.passed, p.episodes)),
            ("95%", &|p| format!("{:.0}-{:.0}%", 1e2 * p.interval.low, 1e2 * p.interval.high)),
            ("by stage", &|p| p.stages.iter().map(|s| s.passed.to_string()).collect::<Vec<_>>().join(" ")),
            ("score", &|p| format!("{:.2}", p.mean_score)),
            ("held", &|p| if p.attached > 0 { format!("{}/{}", p.held_to_end, p.attached) } else { "-".to_owned() }),
            ("lift (mm)", &|p| or_dash(p.lift_median_mm, 1)),
            ("RCM (mm)", &|p| or_dash(p.rcm_median_mm, 3)),
            ("max (mm)", &|p| or_dash(p.rcm_max_mm, 3)),
            ("diverged", &|p| p.ends.diverged.to_string()),
            ("failed", &|p| p.ends.policy_error.to_string()),
            ("warnings", &|p| p.warnings.to_string()),
        ],
    );
    let stages = r
        .policies
        .first()
        .map_or_else(String::new, |p| p.stages.iter().map(|s| s.stage.as_str()).collect::<Vec<_>>().join(", "));
    let failed: String = r
        .policies
        .iter()
        .filter_map(|p| Some((p, p.policy_error.as_ref()?)))
        .map(|(p, why)| {
            let episodes = counted(p.episodes, "episode");
            format!("{}: the policy failed in {} of {episodes}; the first: {why}\n", p.policy, p.ends.policy_error)
        })
        .collect();
    let again = if failed.is_empty() { "" } else { "--retry-failed runs them again\n" };
    format!(
        "{}, {}: {} of {}, split {}, from number {}, variation {}; {} distinct; stages: {stages}\n{}\n{curves}{failed}{again}states {}\nreport {}",
        r.scene,
        r.task,
        r.episodes,
        counted(r.planned, "episode"),
        r.variation.split.name(),
        r.seed,
        r.variation.name,
        r.distinct_outcomes,
        table.text().trim_end(),
        r.hash,
        r.report
    )
}
