//! The minimised function: energy, gradient and Hessian over all nodes of a body, or of several
//! that may touch.

use super::contact::Contacts;
use super::element::{deformation, projected};
use super::rub::{self, outer};
use super::state::Nodes;
use super::tether;
use glam::{DMat3, DVec3};
use std::ops::Range;
use trocar_tissue::assembly::{Stiffness, blocks, shape_gradients, tangent};
use trocar_tissue::{Body, Hyperelastic, Support, SupportContact, Tether};

/// Constants of the energies of a body, nodes in their original order; or of several bodies, one
/// after the other.
pub(super) struct Elastic {
    /// (m)
    pub rest: Vec<DVec3>,
    pub tets: Vec<[u32; 4]>,
    /// Rest gradients of the shape functions (1/m).
    pub gradients: Vec<[DVec3; 4]>,
    /// Rest volumes (m3).
    pub volumes: Vec<f64>,
    /// The material of each body's elements, and the end of these.
    materials: Vec<(usize, Box<dyn Hyperelastic>)>,
    /// (kg)
    pub masses: Vec<f64>,
    /// Edges with a dashpot: nodes and coefficient (N s/m).
    dashpots: Vec<([usize; 2], f64)>,
    supports: Vec<Supported>,
    /// (N/m)
    pub contact_stiffness: Vec<f64>,
    /// An energy that is large beside every change that matters (J): energies are known to its
    /// rounding.
    pub scale: f64,
}

/// A support, and the nodes of the body that lies on it.
struct Supported {
    support: Support,
    nodes: Range<usize>,
    /// Number of the first node among all nodes at all supports.
    first: usize,
}

impl Elastic {
    /// Of one body.
    pub fn new(body: &Body) -> Self {
        Self::of(std::slice::from_ref(body))
    }

    /// Of some bodies.
    pub fn of(bodies: &[Body]) -> Self {
        let mut all = Self {
            rest: Vec::new(),
            tets: Vec::new(),
            gradients: Vec::new(),
            volumes: Vec::new(),
            materials: Vec::new(),
            masses: Vec::new(),
            dashpots: Vec::new(),
            supports: Vec::new(),
            contact_stiffness: Vec::new(),
            scale: 0.0,
        };
        let mut supported = 0;
        for body in bodies {
            let (mu, lambda) = body.material().lame();
            let (mesh, first) = (body.rest(), all.rest.len());
            all.rest.extend_from_slice(&mesh.vertices);
            all.tets.extend(mesh.tets.iter().map(|tet| tet.map(|i| i + first as u32)));
            all.gradients.extend((0..mesh.tets.len()).map(|t| shape_gradients(mesh, t)));
            all.volumes.extend_from_slice(body.volumes());
            all.materials.push((all.tets.len(), body.material().hyperelastic()));
            all.masses.extend((0..body.len()).map(|i| body.mass(i)));
            let dashpots = body.dashpots().into_iter();
            all.dashpots.extend(dashpots.map(|(nodes, damping)| (nodes.map(|i| first + i as usize), damping)));
            for support in body.supports() {
                let nodes = first..first + body.len();
                all.supports.push(Supported { support: support.clone(), nodes, first: supported });
                supported += body.len();
            }
            all.contact_stiffness.extend((0..body.len()).map(|i| body.contact_stiffness(i)));
            all.scale += (mu + lambda) * body.volumes().iter().sum::<f64>();
        }
        all
    }

    /// The material of an element.
    pub fn psi(&self, t: usize) -> &dyn Hyperelastic {
        let body = self.materials.partition_point(|(end, _)| *end <= t);
        self.materials[body].1.as_ref()
    }

    /// Deformation gradient of an element.
    pub fn deformation(&self, t: usize, x: &[DVec3]) -> DMat3 {
        deformation(self.tets[t].map(|i| x[i as usize]), &self.gradients[t])
    }
}

/// Elastic energy of a body with its nodes at `x` (J).
pub fn elastic_energy(body: &Body, x: &[DVec3]) -> f64 {
    let elastic = Elastic::new(body);
    (0..elastic.tets.len()).map(|t| elastic.volumes[t] * elastic.psi(t).energy(elastic.deformation(t, x))).sum()
}

/// The part of a step in time that is added to the elastic energy.
pub(super) struct Motion {
    dt: f64,
    /// Positions at the beginning (m).
    pub start: Vec<DVec3>,
    /// Inertial predictor y (m).
    predictor: Vec<DVec3>,
    /// Squared lengths of the dashpots at the beginning (m2).
    lengths: Vec<f64>,
    /// Where friction holds each node at each support, support by support (m).
    places: Vec<DVec3>,
}

impl Motion {
    pub fn new(elastic: &Elastic, nodes: &Nodes, gravity: DVec3, dt: f64) -> Self {
        let start = nodes.x.clone();
        let predictor = start.iter().zip(&nodes.v).map(|(x, v)| x + dt * v + dt * dt * gravity).collect();
        let length = |([i, j], _): &([usize; 2], f64)| (start[*j] - start[*i]).length_squared();
        let here = elastic.supports.iter().flat_map(|at| &start[at.nodes.clone()]);
        let place = |(k, x): (usize, &DVec3)| nodes.anchors.get(k).copied().flatten().unwrap_or(*x);
        let places = here.enumerate().map(place).collect();
        Self { dt, lengths: elastic.dashpots.iter().map(length).collect(), predictor, places, start }
    }

    /// Applies a force (N) to a node throughout the step.
    pub fn push(&mut self, elastic: &Elastic, node: usize, force: DVec3) {
        self.predictor[node] += self.dt * self.dt / elastic.masses[node] * force;
    }

    pub fn dt(&self) -> f64 {
        self.dt
    }
}

/// The incremental potential of a body, or of several that may touch.
pub(super) struct Potential<'a> {
    pub elastic: &'a Elastic,
    /// None: statics.
    pub motion: Option<Motion>,
    pub gravity: DVec3,
    /// Greatest friction of each node at each support (N), support by support; empty: none.
    pub limits: Vec<f64>,
    /// Contacts with tools and between bodies; None: they pass through each other.
    pub contacts: Option<Contacts<'a>>,
    /// Threads to fixed points; their nodes are counted among all nodes.
    pub tethers: &'a [Tether],
}

impl Potential<'_> {
    /// Energy at x (J); not finite where an element has no volume. Writes the gradient (N) over all
    /// nodes.
    pub fn gradient(&self, x: &[DVec3], out: &mut [DVec3]) -> f64 {
        let e = self.elastic;
        out.fill(DVec3::ZERO);
        let mut energy = 0.0;
        for (t, tet) in e.tets.iter().enumerate() {
            let f = e.deformation(t, x);
            let ratio = f.determinant();
            if ratio.is_nan() || ratio <= 0.0 {
                return f64::INFINITY;
            }
            energy += e.volumes[t] * e.psi(t).energy(f);
            let stress = e.psi(t).stress(f) * e.volumes[t];
            for (i, m) in tet.iter().zip(&e.gradients[t]) {
                out[*i as usize] += stress * *m;
            }
        }
        match &self.motion {
            Some(motion) => {
                let k = 1.0 / (motion.dt * motion.dt);
                for (i, mass) in e.masses.iter().enumerate() {
                    let off = x[i] - motion.predictor[i];
                    energy += 0.5 * mass * k * off.length_squared();
                    out[i] += mass * k * off;
                }
                for (([i, j], damping), before) in e.dashpots.iter().zip(&motion.lengths) {
                    let (k, d) = (damping / (motion.dt * before), x[*j] - x[*i]);
                    let change = 0.5 * (d.length_squared() - before);
                    energy += 0.5 * k * change * change;
                    out[*i] -= k * change * d;
                    out[*j] += k * change * d;
                }
            }
            None => {
                for (i, mass) in e.masses.iter().enumerate() {
                    energy -= mass * self.gravity.dot(x[i]);
                    out[i] -= *mass * self.gravity;
                }
            }
        }
        self.for_supports(x, |i, contact| {
            energy += contact.energy;
            out[i] += contact.gradient;
        });
        for tether in self.tethers {
            let (stored, pull) = tether::energy(tether, x[tether.node as usize]);
            energy += stored;
            out[tether.node as usize] += pull;
        }
        if let Some(contacts) = &self.contacts {
            energy += contacts.gradient(x, |i, gradient| out[i] += gradient);
        }
        energy
    }

    /// Writes the Hessian at x (N/m) into `into`; elements' tangents made positive semidefinite if
    /// `project`, friction's curvature replaced by its secant if `secant`. Returns false if the
    /// projection is impossible.
    pub fn hessian(&self, x: &[DVec3], project: bool, secant: bool, into: &mut Stiffness) -> bool {
        let e = self.elastic;
        into.clear();
        for (t, tet) in e.tets.iter().enumerate() {
            let mut tangent = tangent(e.psi(t), e.deformation(t, x));
            if project {
                match projected(&tangent) {
                    Some(positive) => tangent = positive,
                    None => return false,
                }
            }
            let blocks = blocks(&tangent, &e.gradients[t]);
            for a in 0..4 {
                for b in 0..4 {
                    into.add(tet[a] as usize, tet[b] as usize, blocks[a][b] * e.volumes[t]);
                }
            }
        }
        if let Some(motion) = &self.motion {
            for (i, mass) in e.masses.iter().enumerate() {
                into.add(i, i, DMat3::from_diagonal(DVec3::splat(mass / (motion.dt * motion.dt))));
            }
            for (([i, j], damping), before) in e.dashpots.iter().zip(&motion.lengths) {
                let (k, d) = (damping / (motion.dt * before), x[*j] - x[*i]);
                let change = 0.5 * (d.length_squared() - before);
                // The geometric stiffness of a shortened dashpot is negative.
                let geometric = if project { change.max(0.0) } else { change };
                let block = (outer(d) + DMat3::from_diagonal(DVec3::splat(geometric))) * k;
                into.add(*i, *i, block);
                into.add(*j, *j, block);
                into.add(*i, *j, -block);
                into.add(*j, *i, -block);
            }
        }
        self.for_supports(x, |i, contact| {
            // A field's curvature may make the Hessian indefinite.
            let curvature = if secant || project { DMat3::ZERO } else { contact.curvature };
            into.add(i, i, curvature + if secant { contact.secant } else { contact.hessian });
        });
        for tether in self.tethers {
            let i = tether.node as usize;
            into.add(i, i, tether::hessian(tether, x[i]));
        }
        if let Some(contacts) = &self.contacts {
            contacts.hessian(x, project, secant, into);
        }
        true
    }

    /// Friction's limits at x: coefficient times the supports' forces.
    pub fn friction_limits(&self, x: &[DVec3]) -> Vec<f64> {
        let e = self.elastic;
        let limit = |support: &Support, i: usize| {
            let touch = support.contact(x[i]);
            support.friction() * e.contact_stiffness[i] * -touch.height.min(0.0) * touch.gradient.length()
        };
        e.supports.iter().flat_map(|at| at.nodes.clone().map(move |i| limit(&at.support, i))).collect()
    }

    /// Whether supports rub.
    pub fn rubs(&self) -> bool {
        self.motion.is_some() && self.elastic.supports.iter().any(|at| at.support.friction() > 0.0)
    }

    /// Where friction holds each node at each support after a step that ended at x: a node that
    /// pulled harder than the true limit was dragged along.
    pub fn anchors(&self, x: &[DVec3]) -> Vec<Option<DVec3>> {
        let (Some(motion), limits) = (&self.motion, self.friction_limits(x)) else { return Vec::new() };
        let anchor = |at: &Supported, i: usize| {
            let (support, k) = (&at.support, at.first + i - at.nodes.start);
            let gradient = support.contact(motion.start[i]).gradient;
            let (normal, off) = (gradient.normalize_or_zero(), x[i] - motion.places[k]);
            let most = limits[k] / (self.elastic.contact_stiffness[i] * gradient.length_squared());
            let dragged = rub::dragged(normal, off, most);
            (support.contact(x[i]).height < 0.0).then(|| motion.places[k] + dragged)
        };
        let anchor = &anchor;
        self.elastic.supports.iter().flat_map(|at| at.nodes.clone().map(move |i| anchor(at, i))).collect()
    }

    fn for_supports(&self, x: &[DVec3], mut add: impl FnMut(usize, &Contact)) {
        for at in &self.elastic.supports {
            for i in at.nodes.clone() {
                let k = at.first + i - at.nodes.start;
                let limit = self.limits.get(k).copied().unwrap_or(0.0);
                let touch = at.support.contact(x[i]);
                if touch.height < 0.0 || limit > 0.0 {
                    let mut contact = Contact::pressed(&touch, self.elastic.contact_stiffness[i]);
                    if let Some(motion) = self.motion.as_ref().filter(|_| limit > 0.0) {
                        // The plane of friction is that of the step's beginning: it has a potential
                        // then.
                        let gradient = at.support.contact(motion.start[i]).gradient;
                        let stiffness = self.elastic.contact_stiffness[i] * gradient.length_squared();
                        contact.rub(gradient.normalize_or_zero(), x[i] - motion.places[k], limit, stiffness);
                    }
                    add(i, &contact);
                }
            }
        }
    }
}

/// One node at one support.
struct Contact {
    energy: f64,
    gradient: DVec3,
    /// Without `curvature`.
    hessian: DMat3,
    /// Part of the support's own curvature in the Hessian.
    curvature: DMat3,
    /// The quadratic that touches the energy at this slide and at the opposite one, and lies above
    /// it everywhere: the block of the sweeps.
    secant: DMat3,
}

impl Contact {
    /// The penalty of a depth.
    fn pressed(touch: &SupportContact, stiffness: f64) -> Self {
        let force = stiffness * touch.height.min(0.0);
        let hessian = if touch.height < 0.0 { outer(touch.gradient) * stiffness } else { DMat3::ZERO };
        Self {
            energy: 0.5 * force * touch.height,
            gradient: force * touch.gradient,
            hessian,
            curvature: touch.curvature * force,
            secant: hessian,
        }
    }

    /// Adds friction with its limit held.
    fn rub(&mut self, normal: DVec3, motion: DVec3, limit: f64, stiffness: f64) {
        let rub = rub::Rub::new(normal, motion, limit, stiffness);
        self.energy += rub.energy;
        self.gradient += rub.gradient;
        self.secant += rub.secant;
        self.hessian += rub.hessian;
    }
}
