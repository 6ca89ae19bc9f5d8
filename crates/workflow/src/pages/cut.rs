//! The section on a cut and its pieces.

use trocar_cell::SeveredPiece;
use trocar_report::document::Table;
use trocar_report::page::{self, Card};
use trocar_report::table::{count, fixed};
use trocar_task::Severed;

/// The section on the cut `s`.
pub(super) fn section(s: &Severed) -> String {
    let c = &s.cut;
    let inverted = c.inverted_after.max(s.inverted_peak);
    let mut body = page::cards(&[
        Card::new("Outcome", c.outcome.clone(), format!("at s = {}", fixed(c.at, 2))).met(c.outcome == "severed"),
        Card::new(
            "Pieces",
            count(c.pieces.len().max(1)),
            c.pieces.iter().map(|p| p.name.clone()).collect::<Vec<_>>().join(", "),
        ),
        Card::new(
            "Held after the cut",
            if s.held { "yes" } else { "no" },
            format!("jaws rose {} mm, tissue in them {} mm", fixed(s.jaw_rise_mm, 1), fixed(s.held_rise_mm, 1)),
        )
        .met(s.held),
        Card::new(
            "Cut face",
            format!("{} mm\u{b2}", fixed(c.area_mm2, 0)),
            format!("{} faces on one side", count(c.faces)),
        ),
        Card::new(
            "Volume error",
            if c.volume_error > 0.0 { format!("{:.0e}", c.volume_error) } else { "none".to_owned() },
            format!("{} mm\u{b3} before and after", fixed(c.volume_before_mm3, 0)),
        )
        .met(c.volume_error < 1e-6),
        Card::new("Inverted since the cut", count(inverted), "elements, maximum of any frame").met(inverted == 0),
        Card::new(
            "Blades",
            format!("{} to {} rad", fixed(c.opened_rad, 2), fixed(c.closed_rad, 2)),
            format!("closed {} s into the episode", fixed(s.time_s, 2)),
        ),
        Card::new(
            "Work of the blades",
            format!("{} mJ", fixed(c.work_mj, 1)),
            format!("at most {} N at their middle", fixed(c.force_peak_n, 1)),
        ),
    ]);
    if !c.pieces.is_empty() {
        body += &pieces(&c.pieces).html();
    }
    // A sentence begins with a capital on the page.
    let mut said = c.said.clone();
    if let Some(first) = said.get_mut(..1) {
        first.make_ascii_uppercase();
    }
    page::section("The cut", &page::escape(&format!("{said}.")), &body)
}

fn pieces(pieces: &[SeveredPiece]) -> Table {
    Table::of(
        pieces,
        &[
            ("Piece", &|p| p.name.clone()),
            ("s", &|p| format!("{}\u{2013}{}", fixed(p.s_from, 2), fixed(p.s_to, 2))),
            ("Nodes", &|p| count(p.nodes)),
            ("Pinned", &|p| count(p.pinned)),
            ("In the jaws", &|p| count(p.held)),
            ("Elements", &|p| count(p.elements)),
            ("Volume before (mm\u{b3})", &|p| fixed(p.volume_before_mm3, 1)),
            ("after (mm\u{b3})", &|p| fixed(p.volume_after_mm3, 1)),
            ("Rise since the cut (mm)", &|p| fixed(p.rise_mm, 1)),
        ],
    )
}
