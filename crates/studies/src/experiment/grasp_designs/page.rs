//! The page of the grasp designs: Table II beside the paper's, lift and slip by place, snap of the
//! second grasp.

use super::result::{DESIGNS, GraspDesignRow, GraspDesignsResult, GraspTrial};
use crate::Result;
use crate::experiment::appendix::{Condition, remarks};
use crate::names::design_name;
use crate::trials::resumed;
use trocar_report::colors;
use trocar_report::document::{Document, Section, Table};
use trocar_report::page::{self, Card};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{count, fixed, or_dash, yes_or_no};
use trocar_task::Warnings;

pub(super) fn document(r: &GraspDesignsResult) -> Result<Document> {
    let mut document = Document::new("Grasp designs", "Four ways to hold the appendix");
    for condition in conditions(r) {
        let figures = [
            lift_over_time(r, condition)?,
            by_place(r, condition, "lift (mm)", &|t| Some(t.lift_mm))?,
            by_place(r, condition, "slip (mm)", &|t| t.slip_mm)?,
            snaps(r, condition)?,
        ];
        let section = Section::new(format!("Table II {}", condition.title()), lead(r, condition));
        document = document
            .with(section.cards(cards(r, condition)).table(table_ii(r, condition)))
            .with(Section::new("Plots", "").figures(figures));
    }
    let columns = "Held: the tissue follows at least 80% of the lift, with under 3 mm slip at the top. Lift, slip \
                   and activation step: medians over the trials that did not diverge, as in the paper. Snap: \
                   displacement that the grasp prescribes, least and greatest trial, each the greatest of its nodes; \
                   zero by construction for live-pose and compliant, which capture nodes where they are. Activation \
                   step: largest motion of a node in the first frame of the grasp. Warnings: ";
    let columns = format!("{columns}{}.", Warnings::LEGEND);
    let appendix = format!(
        "Appendix: {} nodes, {} elements, {} kPa, {} kg/m3; {} mm lift, jaw force {} N.",
        count(r.nodes),
        count(r.tets),
        r.modulus_kpa,
        r.density_kg_m3,
        r.lift_mm,
        r.jaw_force_n
    );
    let lines = [columns, appendix].into_iter().chain(resumed(&r.resumed, "trial"));
    Ok(document.with(Section::new("Settings", "").lines(lines)).with(trials(r)))
}

/// The measured conditions, in order.
fn conditions(r: &GraspDesignsResult) -> Vec<Condition> {
    let mut all: Vec<Condition> = r.rows.iter().map(|row| row.condition).collect();
    all.dedup();
    all
}

fn lead(r: &GraspDesignsResult, condition: Condition) -> String {
    format!(
        "{}. The appendix settles. The jaws approach one of five places, in the middle or 2 mm to either side, close \
         with {} N, lift by {} mm in one second and hold for another. <i>Re-grasp</i>: the tissue is first dragged \
         sideways by 5 or 10 mm, released, and grasped again.",
        condition.described(),
        fixed(r.jaw_force_n, 2),
        fixed(r.lift_mm, 0),
    )
}

/// Trials held by each design, with our targets (of 15 trials).
fn cards(r: &GraspDesignsResult, condition: Condition) -> Vec<Card> {
    let card = |(name, target): (&'static str, usize)| {
        let row = r.rows.iter().find(|row| row.condition == condition && row.design == name)?;
        let paper = row.paper.map_or("not in the paper".to_owned(), |p| format!("paper {} of {}", p.held, p.trials));
        let met = row.held * 15 >= target * row.trials && row.diverged == 0;
        let note = format!("{}; {paper}", condition.title());
        Some(Card::new(name, format!("{} of {} held", row.held, row.trials), note).met(met))
    };
    [("friction", 12), ("rest-pose", 0), ("live-pose", 15), ("compliant", 15)].into_iter().filter_map(card).collect()
}

/// Table II of a condition; each row is followed by the paper's.
fn table_ii(r: &GraspDesignsResult, condition: Condition) -> Table {
    let head = [
        "Design",
        "Condition",
        "Held",
        "Diverged",
        "Lift (mm)",
        "Slip (mm)",
        "Snap (mm)",
        "Activation step (mm)",
        "Inverted",
        "Smallest volume",
        "Warnings",
    ];
    let range = |ends: Option<(f64, f64)>| match ends {
        None => "\u{2013}".to_owned(),
        Some((least, most)) if most - least < 0.05 => fixed(most, 2),
        Some((least, most)) => format!("{}\u{2013}{}", fixed(least, 1), fixed(most, 1)),
    };
    let measured = |row: &GraspDesignRow| {
        vec![
            row.design.clone(),
            condition.name().to_owned(),
            format!("{} of {}", row.held, row.trials),
            count(row.diverged),
            fixed(row.lift_median_mm, 1),
            or_dash(row.slip_median_mm, 2),
            range(row.snap_least_mm.zip(row.snap_mm)),
            row.activation_step_median_mm.zip(row.activation_step_most_mm).map_or_else(
                || or_dash(None, 2),
                |(median, most)| format!("{} (max. {})", fixed(median, 2), fixed(most, 2)),
            ),
            count(row.inverted_peak),
            fixed(row.min_volume_ratio, 2),
            row.warnings.to_string(),
        ]
    };
    let paper = |row: &GraspDesignRow| {
        row.paper.map(|p| {
            let mut cells = vec![
                row.design.clone(),
                "paper".to_owned(),
                format!("{} of {}", p.held, p.trials),
                count(p.diverged),
                fixed(p.lift_mm, 1),
                fixed(p.slip_mm, 2),
                range(p.snap_mm),
            ];
            cells.resize(head.len(), String::new());
            cells
        })
    };
    let rows = r.rows.iter().filter(|row| row.condition == condition);
    Table::new(head, rows.flat_map(|row| std::iter::once(measured(row)).chain(paper(row))).collect())
}

fn first_grasps<'a>(
    r: &'a GraspDesignsResult,
    condition: Condition,
    design: &'a str,
) -> impl Iterator<Item = &'a GraspTrial> {
    r.trials.iter().filter(move |t| t.condition == condition && t.design == design && t.drag_mm.is_none())
}

/// A plot with one line per design.
fn plot(title: &str, x: &str, y: &str, points: impl Fn(&str) -> Vec<(f64, f64)>, caption: &str) -> Result<String> {
    let designs = || DESIGNS.iter().map(|d| design_name(*d)).enumerate();
    let lines = designs().map(|(k, name)| Line::new(points(name), colors::organ(k))).collect();
    let legend = page::legend(designs().map(|(k, name)| (name, colors::organ(k))));
    Ok(Plot { title, x, y, lines, show: vec![0.0], ..Plot::default() }.figure(&format!("{caption}{legend}"))?)
}

fn lift_over_time(r: &GraspDesignsResult, condition: Condition) -> Result<String> {
    let points = |design: &str| {
        let all: Vec<&GraspTrial> = first_grasps(r, condition, design).filter(|t| t.offset_mm == 0.0).collect();
        all.get(all.len() / 2).map_or_else(Vec::new, |t| t.lifts.iter().map(|l| (l.0, l.2)).collect())
    };
    let caption = "<b>Lift of the tissue</b>, middle place, straight approach.";
    plot("lift over time", "time since the grasp (s)", "lift (mm)", points, caption)
}

/// Means over the approach offsets, by place.
fn by_place(
    r: &GraspDesignsResult,
    condition: Condition,
    y: &str,
    value: &dyn Fn(&GraspTrial) -> Option<f64>,
) -> Result<String> {
    let points = |design: &str| {
        let mut places: Vec<(f64, f64, f64)> = Vec::new();
        for t in first_grasps(r, condition, design).filter(|t| t.divergence.is_none()) {
            let Some(value) = value(t) else { continue };
            match places.iter_mut().find(|p| p.0 == t.asked) {
                Some(place) => (place.1, place.2) = (place.1 + value, place.2 + 1.0),
                None => places.push((t.asked, value, 1.0)),
            }
        }
        places.iter().map(|p| (p.0, p.1 / p.2)).collect()
    };
    let caption = format!("<b>{y}</b> by place on the appendix, mean over the approach offsets.");
    plot(y, "organ coordinate (1)", y, points, &caption)
}

fn snaps(r: &GraspDesignsResult, condition: Condition) -> Result<String> {
    let points = |design: &str| {
        let is = |t: &&GraspTrial| t.condition == condition && t.design == design && t.drag_mm.is_some();
        let second = r.trials.iter().filter(is);
        let mut points: Vec<(f64, f64)> = second.filter_map(|t| Some((t.displaced_mm?, t.snap_mean_mm?))).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        points
    };
    let caption = "<b>Snap of the second grasp</b>, mean over the nodes, over the displacement of the tissue from \
                   rest. Paper: slope 0.91 for rest-pose, zero for live-pose.";
    plot("snap of the second grasp", "displacement from rest (mm)", "mean snap (mm)", points, caption)
}

fn trials(r: &GraspDesignsResult) -> Section {
    let inverted = |t: &GraspTrial| (t.inverted_peak > 0).then(|| format!("{} inverted", t.inverted_peak));
    let table = Table::of(
        &r.trials,
        &[
            ("Condition", &|t| t.condition.name().to_owned()),
            ("Design", &|t| t.design.clone()),
            ("s", &|t| fixed(t.at, 2)),
            ("Offset (mm)", &|t| fixed(t.offset_mm, 0)),
            ("Drag (mm)", &|t| t.drag_mm.map_or(String::new(), |d| fixed(d, 0))),
            ("Held", &|t| yes_or_no(t.held)),
            ("Lift (mm)", &|t| fixed(t.lift_mm, 1)),
            ("Slip (mm)", &|t| or_dash(t.slip_mm, 2)),
            ("Snap (mm)", &|t| t.snap_mm.map_or(String::new(), |s| fixed(s, 2))),
            ("Activation step (mm)", &|t| or_dash(t.activation_step_mm, 2)),
            ("Closing force (N)", &|t| or_dash(t.closing_force_n, 2)),
            ("Gap (mm)", &|t| or_dash(t.gap_mm, 1)),
            ("Pull (N)", &|t| fixed(t.peak_constraint_n, 2)),
            ("Yielded", &|t| count(t.yielded_substeps)),
            ("Smallest volume", &|t| fixed(t.min_volume_ratio, 2)),
            ("Warnings", &|t| t.warnings.to_string()),
            ("Remarks", &|t| remarks(t.divergence.as_ref(), t.why.as_ref(), (t.slipped, t.torn), inverted(t))),
        ],
    );
    Section::new("All trials", "").table(table.on_page_only())
}

#[cfg(test)]
mod tests {
    use crate::experiment::grasp_designs::result::tests::made_up_result;

    #[test]
    fn each_row_is_followed_by_the_papers() {
        let html = super::document(&made_up_result()).unwrap().page();
        assert_eq!(html.matches("<td>paper</td>").count(), 5);
        assert!(html.contains("4.3\u{2013}17.8") && html.contains("0 of 15") && html.contains("14 of 15 held"));
        assert!(!html.contains("<b>made up</b>"), "texts are escaped");
        assert!(html.matches("<svg").count() == 4 && !html.contains("NaN"));
    }
}
