//! A picture to draw on: smooth lines, discs and text, for films, whose drawings move with the
//! tissue.

use crate::{Error, Result};
use glam::DVec2;
use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};
use tiny_skia::{
    Color, FillRule, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, PremultipliedColorU8, Rect, Stroke,
    StrokeDash, Transform,
};
use trocar_camera::ColorImage;

/// Colour of text and axes on the ground of views.
pub const TEXT: [u8; 3] = [226, 231, 235];

/// Rim of marks; it separates them from tissue of any colour.
pub const RIM: [u8; 3] = [16, 20, 24];

/// Height of a line of text (px).
pub const LINE: f64 = 23.0;

const WEIGHT: FontWeight = FontWeight::Regular;
const HEIGHT: RasterHeight = RasterHeight::Size20;

/// How a line is drawn.
#[derive(Clone, Copy, Debug)]
pub struct Pen {
    /// Its colour (sRGB).
    pub color: [u8; 3],
    /// Its width (px).
    pub width: f64,
    /// 0 to 1.
    pub opacity: f64,
    /// Length of dashes and of the gaps between them (px).
    pub dash: Option<f64>,
}

impl Pen {
    /// A whole, opaque line.
    pub fn new(color: [u8; 3], width: f64) -> Self {
        Self { color, width, opacity: 1.0, dash: None }
    }
}

/// Where a text lies beside its place.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// It begins there.
    Left,
    /// Its middle is there.
    Middle,
    /// It ends there.
    Right,
}

/// A picture to draw on. Places are in pixels; the middle of the first pixel is (0.5, 0.5).
pub struct Canvas {
    pixmap: Pixmap,
}

impl Canvas {
    /// A canvas of one colour.
    ///
    /// # Errors
    /// A size of 0, or one that is too large.
    pub fn new(width: usize, height: usize, color: [u8; 3]) -> Result<Self> {
        let pixmap = u32::try_from(width).ok().zip(u32::try_from(height).ok()).and_then(|(w, h)| Pixmap::new(w, h));
        let mut pixmap =
            pixmap.ok_or_else(|| Error::Mismatch(format!("a picture of {width} x {height} pixels cannot be drawn")))?;
        let [r, g, b] = color;
        pixmap.fill(Color::from_rgba8(r, g, b, 255));
        Ok(Self { pixmap })
    }

    /// Its width (px).
    pub fn width(&self) -> usize {
        self.pixmap.width() as usize
    }

    /// Its height (px).
    pub fn height(&self) -> usize {
        self.pixmap.height() as usize
    }

    /// Puts a picture on it; `at` is the corner of its first pixel. What lies outside is left out.
    pub fn paste(&mut self, picture: &ColorImage, at: [usize; 2]) {
        let (width, height) = (self.width(), self.height());
        for (i, pixel) in picture.pixels.iter().enumerate() {
            let (x, y) = (at[0] + i % picture.width, at[1] + i / picture.width);
            if x < width && y < height {
                self.set(y * width + x, *pixel);
            }
        }
    }

    /// Draws lines through points.
    pub fn line(&mut self, points: &[DVec2], pen: Pen) {
        let mut path = PathBuilder::new();
        for (i, p) in points.iter().enumerate() {
            let (x, y) = (p.x as f32, p.y as f32);
            if i == 0 { path.move_to(x, y) } else { path.line_to(x, y) }
        }
        if let Some(path) = path.finish() {
            self.stroke(&path, pen);
        }
    }

    /// Draws a filled disc of radius `radius` (px).
    pub fn disc(&mut self, middle: DVec2, radius: f64, color: [u8; 3]) {
        if let Some(path) = PathBuilder::from_circle(middle.x as f32, middle.y as f32, radius as f32) {
            self.pixmap.fill_path(&path, &paint(color, 1.0), FillRule::Winding, Transform::identity(), None);
        }
    }

    /// Draws a circle of radius `radius` (px).
    pub fn ring(&mut self, middle: DVec2, radius: f64, pen: Pen) {
        if let Some(path) = PathBuilder::from_circle(middle.x as f32, middle.y as f32, radius as f32) {
            self.stroke(&path, pen);
        }
    }

    /// Fills a rectangle from corner to corner.
    pub fn fill(&mut self, from: DVec2, to: DVec2, color: [u8; 3], opacity: f64) {
        if let Some(rect) = Rect::from_ltrb(from.x as f32, from.y as f32, to.x as f32, to.y as f32) {
            self.pixmap.fill_rect(rect, &paint(color, opacity), Transform::identity(), None);
        }
    }

    /// Writes text, whose middle line is at the height of `at`. Characters that the font lacks are
    /// left out.
    pub fn text(&mut self, at: DVec2, anchor: Anchor, color: [u8; 3], text: &str) {
        let advance = get_raster_width(WEIGHT, HEIGHT);
        let length = (text.chars().count() * advance) as f64;
        let left = match anchor {
            Anchor::Left => at.x,
            Anchor::Middle => at.x - 0.5 * length,
            Anchor::Right => at.x - length,
        };
        let (left, top) = (left.round() as i64, (at.y - 0.5 * HEIGHT.val() as f64).round() as i64);
        let (width, height) = (self.width() as i64, self.height() as i64);
        for (k, letter) in text.chars().enumerate() {
            let Some(glyph) = get_raster(letter, WEIGHT, HEIGHT) else { continue };
            for (row, values) in glyph.rows().enumerate() {
                for (column, value) in values.iter().enumerate().filter(|(_, v)| **v > 0) {
                    let (x, y) = (left + (k * advance + column) as i64, top + row as i64);
                    if (0..width).contains(&x) && (0..height).contains(&y) {
                        let i = (y * width + x) as usize;
                        let under = self.pixmap.pixels()[i];
                        let under = [under.red(), under.green(), under.blue()];
                        self.set(i, crate::colors::mix(under, color, f64::from(*value) / 255.0));
                    }
                }
            }
        }
    }

    /// The picture.
    pub fn picture(&self) -> ColorImage {
        let pixels = self.pixmap.pixels().iter().map(|p| [p.red(), p.green(), p.blue()]).collect();
        ColorImage { width: self.width(), height: self.height(), pixels }
    }

    fn set(&mut self, i: usize, [r, g, b]: [u8; 3]) {
        if let Some(color) = PremultipliedColorU8::from_rgba(r, g, b, 255) {
            self.pixmap.pixels_mut()[i] = color;
        }
    }

    fn stroke(&mut self, path: &Path, pen: Pen) {
        let dash = pen.dash.and_then(|length| StrokeDash::new(vec![length as f32; 2], 0.0));
        let stroke = Stroke {
            width: pen.width as f32,
            line_cap: LineCap::Round,
            line_join: LineJoin::Round,
            dash,
            ..Stroke::default()
        };
        self.pixmap.stroke_path(path, &paint(pen.color, pen.opacity), &stroke, Transform::identity(), None);
    }
}

/// Width of a text (px).
pub fn text_width(text: &str) -> f64 {
    (text.chars().count() * get_raster_width(WEIGHT, HEIGHT)) as f64
}

fn paint([r, g, b]: [u8; 3], opacity: f64) -> Paint<'static> {
    let mut paint = Paint { anti_alias: true, ..Paint::default() };
    paint.set_color_rgba8(r, g, b, (255.0 * opacity.clamp(0.0, 1.0)).round() as u8);
    paint
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn marks_are_where_they_are_drawn() {
        let mut canvas = Canvas::new(60, 40, [0; 3]).unwrap();
        canvas.disc(DVec2::new(20.0, 15.0), 5.0, [200, 0, 0]);
        canvas.line(&[DVec2::new(40.5, 0.0), DVec2::new(40.5, 40.0)], Pen::new([0, 200, 0], 1.0));
        let picture = canvas.picture();
        let red: Vec<usize> = (0..2400).filter(|i| picture.pixels[*i][0] > 100).collect();
        let middle = red.iter().map(|i| DVec2::new((i % 60) as f64 + 0.5, (i / 60) as f64 + 0.5)).sum::<DVec2>();
        assert!((middle / red.len() as f64).distance(DVec2::new(20.0, 15.0)) < 0.01);
        assert!((red.len() as f64 - 25.0 * std::f64::consts::PI).abs() < 10.0, "{}", red.len());
        let green = |x: usize| (0..40).filter(|y| picture.pixels[y * 60 + x][1] > 190).count();
        assert_eq!((green(39), green(40), green(41)), (0, 40, 0));
    }

    #[test]
    fn text_has_its_width_and_stays_inside() {
        let mut canvas = Canvas::new(80, 20, [0; 3]).unwrap();
        canvas.text(DVec2::new(78.0, 10.0), Anchor::Right, TEXT, "d50");
        let set: Vec<usize> = (0..1600).filter(|i| canvas.picture().pixels[*i][0] > 100).collect();
        let columns = || set.iter().map(|i| i % 80);
        assert!(columns().max().unwrap() < 78 && columns().min().unwrap() as f64 >= 78.0 - text_width("d50"));
        assert!(set.len() > 40, "{}", set.len());
        // Beyond the edge, nothing is drawn and nothing panics.
        canvas.text(DVec2::new(-500.0, 90.0), Anchor::Left, TEXT, "far away \u{4e2d}");
        canvas.paste(&ColorImage::new(200, 200, [9; 3]), [70, 15]);
        assert!(Canvas::new(0, 5, [0; 3]).is_err());
    }
}
