//! The page of an identified specimen: the posterior as plots.

use super::{IdentifyResult, ParameterFigures};
use crate::Result;
use crate::lift_film::LiftFilm;
use trocar_identify::Identified;
use trocar_report::colors;
use trocar_report::document::{Document, Section, Table};
use trocar_report::page::{self, Card};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{fixed, or_dash};
use trocar_specimen::{Prior, Scale};

/// Colours of the prior and of the best value.
const PRIOR: [u8; 3] = [150, 156, 162];
const BEST: [u8; 3] = [214, 84, 40];

/// Scores between which densities are drawn, and their number.
const DRAWN: f64 = 3.0;
const POINTS: usize = 240;

pub(super) fn document(r: &IdentifyResult, found: &Identified, film: Option<&(usize, LiftFilm)>) -> Result<Document> {
    let lead = format!(
        "What holds the {} and how stiff it is, from {} lifts of {}. The organ is lifted alone in a simulation, with many \
         values of each parameter. The posterior is written into the specimen; the organ has the values that explain the \
         lifts best.",
        r.organ,
        r.lifts.len(),
        r.recording
    );
    let mm = |v: Option<f64>| format!("{} mm", or_dash(v, 2));
    let identified = r.parameters.iter().filter(|p| p.identified).count();
    let cards = vec![
        Card::new(
            "Identified",
            format!("{identified} of {}", r.parameters.len()),
            "90% interval at most half the prior's",
        ),
        Card::new("Landmark error", mm(r.landmark_rmse_mm), "of these lifts, with the best values"),
        Card::new(
            "As reconstructed",
            mm(r.reconstructed_rmse_mm),
            "the same with the reconstruction's pins and material",
        ),
        Card::new(
            "Model's error",
            format!("{}%", fixed(1e2 * r.model_error, 1)),
            "of the lift; inferred with the rest",
        ),
    ];
    let section = Section::new("Identification", lead).cards(cards).table(r.table()).lines(r.notes.clone());
    let plots = found.posterior.parameters.iter().enumerate().map(|(k, prior)| plot(found, k, prior));
    let plots = plots.collect::<Result<Vec<_>>>()?;
    let said = "Probability density over each parameter, over its largest value: before the lifts, and after them.";
    let document =
        Document::new(format!("Identified: {}", r.organ), "What lifts tell of support and tissue").with(section);
    let document = match film {
        Some((number, film)) => document.with(filmed(*number, film)),
        None => document,
    };
    Ok(document.with(Section::new("Posterior", said).figures(plots)))
}

/// The film of a fitted lift.
fn filmed(number: usize, film: &LiftFilm) -> Section {
    let said = "At the left the recording with what is measured in it, at the right the organ with the best values \
                through the same camera. Below: the lift along the organ, with the half-drop distance d50 marked.";
    let caption = format!(
        "<b>Lift {number}</b>, that with the longest way. At each moment the simulated tissue has gone the same share of \
         its way as the filmed one."
    );
    let figure = film.figure("a filmed lift, and at its right the same lift simulated", &caption);
    Section::new("A lift, filmed and simulated", said).html(figure)
}

impl IdentifyResult {
    /// The parameters, in units for people.
    pub fn table(&self) -> Table {
        let head = ["Parameter", "Unit", "Prior", "5%", "Median", "95%", "Best", "Width over the prior's"];
        let row = |p: &ParameterFigures| {
            let (name, unit, factor) = p.parameter.said();
            let number = |v: f64| fixed(factor * v, if (factor * v).abs() >= 10.0 { 0 } else { 2 });
            let prior = format!("{} to {}", number(p.range[0]), number(p.range[1]));
            let [low, median, high] = p.interval.map(number);
            [name.to_owned(), unit.to_owned(), prior, low, median, high, number(p.best), fixed(p.width, 2)].to_vec()
        };
        Table::new(head, self.parameters.iter().map(row).collect())
    }
}

/// The densities of one parameter.
fn plot(found: &Identified, k: usize, prior: &Prior) -> Result<String> {
    let (name, unit, factor) = prior.name.said();
    let log = prior.name.scale() == Scale::Log;
    let (mean, deviation) = (found.posterior.mean[k], found.posterior.covariance[k][k].max(1e-12).sqrt());
    let density = |mean: f64, deviation: f64| -> Vec<(f64, f64)> {
        let value = |score: f64| factor * prior.name.value(prior.range, score);
        let place = |score: f64| if log { value(score).ln() } else { value(score) };
        let point = |i: usize| {
            let score = mean + deviation * DRAWN * (2.0 * i as f64 / POINTS as f64 - 1.0);
            let slope = (place(score + 1e-4) - place(score - 1e-4)) / 2e-4;
            let off = (score - mean) / deviation;
            (value(score), (-0.5 * off * off).exp() / (deviation * slope))
        };
        (0..=POINTS).map(point).collect()
    };
    let scaled = |points: Vec<(f64, f64)>| {
        let most = points.iter().map(|p| p.1).fold(f64::MIN_POSITIVE, f64::max);
        points.into_iter().map(|(x, y)| (x, y / most)).collect::<Vec<_>>()
    };
    let best = factor * found.best[k].1;
    let lines = vec![
        Line::new(scaled(density(0.0, 1.0)), PRIOR),
        Line::new(scaled(density(mean, deviation)), colors::organ(0)),
        Line::new(vec![(best, 0.0), (best, 1.0)], BEST),
    ];
    let x = if unit.is_empty() { name.to_owned() } else { format!("{name} ({unit})") };
    let plot = Plot { title: name, x: &x, y: "density", lines, show: vec![0.0, 1.0], log_x: log, ..Plot::default() };
    let legend = page::legend([("before", PRIOR), ("after", colors::organ(0)), ("best", BEST)]);
    Ok(plot.figure(&format!("<b>{name}</b>: width {} of the prior's.{legend}", fixed(prior.width, 2)))?)
}
