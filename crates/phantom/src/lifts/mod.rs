//! Filmed grasp-lifts: an instrument grasps the appendix and lifts it, with known truth.
//!
//! The tissue of the lifts is another one than that of the simulation, so that a comparison with
//! them proves something: a mesh of half the edge length, corotated elasticity of another modulus,
//! supports that the camera does not see, and equilibria by the oracle. The lifted organ touches
//! its bed, but not the other organs. It has no shadow in the creases while it is lifted.

mod options;
mod script;
mod support;
mod tissue;
mod truth;

#[cfg(test)]
mod tests;

pub use options::LiftOptions;
pub use support::HiddenSupport;
pub use truth::{LIFTS_FILE, LiftTruth, LiftsTruth};

use crate::anatomy::Anatomy;
use crate::frame::{FrameSettings, Layer, METAL, record_layers};
use crate::instruments::Posture;
use crate::paint;
use crate::spec::{PhantomSpec, Resolution};
use crate::static_view::StaticView;
use crate::{Error, Result};
use glam::DVec3;
use rayon::prelude::*;
use script::LiftScript;
use tissue::{SolvedLift, Tissue};
use trocar_camera::Camera;
use trocar_core::Progress;
use trocar_geometry::{MeshDistance, Skin, TriMesh};
use trocar_recording::{LiftInfo, RecordingWriter};
use truth::TrackRow;

/// The organ that is lifted.
pub(crate) const ORGAN: &str = "appendix";

/// Greatest number of lifts.
pub(crate) const MAX_LIFTS: usize = 100;

/// Organ coordinate of the click.
const CLICK: f64 = 0.5;

/// Distance between tracked points of the centreline (m).
const TRACK_SPACING: f64 = 1e-3;

/// The jaws reach this far beyond the middle of the held tissue (m). They come open and close
/// (rad).
const BEYOND: f64 = 3e-3;
const OPEN: f64 = 0.6;
const CLOSED: f64 = 0.18;

/// Where the instrument waits, from the grasp: back along the shaft, and up (m).
const BACK: f64 = 0.075;
const ABOVE: f64 = 0.02;

/// The lifts of a recording, before they are filmed.
pub(crate) struct Lifts<'a> {
    spec: &'a PhantomSpec,
    options: LiftOptions,
    index: usize,
    /// First frame of the first lift.
    start: usize,
    surface: TriMesh,
    tissue: Tissue,
    /// Each lift with the point of the surface above its grasp (m).
    scripts: Vec<(LiftScript, DVec3)>,
    click: [f64; 2],
}

/// What all frames of the lifts share.
struct Scene<'a> {
    still: StaticView,
    take: FrameSettings<'a>,
    skin: Skin,
    tracks: Skin,
}

/// Checks the number of lifts and finds the organ.
pub(crate) fn check(spec: &PhantomSpec, options: &LiftOptions) -> Result<()> {
    let LiftOptions { count, cell, .. } = *options;
    if count > MAX_LIFTS {
        return Err(Error::Option(format!("lifts is {count}; must be in [0, {MAX_LIFTS}]")));
    }
    if !(3e-4..=5e-3).contains(&cell) {
        return Err(Error::Option(format!("the cell of the lifted tissue is {} mm; must be in [0.3, 5]", 1e3 * cell)));
    }
    if count > 0 && !spec.organ_names.contains(&ORGAN) {
        return Err(Error::Option(format!("{} has no {ORGAN} to lift; phantom-a and phantom-b have one", spec.name)));
    }
    Ok(())
}

impl<'a> Lifts<'a> {
    /// Plans the lifts after `start` still frames. `surfaces` are those of the anatomy.
    pub fn plan(
        spec: &'a PhantomSpec,
        options: &LiftOptions,
        anatomy: &Anatomy,
        surfaces: &[TriMesh],
        (camera, seed, start): (&Camera, u64, usize),
    ) -> Result<Option<Self>> {
        let Some(index) = anatomy.organs.iter().position(|o| o.name == ORGAN).filter(|_| options.count > 0) else {
            return Ok(None);
        };
        let surface = surfaces[index].clone();
        let tissue = Tissue::new(&anatomy.organs[index], spec, &surface, options.support, options.cell, seed)?;
        let shape = MeshDistance::new(&surface)?;
        let scripts = script::draw(options.count, seed);
        let fronts = scripts.iter().map(|s| tissue.front_at(&shape, s.at)).chain([tissue.front_at(&shape, CLICK)]);
        let mut fronts = deformed(&tissue, &tissue.bind(fronts.collect()), &tissue.settled);
        let click = fronts.pop().and_then(|p| camera.project(p)).map(|q| [q.x, q.y]).unwrap_or_default();
        let click = click.map(|c| (c * 10.0).round() / 10.0);
        let scripts = scripts.into_iter().zip(fronts).collect();
        Ok(Some(Self { spec, options: *options, index, start, surface, tissue, scripts, click }))
    }

    /// The lifts for `recording.toml`.
    pub fn info(&self) -> Vec<LiftInfo> {
        let lift = |i: usize| {
            let first = self.start + i * script::FRAMES;
            LiftInfo {
                rest: first + script::REST,
                first: first + script::FIRST,
                last: first + script::FRAMES - 1,
                click: self.click,
                force_n: None,
            }
        };
        (0..self.scripts.len()).map(lift).collect()
    }

    /// Films the lifts and writes their truth.
    pub fn film(
        mut self,
        anatomy: &Anatomy,
        resolution: Resolution,
        take: FrameSettings<'_>,
        writer: &RecordingWriter,
        progress: &dyn Progress,
    ) -> Result<()> {
        let truth = writer.folder().join("truth");
        progress.begin("lifts", self.scripts.len() as u64);
        let mut solved = Vec::new();
        for (script, front) in self.scripts.clone() {
            let lift = self.tissue.lift(&script, front, progress);
            if lift.is_err() {
                progress.end();
            }
            solved.push(lift?);
            progress.advance(1);
        }
        progress.end();
        progress.begin("frames of lifts", (solved.len() * script::FRAMES) as u64);
        let scene = Scene {
            still: StaticView::without(Some(self.index), self.spec, anatomy, take.camera, resolution),
            take,
            skin: Skin::bind(&self.surface, &self.tissue.mesh),
            tracks: self.tissue.bind(self.tracked()?),
        };
        for (number, lift) in solved.iter().enumerate() {
            truth::make_folder(&truth, number)?;
            for (k, (_, nodes)) in lift.keys.iter().enumerate() {
                truth::write_key(&truth, number, k, &self.skinned(&scene, nodes))?;
            }
            truth::write_tracks(&truth, number, &self.tracks(&scene, lift, number))?;
            (0..script::FRAMES).into_par_iter().try_for_each(|frame| {
                if progress.interrupted() {
                    return Err(Error::Interrupted);
                }
                let index = self.start + number * script::FRAMES + frame;
                let shot = record_layers(&scene.still, &scene.take, self.layers(&scene, anatomy, lift, frame), index);
                writer.frame(index, &shot.color, &shot.depth, Some(&shot.instruments))?;
                progress.advance(1);
                Ok(())
            })?;
        }
        progress.end();
        truth::write(&truth, &self.truth(&solved))
    }

    /// Points of the centreline, then those of the front above them (m).
    fn tracked(&self) -> Result<Vec<DVec3>> {
        let shape = MeshDistance::new(&self.surface)?;
        let centre = self.along().into_iter().map(|s| self.tissue.axis.point_at(s));
        let front = self.along().into_iter().map(|s| self.tissue.front_at(&shape, s));
        Ok(centre.chain(front).collect())
    }

    /// Organ coordinates of the tracked points.
    fn along(&self) -> Vec<f64> {
        let count = (self.tissue.axis.length / TRACK_SPACING).floor() as usize;
        (0..=count).map(|i| i as f64 * TRACK_SPACING / self.tissue.axis.length).collect()
    }

    fn tracks(&self, scene: &Scene<'_>, lift: &SolvedLift, number: usize) -> Vec<TrackRow> {
        let along = self.along();
        let mut rows = Vec::new();
        for frame in script::REST..script::FRAMES {
            let points = deformed(&self.tissue, &scene.tracks, &lift.nodes(script::progress(frame)));
            let (centre, front) = points.split_at(along.len());
            rows.extend((0..along.len()).map(|i| TrackRow {
                frame: self.start + number * script::FRAMES + frame,
                along: along[i] * self.tissue.axis.length,
                centre: centre[i],
                front: front[i],
            }));
        }
        rows
    }

    /// The organ's surface with its nodes at `nodes` (m).
    fn skinned(&self, scene: &Scene<'_>, nodes: &[DVec3]) -> TriMesh {
        TriMesh { vertices: deformed(&self.tissue, &scene.skin, nodes), ..self.surface.clone() }
    }

    /// The lifted organ and the instrument in a frame of a lift.
    fn layers(&self, scene: &Scene<'_>, anatomy: &Anatomy, lift: &SolvedLift, frame: usize) -> [Layer; 2] {
        let share = script::progress(frame);
        let mesh = self.skinned(scene, &lift.nodes(share));
        let organ = Layer { mesh, shading: paint::shading(anatomy.organs[self.index].look), instrument: false };
        let reach = &self.spec.reach;
        let port = reach.sweeps[0].port;
        let near = script::nearness(frame);
        let grasp = lift.grasp + share * lift.way;
        let along = (grasp - port).normalize();
        let away = (1.0 - near) * (ABOVE * -DVec3::Z - BACK * along);
        let posture = Posture {
            scale: reach.scale,
            port,
            tip: grasp + BEYOND * along + away,
            roll: 0.0,
            opening: OPEN + (CLOSED - OPEN) * near,
        };
        [organ, Layer { mesh: posture.mesh(), shading: METAL, instrument: true }]
    }

    fn truth(&self, solved: &[SolvedLift]) -> LiftsTruth {
        let lift = |(info, (lift, (script, _))): (LiftInfo, (&SolvedLift, &(LiftScript, DVec3)))| LiftTruth {
            rest: info.rest,
            first: info.first,
            last: info.last,
            grasp_s: script.at,
            grasp_m: lift.grasp.to_array(),
            displacement_m: lift.way.to_array(),
            keys: lift.keys.iter().map(|key| key.0).collect(),
            progress: (script::REST..script::FRAMES).map(script::progress).collect(),
        };
        LiftsTruth {
            organ: ORGAN.to_owned(),
            length_m: self.tissue.axis.length,
            model: "corotated".to_owned(),
            young_modulus_pa: self.tissue.young_modulus,
            poisson_ratio: tissue::POISSON_RATIO,
            density_kg_m3: self.tissue.density,
            cell_m: self.options.cell,
            nodes: self.tissue.mesh.vertices.len(),
            tets: self.tissue.mesh.tets.len(),
            support: self.options.support,
            threads: self.options.support.threads(),
            lifts: self.info().into_iter().zip(solved.iter().zip(&self.scripts)).map(lift).collect(),
        }
    }
}

/// Points bound to the tissue, with its nodes at `nodes` (m).
fn deformed(tissue: &Tissue, skin: &Skin, nodes: &[DVec3]) -> Vec<DVec3> {
    let mut points = vec![DVec3::ZERO; skin.bindings.len()];
    skin.deform(&tissue.mesh, nodes, &mut points);
    points
}
