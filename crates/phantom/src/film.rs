//! Single frames: the still picture with the instruments before it, as the sensor gives it.

use crate::instruments::Instrument;
use crate::sensor::{self, Sensor};
use crate::stereo;
use crate::still::Still;
use glam::DVec2;
use trocar_camera::{Camera, ColorImage, DepthImage, Mask};
use trocar_core::Pose;
use trocar_geometry::TriMesh;
use trocar_render::{Instance, Scene, Shading, srgb};

/// Frames per second.
pub(crate) const RATE_HZ: f64 = 30.0;
/// Growth of the instrument masks: real ones are generous too [px].
const MASK_GROWTH: usize = 2;
/// Rays a pixel and direction for the colour of instruments.
const SAMPLES: usize = 2;

/// One recorded frame.
pub(crate) struct Shot {
    pub color: ColorImage,
    pub depth: DepthImage,
    /// Pixels covered by instruments, grown.
    pub instruments: Mask,
}

/// How a recording is filmed.
#[derive(Clone, Copy)]
pub(crate) struct Take<'a> {
    pub instruments: &'a [Instrument],
    pub camera: &'a Camera,
    pub sensor: Sensor,
    pub seed: u64,
}

/// Films frame `index`.
pub(crate) fn shoot(still: &Still, take: &Take<'_>, index: usize) -> Shot {
    let Take { instruments, camera, sensor, seed } = *take;
    let mut canvas = Canvas {
        color: still.frame.color.clone(),
        depth: still.frame.depth.clone(),
        facing: still.frame.facing.clone(),
        instruments: Mask::new(camera.width, camera.height),
    };
    for instrument in instruments {
        let mesh = instrument.mesh(index as f64 / RATE_HZ);
        if let Some(window) = Window::around(&mesh, camera) {
            window.draw(mesh, camera, still.lit_at, &mut canvas);
        }
    }
    let Canvas { mut color, mut depth, facing, instruments } = canvas;
    if sensor == Sensor::Stereo {
        stereo::bend(&mut depth, seed, index);
    }
    sensor::expose(&mut color, &mut depth, &facing, seed, index);
    Shot { color, depth, instruments: sensor::dilate(&instruments, MASK_GROWTH) }
}

/// What has been drawn so far.
struct Canvas {
    color: ColorImage,
    depth: DepthImage,
    /// Cosine of view and surface at each pixel.
    facing: Vec<f32>,
    instruments: Mask,
}

/// The part of the image that an instrument can cover; nothing else needs rays.
struct Window {
    u: usize,
    v: usize,
    width: usize,
    height: usize,
}

impl Window {
    fn around(mesh: &TriMesh, camera: &Camera) -> Option<Self> {
        let size = DVec2::new(camera.width as f64, camera.height as f64);
        let margin = DVec2::splat(0.1 * size.x);
        let (mut low, mut high) = (DVec2::MAX, DVec2::MIN);
        for p in &mesh.vertices {
            // Too near the lens to say where its triangles reach: then the window is the image.
            let pixel = if p.z < 0.02 { None } else { camera.project(*p) };
            let (a, b) = pixel.map_or((DVec2::ZERO, size), |q| (q, q));
            // What is far beside the image widens nothing; triangles are small against this distance.
            let beside = a.cmplt(-margin).any() || a.cmpgt(size + margin).any();
            if !beside {
                (low, high) = (low.min(a), high.max(b));
            }
        }
        let low = (low - 2.0).floor().clamp(DVec2::ZERO, size);
        let high = (high + 3.0).ceil().clamp(DVec2::ZERO, size);
        let extent = high - low;
        (extent.x > 0.0 && extent.y > 0.0).then_some(Self {
            u: low.x as usize,
            v: low.y as usize,
            width: extent.x as usize,
            height: extent.y as usize,
        })
    }

    /// The camera that sees only this window, with `finer` times as many pixels a side.
    fn camera(&self, whole: &Camera, finer: usize) -> Camera {
        let k = finer as f64;
        Camera {
            width: self.width * finer,
            height: self.height * finer,
            fx: whole.fx * k,
            fy: whole.fy * k,
            cx: (whole.cx - self.u as f64 + 0.5) * k - 0.5,
            cy: (whole.cy - self.v as f64 + 0.5) * k - 0.5,
            distortion: whole.distortion,
        }
    }

    /// Draws the instrument before what is there. Its rim is blended by the share of rays that hit.
    fn draw(&self, mesh: TriMesh, camera: &Camera, lit_at: f32, canvas: &mut Canvas) {
        let Canvas { color, depth, facing, instruments } = canvas;
        let shading = Shading { color: [160; 3], gloss: 0.8, wireframe: false };
        let scene = Scene::new(vec![Instance { mesh, label: 1, shading }], None, [0; 3]);
        let centres = scene.render(&self.camera(camera, 1), &Pose::IDENTITY, 1);
        let fine = scene.render(&self.camera(camera, SAMPLES), &Pose::IDENTITY, 1);
        for v in 0..self.height {
            for u in 0..self.width {
                let (x, y) = (self.u + u, self.v + v);
                let i = y * camera.width + x;
                let behind = depth.depth[i];
                let before = |z: f32| z > 0.0 && (behind <= 0.0 || z < behind);
                let mut sum = [0.0; 3];
                let mut hits = 0;
                for k in 0..SAMPLES * SAMPLES {
                    let at = (v * SAMPLES + k / SAMPLES) * self.width * SAMPLES + u * SAMPLES + k % SAMPLES;
                    let z = fine.depth.depth[at];
                    if before(z) {
                        hits += 1;
                        let light = srgb::to_linear(fine.color.pixels[at]);
                        let lamp = sensor::lamp(camera, x as f64, y as f64, z, lit_at);
                        sum = [0, 1, 2].map(|c| sum[c] + light[c] * lamp);
                    }
                }
                if hits > 0 {
                    let rest = srgb::to_linear(color.pixels[i]).map(|l| l * (SAMPLES * SAMPLES - hits) as f32);
                    color.pixels[i] =
                        srgb::from_linear([0, 1, 2].map(|c| (sum[c] + rest[c]) / (SAMPLES * SAMPLES) as f32));
                }
                let z = centres.depth.depth[v * self.width + u];
                if before(z) {
                    depth.depth[i] = z;
                    facing[i] = centres.facing[v * self.width + u];
                    instruments.set[i] = true;
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::instruments;

    #[test]
    fn nothing_of_an_instrument_is_cut_off_by_its_window() {
        let camera = Camera { width: 424, height: 240, fx: 223.4, fy: 223.4, cx: 211.5, cy: 119.5, ..Camera::d405() };
        let masked = |window: &Window, mesh: TriMesh| {
            let mut canvas = Canvas {
                color: ColorImage::new(camera.width, camera.height, [0; 3]),
                depth: DepthImage::new(camera.width, camera.height),
                facing: vec![0.0; camera.width * camera.height],
                instruments: Mask::new(camera.width, camera.height),
            };
            window.draw(mesh, &camera, 0.15, &mut canvas);
            (canvas.color, canvas.instruments)
        };
        for frame in (0..180).step_by(20) {
            for instrument in instruments::pair(&crate::phantom_a::PLAN.reach, 0.7) {
                let mesh = instrument.mesh(frame as f64 / RATE_HZ);
                let window = Window::around(&mesh, &camera).unwrap();
                let whole = Window { u: 0, v: 0, width: camera.width, height: camera.height };
                assert!(masked(&window, mesh.clone()) == masked(&whole, mesh), "frame {frame}");
            }
        }
    }
}
