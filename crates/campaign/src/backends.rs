//! One campaign on several tissue backends: each in a folder of its own, and one page that tells
//! whether they rank policies alike.

use crate::agreement::Agreement;
use crate::campaign::Campaign;
use crate::store::write_whole;
use crate::table::CampaignResult;
use serde::Serialize;
use std::path::Path;
use trocar_core::Progress;
use trocar_report::document::Table;
use trocar_report::page;
use trocar_report::table::{fixed, or_dash};
use trocar_scene::BackendName;
use trocar_workflow::{Error, Result, counted};

/// A campaign on one backend.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct OfBackend {
    /// The backend.
    pub backend: BackendName,
    /// The campaign.
    pub result: CampaignResult,
}

/// A campaign on several backends.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct BackendsResult {
    /// The campaigns, in the order of the backends.
    pub backends: Vec<OfBackend>,
    /// The pairs of backends.
    pub agreements: Vec<Agreement>,
    /// Path of the page.
    pub report: String,
}

impl Campaign {
    /// Runs the campaign on each of `backends`, at most `max_episodes` episodes on each, in the
    /// folder of `output` that has its name. Writes `backends.json` and a page beside them.
    ///
    /// # Errors
    /// As [`run`](Self::run); fewer than two backends, or one twice.
    pub fn run_on(
        &self,
        backends: &[BackendName],
        max_episodes: Option<usize>,
        output: &Path,
        progress: &dyn Progress,
    ) -> Result<BackendsResult> {
        let twice = (1..backends.len()).any(|k| backends[..k].contains(&backends[k]));
        if backends.len() < 2 || twice {
            return Err(Error::Mismatch("--backend: several backends must be given, each once".to_owned()));
        }
        let (mut results, mut records) = (Vec::new(), Vec::new());
        for backend in backends {
            let campaign = Self { backend: Some(*backend), ..self.clone() };
            let (store, manifest, by) = campaign.run_episodes(&output.join(backend.name()), max_episodes, progress)?;
            results.push(OfBackend { backend: *backend, result: store.write_results(&manifest, &by)? });
            records.push((*backend, store.records(&manifest)?));
        }
        let policies: Vec<&str> = self.policies.iter().map(|p| p.name.as_str()).collect();
        let mut agreements = Vec::new();
        for (k, first) in records.iter().enumerate() {
            for second in &records[k + 1..] {
                agreements.push(Agreement::of(&policies, (first.0, &first.1), (second.0, &second.1)));
            }
        }
        let report = output.join("report.html").display().to_string();
        let result = BackendsResult { backends: results, agreements, report };
        let text = serde_json::to_vec_pretty(&result).map_err(|e| Error::Format(e.to_string()))?;
        write_whole(&output.join("backends.json"), &text)?;
        write_whole(&output.join("report.html"), result.page().as_bytes())?;
        Ok(result)
    }
}

impl BackendsResult {
    /// Success of each policy by stage on each backend.
    pub fn policies(&self) -> Table {
        let mut rows = Vec::new();
        let policies = self.backends.first().map_or(0, |of| of.result.policies.len());
        for k in 0..policies {
            for OfBackend { backend, result } in &self.backends {
                let Some(row) = result.policies.get(k) else { continue };
                let stages = row.stages.iter().map(|s| s.passed.to_string()).collect::<Vec<_>>().join(" ");
                rows.push(vec![
                    row.policy.clone(),
                    backend.name().to_owned(),
                    format!("{}/{}", row.passed, row.episodes),
                    row.interval.in_percent(),
                    stages,
                    fixed(row.mean_score, 2),
                    format!("{}/{}", row.held_to_end, row.attached),
                    or_dash(row.lift_median_mm, 1),
                    row.inverted_peak.to_string(),
                    row.ends.diverged.to_string(),
                ]);
            }
        }
        let head =
            ["Policy", "Backend", "Passed", "95%", "By stage", "Score", "Held", "Lift (mm)", "Inverted", "Diverged"];
        Table::new(head, rows)
    }

    /// How well the backends agree.
    pub fn agreement(&self) -> Table {
        let interval = |a: &Agreement| {
            let [low, high] = a.kendall_interval?;
            Some(format!("{} to {}", fixed(low, 2), fixed(high, 2)))
        };
        Table::of(
            &self.agreements,
            &[
                ("Backends", &|a| format!("{}, {}", a.first.name(), a.second.name())),
                ("Kendall's tau", &|a| or_dash(a.kendall_tau, 2)),
                ("95%", &|a| interval(a).unwrap_or_else(|| "-".to_owned())),
                ("Pearson", &|a| or_dash(a.pearson, 2)),
                ("Largest rank violation", &|a| fixed(a.max_rank_violation, 2)),
                ("Seeds that differ", &|a| {
                    let differ: usize = a.policies.iter().map(|c| c.only_a + c.only_b).sum();
                    let all: usize = a.policies.iter().map(|c| c.seeds).sum();
                    format!("{differ} of {all}")
                }),
            ],
        )
    }

    /// Each policy on both backends of each pair.
    pub fn differences(&self) -> Table {
        let mut rows = Vec::new();
        for a in &self.agreements {
            for c in &a.policies {
                rows.push(vec![
                    c.a.clone(),
                    format!("{}, {}", a.first.name(), a.second.name()),
                    c.seeds.to_string(),
                    c.only_a.to_string(),
                    c.only_b.to_string(),
                    fixed(c.p, 3),
                    fixed(c.score_difference, 2),
                ]);
            }
        }
        let head = ["Policy", "Backends", "Seeds", "Only the first passed", "Only the second", "p", "Score difference"];
        Table::new(head, rows)
    }

    fn page(&self) -> String {
        let Some(OfBackend { result, .. }) = self.backends.first() else { return String::new() };
        let subtitle = format!(
            "{} on each backend, split {}, from number {}, variation {}",
            counted(result.planned, "episode"),
            result.variation.split.name(),
            result.seed,
            result.variation.name
        );
        let link = |of: &OfBackend| {
            let name = of.backend.name();
            format!("<a href=\"{name}/report.html\">{name}</a>")
        };
        let links = self.backends.iter().map(link).collect::<Vec<_>>().join(", ");
        let body = page::section(
            "Agreement",
            "Policies are ranked by mean score. The interval draws the seeds anew. A rank violation is the difference of two scores on the first backend that the second ranks the other way round.",
            &self.agreement().html(),
        ) + &page::section(
            "Policies",
            &format!("The campaign on each backend: {links}."),
            &self.policies().html(),
        ) + &page::section(
            "Where they differ",
            "Seeds on which a policy passed on one backend alone; p: McNemar's exact test.",
            &self.differences().html(),
        );
        page::page(&format!("{}: {} on several backends", result.scene, result.task), &subtitle, &body)
    }
}
