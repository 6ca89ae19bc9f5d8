//! The page of the study.

use super::map::map;
use super::result::{PolicyOutcome, RobustnessResult, RobustnessRow};
use crate::Result;
use crate::trials::resumed;
use trocar_campaign::{Curve, success_by_name, success_over};
use trocar_report::document::{Document, Section, Table};
use trocar_report::page::{self, Card, Columns};
use trocar_report::table::{count, fixed};
use trocar_task::Warnings;
use trocar_workflow::counted;

pub(super) fn document(r: &RobustnessResult) -> Result<Document> {
    let subtitle = "Success of six controllers over each factor of variation";
    let curves = r.curves();
    let document = Document::new("Robustness", subtitle).with(outcome(r)).with(one_at_a_time(r, &curves));
    Ok(document.with(with_intervals(&curves)?).with(all(r)))
}

/// The curves with their intervals, folded: the map has the shares.
fn with_intervals(curves: &[Curve]) -> Result<Section> {
    let (mut wide, mut figures) = (String::new(), Vec::new());
    for curve in curves {
        if curve.bins.iter().all(|bin| bin.numbers.is_some()) {
            figures.push(success_over(&names(curve), curve)?);
        } else {
            wide += &success_by_name(curve);
        }
    }
    let body = wide + &page::grid(Columns::Two, &figures);
    let lead = "Share of episodes that passed, for each factor. Whiskers: Wilson, 95%.";
    Ok(Section::new("Intervals", lead).html(page::fold("All factors", &body)))
}

fn names(curve: &Curve) -> Vec<&str> {
    curve.bins.first().map_or_else(Vec::new, |bin| bin.policies.iter().map(|s| s.policy.as_str()).collect())
}

fn outcome(r: &RobustnessResult) -> Section {
    let sum = |of: &dyn Fn(&PolicyOutcome) -> usize| r.rows.iter().flat_map(|row| &row.policies).map(of).sum::<usize>();
    let inverted = r.rows.iter().flat_map(|row| &row.policies).map(|p| p.inverted_peak).max().unwrap_or(0);
    let warnings: Warnings = r.rows.iter().flat_map(|row| &row.policies).map(|p| p.warnings).sum();
    let cards = [
        Card::new(
            "Passed",
            format!("{} of {}", sum(&|p| p.passed), sum(&|p| p.episodes)),
            "episodes of all conditions",
        ),
        Card::new("Inverted elements", count(inverted), "largest number in any frame").met(inverted == 0),
        Card::new("Diverged", count(sum(&|p| p.diverged)), "episodes").met(sum(&|p| p.diverged) == 0),
        Card::new("Could not begin", count(sum(&|p| p.refused)), "episodes, such as with a start out of reach"),
        Card::new("Warnings", warnings.to_string(), Warnings::LEGEND),
    ];
    let lead = format!(
        "Scene {}, ranges of the set {}. Episodes are unseen ones, from number {} on; with all factors together also \
         seen ones.",
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
    section.lines(resumed(&r.resumed, "condition"))
}

fn summary(name: &str, row: &RobustnessRow) -> Vec<String> {
    let cells = row.policies.iter().map(|p| format!("{}/{}", p.passed, p.episodes));
    std::iter::once(name.to_owned()).chain(cells).collect()
}

fn one_at_a_time(r: &RobustnessResult, curves: &[Curve]) -> Section {
    let lead = format!(
        "Each factor at its values, with all others as the scene is written; {} of each controller at a value. The \
         controllers see no pictures: factors of pictures are left out, unless the task is judged by a picture.",
        counted(r.episodes, "episode")
    );
    let policies = curves.first().map_or_else(Vec::new, names);
    let head = ["factor", "values"].into_iter().chain(policies.iter().copied());
    let row = |curve: &Curve| {
        let numbers = curve.bins.iter().all(|bin| bin.numbers.is_some());
        let values = match curve.bins.as_slice() {
            bins if numbers => bins.iter().map(|bin| bin.value.clone()).collect::<Vec<_>>().join(", "),
            bins => counted(bins.len(), "anatomy"),
        };
        let cell = |k: usize| {
            let shares = || curve.bins.iter().map(|bin| &bin.policies[k]);
            let said = |passed: usize, episodes: usize| format!("{passed}/{episodes}");
            if numbers {
                shares().map(|s| said(s.passed, s.episodes)).collect::<Vec<_>>().join(", ")
            } else {
                said(shares().map(|s| s.passed).sum(), shares().map(|s| s.episodes).sum())
            }
        };
        let cells = (0..names(curve).len()).map(cell);
        [curve.label.clone(), values].into_iter().chain(cells).collect::<Vec<_>>()
    };
    Section::new("One factor at a time", lead)
        .html(map(&policies, curves))
        .table(Table::new(head, curves.iter().map(row).collect()))
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
            ("warnings", &|(_, p)| p.warnings.to_string()),
            ("why the first did not pass", &|(_, p)| p.why.clone().unwrap_or_default()),
        ],
    );
    let episodes = r.rows.iter().flat_map(|row| &row.policies).map(|p| p.episodes).sum();
    Section::new("All conditions", "").html(page::fold(&counted(episodes, "episode"), &table.html()))
}
