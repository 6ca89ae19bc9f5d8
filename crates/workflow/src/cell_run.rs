//! `trocar simulate SCENE`: the scripted grasp-lift in the two-arm cell, from a scene to a run folder.

use crate::cell_figures::{CellRun, TimedEvent};
use crate::phantoms::scene_specimen;
use crate::watched::{Pictures, Watched};
use crate::workflow::{REPORT, refuse_overlap};
use crate::{Error, Result, pages};
use std::path::{Path, PathBuf};
use trocar_cell::{Cell, CellLift, CellLiftRun};
use trocar_core::Progress;
use trocar_scene::Scene;
use trocar_sensors::CameraRig;
use trocar_specimen::StagedFolder;

/// The file that makes a folder a run.
const RUN_MARKER: &str = "result.json";

/// How the grasp-lift is run in a cell.
#[derive(Clone, Debug)]
pub struct CellSimulation {
    /// Scene file or name of a built-in scene.
    pub scene: String,
    /// The task.
    pub task: CellLift,
    /// Force of the grasping arm's jaws [N]; the scene's when `None`.
    pub jaw_force: Option<f64>,
    /// Worker threads, 0 for all.
    pub threads: usize,
    /// Folder in which a scene's phantom is recorded and reconstructed; what is there is used again.
    pub phantoms: PathBuf,
}

impl CellSimulation {
    /// Runs it into the run folder `output`: figures, channels and report.
    ///
    /// # Errors
    /// One line that names the file, field or option; `output` is then left as it was.
    pub fn run(&self, output: &Path, progress: &dyn Progress) -> Result<CellRun> {
        let mut scene = Scene::read(&self.scene)?;
        refuse_overlap(Path::new(&self.scene), output)?;
        if let (Some(force), Some(arm)) =
            (self.jaw_force, scene.stations().first().map(|(arm, ..)| arm.instrument.clone()))
        {
            scene.instruments.iter_mut().filter(|i| i.name == arm).for_each(|i| i.jaw_force_n = force);
        }
        let staged = StagedFolder::create(output, RUN_MARKER)?;
        let specimen = scene_specimen(&scene, &self.phantoms, progress)?;
        let mut cell = Cell::new(&scene, &specimen, self.threads)?;
        let mut task = self.task.clone();
        if task.organ.is_none() && specimen.organs.iter().any(|o| o.name == scene.task.organ) {
            task.organ = Some(scene.task.organ.clone());
        }
        let mut watched = Watched::new(CameraRig::new(&scene, &specimen, &cell)?, &task.arm);
        let run = task.run_watched(&mut cell, progress, &mut |cell, phase| watched.look(cell, phase))?;
        let pictures = watched.finish(&cell)?;
        let made = CellRun {
            scene: scene.name.clone(),
            summary: run.summary.clone(),
            events: run
                .events
                .iter()
                .map(|(time_s, event)| TimedEvent { time_s: *time_s, event: event.clone() })
                .collect(),
            report: output.join(REPORT).display().to_string(),
        };
        write(staged, &made, &run, &pictures, progress)?;
        Ok(made)
    }
}

fn write(
    staged: StagedFolder,
    made: &CellRun,
    run: &CellLiftRun,
    pictures: &Pictures,
    progress: &dyn Progress,
) -> Result<()> {
    let folder = staged.path();
    let write = |name: &str, bytes: &[u8]| {
        let path = folder.join(name);
        std::fs::write(&path, bytes).map_err(|source| Error::Io { path, source })
    };
    write(RUN_MARKER, &serde_json::to_vec_pretty(made).map_err(|e| Error::Format(e.to_string()))?)?;
    let mut table = csv::Writer::from_writer(Vec::new());
    for sample in &run.samples {
        table.serialize(sample).map_err(|e| Error::Format(e.to_string()))?;
    }
    write("channels.csv", &table.into_inner().map_err(|e| Error::Format(e.to_string()))?)?;
    write(REPORT, pages::cell_lift(made, run, pictures)?.as_bytes())?;
    if progress.interrupted() {
        return Err(Error::Interrupted);
    }
    Ok(staged.commit()?)
}
