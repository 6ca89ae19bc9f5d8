//! Graph colouring: vertices of one colour share no element, so their steps do not see each other.

/// Colours nodes greedily, those with most neighbours first (ties by index): each gets the lowest
/// colour that none of its neighbours has. `neighbours[i]` lists the nodes that share an element
/// with node i. Nodes that are `left_out` get no colour and do not affect the others. Returns the
/// colour of each node and the number of colours.
pub(crate) fn color(neighbours: &[Vec<u32>], left_out: &[bool]) -> (Vec<u32>, usize) {
    let mut order: Vec<u32> = (0..neighbours.len() as u32).filter(|i| !left_out[*i as usize]).collect();
    let others = |i: usize| neighbours[i].iter().filter(|j| !left_out[**j as usize]).count();
    order.sort_by_cached_key(|i| (std::cmp::Reverse(others(*i as usize)), *i));
    let mut colors = vec![u32::MAX; neighbours.len()];
    let mut taken: Vec<u32> = Vec::new();
    let mut count = 0;
    for i in order {
        // `taken[c] == i` marks colour c as that of a neighbour. Nothing needs to be cleared
        // between nodes.
        for j in &neighbours[i as usize] {
            if let Some(t) = taken.get_mut(colors[*j as usize] as usize) {
                *t = i;
            }
        }
        let free = taken.iter().position(|t| *t != i).unwrap_or(taken.len());
        if free == taken.len() {
            taken.push(u32::MAX);
        }
        colors[i as usize] = free as u32;
        count = count.max(free + 1);
    }
    (colors, count)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn neighbours_differ() {
        // A ring of 9 with chords.
        let neighbours: Vec<Vec<u32>> =
            (0..9u32).map(|i| vec![(i + 1) % 9, (i + 8) % 9, (i + 3) % 9, (i + 6) % 9]).collect();
        let (colors, count) = color(&neighbours, &[false; 9]);
        for (i, list) in neighbours.iter().enumerate() {
            assert!(list.iter().all(|j| colors[*j as usize] != colors[i]));
        }
        assert!(count <= 5);
    }
}
