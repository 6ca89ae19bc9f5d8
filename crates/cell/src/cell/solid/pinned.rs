//! Tissue that cannot move: the triangles, edges and vertices of organs whose vertices are all
//! pinned. Of a collision surface these are vertices whose nodes are all pinned.
//!
//! The tissue's own step finds contacts of points that move. It has none for pinned ones, so they
//! would let an instrument pass. Here they are solids for the instrument's axis on their outer
//! side, with no margin: an instrument that lies beside them is not touched. Triangles with a
//! vertex that moves belong to the tissue's contact, whose stiffness falls to 0 at a pinned vertex
//! and at an edge between two. At the rim of the pinned part these are solids of their own, and
//! their outer side is where the tissue around them leaves room now.

use super::meeting::{Deepest, Meeting, REACH};
use super::rod::Rod;
use crate::World;
use crate::cell::ContactParts;
use glam::DVec3;
use std::collections::BTreeMap;
use trocar_geometry::{closest_on_triangle, nearest_of_segments};
use trocar_tissue::Hole;

/// Least cosine of the angle between a triangle's normal and the direction in which it pushes. An
/// edge or vertex at the rim pushes to its whole outer side.
const LEAST_COSINE: f64 = 0.5;

/// Share of a rod's radius by which it may come into tissue. An axis that came near the surface
/// would get past the edge between two triangles, because an organ pushes a part with one triangle only.
const ROOM: f64 = 0.5;

/// Most features of a leaf.
const LEAF: usize = 4;

/// The pinned features of all organs' surfaces, in a tree of boxes.
#[derive(Clone, Debug, Default)]
pub(in crate::cell) struct PinnedSurface {
    /// In the tree's order.
    features: Vec<Pinned>,
    nodes: Vec<Node>,
    /// The triangles around each feature at the rim.
    rims: Vec<Vec<[u32; 3]>>,
}

/// A triangle of an organ whose vertices are pinned; or an edge or a vertex at the rim, as a
/// triangle whose last corners are one.
#[derive(Clone, Copy, Debug)]
struct Pinned {
    organ: usize,
    nodes: [u32; 3],
    /// Corners (m); those of a triangle counterclockwise seen from outside.
    corners: [DVec3; 3],
    /// Unit normal, out of the organ.
    outward: DVec3,
    /// Number of its rim, of an edge or vertex.
    rim: Option<usize>,
}

impl Pinned {
    /// Whether it is in one of the `holes` that let `tool` through.
    fn lets_through(&self, holes: &[Hole], tool: usize) -> bool {
        let open = |hole: &Hole| self.nodes.iter().any(|node| hole.nodes.binary_search(node).is_ok());
        holes.iter().any(|hole| hole.body == self.organ && hole.tools.contains(&tool) && open(hole))
    }
}

/// A box around features. Its first child follows it.
#[derive(Clone, Copy, Debug)]
struct Node {
    low: DVec3,
    high: DVec3,
    /// The features of a leaf; empty otherwise.
    leaf: [usize; 2],
    /// The node after its last descendant.
    after: usize,
}

impl PinnedSurface {
    /// The pinned features of `world` at their present place, which never changes. None if
    /// instruments do not touch organs.
    pub fn felt(world: &World, contact: ContactParts) -> Self {
        if !contact.instruments {
            return Self::default();
        }
        let mut surface = Self::default();
        for (k, body) in world.model.bodies().iter().enumerate() {
            if !body.pinned().contains(&true) {
                continue;
            }
            let vertex = |i: u32| Vertex::of(world, k, i);
            match body.collision_surface() {
                Some(collision) => surface.add(k, &collision.mesh().triangles, vertex),
                None => {
                    let (boundary, nodes) = body.rest().boundary();
                    let triangles: Vec<[u32; 3]> =
                        boundary.triangles.iter().map(|t| t.map(|i| nodes[i as usize])).collect();
                    surface.add(k, &triangles, vertex);
                }
            }
        }
        build(&mut surface.features, 0, &mut surface.nodes);
        surface
    }

    /// Appends the pinned triangles of a surface of `organ`, and the edges and vertices at the rim
    /// of its pinned part: those of a triangle with a vertex that moves.
    fn add(&mut self, organ: usize, triangles: &[[u32; 3]], vertex: impl Fn(u32) -> Vertex) {
        // Edges and vertices by their vertices, with their triangles and whether one moves.
        let mut parts: BTreeMap<[u32; 2], (Vec<[u32; 3]>, bool)> = BTreeMap::new();
        let mut add = |corners: [Vertex; 3], outward: Option<DVec3>, rim: Option<usize>| {
            if let Some(outward) = outward {
                let (nodes, corners) = (corners.map(|v| v.node), corners.map(|v| v.place));
                self.features.push(Pinned { organ, nodes, corners, outward, rim });
            }
        };
        for t in triangles {
            let corners = t.map(&vertex);
            let moves = corners.iter().any(|v| !v.is_pinned);
            if !moves {
                add(corners, mean_normal(&[*t], |i| vertex(i).place), None);
            }
            let mut part = |i: u32, k: u32| {
                let (around, rim) = parts.entry([i.min(k), i.max(k)]).or_default();
                around.push(*t);
                *rim |= moves;
            };
            for k in 0..3 {
                let next = (k + 1) % 3;
                if corners[k].is_pinned {
                    part(t[k], t[k]);
                    if corners[next].is_pinned {
                        part(t[k], t[next]);
                    }
                }
            }
        }
        for ([i, k], (around, _)) in parts.into_iter().filter(|(_, (_, rim))| *rim) {
            add([i, k, k].map(&vertex), mean_normal(&around, |i| vertex(i).place), Some(self.rims.len()));
            self.rims.push(around);
        }
    }

    /// Turns the normals at the rim to where the tissue around them is now.
    pub fn follow(&mut self, world: &World) {
        for feature in &mut self.features {
            if let Some(rim) = feature.rim
                && let Some(outward) = mean_normal(&self.rims[rim], |i| Vertex::of(world, feature.organ, i).place)
            {
                feature.outward = outward;
            }
        }
    }

    /// Adds the meetings of `rods`, which belong to `tool` and pass through its `holes`.
    pub(super) fn meet(&self, rods: &[Rod], holes: &[Hole], tool: usize, found: &mut Deepest) {
        for rod in rods {
            self.for_near(&rod.ends, rod.radius + REACH, |feature| {
                if let Some(meeting) = meeting(rod, feature).filter(|_| !feature.lets_through(holes, tool)) {
                    found.add(rod.part, meeting);
                }
            });
        }
    }

    /// Whether the axis of one of `rods`, which belong to `tool`, goes through a triangle that is
    /// in none of its `holes`.
    pub(super) fn is_crossed(&self, rods: &[Rod], holes: &[Hole], tool: usize) -> bool {
        let mut crossed = false;
        for rod in rods {
            self.for_near(&rod.ends, 0.0, |feature| {
                crossed |= crosses(&rod.ends, &feature.corners) && !feature.lets_through(holes, tool);
            });
        }
        crossed
    }

    /// Calls `found` for the features whose boxes are within `reach` (m) of a segment.
    fn for_near(&self, segment: &[DVec3; 2], reach: f64, mut found: impl FnMut(&Pinned)) {
        let mut at = 0;
        while let Some(node) = self.nodes.get(at) {
            if !near_box(segment, reach, node) {
                at = node.after;
                continue;
            }
            self.features[node.leaf[0]..node.leaf[1]].iter().for_each(&mut found);
            at += 1;
        }
    }
}

/// A vertex of a surface.
#[derive(Clone, Copy)]
struct Vertex {
    /// The node that it is, or that bears most of it: for holes.
    node: u32,
    place: DVec3,
    is_pinned: bool,
}

impl Vertex {
    /// Vertex `i` of the collision surface of `organ`, or its node `i` without one.
    fn of(world: &World, organ: usize, i: u32) -> Self {
        let body = &world.model.bodies()[organ];
        let pinned = |node: u32| body.pinned()[node as usize];
        let Some(surface) = body.collision_surface() else {
            let place = world.state.position(&world.model, organ, i as usize);
            return Self { node: i, place, is_pinned: pinned(i) };
        };
        let (nodes, weights) = surface.nodes_of(i as usize);
        let bearing = || nodes.into_iter().zip(weights).filter(|(_, weight)| *weight != 0.0);
        let node = bearing().max_by(|a, b| a.1.total_cmp(&b.1)).map_or(0, |(node, _)| node);
        let place = world.state.collision_position(&world.model, organ, i as usize);
        Self { node, place, is_pinned: bearing().all(|(node, _)| pinned(node)) }
    }
}

/// The mean of the unit normals of triangles, made a unit vector, if there is one.
fn mean_normal(triangles: &[[u32; 3]], place: impl Fn(u32) -> DVec3) -> Option<DVec3> {
    let normal = |t: &[u32; 3]| {
        let [a, b, c] = t.map(&place);
        (b - a).cross(c - a).normalize_or_zero()
    };
    triangles.iter().map(normal).sum::<DVec3>().try_normalize()
}

/// Appends the tree over `features`, the first of which is number `first`.
fn build(features: &mut [Pinned], first: usize, nodes: &mut Vec<Node>) {
    if features.is_empty() {
        return;
    }
    let corners = features.iter().flat_map(|t| &t.corners);
    let (low, high) =
        corners.fold((DVec3::INFINITY, DVec3::NEG_INFINITY), |(low, high), p| (low.min(*p), high.max(*p)));
    let (at, count) = (nodes.len(), features.len());
    let leaf = if count <= LEAF { [first, first + count] } else { [first; 2] };
    nodes.push(Node { low, high, leaf, after: 0 });
    if count > LEAF {
        let size = high - low;
        let axis = (0..3).max_by(|a, b| size[*a].total_cmp(&size[*b])).unwrap_or(0);
        let middle = |t: &Pinned| t.corners.iter().map(|p| p[axis]).sum::<f64>();
        // Stable: features of equal middles keep their order.
        features.sort_by(|a, b| middle(a).total_cmp(&middle(b)));
        let (left, right) = features.split_at_mut(count / 2);
        build(left, first, nodes);
        build(right, first + count / 2, nodes);
    }
    nodes[at].after = nodes.len();
}

/// Whether the segment comes into the box grown by `reach` (m) on all sides.
fn near_box([from, to]: &[DVec3; 2], reach: f64, node: &Node) -> bool {
    let (low, high, way) = (node.low - reach, node.high + reach, *to - *from);
    let (mut begin, mut end) = (0.0_f64, 1.0_f64);
    for a in 0..3 {
        let (one, two) = ((low[a] - from[a]) / way[a], (high[a] - from[a]) / way[a]);
        if way[a] == 0.0 {
            if from[a] < low[a] || from[a] > high[a] {
                return false;
            }
        } else {
            (begin, end) = (begin.max(one.min(two)), end.min(one.max(two)));
        }
    }
    begin <= end
}

/// The meeting of a rod with a feature, if the rod's axis is in front of it.
fn meeting(rod: &Rod, Pinned { organ, corners, outward, rim, .. }: &Pinned) -> Option<Meeting> {
    let [a, b, c] = *corners;
    let mut best: Option<(f64, DVec3, DVec3)> = None;
    let mut add = |p: DVec3, q: DVec3| {
        let distance = p.distance(q);
        if best.is_none_or(|(least, ..)| distance < least) {
            best = Some((distance, p, q));
        }
    };
    // The nearest places are at an end of the axis or at an edge of the triangle, unless the axis
    // goes through it.
    for p in rod.ends {
        add(p, closest_on_triangle(corners, p));
    }
    for edge in [[a, b], [b, c], [c, a]] {
        let [s, t] = nearest_of_segments(rod.ends, edge);
        add(rod.ends[0].lerp(rod.ends[1], s), edge[0].lerp(edge[1], t));
    }
    let (distance, p, q) = best?;
    if crosses(&rod.ends, corners) {
        return None;
    }
    let normal = (p - q).try_normalize()?;
    if normal.dot(*outward) < if rim.is_some() { 0.0 } else { LEAST_COSINE } {
        return None;
    }
    let gap = distance - rod.radius;
    Some(Meeting { point: q + 0.5 * gap * normal, normal, gap, room: ROOM * rod.radius, organ: Some(*organ) })
}

/// Whether a segment goes through a triangle.
fn crosses(ends: &[DVec3; 2], triangle: &[DVec3; 3]) -> bool {
    let [a, b, c] = *triangle;
    let normal = (b - a).cross(c - a);
    let heights = ends.map(|p| (p - a).dot(normal));
    if heights[0].min(heights[1]) >= 0.0 || heights[0].max(heights[1]) <= 0.0 {
        return false;
    }
    let through = ends[0].lerp(ends[1], heights[0] / (heights[0] - heights[1]));
    closest_on_triangle(triangle, through).distance(through) < 1e-12
}

#[cfg(test)]
mod tests {
    use super::*;
    use trocar_testing::blocks::block;

    /// The surface of a cube of 10 mm around 0 in which only vertices at `pinned` cannot move.
    fn cube_pinned(pinned: impl Fn(DVec3) -> bool) -> PinnedSurface {
        let mesh = block([1; 3], 0.01).boundary().0;
        let vertex = |node: u32| {
            let place = mesh.vertices[node as usize] - 5e-3;
            Vertex { node, place, is_pinned: pinned(place) }
        };
        let mut surface = PinnedSurface::default();
        surface.add(0, &mesh.triangles, vertex);
        build(&mut surface.features, 0, &mut surface.nodes);
        surface
    }

    /// The gap at which a ball of 1 mm at `place` (mm) meets the surface (mm), if it does.
    fn gap(surface: &PinnedSurface, place: [f64; 3]) -> Option<f64> {
        let rod = Rod { ends: [1e-3 * DVec3::from(place); 2], radius: 1e-3, part: 0 };
        let mut found = Deepest::default();
        surface.meet(&[rod], &[], 0, &mut found);
        found.into_iter().next().map(|meeting| 1e3 * meeting.gap)
    }

    #[test]
    fn vertices_and_edges_at_the_rim_are_solids() {
        let near = |gap: Option<f64>, to: f64| gap.is_some_and(|gap| (gap - to).abs() < 1e-9);
        let corner = cube_pinned(|p| p.min_element() > 0.0);
        assert_eq!(corner.features.len(), 1);
        assert!(near(gap(&corner, [5.5, 5.0, 5.0]), -0.5));
        assert_eq!(gap(&corner, [4.5, 4.5, 4.5]), None, "inside");
        assert_eq!(gap(&corner, [5.5, 0.0, 5.0]), None, "an edge that moves is tissue's");
        let edge = cube_pinned(|p| p.x > 0.0 && p.y > 0.0);
        assert_eq!(edge.features.len(), 3, "an edge and its two vertices");
        assert!(near(gap(&edge, [5.3, 5.4, 0.0]), -0.5));
        // A face of two triangles, its outer edges and its corners. No triangle at the diagonal
        // moves.
        let face = cube_pinned(|p| p.z > 0.0);
        assert_eq!(face.features.len(), 2 + 4 + 4);
        assert!(near(gap(&face, [1.0, 2.0, 5.4]), -0.6));
        assert!(near(gap(&face, [5.4, 1.0, 5.3]), -0.5), "the rim pushes what its face does not");
        assert!(cube_pinned(|_| false).features.is_empty());
        assert_eq!(cube_pinned(|_| true).features.len(), 12, "no rim");
    }
}
