//! The page of the wrench study.

use super::result::{CHI_SQUARED_95, WrenchFrame, WrenchResult, WrenchTilt, chi_squared_10};
use crate::Result;
use trocar_report::colors;
use trocar_report::document::{Document, Section, Table};
use trocar_report::page::{self, Card};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{count, fixed, percent};

pub(super) fn document(r: &WrenchResult) -> Result<Document> {
    let lead = format!(
        "The grasper weighed in {} poses tilted by up to {}\u{b0} (condition number {}), {} times with other noise: {} mN a force and {} mN m a torque. Each time ten numbers are estimated, with their covariance.",
        r.poses,
        fixed(r.tilt_deg, 0),
        fixed(r.condition, 1),
        count(r.runs),
        fixed(1e3 * r.noise.force, 0),
        fixed(1e3 * r.noise.torque, 1),
    );
    let weighing = Section::new("Weighing", lead).cards(cards(r)).figures([distances(r)?, tilts(r)?]);
    let document = Document::new("Force at the tool mount", "An instrument weighed, tared and touched");
    Ok(document.with(weighing).with(touching(r)?).with(parameters(r)))
}

fn cards(r: &WrenchResult) -> [Card; 4] {
    let off = 1e3 * (r.weight_n - r.paper_weight_n).abs();
    let mean_deviation = r.weight_predicted_mn / (r.runs as f64).sqrt();
    let weight = format!(
        "spread {} mN, predicted {} mN; the paper: {} N",
        fixed(r.weight_spread_mn, 2),
        fixed(r.weight_predicted_mn, 2),
        r.paper_weight_n
    );
    let seen = r.seen_from_mn.map_or("not seen".to_owned(), |f| format!("{} mN", fixed(f, 0)));
    [
        Card::new("Weight", format!("{} N", fixed(r.weight_n, 4)), weight).met(off < 4.0 * mean_deviation),
        Card::new("Within the predicted 95%", percent(r.within_95, 1), "of all ten numbers together"),
        Card::new(
            "Chi-squared",
            fixed(r.mean_distance_squared, 2),
            format!(
                "mean, 10 is right; farthest from its distribution by {} (limit {})",
                fixed(r.largest_difference, 3),
                fixed(r.difference_limit, 3)
            ),
        )
        .met(r.largest_difference < r.difference_limit),
        Card::new("A touch is seen from", seen, "tared reading above three deviations for good")
            .met(r.seen_from_mn.is_some()),
    ]
}

fn distances(r: &WrenchResult) -> Result<String> {
    let (found, right) = (colors::organ(1), colors::organ(0));
    let n = r.distances.len() as f64;
    let steps = r.distances.iter().enumerate().flat_map(|(k, d)| [(*d, k as f64 / n), (*d, (k as f64 + 1.0) / n)]);
    let last = r.distances.last().copied().unwrap_or(1.0).max(CHI_SQUARED_95);
    let curve = (0..=120).map(|k| last * f64::from(k) / 120.0).map(|x| (x, chi_squared_10(x)));
    let plot = Plot {
        title: "Distances of the estimates from the truth",
        x: "squared distance in predicted deviations",
        y: "share below",
        lines: vec![Line::new(curve.collect(), right), Line::new(steps.collect(), found)],
        show: vec![0.0, 1.0],
        limits: vec![0.95],
        ..Plot::default()
    };
    let legend = page::legend([("estimates", found), ("chi-squared, 10 degrees", right)]);
    Ok(plot.figure(&format!("<b>Estimates lie as far from the truth as predicted.</b>{legend}"))?)
}

fn tilts(r: &WrenchResult) -> Result<String> {
    let (weight, condition) = (colors::organ(2), colors::organ(3));
    let points = |value: &dyn Fn(&WrenchTilt) -> f64| r.tilts.iter().map(|t| (t.tilt_deg, value(t))).collect();
    let line = |color, value: &dyn Fn(&WrenchTilt) -> f64| Line::new(points(value), color);
    let plot = Plot {
        title: "What the poses' tilt tells",
        x: "largest tilt of the poses (\u{b0})",
        y: "mN, or condition",
        lines: vec![line(weight, &|t| t.weight_deviation_mn), line(condition, &|t| t.condition)],
        log_x: true,
        log_y: true,
        ..Plot::default()
    };
    let legend = page::legend([("deviation of the weight (mN)", weight), ("condition number", condition)]);
    let caption = format!("<b>Poses must be tilted</b> to tell weight from bias.{legend}");
    Ok(plot.figure(&caption)?)
}

fn touching(r: &WrenchResult) -> Result<Section> {
    let points = |value: &dyn Fn(&WrenchFrame) -> f64| r.ramp.iter().map(|f| (f.time_s, value(f))).collect::<Vec<_>>();
    let (truth, tared, untared, raw) = (colors::organ(0), colors::organ(1), colors::organ(7), colors::organ(4));
    let plot = |title, y, lines, show| Plot { title, x: "time (s)", y, lines, show, ..Plot::default() };
    let line = |color, points| Line::new(points, color);
    let before = plot("Reading before the tare", "reading (N)", vec![line(raw, points(&|f| f.raw_n))], vec![0.0]);
    let after = plot(
        "Force after the tare",
        "force (mN)",
        vec![
            line(untared, points(&|f| f.untared_mn)),
            line(tared, points(&|f| f.tared_mn)),
            line(truth, points(&|f| f.truth_mn)),
        ],
        vec![0.0],
    );
    let legend = page::legend([("contact force", truth), ("tared", tared), ("identified bias, not tared", untared)]);
    let figures = [
        page::figure(
            &before.svg()?,
            "<b>What the sensor reads</b> along the contact force, weight and bias included: the touch is a hundredth of it.",
        ),
        page::figure(
            &after.svg()?,
            &format!("<b>After the weight is taken off</b>; kind of the force: contact.{legend}"),
        ),
    ];
    let first = r.ramp.first().map_or(f64::NAN, |f| f.deviation_mn);
    let lead = format!(
        "The sensor\u{2019}s bias has drifted since the weighing. At reset the instrument is tared; then it is leaned from 13.3 to 18.3\u{b0} while tissue pulls at its jaws, up to 50 mN. A frame is the mean of \
         33 readings; its predicted deviation is {} mN. RMS error {} mN tared, {} mN not tared.",
        fixed(first, 1),
        fixed(r.tared_error_mn, 1),
        fixed(r.untared_error_mn, 1)
    );
    Ok(Section::new("A touch of tens of millinewtons", lead).figures(figures))
}

fn parameters(r: &WrenchResult) -> Section {
    let head = ["Parameter", "Truth", "Mean error", "Spread", "Predicted", "Within 1.96 deviations"];
    let small = |v: f64| format!("{v:.2e}").replace('-', "\u{2212}");
    let rows: Vec<Vec<String>> = r
        .parameters
        .iter()
        .map(|p| {
            vec![
                format!("{} ({})", p.name, p.unit),
                fixed(p.truth, 4),
                small(p.bias),
                small(p.spread),
                small(p.predicted),
                percent(p.within, 1),
            ]
        })
        .collect();
    Section::new("Every parameter", "").table(Table::new(head, rows))
}
