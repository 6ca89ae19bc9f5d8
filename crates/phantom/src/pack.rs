//! Packs organs on the bed: each is slid against those before it until it touches.

use crate::bed::Bed;
use crate::blend::{Blend, Part, Recipe};
use crate::body::{Body, gap};
use crate::noise;
use crate::plan::{Look, Organ, PinRule};
use crate::tube::{Shape, Tube};
use glam::DVec3;

/// Distance at which two organs touch [m].
pub(crate) const TOUCH: f64 = 0.2e-3;
/// How far above the bed an organ's centreline runs, relative to its height: the rest sinks in.
const LIFT: f64 = 0.45;

/// A shape, where it comes from, and the way it slides until it touches what is there.
pub(crate) struct Item {
    pub name: &'static str,
    pub young_modulus: f64,
    pub pins: PinRule,
    pub look: Look,
    pub form: Form,
    /// Where the base should be [mm] if nothing were in the way.
    pub base: (f64, f64),
    pub heading_deg: f64,
    pub slide_deg: f64,
}

/// What kind of shape.
#[derive(Clone, Copy)]
pub(crate) enum Form {
    Tube(Shape),
    Coil(Coil),
}

/// A bowel folded into a mass: runs side by side and one across them. Its base is the middle of its first run's end.
#[derive(Clone, Copy)]
pub(crate) struct Coil {
    /// Number of runs in the lower layer.
    pub runs: usize,
    /// Length of the longest run [m]; those at the sides are shorter.
    pub width: f64,
    pub radius: f64,
    /// Distance between runs [m].
    pub pitch: f64,
}

/// A tube's shape from millimetres.
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

/// Lays `items`, varied by the seed, in their order.
pub(crate) fn pack(items: impl IntoIterator<Item = Item>, seed: u64, bed: &Bed) -> Vec<Organ> {
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
        let Item { name, young_modulus, pins, look, .. } = item;
        organs.push(Organ { name, body, young_modulus, pins, look, seed });
    }
    organs
}

/// Starts far off and moves by as much as the gap allows until it closes.
fn slide(item: &Item, seed: u64, bed: &Bed, organs: &[Organ]) -> Body {
    const START: f64 = 0.12;
    const STEPS: usize = 200;
    let (sin, cos) = item.slide_deg.to_radians().sin_cos();
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
        if gap < 1.5 * TOUCH || along > START {
            break;
        }
        // Less than the gap: the distance is only an estimate.
        along += (0.7 * (gap - TOUCH)).max(0.02e-3);
    }
    at(along)
}

impl Coil {
    /// Lays the mass down; runs are along `heading` [rad] through `base`, the first on one side, the last on the other.
    fn lay(&self, seed: u64, base: (f64, f64), heading: f64, bed: &Bed) -> Blend {
        const POINTS: usize = 25;
        let Self { runs, width, radius, pitch } = *self;
        let (sin, cos) = heading.sin_cos();
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
        let middle = 0.5 * (runs as f64 - 1.0);
        for run in 0..runs {
            let row = run as f64 - middle;
            let half = 0.5 * width * (1.0 - 0.24 * (row / middle.max(1.0)).powi(2) + 0.07 * vary(run as u64));
            let shift = 0.06 * width * vary(10 + run as u64);
            // To and fro, so that the loops follow each other; each end turns towards the neighbour it goes over into.
            let forward = if run % 2 == 0 { 1.0 } else { -1.0 };
            let line = (0..POINTS)
                .map(|i| {
                    let t = 2.0 * i as f64 / (POINTS - 1) as f64 - 1.0;
                    let bow = 0.10 * pitch * vary(30 + run as u64) * (1.0 - t * t);
                    let after = 0.45 * pitch * ((t - 0.62).max(0.0) / 0.38).powi(2);
                    let before = 0.45 * pitch * ((-t - 0.62).max(0.0) / 0.38).powi(2);
                    let turn = if run + 1 < runs { after } else { 0.0 } - if run > 0 { before } else { 0.0 };
                    let wave = 0.10 * (3.0 * t + vary(40 + run as u64)).sin();
                    place(forward * t * half + shift, row * pitch + bow + turn, wave)
                })
                .collect();
            parts.push(strand(line, run as u64));
        }
        // A loop that has slipped on top of the others.
        let line = (0..2 * POINTS)
            .map(|i| {
                let t = 2.0 * i as f64 / (2 * POINTS - 1) as f64 - 1.0;
                let (x, y) = (0.30 * width * (2.6 * t).sin(), 0.36 * pitch * runs as f64 * t);
                place(x, y, 1.15 + 0.1 * (1.0 - t * t))
            })
            .collect();
        parts.push(strand(line, runs as u64));
        let ends = match (parts.first(), parts.last()) {
            (Some(Part::Strand { line: first, .. }), Some(Part::Strand { line: last, .. })) => {
                [first[2], last[2 * POINTS - 1]]
            }
            _ => [DVec3::ZERO; 2],
        };
        Blend::new(Recipe {
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
