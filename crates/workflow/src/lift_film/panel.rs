//! One panel of a film: a magnified part of a picture of the recording's camera with landmarks,
//! plane and grasp drawn in.

use super::moment::Moment;
use super::{FILMED, SIMULATED};
use crate::Result;
use glam::{DVec2, DVec3};
use image::imageops::{FilterType, resize};
use image::{Rgb, RgbImage};
use trocar_camera::{Camera, ColorImage, DepthImage, Mask};
use trocar_measure::{MeasuredLift, Plane};
use trocar_report::canvas::{Canvas, Pen, RIM};
use trocar_report::overlays;

/// Colours of plane and grasp.
pub(super) const PLANE: [u8; 3] = [235, 238, 240];
pub(super) const GRASP: [u8; 3] = [255, 255, 255];

/// Room around the lift in the picture (px of the recording).
const MARGIN: usize = 14;

/// The plane is drawn this far beyond the organ's centreline, with a line this often (m).
const BEYOND: f64 = 0.018;
const HATCH: f64 = 0.006;

/// Length of a piece of those lines (m).
const PIECE: f64 = 1e-3;

/// Tissue that stands at least so high over the plane hides it (m); less is its unevenness.
const HIDES: f64 = 4e-3;

/// Radius of landmarks and of the grasp (px).
pub(super) const MARK: f64 = 4.5;
const HELD: f64 = 11.0;

/// A picture with its depth.
#[derive(Clone, Copy)]
pub(super) struct Seen<'a> {
    pub color: &'a ColorImage,
    pub depth: &'a DepthImage,
}

/// The part of the camera's picture that panels show.
pub(super) struct Panel {
    camera: Camera,
    plane: Plane,
    /// Sides of the drawn part of the plane: corner, and its two edges (m).
    sheet: [DVec3; 3],
    /// Corners of the shown part (px of the recording).
    part: [usize; 4],
    size: [usize; 2],
}

impl Panel {
    /// The part that shows a lift, in panels of `size` (px).
    pub fn around(camera: Camera, lift: &MeasuredLift, moments: &[Moment], size: [usize; 2]) -> Self {
        let sheet = sheet(lift);
        let [corner, along, across] = sheet;
        let corners = [corner, corner + along, corner + across, corner + along + across];
        let moving = moments.iter().flat_map(|m| m.landmarks.iter().flatten().chain(m.grasp.iter().flatten())).copied();
        let mut shown = Mask::new(camera.width, camera.height);
        for p in corners.into_iter().chain(moving).filter_map(|p| camera.project(p)) {
            let at = |v: f64, n: usize| v.round().clamp(0.0, n as f64 - 1.0) as usize;
            shown.set[at(p.y, camera.height) * camera.width + at(p.x, camera.width)] = true;
        }
        let whole = [0, 0, camera.width, camera.height];
        let part = overlays::crop_box(&shown, MARGIN, size[0] as f64 / size[1] as f64).unwrap_or(whole);
        Self { camera, plane: lift.plane, sheet, part, size }
    }

    /// Where a point of the camera's frame (m) is on a panel; `None` behind the camera.
    pub fn place(&self, p: DVec3) -> Option<DVec2> {
        // The middle of the camera's first pixel is (0, 0), that of a canvas (0.5, 0.5).
        let pixel = self.camera.project(p)? - DVec2::new(self.part[0] as f64, self.part[1] as f64) + 0.5;
        Some(pixel * self.scale())
    }

    /// Pixels of a panel for one of the recording.
    fn scale(&self) -> DVec2 {
        let [x0, y0, x1, y1] = self.part;
        DVec2::new(self.size[0] as f64 / (x1 - x0) as f64, self.size[1] as f64 / (y1 - y0) as f64)
    }

    /// The part of a picture, magnified.
    pub fn magnified(&self, picture: &ColorImage) -> ColorImage {
        let part = overlays::crop(picture, self.part);
        let pixel = |x: u32, y: u32| Rgb(part.pixels[y as usize * part.width + x as usize]);
        let small = RgbImage::from_fn(part.width as u32, part.height as u32, pixel);
        let large = resize(&small, self.size[0] as u32, self.size[1] as u32, FilterType::CatmullRom);
        ColorImage { width: self.size[0], height: self.size[1], pixels: large.pixels().map(|p| p.0).collect() }
    }

    /// The filmed frame with the measured lift.
    pub fn filmed(&self, seen: Seen<'_>, measured: &Moment) -> Result<ColorImage> {
        let mut canvas = self.begin(seen)?;
        self.landmarks(&mut canvas, measured, FILMED);
        self.grasp(&mut canvas, measured);
        Ok(canvas.picture())
    }

    /// The simulated lift; circles show where its landmarks are in the filmed frame.
    pub fn simulated(&self, seen: Seen<'_>, simulated: &Moment, measured: &Moment) -> Result<ColorImage> {
        let mut canvas = self.begin(seen)?;
        self.landmarks(&mut canvas, simulated, SIMULATED);
        for at in measured.landmarks.iter().flatten().filter_map(|p| self.place(*p)) {
            canvas.ring(at, MARK + 2.5, Pen::new(RIM, 3.5));
            canvas.ring(at, MARK + 2.5, Pen::new(FILMED, 2.0));
        }
        self.grasp(&mut canvas, simulated);
        Ok(canvas.picture())
    }

    /// The magnified picture with the plane.
    fn begin(&self, seen: Seen<'_>) -> Result<Canvas> {
        let mut canvas = Canvas::new(self.size[0], self.size[1], RIM)?;
        canvas.paste(&self.magnified(seen.color), [0, 0]);
        let [corner, along, across] = self.sheet;
        let faint = Pen { opacity: 0.4, ..Pen::new(PLANE, 1.0) };
        let count = (across.length() / HATCH).round().max(1.0) as usize;
        for k in 1..count {
            let from = corner + across * (k as f64 / count as f64);
            self.on_plane(&mut canvas, seen.depth, from, from + along, faint);
        }
        let rim = Pen { opacity: 0.75, ..Pen::new(PLANE, 1.5) };
        let corners = [corner, corner + along, corner + along + across, corner + across];
        for k in 0..4 {
            self.on_plane(&mut canvas, seen.depth, corners[k], corners[(k + 1) % 4], rim);
        }
        Ok(canvas)
    }

    /// Draws the parts of a line of the plane before which nothing stands.
    fn on_plane(&self, canvas: &mut Canvas, depth: &DepthImage, from: DVec3, to: DVec3, pen: Pen) {
        let count = (from.distance(to) / PIECE).ceil().max(1.0) as usize;
        let mut run = Vec::new();
        for i in 0..=count {
            let p = from.lerp(to, i as f64 / count as f64);
            match self.place(p).filter(|_| self.is_free(depth, p)) {
                Some(at) => run.push(at),
                None => canvas.line(&std::mem::take(&mut run), pen),
            }
        }
        canvas.line(&run, pen);
    }

    /// Whether nothing stands before a point of the plane.
    fn is_free(&self, depth: &DepthImage, p: DVec3) -> bool {
        let Some(pixel) = self.camera.project(p) else { return false };
        let (u, v) = (pixel.x.round(), pixel.y.round());
        if u < 0.0 || v < 0.0 || u >= depth.width as f64 || v >= depth.height as f64 {
            return false;
        }
        let z = f64::from(depth.depth[v as usize * depth.width + u as usize]);
        z <= 0.0 || self.plane.height(self.camera.ray(u, v) * z) < HIDES
    }

    /// Landmarks, with a line between neighbours.
    fn landmarks(&self, canvas: &mut Canvas, moment: &Moment, color: [u8; 3]) {
        let places: Vec<Option<DVec2>> = moment.landmarks.iter().map(|p| p.and_then(|p| self.place(p))).collect();
        for run in places.split(Option::is_none) {
            let run: Vec<DVec2> = run.iter().copied().flatten().collect();
            canvas.line(&run, Pen { opacity: 0.6, ..Pen::new(RIM, 3.0) });
            canvas.line(&run, Pen::new(color, 1.5));
        }
        for at in places.into_iter().flatten() {
            canvas.disc(at, MARK + 1.2, RIM);
            canvas.disc(at, MARK, color);
        }
    }

    /// The grasped place, and the way from where it was.
    fn grasp(&self, canvas: &mut Canvas, moment: &Moment) {
        let Some([before, now]) = moment.grasp.map(|places| places.map(|p| self.place(p))) else { return };
        let Some(now) = now else { return };
        if let Some(before) = before.filter(|b| b.distance(now) > HELD) {
            let end = now + (before - now).normalize() * HELD;
            canvas.line(&[before, end], Pen { dash: Some(4.0), ..Pen::new(GRASP, 1.5) });
        }
        canvas.ring(now, HELD, Pen::new(RIM, 4.5));
        canvas.ring(now, HELD, Pen::new(GRASP, 2.5));
    }
}

/// The drawn part of the plane: a rectangle under the organ, level with the picture.
fn sheet(lift: &MeasuredLift) -> [DVec3; 3] {
    let normal = lift.plane.normal;
    let along = (DVec3::X - normal * normal.x).normalize_or(normal.any_orthonormal_vector());
    let across = normal.cross(along);
    let inside = |axis: DVec3| {
        let places = lift.centreline.stations.iter().map(|s| (s.point - lift.plane.point).dot(axis));
        places.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)))
    };
    let ((a0, a1), (b0, b1)) = (inside(along), inside(across));
    let corner = lift.plane.point + along * (a0 - BEYOND) + across * (b0 - BEYOND);
    [corner, along * (a1 - a0 + 2.0 * BEYOND), across * (b1 - b0 + 2.0 * BEYOND)]
}
