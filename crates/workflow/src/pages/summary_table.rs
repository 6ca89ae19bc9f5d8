//! The table of a run's summary.

use trocar_cell::Summary;
use trocar_report::table::{count, fixed, plain};

/// Every figure of a run with what it means.
pub fn summary(s: &Summary) -> String {
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
