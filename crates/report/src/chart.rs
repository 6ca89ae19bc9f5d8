//! Curves on a canvas, for plots that move. A plot of a page is a [`Plot`](crate::plots::Plot).

use crate::axis::{decimal, ticks};
use crate::canvas::{Anchor, Canvas, Pen, TEXT};
use glam::DVec2;

/// Room for the labels of the axes (px): at the left, and below.
const LEFT: f64 = 52.0;
const BELOW: f64 = 50.0;

/// Room above and at the right (px).
const ABOVE: f64 = 10.0;
const RIGHT: f64 = 12.0;

/// Opacity of bridged parts of a curve.
const BRIDGED: f64 = 0.4;

/// A curve.
pub struct Curve {
    /// Points (x, y), and whether the curve is known there. Between others it is drawn faintly.
    pub points: Vec<(f64, f64, bool)>,
    /// Colour (sRGB).
    pub color: [u8; 3],
}

/// A level line between marked ends, from which dashed lines go down to the axis.
pub struct Span {
    /// Its ends.
    pub x: [f64; 2],
    /// Its height.
    pub y: f64,
    /// Colour (sRGB).
    pub color: [u8; 3],
    /// What it is, below its middle.
    pub name: &'static str,
}

/// Axes with curves. The ranges are given: they must not change from frame to frame.
pub struct Chart<'a> {
    /// Label of the x axis, with its unit.
    pub x: &'a str,
    /// Label above the y axis.
    pub y: &'a str,
    /// Ends of the x axis.
    pub x_range: (f64, f64),
    /// Ends of the y axis.
    pub y_range: (f64, f64),
    /// Curves.
    pub curves: Vec<Curve>,
    /// Level lines.
    pub spans: Vec<Span>,
}

impl Chart<'_> {
    /// Draws the chart between two corners of the canvas.
    pub fn draw(&self, canvas: &mut Canvas, from: DVec2, to: DVec2) {
        let (low, high) = (DVec2::new(from.x + LEFT, to.y - BELOW), DVec2::new(to.x - RIGHT, from.y + ABOVE));
        let share = |v: f64, (a, b): (f64, f64)| (v - a) / (b - a).max(f64::MIN_POSITIVE);
        let place = |x: f64, y: f64| low + DVec2::new(share(x, self.x_range), share(y, self.y_range)) * (high - low);
        let grid = Pen { opacity: 0.16, ..Pen::new(TEXT, 1.0) };
        for x in ticks(false, self.x_range.0, self.x_range.1, 9) {
            let at = place(x, self.y_range.0);
            canvas.line(&[at, DVec2::new(at.x, high.y)], grid);
            let label = decimal(x, self.x_range.1 - self.x_range.0).replace('\u{2212}', "-");
            canvas.text(at + DVec2::new(0.0, 14.0), Anchor::Middle, TEXT, &label);
        }
        for y in ticks(false, self.y_range.0, self.y_range.1, 4) {
            let at = place(self.x_range.0, y);
            canvas.line(&[at, DVec2::new(high.x, at.y)], grid);
            let label = decimal(y, self.y_range.1 - self.y_range.0).replace('\u{2212}', "-");
            canvas.text(at - DVec2::new(8.0, 0.0), Anchor::Right, TEXT, &label);
        }
        canvas.text(DVec2::new(0.5 * (low.x + high.x), to.y - 12.0), Anchor::Middle, TEXT, self.x);
        canvas.text(DVec2::new(low.x + 8.0, high.y + 8.0), Anchor::Left, TEXT, self.y);
        for curve in &self.curves {
            // One line for each part that is known, or bridged, throughout.
            let mut rest = &curve.points[..];
            while rest.len() > 1 {
                let known = |i: usize| rest[i].2 && rest[i + 1].2;
                let end = (1..rest.len() - 1).find(|i| known(*i) != known(0)).unwrap_or(rest.len() - 1);
                let part: Vec<DVec2> = rest[..=end].iter().map(|(x, y, _)| place(*x, *y)).collect();
                let opacity = if known(0) { 1.0 } else { BRIDGED };
                canvas.line(&part, Pen { opacity, ..Pen::new(curve.color, 2.5) });
                rest = &rest[end..];
            }
        }
        for span in &self.spans {
            let ends = span.x.map(|x| place(x, span.y));
            canvas.line(&ends, Pen { opacity: 0.5, ..Pen::new(span.color, 1.5) });
            for end in ends {
                canvas.line(&[end, DVec2::new(end.x, low.y)], Pen { dash: Some(4.0), ..Pen::new(span.color, 1.5) });
                canvas.disc(end, 4.0, span.color);
            }
            canvas.text(0.5 * (ends[0] + ends[1]) + DVec2::new(0.0, 14.0), Anchor::Middle, TEXT, span.name);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_curve_is_drawn_over_its_values() {
        let mut canvas = Canvas::new(400, 200, [0; 3]).unwrap();
        let points = (0..=10).map(|i| (f64::from(i), 1.0, i < 4)).collect();
        let curves = vec![Curve { points, color: [250, 0, 0] }];
        let spans = vec![Span { x: [2.0, 8.0], y: 0.5, color: [0, 0, 250], name: "" }];
        let chart = Chart { x: "way (mm)", y: "", x_range: (0.0, 10.0), y_range: (0.0, 1.0), curves, spans };
        chart.draw(&mut canvas, DVec2::ZERO, DVec2::new(400.0, 200.0));
        let picture = canvas.picture();
        let at = |x: f64, y: f64| picture.pixels[y as usize * 400 + x as usize];
        let (left, right, bottom) = (LEFT, 400.0 - RIGHT, 200.0 - BELOW);
        let along = |x: f64| left + 0.1 * x * (right - left);
        let ([bright, ..], [faint, ..]) = (at(along(1.5), ABOVE), at(along(7.5), ABOVE));
        assert!(bright > 240 && (70..140).contains(&faint), "{bright} where it is known, {faint} where not");
        let middle = 0.5 * (ABOVE + bottom);
        assert!(at(along(2.0), middle)[2] > 240 && at(along(8.0), middle)[2] > 240);
        assert!(at(along(9.5), middle)[2] < 60, "only the grid is there");
    }
}
