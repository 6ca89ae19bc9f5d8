//! The page of the wrench experiment: how well an instrument is weighed, and what is seen after the tare.

use crate::Result;
use crate::experiment::{CHI_SQUARED_95, WrenchFrame, WrenchResult, chi_squared_10};
use trocar_report::colors;
use trocar_report::page::{self, Card, Columns};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{self, count, fixed, percent};

pub(super) fn body(r: &WrenchResult) -> Result<String> {
    let lead = format!(
        "The grasper weighed in {} poses tilted by up to {}\u{b0} (condition number {}), {} times with other noise: {} mN a force and {} mN m a torque. Each time ten numbers are estimated, with their covariance.",
        r.poses,
        fixed(r.tilt_deg, 0),
        fixed(r.condition, 1),
        count(r.runs),
        fixed(1e3 * r.noise.force, 0),
        fixed(1e3 * r.noise.torque, 1),
    );
    let figures = [distances(r)?, tilts(r)?];
    let weighing = page::section("Weighing", &lead, &(cards(r) + &page::grid(Columns::Two, &figures)));
    Ok(weighing + &touching(r)? + &parameters(r))
}

fn cards(r: &WrenchResult) -> String {
    let off = 1e3 * (r.weight_n - r.paper_weight_n).abs();
    let mean_deviation = r.weight_predicted_mn / (r.runs as f64).sqrt();
    let weight = format!(
        "spread {} mN, predicted {} mN; the paper: {} N",
        fixed(r.weight_spread_mn, 2),
        fixed(r.weight_predicted_mn, 2),
        r.paper_weight_n
    );
    let seen = r.seen_from_mn.map_or("not seen".to_owned(), |f| format!("{} mN", fixed(f, 0)));
    page::cards(&[
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
    ])
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
        lines: vec![
            Line { points: curve.collect(), color: right, filled: false },
            Line { points: steps.collect(), color: found, filled: false },
        ],
        bands: vec![],
        show: vec![0.0, 1.0],
        limits: vec![0.95],
        log_x: false,
        log_y: false,
    };
    let legend = page::legend([("estimates", found), ("chi-squared, 10 degrees", right)]);
    Ok(page::figure(&plot.svg()?, &format!("<b>Estimates lie as far from the truth as predicted.</b>{legend}")))
}

fn tilts(r: &WrenchResult) -> Result<String> {
    let (weight, condition) = (colors::organ(2), colors::organ(3));
    let line = |color, value: &dyn Fn(&crate::experiment::WrenchTilt) -> f64| Line {
        points: r.tilts.iter().map(|t| (t.tilt_deg, value(t))).collect(),
        color,
        filled: false,
    };
    let plot = Plot {
        title: "What the poses' tilt tells",
        x: "largest tilt of the poses [\u{b0}]",
        y: "mN, or condition",
        lines: vec![line(weight, &|t| t.weight_deviation_mn), line(condition, &|t| t.condition)],
        bands: vec![],
        show: vec![],
        limits: vec![],
        log_x: true,
        log_y: true,
    };
    let legend = page::legend([("deviation of the weight [mN]", weight), ("condition number", condition)]);
    let caption = format!("<b>Poses must be tilted</b> to tell weight from bias.{legend}");
    Ok(page::figure(&plot.svg()?, &caption))
}

fn touching(r: &WrenchResult) -> Result<String> {
    let points = |value: &dyn Fn(&WrenchFrame) -> f64| r.ramp.iter().map(|f| (f.time_s, value(f))).collect::<Vec<_>>();
    let (truth, tared, untared, raw) = (colors::organ(0), colors::organ(1), colors::organ(7), colors::organ(4));
    let plot = |title, y, lines, show| Plot {
        title,
        x: "time [s]",
        y,
        lines,
        bands: vec![],
        show,
        limits: vec![],
        log_x: false,
        log_y: false,
    };
    let line = |color, points| Line { points, color, filled: false };
    let before = plot("Reading before the tare", "reading [N]", vec![line(raw, points(&|f| f.raw_n))], vec![0.0]);
    let after = plot(
        "Force after the tare",
        "force [mN]",
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
    Ok(page::section("A touch of tens of millinewtons", &lead, &page::grid(Columns::Two, &figures)))
}

fn parameters(r: &WrenchResult) -> String {
    let head = ["Parameter", "Truth", "Mean error", "Spread", "Predicted", "Within 1.96 deviations"];
    let small = |v: f64| format!("{v:.2e}").replace('-', "\u{2212}");
    let rows: Vec<Vec<String>> = r
        .parameters
        .iter()
        .map(|p| {
            vec![
                format!("{} [{}]", p.name, p.unit),
                fixed(p.truth, 4),
                small(p.bias),
                small(p.spread),
                small(p.predicted),
                percent(p.within, 1),
            ]
        })
        .collect();
    page::section("Every parameter", "", &table::plain(&head, &rows))
}

#[cfg(test)]
mod tests {
    use crate::experiment::measured_wrench;

    #[test]
    fn everything_is_shown() {
        let html = super::body(&measured_wrench()).unwrap();
        assert_eq!(html.matches("<svg").count(), 4);
        assert_eq!(html.matches("<tr>").count(), 11);
        assert!(html.contains("4.7 N") && html.contains("card good") && !html.contains("NaN"));
    }
}
