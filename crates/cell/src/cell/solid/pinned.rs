//! Tissue that cannot move: the triangles of organs whose three vertices are pinned. Of a collision
//! surface these are vertices whose nodes are all pinned.
//!
//! The tissue's own step finds contacts of points that move. It has none for pinned ones, so they
//! would let an instrument pass. Here such a triangle is a solid for the instrument's axis on its
//! outer side, with no margin: an instrument that lies beside it is not touched. Triangles with a
//! vertex that moves belong to the tissue's contact. Its stiffness falls to 0 at a pinned vertex
//! and at an edge between two, so these are solids, too, where such a triangle begins
//! ([`super::rim`]).

use super::meeting::{Deepest, Meeting, REACH};
use super::rim::{Rim, RimPlaces};
use super::rod::Rod;
use super::surface_vertex::SurfaceVertex;
use crate::World;
use crate::cell::ContactParts;
use glam::DVec3;
use std::collections::BTreeMap;
use trocar_geometry::{closest_on_triangle, nearest_of_segments};
use trocar_tissue::Hole;

/// Least cosine of the angle between a triangle's normal and the direction in which it pushes.
const LEAST_COSINE: f64 = 0.5;

/// Share of a rod's radius by which it may come into tissue. An axis that came near the surface
/// would get past the edge between two triangles, because an organ pushes a part at one place only.
const ROOM: f64 = 0.5;

/// Most features of a leaf.
const LEAF: usize = 4;

/// The pinned features of all organs' surfaces, in a tree of boxes.
#[derive(Clone, Debug, Default)]
pub(in crate::cell) struct PinnedSurface {
    /// In the tree's order.
    features: Vec<Pinned>,
    nodes: Vec<Node>,
    rims: Vec<Rim>,
    places: RimPlaces,
}

/// A pinned triangle of an organ, or an edge or a vertex at a rim.
#[derive(Clone, Copy, Debug)]
struct Pinned {
    organ: usize,
    nodes: [u32; 3],
    /// Corners (m), counterclockwise seen from outside; of an edge or a vertex the last ones are
    /// the same.
    corners: [DVec3; 3],
    side: Side,
}

/// Where the outside of a pinned feature is.
#[derive(Clone, Copy, Debug)]
enum Side {
    /// The unit normal of a triangle.
    Face(DVec3),
    /// Number of a rim.
    Rim(usize),
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
    /// The pinned features of `world`, which stay where they are. None if instruments do not touch
    /// organs.
    pub fn felt(world: &World, contact: ContactParts) -> Self {
        if !contact.instruments {
            return Self::default();
        }
        let mut surface = Self::default();
        for (organ, body) in world.model.bodies().iter().enumerate() {
            if !body.pinned().contains(&true) {
                continue;
            }
            let vertex = |i: u32| SurfaceVertex::of(world, organ, i);
            match body.collision_surface() {
                Some(collision) => surface.add(organ, &collision.mesh().triangles, vertex),
                None => {
                    let (boundary, nodes) = body.rest().boundary();
                    let triangles = boundary.triangles.iter().map(|t| t.map(|i| nodes[i as usize]));
                    surface.add(organ, &triangles.collect::<Vec<_>>(), vertex);
                }
            }
        }
        build(&mut surface.features, 0, &mut surface.nodes);
        surface.places.finish();
        surface
    }

    /// Appends the pinned features of a surface of `organ`.
    fn add(&mut self, organ: usize, triangles: &[[u32; 3]], vertex: impl Fn(u32) -> SurfaceVertex) {
        // The triangles around each pinned edge and vertex, by its ends, and whether one moves.
        let mut around: BTreeMap<[u32; 2], (Vec<[u32; 3]>, bool)> = BTreeMap::new();
        let mut push = |corners: [SurfaceVertex; 3], side: Side| {
            let (nodes, corners) = (corners.map(|v| v.node), corners.map(|v| v.place));
            self.features.push(Pinned { organ, nodes, corners, side });
        };
        for t in triangles {
            let corners = t.map(&vertex);
            let [a, b, c] = corners.map(|v| v.place);
            let moves = corners.iter().any(|v| !v.is_pinned);
            if let Some(outward) = (b - a).cross(c - a).try_normalize().filter(|_| !moves) {
                push(corners, Side::Face(outward));
            }
            let mut note = |i: usize, k: usize| {
                if corners[i].is_pinned && corners[k].is_pinned {
                    let (triangles, rim) = around.entry([t[i].min(t[k]), t[i].max(t[k])]).or_default();
                    triangles.push(*t);
                    *rim |= moves;
                }
            };
            (0..3).for_each(|i| note(i, i));
            (0..3).for_each(|i| note(i, (i + 1) % 3));
        }
        for (ends, (triangles, _)) in around.into_iter().filter(|(_, (_, rim))| *rim) {
            push([ends[0], ends[1], ends[1]].map(&vertex), Side::Rim(self.rims.len()));
            self.rims.push(Rim::new(organ, ends, &triangles, |i| vertex(i).place, &mut self.places));
        }
    }

    /// Reads where the tissue around the rims is now.
    pub fn follow(&mut self, world: &World) {
        self.places.follow(world);
    }

    /// Adds the meetings of `rods`, which belong to `tool` and pass through its `holes`.
    pub(super) fn meet(&self, rods: &[Rod], holes: &[Hole], tool: usize, found: &mut Deepest) {
        for rod in rods {
            self.for_near(&rod.ends, rod.radius + REACH, |feature| {
                if let Some(meeting) = self.meeting(rod, feature).filter(|_| !feature.lets_through(holes, tool)) {
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
                let is_face = matches!(feature.side, Side::Face(_));
                crossed |= is_face && crosses(&rod.ends, &feature.corners) && !feature.lets_through(holes, tool);
            });
        }
        crossed
    }

    /// The meeting of a rod with a feature, if the rod's axis is in front of it.
    fn meeting(&self, rod: &Rod, Pinned { organ, corners, side, .. }: &Pinned) -> Option<Meeting> {
        let [p, q] = match side {
            Side::Face(_) => nearest_to_triangle(&rod.ends, corners)?,
            Side::Rim(rim) => {
                let edge = [corners[0], corners[1]];
                let [s, t] = nearest_of_segments(rod.ends, edge);
                // The ends of an edge are rims of their own.
                if !self.rims[*rim].is_vertex() && (t <= 0.0 || t >= 1.0) {
                    return None;
                }
                [rod.ends[0].lerp(rod.ends[1], s), edge[0].lerp(edge[1], t)]
            }
        };
        let normal = (p - q).try_normalize()?;
        let in_front = match side {
            Side::Face(outward) => normal.dot(*outward) >= LEAST_COSINE,
            Side::Rim(rim) => self.rims[*rim].leads_out(normal, &self.places),
        };
        let gap = p.distance(q) - rod.radius;
        let point = q + 0.5 * gap * normal;
        in_front.then_some(Meeting { point, normal, gap, room: ROOM * rod.radius, organ: Some(*organ) })
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

/// The nearest places of a segment and a triangle; None if the segment goes through it.
fn nearest_to_triangle(ends: &[DVec3; 2], triangle: &[DVec3; 3]) -> Option<[DVec3; 2]> {
    let [a, b, c] = *triangle;
    // The nearest places are at an end of the segment or at an edge of the triangle, unless the
    // segment goes through it.
    let of_ends = ends.map(|p| [p, closest_on_triangle(triangle, p)]);
    let of_edges = [[a, b], [b, c], [c, a]].map(|edge| {
        let [s, t] = nearest_of_segments(*ends, edge);
        [ends[0].lerp(ends[1], s), edge[0].lerp(edge[1], t)]
    });
    let mut best = of_ends[0];
    for pair in of_ends.into_iter().chain(of_edges) {
        if pair[0].distance(pair[1]) < best[0].distance(best[1]) {
            best = pair;
        }
    }
    (!crosses(ends, triangle)).then_some(best)
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
            SurfaceVertex { node, place, is_pinned: pinned(place) }
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
        let pushing = |place: [f64; 3]| {
            let rod = Rod { ends: [1e-3 * DVec3::from(place); 2], radius: 1e-3, part: 0 };
            edge.features.iter().filter(|feature| edge.meeting(&rod, feature).is_some()).count()
        };
        assert_eq!(pushing([5.3, 5.4, 5.2]), 1, "beyond its end an edge does not push, its vertex does");
        assert_eq!(pushing([5.3, 5.4, 4.8]), 2);
        // A face of two triangles, its outer edges and its corners. No triangle at the diagonal
        // moves.
        let face = cube_pinned(|p| p.z > 0.0);
        assert_eq!(face.features.len(), 2 + 4 + 4);
        assert!(near(gap(&face, [1.0, 2.0, 5.4]), -0.6));
        let beside = gap(&face, [5.4, 1.0, 5.1]);
        assert!(near(beside, 0.17_f64.sqrt() - 1.0), "the rim pushes what its face does not: {beside:?}");
        assert!(cube_pinned(|_| false).features.is_empty());
        assert_eq!(cube_pinned(|_| true).features.len(), 12, "no rim");
    }
}
