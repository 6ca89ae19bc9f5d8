//! Scissors that close through tissue: how the cut advances, and what it takes.
//!
//! At a station x along the blades the edges are 2 x tan(theta / 2) apart. Where they are as far
//! apart as the tissue there is thick, they meet it, and the cut passes that station while they
//! close by a share of its thickness ([`SINK`]). A cut opens an area, and each unit of area takes
//! the toughness J. So the torque that closes the blades is J dA/dtheta, which for a sheet of
//! thickness t is J t^2 / (4 sin^2(theta / 2)) but for the cosine of the half angle, as in Mahvash
//! and Okamura (2005; 2008, IEEE Trans. Biomed. Eng. 55:848). It depends on toughness and geometry,
//! not on stiffness. Tissue that is thicker than the edges are apart is cut where they pass, with
//! the force J for each length of edge.
//!
//! Torque is limited by what the jaws have. If the tissue needs more torque, the blades stop.

use crate::section::{Chord, STATION, place};

/// Share of the thickness by which the edges sink into tissue until they are through. It spreads
/// the cut over a short distance: without it, edges that meet a round organ along a line would need
/// an infinite force. The force on a sheet is smaller by half of this share.
pub(crate) const SINK: f64 = 0.15;

/// The blades turn in steps of this angle (rad).
const TURN: f64 = 0.002;

/// A cut is through when this share of the tissue between the blades is left.
const LEFT: f64 = 0.03;

/// A station along the blades.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Station {
    /// Thickness of the tissue there (m); 0 without tissue.
    thickness: f64,
    /// Gaps between the edges at which the cut begins and ends there (m).
    gaps: [f64; 2],
    /// Share of it that is cut.
    share: f64,
}

impl Station {
    /// The share that is cut when the edges are `gap` (m) apart.
    fn share_at(&self, gap: f64) -> f64 {
        let [from, to] = self.gaps;
        if from > to { ((from - gap) / (from - to)).clamp(self.share, 1.0) } else { self.share }
    }
}

/// Blades on their way through an organ.
#[derive(Clone, Debug)]
pub(crate) struct Bite {
    /// The body that they cut.
    pub organ: usize,
    /// Angle of the open blades (rad).
    pub opened: f64,
    /// Area that events have already reported (m2).
    pub told: f64,
    /// Force that tissue exerts on the blades, at their middle (N).
    pub force: f64,
    /// Largest such force so far.
    pub force_peak: f64,
    /// Work of the jaws so far (J).
    pub work: f64,
    /// Toughness of the tissue (J/m2).
    toughness: f64,
    /// Distance of the blades' middle from the pivot (m).
    lever: f64,
    stations: Vec<Station>,
    /// Tissue at each station that earlier cuts opened (m).
    slit: Vec<f64>,
}

impl Bite {
    /// Blades that begin to close through body `organ` of some `toughness` (J/m2) after they were
    /// `opened` (rad), whose middle is at `lever` (m) from the pivot. `slit` is the tissue at each
    /// station that is open already (m).
    pub fn new(organ: usize, opened: f64, toughness: f64, lever: f64, slit: Vec<f64>) -> Self {
        let stations = vec![Station::default(); slit.len()];
        let [told, force, force_peak, work] = [0.0; 4];
        Self { organ, opened, told, force, force_peak, work, toughness, lever, stations, slit }
    }

    /// Updates the stations to the tissue's present place, with the blades at `angle` (rad). A
    /// station that is partly cut keeps its earlier measurement.
    pub fn measure(&mut self, chords: &[Chord], angle: f64) {
        for (k, (station, chord)) in self.stations.iter_mut().zip(chords).enumerate() {
            if station.share > 0.0 {
                continue;
            }
            let (gap, length) = (gap(k, angle), chord.length - self.slit[k].min(chord.length));
            let thickness = if chord.between { length.min(gap) } else { 0.0 };
            let end = if length > gap { 0.0 } else { (1.0 - SINK) * thickness };
            *station = Station { thickness, gaps: [thickness, end], share: 0.0 };
        }
    }

    /// Closes the blades from the angle `from` towards `to` (rad) with at most the torque `most`
    /// (N m). Returns the angle that they reach.
    pub fn close(&mut self, from: f64, to: f64, most: f64) -> f64 {
        if to >= from {
            return to;
        }
        let turns = ((from - to) / TURN).ceil().max(1.0);
        let (mut angle, mut spent, mut stands) = (from, 0.0, false);
        for k in 1..=turns as usize {
            let next = if k == turns as usize { to } else { from + (to - from) * k as f64 / turns };
            let takes = self.toughness * self.area_by(next);
            stands = takes > most * (angle - next);
            if stands {
                break;
            }
            self.stations.iter_mut().enumerate().for_each(|(k, s)| s.share = s.share_at(gap(k, next)));
            (angle, spent) = (next, spent + takes);
        }
        self.work += spent;
        self.force = if stands { most } else { spent / (from - to) } / self.lever;
        self.force_peak = self.force_peak.max(self.force);
        angle
    }

    /// Further area that is cut when the blades close to `angle` (m2).
    fn area_by(&self, angle: f64) -> f64 {
        let of = |(k, s): (usize, &Station)| s.thickness * (s.share_at(gap(k, angle)) - s.share);
        STATION * self.stations.iter().enumerate().map(of).sum::<f64>()
    }

    /// Area that is cut (m2).
    pub fn area(&self) -> f64 {
        STATION * self.stations.iter().map(|s| s.thickness * s.share).sum::<f64>()
    }

    /// Whether almost nothing is left between the blades.
    pub fn is_through(&self) -> bool {
        self.area() > 0.0 && self.area() >= (1.0 - LEFT) * self.area_between()
    }

    /// Whether enough was cut since the last event for another.
    pub fn has_news(&self) -> bool {
        self.area() - self.told > LEFT * self.area_between()
    }

    /// Area of the tissue that was between the blades when they reached it (m2).
    fn area_between(&self) -> f64 {
        STATION * self.stations.iter().map(|s| s.thickness).sum::<f64>()
    }

    /// The part of the blades along which tissue is cut: distances from the pivot (m). `None`
    /// without any.
    pub fn part(&self) -> Option<[f64; 2]> {
        let cut = |s: &Station| s.thickness > 0.0 && s.share > 0.5;
        let first = self.stations.iter().position(cut)?;
        let last = self.stations.iter().rposition(cut)?;
        Some([place(first) - 0.5 * STATION, place(last) + 0.5 * STATION])
    }

    /// The numbers of its state.
    pub fn numbers(&self) -> impl Iterator<Item = f64> {
        let Self { organ, opened, told, force, force_peak, work, toughness, lever, stations, slit } = self;
        let of = |s: &Station| [s.thickness, s.gaps[0], s.gaps[1], s.share];
        let own = [*organ as f64, *opened, *told, *force, *force_peak, *work, *toughness, *lever];
        own.into_iter().chain(stations.iter().flat_map(of)).chain(slit.iter().copied())
    }
}

/// Gap between the edges at station `k` (m), with the blades at `angle` (rad).
fn gap(k: usize, angle: f64) -> f64 {
    2.0 * place(k) * libm::tan(0.5 * angle)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::MAX_ANGLE;
    use crate::gripper::BLADE_TIP;
    use crate::section::count;

    const LEVER: f64 = 0.0115;

    /// Scissors about tissue whose thickness at `x` (m) from the pivot is `thickness(x)` (m).
    fn bite(toughness: f64, thickness: impl Fn(f64) -> f64) -> Bite {
        let n = count(BLADE_TIP);
        let mut bite = Bite::new(0, MAX_ANGLE, toughness, LEVER, vec![0.0; n]);
        let chord = |k| Chord { length: thickness(place(k)), between: thickness(place(k)) > 0.0 };
        bite.measure(&(0..n).map(chord).collect::<Vec<_>>(), MAX_ANGLE);
        bite
    }

    fn sheet(toughness: f64) -> Bite {
        bite(toughness, |x| if x > 4.5e-3 { 3e-3 } else { 0.0 })
    }

    #[test]
    fn the_torque_on_a_sheet_is_the_closed_form() {
        for toughness in [150.0, 300.0, 1000.0] {
            let mut bite = sheet(toughness);
            let mut angle = MAX_ANGLE;
            while angle > 0.16 {
                angle = bite.close(angle, angle - 0.02, 10.0);
                let half = 0.5 * (angle + 0.01);
                if half < 0.27 {
                    let closed = toughness * 9e-6 * half.cos() / (4.0 * half.sin().powi(2));
                    let off = bite.force * LEVER / closed - 1.0;
                    assert!(off.abs() < 0.11, "{toughness} J/m2 at {angle} rad: {off}");
                }
            }
            // The cut has come to where the edges are as far apart as the sheet is thick.
            let front = 3e-3 / (2.0 * (0.5 * angle).tan());
            let [from, to] = bite.part().unwrap();
            assert!((from - 4.5e-3).abs() < 1e-4 && to < front && to > (1.0 - SINK) * front, "{from} to {to}, {front}");
        }
    }

    #[test]
    fn the_work_is_toughness_times_area() {
        let tube = |x: f64| 2.0 * (4.5e-3_f64.powi(2) - (x - 0.012).powi(2)).max(0.0).sqrt();
        let mut bite = bite(300.0, tube);
        assert_eq!(bite.close(MAX_ANGLE, 0.0, 10.0), 0.0);
        let area = std::f64::consts::PI * 4.5e-3_f64.powi(2);
        assert!((bite.area() / area - 1.0).abs() < 1e-3 && bite.is_through());
        assert!((bite.work / (300.0 * area) - 1.0).abs() < 1e-3, "{} J", bite.work);
    }

    #[test]
    fn weak_scissors_stand_on_the_tissue() {
        // 0.23 N m at 20 N: enough for 300 J/m2. A newton is not.
        for (newtons, cuts) in [(20.0, true), (1.0, false)] {
            let mut bite = sheet(300.0);
            let mut angle = MAX_ANGLE;
            for _ in 0..30 {
                angle = bite.close(angle, (angle - 0.08_f64).max(0.13), newtons * LEVER);
            }
            assert_eq!(angle < 0.14, cuts, "{newtons} N: {angle} rad");
            assert!(cuts || (bite.force - newtons).abs() < 1e-9, "they press with all they have");
            assert!(bite.force_peak <= newtons + 1e-9);
            assert!((bite.work - 300.0 * bite.area()).abs() < 1e-9);
        }
    }

    #[test]
    fn tissue_that_fills_the_mouth_is_cut_where_the_edges_pass() {
        let mut bite = bite(300.0, |_| 0.03);
        bite.close(MAX_ANGLE, MAX_ANGLE - 0.02, 10.0);
        // J for each length of both edges: J (l^2 - b^2) / 2, and tan for sin.
        let torque = 150.0 * (BLADE_TIP.powi(2) - 0.002_f64.powi(2)) / (0.5 * MAX_ANGLE).cos().powi(2);
        assert!((bite.force * LEVER / torque - 1.0).abs() < 0.03, "{} N", bite.force);
    }

    #[test]
    fn what_is_open_already_takes_no_work() {
        let mut bite = sheet(300.0);
        bite.slit.fill(3e-3);
        let chords = vec![Chord { length: 3e-3, between: true }; bite.slit.len()];
        bite.measure(&chords, MAX_ANGLE);
        bite.close(MAX_ANGLE, 0.1, 1e-9);
        assert_eq!((bite.work, bite.force), (0.0, 0.0));
    }
}
