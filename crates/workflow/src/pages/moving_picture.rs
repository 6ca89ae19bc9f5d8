//! The lift as a moving picture (GIF) and as stills from the same view.

use super::organ_views::{self, Directions};
use super::severed::{self, CutSkin};
use crate::{Error, Result};
use color_quant::NeuQuant;
use glam::DVec3;
use trocar_cell::{CUT_OPENED, CutOrgan, GraspLiftRun, Gripper, Snapshot};
use trocar_geometry::Skin;
use trocar_render::phong::{Instance, PhongScene, Shading};
use trocar_report::colors::{self, METAL, VIEW_GROUND};
use trocar_report::views::View;
use trocar_specimen::Specimen;

/// Size of the moving picture [px].
pub(super) const SIZE: (usize, usize) = (480, 300);

/// Most frames of it.
const MOST_FRAMES: usize = 45;

/// Time a frame is shown [1/100 s]: about 15 frames a second.
const DELAY: u16 = 7;

/// The last frame is shown this long [1/100 s], so that the loop has a beat.
const LAST_DELAY: u16 = 70;

/// Palette entry that stands for "as in the frame before".
const UNCHANGED: u8 = 255;

/// A run ready to be pictured.
pub(super) struct Lift<'a> {
    specimen: &'a Specimen,
    run: &'a GraspLiftRun,
    skins: Vec<Skin>,
    /// The organ that was cut, in its pieces.
    cut: Option<CutSkin<'a>>,
    grasped: usize,
    view: View,
}

impl<'a> Lift<'a> {
    /// Binds the surfaces and finds a view on the grasped organ. `None` when the run kept no snapshots.
    ///
    /// # Errors
    /// When the snapshots are not of this specimen.
    pub(super) fn new(specimen: &'a Specimen, run: &'a GraspLiftRun) -> Result<Option<Self>> {
        if run.snapshots.is_empty() {
            return Ok(None);
        }
        for snapshot in &run.snapshots {
            let nodes = |k: usize| match run.cut.as_ref().filter(|cut| snapshot.cut && cut.organ == k) {
                Some(cut) => cut.parents.len(),
                None => specimen.organs[k].body.vertices.len(),
            };
            let of_organ = |cut: &CutOrgan| specimen.organs.get(cut.organ).is_some_and(|o| is_of(cut, o));
            let fits = snapshot.nodes.len() == specimen.organs.len()
                && snapshot.nodes.iter().enumerate().all(|(k, n)| n.len() == nodes(k))
                && run.cut.as_ref().is_none_or(of_organ);
            if !fits {
                let time = snapshot.time_s;
                let name = &specimen.name;
                return Err(Error::Mismatch(format!("the snapshot at {time} s is not of specimen '{name}'")));
            }
        }
        let skins: Vec<Skin> = specimen.organs.iter().map(|o| Skin::bind(&o.surface, &o.body)).collect();
        let bound = |cut: &'a CutOrgan| {
            CutSkin::new(&specimen.organs[cut.organ], &skins[cut.organ], cut, colors::organ(cut.organ))
        };
        let cut = run.cut.as_ref().map(bound);
        let grasped = specimen.organs.iter().position(|o| o.name == run.summary.organ).unwrap_or(0);
        let view = View::framing(&[], DVec3::Z, DVec3::Z, SIZE);
        let mut lift = Self { specimen, run, skins, cut, grasped, view };
        lift.view = lift.best_view();
        Ok(Some(lift))
    }

    /// The snapshot at the top: the last one of the hold, else the one where the grasped organ is highest.
    pub(super) fn top(&self) -> &'a Snapshot {
        let up = Directions::of(self.specimen).up;
        let height = |s: &Snapshot| {
            s.nodes.get(self.grasped).map_or(0.0, |n| n.iter().map(|p| p.dot(up)).sum::<f64>() / n.len().max(1) as f64)
        };
        let held = self.run.snapshots.iter().rfind(|s| phase_at(self.run, s.time_s) == Some("hold"));
        let highest = || self.run.snapshots.iter().max_by(|a, b| height(a).total_cmp(&height(b)));
        held.or_else(highest).unwrap_or(&self.run.snapshots[0])
    }

    /// The close-up, at another size.
    pub(super) fn view(&self, scale: usize) -> View {
        let mut view = self.view;
        let s = scale as f64;
        view.camera.width *= scale;
        view.camera.height *= scale;
        view.camera.fx *= s;
        view.camera.fy *= s;
        view.camera.cx = (view.camera.cx + 0.5) * s - 0.5;
        view.camera.cy = (view.camera.cy + 0.5) * s - 0.5;
        view
    }

    /// The organ that was cut, if one was.
    pub(super) fn cut(&self) -> Option<&'a CutOrgan> {
        self.run.cut.as_ref()
    }

    /// The last snapshot.
    pub(super) fn last(&self) -> &'a Snapshot {
        self.run.snapshots.last().unwrap_or(&self.run.snapshots[0])
    }

    /// The last snapshot before the cut in which the cutter's blades are open.
    pub(super) fn before_cut(&self) -> Option<&'a Snapshot> {
        let open = |s: &&Snapshot| !s.cut && s.cutter.is_some_and(|cutter| cutter.jaw_angle > CUT_OPENED);
        self.run.snapshots.iter().rfind(open)
    }

    /// The organ that was cut, if it is in pieces in `snapshot`.
    fn in_pieces(&self, snapshot: &Snapshot) -> Option<(usize, &CutSkin<'a>)> {
        let cut = self.run.cut.as_ref().filter(|_| snapshot.cut)?;
        Some((cut.organ, self.cut.as_ref()?))
    }

    /// The deformed surfaces and the instruments.
    pub(super) fn surfaces(&self, snapshot: &Snapshot) -> Vec<Instance> {
        let mut instances = self.organs(snapshot);
        instances.extend(self.instruments(snapshot));
        instances
    }

    /// The deformed surfaces alone.
    pub(super) fn organs(&self, snapshot: &Snapshot) -> Vec<Instance> {
        let mut instances = organ_views::surfaces(self.specimen);
        let in_pieces = self.in_pieces(snapshot);
        for (i, organ) in self.specimen.organs.iter().enumerate() {
            let nodes = &snapshot.nodes[i];
            match in_pieces {
                Some((cut, skin)) if cut == i => {
                    let mesh = skin.surface(organ, &self.skins[i], nodes, colors::organ(i));
                    instances[i] = severed::instance(i, mesh, instances[i].shading.gloss, false);
                }
                _ => self.skins[i].deform(&organ.body, nodes, &mut instances[i].mesh.vertices),
            }
        }
        instances
    }

    /// The deformed elements as wires and the instruments.
    pub(super) fn wires(&self, snapshot: &Snapshot) -> Vec<Instance> {
        let mut instances = organ_views::wires(self.specimen, &snapshot.nodes, None);
        if let Some((i, skin)) = self.in_pieces(snapshot) {
            let mesh = skin.wires(&snapshot.nodes[i], colors::organ(i));
            instances[i] = severed::instance(i, mesh, 0.0, true);
        }
        instances.extend(self.instruments(snapshot));
        instances
    }

    fn instruments(&self, snapshot: &Snapshot) -> Vec<Instance> {
        let meshes = [Some(snapshot.gripper.surface()), snapshot.cutter.as_ref().map(Gripper::cutter_surface)];
        let shading = Shading { color: METAL, gloss: 0.9, wireframe: false };
        let label = organ_views::label(self.specimen.organs.len());
        meshes.into_iter().flatten().map(|mesh| Instance { mesh, label, shading }).collect()
    }

    /// Frames the grasped organ in rest and at the top, seen from where most of it is visible.
    fn best_view(&self) -> View {
        let top = self.top();
        let first = &self.run.snapshots[0];
        let tip = |s: &Snapshot| s.gripper.pose.transform(DVec3::new(0.012, 0.0, 0.0));
        let mut points = vec![tip(first), tip(top)];
        points.truncate(if (tip(first) - tip(top)).length() < 0.05 { 2 } else { 0 });
        points.push(tip(top));
        // What is cut off is carried on, out of the picture otherwise.
        let last = self.run.cut.is_some().then(|| self.last());
        points.extend(last.map(tip));
        for s in [Some(first), Some(top), last].into_iter().flatten() {
            points.extend(s.nodes.get(self.grasped).into_iter().flatten());
        }
        let d = Directions::of(self.specimen);
        let sideways = [-0.9, -0.35, 0.35, 0.9];
        let heights = [0.45, 0.75];
        let instances = self.surfaces(last.unwrap_or(top));
        let scene = PhongScene::new(instances, None, VIEW_GROUND);
        let mut best: Option<(usize, View)> = None;
        for height in heights {
            for side in sideways {
                let from = height * d.up + d.front * (1.0 - 0.5 * f64::abs(side)) + side * d.right;
                let small = View::framing(&points, from, d.up, (SIZE.0 / 4, SIZE.1 / 4));
                let frame = scene.render(&small.camera, &small.pose, 1);
                let seen = frame.labels.iter().filter(|l| **l == organ_views::label(self.grasped)).count();
                if best.as_ref().is_none_or(|b| seen > b.0) {
                    best = Some((seen, View::framing(&points, from, d.up, SIZE)));
                }
            }
        }
        best.map_or(self.view, |b| b.1)
    }

    /// The snapshots that are shown: from the approach on, evenly thinned.
    pub(super) fn shown(&self) -> Vec<&'a Snapshot> {
        let all = &self.run.snapshots;
        let start = all.iter().position(|s| phase_at(self.run, s.time_s).is_some_and(|p| p != "settle")).unwrap_or(0);
        let active = &all[start..];
        let n = active.len().min(MOST_FRAMES);
        (0..n).map(|i| &active[if n < 2 { 0 } else { i * (active.len() - 1) / (n - 1) }]).collect()
    }

    /// How many times faster than life the moving picture runs.
    pub(super) fn pace(&self) -> f64 {
        let shown = self.shown();
        match (shown.first(), shown.last()) {
            (Some(a), Some(b)) if shown.len() > 1 => {
                (b.time_s - a.time_s) / ((shown.len() - 1) as f64 * f64::from(DELAY) / 100.0)
            }
            _ => 1.0,
        }
    }

    /// The GIF: one palette for all frames, unchanged pixels transparent, endless.
    pub(super) fn gif(&self) -> Result<Vec<u8>> {
        let frames: Vec<_> = self
            .shown()
            .into_iter()
            .map(|snapshot| {
                let scene = PhongScene::new(self.surfaces(snapshot), Some(self.light()), VIEW_GROUND);
                scene.render(&self.view.camera, &self.view.pose, 2).color
            })
            .collect();
        let (width, height) = (SIZE.0 as u16, SIZE.1 as u16);
        let palette = Palette::of(&frames);
        let mut bytes = Vec::new();
        let mut encoder = gif::Encoder::new(&mut bytes, width, height, &palette.rgb)?;
        encoder.set_repeat(gif::Repeat::Infinite)?;
        // Colours that agree in their upper six bits share a palette entry: the search is slow, the difference unseen.
        let mut nearest: Vec<Option<u8>> = vec![None; 1 << 18];
        let mut before: Option<Vec<u8>> = None;
        for (i, frame) in frames.iter().enumerate() {
            let indices: Vec<u8> = frame
                .pixels
                .iter()
                .map(|p| *nearest[upper_bits(*p)].get_or_insert_with(|| palette.index(*p)))
                .collect();
            let buffer: Vec<u8> = match &before {
                Some(before) => indices.iter().zip(before).map(|(a, b)| if a == b { UNCHANGED } else { *a }).collect(),
                None => indices.clone(),
            };
            encoder.write_frame(&gif::Frame {
                width,
                height,
                buffer: buffer.into(),
                delay: if i + 1 == frames.len() { LAST_DELAY } else { DELAY },
                dispose: gif::DisposalMethod::Keep,
                transparent: Some(UNCHANGED),
                ..gif::Frame::default()
            })?;
            before = Some(indices);
        }
        drop(encoder);
        Ok(bytes)
    }

    fn light(&self) -> DVec3 {
        self.view.pose.rotation * DVec3::new(-0.45, -0.8, -0.9)
    }
}

/// Whether `cut` is a cut of `organ`: as many elements, and no node that it has not.
fn is_of(cut: &CutOrgan, organ: &trocar_specimen::Organ) -> bool {
    let (nodes, copies) = (organ.body.vertices.len(), cut.parents.len());
    let known = |i: &u32| (*i as usize) < copies;
    cut.tets.len() == organ.body.tets.len()
        && cut.piece.len() == copies
        && cut.parents.iter().all(|i| (*i as usize) < nodes)
        && cut.tets.iter().flatten().all(known)
        && cut.faces.iter().flatten().all(known)
}

/// Up to 255 colours that serve all frames, and one entry to spare for [`UNCHANGED`].
struct Palette {
    quantizer: NeuQuant,
    rgb: Vec<u8>,
}

impl Palette {
    fn of(frames: &[trocar_camera::ColorImage]) -> Self {
        // A ninth of all pixels is enough for 255 colours.
        let sample = frames.iter().step_by(3).flat_map(|f| f.pixels.iter().step_by(3));
        let rgba: Vec<u8> = sample.flat_map(|p| [p[0], p[1], p[2], 255]).collect();
        let quantizer = NeuQuant::new(10, 255, &rgba);
        let mut rgb = quantizer.color_map_rgb();
        rgb.resize(256 * 3, 0);
        Self { quantizer, rgb }
    }

    fn index(&self, [r, g, b]: [u8; 3]) -> u8 {
        self.quantizer.index_of(&[r, g, b, 255]).min(usize::from(UNCHANGED) - 1) as u8
    }
}

/// The upper six bits of each channel as one number.
fn upper_bits([r, g, b]: [u8; 3]) -> usize {
    usize::from(r >> 2) << 12 | usize::from(g >> 2) << 6 | usize::from(b >> 2)
}

/// Phase of the sample nearest to a time.
pub(super) fn phase_at(run: &GraspLiftRun, time: f64) -> Option<&'static str> {
    let distance = |s: &&trocar_cell::Sample| (s.time_s - time).abs();
    run.samples.iter().min_by(|a, b| distance(a).total_cmp(&distance(b))).map(|s| s.phase)
}
