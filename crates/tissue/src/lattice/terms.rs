//! The forces that press, hold and pull the vertices of an island in a substep, as terms of its
//! potential in double precision.

use crate::Body;
use crate::contact::{Contact, Friction, Pairs};
use glam::{DMat3, DVec3, Vec3A};
use trocar_lattice::EmbeddedPoint;

/// A vertex with its share of a term.
#[derive(Clone, Copy, Debug)]
pub(super) struct Share<'a> {
    /// The body, by its number in the island.
    pub member: usize,
    pub share: f64,
    pub place: Place<'a>,
}

/// Where a vertex is.
#[derive(Clone, Copy, Debug)]
pub(super) enum Place<'a> {
    /// It moves with a lattice.
    Embedded(&'a EmbeddedPoint),
    /// It does not move (m).
    Fixed(DVec3),
}

/// The law of a term.
#[derive(Clone, Copy, Debug)]
enum Law {
    /// A contact, which presses on one side or, where it clamps, on both.
    Contact { normal: DVec3, point: DVec3, hard: f64, hard_from: f64, friction: Friction },
    /// A spring in all directions.
    Spring,
}

/// One term: a point of the island at a plane or a place.
#[derive(Clone, Debug)]
pub(super) struct Term<'a> {
    shares: [Option<Share<'a>>; 4],
    /// Added to the weighted sum of the vertices (m).
    shift: DVec3,
    /// Where friction or the spring holds the point (m).
    place: DVec3,
    /// (N/m).
    stiffness: f64,
    law: Law,
    /// Limit of friction (N), held between two updates.
    pub limit: f64,
}

/// What a term exerts.
struct Response {
    /// (J).
    energy: f64,
    /// Gradient by the point (N).
    force: DVec3,
    /// Of a contact; zero of a spring.
    normal: DVec3,
    /// Stiffness along the normal and across it (N/m).
    along: f64,
    across: f64,
}

impl Response {
    /// Second derivative by the point (N/m), positive semidefinite.
    fn stiffness(&self) -> DMat3 {
        let n = self.normal;
        let outer = DMat3::from_cols(n * n.x, n * n.y, n * n.z);
        outer * (self.along - self.across) + DMat3::from_diagonal(DVec3::splat(self.across))
    }
}

impl<'a> Term<'a> {
    /// A spring of `stiffness` (N/m) from a point to a place (m).
    pub fn spring(share: Share<'a>, place: DVec3, stiffness: f64) -> Self {
        let shares = [Some(share), None, None, None];
        Self { shares, shift: DVec3::ZERO, place, stiffness, law: Law::Spring, limit: 0.0 }
    }

    fn contact(contact: &Contact, shares: [Option<Share<'a>>; 4], shift: DVec3) -> Self {
        let law = Law::Contact {
            normal: contact.normal.as_dvec3(),
            point: contact.point.as_dvec3(),
            hard: f64::from(contact.hardened()),
            hard_from: f64::from(contact.hard_from),
            friction: contact.friction,
        };
        let (place, stiffness) = (contact.place.as_dvec3(), f64::from(contact.stiffness));
        Self { shares, shift, place, stiffness, law, limit: 0.0 }
    }

    /// The shares of the point.
    pub fn shares(&self) -> impl Iterator<Item = &Share<'a>> {
        self.shares.iter().flatten()
    }

    /// The point, with the lattices' nodes at `x` (m).
    pub fn at(&self, x: &[&[DVec3]]) -> DVec3 {
        let of = |share: &Share<'_>| match &share.place {
            Place::Embedded(point) => share.share * point.interpolate(x[share.member]),
            Place::Fixed(place) => share.share * *place,
        };
        self.shift + self.shares().map(of).sum::<DVec3>()
    }

    /// Force along the normal at a height (N), negative where it pushes towards the free side; its
    /// energy (J) and stiffness (N/m).
    fn press(&self, height: f64) -> [f64; 3] {
        let k = self.stiffness;
        let Law::Contact { hard, hard_from, friction, .. } = self.law else { return [0.0; 3] };
        if let Friction::Clamped(_) = friction {
            return [k * height, 0.5 * k * height * height, k];
        }
        if height >= 0.0 {
            return [0.0; 3];
        }
        let beyond = (-height - hard_from).max(0.0);
        let force = k * height - (hard - k) * beyond;
        let energy = 0.5 * (k * height * height + (hard - k) * beyond * beyond);
        [force, energy, if beyond > 0.0 { hard } else { k }]
    }

    /// Sets the limit of friction to that with the point at `p` (m).
    pub fn update_limit(&mut self, p: DVec3) {
        let Law::Contact { normal, point, friction, .. } = self.law else { return };
        self.limit = match friction {
            Friction::Coulomb(0.0) => 0.0,
            Friction::Coulomb(coefficient) => -f64::from(coefficient) * self.press((p - point).dot(normal))[0],
            Friction::Clamped(force) => f64::from(force.max(0.0)),
        };
    }

    /// What acts with the point at `p` (m), if anything does.
    fn value(&self, p: DVec3) -> Option<Response> {
        let (k, off) = (self.stiffness, p - self.place);
        let Law::Contact { normal, point, .. } = self.law else {
            let energy = 0.5 * k * off.length_squared();
            return Some(Response { energy, force: k * off, normal: DVec3::ZERO, along: k, across: k });
        };
        let [force, mut energy, along] = self.press((p - point).dot(normal));
        if along == 0.0 && self.limit <= 0.0 {
            return None;
        }
        let off = off - off.dot(normal) * normal;
        let length = off.length();
        let slides = k * length > self.limit;
        let across = if slides { self.limit / length } else { k };
        energy += if slides { self.limit * (length - 0.5 * self.limit / k) } else { 0.5 * k * length * length };
        Some(Response { energy, force: force * normal + across * off, normal, along, across })
    }

    /// Adds the gradient with the point at `p` (N); returns the energy (J).
    pub fn add_gradient(&self, p: DVec3, gradient: &mut [Vec<DVec3>]) -> f64 {
        let Some(Response { energy, force, .. }) = self.value(p) else { return 0.0 };
        for share in self.shares() {
            if let Place::Embedded(point) = &share.place {
                point.spread(share.share * force, &mut gradient[share.member]);
            }
        }
        energy
    }

    /// Calls `add(a, b, block)` for pairs of nodes of the lattice of a body (N/m). Coupling between
    /// vertices is left out, and each bears the whole share of its own: no less than the term's
    /// second derivative where they move alike.
    pub fn add_stiffness(&self, x: &[&[DVec3]], member: usize, mut add: impl FnMut(u32, u32, DMat3)) {
        if !self.shares().any(|share| share.member == member) {
            return;
        }
        let Some(value) = self.value(self.at(x)) else { return };
        let block = value.stiffness();
        for share in self.shares().filter(|share| share.member == member) {
            if let Place::Embedded(point) = &share.place {
                for (a, wa) in point.nodes.iter().zip(&point.weights) {
                    for (b, wb) in point.nodes.iter().zip(&point.weights) {
                        add(*a, *b, block * (share.share.abs() * wa * wb));
                    }
                }
            }
        }
    }

    /// Force of the spring at `x` on what holds the point (N), and the point (m).
    pub fn pull(&self, x: &[&[DVec3]]) -> (DVec3, DVec3) {
        let p = self.at(x);
        (self.stiffness * (p - self.place), p)
    }
}

/// A vertex of a body.
fn share<'a>(member: usize, (body, x): Member<'a, '_>, vertex: u32, share: f64) -> Share<'a> {
    let embedded = body.lattice.as_deref().and_then(|embedding| embedding.points[vertex as usize].as_ref());
    let place = embedded.map_or_else(|| Place::Fixed(x[vertex as usize].as_dvec3()), Place::Embedded);
    Share { member, share, place }
}

/// The body of a member, and where its vertices are.
pub(super) type Member<'a, 'x> = (&'a Body, &'x [Vec3A]);

/// Appends the contacts of a body with tools, supports and grasps.
pub(super) fn push_contacts<'a>(member: usize, body: Member<'a, '_>, contacts: &[Contact], terms: &mut Vec<Term<'a>>) {
    for contact in contacts {
        let mut shares = [None; 4];
        for (to, (vertex, weight)) in shares.iter_mut().zip(contact.site.shares()) {
            *to = Some(share(member, body, vertex, f64::from(weight)));
        }
        terms.push(Term::contact(contact, shares, DVec3::ZERO));
    }
}

/// Appends the contacts between the bodies of an island.
pub(super) fn push_pairs<'a, 'x>(members: impl Fn(usize) -> Member<'a, 'x>, pairs: &Pairs, terms: &mut Vec<Term<'a>>) {
    for pair in pairs.list() {
        let shares = pair.shares().map(|(member, vertex, weight)| {
            (weight != 0.0).then(|| share(member, members(member), vertex, f64::from(weight)))
        });
        terms.push(Term::contact(&pair.contact, shares, pair.shift().as_dvec3()));
    }
}
