//! Line plots as inline SVG. Text and axes have the text colour of the page, through
//! `currentColor`.

use crate::axis::{Axis, decimal, log_label, measurable};
use crate::{Error, Result, page};
use plotters::prelude::*;
use plotters::style::text_anchor::{HPos, Pos, VPos};

const SIZE: (u32, u32) = (560, 300);

/// Placeholder colour of text and axes, replaced by `currentColor`.
const INK: RGBColor = RGBColor(1, 2, 3);
const INK_HEX: &str = "\"#010203\"";

/// Larger values have diverged and are not drawn: the range of the axis would overflow.
const MAX_VALUE: f64 = 1e300;

/// A curve.
pub struct Line {
    /// Points (x, y). A single one is drawn as a dot.
    pub points: Vec<(f64, f64)>,
    /// Colour (sRGB).
    pub color: [u8; 3],
    /// Fills the area down to zero.
    pub filled: bool,
}

impl Line {
    /// A line that is not filled.
    pub fn new(points: Vec<(f64, f64)>, color: [u8; 3]) -> Self {
        Self { points, color, filled: false }
    }
}

/// A shaded interval of the x axis.
pub struct Band {
    /// Its label.
    pub name: String,
    /// Start on the x axis.
    pub from: f64,
    /// End on the x axis.
    pub to: f64,
}

/// A line plot.
#[derive(Default)]
pub struct Plot<'a> {
    /// Title, for screen readers and error messages.
    pub title: &'a str,
    /// Label of the x axis, with its unit.
    pub x: &'a str,
    /// Label of the y axis, with its unit.
    pub y: &'a str,
    /// Lines.
    pub lines: Vec<Line>,
    /// Bands behind the lines.
    pub bands: Vec<Band>,
    /// Values that the y axis always includes.
    pub show: Vec<f64>,
    /// Dashed horizontal lines.
    pub limits: Vec<f64>,
    /// Logarithmic x axis; values at or below 0 are not drawn.
    pub log_x: bool,
    /// Logarithmic y axis; values at or below 0 are not drawn.
    pub log_y: bool,
}

impl Plot<'_> {
    /// The plot above its caption (HTML), as a `<figure>`.
    ///
    /// # Errors
    /// A plot that cannot be drawn.
    pub fn figure(&self, caption: &str) -> Result<String> {
        Ok(page::figure(&self.svg()?, caption))
    }

    /// The plot as an `<svg>`; a sentence if there is nothing to plot.
    ///
    /// # Errors
    /// A plot that cannot be drawn.
    pub fn svg(&self) -> Result<String> {
        let shown_on = |log: bool, v: f64| v.abs() <= MAX_VALUE && (!log || v > 0.0);
        let keep = |&(x, y): &(f64, f64)| shown_on(self.log_x, x) && shown_on(self.log_y, y);
        let scale = |y: f64| if self.log_y { y.log10() } else { y };
        let along = |x: f64| if self.log_x { x.log10() } else { x };
        let lines: Vec<Vec<(f64, f64)>> = self
            .lines
            .iter()
            .map(|l| l.points.iter().filter(|p| keep(p)).map(|&(x, y)| (along(x), scale(y))).collect())
            .collect();
        let Some((left, right)) = range(lines.iter().flatten().map(|p| p.0)) else {
            return Ok(format!("<p class=\"lead\">Nothing to plot for {}.</p>", page::escape(self.title)));
        };
        let (left, right) = measurable((left, right), self.x, self.log_x);
        // Room for values next to a power of ten.
        let beside = if self.log_x { 0.04 * (right - left) } else { 0.0 };
        let x_range = (left - beside, right + beside);
        let shown = self.show.iter().chain(&self.limits).filter(|y| shown_on(self.log_y, **y)).map(|y| scale(*y));
        let (low, high) = range(lines.iter().flatten().map(|p| p.1).chain(shown)).unwrap_or((0.0, 1.0));
        let (low, high) = measurable((low, high), self.y, self.log_y);
        let y_range = if self.log_y {
            (low.floor(), high.ceil().max(low.floor() + 1.0))
        } else {
            let room = 0.06 * (high - low);
            (if low == 0.0 { 0.0 } else { low - room }, high + room)
        };
        let mut svg = String::new();
        self.draw(&lines, x_range, y_range, &mut svg)
            .map_err(|reason| Error::Plot { plot: self.title.to_owned(), reason })?;
        Ok(self.inline(&svg))
    }

    fn draw(
        &self,
        lines: &[Vec<(f64, f64)>],
        (x0, x1): (f64, f64),
        (y0, y1): (f64, f64),
        svg: &mut String,
    ) -> std::result::Result<(), String> {
        let root = SVGBackend::with_string(svg, SIZE).into_drawing_area();
        let top = if self.bands.is_empty() { 10 } else { 24 };
        let mut chart = ChartBuilder::on(&root)
            .margin_top(top)
            .margin_right(14)
            .x_label_area_size(46)
            .y_label_area_size(60)
            .build_cartesian_2d(Axis::new(self.log_x, x0, x1, 9), Axis::new(self.log_y, y0, y1, 6))
            .map_err(|e| e.to_string())?;
        for (i, band) in self.bands.iter().enumerate().filter(|(_, b)| b.to > b.from) {
            let (a, b) = (band.from.clamp(x0, x1), band.to.clamp(x0, x1));
            if i % 2 == 0 {
                let area = Rectangle::new([(a, y0), (b, y1)], INK.mix(0.055).filled());
                chart.draw_series([area]).map_err(|e| e.to_string())?;
            }
            let (left, _) = chart.backend_coord(&(a, y1));
            let (right, y) = chart.backend_coord(&(b, y1));
            // A letter is about 6 pixels wide; a name that does not fit its band is not drawn.
            if right - left > 6 * band.name.len() as i32 {
                let style = text(12).pos(Pos::new(HPos::Center, VPos::Bottom));
                let label = Text::new(band.name.clone(), ((left + right) / 2, y - 5), style);
                root.draw(&label).map_err(|e| e.to_string())?;
            }
        }
        let label = |log: bool, span: f64| move |v: &f64| if log { log_label(*v) } else { decimal(*v, span) };
        let (tick_x, tick) = (label(self.log_x, x1 - x0), label(self.log_y, y1 - y0));
        chart
            .configure_mesh()
            .light_line_style(TRANSPARENT)
            .bold_line_style(INK.mix(0.12))
            .axis_style(INK.mix(0.6))
            .x_label_formatter(&tick_x)
            .y_label_formatter(&tick)
            .x_desc(self.x)
            .y_desc(self.y)
            .label_style(text(14))
            .axis_desc_style(text(15))
            .draw()
            .map_err(|e| e.to_string())?;
        for limit in &self.limits {
            let y = if self.log_y { limit.log10() } else { *limit };
            let dashed = DashedLineSeries::new([(x0, y), (x1, y)], 6, 5, INK.mix(0.55).stroke_width(1));
            chart.draw_series(dashed).map_err(|e| e.to_string())?;
        }
        for (line, points) in self.lines.iter().zip(lines) {
            let color = RGBColor(line.color[0], line.color[1], line.color[2]);
            if line.filled {
                let area = AreaSeries::new(points.iter().copied(), y0.max(0.0), color.mix(0.12));
                chart.draw_series(area).map_err(|e| e.to_string())?;
            }
            if let [point] = points[..] {
                chart.draw_series([Circle::new(point, 4, color.filled())]).map_err(|e| e.to_string())?;
                continue;
            }
            let series = LineSeries::new(points.iter().copied(), color.stroke_width(2));
            chart.draw_series(series).map_err(|e| e.to_string())?;
        }
        root.present().map_err(|e| e.to_string())
    }

    /// The drawing as inline SVG: without size and namespace, in the text colour of the page.
    fn inline(&self, svg: &str) -> String {
        let body = svg.find("<svg").and_then(|a| svg[a..].find('>').map(|b| &svg[a + b + 1..])).unwrap_or("</svg>");
        format!(
            "<svg viewBox=\"0 0 {} {}\" role=\"img\" aria-label=\"{}\">{}",
            SIZE.0,
            SIZE.1,
            page::escape(self.title),
            body.trim_end().replace(INK_HEX, "\"currentColor\"")
        )
    }
}

fn text(size: u32) -> TextStyle<'static> {
    ("sans-serif", size).into_font().color(&INK)
}

/// Smallest and largest value, apart by at least a small amount; none without values.
fn range(values: impl Iterator<Item = f64>) -> Option<(f64, f64)> {
    let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), v| (low.min(v), high.max(v)));
    (low <= high).then(|| if high - low > 1e-12 { (low, high) } else { (low, low + low.abs().max(1.0)) })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plot(points: Vec<(f64, f64)>, log_y: bool) -> String {
        Plot {
            title: "lift <over> time",
            x: "time (s)",
            y: "lift (mm)",
            lines: vec![Line::new(points, [10, 20, 30])],
            bands: vec![Band { name: "settle".into(), from: 0.0, to: 2.0 }],
            show: vec![0.0],
            limits: vec![3.0],
            log_y,
            ..Plot::default()
        }
        .svg()
        .unwrap()
    }

    #[test]
    fn a_plot_has_its_units_and_loads_nothing() {
        let svg = plot((0..100).map(|i| (f64::from(i) * 0.02, f64::from(i))).collect(), false);
        assert!(svg.contains("time (s)") && svg.contains("lift (mm)") && svg.contains("settle"));
        assert!(svg.contains("currentColor") && !svg.contains(INK_HEX) && !svg.contains("http"));
        assert!(svg.contains("lift &lt;over&gt; time") && svg.ends_with("</svg>"));
    }

    #[test]
    fn unusual_data_do_not_panic() {
        assert!(plot(vec![], false).contains("Nothing to plot"));
        assert!(plot(vec![(f64::NAN, 1.0), (0.0, f64::INFINITY)], false).contains("Nothing to plot"));
        assert!(plot(vec![(0.0, 0.0), (1.0, -1.0)], true).contains("Nothing to plot"));
        assert!(plot(vec![(1.0, 2.0)], false).contains("<svg"));
        assert!(plot(vec![(0.0, 1e-9), (1.0, 1e5)], true).contains("10⁻⁹"));
        assert!(plot(vec![(0.0, 1e300), (1.0, -1e300)], false).contains("<svg"));
        // Values of diverged runs.
        assert!(plot(vec![(0.0, 0.0), (1.0, f64::MAX), (f64::MAX, 1.0)], false).contains("<svg"));
    }

    #[test]
    fn differences_that_cannot_be_measured_look_like_none() {
        let of = |unit: &str| {
            let y = format!("largest RCM deviation ({unit})");
            let lines = vec![Line::new(vec![(0.0, 8.000_01), (1.0, 8.000_02)], [10, 20, 30])];
            Plot { title: "noise", x: "time (s)", y: &y, lines, ..Plot::default() }.svg().unwrap()
        };
        let heights = |svg: &str| -> Vec<f64> {
            let line = svg.split("<polyline").find(|p| p.contains("#0A141E")).unwrap();
            let points = line.split("points=\"").nth(1).unwrap().split('"').next().unwrap();
            points.split_whitespace().map(|p| p.split(',').nth(1).unwrap().parse().unwrap()).collect()
        };
        let rise = |unit: &str| heights(&of(unit)).windows(2).map(|h| (h[1] - h[0]).abs()).fold(0.0, f64::max);
        assert!(rise("mm") <= 1.0, "10 nm of 0.01 mm: {}", rise("mm"));
        assert!(rise("share") > 100.0, "{}", rise("share"));
    }

    #[test]
    fn both_axes_may_be_logarithmic() {
        let points = vec![(0.0, 1.0), (1_039.0, 0.5), (10_000.0, 5.0), (99_900.0, 50.0)];
        let (lines, limits) = (vec![Line::new(points, [10, 20, 30])], vec![1.0]);
        let svg = Plot { title: "speed", lines, limits, log_x: true, log_y: true, ..Plot::default() }.svg().unwrap();
        assert!(["10³", "10⁴", "10⁵"].iter().all(|tick| svg.contains(tick)), "{svg}");
    }
}
