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
        "The grasper is weighed in {} poses tilted by up to {}\u{b0} (condition number {}), {} times with different \
         noise: {} mN per force and {} mN m per torque. Each identification estimates ten parameters and their \
         covariance.",
        r.poses,
        fixed(r.tilt_deg, 0),
        fixed(r.condition, 1),
        count(r.runs),
        fixed(1e3 * r.noise.force, 0),
        fixed(1e3 * r.noise.torque, 1),
    );
    let weighing = Section::new("Weighing", lead).cards(cards(r)).figures([distances(r)?, tilts(r)?]);
    let document = Document::new("Force at the tool mount", "An instrument weighed, tared and in contact");
    Ok(document.with(weighing).with(touching(r)?).with(parameters(r)))
}

fn cards(r: &WrenchResult) -> [Card; 4] {
    let off = 1e3 * (r.weight_n - r.paper_weight_n).abs();
    let mean_deviation = r.weight_predicted_mn / (r.runs as f64).sqrt();
    let weight = format!(
        "spread {} mN, predicted {} mN; paper {} N",
        fixed(r.weight_spread_mn, 2),
        fixed(r.weight_predicted_mn, 2),
        r.paper_weight_n
    );
    let seen = r.seen_from_mn.map_or("none".to_owned(), |f| format!("{} mN", fixed(f, 0)));
    [
        Card::new("Weight", format!("{} N", fixed(r.weight_n, 4)), weight).met(off < 4.0 * mean_deviation),
        Card::new("Within the predicted 95%", percent(r.within_95, 1), "of all ten parameters together"),
        Card::new(
            "Chi-squared",
            fixed(r.mean_distance_squared, 2),
            format!(
                "mean; 10 is correct; largest difference from its distribution {} (limit {})",
                fixed(r.largest_difference, 3),
                fixed(r.difference_limit, 3)
            ),
        )
        .met(r.largest_difference < r.difference_limit),
        Card::new("Detectable contact force", seen, "tared reading stays above three standard deviations")
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
        x: "squared distance (predicted standard deviations)",
        y: "share below",
        lines: vec![Line::new(curve.collect(), right), Line::new(steps.collect(), found)],
        show: vec![0.0, 1.0],
        limits: vec![0.95],
        ..Plot::default()
    };
    let legend = page::legend([("estimates", found), ("chi-squared, 10 degrees", right)]);
    Ok(plot
        .figure(&format!("<b>Distances of the estimates from the truth</b> and the predicted distribution.{legend}"))?)
}

fn tilts(r: &WrenchResult) -> Result<String> {
    let (weight, condition) = (colors::organ(2), colors::organ(3));
    let points = |value: &dyn Fn(&WrenchTilt) -> f64| r.tilts.iter().map(|t| (t.tilt_deg, value(t))).collect();
    let line = |color, value: &dyn Fn(&WrenchTilt) -> f64| Line::new(points(value), color);
    let plot = Plot {
        title: "Influence of the tilt",
        x: "largest tilt of the poses (\u{b0})",
        y: "mN, or condition",
        lines: vec![line(weight, &|t| t.weight_deviation_mn), line(condition, &|t| t.condition)],
        log_x: true,
        log_y: true,
        ..Plot::default()
    };
    let legend = page::legend([("standard deviation of the weight (mN)", weight), ("condition number", condition)]);
    let caption = format!("<b>Only tilted poses</b> separate weight from bias.{legend}");
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
            "<b>Sensor reading</b> along the contact force, with weight and bias: the contact force is a hundredth \
             of it.",
        ),
        page::figure(&after.svg()?, &format!("<b>Contact force</b>, without the weight.{legend}")),
    ];
    let first = r.ramp.first().map_or(f64::NAN, |f| f.deviation_mn);
    let lead = format!(
        "The bias of the sensor has drifted since the weighing. The instrument is tared at reset, then tilted from \
         13.3 to 18.3\u{b0} while tissue pulls at its jaws with up to 50 mN. A frame is the mean of 33 readings; its \
         predicted standard deviation is {} mN. RMS error {} mN tared, {} mN not tared.",
        fixed(first, 1),
        fixed(r.tared_error_mn, 1),
        fixed(r.untared_error_mn, 1)
    );
    Ok(Section::new("A contact force of tens of millinewtons", lead).figures(figures))
}

fn parameters(r: &WrenchResult) -> Section {
    let small = |v: f64| format!("{v:.2e}").replace('-', "\u{2212}");
    let table = Table::of(
        &r.parameters,
        &[
            ("Parameter", &|p| format!("{} ({})", p.name, p.unit)),
            ("Truth", &|p| fixed(p.truth, 4)),
            ("Mean error", &|p| small(p.bias)),
            ("Spread", &|p| small(p.spread)),
            ("Predicted", &|p| small(p.predicted)),
            ("Within 1.96 deviations", &|p| percent(p.within, 1)),
        ],
    );
    Section::new("Parameters", "").table(table)
}
