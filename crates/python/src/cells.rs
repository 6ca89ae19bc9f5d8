//! `Cells`: episodes of one scene, side by side in one process.

use crate::error::{evaluate, forked, task, wrong};
use crate::frames::Rows;
use crate::pictures::Eyes;
use crate::prepare;
use crate::progress::Signals;
use crate::viewers::Viewers;
use numpy::{PyArray1, PyArray3, PyArrayDyn, PyReadonlyArray1, PyReadonlyArray2, PyUntypedArrayMethods};
use pyo3::prelude::*;
use rayon::prelude::*;
use std::path::PathBuf;
use trocar_cell::{Action, ActionSpace};
use trocar_task::{Bounds, Channels, End, Episode, EpisodeState, STATE_NAMES, STATE_SIZE};
use trocar_workflow::{SpecimenCache, drawn_specimens};

/// Numbers per cell and step in `figures`: reward, score, stages passed, end (-1 while the episode
/// runs), time (s).
const FIGURES: [&str; 5] = ["reward", "score", "stage", "end", "time_s"];

/// Names of the ends, by their number in `figures`.
const ENDS: [&str; 7] = ["passed", "time-out", "rcm-abort", "diverged", "policy-error", "finished", "aborted"];

/// A saved episode. It stays in the process, because nothing that is loaded from disk would be
/// trusted like this.
#[pyclass(frozen, module = "trocar._native")]
pub struct State(EpisodeState);

/// Episodes of one scene, stepped side by side.
#[pyclass(module = "trocar._native")]
pub struct Cells {
    pub(crate) episodes: Vec<Episode>,
    pub(crate) eyes: Eyes,
    pub(crate) viewers: Viewers,
    specimens: SpecimenCache,
    bounds: Bounds,
    pub(crate) pool: rayon::ThreadPool,
    task_name: String,
    prompt: String,
    steps: usize,
    /// The process that made them. The pool's threads do not exist in a child made by `fork`. Work
    /// given to them there would never finish.
    process: u32,
}

/// The caller's arrays that steps write, as a tuple: (cells, numbers) each.
#[derive(FromPyObject)]
struct Arrays<'py> {
    #[pyo3(item(0))]
    state: Bound<'py, PyArrayDyn<f32>>,
    #[pyo3(item(1))]
    figures: Bound<'py, PyArrayDyn<f64>>,
    #[pyo3(item(2))]
    channels: Bound<'py, PyArrayDyn<f64>>,
}

/// A cell with what is written of it.
struct Place<'a> {
    episode: &'a mut Episode,
    state: &'a mut [f32],
    figures: &'a mut [f64],
    channels: &'a mut [f64],
}

impl Place<'_> {
    fn write(&mut self, reward: f64) {
        let episode = &*self.episode;
        for (to, from) in self.state.iter_mut().zip(episode.observe().to_vec()) {
            *to = from as f32;
        }
        let progress = episode.progress();
        let end = episode.end().and_then(|e| ENDS.iter().position(|n| *n == e.name()));
        let end = end.map_or(-1.0, |k| k as f64);
        self.figures.copy_from_slice(&[reward, progress.score(), progress.stage as f64, end, episode.time()]);
        if !self.channels.is_empty() {
            let row = episode.rows().last().copied().unwrap_or_default();
            let (channels, measures) = self.channels.split_at_mut(Channels::COUNT);
            channels.copy_from_slice(&row.to_row());
            measures.copy_from_slice(&row.measures[..measures.len()]);
        }
    }

    /// The reward is the gain in stages, including parts of stages: a passed task gives its number
    /// of stages in all.
    fn step(&mut self, action: &Action) -> Result<(), trocar_task::Error> {
        if self.episode.end().is_some() {
            return Err(trocar_task::Error::Ended(self.episode.end().map_or_else(String::new, End::to_string)));
        }
        let stages = self.episode.progress().stages.len() as f64;
        let before = self.episode.progress().score();
        self.episode.step(action)?;
        self.write(stages * (self.episode.progress().score() - before));
        Ok(())
    }
}

#[pymethods]
impl Cells {
    /// `count` episodes of `scene` on `threads` threads (0: as many as the machine has; results do
    /// not depend on them).
    #[new]
    #[pyo3(signature = (scene, count, *, phantoms, threads=0, task=None, actions="pivots", episode_s=None, sensor_noise=false, variation=None, split="seen", backend=None))]
    fn new(
        py: Python<'_>,
        scene: &str,
        count: usize,
        phantoms: PathBuf,
        threads: usize,
        task: Option<&str>,
        actions: &str,
        episode_s: Option<f64>,
        sensor_noise: bool,
        variation: Option<&str>,
        split: &str,
        backend: Option<&str>,
    ) -> PyResult<Self> {
        if count == 0 || count > 4096 {
            return Err(wrong(format!("num_envs: is {count}; 1 to 4096 cells")));
        }
        let space = match actions {
            "pivots" => ActionSpace::Pivots,
            "tip" => ActionSpace::Tip,
            other => {
                let known = "pivots (absolute targets), tip (steps of the tip)";
                return Err(wrong(format!("actions: '{other}' is unknown; {known} are known")));
            }
        };
        let scene = prepare::scene(scene, variation, backend, task, episode_s)?;
        let split = prepare::split(split)?;
        py.detach(|| {
            let specimens = prepare::specimens(&scene, split, &phantoms)?;
            let pool = trocar_core::thread_pool(threads).map_err(wrong)?;
            // One cell uses all threads. With several cells, each uses one.
            let each = if count == 1 { threads } else { 1 };
            let seed = split.seed(0);
            // In the pool, because the threads of rayon's own would be missing in a forked child.
            let first =
                pool.install(|| Episode::begun(&scene, Box::new(specimens.clone()), each, seed, scene.draw(seed)));
            let episodes = copies(first.map_err(|e| crate::error::task(&e))?, count, &pool, &specimens)?;
            let bounds = Bounds::new(episodes[0].cell(), space).map_err(|e| crate::error::task(&e))?;
            let steps = (scene.task.episode_s * f64::from(scene.rates.control_hz)).round() as usize;
            let prompt = trocar_task::prompt(&scene);
            let eyes = Eyes::new(count, sensor_noise);
            let (task_name, process) = (scene.task.name.name().to_owned(), std::process::id());
            let viewers = Viewers::default();
            Ok(Self { episodes, eyes, viewers, specimens, bounds, pool, task_name, prompt, steps, process })
        })
    }

    /// Cells.
    #[getter]
    fn count(&self) -> usize {
        self.episodes.len()
    }

    /// Name of the task.
    #[getter]
    fn task(&self) -> &str {
        &self.task_name
    }

    /// The task's instruction, in words.
    #[getter]
    fn prompt(&self) -> &str {
        &self.prompt
    }

    /// Control periods of an episode, at most.
    #[getter]
    fn max_steps(&self) -> usize {
        self.steps
    }

    /// Control periods a second.
    #[getter]
    fn control_hz(&self) -> f64 {
        1.0 / self.episodes[0].cell().period()
    }

    /// Names of the numbers of a state.
    #[getter]
    fn state_names(&self) -> Vec<&'static str> {
        STATE_NAMES[..STATE_SIZE].to_vec()
    }

    /// Names of the numbers of an action.
    #[getter]
    fn action_names(&self) -> Vec<String> {
        self.bounds.names.clone()
    }

    /// Names of the channels.
    #[getter]
    fn channel_names(&self) -> Vec<String> {
        let measures = &self.episodes[0].program().measures;
        Channels::names().into_iter().chain(measures.iter().map(ToString::to_string)).collect()
    }

    /// Names of the figures.
    #[getter]
    fn figure_names(&self) -> Vec<&'static str> {
        FIGURES.to_vec()
    }

    /// Names of the ends, by their number in the figures.
    #[getter]
    fn end_names(&self) -> Vec<&'static str> {
        ENDS.to_vec()
    }

    /// Names of the task's stages.
    #[getter]
    fn stage_names(&self) -> Vec<String> {
        self.episodes[0].program().stages.iter().map(|s| s.name.clone()).collect()
    }

    /// Writes what `cameras` see of the cells that `active` says: `color` has an array (cells,
    /// height, width, 3) of bytes a camera, `depth` one (cells, height, width, 1) of z (m), 0 where
    /// nothing is; either list may be empty. Cells go in parallel, without the interpreter's lock.
    fn see(
        &mut self,
        py: Python<'_>,
        cameras: Vec<String>,
        size: Vec<(usize, usize)>,
        active: PyReadonlyArray1<'_, bool>,
        color: Vec<Bound<'_, PyArrayDyn<u8>>>,
        depth: Vec<Bound<'_, PyArrayDyn<f32>>>,
    ) -> PyResult<()> {
        self.here()?;
        self.eyes.look(py, (&self.episodes, &self.pool), &cameras, &size, &active, &color, &depth)
    }

    /// A picture (height, width, 3) of cell `k` through `camera`.
    fn picture<'py>(
        &mut self,
        py: Python<'py>,
        k: usize,
        camera: &str,
        height: usize,
        width: usize,
    ) -> PyResult<Bound<'py, PyArray3<u8>>> {
        self.at(k)?;
        self.eyes.photograph(py, (&self.episodes, &self.pool), k, camera, height, width)
    }

    /// Least and greatest numbers of an action.
    #[getter]
    fn action_limits<'py>(&self, py: Python<'py>) -> (Bound<'py, PyArray1<f64>>, Bound<'py, PyArray1<f64>>) {
        (PyArray1::from_slice(py, &self.bounds.low), PyArray1::from_slice(py, &self.bounds.high))
    }

    /// Begins the episodes of `seeds` in the cells `which`, and writes what is seen there.
    fn reset(
        &mut self,
        py: Python<'_>,
        which: PyReadonlyArray1<'_, i64>,
        seeds: PyReadonlyArray1<'_, u64>,
        arrays: Arrays<'_>,
    ) -> PyResult<()> {
        let count = self.episodes.len();
        let (which, seeds) = (which.as_slice().map_err(wrong)?, seeds.as_slice().map_err(wrong)?);
        let mut wanted = vec![None; count];
        for (k, seed) in which.iter().zip(seeds) {
            let place = usize::try_from(*k).ok().and_then(|k| wanted.get_mut(k));
            *place.ok_or_else(|| wrong(format!("cell {k} is not there; there are {count}")))? = Some(*seed);
        }
        // Made here and not in the pool: whoever makes one uses the pool itself and locks its
        // folder.
        let drawn = drawn_specimens(self.episodes[0].scene(), wanted.iter().copied().flatten());
        let specimens = &self.specimens;
        py.detach(|| specimens.make_all(&drawn, &Signals::new())).map_err(|e| evaluate(&e))?;
        let begin = |(place, seed): (&mut Place<'_>, &Option<u64>)| match seed {
            Some(seed) => place.episode.reset(*seed).map(|_| place.write(0.0)),
            None => Ok(()),
        };
        self.each(py, &arrays, &wanted, begin)?;
        self.viewers.see(py, &self.episodes, |k| wanted[k].map(|_| true))
    }

    /// Does one control period in every cell that `active` says, by its row of `actions`. An action
    /// that is not finite is refused before anything changes.
    fn step(
        &mut self,
        py: Python<'_>,
        actions: PyReadonlyArray2<'_, f64>,
        active: PyReadonlyArray1<'_, bool>,
        arrays: Arrays<'_>,
    ) -> PyResult<()> {
        let (count, numbers) = (self.episodes.len(), self.bounds.low.len());
        if actions.shape() != [count, numbers] {
            return Err(wrong(format!("actions: have shape {:?}; ({count}, {numbers}) is needed", actions.shape())));
        }
        let active = active.as_slice().map_err(wrong)?;
        if active.len() != count {
            return Err(wrong(format!("active: has {} flags; {count} are needed", active.len())));
        }
        let rows = actions.as_slice().map_err(wrong)?.chunks_exact(numbers);
        let told: Vec<Option<Action>> = rows
            .zip(active)
            .map(|(row, active)| active.then(|| self.bounds.action(row).map_err(|e| task(&e))).transpose())
            .collect::<PyResult<_>>()?;
        let go = |(place, action): (&mut Place<'_>, &Option<Action>)| match action {
            Some(action) => place.step(action),
            None => Ok(()),
        };
        self.each(py, &arrays, &told, go)?;
        self.viewers.see(py, &self.episodes, |k| told[k].as_ref().map(|_| false))
    }

    /// Why the episode in cell `k` ended; None while it runs.
    fn why(&self, k: usize) -> PyResult<Option<String>> {
        Ok(self.at(k)?.end().map(End::to_string))
    }

    /// The events in cell `k` since its reset: a JSON list of `[time_s, event]`.
    fn events(&self, k: usize) -> PyResult<String> {
        serde_json::to_string(self.at(k)?.events()).map_err(wrong)
    }

    /// The drawn values of the episode in cell `k`: a JSON object.
    fn drawn(&self, k: usize) -> PyResult<String> {
        serde_json::to_string(self.at(k)?.drawn()).map_err(wrong)
    }

    /// The episode in cell `k` in figures: a JSON object.
    fn summary(&self, k: usize) -> PyResult<String> {
        serde_json::to_string(&self.at(k)?.summary()).map_err(wrong)
    }

    /// Hash over every bit that the future of cell `k` depends on.
    fn state_hash(&self, k: usize) -> PyResult<u64> {
        Ok(self.at(k)?.state_hash())
    }

    /// The state of cell `k`.
    fn save(&self, k: usize) -> PyResult<State> {
        Ok(State(self.at(k)?.save()))
    }

    /// Puts `saved` into cell `k`, and writes what is seen there. A state of something else is
    /// refused before anything changes.
    fn restore(&mut self, py: Python<'_>, k: usize, saved: &State, arrays: Arrays<'_>) -> PyResult<()> {
        self.at(k)?;
        let which: Vec<Option<&State>> = (0..self.episodes.len()).map(|j| (j == k).then_some(saved)).collect();
        let put = |(place, saved): (&mut Place<'_>, &Option<&State>)| match saved {
            Some(saved) => place.episode.restore(&saved.0).map(|()| place.write(0.0)),
            None => Ok(()),
        };
        self.each(py, &arrays, &which, put)?;
        self.viewers.see(py, &self.episodes, |j| (j == k).then_some(true))
    }
}

/// `first` and copies of it, `count` in all, as many at a time as the pool has threads. In between
/// the interpreter's signals are looked at: thousands of cells take minutes.
fn copies(first: Episode, count: usize, pool: &rayon::ThreadPool, specimens: &SpecimenCache) -> PyResult<Vec<Episode>> {
    let mut episodes = Vec::with_capacity(count);
    episodes.push(first);
    while episodes.len() < count {
        let batch = pool.current_num_threads().clamp(1, count - episodes.len());
        let one = |_| episodes[0].try_clone(Box::new(specimens.clone()));
        let more: trocar_task::Result<Vec<Episode>> = pool.install(|| (0..batch).into_par_iter().map(one).collect());
        episodes.extend(more.map_err(|e| task(&e))?);
        // Only the calling thread receives signals, not those of the pool.
        Python::attach(|py| py.check_signals())?;
    }
    Ok(episodes)
}

impl Cells {
    /// Cells are refused in another process than that which made them.
    pub(crate) fn here(&self) -> PyResult<()> {
        if std::process::id() == self.process { Ok(()) } else { Err(forked()) }
    }

    pub(crate) fn at(&self, k: usize) -> PyResult<&Episode> {
        self.here()?;
        let count = self.episodes.len();
        self.episodes.get(k).ok_or_else(|| wrong(format!("cell {k} is not there; there are {count}")))
    }

    /// Runs `work` in every cell, with that cell's item of `with`, in parallel and without the
    /// interpreter's lock. It reports the first error in the order of the cells.
    fn each<T: Sync>(
        &mut self,
        py: Python<'_>,
        arrays: &Arrays<'_>,
        with: &[T],
        work: impl Fn((&mut Place<'_>, &T)) -> Result<(), trocar_task::Error> + Sync,
    ) -> PyResult<()> {
        self.here()?;
        let count = self.episodes.len();
        let mut state = Rows::new(&arrays.state, "state", count, &[STATE_SIZE])?;
        let mut figures = Rows::new(&arrays.figures, "figures", count, &[FIGURES.len()])?;
        let mut channels = Rows::new(&arrays.channels, "channels", count, &[Channels::COUNT])?;
        let mut places: Vec<Place<'_>> = self
            .episodes
            .iter_mut()
            .zip(state.pieces()?.into_iter().zip(figures.pieces()?).zip(channels.pieces()?))
            .map(|(episode, ((state, figures), channels))| Place { episode, state, figures, channels })
            .collect();
        let pool = &self.pool;
        let done: Vec<Result<(), trocar_task::Error>> =
            py.detach(|| pool.install(|| places.par_iter_mut().zip(with).map(&work).collect()));
        done.into_iter().collect::<Result<(), _>>().map_err(|e| task(&e))
    }
}
