//! `Recorded`: a kept episode frame by frame, for datasets that are rendered after the fact.

use crate::error::{evaluate, wrong};
use crate::progress::Signals;
use numpy::{PyArray1, PyArray3, PyArrayMethods};
use pyo3::prelude::*;
use serde_json::json;
use std::path::PathBuf;
use trocar_cell::ActionSpace;
use trocar_render::RenderSettings;
use trocar_task::End;
use trocar_workflow::RecordedEpisode;

/// An episode with its surfaces.
#[pyclass(module = "trocar._native")]
pub struct Recorded(RecordedEpisode);

#[pymethods]
impl Recorded {
    /// Opens the episode in `folder`. One without surfaces is replayed and verified. `specimen` is
    /// the folder of a specimen that was moved. `plain_light`: not that which was drawn.
    #[new]
    #[pyo3(signature = (folder, *, phantoms, specimen=None, plain_light=false))]
    fn new(
        py: Python<'_>,
        folder: PathBuf,
        phantoms: PathBuf,
        specimen: Option<PathBuf>,
        plain_light: bool,
    ) -> PyResult<Self> {
        let open = || RecordedEpisode::open(&folder, specimen.as_deref(), &phantoms, &Signals::new());
        let made = py.detach(open).map_err(|e| evaluate(&e))?;
        Ok(Self(if plain_light { made.in_plain_light() } else { made }))
    }

    /// The header of the recording: a JSON object.
    #[getter]
    fn header(&self) -> PyResult<String> {
        let episode = &self.0.file.header;
        let scene = self.0.scene();
        let mut all = serde_json::to_value(self.0.header()).map_err(wrong)?;
        all["policy"] = json!(episode.policy);
        all["passed"] = json!(matches!(episode.end, Some(End::Passed)));
        all["scene"] = json!(scene.name);
        all["task"] = json!(scene.task.name.name());
        all["steps"] = json!(self.0.file.steps.len());
        all["note"] = json!(self.0.note);
        serde_json::to_string(&all).map_err(wrong)
    }

    /// The actions of all steps: for each its space, `pivots` or `tip`, and its numbers.
    fn actions(&self) -> Vec<(&'static str, Vec<f64>)> {
        let named = |space| match space {
            ActionSpace::Pivots => "pivots",
            ActionSpace::Tip => "tip",
        };
        self.0.file.steps.iter().map(|(action, _)| (named(action.space), action.numbers.clone())).collect()
    }

    /// Goes to the next frame. False at the last.
    fn advance(&mut self, py: Python<'_>) -> PyResult<bool> {
        py.detach(|| self.0.advance()).map_err(|e| evaluate(&e))
    }

    /// Simulated time of the frame (s).
    #[getter]
    fn time_s(&self) -> f64 {
        self.0.now().time_s
    }

    /// How far the task is, from 0 to 1.
    #[getter]
    fn score(&self) -> f64 {
        self.0.now().score
    }

    /// The observation of a policy.
    #[getter]
    fn state<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f32>> {
        PyArray1::from_slice(py, &self.0.now().state)
    }

    /// A picture (height, width, 3) of the frame through `camera`.
    fn picture<'py>(
        &mut self,
        py: Python<'py>,
        camera: &str,
        height: usize,
        width: usize,
    ) -> PyResult<Bound<'py, PyArray3<u8>>> {
        // These are the pictures of policies, too.
        let settings = RenderSettings::Preview { shadows: false };
        let pixels = py.detach(|| {
            let picture = self.0.picture(camera, [width, height], &settings)?;
            Ok(picture.color.pixels.as_flattened().to_vec())
        });
        let pixels = pixels.map_err(|e: trocar_workflow::Error| evaluate(&e))?;
        PyArray1::from_vec(py, pixels).reshape([height, width, 3])
    }
}
