//! The organs of a specimen as a tissue model with its state and stepper.

use crate::mesh_correction::element_material;
use crate::{Error, Result};
use glam::DVec3;
use trocar_geometry::{OrganAxis, TetQuality, TriMesh};
use trocar_scene::TOUGHNESS;
use trocar_specimen::{End, MaterialModel, Organ, Pins, Specimen, Threads};
use trocar_tissue::{
    Backend, BodyContact, BodyDescription, Collider, ConstitutiveModel, Event, Load, Material, Model, ModelBuilder,
    SolverSettings, State, Stepper, Support, SupportField, Tether, ToolContact, ToolForce, ToolMotion, pins,
};

/// Length of a frame (s).
pub const FRAME: f64 = 1.0 / 60.0;

/// Standard gravity (m/s2).
pub(crate) const GRAVITY: f64 = 9.80665;

/// Friction between tissue and its support (paper section IV-C).
const SUPPORT_FRICTION: f64 = 0.6;

/// Shear viscosity of tissue over its Young's modulus (s). Sheared tissue creeps with three times
/// as long a time constant, 18 ms. The paper damps its elements but does not state the coefficient.
/// With this value the organs of all phantoms come to rest within a second, and the time constant
/// stays far below the second that a lift takes.
pub const VISCOSITY_TIME: f64 = 0.006;

/// Distance between the threads of an organ along it (m), or its median edge if that is longer.
const THREAD_SPACING: f64 = 2e-3;

/// Cell size of the supports over the organ's median edge: as fine as the nodes that lie on them.
const SUPPORT_CELL: f64 = 0.5;

/// The organs of a specimen as bodies under gravity, on their supports.
pub struct World {
    /// The constant part.
    pub model: Model,
    /// The part that changes.
    pub state: State,
    /// Axis and organ coordinates of each organ, in the specimen's order.
    pub axes: Vec<OrganAxis>,
    /// Energy that a cut takes for the area that it opens, of each body (J/m2).
    pub toughness: Vec<f64>,
    /// Unit vector against gravity.
    pub up: DVec3,
    pub(crate) stepper: Stepper,
    /// Number of cuts so far; each replaces the model.
    pub(crate) cuts: usize,
}

/// The surroundings of organs: their supports, and how they touch each other.
#[derive(Clone, Debug)]
pub struct Surroundings {
    /// The solver backend of the tissue.
    pub backend: Backend,
    /// How organs touch each other; None if they pass through each other.
    pub body_contact: Option<BodyContact>,
    /// The parts of organs that touch instruments.
    pub tool_contact: ToolContact,
    /// Pairs of organs without contact, by their indices in the specimen.
    pub filtered: Vec<[usize; 2]>,
    /// Friction of the bed that organs lie on, with their imprints; None for no bed.
    pub bed_friction: Option<f64>,
    /// Organs without a bed, by their indices.
    pub floating: Vec<usize>,
    /// Whether tetrahedra are made softer than their organ, to compensate for a mesh that is too
    /// stiff.
    pub mesh_correction: bool,
    /// Toughness of organs (J/m2), by their indices; [`TOUGHNESS`] of those that are left out.
    pub toughness: Vec<f64>,
    /// Collision surfaces of organs (m), by their indices; None, or left out: the boundary of the
    /// elements.
    pub collision: Vec<Option<TriMesh>>,
}

impl Default for Surroundings {
    /// Organs that touch each other, on a bed with their imprints.
    fn default() -> Self {
        Self {
            backend: Backend::default(),
            body_contact: Some(BodyContact::default()),
            tool_contact: ToolContact::default(),
            filtered: Vec::new(),
            bed_friction: Some(SUPPORT_FRICTION),
            floating: Vec::new(),
            mesh_correction: true,
            toughness: Vec::new(),
            collision: Vec::new(),
        }
    }
}

/// Everything of a [`World`] that changes, cuts included.
#[derive(Clone, Debug)]
pub(crate) struct WorldState {
    model: Model,
    state: State,
    axes: Vec<OrganAxis>,
    toughness: Vec<f64>,
    cuts: usize,
}

impl WorldState {
    /// Whether its organs have been cut.
    pub fn is_cut(&self) -> bool {
        self.cuts > 0
    }

    /// Hash over every bit of positions, velocities and grasps.
    pub fn hash(&self) -> u64 {
        self.state.hash()
    }
}

impl World {
    /// Builds the world: one body an organ, its pins, gravity against `specimen.up`, and the bed it
    /// lies on, with its imprint.
    ///
    /// # Errors
    /// A mesh, a material or pins of an organ that cannot be simulated.
    pub fn new(specimen: &Specimen, schedule: SolverSettings, threads: usize) -> Result<Self> {
        Self::surrounded(specimen, &Surroundings::default(), Vec::new(), schedule, threads)
    }

    /// The same with other `surroundings`, and tools with `colliders`, such as
    /// [`crate::blades::colliders`].
    ///
    /// # Errors
    /// As [`World::new`], invalid colliders, and filtered pairs of organs that do not exist.
    pub fn surrounded(
        specimen: &Specimen,
        surroundings: &Surroundings,
        colliders: Vec<Collider>,
        schedule: SolverSettings,
        threads: usize,
    ) -> Result<Self> {
        let up = specimen.up.normalize();
        let mut builder = ModelBuilder::new()
            .gravity(-GRAVITY * up)
            .tool_contact(surroundings.tool_contact)
            .backend(surroundings.backend);
        if let Some(contact) = surroundings.body_contact {
            builder = builder.body_contact(contact);
        }
        let mut axes = Vec::with_capacity(specimen.organs.len());
        for (k, organ) in specimen.organs.iter().enumerate() {
            let bed = surroundings.bed_friction.filter(|_| !surroundings.floating.contains(&k));
            let axis = OrganAxis::of(&organ.body, organ.base)?;
            builder.body(BodyDescription {
                name: organ.name.clone(),
                mesh: &organ.body,
                material: if surroundings.mesh_correction && surroundings.backend == Backend::Tetrahedra {
                    element_material(tissue_of(organ), &organ.body)
                } else {
                    tissue_of(organ)
                },
                pinned: pinned_nodes(organ, &axis, up),
                supports: bed.map(|friction| support_under(organ, up, friction)).transpose()?.into_iter().collect(),
            })?;
            builder.tethers(k, &tethers_of(organ, &axis, up))?;
            if let Some(Some(surface)) = surroundings.collision.get(k) {
                builder.collision_surface(k, surface)?;
            }
            axes.push(axis);
        }
        for [a, b] in &surroundings.filtered {
            builder.filter_pair(*a, *b)?;
        }
        for collider in colliders {
            builder.collider(collider)?;
        }
        let model = builder.build()?;
        let state = State::new(&model);
        let stepper = Stepper::new(&model, schedule, FRAME, threads)?;
        let mut toughness = surroundings.toughness.clone();
        toughness.resize(axes.len(), TOUGHNESS);
        Ok(Self { model, state, axes, toughness, up, stepper, cuts: 0 })
    }

    /// A world of its own in the same state. Bodies are shared, so that it costs little beside
    /// building and settling another. Forces and events of the last frame are not copied.
    ///
    /// # Errors
    /// Threads that the system refuses.
    pub fn try_clone(&self) -> Result<Self> {
        let Self { model, state, axes, toughness, up, stepper, cuts } = self;
        Ok(Self {
            model: model.clone(),
            state: state.clone(),
            axes: axes.clone(),
            toughness: toughness.clone(),
            up: *up,
            stepper: stepper.another(model)?,
            cuts: *cuts,
        })
    }

    /// Forces of tissue on each tool in the last frame, in the order of the given motions. The list
    /// is shorter if the last tools touch nothing.
    pub fn forces(&self) -> &[ToolForce] {
        self.stepper.forces()
    }

    /// Force of the tissue of one organ on a tool in the last frame.
    pub(crate) fn force_of(&self, organ: usize, tool: usize) -> ToolForce {
        self.stepper.force_of(organ, tool)
    }

    /// Whether a `tool` is in a hole of an organ.
    pub(crate) fn is_punctured(&self, organ: usize, tool: usize) -> bool {
        self.state.holes.iter().any(|hole| hole.body == organ && hole.tools.contains(&tool))
    }

    /// Events of grasps in the last frame.
    pub fn events(&self) -> &[Event] {
        self.stepper.events()
    }

    /// A copy of everything that changes.
    pub(crate) fn save(&self) -> WorldState {
        // The upward direction never changes, and the stepper follows the model.
        let Self { model, state, axes, toughness, up: _, stepper: _, cuts } = self;
        WorldState {
            model: model.clone(),
            state: state.clone(),
            axes: axes.clone(),
            toughness: toughness.clone(),
            cuts: *cuts,
        }
    }

    /// Restores what [`World::save`] returned. The steps after it are the same to the bit.
    pub(crate) fn restore(&mut self, saved: &WorldState) -> Result<()> {
        let sizes = |model: &Model| model.bodies().iter().map(|b| b.len()).collect::<Vec<_>>();
        if self.cuts == 0 && saved.cuts == 0 && sizes(&self.model) != sizes(&saved.model) {
            return Err(Error::Option("the state is of another specimen: its organs have other nodes".to_owned()));
        }
        if self.cuts > 0 || saved.cuts > 0 {
            self.stepper.set_model(&saved.model)?;
        }
        self.model = saved.model.clone();
        self.state = saved.state.clone();
        self.axes.clone_from(&saved.axes);
        self.toughness.clone_from(&saved.toughness);
        self.cuts = saved.cuts;
        Ok(())
    }

    /// Largest distance that any node has moved since `then`, a state of the same model (m).
    pub(crate) fn largest_motion_since(&self, then: &State) -> f64 {
        let bodies = self.model.bodies().iter().enumerate();
        let nodes = bodies.flat_map(|(k, body)| (0..body.len()).map(move |i| (k, i)));
        let way = |(k, i)| self.state.position(&self.model, k, i).distance(then.position(&self.model, k, i));
        nodes.map(way).fold(0.0, f64::max)
    }

    /// Advances by one [`FRAME`]; `tools` are the motions of the tools that carry grasps and
    /// colliders.
    pub fn step(&mut self, tools: &[ToolMotion]) -> trocar_tissue::StepReport {
        self.step_under(tools, &[])
    }

    /// The same under `loads` on nodes.
    pub fn step_under(&mut self, tools: &[ToolMotion], loads: &[Load]) -> trocar_tissue::StepReport {
        self.stepper.step_with_loads(&self.model, &mut self.state, tools, loads)
    }

    /// Forces of tools and other organs on nodes at the end of the last frame.
    pub fn contact_loads(&self) -> Vec<Load> {
        self.stepper.contact_loads(&self.model, &self.state)
    }
}

/// The bed on which the organ was recorded, with its imprint.
fn support_under(organ: &Organ, up: DVec3, friction: f64) -> Result<Support> {
    let cell = SUPPORT_CELL * TetQuality::of(&organ.body).median_edge;
    Ok(SupportField::under(&organ.body, up, cell, friction)?.into())
}

/// The threads that hold an organ: from the lowest nodes along it to where these were recorded. The
/// nodes do not depend on which part is held: so the threads' force changes evenly with it.
fn tethers_of(organ: &Organ, axis: &OrganAxis, up: DVec3) -> Vec<Tether> {
    let Some(Threads { from, to, slack_m, stiffness_n_m2 }) = organ.threads else { return Vec::new() };
    let nodes = &organ.body.vertices;
    let spacing = THREAD_SPACING.max(TetQuality::of(&organ.body).median_edge) / axis.length;
    // Only free nodes of the surface have a place.
    let mut s = vec![f64::NAN; nodes.len()];
    organ.body.boundary().1.iter().for_each(|i| s[*i as usize] = axis.s[*i as usize]);
    pinned_nodes(organ, axis, up).iter().for_each(|i| s[*i as usize] = f64::NAN);
    let lowest = pins::lowest_along(nodes, &s, up, [0.0, 1.0], spacing);
    let mut places: Vec<(f64, u32)> = lowest.into_iter().map(|(node, _)| (s[node as usize], node)).collect();
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    // A node may be the lowest of two slices.
    places.dedup_by(|a, b| a.0 == b.0);
    let along: Vec<f64> = places.iter().map(|p| p.0).collect();
    let borne = pins::borne(&along, [from, to], 0.5 * spacing);
    let held = places.into_iter().zip(borne).filter(|(_, borne)| *borne > 0.0);
    let thread = |((_, node), borne): ((f64, u32), f64)| Tether {
        node,
        anchor: nodes[node as usize],
        length: slack_m,
        stiffness: stiffness_n_m2 * borne * axis.length,
    };
    held.map(thread).collect()
}

/// The tissue of an organ.
pub fn tissue_of(organ: &Organ) -> Material {
    let m = organ.material;
    Material {
        model: match m.model {
            MaterialModel::StableNeoHookean => ConstitutiveModel::StableNeoHookean,
            MaterialModel::StVenantKirchhoff => ConstitutiveModel::StVenantKirchhoff,
            MaterialModel::Corotated => ConstitutiveModel::Corotated,
        },
        young_modulus: m.young_modulus_pa,
        poisson_ratio: m.poisson_ratio,
        density: m.density_kg_m3,
        viscosity: VISCOSITY_TIME * m.young_modulus_pa,
    }
}

fn pinned_nodes(organ: &Organ, axis: &OrganAxis, up: DVec3) -> Vec<u32> {
    let nodes = &organ.body.vertices;
    match organ.pins {
        Pins::None => Vec::new(),
        Pins::Band { share } => pins::lowest_band(nodes, up, share),
        Pins::End { end, length, band_length, band_share } => {
            pins::end(nodes, &axis.s, up, end == End::Base, length, band_length, band_share)
        }
    }
}
