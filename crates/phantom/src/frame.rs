//! Single frames: the static view with instruments in front, as the sensor records it.

use crate::instruments::Instrument;
use crate::sensor::{self, Sensor};
use crate::static_view::StaticView;
use crate::stereo;
use glam::DVec2;
use trocar_camera::{Camera, ColorImage, DepthImage, Mask};
use trocar_core::Pose;
use trocar_geometry::TriMesh;
use trocar_render::phong::{Instance, PhongScene, Shading};
use trocar_render::srgb;

/// Frames per second.
pub(crate) const RATE_HZ: f64 = 30.0;
/// Margin of the instrument masks (px). Real masks have one too.
const MASK_GROWTH: usize = 2;
/// Rays per side of a pixel for the colour of instruments.
const SAMPLES: usize = 2;

/// A recorded frame.
pub(crate) struct RecordedFrame {
    pub color: ColorImage,
    pub depth: DepthImage,
    /// Pixels covered by instruments, with a margin.
    pub instruments: Mask,
}

/// Recording settings that all frames share.
#[derive(Clone, Copy)]
pub(crate) struct FrameSettings<'a> {
    pub instruments: &'a [Instrument],
    pub camera: &'a Camera,
    pub sensor: Sensor,
    pub seed: u64,
}

/// Something that is drawn in front of the static view.
pub(crate) struct Layer {
    pub mesh: TriMesh,
    pub shading: Shading,
    /// Whether the instrument mask holds its pixels.
    pub instrument: bool,
}

/// The shading of an instrument.
pub(crate) const METAL: Shading = Shading { color: [160; 3], gloss: 0.8, wireframe: false };

/// Renders and records frame `index`.
pub(crate) fn record_frame(still: &StaticView, take: &FrameSettings<'_>, index: usize) -> RecordedFrame {
    let time = index as f64 / RATE_HZ;
    let layer = |i: &Instrument| Layer { mesh: i.mesh(time), shading: METAL, instrument: true };
    record_layers(still, take, take.instruments.iter().map(layer), index)
}

/// Renders and records frame `index` with `layers` in front of the static view.
pub(crate) fn record_layers(
    still: &StaticView,
    take: &FrameSettings<'_>,
    layers: impl IntoIterator<Item = Layer>,
    index: usize,
) -> RecordedFrame {
    let FrameSettings { camera, sensor, seed, .. } = *take;
    let mut canvas = Canvas {
        color: still.frame.color.clone(),
        depth: still.frame.depth.clone(),
        facing: still.frame.facing.clone(),
        instruments: Mask::new(camera.width, camera.height),
    };
    for layer in layers {
        if let Some(window) = Window::around(&layer.mesh, camera) {
            window.draw(layer, camera, still.lamp_distance, &mut canvas);
        }
    }
    let Canvas { mut color, mut depth, facing, instruments } = canvas;
    if sensor == Sensor::Stereo {
        stereo::add_error(&mut depth, seed, index);
    }
    sensor::add_noise(&mut color, &mut depth, &facing, seed, index);
    RecordedFrame { color, depth, instruments: sensor::dilate(&instruments, MASK_GROWTH) }
}

/// The frame while instruments are drawn.
struct Canvas {
    color: ColorImage,
    depth: DepthImage,
    /// Cosine between the surface normal and the ray at each pixel.
    facing: Vec<f32>,
    instruments: Mask,
}

/// The part of the image that an instrument can cover. Only this part is rendered.
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
            // So close to the lens, triangles can reach anywhere: the window is the whole image.
            let pixel = if p.z < 0.02 { None } else { camera.project(*p) };
            let (a, b) = pixel.map_or((DVec2::ZERO, size), |q| (q, q));
            // A vertex far outside the image does not extend the window; triangles are small
            // compared with this distance.
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

    /// The camera of this window.
    fn camera(&self, whole: &Camera) -> Camera {
        let (cx, cy) = (whole.cx - self.u as f64, whole.cy - self.v as f64);
        Camera { width: self.width, height: self.height, cx, cy, ..*whole }
    }

    /// Draws the layer in front of the canvas. Its rim is blended by the share of rays that hit.
    fn draw(&self, layer: Layer, camera: &Camera, lamp_distance: f32, canvas: &mut Canvas) {
        let Canvas { color, depth, facing, instruments } = canvas;
        let Layer { mesh, shading, instrument } = layer;
        let scene = PhongScene::new(vec![Instance { mesh, label: 1, shading }], None, [0; 3]);
        let own = self.camera(camera);
        let centres = scene.render(&own, &Pose::IDENTITY, 1);
        let fine = scene.render(&own.finer(SAMPLES), &Pose::IDENTITY, 1);
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
                        let lamp = sensor::lamp_brightness(camera, x as f64, y as f64, z, lamp_distance);
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
                    instruments.set[i] |= instrument;
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
    fn window_covers_the_whole_instrument() {
        let camera = Camera { width: 424, height: 240, fx: 223.4, fy: 223.4, cx: 211.5, cy: 119.5, ..Camera::d405() };
        let masked = |window: &Window, mesh: TriMesh| {
            let mut canvas = Canvas {
                color: ColorImage::new(camera.width, camera.height, [0; 3]),
                depth: DepthImage::new(camera.width, camera.height),
                facing: vec![0.0; camera.width * camera.height],
                instruments: Mask::new(camera.width, camera.height),
            };
            window.draw(Layer { mesh, shading: METAL, instrument: true }, &camera, 0.15, &mut canvas);
            (canvas.color, canvas.instruments)
        };
        for frame in (0..180).step_by(20) {
            for instrument in instruments::pair(&crate::phantom_a::SPEC.reach, 0.7) {
                let mesh = instrument.mesh(frame as f64 / RATE_HZ);
                let window = Window::around(&mesh, &camera).unwrap();
                let whole = Window { u: 0, v: 0, width: camera.width, height: camera.height };
                assert!(masked(&window, mesh.clone()) == masked(&whole, mesh), "frame {frame}");
            }
        }
    }
}
