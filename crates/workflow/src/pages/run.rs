//! Sections on the bodies themselves and on a grasp-lift run.

use super::moving_picture::{self, Lift};
use super::organ_table;
use super::organ_views::{self, Directions};
use super::{severed, summary_table};
use crate::Result;
use glam::DVec3;
use trocar_cell::{GraspLiftRun, Sample};
use trocar_report::page::{self, Card, Columns};
use trocar_report::plots::{Band, Line, Plot};
use trocar_report::table::{count, fixed};
use trocar_report::views::View;
use trocar_report::{colors, figures};
use trocar_specimen::Specimen;

const JAW: [u8; 3] = [128, 138, 150];
const TISSUE: [u8; 3] = [16, 150, 140];

/// Views of the organs and their table.
pub(super) fn bodies(s: &Specimen, beside_paper: bool) -> Result<String> {
    // The bodies too: a lattice may stand out a little beyond its surface.
    let points: Vec<DVec3> =
        s.organs.iter().flat_map(|o| o.surface.vertices.iter().chain(&o.body.vertices).copied()).collect();
    let d = Directions::of(s);
    let size = (800, 520);
    let oblique = View::framing(&points, d.oblique(), d.up, size);
    let low = View::framing(&points, d.low(), d.up, size);
    let rest = organ_views::rest(s);
    let picture = |view: &View, instances, alt: &str| figures::img(&view.picture(instances, 2), alt);
    let names = s.organs.iter().enumerate().map(|(i, o)| (o.name.as_str(), colors::organ(i)));
    let wires = format!("<b>Tetrahedra.</b> Outer faces of the bodies that are simulated.{}", page::legend(names));
    let cut = "<b>Cut-away.</b> Each organ opened by an upright plane through its middle; cut elements are lighter.";
    let figures = [
        page::figure(
            &picture(&oblique, organ_views::surfaces(s), "organ surfaces, oblique view")?,
            "<b>Surfaces.</b> Closed, coloured, seen obliquely from the front.",
        ),
        page::figure(
            &picture(&low, organ_views::surfaces(s), "organ surfaces, low view")?,
            "<b>Surfaces, from low on the other side.</b>",
        ),
        page::figure(&picture(&oblique, organ_views::wires(s, &rest, None), "tetrahedral meshes")?, &wires),
        page::figure(
            &picture(&oblique, organ_views::wires(s, &rest, Some(d.front)), "tetrahedral meshes, cut open")?,
            cut,
        ),
    ];
    let lead = if beside_paper {
        "Each organ is a watertight surface around a body of tetrahedra; under the figures, where the names agree, \
         the paper\u{2019}s Table I."
    } else {
        "Each organ is a watertight surface around a body of tetrahedra."
    };
    let body = page::grid(Columns::Two, &figures) + &organ_table::organs(s, beside_paper);
    Ok(page::section("The organs", lead, &body))
}

/// The outcome of a run, and its curves and table.
pub(super) fn sections(s: &Specimen, run: &GraspLiftRun) -> Result<(String, String)> {
    let lift = Lift::new(s, run)?;
    let mut outcome = cards(run);
    let mut stills = String::new();
    if let Some(lift) = &lift {
        let gif = lift.gif()?;
        let (w, h) = moving_picture::SIZE;
        let moving = figures::img_of_bytes(
            "gif",
            &gif,
            w,
            h,
            if run.summary.sever.is_some() {
                "the organ is grasped, lifted, held and cut"
            } else {
                "the organ is grasped, lifted, held and lowered"
            },
        );
        let pace = lift.pace();
        let pace = if (pace - 1.0).abs() < 0.1 {
            "in real time".to_owned()
        } else {
            format!("{} times real time", fixed(pace, 1))
        };
        let view = lift.view(2);
        let top = lift.top();
        let still = figures::img(&view.picture(lift.surfaces(top), 2), "the organ at the top of the lift")?;
        outcome += &page::grid(
            Columns::Two,
            &[
                page::figure(
                    &moving,
                    &format!("<b>The lift,</b> {pace}. The recorded surface rides on the simulated body."),
                ),
                page::figure(&still, &format!("<b>At the top,</b> {} s into the run.", fixed(top.time_s, 2))),
            ],
        );
        let first = &run.snapshots[0];
        let before = figures::img(&view.picture(lift.wires(first), 2), "elements before the lift")?;
        let after = figures::img(&view.picture(lift.wires(top), 2), "elements at the top of the lift")?;
        stills = page::grid(
            Columns::Two,
            &[
                page::figure(&before, &format!("<b>Elements before,</b> at {} s.", fixed(first.time_s, 2))),
                page::figure(&after, "<b>Elements at the top</b> of the lift."),
            ],
        );
    } else {
        outcome += "<p class=\"lead\">This run kept no snapshots, so there is no moving picture of it.</p>\n";
    }
    let title = if run.summary.diverged { "The lift (diverged)" } else { "The lift" };
    let lead = if run.summary.sever.is_some() {
        "The gripper closes on the organ, lifts it and holds it; a second instrument cuts it, and what came loose is lifted on."
    } else {
        "The gripper closes on the organ, lifts it, holds it, lowers it and lets go."
    };
    let lead = run
        .summary
        .force_advice()
        .map_or(lead.to_owned(), |advice| format!("{lead} <b>Note:</b> {}.", page::escape(&advice)));
    let mut after = String::new();
    if let Some(sever) = &run.summary.sever {
        after = severed::section(s, sever, lift.as_ref())?;
    }
    let details = page::section("Frame by frame", "Shaded: the phases of the task.", &(plots(&run.samples)? + &stills))
        + &page::section("All figures of the run", "", &summary_table::summary(&run.summary));
    Ok((page::section(title, &lead, &outcome) + &after, details))
}

fn cards(run: &GraspLiftRun) -> String {
    let s = &run.summary;
    let mut cards = vec![
        Card::new("Lift", format!("{} mm", fixed(s.lift_mm, 1)), format!("{} nodes held", count(s.held_nodes))),
        Card::new("Follow ratio", fixed(s.follow_ratio, 3), "target at least 0.80").met(s.follow_ratio >= 0.8),
        Card::new("Slip", format!("{} mm", fixed(s.slip_mm, 2)), "target under 3 mm").met(s.slip_mm < 3.0),
        Card::new(
            "Grasp",
            s.design,
            format!("jaws of {} N, {} N when they had closed", fixed(s.jaw_force_n, 2), fixed(s.closing_force_n, 2)),
        )
        .met(s.attached),
        Card::new("Snap", format!("{} mm", fixed(s.snap_mm, 3)), "jump at activation"),
        Card::new("Inverted, peak", count(s.inverted_peak), "elements in any frame").met(s.inverted_peak == 0),
        Card::new("Peak speed", format!("{} m/s", fixed(s.peak_speed_m_s, 2)), "any node, any frame"),
        Card::new("Real-time factor", fixed(s.real_time_factor, 1), "simulated over wall time"),
        Card::new("State hash", s.state_hash.chars().take(8).collect::<String>(), "full one in the table"),
    ];
    if s.diverged {
        let why = s.divergence.clone().unwrap_or_default();
        cards.insert(0, Card::new("Diverged", "yes", why).met(false));
    }
    page::cards(&cards)
}

fn plots(samples: &[Sample]) -> Result<String> {
    let bands = || {
        let mut bands: Vec<Band> = Vec::new();
        for s in samples {
            match bands.last_mut() {
                Some(band) if band.name == s.phase => band.to = s.time_s,
                Some(band) => {
                    band.to = s.time_s;
                    bands.push(Band { name: s.phase.to_owned(), from: s.time_s, to: s.time_s });
                }
                None => bands.push(Band { name: s.phase.to_owned(), from: s.time_s, to: s.time_s }),
            }
        }
        bands
    };
    let line = |value: &dyn Fn(&Sample) -> f64, color| Line {
        points: samples.iter().map(|s| (s.time_s, value(s))).collect(),
        color,
        filled: false,
    };
    let plot = |title, y, lines, show: &[f64], limits: &[f64], log_y| {
        Plot {
            title,
            x: "time [s]",
            y,
            lines,
            bands: bands(),
            show: show.to_vec(),
            limits: limits.to_vec(),
            log_x: false,
            log_y,
        }
        .svg()
    };
    let lift = vec![line(&|s| s.jaw_lift_mm, JAW), line(&|s| s.tissue_lift_mm, TISSUE)];
    let slip = vec![Line { filled: true, ..line(&|s| s.slip_mm, TISSUE) }];
    let names = page::legend([("jaw", JAW), ("grasped tissue", TISSUE)]);
    let forces = vec![
        line(&|s| s.contact_n, colors::organ(1)),
        line(&|s| s.jaw_force_n, colors::organ(0)),
        line(&|s| s.constraint_n, colors::organ(3)),
    ];
    let force_names =
        page::legend([("contact", colors::organ(1)), ("jaw", colors::organ(0)), ("constraint", colors::organ(3))]);
    let angle = vec![line(&|s| s.jaw_angle_deg, JAW)];
    let figures = [
        page::figure(
            &plot("lift over time", "lift [mm]", lift, &[0.0], &[], false)?,
            &format!("<b>Lift.</b> Rise of the jaw and of the grasped tissue since activation [mm].{names}"),
        ),
        page::figure(
            &plot("slip over time", "slip [mm]", slip, &[0.0], &[3.0], false)?,
            "<b>Slip.</b> How far the grasped tissue has moved in the jaws [mm]; dashed: the limit of 3 mm.",
        ),
        page::figure(
            &plot("forces over time", "force [N]", forces, &[0.0], &[], false)?,
            &format!(
                "<b>Forces</b> on the gripper [N]: contact of tissue with blades and shaft; how hard it pushes the blades apart; constraint, the pull of held nodes, which \
                 is no tissue contact.{force_names}"
            ),
        ),
        page::figure(
            &plot("jaw angle over time", "angle [\u{b0}]", angle, &[0.0], &[], false)?,
            "<b>Angle between the blades</b> [\u{b0}]. They close with a force, not to an angle.",
        ),
        page::figure(
            &plot(
                "largest node speed over time",
                "speed [m/s]",
                vec![line(&|s| s.max_speed_m_s, TISSUE)],
                &[],
                &[0.01],
                true,
            )?,
            "<b>Largest node speed</b> over all organs [m/s], logarithmic; dashed: settled, 0.01 m/s.",
        ),
        page::figure(
            &plot(
                "smallest volume ratio over time",
                "volume ratio [1]",
                vec![line(&|s| s.min_volume_ratio, TISSUE)],
                &[0.0, 1.0],
                &[],
                false,
            )?,
            "<b>Smallest volume ratio.</b> Volume of the most compressed element over its volume at rest [1]; \
             at 0 an element is inverted.",
        ),
    ];
    Ok(page::grid(Columns::Two, &figures))
}
