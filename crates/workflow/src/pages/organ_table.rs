//! The table of organs, beside the paper's Table I.

use crate::paper::{PaperOrgan, TABLE_I, table_i};
use std::fmt::Write;
use trocar_report::table::{count, fixed, or_dash, percent};
use trocar_report::{colors, page};
use trocar_specimen::{Organ, Specimen};

/// One row per organ. `beside_paper` adds the paper's figures for organs of the same name.
pub fn organs(specimen: &Specimen, beside_paper: bool) -> String {
    let seen = specimen.organs.iter().any(|o| o.facts.depth_error_median_mm.is_some());
    let mut out = String::from(
        "<div class=\"wide\"><table><thead><tr><th>Organ</th><th>Nodes</th><th>Tetra\u{ad}hedra</th><th>E<br>(kPa)</th>\
         <th>Min. dihedral<br>(\u{b0})</th><th>Median dihedral<br>(\u{b0})</th><th>Median edge<br>(mm)</th>\
         <th>Volume<br>(cm\u{b3})</th><th>Water\u{ad}tight</th><th>In\u{ad}verted</th>",
    );
    if seen {
        out.push_str("<th>Depth error<br>(mm)</th><th>signed<br>(mm)</th><th>Covered</th>");
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
        let _ = write!(
            out,
            "<td>{}</td><td>{}</td><td>{}</td>",
            or_dash(facts.depth_error_median_mm, 2),
            or_dash(facts.depth_error_signed_mm, 2),
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
