//! In which order a factorisation takes the nodes: nested dissection by their positions.
//!
//! The nodes are halved near the median along the longest side of their box; the nodes of one half that have a
//! neighbour in the other separate the two and come last, after both halves, each ordered in the same way (George,
//! Nested dissection of a regular finite element mesh, 1973). Eliminating a node then fills in only what its own part
//! and the separators around it hold: O(N log N) entries of the factor on a surface, O(N^(4/3)) in a solid. Meshes of
//! points in space dissect better by geometry than by minimum degree on the graph, and faster.
//!
//! Nodes of a lattice lie in layers. A cut between two layers bounds the cubes on one of its sides: there one layer
//! separates the halves, on the other two, which makes twice the entries. So the smaller of both separators is taken.

use super::Stiffness;
use glam::DVec3;

/// Parts of at most as many nodes are not cut any further: within them fill hardly depends on the order.
const SMALLEST_PART: usize = 8;

/// All nodes of `stiffness`, first to be eliminated first; `positions` of each (m).
pub(super) fn nested_dissection(stiffness: &Stiffness, positions: &[DVec3]) -> Vec<u32> {
    let mut nodes: Vec<u32> = (0..positions.len() as u32).collect();
    let mut ordered = Vec::with_capacity(nodes.len());
    let mut side = vec![false; nodes.len()];
    dissect(stiffness, positions, &mut nodes, &mut side, &mut ordered);
    ordered
}

/// Appends `nodes` in their order. `side` is false for all nodes, before and after.
fn dissect(stiffness: &Stiffness, positions: &[DVec3], nodes: &mut [u32], side: &mut [bool], ordered: &mut Vec<u32>) {
    if nodes.len() <= SMALLEST_PART {
        ordered.extend_from_slice(nodes);
        return;
    }
    let place = |node: u32| positions[node as usize];
    let low = nodes.iter().map(|&node| place(node)).fold(DVec3::INFINITY, DVec3::min);
    let high = nodes.iter().map(|&node| place(node)).fold(DVec3::NEG_INFINITY, DVec3::max);
    let axis = (high - low).max_position();
    nodes.sort_unstable_by(|&a, &b| place(a)[axis].total_cmp(&place(b)[axis]).then(a.cmp(&b)));
    let middle = nodes.len() / 2;
    let is_between_layers = |cut: &usize| place(nodes[*cut])[axis] > place(nodes[cut - 1])[axis];
    let cut = (1..=middle).rev().find(is_between_layers).unwrap_or(middle);
    let (left, right) = nodes.split_at(cut);
    let mut separate = |[part, other]: [&[u32]; 2]| {
        other.iter().for_each(|&node| side[node as usize] = true);
        let touches = |node: u32| stiffness.row(node as usize).any(|(neighbour, _)| side[neighbour]);
        let (separator, inner): (Vec<u32>, Vec<u32>) = part.iter().partition(|node| touches(**node));
        other.iter().for_each(|&node| side[node as usize] = false);
        (separator, [inner, other.to_vec()])
    };
    let ways = [[left, right], [right, left]].map(&mut separate);
    let best = ways.into_iter().min_by_key(|(separator, _)| separator.len());
    if let Some((mut separator, parts)) = best {
        for mut part in parts {
            dissect(stiffness, positions, &mut part, side, ordered);
        }
        separator.sort_unstable();
        ordered.append(&mut separator);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A lattice of n x n x n nodes, each joined to its six neighbours.
    fn lattice(n: u32) -> (Stiffness, Vec<DVec3>) {
        let number = |x: u32, y: u32, z: u32| (x * n + y) * n + z;
        let (mut edges, mut positions) = (Vec::new(), Vec::new());
        for x in 0..n {
            for y in 0..n {
                for z in 0..n {
                    positions.push(DVec3::new(f64::from(x), f64::from(y), f64::from(z)));
                    let far = [(x + 1, y, z), (x, y + 1, z), (x, y, z + 1)];
                    let inside = far.into_iter().filter(|&(x, y, z)| x.max(y).max(z) < n);
                    edges.extend(inside.map(|(a, b, c)| [number(x, y, z), number(a, b, c)]));
                }
            }
        }
        (Stiffness::with_pattern(positions.len(), &edges), positions)
    }

    #[test]
    fn every_node_comes_once() {
        let (stiffness, positions) = lattice(7);
        let mut ordered = nested_dissection(&stiffness, &positions);
        ordered.sort_unstable();
        assert!(ordered.into_iter().eq(0..343));
        assert!(nested_dissection(&Stiffness::with_pattern::<[u32; 2]>(0, &[]), &[]).is_empty());
    }

    /// Fill of an elimination in the order given: entries of the factor, counted on the graph.
    fn fill(stiffness: &Stiffness, order: &[u32]) -> usize {
        let mut rank = vec![0; order.len()];
        order.iter().enumerate().for_each(|(k, &node)| rank[node as usize] = k);
        let mut columns: Vec<std::collections::BTreeSet<usize>> = vec![Default::default(); order.len()];
        let mut entries = 0;
        for (k, &node) in order.iter().enumerate() {
            let neighbours = stiffness.row(node as usize).map(|(other, _)| rank[other]).filter(|&other| other > k);
            let mut column = std::mem::take(&mut columns[k]);
            column.extend(neighbours);
            entries += 1 + column.len();
            if let Some(&parent) = column.first() {
                columns[parent].extend(column.into_iter().skip(1));
            }
        }
        entries
    }

    /// Elements of 27 nodes, which couple all of their nodes: a cut through them would take two layers.
    #[test]
    fn elements_are_separated_by_one_layer_of_nodes() {
        let n = 9;
        let node = |at: [u32; 3]| (at[0] * n + at[1]) * n + at[2];
        let cube = |k: u32| [k / 16, k / 4 % 4, k % 4].map(|i| 2 * i);
        let offsets = |k: u32| [k / 9, k / 3 % 3, k % 3];
        let cubes: Vec<Vec<u32>> = (0..64)
            .map(|k| (0..27).map(|a| node([0, 1, 2].map(|axis| cube(k)[axis] + offsets(a)[axis]))).collect())
            .collect();
        let positions: Vec<DVec3> = (0..n * n * n)
            .map(|k| DVec3::new(f64::from(k / (n * n)), f64::from(k / n % n), f64::from(k % n)))
            .collect();
        let ordered = nested_dissection(&Stiffness::with_pattern(positions.len(), &cubes), &positions);
        let last = &ordered[ordered.len() - 81..];
        assert!(last.iter().all(|&node| positions[node as usize].x == positions[last[0] as usize].x), "{last:?}");
    }

    #[test]
    fn dissection_fills_in_far_less_than_the_nodes_order() {
        let (stiffness, positions) = lattice(12);
        let natural: Vec<u32> = (0..1728).collect();
        let (dissected, natural) =
            (fill(&stiffness, &nested_dissection(&stiffness, &positions)), fill(&stiffness, &natural));
        assert!(2 * dissected < natural, "{dissected} entries against {natural}");
    }
}
