//! Packs organs on the bed: each organ slides until it touches those placed before.

use crate::bed::Bed;
use crate::blend::{Blend, BlendSpec, Part};
use crate::body::{Body, gap};
use crate::noise;
use crate::spec::{Organ, PinRule, TissueAppearance};
use crate::tube::{Shape, Tube};
use glam::DVec3;

/// Gap at which two organs count as touching (m).
const TOUCHING_GAP: f64 = 0.2e-3;
/// Height of an organ's centreline above the bed, relative to the organ's height. The rest sinks
/// in.
const LIFT: f64 = 0.45;

/// An organ to place: its shape, its start and the direction in which it slides.
pub(crate) struct OrganPlacement {
    pub name: &'static str,
    pub young_modulus: f64,
    pub pins: PinRule,
    pub look: TissueAppearance,
    pub form: Form,
    /// Position of the base without obstacles (mm).
    pub base: (f64, f64),
    pub heading_deg: f64,
    pub slide_deg: f64,
}

/// Shape of an organ.
#[derive(Clone, Copy)]
pub(crate) enum Form {
    Tube(Shape),
    Coil(Coil),
}

/// A bowel folded into a mass: two layers of parallel runs and a loop across them. It starts at the
/// end of its first run.
#[derive(Clone, Copy)]
pub(crate) struct Coil {
    /// Number of runs in the lower layer, at least two. The upper layer has one less.
    pub runs: usize,
    /// Length of the central run of the lower layer (m). Other runs are shorter.
    pub width: f64,
    pub radius: f64,
    /// Distance between runs (m).
    pub pitch: f64,
}

/// A tube's shape from lengths in millimetres.
pub(crate) fn shape(
    length: f64,
    across: f64,
    high: f64,
    taper: f64,
    bulge: f64,
    folds: (f64, f64),
    bends: [f64; 2],
) -> Shape {
    Shape {
        length: length * 1e-3,
        across: across * 1e-3,
        high: high * 1e-3,
        taper,
        bulge,
        folds: (folds.0, folds.1 * 1e-3),
        bends,
    }
}

/// Places `items` in their order, with random variations.
pub(crate) fn pack(items: impl IntoIterator<Item = OrganPlacement>, seed: u64, bed: &Bed) -> Vec<Organ> {
    let mut organs: Vec<Organ> = Vec::new();
    for (index, mut item) in items.into_iter().enumerate() {
        let seed = noise::key(&[seed, 2, index as u64]);
        let vary = |k: u64, by: f64| by * (2.0 * noise::unit(noise::key(&[seed, k])) - 1.0);
        if let Form::Tube(shape) = &mut item.form {
            shape.bends[0] += vary(0, 0.12);
            shape.bends[1] += vary(1, 0.12);
        }
        item.heading_deg += vary(2, 4.0);
        let body = slide(&item, seed, bed, &organs);
        let OrganPlacement { name, young_modulus, pins, look, .. } = item;
        organs.push(Organ { name, body, young_modulus, pins, look, seed });
    }
    organs
}

/// Starts far away and advances by the gap until it closes.
fn slide(item: &OrganPlacement, seed: u64, bed: &Bed, organs: &[Organ]) -> Body {
    const START: f64 = 0.12;
    const STEPS: usize = 200;
    let (sin, cos) = libm::sincos(item.slide_deg.to_radians());
    let at = |along: f64| {
        let base = (item.base.0 * 1e-3 + along * cos, item.base.1 * 1e-3 + along * sin);
        let heading = item.heading_deg.to_radians();
        match item.form {
            Form::Tube(shape) => {
                let lift = LIFT * shape.high;
                Body::Tube(Tube::lay(shape, seed, base, heading, |x, y| bed.smooth_height(x, y) - lift))
            }
            Form::Coil(coil) => Body::Blend(coil.lay(seed, base, heading, bed)),
        }
    };
    if organs.is_empty() {
        return at(0.0);
    }
    let mut along = -START;
    for _ in 0..STEPS {
        let gap = gap(&at(along), organs.iter().map(|o| &o.body));
        if gap < 1.5 * TOUCHING_GAP || along > START {
            break;
        }
        // Advance less than the gap, because the distance is an estimate.
        along += (0.7 * (gap - TOUCHING_GAP)).max(0.02e-3);
    }
    at(along)
}

impl Coil {
    /// Places the mass. Runs are parallel to `heading` (rad), from one side of `base` to the other.
    fn lay(&self, seed: u64, base: (f64, f64), heading: f64, bed: &Bed) -> Blend {
        const POINTS: usize = 25;
        let Self { runs, width, radius, pitch } = *self;
        let (sin, cos) = libm::sincos(heading);
        let vary = |k: u64| 2.0 * noise::unit(noise::key(&[seed, 50 + k])) - 1.0;
        let place = |x: f64, y: f64, level: f64| {
            let (x, y) = (base.0 + x * cos - y * sin, base.1 + x * sin + y * cos);
            DVec3::new(x, y, bed.smooth_height(x, y) - (LIFT + level) * radius)
        };
        let mut parts = Vec::new();
        let strand = |line: Vec<DVec3>, k: u64| Part::Strand {
            line,
            radius: radius * (1.0 + 0.06 * vary(20 + k)),
            folds: (0.10, 0.0095),
            seed: noise::key(&[seed, 70 + k]),
        };
        // Two layers, the upper in the grooves of the lower.
        let layers = (0..runs).map(|row| (row, runs, 0.0)).chain((0..runs - 1).map(|row| (row, runs - 1, 1.45)));
        for (k, (row, rows, level)) in layers.enumerate() {
            let k = k as u64;
            let middle = 0.5 * (rows as f64 - 1.0);
            let y = (row as f64 - middle) * pitch;
            let outward = 2.0 * y / (pitch * runs as f64);
            let half = 0.5 * (width - level * radius) * (1.0 - 0.35 * outward * outward + 0.07 * vary(k));
            let shift = 0.05 * width * vary(10 + k);
            // Alternating directions connect the loops. Each end turns towards the next run.
            let forward = if row % 2 == 0 { 1.0 } else { -1.0 };
            let line = (0..POINTS)
                .map(|i| {
                    let t = 2.0 * i as f64 / (POINTS - 1) as f64 - 1.0;
                    let bow = 0.10 * pitch * vary(30 + k) * (1.0 - t * t);
                    let turning = |t: f64| 0.45 * pitch * ((t - 0.62).max(0.0) / 0.38).powi(2);
                    let after = if row + 1 < rows { turning(t) } else { 0.0 };
                    let before = if row > 0 { turning(-t) } else { 0.0 };
                    let wave = 0.10 * libm::sin(3.0 * t + vary(40 + k));
                    place(forward * t * half + shift, y + bow + after - before, level + wave)
                })
                .collect();
            parts.push(strand(line, k));
        }
        // A loop on top of the others.
        let line = (0..2 * POINTS)
            .map(|i| {
                let t = 2.0 * i as f64 / (2 * POINTS - 1) as f64 - 1.0;
                let (x, y) = (0.26 * width * libm::sin(2.4 * t), 0.22 * pitch * runs as f64 * t);
                place(x, y, 2.55 - 0.5 * t * t)
            })
            .collect();
        parts.push(strand(line, 20));
        let ends = match (parts.first(), parts.last()) {
            (Some(Part::Strand { line: first, .. }), Some(Part::Strand { line: last, .. })) => {
                [first[2], last[2 * POINTS - 1]]
            }
            _ => [DVec3::ZERO; 2],
        };
        Blend::new(BlendSpec {
            parts,
            blend: 0.4 * radius,
            bumps: [(0.2e-3, 5e-3), (0.0, 1.0)],
            seed: noise::key(&[seed, 90]),
            ends,
            groove: None,
            sampling: 1.5e-3,
        })
    }
}
