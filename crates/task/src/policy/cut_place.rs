//! Where a lifted organ is cut: between the grasp and its attachment.

use crate::{Episode, Error, Result};

/// Least room between the tissue in the jaws and the cut (m): half of the grasper's blades stands
/// out beside that tissue's middle, and a cutter's edge beside them.
const MIN_ROOM: f64 = 0.003;

/// With pins on both sides of the grasp there is no end to cut off; the cut is then this far from
/// the grasp (m).
const BESIDE: f64 = 0.008;

/// The organ coordinate half way between the tissue in the jaws and the part of `body` that is
/// pinned.
///
/// # Errors
/// When the jaws hold nothing, or there is no room.
pub(super) fn cut_place(episode: &Episode, body: usize) -> Result<f64> {
    let world = episode.cell().world();
    let (data, axis) = (&world.model.bodies()[body], &world.axes[body]);
    let held = episode.roles().0.map_or_else(Vec::new, |k| episode.cell().carried_coordinates(k));
    if held.is_empty() {
        return Err(Error::Option(format!("the jaws hold nothing of the {}, so there is no cut to make", data.name())));
    }
    let pins: Vec<f64> = (0..data.len()).filter(|i| data.pinned()[*i]).map(|i| axis.s[i]).collect();
    between(&held, &pins, axis.length).map_err(|room| {
        Error::Option(format!(
            "no room to cut the {} between the grasp at s = {:.2} and what holds it: {:.1} mm, and {:.0} are needed; \
             grasp farther away with --at, or say where to cut with --sever=S",
            data.name(),
            mean(&held),
            1e3 * room,
            1e3 * MIN_ROOM
        ))
    })
}

/// The same for organ coordinates of held and pinned nodes and the organ's length (m). Where there
/// is too little room, the room there is (m).
fn between(held: &[f64], pins: &[f64], length: f64) -> std::result::Result<f64, f64> {
    let middle = mean(held);
    let towards_base = pins.iter().filter(|s| **s < middle).count();
    let towards_tip = pins.iter().filter(|s| **s > middle).count();
    let to_base = towards_base >= towards_tip;
    // From the grasp towards the organ's attachment (m).
    let along = |s: f64| if to_base { middle - s } else { s - middle } * length;
    let grasp_ends = held.iter().map(|s| along(*s)).fold(0.0, f64::max);
    let end = along(if to_base { 0.0 } else { 1.0 });
    let (room_ends, wanted) = if towards_base == 0 || towards_tip == 0 {
        let pin = pins.iter().map(|s| along(*s)).filter(|d| *d > 0.0).fold(end, f64::min);
        (pin, 0.5 * (grasp_ends + pin))
    } else {
        (end, grasp_ends + MIN_ROOM + BESIDE)
    };
    if grasp_ends + MIN_ROOM > room_ends {
        return Err((room_ends - grasp_ends).max(0.0));
    }
    let at = wanted.clamp(grasp_ends + MIN_ROOM, room_ends) / length;
    Ok((middle + if to_base { -at } else { at }).clamp(0.0, 1.0))
}

/// The mean; 0 of nothing.
fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_cut_lies_between_the_grasp_and_what_holds_the_organ() {
        let held = [0.65, 0.75];
        let near = |found: std::result::Result<f64, f64>, right: f64| found.is_ok_and(|s| (s - right).abs() < 1e-9);
        // 100 mm long; half way to the nearest pin on the one side that has any.
        assert!(near(between(&held, &[0.1, 0.45], 0.1), 0.55));
        assert!(near(between(&held, &[0.95], 0.1), 0.85));
        assert!(near(between(&held, &[], 0.1), 0.325), "unpinned, on its base's side");
        // Pinned on both sides: 11 mm from the tissue in the jaws, or at the end.
        assert!(near(between(&held, &[0.1, 0.5, 0.6, 0.9], 0.1), 0.54));
        assert!(near(between(&[0.04, 0.06], &[0.02, 0.03, 0.9], 0.1), 0.0));
        // 2 mm of room are too few.
        assert!(between(&held, &[0.63], 0.1).is_err_and(|room| (room - 0.002).abs() < 1e-9));
        assert!(near(between(&held, &[0.61], 0.1), 0.62), "3 mm from the grasp at least");
    }
}
