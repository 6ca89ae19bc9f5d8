//! The page of the study.

use super::result::{PolicyOutcome, RobustnessResult, RobustnessRow};
use crate::Result;
use crate::trials::resumed;
use trocar_campaign::{Curve, success_by_name, success_over};
use trocar_report::document::{Document, Section, Table};
use trocar_report::page::{self, Card};
use trocar_report::table::{count, fixed};

pub(super) fn document(r: &RobustnessResult) -> Result<Document> {
    let subtitle = "Success of six controllers over each factor of variation";
    let mut document = Document::new("Robustness", subtitle).with(outcome(r)).with(one_at_a_time(r));
    let mut figures = Vec::new();
    for curve in r.curves() {
        let policies = names(&curve);
        figures.push(if curve.bins.iter().all(|bin| bin.numbers.is_some()) {
            success_over(&policies, &curve)?
        } else {
            success_by_name(&curve)
        });
    }
    let lead = "Share of episodes that passed. Whiskers: Wilson, 95%.";
    document = document.with(Section::new("Curves", lead).figures(figures));
    Ok(document.with(all(r)))
}

fn names(curve: &Curve) -> Vec<&str> {
    curve.bins.first().map_or_else(Vec::new, |bin| bin.policies.iter().map(|s| s.policy.as_str()).collect())
}

fn outcome(r: &RobustnessResult) -> Section {
    let sum = |of: &dyn Fn(&PolicyOutcome) -> usize| r.rows.iter().flat_map(|row| &row.policies).map(of).sum::<usize>();
    let inverted = r.rows.iter().flat_map(|row| &row.policies).map(|p| p.inverted_peak).max().unwrap_or(0);
    let suspended = [0, 1, 2].map(|k| sum(&|p| p.suspensions[k]));
    let cards = [
        Card::new(
            "Passed",
            format!("{} of {}", sum(&|p| p.passed), sum(&|p| p.episodes)),
            "episodes of all conditions",
        ),
        Card::new("Inverted elements", count(inverted), "largest number in any frame").met(inverted == 0),
        Card::new("Diverged", count(sum(&|p| p.diverged)), "episodes").met(sum(&|p| p.diverged) == 0),
        Card::new("Could not begin", count(sum(&|p| p.refused)), "episodes, such as with a start out of reach"),
        Card::new(
            "Suspensions",
            suspended.map(|n| n.to_string()).join("/"),
            "contacts disabled / contacts of blades disabled / organs relaxed",
        ),
    ];
    let lead = format!(
        "Scene {}, ranges of the set {}. Episodes are unseen ones, from number {} on.",
        page::escape(&r.scene),
        r.variation,
        r.seed
    );
    let mut rows: Vec<Vec<String>> = r.as_written().map(|row| summary("as written", row)).into_iter().collect();
    rows.extend(r.together().map(|row| summary(&format!("all together, {}", row.value), row)));
    let head: Vec<String> = std::iter::once(String::new())
        .chain(r.as_written().into_iter().flat_map(|row| row.policies.iter().map(|p| p.policy.clone())))
        .collect();
    let section = Section::new("Outcome", lead).cards(cards).table(Table::new(head, rows));
    section.lines(resumed(&r.resumed, "conditions"))
}

fn summary(name: &str, row: &RobustnessRow) -> Vec<String> {
    let cells = row.policies.iter().map(|p| format!("{}/{}", p.passed, p.episodes));
    std::iter::once(name.to_owned()).chain(cells).collect()
}

fn one_at_a_time(r: &RobustnessResult) -> Section {
    let lead = format!(
        "Each factor at its values in order, with all others as the scene is written: episodes of {} that passed. The \
         controllers see no pictures: factors of pictures are left out, unless the task is judged by a picture.",
        r.episodes
    );
    let curves = r.curves();
    let policies = curves.first().map_or_else(Vec::new, names);
    let head = ["factor", "values"].into_iter().chain(policies);
    let row = |curve: &Curve| {
        let values = curve.bins.iter().map(|bin| bin.value.clone()).collect::<Vec<_>>().join(", ");
        let cell = |k: usize| curve.bins.iter().map(|b| b.policies[k].passed.to_string()).collect::<Vec<_>>().join(" ");
        let cells = (0..names(curve).len()).map(cell);
        [curve.label.clone(), values].into_iter().chain(cells).collect::<Vec<_>>()
    };
    Section::new("One factor at a time", lead).table(Table::new(head, curves.iter().map(row).collect()))
}

fn all(r: &RobustnessResult) -> Section {
    let table = Table::of(
        r.rows.iter().flat_map(|row| row.policies.iter().map(move |p| (row, p))),
        &[
            ("factor", &|(row, _)| row.label.clone()),
            ("value", &|(row, _)| row.value.clone()),
            ("controller", &|(_, p)| p.policy.clone()),
            ("passed", &|(_, p)| format!("{} of {}", p.passed, p.episodes)),
            ("mean score", &|(_, p)| fixed(p.mean_score, 2)),
            ("could not begin", &|(_, p)| count(p.refused)),
            ("diverged", &|(_, p)| count(p.diverged)),
            ("inverted", &|(_, p)| count(p.inverted_peak)),
            ("suspensions", &|(_, p)| p.suspensions.map(|n| n.to_string()).join("/")),
            ("why the first did not pass", &|(_, p)| p.why.clone().unwrap_or_default()),
        ],
    );
    Section::new("All conditions", "").table(table.on_page_only())
}
