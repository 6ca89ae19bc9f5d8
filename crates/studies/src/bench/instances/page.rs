//! The page of `bench many`.

use super::{CardRow, InstancesRow, ManyResult};
use crate::Result;
use trocar_report::document::{Document, Section, Table};
use trocar_report::page::Card;
use trocar_report::table::{count, fixed, percent};

/// Least rate of 1,024 instances of some 500 nodes (frames a second), and how much cheaper an
/// instance of them is to be at least.
const BAR: (usize, usize, f64, f64) = (1_024, 600, 20.0, 4.0);

/// The page.
///
/// # Errors
/// None.
pub(super) fn document(result: &ManyResult) -> Result<Document> {
    let lead = format!(
        "Ceca on one lattice, each with its own modulus, pose and path of the jaws that lift it. {} substeps a \
         frame of 1/60 s, {} threads; {}. Error: RMS distance from the converged solution of the same \
         substeps over RMS displacement.",
        result.substeps,
        result.threads,
        result.machine.described()
    );
    let (instances, nodes, rate, cheaper) = BAR;
    let judged = result.rows.iter().filter(|r| r.instances == instances && r.nodes <= nodes);
    let cards = judged.flat_map(|r| {
        [
            Card::new("Frames a second", fixed(r.frames_per_s, 1), format!("of {} instances", r.instances))
                .met(r.frames_per_s >= rate),
            Card::new("Over one alone", format!("{}\u{d7}", fixed(r.over_alone, 1)), r.alone.to_owned())
                .met(r.over_alone >= cheaper),
        ]
    });
    let section = Section::new("Instances", lead).cards(cards.collect::<Vec<_>>()).table(table(&result.rows));
    let alone = Table::of(
        &result.alone,
        &[
            ("Alone", &|r| r.name.to_owned()),
            ("Relative tolerance", &|r| r.relative.to_string()),
            ("Nodes", &|r| count(r.nodes)),
            ("Error", &|r| percent(r.error, 3)),
        ],
    );
    let mut document = Document::new("Many", "Many instances of one lattice in lanes").with(section);
    if let Some(first) = result.card.first() {
        let lead = format!(
            "The same instances on a graphics card, {}, beside the lanes of the same run. Paths of the tools go to the \
             card and reports come back in each frame.",
            first.card
        );
        document = document.with(Section::new("On a graphics card", lead).table(card(&result.card)));
    }
    Ok(document.with(Section::new("Alone", "The same organ and motion, stepped by itself.").table(alone)))
}

fn table(rows: &[InstancesRow]) -> Table {
    Table::of(
        rows,
        &[
            ("Nodes", &|r| count(r.nodes)),
            ("Instances", &|r| count(r.instances)),
            ("Frames/s", &|r| fixed(r.frames_per_s, 1)),
            ("Organ frames/s", &|r| count(r.organ_frames_per_s.round() as usize)),
            ("Error", &|r| percent(r.error, 3)),
            ("Memory (MB)", &|r| fixed(r.memory_mb, 1)),
            ("Over one alone", &|r| format!("{}\u{d7}", fixed(r.over_alone, 1))),
            ("Alone (ms)", &|r| fixed(r.alone_ms, 3)),
            ("Its error", &|r| percent(r.alone_error, 3)),
            ("Rounds", &|r| fixed(r.rounds, 1)),
            ("Unconverged", &|r| count(r.unconverged)),
        ],
    )
}

fn card(rows: &[CardRow]) -> Table {
    Table::of(
        rows,
        &[
            ("Nodes", &|r| count(r.nodes)),
            ("Instances", &|r| count(r.instances)),
            ("Frames/s", &|r| fixed(r.frames_per_s, 1)),
            ("Organ frames/s", &|r| count(r.organ_frames_per_s.round() as usize)),
            ("Over lanes", &|r| format!("{}\u{d7}", fixed(r.over_lanes, 1))),
            ("Error", &|r| percent(r.error, 3)),
            ("Memory (MB)", &|r| fixed(r.memory_mb, 1)),
            ("Rounds", &|r| fixed(r.rounds, 1)),
            ("Unconverged", &|r| count(r.unconverged)),
        ],
    )
}
