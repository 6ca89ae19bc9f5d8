//! Nested dissection: an order of elimination that keeps the Cholesky factor sparse.
//!
//! George, "Nested dissection of a regular finite element mesh", 1973. A part is cut into two
//! halves by a separator, which is eliminated after them. To find a small separator, the part is
//! made coarser until few nodes are left and cut there. On each finer graph the separator is made
//! smaller (Hendrickson and Rothberg, "Improving the run time and quality of nested dissection
//! ordering", 1998).

use crate::coarsening::Coarser;
use crate::graph::Graph;
use crate::separator::{SEPARATOR, Separator};
use trocar_core::has_threads;

/// Parts of at most this many nodes are not cut further.
const MAX_LEAF_NODES: usize = 16;

/// Graphs of at most this many nodes are not made coarser.
const MAX_COARSEST_NODES: usize = 80;

/// A coarser graph with more than this share of the nodes is of no use.
const MAX_COARSENING_RATIO: f64 = 0.9;

/// Cuts of a part that is made coarser, each from another coarser graph; the best counts.
const CUTS: u32 = 3;

/// Nodes of the coarsest graph that a half grows from; the best cut counts.
const SEEDS: usize = 3;

/// Halves of parts of at least this many nodes are worth a thread each.
const MIN_PARALLEL_NODES: usize = 200;

/// The nodes of `graph` in the order of elimination: first eliminated first.
pub(crate) fn dissect(graph: &Graph) -> Vec<u32> {
    let mut nodes: Vec<u32> = graph.nodes().collect();
    if graph.len() <= MAX_LEAF_NODES {
        return nodes;
    }
    let sides = best_cut(graph);
    let on = |side: u8| graph.nodes().filter(|i| sides[*i as usize] == side).collect::<Vec<u32>>();
    let (separator, halves) = (on(SEPARATOR), [on(1), on(2)]);
    if halves.iter().any(Vec::is_empty) {
        // Nodes that are joined to many others last.
        nodes.sort_by_key(|i| graph.edges(*i).len());
        return nodes;
    }
    let order = |half: &[u32]| dissect(&graph.part(half)).into_iter().map(|k| half[k as usize]).collect::<Vec<u32>>();
    let [a, b] = &halves;
    let (a, b) = match has_threads() && graph.len() >= MIN_PARALLEL_NODES {
        true => rayon::join(|| order(a), || order(b)),
        false => (order(a), order(b)),
    };
    [a, b, separator].concat()
}

/// The cut with the smallest separator; the side of each node.
fn best_cut(graph: &Graph) -> Vec<u8> {
    let count = if graph.len() > MAX_COARSEST_NODES { CUTS } else { 1 };
    let cuts = (0..count).map(|turn| cut(graph, turn));
    cuts.min_by_key(|sides| graph.weight_of(sides, SEPARATOR)).unwrap_or_default()
}

/// Cuts a graph; another `turn` makes it coarser in another way.
fn cut(graph: &Graph, turn: u32) -> Vec<u8> {
    if graph.len() <= MAX_COARSEST_NODES {
        return first_cut(graph);
    }
    let coarser = Coarser::new(graph, graph.weight().div_ceil(MAX_COARSEST_NODES as u32 / 2), turn);
    if coarser.graph.len() as f64 > MAX_COARSENING_RATIO * graph.len() as f64 {
        return first_cut(graph);
    }
    let coarse = cut(&coarser.graph, turn);
    let mut sides: Vec<u8> = coarser.of.iter().map(|k| coarse[*k as usize]).collect();
    Separator::new(graph, &mut sides).refine();
    sides
}

/// The best of some cuts in which a half grows from a node.
fn first_cut(graph: &Graph) -> Vec<u8> {
    let seeds = (0..SEEDS).map(|k| (k * graph.len() / SEEDS) as u32);
    let cuts = seeds.map(|seed| {
        let mut sides = grow(graph, seed);
        Separator::new(graph, &mut sides).refine();
        sides
    });
    cuts.min_by_key(|sides| graph.weight_of(sides, SEPARATOR)).unwrap_or_default()
}

/// A half that grows from a node until it has half of the weight; what is next to it separates.
fn grow(graph: &Graph, seed: u32) -> Vec<u8> {
    let distances = graph.distances(seed);
    let mut near: Vec<u32> = graph.nodes().collect();
    near.sort_by_key(|i| distances[*i as usize]);
    let (mut sides, mut weight, half) = (vec![2; graph.len()], 0, graph.weight().div_ceil(2));
    for i in near {
        if weight >= half {
            break;
        }
        sides[i as usize] = 1;
        weight += graph.weights[i as usize];
    }
    for i in graph.nodes() {
        if sides[i as usize] == 2 && graph.neighbours(i).any(|j| sides[j as usize] == 1) {
            sides[i as usize] = SEPARATOR;
        }
    }
    sides
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::BlockMatrix;
    use crate::separator::assert_apart;
    use crate::supernodes::{column_counts, elimination_tree};

    /// A grid of `n` nodes a side, each joined to the next along the axes.
    fn grid(n: [u32; 3]) -> Graph {
        let mut pairs = Vec::new();
        for i in nodes(n, [0; 3], n) {
            let at = [i % n[0], i / n[0] % n[1], i / n[0] / n[1]];
            let steps = [1, n[0], n[0] * n[1]];
            pairs.extend((0..3).filter(|c| at[*c] + 1 < n[*c]).map(|c| (i, i + steps[c])));
        }
        Graph::new(&BlockMatrix::new(n.iter().product::<u32>() as usize, pairs.into_iter()))
    }

    /// Sizes of the separator and of the halves; none of the edges goes from half to half.
    fn sizes(graph: &Graph) -> [u32; 3] {
        let sides = best_cut(graph);
        assert_apart(graph, &sides);
        [SEPARATOR, 1, 2].map(|side| graph.weight_of(&sides, side))
    }

    #[test]
    fn a_box_is_cut_across_its_longest_side() {
        for n in [[40, 6, 5], [6, 40, 5], [12, 12, 30], [60, 3, 3]] {
            let [separator, a, b] = sizes(&grid(n));
            let mut sides = n;
            sides.sort_unstable();
            let smallest = sides[0] * sides[1];
            assert!(separator <= smallest, "{n:?}: {separator} nodes, {smallest} would do");
            assert!(2 * a.min(b) >= a.max(b), "{n:?}: halves of {a} and {b} nodes");
        }
    }

    /// Numbers of nodes in the factor of a graph that is eliminated in this order.
    fn fill(graph: &Graph, order: &[u32]) -> u32 {
        let mut rank = vec![0; order.len()];
        order.iter().enumerate().for_each(|(k, i)| rank[*i as usize] = k as u32);
        let parent = elimination_tree(graph, order, &rank);
        let neighbours = |k: u32| graph.neighbours(order[k as usize]).map(|j| rank[j as usize]);
        column_counts(&parent, &neighbours).iter().sum()
    }

    /// The nodes of a box of a grid.
    fn nodes(n: [u32; 3], from: [u32; 3], to: [u32; 3]) -> impl Iterator<Item = u32> {
        let lines = (from[2]..to[2]).flat_map(move |z| (from[1]..to[1]).map(move |y| n[0] * (y + n[1] * z)));
        lines.flat_map(move |line| (from[0]..to[0]).map(move |x| x + line))
    }

    /// George's order of a grid: planes across the longest side of a box, again and again.
    fn by_planes(n: [u32; 3], from: [u32; 3], to: [u32; 3], order: &mut Vec<u32>) {
        let longest = (0..3).max_by_key(|c| to[*c] - from[*c]).unwrap();
        if to[longest] - from[longest] < 3 {
            order.extend(nodes(n, from, to));
            return;
        }
        let middle = (from[longest] + to[longest]) / 2;
        let with = |mut corner: [u32; 3], at: u32| {
            corner[longest] = at;
            corner
        };
        by_planes(n, from, with(to, middle), order);
        by_planes(n, with(from, middle + 1), to, order);
        order.extend(nodes(n, with(from, middle), with(to, middle + 1)));
    }

    #[test]
    fn grids_fill_in_less_than_by_planes() {
        for (n, share) in [([15, 15, 15], 0.8), ([31, 15, 7], 0.8), ([40, 6, 5], 0.95)] {
            let graph = grid(n);
            let mut planes = Vec::new();
            by_planes(n, [0; 3], n, &mut planes);
            let [ours, planes] = [dissect(&graph), planes].map(|order| fill(&graph, &order));
            assert!(f64::from(ours) < share * f64::from(planes), "{n:?}: {ours} numbers, {planes} by planes");
        }
    }

    fn graph(nodes: usize, pairs: impl IntoIterator<Item = (u32, u32)>) -> Graph {
        Graph::new(&BlockMatrix::new(nodes, pairs.into_iter()))
    }

    /// A path of nodes from the first on.
    fn path(first: u32, nodes: u32) -> impl Iterator<Item = (u32, u32)> {
        (first + 1..first + nodes).map(|i| (i - 1, i))
    }

    #[test]
    fn any_graph_has_an_order() {
        let star = graph(200, (1..200).map(|i| (0, i)));
        let complete = graph(90, (0..90).flat_map(|i| (0..i).map(move |j| (i, j))));
        for graph in [star, complete, graph(300, path(0, 300)), graph(100, []), graph(1, []), graph(0, [])] {
            let mut order = dissect(&graph);
            order.sort_unstable();
            assert_eq!(order, graph.nodes().collect::<Vec<_>>());
        }
    }

    #[test]
    fn nodes_that_all_others_have_an_edge_to_come_last() {
        for hubs in [1, 60] {
            let graph = graph(2000, (hubs..2000).flat_map(|i| (0..hubs).map(move |hub| (hub, i))));
            let fill = fill(&graph, &dissect(&graph));
            let least = 2000 + (2000 - hubs) * hubs + hubs * (hubs - 1) / 2;
            assert!(fill <= least, "{hubs} hubs: {fill} numbers, {least} would do");
        }
    }

    #[test]
    fn pieces_are_cut_between_them_or_once() {
        for (pieces, most) in [(vec![100, 100], 0), (vec![100; 3], 1), (vec![70, 80, 150], 1), (vec![90; 4], 0)] {
            let first = |k: usize| pieces[..k].iter().sum::<u32>();
            let pairs = (0..pieces.len()).flat_map(|k| path(first(k), pieces[k]));
            let [separator, ..] = sizes(&graph(first(pieces.len()) as usize, pairs));
            assert!(separator <= most, "{pieces:?}: {separator} nodes");
        }
    }
}
