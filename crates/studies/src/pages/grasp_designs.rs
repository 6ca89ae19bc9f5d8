//! The page of the grasp designs: Table II beside the paper's, lift and slip by place, snap on re-grasp.

use crate::Result;
use crate::experiment::{Condition, DESIGNS, GraspDesignRow, GraspDesignsResult, GraspTrial, design_name};
use trocar_report::colors;
use trocar_report::page::{self, Card, Columns};
use trocar_report::plots::{Line, Plot};
use trocar_report::table::{self, count, fixed};

/// The conditions that were measured, in order.
fn conditions(r: &GraspDesignsResult) -> Vec<Condition> {
    let mut all: Vec<Condition> = Vec::new();
    for row in &r.rows {
        if !all.contains(&row.condition) {
            all.push(row.condition);
        }
    }
    all
}

fn title(condition: Condition) -> &'static str {
    match condition {
        Condition::Cell => "Table II in the whole cell",
        Condition::Appendix => "Table II with the appendix alone",
    }
}

fn lead(r: &GraspDesignsResult, condition: Condition) -> String {
    let what = match condition {
        Condition::Cell => "The paper\u{2019}s cell: all organs, which touch each other, and a dynamic arm in its port",
        Condition::Appendix => "The appendix alone, lifted by an ideal arm without a port",
    };
    format!(
        "{what}. The appendix ({} nodes, {} elements, {} kPa, {} kg/m\u{b3}) settles, the jaws come over one of five \
         places, in the middle or 2 mm to either side, close with {} N, lift by {} mm in a second and hold for another. \
         <i>Re-grasp</i>: the tissue is first dragged sideways by 5 or 10 mm, let go of, and grasped once more.",
        count(r.nodes),
        count(r.tets),
        fixed(r.modulus_kpa, 0),
        fixed(r.density_kg_m3, 0),
        fixed(r.jaw_force_n, 2),
        fixed(r.lift_mm, 0),
    )
}

pub(super) fn body(r: &GraspDesignsResult) -> Result<String> {
    let mut body = String::new();
    for condition in conditions(r) {
        let figures = [
            lifts_over_time(r, condition)?,
            by_place(r, condition, "lift [mm]", &|t| t.lift_mm)?,
            by_place(r, condition, "slip [mm]", &|t| t.slip_mm)?,
            snaps(r, condition)?,
        ];
        body += &page::section(title(condition), &lead(r, condition), &(cards(r, condition) + &rows(r, condition)));
        body += &page::section("In pictures", "", &page::grid(Columns::Two, &figures));
    }
    Ok(body + &trials(r))
}

fn cards(r: &GraspDesignsResult, condition: Condition) -> String {
    let find = |name: &str| r.rows.iter().find(|row| row.condition == condition && row.design == name);
    let held = |name: &'static str, least: usize| {
        find(name).map(|row| {
            let paper =
                row.paper.map_or("not in the paper".to_owned(), |p| format!("the paper: {} of {}", p.held, p.trials));
            let good = row.held * 15 >= least * row.trials && row.diverged == 0;
            Card::new(name, format!("{} of {} held", row.held, row.trials), paper).met(good)
        })
    };
    let cards: Vec<Card> = [("friction", 12), ("rest-pose", 0), ("live-pose", 15), ("compliant", 15)]
        .into_iter()
        .filter_map(|(name, least)| held(name, least))
        .collect();
    page::cards(&cards)
}

/// The head of Table II.
pub(crate) const HEAD: [&str; 10] = [
    "Design",
    "Held",
    "Diverged",
    "Lift [mm]",
    "Slip [mm]",
    "Snap [mm]",
    "Activation step [mm]",
    "Inverted",
    "Smallest volume",
    "Suspensions",
];

/// The rows of Table II of a condition, each with the paper's below it.
pub(crate) fn table_rows(r: &GraspDesignsResult, condition: Condition) -> Vec<Vec<String>> {
    let range = |least: f64, most: f64| {
        if most - least < 0.05 { fixed(most, 2) } else { format!("{}\u{2013}{}", fixed(least, 1), fixed(most, 1)) }
    };
    let dash = || "\u{2013}".to_owned();
    let ours = |row: &GraspDesignRow| {
        vec![
            row.design.clone(),
            format!("{} of {}", row.held, row.trials),
            count(row.diverged),
            fixed(row.lift_median_mm, 1),
            fixed(row.slip_median_mm, 2),
            row.snap_least_mm.zip(row.snap_mm).map_or_else(dash, |(least, most)| range(least, most)),
            format!("{} (most {})", fixed(row.activation_step_median_mm, 2), fixed(row.activation_step_most_mm, 2)),
            count(row.inverted_peak),
            fixed(row.min_volume_ratio, 2),
            suspensions(&row.suspensions),
        ]
    };
    let paper = |row: &GraspDesignRow| {
        row.paper.map(|p| {
            let mut cells = vec![
                "  the paper".to_owned(),
                format!("{} of {}", p.held, p.trials),
                count(p.diverged),
                fixed(p.lift_mm, 1),
                fixed(p.slip_mm, 2),
                p.snap_mm.map_or_else(dash, |(least, most)| range(least, most)),
            ];
            cells.resize(HEAD.len(), String::new());
            cells
        })
    };
    let of = r.rows.iter().filter(|row| row.condition == condition);
    of.flat_map(|row| std::iter::once(ours(row)).chain(paper(row))).collect()
}

/// Contacts disabled, contacts of blades disabled, organs relaxed.
pub(crate) fn suspensions([contacts, blades, relaxed]: &[usize; 3]) -> String {
    if [contacts, blades, relaxed] == [&0, &0, &0] { "0".to_owned() } else { format!("{contacts}/{blades}/{relaxed}") }
}

fn rows(r: &GraspDesignsResult, condition: Condition) -> String {
    table::plain(&HEAD, &table_rows(r, condition))
        + "<p class=\"lead\"><i>Held</i>: tissue follows at least 80% of the lift with under 3 mm slip at the top. Lift, \
           slip and activation step are medians over trials that did not diverge, as the paper\u{2019}s are; snap is the \
           least and the greatest of the trials, each the greatest over its nodes. <i>Snap</i> is what the grasp \
           prescribes: zero by construction for live-pose and compliant, which capture nodes where they are. \
           <i>Activation step</i> is what moves in the first frame of the grasp. <i>Suspensions</i> of physics: contacts \
           disabled / contacts of blades disabled / organs relaxed.</p>"
}

/// Trials that do not grasp again, of one design.
fn first_grasps<'a>(
    r: &'a GraspDesignsResult,
    condition: Condition,
    design: &'a str,
) -> impl Iterator<Item = &'a GraspTrial> {
    r.trials.iter().filter(move |t| t.condition == condition && t.design == design && t.drag_mm.is_none())
}

fn legend() -> String {
    page::legend(DESIGNS.iter().enumerate().map(|(k, d)| (design_name(*d), colors::organ(k))))
}

fn plot(title: &str, x: &str, y: &str, lines: Vec<Line>, caption: &str) -> Result<String> {
    let plot = Plot { title, x, y, lines, bands: vec![], show: vec![0.0], limits: vec![], log_x: false, log_y: false };
    Ok(page::figure(&plot.svg()?, caption))
}

fn lifts_over_time(r: &GraspDesignsResult, condition: Condition) -> Result<String> {
    let middle = |design: &'static str| {
        let all: Vec<&GraspTrial> = first_grasps(r, condition, design).filter(|t| t.offset_mm == 0.0).collect();
        all.get(all.len() / 2).copied()
    };
    let line = |(k, name): (usize, &'static str)| Line {
        points: middle(name).map_or_else(Vec::new, |t| t.lifts.iter().map(|l| (l.0, l.2)).collect()),
        color: colors::organ(k),
        filled: false,
    };
    let lines = DESIGNS.iter().map(|d| design_name(*d)).enumerate().map(line).collect();
    let caption = format!("<b>Lift of the tissue,</b> middle place, straight approach.{}", legend());
    plot("lift over time", "time since the grasp [s]", "lift [mm]", lines, &caption)
}

/// Means over the approach offsets, by place.
fn by_place(
    r: &GraspDesignsResult,
    condition: Condition,
    y: &'static str,
    value: &dyn Fn(&GraspTrial) -> f64,
) -> Result<String> {
    let line = |(k, name): (usize, &'static str)| {
        let mut places: Vec<(f64, f64, f64)> = Vec::new();
        for t in first_grasps(r, condition, name).filter(|t| t.divergence.is_none()) {
            match places.iter_mut().find(|p| p.0 == t.asked) {
                Some(place) => (place.1, place.2) = (place.1 + value(t), place.2 + 1.0),
                None => places.push((t.asked, value(t), 1.0)),
            }
        }
        Line { points: places.iter().map(|p| (p.0, p.1 / p.2)).collect(), color: colors::organ(k), filled: false }
    };
    let lines = DESIGNS.iter().map(|d| design_name(*d)).enumerate().map(line).collect();
    let caption = format!("<b>{}</b> by place on the appendix, mean over the approach offsets.{}", y, legend());
    plot(y, "organ coordinate [1]", y, lines, &caption)
}

fn snaps(r: &GraspDesignsResult, condition: Condition) -> Result<String> {
    let line = |(k, name): (usize, &'static str)| {
        let is = |t: &&GraspTrial| t.condition == condition && t.design == name && t.drag_mm.is_some();
        let again = r.trials.iter().filter(is);
        let mut points: Vec<(f64, f64)> = again.filter_map(|t| Some((t.displaced_mm, t.snap_mean_mm?))).collect();
        points.sort_by(|a, b| a.0.total_cmp(&b.0));
        Line { points, color: colors::organ(k), filled: false }
    };
    let lines = DESIGNS.iter().map(|d| design_name(*d)).enumerate().map(line).collect();
    let caption = format!(
        "<b>Snap on re-grasp,</b> mean over the nodes, over how far the tissue was from its place at rest. The paper: \
         slope 0.91 for rest-pose, none for live-pose.{}",
        legend()
    );
    plot("snap on re-grasp", "displacement since rest [mm]", "mean snap [mm]", lines, &caption)
}

fn trials(r: &GraspDesignsResult) -> String {
    let head = [
        "Condition",
        "Design",
        "s",
        "Offset [mm]",
        "Drag [mm]",
        "Held",
        "Lift [mm]",
        "Slip [mm]",
        "Snap [mm]",
        "Activation step [mm]",
        "Closed with [N]",
        "Gap [mm]",
        "Pull [N]",
        "Yielded",
        "Smallest volume",
        "Suspensions",
        "Remarks",
    ];
    let row = |t: &GraspTrial| {
        let remarks = [
            t.divergence.clone(),
            t.why.clone().filter(|_| t.divergence.is_none()),
            (t.slipped > 0).then(|| format!("slid {} times", t.slipped)),
            t.torn.then(|| "torn".to_owned()),
            (t.inverted_peak > 0).then(|| format!("{} inverted", t.inverted_peak)),
        ];
        vec![
            t.condition.name().to_owned(),
            t.design.clone(),
            fixed(t.at, 2),
            fixed(t.offset_mm, 0),
            t.drag_mm.map_or(String::new(), |d| fixed(d, 0)),
            if t.held { "yes" } else { "no" }.to_owned(),
            fixed(t.lift_mm, 1),
            fixed(t.slip_mm, 2),
            t.snap_mm.map_or(String::new(), |s| fixed(s, 2)),
            fixed(t.activation_step_mm, 2),
            fixed(t.closing_force_n, 2),
            fixed(t.gap_mm, 1),
            fixed(t.peak_constraint_n, 2),
            count(t.yielded_substeps),
            fixed(t.min_volume_ratio, 2),
            suspensions(&t.suspensions),
            remarks.into_iter().flatten().collect::<Vec<_>>().join("; "),
        ]
    };
    page::section("Every trial", "", &table::plain(&head, &r.trials.iter().map(row).collect::<Vec<_>>()))
}

#[cfg(test)]
mod tests {
    use crate::experiment::made_up_grasp_designs;

    #[test]
    fn every_row_stands_beside_the_papers() {
        let html = super::body(&made_up_grasp_designs()).unwrap();
        assert_eq!(html.matches("the paper</td>").count(), 5);
        assert!(html.contains("4.3\u{2013}17.8") && html.contains("0 of 15") && html.contains("14 of 15 held"));
        assert!(!html.contains("<b>made up</b>"), "texts are escaped");
        assert!(html.matches("<svg").count() == 4 && !html.contains("NaN"));
    }
}
