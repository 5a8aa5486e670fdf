//! Hexahedra, prisms and pyramids of Gmsh, of first and second order, which are divided into tetrahedra.

use super::accuracy::{compliance, reference};
use super::*;
use std::collections::HashMap;
use std::fmt::Write;

/// Gmsh's order of nodes: its types of first order, of second order without and with nodes in faces; the corners' edges,
/// and its faces of four corners.
pub struct Cell {
    pub kinds: [u64; 3],
    pub corners: usize,
    pub edges: &'static [[usize; 2]],
    pub squares: &'static [[usize; 4]],
}

pub const HEXAHEDRON: Cell = Cell {
    kinds: [5, 17, 12],
    corners: 8,
    edges: &[[0, 1], [0, 3], [0, 4], [1, 2], [1, 5], [2, 3], [2, 6], [3, 7], [4, 5], [4, 7], [5, 6], [6, 7]],
    squares: &[[0, 1, 2, 3], [0, 1, 5, 4], [0, 3, 7, 4], [1, 2, 6, 5], [2, 3, 7, 6], [4, 5, 6, 7]],
};

pub const PRISM: Cell = Cell {
    kinds: [6, 18, 13],
    corners: 6,
    edges: &[[0, 1], [0, 2], [0, 3], [1, 2], [1, 4], [2, 5], [3, 4], [3, 5], [4, 5]],
    squares: &[[0, 1, 4, 3], [0, 2, 5, 3], [1, 2, 5, 4]],
};

pub const PYRAMID: Cell = Cell {
    kinds: [7, 19, 14],
    corners: 5,
    edges: &[[0, 1], [0, 3], [0, 4], [1, 2], [1, 4], [2, 3], [2, 4], [3, 4]],
    squares: &[[0, 1, 2, 3]],
};

pub const TETRAHEDRON: Cell =
    Cell { kinds: [4, 11, 11], corners: 4, edges: &[[0, 1], [1, 2], [0, 2], [0, 3], [2, 3], [1, 3]], squares: &[] };

/// The cells that fill a cube, as its corners in Gmsh's order; 8 is its middle. Half of the pyramids are inside out.
fn in_cube(cell: &Cell) -> Vec<Vec<usize>> {
    match cell.corners {
        8 => vec![(0..8).collect()],
        6 => vec![vec![0, 1, 2, 4, 5, 6], vec![0, 2, 3, 4, 6, 7]],
        4 => [[1, 2], [2, 3], [3, 7], [7, 4], [4, 5], [5, 1]].map(|[a, b]| vec![0, a, b, 6]).into(),
        _ => HEXAHEDRON.squares.iter().map(|square| [&square[..], &[8]].concat()).collect(),
    }
}

/// A file of cells of type `kinds[order]`, as [`mesh`] makes them, their numbers out of order.
pub fn msh(cell: &Cell, order: usize, counts: [i32; 3], place: impl Fn(DVec3) -> DVec3) -> String {
    let (places, elements) = mesh(cell, order, counts, place);
    let elements: Vec<(u32, Vec<usize>)> = elements.into_iter().map(|nodes| (1, nodes)).collect();
    written(cell.kinds[order], &places, &elements)
}

/// Nodes (m) and cells of an `order` in `counts` cubes; `place` puts the nodes from [0, 1]^3 in space.
pub fn mesh(
    cell: &Cell,
    order: usize,
    counts: [i32; 3],
    place: impl Fn(DVec3) -> DVec3,
) -> (Vec<DVec3>, Vec<Vec<usize>>) {
    let corner = |k: usize| match k {
        8 => [2, 2, 2],
        k => [[0, 1, 1, 0][k % 4], [0, 0, 1, 1][k % 4], k as i32 / 4].map(|i| 4 * i),
    };
    let mut numbers: HashMap<[i32; 3], usize> = HashMap::new();
    let mut elements = Vec::new();
    for cube in
        (0..counts.iter().product()).map(|k| [k / (counts[1] * counts[2]), k / counts[2] % counts[1], k % counts[2]])
    {
        for corners in in_cube(cell) {
            let at: Vec<[i32; 3]> =
                corners.iter().map(|&k| [0, 1, 2].map(|axis| 4 * cube[axis] + corner(k)[axis])).collect();
            let mean =
                |of: &[usize]| [0, 1, 2].map(|axis| of.iter().map(|&k| at[k][axis]).sum::<i32>() / of.len() as i32);
            let mut nodes = at.clone();
            if order > 0 {
                nodes.extend(cell.edges.iter().map(|edge| mean(edge)));
            }
            if order > 1 {
                nodes.extend(cell.squares.iter().map(|square| mean(square)));
                nodes.extend((cell.corners == 8).then(|| mean(&[0, 1, 2, 3, 4, 5, 6, 7])));
            }
            let mut number = |node| {
                let next = numbers.len();
                *numbers.entry(node).or_insert(next)
            };
            elements.push(nodes.into_iter().map(&mut number).collect::<Vec<_>>());
        }
    }
    let mut places = vec![DVec3::ZERO; numbers.len()];
    for (at, number) in numbers {
        let at = DVec3::from_array([0, 1, 2].map(|axis| f64::from(at[axis]) / f64::from(4 * counts[axis])));
        places[number] = place(at);
    }
    (places, elements)
}

/// A file of elements of type `kind`, each with its physical volume, between nodes at `places` (m), whose numbers are
/// out of order.
pub fn written(kind: u64, places: &[DVec3], elements: &[(u32, Vec<usize>)]) -> String {
    // A permutation: a prime that the count is no multiple of.
    let tag = |number: usize| 1 + number * 7919 % places.len();
    assert!(!places.len().is_multiple_of(7919));
    let mut text = format!("$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n{}\n", places.len());
    let mut listed: Vec<(usize, DVec3)> = places.iter().enumerate().map(|(number, x)| (tag(number), *x)).collect();
    listed.sort_by_key(|(tag, _)| *tag);
    listed.iter().for_each(|(tag, x)| writeln!(text, "{tag} {} {} {}", x.x, x.y, x.z).unwrap());
    write!(text, "$EndNodes\n$Elements\n{}\n", elements.len()).unwrap();
    for (number, (region, nodes)) in elements.iter().enumerate() {
        write!(text, "{} {kind} 2 {region} {region}", number + 1).unwrap();
        nodes.iter().for_each(|node| write!(text, " {}", tag(*node)).unwrap());
        text.push('\n');
    }
    text + "$EndElements\n"
}

pub fn build(content: &str, material: Material, ground: GroundSpec) -> Object {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("cells.msh");
    std::fs::write(&file, content).unwrap();
    Object::build(&spec(Shape::Tetrahedra { file, placement: Placement::METRES }, material, ground)).unwrap()
}

/// A box of 0.2 m whose middle is drawn aside: its sides stay flat, or are bent.
pub fn skewed(at: DVec3, is_bent: bool) -> DVec3 {
    let bubble: f64 = at.to_array().iter().map(|x| 4.0 * x * (1.0 - x)).product();
    let bend =
        if is_bent { DVec3::new(0.05 * at.z * at.z, 0.03 * at.x * at.z, -0.04 * at.x * at.x) } else { DVec3::ZERO };
    0.2 * at + bubble * DVec3::new(0.02, -0.03, 0.01) + bend
}

/// The patch test: a uniform strain is met exactly, and leaves the inside in balance.
#[test]
fn a_uniform_strain_is_exact_in_cells_of_every_type() {
    let strain = |x: DVec3| 1e-3 * DVec3::new(0.3 * x.x + 0.2 * x.y, 0.1 * x.z - 0.5 * x.y, x.z - 0.3 * x.x);
    let ground = || GroundSpec { stiffness: GroundStiffness::PerArea(1e3), nodes: GroundNodes::Below(1e-3) };
    for cell in [HEXAHEDRON, PRISM, PYRAMID] {
        for (order, is_bent) in [(0, false), (1, false), (2, false), (1, true), (2, true)] {
            let object = build(&msh(&cell, order, [2, 2, 2], |at| skewed(at, is_bent)), elastic(0.3, None), ground());
            let mechanics = object.mechanics().unwrap();
            let displacement: Vec<DVec3> = mechanics.moved.iter().map(|x| strain(*x)).collect();
            let on_surface = |x: DVec3| object.rest[..object.surface_nodes].iter().any(|node| node.distance(x) < 1e-9);
            // Nodes of straight edges lie on the surface, but are not the surface's.
            let is_inner = |x: DVec3| {
                !on_surface(x)
                    && (order > 0 || x.cmpgt(DVec3::splat(1e-9)).all() && x.cmplt(DVec3::splat(0.2 - 1e-9)).all())
            };
            let inner: Vec<usize> =
                (0..mechanics.moved.len()).filter(|&node| is_inner(mechanics.moved[node])).collect();
            assert!(inner.len() > 26, "{}", inner.len());
            let scale = mechanics.stiffness.norm() * 1e-4;
            for node in inner {
                let force = mechanics.stiffness.force_on(node, &displacement);
                assert!(force.length() < 1e-10 * scale, "{force} at {}", mechanics.moved[node]);
            }
            let volume: f64 = object
                .triangles
                .iter()
                .map(|triangle| {
                    let [a, b, c] = triangle.map(|node| object.rest[node as usize]);
                    a.dot(b.cross(c)) / 6.0
                })
                .sum();
            println!("type {}: {} tetrahedra, {volume:.6} m^3", cell.kinds[order], object.tetrahedra.len());
            // int det(d skewed / d at), to the facets of a curved surface.
            let (expected, bound) = if is_bent { (8.4e-3, 0.01) } else { (8e-3, 1e-12) };
            assert!((volume / expected - 1.0).abs() < bound, "{volume}");
        }
    }
}

/// The block of the references in cells that grow away from the pressure, and are drawn aside inside.
fn graded(at: DVec3) -> DVec3 {
    let across = |x: f64| 0.05 * (2.0 * x - 1.0).signum() * (2.0 * x - 1.0).abs().powf(1.8);
    let wave = |x: f64| (std::f64::consts::PI * x).sin();
    let aside = 0.004 * wave(at.x) * wave(at.y) * wave(at.z) * wave(2.0 * at.z + 0.3);
    DVec3::new(across(at.x), across(at.y), 0.05 * (1.0 - (1.0 - at.z).powf(1.6))) + aside * DVec3::new(1.0, -0.7, 0.5)
}

/// Against the same nodes in tetrahedra around one diagonal of each cube: the difference is what another division makes.
#[test]
fn a_block_of_distorted_cells_gives_way_as_tetrahedra_of_the_same_nodes_do() {
    let poisson = 0.49;
    let found = |cell: &Cell| {
        let block = build(&msh(cell, 0, [12, 12, 6], graded), elastic(poisson, None), clamped(1e-6));
        let found = compliance(&block, 0.05 * DVec3::Z, DVec3::Z);
        let error = found / reference("block", poisson) - 1.0;
        println!("type {}: {error:.4} from the converged", cell.kinds[0]);
        found
    };
    let expected = found(&TETRAHEDRON);
    for cell in [HEXAHEDRON, PRISM] {
        let error = found(&cell) / expected - 1.0;
        assert!(error.abs() < 0.03, "type {}: {error}", cell.kinds[0]);
    }
}
