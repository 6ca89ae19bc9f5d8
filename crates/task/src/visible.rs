//! How much of a part of an organ a camera sees: a small depth picture of all organs and of the
//! instruments' shafts, and one of the part alone.

use crate::bodies::bodies_of;
use crate::{Error, Result};
use glam::DVec3;
use std::sync::Arc;
use trocar_camera::{Camera, draw_triangle};
use trocar_cell::Cell;
use trocar_core::Pose;
use trocar_scene::{Part, Scene};
use trocar_tissue::Body;

/// Width of the picture (px); its height follows from the camera.
const WIDTH: usize = 192;

/// An instrument hides everything behind it: this far to either side of its axis, and this far from
/// the pivot of its jaws back along the shaft and forward along the closed blades (m). Its axis is
/// drawn in so many pieces, and those behind the camera are left out.
const HALF_SHAFT: f64 = 0.0025;
const SHAFT: f64 = 0.12;
const BLADES: f64 = 0.021;
const PIECES: usize = 12;

/// A camera that looks at a part of an organ.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct View {
    /// From the cell to the camera.
    to_camera: Pose,
    eye: DVec3,
    camera: Camera,
    part: Part,
    surfaces: Arc<[Surface]>,
}

/// The surface of a body.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Surface {
    /// Nodes of the whole body.
    count: usize,
    /// Nodes of the surface.
    nodes: Vec<u32>,
    triangles: Vec<[u32; 3]>,
}

impl Surface {
    /// Those of all bodies of `cell`.
    pub fn all(cell: &Cell) -> Arc<[Self]> {
        let bodies = cell.world().model.bodies().iter();
        let surface = |body: &Body| {
            let (surface, nodes) = body.rest().boundary();
            Self { count: body.len(), nodes, triangles: surface.triangles }
        };
        bodies.map(surface).collect()
    }
}

impl View {
    /// The view of the camera `name` of `scene` on `part` of a cell with these `surfaces`;
    /// `recording` is the specimen's camera.
    pub fn new(
        scene: &Scene,
        name: &str,
        recording: Option<&Camera>,
        part: &Part,
        surfaces: &Arc<[Surface]>,
    ) -> Result<Self> {
        let found = scene.cameras.iter().find(|camera| camera.name == name);
        let model = found.and_then(|camera| Some((camera, camera.model(recording)?)));
        let Some((camera, model)) = model else {
            return Err(Error::Option(format!(
                "the scene has no camera '{name}', or the specimen was recorded by none"
            )));
        };
        let pose = camera.view.pose(&scene.placement);
        let scale = WIDTH as f64 / model.width as f64;
        // The middle of the first pixel is 0.
        let middle = |c: f64| (c + 0.5) * scale - 0.5;
        let small = Camera {
            width: WIDTH,
            height: ((model.height as f64 * scale).round() as usize).max(1),
            fx: scale * model.fx,
            fy: scale * model.fy,
            cx: middle(model.cx),
            cy: middle(model.cy),
            distortion: model.distortion,
        };
        Ok(Self {
            to_camera: pose.inverse(),
            eye: pose.translation,
            camera: small,
            part: part.clone(),
            surfaces: Arc::clone(surfaces),
        })
    }

    /// Of the pixels that the part alone would cover, the share that it covers; 0 where it would
    /// cover none.
    pub fn share(&self, cell: &Cell) -> Result<f64> {
        let world = cell.world();
        let of_part = bodies_of(cell, &self.part.organ);
        let mut alone = Depths::new(&self.camera);
        let mut all = Depths::new(&self.camera);
        // A cut has made other bodies.
        let bodies = world.model.bodies();
        let same =
            bodies.len() == self.surfaces.len() && bodies.iter().zip(&*self.surfaces).all(|(b, s)| b.len() == s.count);
        let surfaces = if same { Arc::clone(&self.surfaces) } else { Surface::all(cell) };
        for (body, Surface { nodes, triangles, .. }) in surfaces.iter().enumerate() {
            let s = &world.axes[body].s;
            let inside = |node: u32| (self.part.range[0]..=self.part.range[1]).contains(&s[node as usize]);
            let seen: Vec<Option<DVec3>> =
                nodes.iter().map(|i| self.seen(world.state.position(&world.model, body, *i as usize))).collect();
            for triangle in triangles {
                let [Some(a), Some(b), Some(c)] = triangle.map(|i| seen[i as usize]) else { continue };
                let is_part = of_part.contains(&body) && triangle.iter().all(|i| inside(nodes[*i as usize]));
                all.draw([a, b, c], is_part);
                if is_part {
                    alone.draw([a, b, c], true);
                }
            }
        }
        for (side, _) in cell.arms() {
            self.draw_instrument(&cell.measured_cp(side.name())?, &mut all);
        }
        let (whole, left) = (alone.count(), all.count());
        Ok(if whole == 0 { 0.0 } else { left as f64 / whole as f64 })
    }

    /// Pixel and inverse depth (1/m) of a point (m, cell); `None` behind the camera.
    fn seen(&self, p: DVec3) -> Option<DVec3> {
        let q = self.to_camera.transform(p);
        Some(self.camera.project(q)?.extend(1.0 / q.z))
    }

    /// Draws an instrument as a strip along its axis that faces the camera.
    fn draw_instrument(&self, tip: &Pose, all: &mut Depths) {
        let axis = tip.rotation * DVec3::X;
        let ends = |k: usize| {
            let at = tip.translation + (BLADES - (SHAFT + BLADES) * k as f64 / PIECES as f64) * axis;
            let side = HALF_SHAFT * axis.cross(at - self.eye).normalize_or_zero();
            [self.seen(at - side), self.seen(at + side)]
        };
        for k in 0..PIECES {
            let ([Some(a), Some(b)], [Some(c), Some(d)]) = (ends(k), ends(k + 1)) else { continue };
            all.draw([a, b, c], false);
            all.draw([b, c, d], false);
        }
    }
}

/// The nearest surface of each pixel: its depth (m), and whether it is of the part.
struct Depths {
    width: usize,
    height: usize,
    nearest: Vec<(f64, bool)>,
}

impl Depths {
    fn new(camera: &Camera) -> Self {
        let (width, height) = (camera.width, camera.height);
        Self { width, height, nearest: vec![(f64::INFINITY, false); width * height] }
    }

    fn draw(&mut self, corners: [DVec3; 3], is_part: bool) {
        draw_triangle(corners, self.width, self.height, |pixel, depth| {
            if depth < self.nearest[pixel].0 {
                self.nearest[pixel] = (depth, is_part);
            }
        });
    }

    /// Pixels of the part.
    fn count(&self) -> usize {
        self.nearest.iter().filter(|(_, is_part)| *is_part).count()
    }
}
