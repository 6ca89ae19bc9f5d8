//! A frame of the film: titles, panels, and below them profiles, figures and the meaning of marks.

use super::moment::Moment;
use super::panel::{GRASP, MARK, PLANE};
use super::{FILMED, SIMULATED, ShownLift};
use crate::Result;
use glam::DVec2;
use trocar_camera::ColorImage;
use trocar_measure::{LiftProfile, MeasuredLift};
use trocar_report::canvas::{Anchor, Canvas, LINE, Pen, RIM, TEXT, text_width};
use trocar_report::chart::{Chart, Curve, Span};
use trocar_report::colors::VIEW_GROUND;

/// Sizes of panels: alone, and one of two (px).
const ALONE: [usize; 2] = [760, 570];
const BESIDE: [usize; 2] = [540, 405];

/// Gap between panels, height of the titles, and height of the part below the panels (px).
const GAP: usize = 8;
const TITLE: usize = 32;
const BELOW: usize = 250;

/// Width of the figures beside the profiles (px).
const FIGURES: f64 = 340.0;

/// Lifts of less than this have no profile to speak of (m).
const LEAST: f64 = 1e-3;

/// Where things are, and the greatest lifts, by which profiles are divided.
pub(super) struct FrameLayout {
    panels: usize,
    greatest: [Option<LiftProfile>; 2],
    /// Ends of the axis along the organ (mm).
    x_range: (f64, f64),
}

impl FrameLayout {
    /// For a lift alone, or beside the moments of a simulated one.
    pub fn of(lift: &MeasuredLift, simulated: Option<&[Moment]>) -> Self {
        let profiles = simulated.into_iter().flatten().filter_map(|m| m.profile.as_ref());
        let best = profiles.max_by(|a, b| a.apex.total_cmp(&b.apex)).cloned();
        let greatest = [lift.profile.clone(), best];
        let ends = greatest.iter().flatten().map(|p| {
            let from = -1e3 * p.apex_at;
            (from, from + 1e3 * p.spacing * p.lift.len().saturating_sub(1) as f64)
        });
        let x_range = ends.reduce(|a, b| (a.0.min(b.0), a.1.max(b.1))).unwrap_or((-1.0, 1.0));
        Self { panels: 1 + usize::from(simulated.is_some()), greatest, x_range }
    }

    /// Size of a panel (px).
    pub fn panel(&self) -> [usize; 2] {
        if self.panels == 1 { ALONE } else { BESIDE }
    }

    /// Size of a frame (px).
    fn size(&self) -> [usize; 2] {
        let [width, height] = self.panel();
        [self.panels * width + (self.panels - 1) * GAP, TITLE + height + BELOW]
    }

    /// The frame of the moment of `index`.
    pub fn frame(
        &self,
        shown: &ShownLift<'_>,
        index: usize,
        panels: &[ColorImage],
        measured: &Moment,
        simulated: Option<&Moment>,
    ) -> Result<ColorImage> {
        let [width, height] = self.size();
        let mut canvas = Canvas::new(width, height, VIEW_GROUND)?;
        // A lift alone may be of an episode, which nobody filmed.
        let first = if simulated.is_some() { "Filmed" } else { "Measured" };
        let titles = [(format!("{first}, lift {}", shown.number), FILMED), ("Simulated".to_owned(), SIMULATED)];
        for (k, (picture, (title, color))) in panels.iter().zip(&titles).enumerate() {
            let left = k * (picture.width + GAP);
            canvas.paste(picture, [left, TITLE]);
            canvas.text(DVec2::new(left as f64 + 10.0, 0.5 * TITLE as f64), Anchor::Left, *color, title);
        }
        let since = |hz: f64| format!("  {:.2} s", (index - shown.lift.info.rest) as f64 / hz);
        let clock = format!("frame {index}{}", shown.rate_hz.map(since).unwrap_or_default());
        canvas.text(DVec2::new(width as f64 - 10.0, 0.5 * TITLE as f64), Anchor::Right, TEXT, &clock);
        let top = (TITLE + self.panel()[1]) as f64;
        let split = width as f64 - FIGURES;
        self.profiles([Some(measured), simulated]).draw(
            &mut canvas,
            DVec2::new(0.0, top + 6.0),
            DVec2::new(split, height as f64),
        );
        figures(&mut canvas, DVec2::new(split + 8.0, top + 22.0), measured, simulated);
        Ok(canvas.picture())
    }

    /// The lifts over the greatest lifts, along the organ from the apex of these.
    fn profiles(&self, moments: [Option<&Moment>; 2]) -> Chart<'static> {
        let (mut curves, mut spans) = (Vec::new(), Vec::new());
        for ((moment, greatest), color) in moments.iter().zip(&self.greatest).zip([FILMED, SIMULATED]) {
            let (Some(greatest), Some(now)) = (greatest, moment.and_then(|m| m.profile.as_ref())) else { continue };
            let place = |along: f64| 1e3 * (along - greatest.apex_at);
            let point = |(i, lift): (usize, &f64)| (place(i as f64 * now.spacing), lift / greatest.apex, now.seen[i]);
            curves.push(Curve { points: now.lift.iter().enumerate().map(point).collect(), color });
            if let Some(x) = half_drop(now).map(|ends| ends.map(place)) {
                // Both are at nearly the same height; one is named.
                let name = if spans.is_empty() { "d50" } else { "" };
                spans.push(Span { x, y: 0.5 * now.apex / greatest.apex, color, name });
            }
        }
        Chart {
            x: "distance from the apex (mm), base at the left",
            y: "lift over the greatest lift",
            x_range: self.x_range,
            y_range: (-0.08, 1.2),
            curves,
            spans,
        }
    }
}

/// Where the lift falls to half along the organ (m); the apex for a side that does not.
fn half_drop(profile: &LiftProfile) -> Option<[f64; 2]> {
    profile.d50().filter(|_| profile.apex >= LEAST)?;
    let [base, tip] = profile.half_drop.map(|d| d.unwrap_or(0.0));
    Some([profile.apex_at - base, profile.apex_at + tip])
}

/// The figures of the moment in columns, and what the marks mean.
fn figures(canvas: &mut Canvas, from: DVec2, measured: &Moment, simulated: Option<&Moment>) {
    let mm = |v: Option<f64>| v.map_or("-".to_owned(), |m| format!("{:.1}", 1e3 * m));
    let apex = |m: &Moment| mm(m.profile.as_ref().map(|p| p.apex));
    let d50 = |m: &Moment| mm(m.profile.as_ref().filter(|p| p.apex >= LEAST).and_then(LiftProfile::d50));
    let columns = [from.x + 170.0, from.x + 300.0];
    let mut row = |k: f64, name: &str, values: [Option<(String, [u8; 3])>; 2]| {
        let y = from.y + k * LINE;
        canvas.text(DVec2::new(from.x, y), Anchor::Left, TEXT, name);
        for (x, (value, color)) in columns.into_iter().zip(values).filter_map(|(x, v)| Some((x, v?))) {
            canvas.text(DVec2::new(x, y), Anchor::Right, color, &value);
        }
    };
    let both = |of: &dyn Fn(&Moment) -> String| [Some((of(measured), TEXT)), simulated.map(|m| (of(m), TEXT))];
    let second = simulated.map(|_| ("simulated".to_owned(), SIMULATED));
    let first = if simulated.is_some() { "filmed" } else { "measured" };
    row(0.0, "mm", [Some((first.to_owned(), FILMED)), second]);
    row(1.0, "lift", both(&apex));
    row(2.0, "d50", both(&d50));
    if let Some(simulated) = simulated {
        row(3.0, "landmarks off", [None, Some((mm(simulated.error), TEXT))]);
    }
    let middle = |k: f64| DVec2::new(from.x + 8.0, from.y + k * LINE);
    let color = if simulated.is_some() { SIMULATED } else { FILMED };
    canvas.disc(middle(4.6), MARK + 1.2, RIM);
    canvas.disc(middle(4.6), MARK, color);
    let mut named = |k: f64, name: &str| {
        canvas.text(middle(k) + DVec2::new(18.0, 0.0), Anchor::Left, TEXT, name);
    };
    named(4.6, "landmark, every 5 mm");
    named(5.7, "grasp");
    named(6.8, "plane of the surroundings");
    let beside = middle(5.7) + DVec2::new(18.0 + text_width("grasp  "), 0.0);
    canvas.ring(middle(5.7), MARK + 2.5, Pen::new(GRASP, 2.5));
    canvas.line(&[middle(6.8) - 7.0 * DVec2::X, middle(6.8) + 7.0 * DVec2::X], Pen::new(PLANE, 1.5));
    if simulated.is_some() {
        canvas.ring(beside + 8.0 * DVec2::X, MARK + 2.5, Pen::new(FILMED, 2.0));
        canvas.text(beside + 24.0 * DVec2::X, Anchor::Left, TEXT, "the filmed one");
    }
}
