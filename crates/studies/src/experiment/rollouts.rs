//! The paper's rollouts (Fig. 6(d, e)): 140 episodes of six controllers, as a campaign that
//! resumes.

use crate::names::SceneChoice;
use crate::study::{Job, Kind, Study};
use crate::{Error, Result};
use clap::Args;
use serde::Serialize;
use trocar_campaign::{Campaign, CampaignResult, EpisodeRecord, Manifest, PolicyRow, PolicySpec, lift_and_rcm, lifts};
use trocar_core::median;
use trocar_report::document::{Document, Section, Table};
use trocar_report::page::{self, Card};
use trocar_report::table::{count, fixed, or_dash};
use trocar_scene::{Split, VariationSet};
use trocar_task::Warnings;
use trocar_task::policy::POLICIES;

/// The page of the study, beside the page of the campaign.
const PAGE: &str = "rollouts.html";

/// RCM deviation at which the paper's hardware stops (mm).
const ABORT_MM: f64 = 5.0;

/// The paper's threshold of the RCM deviation (mm).
const THRESHOLD_MM: f64 = 3.0;

/// Fig. 6(d, e): 140 rollouts of six controllers; resumable, safe to interrupt at any time.
#[derive(Clone, Debug, Args)]
pub struct RolloutsExperiment {
    /// The scene.
    #[command(flatten)]
    pub scene: SceneChoice,
    /// Rollouts of all six controllers together. If they cannot be divided by six, the first
    /// controllers run one more.
    #[arg(long, default_value_t = 140)]
    pub rollouts: usize,
    /// Seed of the first rollout of each controller; each further rollout has the next seed.
    #[arg(long, visible_alias = "first-seed", default_value_t = 0)]
    pub seed: u64,
    /// Rollouts in parallel; as many as the machine has cores by default. The result does not
    /// depend on it.
    #[arg(long, default_value_t = 0)]
    pub jobs: usize,
}

/// The paper's figures of its 140 rollouts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PaperRollouts {
    /// Rollouts.
    pub rollouts: usize,
    /// Rollouts that attached the appendix.
    pub attached: usize,
    /// Of these, those that held it to the end.
    pub held_to_end: usize,
    /// Median lift of the attached rollouts (mm).
    pub lift_median_mm: f64,
    /// Median of the peak RCM deviations of the attached rollouts (mm).
    pub rcm_peak_median_mm: f64,
    /// Attached rollouts with RCM deviations of at most 3 mm.
    pub rcm_within_3_mm: usize,
    /// Attached rollouts with RCM deviations of at most 5 mm.
    pub rcm_within_5_mm: usize,
}

/// Fig. 6(d, e).
const PAPER: PaperRollouts = PaperRollouts {
    rollouts: 140,
    attached: 84,
    held_to_end: 83,
    lift_median_mm: 12.2,
    rcm_peak_median_mm: 0.12,
    rcm_within_3_mm: 79,
    rcm_within_5_mm: 84,
};

/// A grasp that did not last to the end of its rollout.
#[derive(Clone, Debug, Serialize)]
pub struct LostGrasp {
    /// The controller.
    pub policy: String,
    /// The seed of the rollout.
    pub seed: u64,
    /// How it ended.
    pub why: String,
}

/// Figures of the study.
#[derive(Clone, Debug, Serialize)]
pub struct RolloutsResult {
    /// The scene.
    pub scene: String,
    /// Finished rollouts.
    pub rollouts: usize,
    /// Rollouts that attached the organ of the task.
    pub attached: usize,
    /// Of these, those that held it to the end.
    pub held_to_end: usize,
    /// The others of these.
    pub lost: Vec<LostGrasp>,
    /// Rollouts whose tissue or arms diverged.
    pub diverged: usize,
    /// Rollouts that passed all stages.
    pub passed: usize,
    /// Median over the attached rollouts of the largest lift (mm); none without any.
    pub lift_median_mm: Option<f64>,
    /// Median over the attached rollouts of the largest RCM deviation of any arm in any physics
    /// step (mm). The paper's figure is also one of peaks.
    pub rcm_peak_median_mm: Option<f64>,
    /// Median over the attached rollouts of the grasping arm's median RCM deviation under load
    /// (mm).
    pub rcm_loaded_median_mm: Option<f64>,
    /// Attached rollouts with RCM deviations of at most 3 mm, of any arm in any physics step.
    pub rcm_within_3_mm: usize,
    /// The same with at most 5 mm.
    pub rcm_within_5_mm: usize,
    /// Largest number of inverted elements in any frame.
    pub inverted_peak: usize,
    /// What was beyond what tissue withstands, in all rollouts.
    pub warnings: Warnings,
    /// How often a rule switched physics off: never, since none does.
    pub suspensions: usize,
    /// Rows of the controllers.
    pub by_policy: Vec<PolicyRow>,
    /// The paper's figures.
    pub paper: PaperRollouts,
    /// Hash of all final states.
    pub hash: String,
    /// Path of the campaign's page, with the failures.
    pub campaign: String,
    /// Path of the page of the study.
    pub report: String,
}

impl Study for RolloutsExperiment {
    const NAME: &'static str = "rollouts";
    const KIND: Kind = Kind::Experiment;
    const FOLDER: Option<&'static str> = Some("Campaign folder: a new one, or one of an earlier run to resume.");
    const WRITES_OWN_FILES: bool = true;
    const SCHEMA: u32 = 2;
    type Figures = RolloutsResult;

    fn run(&self, job: &Job<'_>) -> Result<(RolloutsResult, Document)> {
        if self.rollouts == 0 {
            return Err(Error::Mismatch("--rollouts 0: must be at least 1; the paper has 140".to_owned()));
        }
        let campaign = campaign(&self.scene, self.rollouts, self.seed, self.jobs)?;
        let (store, manifest, by) = campaign.run_episodes(job.output(), Some(self.rollouts), job.progress)?;
        let (made, records) = (store.write_results(&manifest, &by)?, store.records(&manifest)?);
        let page = job.output().join(PAGE);
        let result = RolloutsResult::of(made, &records, page.display().to_string());
        let document = document(&manifest, &result, &records)?;
        store.write(PAGE, document.page().as_bytes())?;
        let text = serde_json::to_vec_pretty(&result).map_err(|e| Error::Format(e.to_string()))?;
        store.write("rollouts.json", &text)?;
        Ok((result, document))
    }
}

/// The campaign of the six controllers without variation: `rollouts` in all, from `seed` on, `jobs`
/// at once.
pub(super) fn campaign(scene: &SceneChoice, rollouts: usize, seed: u64, jobs: usize) -> Result<Campaign> {
    Ok(Campaign {
        scene: scene.scene.clone(),
        policies: POLICIES.iter().map(|name| PolicySpec::parse(name)).collect::<std::result::Result<_, _>>()?,
        episodes: rollouts.div_ceil(POLICIES.len()),
        split: Split::Seen,
        seed,
        tissue: None,
        variation: Some(VariationSet::None),
        backend: None,
        cell_mm: None,
        by: Vec::new(),
        jobs,
        retry_failed: false,
        surfaces: false,
        phantoms: scene.phantoms.clone(),
    })
}

impl LostGrasp {
    fn of(record: &EpisodeRecord) -> Self {
        let policy = record.name.clone();
        let why = record.summary.why.clone().unwrap_or_else(|| "after all stages had passed".to_owned());
        Self { policy, seed: record.seed, why }
    }
}

impl RolloutsResult {
    fn of(made: CampaignResult, records: &[EpisodeRecord], report: String) -> Self {
        let attached: Vec<&EpisodeRecord> = records.iter().filter(|k| k.summary.attached).collect();
        let within = |mm: f64| attached.iter().filter(|k| k.summary.rcm_peak_mm <= mm).count();
        Self {
            scene: made.scene,
            rollouts: records.len(),
            attached: attached.len(),
            held_to_end: attached.iter().filter(|k| k.summary.held_to_end).count(),
            lost: attached.iter().filter(|k| !k.summary.held_to_end).map(|k| LostGrasp::of(k)).collect(),
            diverged: records.iter().filter(|k| k.summary.diverged).count(),
            passed: made.passed,
            lift_median_mm: median(attached.iter().filter_map(|k| k.summary.lift_mm).collect::<Vec<_>>()),
            rcm_peak_median_mm: median(attached.iter().map(|k| k.summary.rcm_peak_mm).collect::<Vec<_>>()),
            rcm_loaded_median_mm: median(attached.iter().filter_map(|k| k.loaded_rcm_mm()).collect::<Vec<_>>()),
            rcm_within_3_mm: within(THRESHOLD_MM),
            rcm_within_5_mm: within(ABORT_MM),
            inverted_peak: records.iter().map(|k| k.summary.inverted_peak).max().unwrap_or(0),
            warnings: made.warnings,
            suspensions: made.suspensions,
            by_policy: made.policies,
            paper: PAPER,
            hash: made.hash,
            campaign: made.report,
            report,
        }
    }
}

fn document(manifest: &Manifest, r: &RolloutsResult, records: &[EpisodeRecord]) -> Result<Document> {
    let lead = format!(
        "{} rollouts of {} by {} controllers, seeds from {}. The paper\u{2019}s 140 are by six other controllers: \
         compare shares of the attached rollouts.",
        r.rollouts,
        page::escape(&r.scene),
        manifest.policies.len(),
        manifest.seed
    );
    let cards = [
        Card::new("Held to the end", format!("{} of {}", r.held_to_end, r.attached), "of the attached; paper 83 of 84")
            .met(r.held_to_end == r.attached),
        Card::new("Diverged", count(r.diverged), "of all rollouts").met(r.diverged == 0),
        Card::new("Inverted elements", count(r.inverted_peak), "largest number in any frame").met(r.inverted_peak == 0),
        Card::new("Passed", format!("{} of {}", r.passed, r.rollouts), "all stages"),
        Card::new("Warnings", r.warnings.to_string(), Warnings::LEGEND).met(r.warnings.is_empty()),
    ];
    let outcome = Section::new("Outcome", lead).cards(cards).table(beside_paper(r));
    let outcome = if r.lost.is_empty() { outcome } else { outcome.table(lost(&r.lost)) };
    let spread = Section::new("Lift and RCM deviation", "All rollouts that attached the organ.")
        .figures([lift_and_rcm(manifest, records)?, lifts(manifest, records)?]);
    let by_controller = Section::new("Controllers", "").table(controllers(&r.by_policy));
    let subtitle = "Lift and RCM deviation of six controllers, beside the paper's Fig. 6(d, e)";
    Ok(Document::new("Rollouts", subtitle).with(outcome).with(spread).with(by_controller))
}

fn beside_paper(r: &RolloutsResult) -> Table {
    let p = &r.paper;
    let of = |n: usize, all: usize| format!("{n} of {all}");
    let row = |what: &str, here: String, paper: String| vec![what.to_owned(), here, paper];
    let rows = vec![
        row("Attached", of(r.attached, r.rollouts), of(p.attached, p.rollouts)),
        row("Held to the end", of(r.held_to_end, r.attached), of(p.held_to_end, p.attached)),
        row("Lift, median (mm)", or_dash(r.lift_median_mm, 1), fixed(p.lift_median_mm, 1)),
        row("Peak RCM deviation, median (mm)", or_dash(r.rcm_peak_median_mm, 3), fixed(p.rcm_peak_median_mm, 2)),
        row("RCM deviation under load, median of medians (mm)", or_dash(r.rcm_loaded_median_mm, 4), or_dash(None, 0)),
        row("RCM within 3 mm", of(r.rcm_within_3_mm, r.attached), of(p.rcm_within_3_mm, p.attached)),
        row("RCM within 5 mm", of(r.rcm_within_5_mm, r.attached), of(p.rcm_within_5_mm, p.attached)),
    ];
    Table::new(["", "here", "paper"], rows)
}

fn lost(rows: &[LostGrasp]) -> Table {
    Table::of(
        rows,
        &[
            ("grasp lost by", &|lost| lost.policy.clone()),
            ("seed", &|lost| lost.seed.to_string()),
            ("how it ended", &|lost| lost.why.clone()),
        ],
    )
}

fn controllers(rows: &[PolicyRow]) -> Table {
    Table::of(
        rows,
        &[
            ("controller", &|p| p.policy.clone()),
            ("rollouts", &|p| count(p.episodes)),
            ("passed", &|p| count(p.passed)),
            ("attached", &|p| count(p.attached)),
            ("held", &|p| count(p.held_to_end)),
            ("lift (mm)", &|p| or_dash(p.lift_median_mm, 1)),
            ("RCM, loaded median (mm)", &|p| or_dash(p.rcm_median_mm, 4)),
            ("RCM, max. (mm)", &|p| or_dash(p.rcm_max_mm, 3)),
            ("diverged", &|p| count(p.ends.diverged)),
        ],
    )
}
