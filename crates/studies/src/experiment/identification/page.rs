//! The page of the study.

use super::result::{CoverageRow, ErrorRow, FitRow, IdentificationResult};
use crate::Result;
use crate::trials::resumed;
use trocar_report::colors;
use trocar_report::document::{Document, Section, Table};
use trocar_report::page::{self, Card};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{fixed, or_dash};
use trocar_specimen::Parameter;

/// Colour of intervals that miss the truth, and of the prior's range.
const MISSED: [u8; 3] = [214, 84, 40];
const PRIOR: [u8; 3] = [190, 196, 202];

pub(super) fn document(r: &IdentificationResult, phantoms: usize) -> Result<Document> {
    let lead = format!(
        "{phantoms} appendices of phantom A, each with a support and tissue drawn from the prior, are lifted ten times \
         by our own solver: a finer mesh, another law (corotated), noise of the tracker, of the grasp's place and of \
         its way. From five lifts the values are identified; the other five are predicted. A parameter \
         is observable where landmarks of the five could tell its true value from the ends of an interval half as wide \
         as the prior's, if all others were known."
    );
    let mut section = Section::new("Identification", lead).cards(cards(r)).table(coverage(&r.coverage));
    section = section.table(errors(&r.errors)).lines(resumed(&r.resumed, "fit"));
    let plots = Parameter::ALL.into_iter().map(|p| intervals(r, p)).collect::<Result<Vec<_>>>()?;
    let said = "The 90% interval of each phantom over the true value, default fit, on the scale of the prior.";
    Ok(Document::new("Identification", "What lifts tell of support and tissue")
        .with(section)
        .with(Section::new("Intervals", said).figures(plots)))
}

fn cards(r: &IdentificationResult) -> Vec<Card> {
    let mm = |value: Option<f64>| format!("{} mm", or_dash(value, 2));
    let own = r.errors.first();
    let bar = r.lift_mm.map(|lift| (1.5 * r.landmark_floor_mm).max(0.1 * lift));
    let note = format!(
        "lifts that were not fitted; without the threads {}, pins of a specimen {}, noise {}; bar {}",
        mm(own.and_then(|e| e.without_threads_mm)),
        mm(own.and_then(|e| e.own_pins_mm)),
        mm(Some(r.landmark_floor_mm)),
        mm(bar)
    );
    let met = r.landmark_rmse_mm.zip(bar).is_some_and(|(error, bar)| error <= bar);
    vec![
        Card::new(
            "Covered",
            format!("{} of 6", r.covered),
            "parameters whose 90% interval holds 80% or more of truths",
        )
        .met(r.covered == 6),
        Card::new(
            "Support",
            or_dash(r.support_width, 2),
            "widest interval of a parameter of the support over its prior's, in phantoms in which it is observable; \
             0.5 at most",
        )
        .met(r.support_width.is_some_and(|width| width <= 0.5)),
        Card::new("Landmark error", mm(r.landmark_rmse_mm), note).met(met),
    ]
}

/// The name of a parameter for people.
fn said(name: &str) -> String {
    Parameter::named(name).map_or(name.to_owned(), |p| p.said().0.to_owned())
}

fn coverage(rows: &[CoverageRow]) -> Table {
    Table::of(
        rows,
        &[
            ("Fit", &|c: &&CoverageRow| c.fit.clone()),
            ("Parameter", &|c| said(&c.parameter)),
            ("Truth in the 90% interval", &|c| format!("{} of {}", c.holds, c.phantoms)),
            ("Width over the prior's", &|c| fixed(c.width, 2)),
            ("At most half", &|c| format!("{} of {}", c.identified, c.phantoms)),
            ("Observable in", &|c| format!("{} of {}", c.observable, c.phantoms)),
            ("Width there", &|c| or_dash(c.observable_width, 2)),
        ],
    )
}

fn errors(rows: &[ErrorRow]) -> Table {
    Table::of(
        rows,
        &[
            ("Fit", &|e: &&ErrorRow| e.fit.clone()),
            ("Fitted lifts (mm)", &|e| or_dash(e.fitted_rmse_mm, 2)),
            ("Other lifts (mm)", &|e| or_dash(e.held_out_mm, 2)),
            ("Without threads (mm)", &|e| or_dash(e.without_threads_mm, 2)),
            ("Pins of a specimen (mm)", &|e| or_dash(e.own_pins_mm, 2)),
            ("Model's error over the lift", &|e| or_dash(e.model_error.map(|m| 1e2 * m), 1) + "%"),
        ],
    )
}

/// The intervals of one parameter over its true value.
fn intervals(r: &IdentificationResult, parameter: Parameter) -> Result<String> {
    let (name, unit, factor) = parameter.said();
    let log = parameter.scale() == trocar_specimen::Scale::Log;
    let scaled = |value: f64| factor * value;
    let range = trocar_identify::default_priors().into_iter().find(|p| p.name == parameter).map(|p| p.range);
    let [low, high] = range.unwrap_or([0.0, 1.0]).map(scaled);
    let mut lines = vec![Line::new(vec![(low, low), (high, high)], PRIOR)];
    let own = |row: &&FitRow| row.cell_mm == super::CELL_MM && !row.forces;
    for row in r.rows.iter().filter(own) {
        for p in row.parameters.iter().filter(|p| p.parameter == parameter.name()) {
            let x = scaled(p.truth);
            let color = if p.holds { colors::organ(0) } else { MISSED };
            lines.push(Line::new(vec![(x, scaled(p.interval[0])), (x, scaled(p.interval[2]))], color));
            let [left, right] =
                if log { [x / 1.02, x * 1.02] } else { [x - 0.006 * (high - low), x + 0.006 * (high - low)] };
            lines.push(Line::new(vec![(left, scaled(p.interval[1])), (right, scaled(p.interval[1]))], color));
        }
    }
    let unit = if unit.is_empty() { String::new() } else { format!(" ({unit})") };
    let (x, y) = (format!("true {name}{unit}"), format!("identified{unit}"));
    let plot =
        Plot { title: name, x: &x, y: &y, lines, show: vec![low, high], log_x: log, log_y: log, ..Plot::default() };
    let legend =
        page::legend([("holds the truth", colors::organ(0)), ("misses it", MISSED), ("identified = true", PRIOR)]);
    Ok(plot.figure(&format!("<b>{name}</b>, 90% intervals.{legend}"))?)
}
