//! The page of random actions.

use crate::experiment::RandomActionsResult;
use trocar_report::page::{self, Card};
use trocar_report::table::{self, count, fixed, percent};

pub(super) fn body(r: &RandomActionsResult) -> String {
    let lead = format!(
        "Random but legal actions in the cell of {}, from {} seeds. An instrument that pierces, hooks or crushes tissue lets go of it and passes through until it is out; an organ folded for good is put \
         right. Both are counted.",
        page::escape(&r.scene),
        r.rows.len()
    );
    let good = r.rows.iter().filter(|row| row.diverged.is_none() && row.inverted_peak == 0).count();
    let broken: usize = r.rows.iter().map(|row| row.joint_limits_broken).sum();
    let cards = page::cards(&[
        Card::new("Actions", count(r.actions), "done"),
        Card::new("Seeds unbroken", format!("{good} of {}", r.rows.len()), "no divergence, no inverted element")
            .met(good == r.rows.len()),
        Card::new("Joint limits broken", count(broken), "over all actions").met(broken == 0),
    ]);
    let head = [
        "Seed",
        "Actions",
        "Diverged",
        "Inverted",
        "Stretch",
        "Least volume",
        "RCM [mm]",
        "Force [N]",
        "Contacts disabled",
        "Of blades",
        "Relaxed",
        "Guarded",
    ];
    let rows: Vec<Vec<String>> = r
        .rows
        .iter()
        .map(|row| {
            vec![
                row.seed.to_string(),
                count(row.actions),
                row.diverged.clone().unwrap_or_default(),
                count(row.inverted_peak),
                fixed(row.max_stretch, 2),
                percent(row.min_volume_ratio, 2),
                fixed(row.rcm_max_mm, 2),
                fixed(row.force_max_n, 2),
                count(row.disabled_contacts),
                count(row.disabled_blades),
                count(row.relaxed),
                count(row.guarded),
            ]
        })
        .collect();
    page::section("Random actions", &lead, &cards) + &page::section("Seed by seed", "", &table::plain(&head, &rows))
}
