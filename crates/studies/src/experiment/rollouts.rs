//! The paper's rollouts made anew (Fig. 6(d, e)): 140 episodes of six controllers, as a campaign that goes on where it was left.

use crate::{Error, Result, pages};
use serde::Serialize;
use std::path::{Path, PathBuf};
use trocar_campaign::CampaignResult;
use trocar_campaign::{Campaign, Kept, PolicyRow, PolicySpec, median};
use trocar_core::Progress;
use trocar_task::policy::POLICIES;

/// The page that stands beside the campaign's own.
const PAGE: &str = "rollouts.html";

/// Beyond this RCM deviation the paper's hardware stops [mm].
const ABORT_MM: f64 = 5.0;

/// The paper's threshold for RCM deviations [mm].
const THRESHOLD_MM: f64 = 3.0;

/// The experiment's options.
#[derive(Clone, Debug)]
pub struct RolloutsExperiment {
    /// Scene file or built-in scene.
    pub scene: String,
    /// Folder in which a scene's phantom is recorded and reconstructed; what is there is used again.
    pub phantoms: PathBuf,
    /// Rollouts of all controllers together; the first controllers have one more where it does not divide.
    pub rollouts: usize,
    /// Seed of each controller's first; the next have the next.
    pub seed: u64,
    /// Rollouts at once, 0 for as many as the machine has cores. Results do not depend on it.
    pub jobs: usize,
}

/// What the paper says of its 140 rollouts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct PaperRollouts {
    /// Rollouts.
    pub rollouts: usize,
    /// Of these, those that attached the appendix.
    pub attached: usize,
    /// Of these, those that held it to the end.
    pub held_to_end: usize,
    /// Median lift of the attached [mm].
    pub lift_median_mm: f64,
    /// Median of their peak RCM deviations [mm].
    pub rcm_peak_median_mm: f64,
    /// Attached rollouts whose RCM deviation stayed within 3 mm.
    pub rcm_within_3_mm: usize,
    /// And within 5 mm.
    pub rcm_within_5_mm: usize,
}

/// Fig. 6(d, e).
pub(crate) const PAPER: PaperRollouts = PaperRollouts {
    rollouts: 140,
    attached: 84,
    held_to_end: 83,
    lift_median_mm: 12.2,
    rcm_peak_median_mm: 0.12,
    rcm_within_3_mm: 79,
    rcm_within_5_mm: 84,
};

/// The experiment's outcome.
#[derive(Clone, Debug, Serialize)]
pub struct RolloutsResult {
    /// The scene.
    pub scene: String,
    /// Rollouts that are kept.
    pub rollouts: usize,
    /// Those that attached the task's organ.
    pub attached: usize,
    /// Of these, those that held it to the end.
    pub held_to_end: usize,
    /// Rollouts whose tissue or arms were lost.
    pub diverged: usize,
    /// Rollouts that passed all stages.
    pub passed: usize,
    /// Median over the attached of the greatest lift [mm]; None without any.
    pub lift_median_mm: Option<f64>,
    /// Median over the attached of the largest RCM deviation of any arm in any physics step [mm], as the paper's is of peaks.
    pub rcm_peak_median_mm: Option<f64>,
    /// Median over the attached of the grasping arm's median RCM deviation under load [mm].
    pub rcm_loaded_median_mm: Option<f64>,
    /// Attached rollouts in which no arm's RCM deviation was beyond 3 mm in any physics step.
    pub rcm_within_3_mm: usize,
    /// And beyond 5 mm.
    pub rcm_within_5_mm: usize,
    /// Most inverted elements in any frame.
    pub inverted_peak: usize,
    /// Suspensions of physics in all rollouts: contacts disabled, contacts of blades disabled, organs relaxed.
    pub suspensions: [usize; 3],
    /// Controller by controller.
    pub by_policy: Vec<PolicyRow>,
    /// What the paper says.
    pub paper: PaperRollouts,
    /// One hash over all final states.
    pub hash: String,
    /// The campaign's page, with the failures.
    pub campaign: String,
    /// The page beside the paper.
    pub report: String,
}

impl RolloutsExperiment {
    /// Runs what is missing in the campaign folder `output`, then writes the pages there.
    ///
    /// # Errors
    /// As [`Campaign::run`]; no rollouts.
    pub fn run(&self, output: &Path, progress: &dyn Progress) -> Result<RolloutsResult> {
        if self.rollouts == 0 {
            return Err(Error::Mismatch("--rollouts 0: 1 or more are to be run; the paper has 140".to_owned()));
        }
        let campaign = Campaign {
            scene: self.scene.clone(),
            policies: POLICIES.iter().map(|name| PolicySpec::parse(name)).collect::<std::result::Result<_, _>>()?,
            episodes: self.rollouts.div_ceil(POLICIES.len()),
            seed: self.seed,
            jobs: self.jobs,
            retry_failed: false,
            phantoms: self.phantoms.clone(),
        };
        let (store, plan) = campaign.keep(output, Some(self.rollouts), progress)?;
        let (made, kept) = (store.finish(&plan)?, store.kept(&plan)?);
        let page = output.join(PAGE);
        let result = RolloutsResult::of(made, &kept, page.display().to_string());
        store.write(PAGE, pages::rollouts(&plan, &result, &kept)?.as_bytes())?;
        let text = serde_json::to_vec_pretty(&result).map_err(|e| Error::Format(e.to_string()))?;
        store.write("rollouts.json", &text)?;
        Ok(result)
    }
}

impl RolloutsResult {
    fn of(made: CampaignResult, kept: &[Kept], report: String) -> Self {
        let attached: Vec<&Kept> = kept.iter().filter(|k| k.summary.attached).collect();
        let within = |mm: f64| attached.iter().filter(|k| k.summary.rcm_peak_mm <= mm).count();
        Self {
            scene: made.scene,
            rollouts: kept.len(),
            attached: attached.len(),
            held_to_end: attached.iter().filter(|k| k.summary.held_to_end).count(),
            diverged: kept.iter().filter(|k| k.summary.diverged).count(),
            passed: made.passed,
            lift_median_mm: median(attached.iter().map(|k| k.summary.lift_mm).collect()),
            rcm_peak_median_mm: median(attached.iter().map(|k| k.summary.rcm_peak_mm).collect()),
            rcm_loaded_median_mm: median(attached.iter().filter_map(|k| k.loaded_rcm_mm()).collect()),
            rcm_within_3_mm: within(THRESHOLD_MM),
            rcm_within_5_mm: within(ABORT_MM),
            inverted_peak: kept.iter().map(|k| k.summary.inverted_peak).max().unwrap_or(0),
            suspensions: [
                kept.iter().map(|k| k.summary.disabled_contacts).sum(),
                kept.iter().map(|k| k.summary.disabled_blades).sum(),
                kept.iter().map(|k| k.summary.relaxed).sum(),
            ],
            by_policy: made.policies,
            paper: PAPER,
            hash: made.hash,
            campaign: made.report,
            report,
        }
    }
}
