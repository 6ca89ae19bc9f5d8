//! Cutting: the blades of a tool part a body along the faces of its elements.
//!
//! A [`Model`] never changes, so a cut makes another one, in which the cut body is laid out again
//! and all others are shared. A pool of spare vertices in a body of fixed size would not help: the
//! quasi-Newton solver needs another ordering and another factor after any change of topology, and
//! they are more than half of the cost of a cut ([`sever`] has the figures).

mod carry;
mod faces;
mod split;

use crate::{Error, Model, Result, State};
use glam::DVec3;

/// A rectangle through which two blades have closed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cut {
    /// The body that is cut.
    pub body: usize,
    /// Middle of the rectangle (m, world).
    pub point: DVec3,
    /// Unit normal of its plane.
    pub normal: DVec3,
    /// Unit vector in the plane: the blades' direction.
    pub along: DVec3,
    /// Half of the rectangle's extent along `along` and across it (m), above 0. Infinity cuts
    /// without end.
    pub half_extents: [f64; 2],
}

/// A body that a cut made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Piece {
    /// Its index in the new model.
    pub body: usize,
    /// For each of its nodes, the node of the whole body that it is, or is a copy of.
    pub nodes: Vec<u32>,
    /// For each of its elements, the element of the whole body, ascending.
    pub elements: Vec<u32>,
}

/// The result of a cut.
#[derive(Clone, Debug)]
pub struct Severed {
    /// The model after the cut. It shares the bodies that were not cut with the model before.
    pub model: Model,
    /// The state after the cut, at the same instant.
    pub state: State,
    /// Faces between elements that were opened; 0 if the blades met nothing.
    pub faces: usize,
    /// The pieces; the first is at the index, and has the name, of the whole body.
    pub pieces: Vec<Piece>,
}

impl Cut {
    /// A cut of the whole plane.
    pub fn through(body: usize, point: DVec3, normal: DVec3) -> Self {
        let along = normal.try_normalize().map_or(DVec3::X, DVec3::any_orthonormal_vector);
        Self { body, point, normal, along, half_extents: [f64::INFINITY; 2] }
    }

    /// Whether `x`, which lies near the plane, is between the blades.
    fn reaches(&self, x: DVec3) -> bool {
        let offset = x - self.point;
        let across = self.normal.cross(self.along);
        offset.dot(self.along).abs() <= self.half_extents[0] && offset.dot(across).abs() <= self.half_extents[1]
    }

    /// Checks the cut.
    fn check(&self) -> std::result::Result<(), String> {
        if !(self.point.is_finite() && self.normal.is_finite() && self.along.is_finite()) {
            return Err(format!(
                "a cut at {} with normal {} along {}; coordinates are finite numbers",
                self.point, self.normal, self.along
            ));
        }
        for (name, vector) in [("normal", self.normal), ("direction", self.along)] {
            if !vector.is_normalized() {
                return Err(format!("a cut's {name} is {} long; it must be a unit vector", vector.length()));
            }
        }
        if self.normal.dot(self.along).abs() > 1e-4 {
            return Err(format!(
                "a cut's direction {} is not in its plane; it must be at right angles to the normal {}",
                self.along, self.normal
            ));
        }
        match self.half_extents.iter().find(|half| half.is_nan() || **half <= 0.0) {
            Some(half) => Err(format!("a cut's half extent is {half} m; it must be above 0")),
            None => Ok(()),
        }
    }
}

/// Cuts a body of `model` as it lies in `state`.
///
/// Every element is on the side of the plane on which its centroid is. Elements that would hang by
/// little go with the side they share more area with: no piece of fewer than four elements comes
/// loose. Faces between elements of different sides open if their centroid is within the cut's
/// rectangle. A node falls into as many copies as the elements around it fall into groups that are
/// joined by faces; the end of a crack stays joined. Elements do not change, so volumes are exact.
///
/// Copies have the position, velocity and rest position of their node, to the bit, and shares of
/// its mass by the volumes around them: masses are kept to rounding (6e-8 each). The mass floor is
/// not applied again, so that a copy may be lighter than it; the implicit solvers do not need it,
/// the explicit comparator's stable step becomes shorter. Copies of pinned nodes are pinned.
/// Supports stay. Nodes that stay whole keep their number as long as the body is one, and one copy
/// of each node that fell apart has its number; the others come last.
///
/// A piece that falls off becomes a body of its own at the end of the model, named `appendix.1`,
/// `appendix.2`, ... The piece that is pinned by the most nodes, or else is the largest, remains
/// the body. New bodies have contact with the bodies that the whole one had contact with, and with
/// the other pieces if the whole had contact with itself. A body of loose parts keeps those that
/// the cut did not sever.
///
/// A grasp follows the nodes it holds: one that holds nodes of several pieces becomes a grasp for
/// each, in sequence, jaw and tear force shared by the number of nodes. Of a held node's copies,
/// those stay held that share an element with a held node off the cut; if there are none, those of
/// a piece that has any; and if there are none at all, every copy.
///
/// A hole follows its nodes into every piece.
///
/// Pieces of a body with a collision surface of its own touch with the boundary of their elements:
/// the surface has no faces where the cut is.
///
/// A cut that meets nothing opens no face and leaves model and state as they were. The model and
/// the state before remain valid: [`crate::Stepper::set_model`] changes to either. On one thread of
/// a Zen 5 core that others used at the same time, a tube of 7,752 elements is severed in 15 ms,
/// and the fast solver changes to the new model in 23 ms (layout, ordering and factor of both
/// pieces), which are two frames of 60 Hz together; 3,958 elements take 8 and 14 ms, 31,498 take 53
/// and 179 ms. Sweeps change at once. (`cargo bench -p trocar-tissue --bench cutting`)
///
/// # Errors
/// A body that does not exist, a state of another model, numbers that are not finite, vectors that
/// are not of unit length, a direction out of the plane, extents that are not above 0.
pub fn sever(model: &Model, state: &State, cut: &Cut) -> Result<Severed> {
    let sides = sides(model, state, cut)?;
    sever_part(model, state, cut, [f64::NEG_INFINITY, f64::INFINITY], &sides)
}

/// For each element of the body that `cut` is to sever, whether it comes to lie on the side that
/// the normal points to.
///
/// # Errors
/// As [`sever`].
pub fn sides(model: &Model, state: &State, cut: &Cut) -> Result<Vec<bool>> {
    let body = check(model, state, cut)?;
    Ok(faces::sides(&body.rest, &state.positions(model, cut.body), cut))
}

/// As [`sever`], but of the rectangle only what lies between `part` opens: from and to, along its
/// direction from its middle (m). `sides` are those of the body's elements, from [`sides`] before
/// the first part. So parts of a cut that are opened one after the other meet.
///
/// # Errors
/// As [`sever`]; a part whose ends are not numbers, and sides of another body.
pub fn sever_part(model: &Model, state: &State, cut: &Cut, part: [f64; 2], sides: &[bool]) -> Result<Severed> {
    let body = check(model, state, cut)?;
    let refused = |reason| Error::Body { body: body.name.clone(), reason };
    if part.iter().any(|end| end.is_nan()) {
        return Err(refused("a part of a cut ends at a place that is no number".to_owned()));
    }
    if sides.len() != body.tets.len() {
        let (given, here) = (sides.len(), body.tets.len());
        return Err(refused(format!("a cut has sides of {given} elements; the body has {here}")));
    }
    let opened = faces::open(&body.rest, &state.positions(model, cut.body), cut, part, sides);
    let split = split::split(&body.rest, &opened);
    if split.faces == 0 {
        let whole = Piece {
            body: cut.body,
            nodes: (0..body.len() as u32).collect(),
            elements: (0..body.tets.len() as u32).collect(),
        };
        return Ok(Severed { model: model.clone(), state: state.clone(), faces: 0, pieces: vec![whole] });
    }
    carry::carry(model, state, cut.body, &split)
}

/// The body that `cut` is to sever.
fn check<'m>(model: &'m Model, state: &State, cut: &Cut) -> Result<&'m crate::Body> {
    let Some(body) = model.bodies.get(cut.body) else {
        return Err(Error::Model(format!("body {} is to be cut; there are {}", cut.body, model.bodies.len())));
    };
    cut.check().map_err(|reason| Error::Body { body: body.name.clone(), reason })?;
    let fits = state.bodies.len() == model.bodies.len()
        && state.bodies.iter().zip(&model.bodies).all(|(state, body)| state.x.len() == body.vertex_count())
        && state.names_nodes_of(model);
    if !fits {
        return Err(Error::Model(format!("body '{}' is to be cut in a state of another model", body.name)));
    }
    Ok(body)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Body, BodyDescription, ConstitutiveModel, Material, ModelBuilder};
    use trocar_geometry::TetMesh;

    const MATERIAL: Material = Material {
        model: ConstitutiveModel::StableNeoHookean,
        young_modulus: 12e3,
        poisson_ratio: 0.45,
        density: 1200.0,
        viscosity: 0.0,
    };

    fn model(mesh: &TetMesh, pinned: Vec<u32>) -> Model {
        let mut builder = ModelBuilder::new();
        let description = BodyDescription { name: "body".into(), mesh, material: MATERIAL, pinned, supports: vec![] };
        builder.body(description).unwrap();
        builder.build().unwrap()
    }

    /// A row of cubes, six elements each.
    fn row(cubes: u32) -> TetMesh {
        let mut mesh = TetMesh::default();
        for i in 0..=cubes {
            for c in 0..4 {
                mesh.vertices.push(2e-3 * DVec3::new(f64::from(i), f64::from(c & 1), f64::from(c >> 1)));
            }
        }
        for i in 0..cubes {
            let corner = |c: u32| 4 * (i + (c & 1)) + (c >> 1);
            for [a, b] in [[1, 3], [3, 2], [2, 6], [6, 4], [4, 5], [5, 1]] {
                mesh.tets.push([corner(0), corner(a), corner(b), corner(7)]);
            }
        }
        mesh
    }

    fn color(body: &Body, node: u32) -> usize {
        let vertex = body.internal[node as usize];
        body.color_start.iter().filter(|start| **start <= vertex).count()
    }

    #[test]
    fn colours_stay_valid_for_copies() {
        let mesh = row(6);
        let whole = model(&mesh, vec![0, 1]);
        let state = State::new(&whole);
        for k in 0..40 {
            let tilt = 0.05 * f64::from(k - 20);
            let point = 2e-3 * DVec3::new(3.0, 0.5, 0.5);
            let cut = sever(&whole, &state, &Cut::through(0, point, DVec3::new(1.0, tilt, 0.3).normalize())).unwrap();
            assert_eq!(cut.pieces.len(), 2);
            for piece in &cut.pieces {
                let body = &cut.model.bodies[piece.body];
                for tet in body.tets() {
                    let free = || tet.iter().filter(|i| !body.pinned[**i as usize]);
                    // By the colours of the nodes they come from, and by those they were given.
                    let old = |i: &u32| color(&whole.bodies[0], piece.nodes[*i as usize]);
                    for colors in [free().map(old).collect::<Vec<_>>(), free().map(|i| color(body, *i)).collect()] {
                        let mut distinct = colors.clone();
                        distinct.sort_unstable();
                        distinct.dedup();
                        assert_eq!(distinct.len(), colors.len(), "{colors:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn what_hangs_by_an_edge_stays_with_its_side() {
        // A row, and on each of two of its cubes an element that shares an edge along the row with
        // it and nothing else.
        let mut mesh = row(6);
        for i in [1u32, 4] {
            let first = mesh.vertices.len() as u32;
            let middle = mesh.vertices[4 * i as usize] + 1e-3 * DVec3::X;
            mesh.vertices
                .extend([middle + 2e-3 * DVec3::new(0.0, -1.0, -0.3), middle + 2e-3 * DVec3::new(0.0, -0.3, -1.0)]);
            mesh.tets.push([4 * i, 4 * (i + 1), first, first + 1]);
            let last = mesh.tets.len() - 1;
            if mesh.tet_volume(last) < 0.0 {
                mesh.tets[last].swap(2, 3);
            }
        }
        let whole = model(&mesh, vec![]);
        let state = State::new(&whole);
        assert_eq!(whole.bodies[0].parts(), 1);
        // Between the cubes: through an end of the edge by which the first hangs, of none, of that
        // by which the second does.
        for x in [4e-3, 6e-3, 8e-3] {
            let cut = sever(&whole, &state, &Cut::through(0, DVec3::X * x, DVec3::X)).unwrap();
            let parts = |p: &Piece| cut.model.bodies[p.body].parts();
            assert_eq!(cut.pieces.iter().map(parts).collect::<Vec<_>>(), [1, 1], "cut at {x} m");
            // The four nodes in the plane fall in two, not in three where an element hangs.
            let nodes: usize = cut.pieces.iter().map(|p| p.nodes.len()).sum();
            assert_eq!(nodes, mesh.vertices.len() + 4, "cut at {x} m");
            let hanging = mesh.tets.len() as u32 - 1;
            let with = cut.pieces.iter().position(|p| p.elements.contains(&hanging)).unwrap();
            let beside = cut.pieces.iter().position(|p| p.elements.contains(&(6 * 5))).unwrap();
            assert_eq!(with, beside, "cut at {x} m");
        }
    }

    #[test]
    fn a_body_too_small_to_be_parted_stays_whole() {
        let mesh = row(1);
        let whole = model(&mesh, vec![]);
        let middle = DVec3::splat(1e-3);
        let cut = sever(&whole, &State::new(&whole), &Cut::through(0, middle, DVec3::new(0.0, 1.0, -1.0).normalize()));
        assert_eq!(cut.unwrap().faces, 0, "two pieces of three elements each would be crumbs");
    }
}
