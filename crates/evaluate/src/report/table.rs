//! Tables: organs beside the paper's Table I, and the summary of a run.

use super::{colors, page};
use crate::paper::{PaperOrgan, TABLE_I, table_i};
use std::fmt::Write;
use trocar_cell::Summary;
use trocar_specimen::{Organ, Specimen};

/// A count with thin spaces between thousands.
pub(super) fn count(n: usize) -> String {
    let digits = n.to_string();
    let mut out = String::new();
    for (i, c) in digits.chars().enumerate() {
        if i > 0 && (digits.len() - i).is_multiple_of(3) {
            out.push('\u{202f}');
        }
        out.push(c);
    }
    out
}

/// A number with fixed decimals and a true minus; a dash where it is not finite.
pub(super) fn fixed(value: f64, decimals: usize) -> String {
    if !value.is_finite() {
        return "\u{2013}".to_owned();
    }
    let text = format!("{value:.decimals$}");
    match text.strip_prefix('-') {
        Some(rest) if rest.chars().all(|c| c == '0' || c == '.') => rest.to_owned(),
        Some(rest) => format!("\u{2212}{rest}"),
        None => text,
    }
}

/// A share as a percentage.
pub(super) fn percent(share: f64, decimals: usize) -> String {
    format!("{}\u{202f}%", fixed(100.0 * share, decimals))
}

/// A row an organ. `beside_paper` puts the paper's figures under those of organs of the same name.
pub(super) fn organs(specimen: &Specimen, beside_paper: bool) -> String {
    let seen = specimen.organs.iter().any(|o| o.facts.depth_error_median_mm.is_some());
    let mut out = String::from(
        "<div class=\"wide\"><table><thead><tr><th>Organ</th><th>Nodes</th><th>Tetra\u{ad}hedra</th><th>E<br>[kPa]</th>\
         <th>Min. dihedral<br>[\u{b0}]</th><th>Median dihedral<br>[\u{b0}]</th><th>Median edge<br>[mm]</th>\
         <th>Volume<br>[cm\u{b3}]</th><th>Water\u{ad}tight</th><th>In\u{ad}verted</th>",
    );
    if seen {
        out.push_str("<th>Depth error<br>[mm]</th><th>signed<br>[mm]</th><th>Covered</th>");
    }
    out.push_str("</tr></thead><tbody>\n");
    for (i, organ) in specimen.organs.iter().enumerate() {
        let paper = if beside_paper { table_i(&specimen.name, &organ.name) } else { None };
        organ_row(&mut out, i, organ, paper, seen);
    }
    if specimen.organs.len() > 1 {
        sum_row(&mut out, specimen, beside_paper, seen);
    }
    out.push_str("</tbody></table></div>\n");
    out
}

fn organ_row(out: &mut String, index: usize, organ: &Organ, paper: Option<&PaperOrgan>, seen: bool) {
    let facts = &organ.facts;
    let small = |text: Option<String>| text.map_or(String::new(), |t| format!("<small>{t}</small>"));
    let verdict = |good: bool| if good { "" } else { " class=\"bad\"" };
    let _ = write!(
        out,
        "<tr><td><i style=\"background:{}\"></i>{}{}</td><td>{}{}</td><td>{}{}</td><td>{}{}</td>\
         <td>{}</td><td>{}</td><td>{}</td><td>{}</td><td{}>{}</td><td{}>{}</td>",
        page::hex(colors::organ(index)),
        page::escape(&organ.name),
        small(paper.map(|_| "paper".to_owned())),
        count(facts.nodes),
        small(paper.map(|p| count(p.nodes))),
        count(facts.tets),
        small(paper.map(|p| count(p.tets))),
        fixed(organ.material.young_modulus_pa / 1e3, 0),
        small(paper.map(|p| fixed(p.young_modulus_kpa, 0))),
        fixed(facts.min_dihedral_deg, 1),
        fixed(facts.median_dihedral_deg, 1),
        fixed(facts.median_edge_mm, 2),
        fixed(facts.volume_cm3, 1),
        verdict(facts.watertight),
        if facts.watertight { "yes" } else { "no" },
        verdict(facts.inverted == 0),
        count(facts.inverted),
    );
    if seen {
        let number = |v: Option<f64>| fixed(v.unwrap_or(f64::NAN), 2);
        let _ = write!(
            out,
            "<td>{}</td><td>{}</td><td>{}</td>",
            number(facts.depth_error_median_mm),
            number(facts.depth_error_signed_mm),
            facts.covered.map_or("\u{2013}".to_owned(), |c| percent(c, 0))
        );
    }
    out.push_str("</tr>\n");
}

fn sum_row(out: &mut String, specimen: &Specimen, beside_paper: bool, seen: bool) {
    let facts = || specimen.organs.iter().map(|o| &o.facts);
    let known = || TABLE_I.iter().filter(|p| p.phantom == specimen.name);
    let all_known = beside_paper
        && known().count() == specimen.organs.len()
        && known().all(|p| specimen.organs.iter().any(|o| o.name == p.organ));
    let paper = |value: usize| if all_known { format!("<small>{}</small>", count(value)) } else { String::new() };
    let _ = writeln!(
        out,
        "<tr class=\"sum\"><td>together</td><td>{}{}</td><td>{}{}</td><td></td><td></td><td></td><td></td><td>{}</td>\
         <td></td><td>{}</td>{}</tr>",
        count(facts().map(|f| f.nodes).sum()),
        paper(known().map(|p| p.nodes).sum()),
        count(facts().map(|f| f.tets).sum()),
        paper(known().map(|p| p.tets).sum()),
        fixed(facts().map(|f| f.volume_cm3).sum(), 1),
        count(facts().map(|f| f.inverted).sum()),
        if seen { "<td></td><td></td><td></td>" } else { "" },
    );
}

/// Rows of two or three plain texts under a head.
pub(super) fn plain(head: &[&str], rows: &[Vec<String>]) -> String {
    let cells = |tag: &str, texts: &mut dyn Iterator<Item = &str>| {
        texts.map(|t| format!("<{tag}>{}</{tag}>", page::escape(t))).collect::<String>()
    };
    let mut out = format!(
        "<div class=\"wide\"><table class=\"plain\"><thead><tr>{}</tr></thead><tbody>\n",
        cells("th", &mut head.iter().copied())
    );
    for row in rows {
        let _ = writeln!(out, "<tr>{}</tr>", cells("td", &mut row.iter().map(String::as_str)));
    }
    out.push_str("</tbody></table></div>\n");
    out
}

/// Every figure of a run with what it means.
pub(super) fn summary(s: &Summary) -> String {
    let yes = |b: bool| if b { "yes" } else { "no" }.to_owned();
    let rows: [(&str, String, &str); 27] = [
        ("Organ", format!("{}, s = {}", s.organ, fixed(s.at, 2)), "grasped at this organ coordinate, 0 base to 1 tip"),
        ("Grasp design", s.design.to_owned(), "friction, rest-pose, live-pose or compliant"),
        ("Jaw force", format!("{} N", fixed(s.jaw_force_n, 2)), "what the jaws may press with"),
        (
            "Closed on",
            format!("{} mm with {} N", fixed(s.gap_mm, 1), fixed(s.closing_force_n, 2)),
            "gap between the blades and the force that pushed them apart when they had closed",
        ),
        ("In the mouth", yes(s.attached), "tissue on both sides of the closing plane when the jaws had closed"),
        ("Nodes held", count(s.held_nodes), "tissue nodes inside the jaws at activation"),
        ("Held", yes(s.held), "follow ratio at least 0.80 and slip under 3 mm"),
        (
            "Lift",
            format!("{} mm", fixed(s.lift_mm, 2)),
            "rise of the grasped cluster's centroid, activation to end of hold",
        ),
        ("Follow ratio", fixed(s.follow_ratio, 3), "tissue lift over jaw lift"),
        (
            "Slip",
            format!("{} mm", fixed(s.slip_mm, 3)),
            "motion of the cluster's centroid in the jaw frame, end of hold",
        ),
        ("Snap", format!("{} mm", fixed(s.snap_mm, 3)), "largest jump the grasp prescribes when it activates"),
        (
            "Peak forces",
            format!("{} N contact, {} N constraint", fixed(s.peak_contact_n, 2), fixed(s.peak_constraint_n, 2)),
            "of tissue on the gripper; of held nodes at it",
        ),
        ("Slid", count(s.slipped), "frames in which held tissue began to slide through the jaws"),
        ("Torn", yes(s.torn), "the pull went beyond what the tissue bears"),
        (
            "Activation step",
            format!("{} mm", fixed(s.activation_step_mm, 3)),
            "largest motion of any node in that frame",
        ),
        ("Inverted at rest", count(s.inverted_rest), "elements, before the first step"),
        ("Inverted, peak", count(s.inverted_peak), "elements, most in any frame"),
        ("Volume ratio, smallest", fixed(s.min_volume_ratio, 3), "element volume over its rest volume"),
        ("Speed, peak", format!("{} m/s", fixed(s.peak_speed_m_s, 3)), "of any node in any frame"),
        ("Speed, settled", format!("{:.1e} m/s", s.settled_speed_m_s), "of any node one second after release"),
        ("Calmed", format!("{:.2} s", s.calmed_s), "kinetic damping of organs that had not settled by then"),
        ("Speed, at rest", format!("{:.1e} m/s", s.resting_speed_m_s), "of any node when the gripper sets out"),
        ("Pin drift", format!("{:.1e} mm", s.pin_drift_mm), "largest motion of a pinned node"),
        (
            "Diverged",
            s.divergence.clone().unwrap_or_else(|| yes(s.diverged)),
            "a run that diverges is stopped and says why",
        ),
        ("Simulated", format!("{} s", fixed(s.simulated_s, 2)), "in frames of 1/60 s"),
        (
            "Real-time factor",
            fixed(s.real_time_factor, 2),
            "simulated over wall time of the stepping, on the machine that wrote this report",
        ),
        ("State hash", s.state_hash.clone(), "of the final state; the same for any number of threads"),
    ];
    let rows: Vec<Vec<String>> =
        rows.into_iter().map(|(name, value, note)| vec![name.to_owned(), value, note.to_owned()]).collect();
    plain(&["Figure", "Value", "Meaning"], &rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        assert_eq!(count(1_234_567), "1\u{202f}234\u{202f}567");
        assert_eq!(count(999), "999");
        assert_eq!(fixed(-0.001, 2), "0.00");
        assert_eq!(fixed(-1.234, 1), "\u{2212}1.2");
        assert_eq!(fixed(f64::NAN, 1), "\u{2013}");
        assert_eq!(percent(0.034, 1), "3.4\u{202f}%");
    }
}
