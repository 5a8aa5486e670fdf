//! In which order a factorisation takes the nodes: nested dissection by their positions.
//!
//! A plane parts the nodes; those on one side of it that have a neighbour on the other separate the two sides and come
//! last, after both, each ordered in the same way (George, Nested dissection of a regular finite element mesh, 1973).
//! Eliminating a node then fills in only what its own part and the separators around it hold: O(N log N) entries of the
//! factor on a surface, O(N^(4/3)) in a solid. Meshes of points in space dissect better by geometry than by minimum
//! degree on the graph, and faster.
//!
//! Of all planes across the three axes that one is taken for which s^(3/2) / (a b) is least, s being the size of the
//! separator and a and b those of the parts. In a solid s^(3/2) grows as the smaller part does, so that no place is
//! preferred for its size alone. A separator lies between the cubes of a lattice, and beside a region of small ones rather
//! than through it.

use super::Stiffness;
use glam::DVec3;

/// Parts of at most as many nodes are not cut any further: within them fill hardly depends on the order.
const SMALLEST_PART: usize = 8;

/// Number of no layer.
const ABSENT: usize = usize::MAX;

/// All nodes of `stiffness`, first to be eliminated first; `positions` of each (m).
pub(super) fn nested_dissection(stiffness: &Stiffness, positions: &[DVec3]) -> Vec<u32> {
    let mut ordered = Vec::with_capacity(positions.len());
    let mut layers = vec![ABSENT; positions.len()];
    dissect(stiffness, positions, (0..positions.len() as u32).collect(), &mut layers, &mut ordered);
    ordered
}

/// A plane between two layers of nodes, and the side of it on which those that touch the other side separate the two.
struct Cut {
    /// It is across this axis.
    axis: usize,
    /// The first place above it (m).
    above: f64,
    /// Whether the separator is below it.
    is_below: bool,
    /// What the least of is best (1).
    cost: f64,
}

/// Appends `nodes` in their order. `layers` are absent for all nodes, before and after.
fn dissect(stiffness: &Stiffness, positions: &[DVec3], nodes: Vec<u32>, layers: &mut [usize], ordered: &mut Vec<u32>) {
    let cuts = |axis| cuts(stiffness, positions, &nodes, axis, layers);
    let axes = if nodes.len() > SMALLEST_PART { 0..3 } else { 0..0 };
    let Some(cut) = axes.flat_map(cuts).min_by(|a, b| a.cost.total_cmp(&b.cost)) else {
        ordered.extend(nodes);
        return;
    };
    let is_below = |node: usize| positions[node][cut.axis] < cut.above;
    nodes.iter().for_each(|&node| layers[node as usize] = usize::from(is_below(node as usize)));
    let other_side = usize::from(!cut.is_below);
    let separates = |node: u32| {
        let mut around = stiffness.row(node as usize).map(|(other, _)| layers[other]);
        is_below(node as usize) == cut.is_below && around.any(|side| side == other_side)
    };
    let (separator, rest): (Vec<u32>, Vec<u32>) = nodes.iter().partition(|node| separates(**node));
    nodes.iter().for_each(|&node| layers[node as usize] = ABSENT);
    let (below, above) = rest.into_iter().partition(|&node| is_below(node as usize));
    for part in [below, above] {
        dissect(stiffness, positions, part, layers, ordered);
    }
    ordered.extend(separator);
}

/// All cuts of `nodes` across `axis`. `layers` are absent for all nodes, before and after.
fn cuts(stiffness: &Stiffness, positions: &[DVec3], nodes: &[u32], axis: usize, layers: &mut [usize]) -> Vec<Cut> {
    let place = |node: &u32| positions[*node as usize][axis];
    let mut places: Vec<f64> = nodes.iter().map(place).collect();
    places.sort_unstable_by(f64::total_cmp);
    places.dedup();
    nodes.iter().for_each(|node| layers[*node as usize] = places.partition_point(|other| *other < place(node)));
    // By how much these numbers change from each cut to the next: nodes below it, and those of either separator.
    let mut changes = vec![[0_isize; 3]; places.len() + 1];
    for &node in nodes {
        let own = layers[node as usize];
        let around = stiffness.row(node as usize).map(|(other, _)| layers[other]).filter(|layer| *layer != ABSENT);
        let [least, most] = around.fold([own; 2], |[least, most], layer| [least.min(layer), most.max(layer)]);
        for (cut, number, change) in [(own, 0, 1), (own, 1, 1), (most, 1, -1), (least, 2, 1), (own, 2, -1)] {
            changes[cut + 1][number] += change;
        }
    }
    nodes.iter().for_each(|node| layers[*node as usize] = ABSENT);
    let (mut below, mut separators) = (0, [0; 2]);
    let mut cuts = Vec::new();
    for (&above, [more, others @ ..]) in places.iter().zip(changes).skip(1) {
        below += more;
        for (k, is_below) in [true, false].into_iter().enumerate() {
            separators[k] += others[k];
            let side = if is_below { below } else { nodes.len() as isize - below };
            let [separator, one, other] =
                [separators[k], side - separators[k], nodes.len() as isize - side].map(|count| count as f64);
            cuts.push(Cut { axis, above, is_below, cost: separator.powf(1.5) / (one * other) });
        }
    }
    cuts
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
        assert!(last.iter().all(|&node| positions[node as usize].x == 4.0), "not between two cubes: {last:?}");
    }

    /// A large and a small block, joined by one node that lies far from the median.
    #[test]
    fn a_narrow_place_separates_rather_than_the_median() {
        let is_there = |[x, y, z]: [u32; 3]| x != 9 || y == 2 && z == 2;
        let all = (0..13 * 25).map(|k| [k / 25, k / 5 % 5, k % 5]).filter(|at| is_there(*at));
        let positions: Vec<DVec3> = all.map(|at| DVec3::from_array(at.map(f64::from))).collect();
        let count = positions.len() as u32;
        let pairs = (0..count).flat_map(|a| (0..a).map(move |b| [a, b]));
        let edges: Vec<[u32; 2]> =
            pairs.filter(|pair| positions[pair[0] as usize].distance(positions[pair[1] as usize]) < 1.5).collect();
        let ordered = nested_dissection(&Stiffness::with_pattern(positions.len(), &edges), &positions);
        assert_eq!(positions[ordered[ordered.len() - 1] as usize], DVec3::new(9.0, 2.0, 2.0));
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
