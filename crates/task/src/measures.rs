//! A task's own measures besides the channels: distances, displacements, and which tissue is held.

use crate::bodies::{MID_JAWS, between_blades, bodies_of, nearest};
use crate::channels::flag;
use crate::visible::{Surface, View};
use crate::{Channels, Result};
use glam::DVec3;
use std::sync::Arc;
use trocar_camera::Camera;
use trocar_cell::Cell;
use trocar_scene::{MAX_MEASURES, Measure, Part, Place, Scene, Side, Target};

/// The measures of a task, and the start positions of everything whose motion they measure (m,
/// cell).
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Measures {
    list: Vec<Measure>,
    origins: Vec<DVec3>,
    /// The views for the parts of [`Measure::Visible`], in their order.
    views: Vec<View>,
}

impl Measures {
    /// At the start of an episode in `cell`, with the cameras of `scene`; `recording` is the
    /// specimen's camera.
    pub fn begin(cell: &Cell, scene: &Scene, recording: Option<&Camera>, list: &[Measure]) -> Result<Self> {
        let origin = |measure: &Measure| match measure {
            Measure::Moved(what) | Measure::Aside(what) | Measure::Risen(what) => place(cell, what),
            Measure::Distance(..) | Measure::Held(..) | Measure::InMouth(..) | Measure::Visible(..) => Ok(DVec3::ZERO),
        };
        let sees = list.iter().any(|measure| matches!(measure, Measure::Visible(..)));
        let surfaces = if sees { Surface::all(cell) } else { Arc::default() };
        let views = list.iter().filter_map(|measure| match measure {
            Measure::Visible(camera, part) => Some(View::new(scene, camera, recording, part, &surfaces)),
            _ => None,
        });
        Ok(Self {
            list: list.to_vec(),
            origins: list.iter().map(origin).collect::<Result<_>>()?,
            views: views.collect::<Result<_>>()?,
        })
    }

    /// Fills the measures of `row`.
    pub fn measure(&self, cell: &Cell, row: &mut Channels) -> Result<()> {
        let mut all = [0.0; MAX_MEASURES];
        let mut views = self.views.iter();
        for ((value, measure), origin) in all.iter_mut().zip(&self.list).zip(&self.origins) {
            *value = match measure {
                Measure::Visible(..) => views.next().map_or(Ok(0.0), |view| view.share(cell))?,
                other => one(cell, other, *origin)?,
            };
        }
        row.measures = all;
        Ok(())
    }
}

fn one(cell: &Cell, measure: &Measure, origin: DVec3) -> Result<f64> {
    let up = cell.world().up;
    let arm = |side: Side| cell.arms().iter().position(|(own, _)| *own == side);
    Ok(match measure {
        Measure::Distance(from, Target::Place(to)) => 1e3 * point(cell, *from)?.distance(point(cell, *to)?),
        Measure::Distance(from, Target::Part(part)) => {
            let from = point(cell, *from)?;
            let distance = |body: usize| {
                let s = &cell.world().axes[body].s;
                nearest(cell, body, from, |i| (part.range[0]..=part.range[1]).contains(&s[i]))
            };
            let least = bodies_of(cell, &part.organ).into_iter().map(distance).fold(f64::INFINITY, f64::min);
            // As for the distances that are channels: files have no infinity.
            if least.is_finite() { 1e3 * least } else { 1e3 }
        }
        Measure::Held(side, organ) => {
            let held = arm(*side).and_then(|k| cell.carried(k));
            held.filter(|c| bodies_of(cell, organ).contains(&c.organ)).map_or(-1.0, |c| c.s)
        }
        Measure::InMouth(side, organ) => {
            flag(arm(*side).is_some_and(|k| between_blades(cell, k, &bodies_of(cell, organ)).0))
        }
        Measure::Moved(what) => 1e3 * place(cell, what)?.distance(origin),
        Measure::Aside(what) => {
            let by = place(cell, what)? - origin;
            1e3 * (by - by.dot(up) * up).length()
        }
        Measure::Risen(what) => 1e3 * (place(cell, what)? - origin).dot(up),
        // See `Measures::measure`.
        Measure::Visible(..) => 0.0,
    })
}

/// A point of an instrument (m, cell).
fn point(cell: &Cell, place: Place) -> Result<DVec3> {
    Ok(match place {
        Place::Tip(side) => cell.blade_tip(side.name())?,
        Place::Jaws(side) => cell.measured_cp(side.name())?.transform(MID_JAWS * DVec3::X),
    })
}

/// A point of an instrument, or the centroid of a part of an organ (m, cell).
fn place(cell: &Cell, target: &Target) -> Result<DVec3> {
    match target {
        Target::Place(place) => point(cell, *place),
        Target::Part(part) => Ok(centroid(cell, part)),
    }
}

/// The centroid of a part of an organ (m, cell); of the whole organ where no node lies in the part.
fn centroid(cell: &Cell, part: &Part) -> DVec3 {
    let world = cell.world();
    let (mut sum, mut count, mut whole, mut nodes) = (DVec3::ZERO, 0_usize, DVec3::ZERO, 0_usize);
    for body in bodies_of(cell, &part.organ) {
        for (i, s) in world.axes[body].s.iter().enumerate() {
            let p = world.state.position(&world.model, body, i);
            (whole, nodes) = (whole + p, nodes + 1);
            if (part.range[0]..=part.range[1]).contains(s) {
                (sum, count) = (sum + p, count + 1);
            }
        }
    }
    if count > 0 { sum / count as f64 } else { whole / nodes.max(1) as f64 }
}
