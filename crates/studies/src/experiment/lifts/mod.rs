//! Recorded grasp-lifts beside simulated ones (paper section VII, Fig. 7(d,e) and 8(e) to (g)):
//! lifts of a phantom whose tissue is another than the simulated one are measured, reproduced and
//! compared.

mod film;
mod identified;
mod page;
mod result;
mod support;

pub(super) use identified::{identified, organ_of};
pub use result::LiftsResult;

use crate::names::SupportName;
use crate::study::{Job, Kind, Study};
use crate::trials::Outcomes;
use crate::{Error, Result};
use clap::Args;
use glam::DVec3;
use result::{IdentifiedSummary, SimulatedRow, errors, residual, trend};
use support::Support;
use trocar_core::Progress;
use trocar_identify::{Grip, LoneOrgan, Pace, Pull, SeenLift};
use trocar_measure::normalised;
use trocar_phantom::{LiftOptions, RecordOptions, Sensor};
use trocar_recording::Recording;
use trocar_report::document::Document;
use trocar_workflow::measure::{Measured, measure_recording};
use trocar_workflow::phantoms;
use xxhash_rust::xxh3::xxh3_64;

/// Places of the lifts straight up.
const PLACES: [f64; 3] = [0.55, 0.65, 0.75];

/// Displacements of the lifts straight up (m). The paper's line is compared at 15 and 30 mm.
const HEIGHTS: [f64; 4] = [0.0075, 0.015, 0.0225, 0.030];

/// Recorded grasp-lifts of a phantom beside simulated ones: half-drop distance over height, and
/// errors of landmarks over modulus and support.
#[derive(Clone, Debug, Args)]
pub struct LiftsExperiment {
    /// Recorded lifts.
    #[arg(long, default_value_t = 6)]
    pub lifts: usize,
    /// Seed of the anatomy, of the lifts and of the camera noise.
    #[arg(long, default_value_t = 1)]
    pub seed: u64,
    /// What holds the recorded appendix besides its bed.
    #[arg(long = "true-support", value_enum, default_value_t = SupportName::Mesentery)]
    pub true_support: SupportName,
    /// Young's moduli of lifts straight up (kPa).
    #[arg(long, value_delimiter = ',', default_values_t = [3.0, 6.0, 12.0, 24.0, 48.0])]
    pub moduli: Vec<f64>,
    /// Young's moduli of reproduced lifts (kPa).
    #[arg(long, value_delimiter = ',', default_values_t = [6.0, 12.0, 48.0, 192.0])]
    pub reproduced_moduli: Vec<f64>,
    /// Lifts in parallel; all threads by default. The figures do not depend on it.
    #[arg(long, default_value_t = 0)]
    pub threads: usize,
}

/// A lift to simulate.
struct Trial<'a> {
    support: Support,
    /// (kPa)
    modulus_kpa: f64,
    /// (m)
    displacement: DVec3,
    grasp_s: f64,
    /// The recorded lift that is reproduced.
    recorded: Option<(usize, &'a SeenLift)>,
}

impl Study for LiftsExperiment {
    const NAME: &'static str = "lifts";
    const KIND: Kind = Kind::Experiment;
    const FOLDER: Option<&'static str> = Some(
        "Output folder of recording, specimen, trials and report. A finished recording in it is used again, and so \
         are finished trials with the same settings: an interrupted run resumes.",
    );
    type Figures = LiftsResult;

    fn run(&self, job: &Job<'_>) -> Result<(LiftsResult, Document)> {
        self.check()?;
        job.claim()?;
        let folder = job.output().join("phantom-a");
        let lifts = LiftOptions { count: self.lifts, support: self.true_support.into(), ..LiftOptions::default() };
        let options = RecordOptions { frames: 181, seed: self.seed, sensor: Sensor::Stereo, lifts };
        let specimen =
            phantoms::specimen("phantom-a", &options, None, &folder, phantoms::AfterUse::Keep, job.progress)?;
        let appendix = LoneOrgan::of(&specimen, "appendix")?;
        let recording = Recording::open(&folder.join("recording"))?;
        let measured = measure_recording(&recording, job.progress)?;
        let truth = measured.truth.clone();
        let summary = Measured::summary(&recording, &measured)?;
        let reproduced: Vec<(usize, SeenLift)> = measured
            .lifts
            .into_iter()
            .enumerate()
            .filter_map(|(number, lift)| Some((number, SeenLift::of(lift.ok()?, &appendix)?)))
            .collect();
        let own = appendix.organ().material.young_modulus_pa;
        let trials = self.trials(1e-3 * own, appendix.up(), &reproduced);
        let settings = format!("{:?} {:016x}", options, fingerprint(&specimen, &reproduced));
        let Outcomes { rows, resumed } =
            job.trials("lifts", &settings, &trials, Trial::key, self.threads, |trial, progress| {
                trial.run(&appendix, progress)
            })?;
        let folds = job.trials(
            "identification",
            &settings,
            &[0, 1],
            |fold| format!("fold {fold}"),
            self.threads,
            |fold, progress| identified(*fold, &appendix, &reproduced, progress),
        )?;
        let film = film::held_out(&recording, &specimen, &appendix, &reproduced, &folds.rows, job.progress)?;
        let identified = IdentifiedSummary::of(folds.rows);
        let (trend, errors) = (trend(&rows), errors(&rows));
        let chosen = errors.iter().find(|e| e.support == Support::Specimen.name() && e.modulus_kpa == 1e-3 * own);
        let left: Vec<f64> = reproduced.iter().map(|(_, r)| 1e3 * r.left).collect();
        let result = LiftsResult {
            d50_residual_mm: residual(&trend, 1e-3 * own),
            specimen_landmark_rmse_mm: chosen.and_then(|e| e.landmark_rmse_mm),
            chamfer_mm: chosen.and_then(|e| e.chamfer_mm),
            landmark_rmse_mm: identified.landmark_rmse_mm,
            identified,
            landmark_floor_mm: summary.landmark_floor_mm,
            lift_mm: summary.lift_mm,
            static_rmse_mm: summary.static_rmse_mm,
            rigid_rmse_mm: summary.rigid_rmse_mm,
            tracking_error_mm_median: summary.tracking_error_mm_median,
            alignment_mm: trocar_core::median(left),
            recorded_line: summary.line,
            recorded: summary,
            trend,
            errors,
            rows,
            modulus_kpa: 1e-3 * own,
            true_modulus_kpa: truth.as_ref().map_or(f64::NAN, |t| 1e-3 * t.young_modulus_pa),
            true_support: truth.map(|t| t.support.name().to_owned()).unwrap_or_default(),
            resumed,
        };
        let document = page::document(&result, film.as_ref())?;
        Ok((result, document))
    }
}

impl LiftsExperiment {
    fn check(&self) -> Result<()> {
        if !(1..=100).contains(&self.lifts) {
            return Err(Error::Mismatch(format!("--lifts is {}; must be in [1, 100]", self.lifts)));
        }
        let all = self.moduli.iter().chain(&self.reproduced_moduli);
        match all.copied().find(|kpa| !(0.5..=1000.0).contains(kpa)) {
            Some(kpa) => Err(Error::Mismatch(format!("a modulus is {kpa} kPa; must be in [0.5, 1000]"))),
            None => Ok(()),
        }
    }

    /// All lifts; those with the specimen's own modulus are always among them.
    fn trials<'a>(&self, own: f64, up: DVec3, reproduced: &'a [(usize, SeenLift)]) -> Vec<Trial<'a>> {
        let with_own = |moduli: &[f64]| {
            let mut all = moduli.to_vec();
            all.push(own);
            all.sort_by(f64::total_cmp);
            all.dedup();
            all
        };
        let mut trials = Vec::new();
        for support in Support::ALL {
            for modulus_kpa in with_own(&self.moduli) {
                for height in HEIGHTS {
                    trials.extend(PLACES.map(|grasp_s| Trial {
                        support,
                        modulus_kpa,
                        displacement: height * up,
                        grasp_s,
                        recorded: None,
                    }));
                }
            }
            for modulus_kpa in with_own(&self.reproduced_moduli) {
                trials.extend(reproduced.iter().map(|(number, lift)| Trial {
                    support,
                    modulus_kpa,
                    displacement: lift.displacement,
                    grasp_s: lift.grasp_s,
                    recorded: Some((*number, lift)),
                }));
            }
        }
        trials
    }
}

impl Trial<'_> {
    fn key(&self) -> String {
        let what = self.recorded.map_or("up".to_owned(), |(number, _)| format!("lift {number}"));
        let Self { support, modulus_kpa, displacement, grasp_s, .. } = self;
        format!("{what}, {}, {modulus_kpa} kPa, {displacement} m at {grasp_s}", support.name())
    }

    fn run(&self, appendix: &LoneOrgan, progress: &dyn Progress) -> Result<SimulatedRow> {
        let held = appendix.with(|organ| {
            organ.material.young_modulus_pa = 1e3 * self.modulus_kpa;
            organ.pins = self.support.pins(organ.pins);
        });
        let pull = Pull { s: self.grasp_s, displacement: self.displacement, grip: Grip::Cluster };
        let lifted = held.lift(&[pull], Pace::SLOW, progress)?.pop().flatten();
        let profile = lifted.as_ref().and_then(|l| appendix.profile(l));
        let [rmse, chamfer] = match (&self.recorded, &lifted) {
            (Some((_, reproduced)), Some(lifted)) => reproduced.compared(appendix, lifted),
            _ => [None; 2],
        };
        let mm = |m: f64| 1e3 * m;
        Ok(SimulatedRow {
            support: self.support.name().to_owned(),
            modulus_kpa: self.modulus_kpa,
            recorded: self.recorded.map(|(number, _)| number),
            grasp_s: self.grasp_s,
            displacement_mm: (1e6 * self.displacement.length()).round() * 1e-3,
            diverged: lifted.is_none(),
            lift_mm: profile.as_ref().map(|p| mm(p.apex)),
            d50_mm: profile.as_ref().and_then(|p| p.d50()).map(mm),
            landmark_rmse_mm: rmse.map(mm),
            chamfer_mm: chamfer.map(mm),
            profile: profile.as_ref().map(normalised).unwrap_or_default(),
        })
    }
}

/// A hash of everything that the trials depend on besides their keys.
fn fingerprint(specimen: &trocar_specimen::Specimen, reproduced: &[(usize, SeenLift)]) -> u64 {
    let mut text = format!("{:016x}", trocar_task::specimen_hash(specimen));
    for (number, lift) in reproduced {
        text += &format!("{number} {:?} {:?}", lift.landmarks, lift.lift.landmarks);
    }
    xxh3_64(text.as_bytes())
}
