//! Pictures of the cells through their cameras: colour and depth of all cells at once, written into
//! the caller's arrays.

use crate::error::wrong;
use crate::frames::Rows;
use crate::prepare;
use numpy::{PyArray3, PyArrayDyn, PyArrayMethods, PyReadonlyArray1};
use pyo3::prelude::*;
use rayon::prelude::*;
use trocar_render::RenderSettings;
use trocar_sensors::{CameraNoise, CameraRig, DepthNoise};
use trocar_task::Episode;

/// Shot and read noise of the colours, with `sensor_noise`.
const COLOR_NOISE: [f32; 2] = [0.015, 0.003];

/// Pictures are made by direct light without shadows, which is what policies of campaigns see too.
const SETTINGS: RenderSettings = RenderSettings::Preview { shadows: false };

/// The sights of the cells; each is made when its cell is first looked at, and shares with those of
/// the same scene.
pub struct Eyes {
    sights: Vec<Option<CameraRig>>,
    noise: bool,
}

/// A cell that is looked at, with the pieces of the arrays that are its own.
struct Look<'a> {
    sight: &'a mut CameraRig,
    episode: &'a Episode,
    color: Vec<&'a mut [u8]>,
    depth: Vec<&'a mut [f32]>,
}

impl Eyes {
    pub fn new(count: usize, noise: bool) -> Self {
        Self { sights: (0..count).map(|_| None).collect(), noise }
    }
}

/// The noise of an episode's cameras.
fn sensor_noise(episode: &Episode, noise: bool) -> CameraNoise {
    if !noise {
        return CameraNoise::default();
    }
    let seed = episode.seed();
    // Both halves of the seed count.
    let seed = (seed ^ (seed >> 32)) as u32;
    CameraNoise { color: Some(COLOR_NOISE), depth: Some(DepthNoise::default()), seed }
}

/// A camera as Python sees it: name, height and width (px) of policies' pictures, and whether it
/// measures depth.
pub type Described = (String, usize, usize, bool);

/// The cameras of a scene, before anything is built of it.
#[pyfunction]
pub fn cameras(scene: &str) -> PyResult<Vec<Described>> {
    let row = |c: &trocar_scene::CellCamera| {
        let [width, height] = c.policy_size_px.map(|n| n as usize);
        (c.name.clone(), height, width, c.depth)
    };
    Ok(prepare::scene(scene, None, None, None, None)?.cameras.iter().map(row).collect())
}

impl Eyes {
    /// Makes the sights of the `wanted` episodes that are not there or are of an episode for which
    /// something else was drawn. Episodes for which the same was drawn share what does not move.
    fn wake(&mut self, episodes: &[Episode], wanted: &[usize]) -> trocar_sensors::Result<()> {
        let scene = |k: usize| episodes[k].arranged_scene();
        let is_ready = |sight: &Option<CameraRig>, k: usize| sight.as_ref().is_some_and(|rig| rig.is_of(scene(k)));
        let missing: Vec<usize> = wanted.iter().copied().filter(|k| !is_ready(&self.sights[*k], *k)).collect();
        for k in missing.iter().copied() {
            self.sights[k] = self.sights.iter().find(|sight| is_ready(sight, k)).cloned().flatten();
        }
        let open: Vec<usize> = missing.iter().copied().filter(|k| !is_ready(&self.sights[*k], *k)).collect();
        let leader = |k: usize| open.iter().copied().find(|j| CameraRig::shows_same(scene(*j), scene(k))).unwrap_or(k);
        let made: Vec<(usize, trocar_sensors::Result<CameraRig>)> = open
            .par_iter()
            .filter(|k| leader(**k) == **k)
            .map(|k| (*k, CameraRig::new(scene(*k), episodes[*k].specimen(), episodes[*k].cell())))
            .collect();
        for (k, rig) in made {
            self.sights[k] = Some(rig?);
        }
        for k in open.iter().copied() {
            let from = leader(k);
            if from != k {
                self.sights[k] = self.sights[from].clone();
            }
        }
        for k in wanted {
            if let Some(sight) = &mut self.sights[*k] {
                sight.noise = sensor_noise(&episodes[*k], self.noise);
            }
        }
        Ok(())
    }

    /// See `Cells.see`.
    pub fn look(
        &mut self,
        py: Python<'_>,
        (episodes, pool): (&[Episode], &rayon::ThreadPool),
        cameras: &[String],
        size: &[(usize, usize)],
        active: &PyReadonlyArray1<'_, bool>,
        color: &[Bound<'_, PyArrayDyn<u8>>],
        depth: &[Bound<'_, PyArrayDyn<f32>>],
    ) -> PyResult<()> {
        let count = episodes.len();
        let active = active.as_slice().map_err(wrong)?;
        let fits = |n: usize| n == 0 || n == cameras.len();
        if active.len() != count || size.len() != cameras.len() || !fits(color.len()) || !fits(depth.len()) {
            return Err(wrong(format!(
                "see: {count} flags are needed, and a size and an array for each of {} cameras",
                cameras.len()
            )));
        }
        let mut color = rows(color, "color", count, size, 3)?;
        let mut depth = rows(depth, "depth", count, size, 1)?;
        let mut colors = by_cell(&mut color, count)?;
        let mut depths = by_cell(&mut depth, count)?;
        let wanted: Vec<usize> = (0..count).filter(|k| active[*k]).collect();
        py.detach(|| pool.install(|| self.wake(episodes, &wanted))).map_err(wrong)?;
        let mut looks: Vec<Look<'_>> = self
            .sights
            .iter_mut()
            .zip(episodes)
            .zip(colors.drain(..).zip(depths.drain(..)))
            .zip(active)
            .filter(|(_, active)| **active)
            .filter_map(|(((sight, episode), (color, depth)), _)| {
                Some(Look { sight: sight.as_mut()?, episode, color, depth })
            })
            .collect();
        let see = |look: &mut Look<'_>| -> trocar_sensors::Result<()> {
            for (k, (camera, (height, width))) in cameras.iter().zip(size).enumerate() {
                let picture = look.sight.render(look.episode.cell(), camera, [*width, *height], &SETTINGS)?;
                if let Some(to) = look.color.get_mut(k) {
                    to.copy_from_slice(picture.color.pixels.as_flattened());
                }
                if let Some(to) = look.depth.get_mut(k) {
                    to.copy_from_slice(&picture.depth.depth);
                }
            }
            Ok(())
        };
        let done: Vec<trocar_sensors::Result<()>> =
            py.detach(|| pool.install(|| looks.par_iter_mut().map(see).collect()));
        done.into_iter().collect::<trocar_sensors::Result<()>>().map_err(wrong)
    }

    /// See `Cells.picture`.
    pub fn photograph<'py>(
        &mut self,
        py: Python<'py>,
        (episodes, pool): (&[Episode], &rayon::ThreadPool),
        k: usize,
        camera: &str,
        height: usize,
        width: usize,
    ) -> PyResult<Bound<'py, PyArray3<u8>>> {
        let pixels = py.detach(|| {
            pool.install(|| {
                self.wake(episodes, &[k])?;
                let Some(sight) = &mut self.sights[k] else { return Ok(Vec::new()) };
                let picture = sight.render(episodes[k].cell(), camera, [width, height], &SETTINGS)?;
                Ok(picture.color.pixels.as_flattened().to_vec())
            })
        });
        let pixels: Vec<u8> = pixels.map_err(|e: trocar_sensors::Error| wrong(e))?;
        numpy::PyArray1::from_vec(py, pixels).reshape([height, width, 3])
    }
}

/// The arrays of all cameras, checked.
fn rows<'py, T: numpy::Element>(
    arrays: &[Bound<'py, PyArrayDyn<T>>],
    name: &'static str,
    count: usize,
    size: &[(usize, usize)],
    channels: usize,
) -> PyResult<Vec<Rows<'py, T>>> {
    let one = |(array, (height, width)): (&Bound<'py, PyArrayDyn<T>>, &(usize, usize))| {
        Rows::new(array, name, count, &[*height, *width, channels])
    };
    arrays.iter().zip(size).map(one).collect()
}

/// For each cell its pieces, one a camera.
fn by_cell<'a, T: numpy::Element>(rows: &'a mut [Rows<'_, T>], count: usize) -> PyResult<Vec<Vec<&'a mut [T]>>> {
    let mut cells: Vec<Vec<&'a mut [T]>> = (0..count).map(|_| Vec::new()).collect();
    for row in rows {
        for (cell, piece) in cells.iter_mut().zip(row.pieces()?) {
            cell.push(piece);
        }
    }
    Ok(cells)
}
