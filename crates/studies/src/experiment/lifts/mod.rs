//! Recorded grasp-lifts beside simulated ones (paper section VII, Fig. 7(d,e) and 8(e) to (g)):
//! lifts of a phantom whose tissue is another than the simulated one are measured, reproduced and
//! compared.

mod page;
mod result;
mod simulated;

pub use result::LiftsResult;

use crate::names::SupportName;
use crate::study::{Job, Kind, Study};
use crate::trials::Outcomes;
use crate::{Error, Result};
use clap::Args;
use glam::DVec3;
use result::{SimulatedRow, errors, residual, trend};
use simulated::{Appendix, Support, aligned};
use trocar_core::Progress;
use trocar_measure::{MeasuredLift, chamfer, normalised};
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
    recorded: Option<(usize, &'a Reproduced)>,
}

/// A measured lift in the frame of the specimen.
struct Reproduced {
    lift: MeasuredLift,
    grasp_s: f64,
    /// From the recording to the specimen: displacement of the apex (m), landmarks and points (m).
    displacement: DVec3,
    landmarks: Vec<DVec3>,
    points: Vec<DVec3>,
    /// Turns motions of the specimen into those of the recording.
    back: glam::DMat3,
    /// Median distance between the aligned centrelines (m).
    left: f64,
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
        let specimen = phantoms::specimen("phantom-a", &options, None, &folder, job.progress)?;
        let appendix = Appendix::of(&specimen)?;
        let recording = Recording::open(&folder.join("recording"))?;
        let measured = measure_recording(&recording, job.progress)?;
        let truth = measured.truth.clone();
        let summary = Measured::summary(&recording, &measured)?;
        let reproduced: Vec<(usize, Reproduced)> = measured
            .lifts
            .into_iter()
            .enumerate()
            .filter_map(|(number, lift)| Some((number, Reproduced::of(lift.ok()?, &appendix)?)))
            .collect();
        let own =
            specimen.organs.iter().find(|o| o.name == "appendix").map_or(f64::NAN, |o| o.material.young_modulus_pa);
        let trials = self.trials(1e-3 * own, appendix.up(), &reproduced);
        let settings = format!("{:?} {:016x}", options, fingerprint(&specimen, &reproduced));
        let Outcomes { rows, resumed } =
            job.trials("lifts", &settings, &trials, Trial::key, self.threads, |trial, progress| {
                trial.run(&appendix, progress)
            })?;
        let (trend, errors) = (trend(&rows), errors(&rows));
        let chosen = errors.iter().find(|e| e.support == Support::Specimen.name() && e.modulus_kpa == 1e-3 * own);
        let left: Vec<f64> = reproduced.iter().map(|(_, r)| 1e3 * r.left).collect();
        let result = LiftsResult {
            d50_residual_mm: residual(&trend, 1e-3 * own),
            landmark_rmse_mm: chosen.and_then(|e| e.landmark_rmse_mm),
            chamfer_mm: chosen.and_then(|e| e.chamfer_mm),
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
        let document = page::document(&result)?;
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
    fn trials<'a>(&self, own: f64, up: DVec3, reproduced: &'a [(usize, Reproduced)]) -> Vec<Trial<'a>> {
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

impl Reproduced {
    /// Aligns the centreline of a lift at rest with that of the specimen (paper section VII-F:
    /// rigidly, places of the same arc length). `None` if too little of the lift is seen.
    fn of(lift: MeasuredLift, appendix: &Appendix) -> Option<Self> {
        let (profile, apex) = (lift.profile.as_ref()?, lift.apex?);
        let stations = &lift.centreline.stations;
        // The visible line ends half a width before each end of the organ.
        let spare = 0.5 * (appendix.length() - lift.centreline.length()).max(0.0);
        let place = |along: f64| ((along + spare) / appendix.length()).clamp(0.0, 1.0);
        let points: Vec<DVec3> = stations.iter().map(|s| s.point).collect();
        let fronts: Vec<DVec3> =
            (0..points.len()).map(|i| appendix.front_at(place(i as f64 * trocar_measure::SPACING))).collect();
        let ((rotation, a, b), left) = aligned(&points, &fronts);
        let there = |p: DVec3| rotation * (p - a) + b;
        let (rest, _): (Vec<DVec3>, Vec<DVec3>) = lift.surface(lift.peak).into_iter().unzip();
        Some(Self {
            grasp_s: place(profile.apex_at),
            displacement: rotation * apex.displacement,
            landmarks: lift.landmarks.iter().map(|l| there(l.rest)).collect(),
            points: rest.into_iter().map(there).collect(),
            back: rotation.transpose(),
            left,
            lift,
        })
    }

    /// Landmark error and local Chamfer distance of a simulated lift (m).
    fn compared(&self, appendix: &Appendix, lifted: &simulated::Lifted) -> [Option<f64>; 2] {
        let moved = |points: &[DVec3]| -> Vec<DVec3> {
            appendix.motions(lifted, points.to_vec()).into_iter().map(|d| self.back * d).collect()
        };
        let landmarks: Vec<Option<DVec3>> = moved(&self.landmarks).into_iter().map(Some).collect();
        let surface = self.lift.surface(self.lift.peak);
        let (rest, now): (Vec<DVec3>, Vec<DVec3>) = surface.into_iter().unzip();
        let predicted: Vec<DVec3> = rest.iter().zip(moved(&self.points)).map(|(p, d)| *p + d).collect();
        [self.lift.landmark_rmse(&landmarks), chamfer(&predicted, &now)]
    }
}

impl Trial<'_> {
    fn key(&self) -> String {
        let what = self.recorded.map_or("up".to_owned(), |(number, _)| format!("lift {number}"));
        let Self { support, modulus_kpa, displacement, grasp_s, .. } = self;
        format!("{what}, {}, {modulus_kpa} kPa, {displacement} m at {grasp_s}", support.name())
    }

    fn run(&self, appendix: &Appendix, progress: &dyn Progress) -> Result<SimulatedRow> {
        let lifted = appendix.lift(self.support, 1e3 * self.modulus_kpa, self.grasp_s, self.displacement, progress)?;
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
fn fingerprint(specimen: &trocar_specimen::Specimen, reproduced: &[(usize, Reproduced)]) -> u64 {
    let mut text = format!("{:016x}", trocar_task::specimen_hash(specimen));
    for (number, lift) in reproduced {
        text += &format!("{number} {:?} {:?}", lift.landmarks, lift.lift.landmarks);
    }
    xxh3_64(text.as_bytes())
}
