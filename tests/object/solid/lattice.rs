//! Contracts of the lattice: what holds whatever its size.

use super::*;
use haptize::object::Compliance;

fn strained(x: DVec3) -> DVec3 {
    1e-3 * DVec3::new(0.3 * x.x + 0.2 * x.y, 0.2 * x.x - 0.5 * x.y + 0.1 * x.z, x.z - 0.3 * x.x)
}

/// A box of squares of 10 mm, turned or not, on a bed; and its own energy under a displacement, without the bed's,
/// which grows in proportion to its stiffness (J).
struct Bedded([Object; 2]);

impl Bedded {
    fn new(counts: [i32; 3], edge: f64, material: Material, turn: DMat3, shift: DVec3) -> Self {
        Self([1.0, 2.0].map(|k| solid(block(counts, edge), material.clone(), bed(1e3 * k), turn, shift)))
    }

    fn energy(&self, u: impl Fn(DVec3) -> DVec3) -> f64 {
        2.0 * energy(&self.0[0], &u) - energy(&self.0[1], &u)
    }
}

/// Density of the elastic energy under [`strained`] (J/m^3).
fn density(poisson: f64) -> f64 {
    let gradient = DMat3::from_cols(strained(DVec3::X), strained(DVec3::Y), strained(DVec3::Z));
    let strain = 0.5 * (gradient + gradient.transpose());
    let trace = strain.x_axis.x + strain.y_axis.y + strain.z_axis.z;
    let squares: f64 = strain.to_cols_array().iter().map(|e| e * e).sum();
    let lambda = YOUNG * poisson / ((1.0 + poisson) * (1.0 - 2.0 * poisson));
    0.5 * lambda * trace * trace + YOUNG / (2.0 * (1.0 + poisson)) * squares
}

#[test]
fn a_uniform_strain_is_exact_and_leaves_the_inside_in_balance() {
    for poisson in [-0.5, 0.0, 0.3, 0.4999] {
        let bedded = Bedded::new([2, 3, 5], 0.02, elastic(poisson, Some(0.02)), DMat3::IDENTITY, DVec3::ZERO);
        let bar = &bedded.0[0];
        assert_eq!(bar.mechanics().unwrap().moved.len(), 5 * 7 * 11);
        let expected = density(poisson) * 0.04 * 0.06 * 0.1;
        assert!((bedded.energy(strained) / expected - 1.0).abs() < 1e-10, "nu {poisson}");
        let displacement: Vec<DVec3> = bar.mechanics().unwrap().moved.iter().map(|x| strained(*x)).collect();
        let inner = |x: DVec3| x.x.abs() < 0.019 && x.y.abs() < 0.029 && (0.001..0.099).contains(&x.z);
        let scale = bar.mechanics().unwrap().stiffness.norm() * 1e-4;
        let mut count = 0;
        for (node, x) in bar.mechanics().unwrap().moved.iter().enumerate().filter(|(_, x)| inner(**x)) {
            let force = bar.mechanics().unwrap().stiffness.force_on(node, &displacement);
            assert!(force.length() < 1e-10 * scale, "{force} at {x}, nu {poisson}");
            count += 1;
        }
        assert_eq!(count, 3 * 5 * 9);
    }
}

/// A body that the lattice does not fit: a box turned in it.
#[test]
fn cut_cubes_hold_as_much_as_lies_inside_and_rigid_motions_cost_nothing() {
    for poisson in [-0.5, 0.3, 0.499] {
        let material = elastic(poisson, Some(0.011));
        let turned = Bedded::new([5, 5, 4], 0.01, material, turned(), DVec3::new(0.001, 0.002, 0.003));
        let expected = density(poisson) * 0.05 * 0.05 * 0.04;
        let error = turned.energy(strained) / expected - 1.0;
        // Outside, 1e-4 of the material; lines see a slanted face up to some thousandths of a cube.
        assert!(error.abs() < 4e-3, "nu {poisson}: {error}");
        let rigid = |x: DVec3| DVec3::new(1e-4, 2e-4, -1e-4) + DVec3::new(1e-3, -2e-3, 3e-3).cross(x);
        assert!(turned.energy(rigid).abs() < 1e-12 * turned.energy(strained), "nu {poisson}");
    }
}

#[test]
fn every_admissible_ratio_of_poisson_is_positive_definite_anywhere_in_the_lattice() {
    for poisson in [-0.5, 0.0, 0.3, 0.45, 0.49, 0.499, 0.4999] {
        for shift in [0.0, 0.0031, 0.0077] {
            let shell = block([6, 6, 3], 0.0166);
            let material = elastic(poisson, Some(0.0166 + shift));
            solid(shell, material, clamped(0.02), turned(), DVec3::splat(shift));
        }
    }
}

#[test]
fn the_surface_follows_the_mean_over_its_own_area() {
    let ball = Shape::Icosphere { centre: DVec3::ZERO, radius: 0.05, divisions: 6 };
    let ball = Object::build(&spec(ball, elastic(0.3, None), bed(1e6))).unwrap();
    let areas = own_areas(&ball);
    let displacement: Vec<DVec3> = ball.mechanics().unwrap().moved.iter().map(|x| strained(*x)).collect();
    let (mut means, mut whole) = (vec![DVec3::ZERO; ball.surface_nodes], vec![0.0; ball.surface_nodes]);
    for triangle in &ball.triangles {
        let [a, b, c] = triangle.map(|node| ball.rest[node as usize]);
        let (to_b, to_c) = (b - a, c - a);
        let normal = to_b.cross(to_c);
        let centre = a
            + (to_c.length_squared() * normal.cross(to_b) + to_b.length_squared() * to_c.cross(normal))
                / (2.0 * normal.length_squared());
        for k in 0..3 {
            // What is nearer to a corner than to the others: two triangles, since none is obtuse.
            let [own, next, last] = [0, 1, 2].map(|j| [a, b, c][(k + j) % 3]);
            for middle in [own.midpoint(next), own.midpoint(last)] {
                let area = 0.5 * (middle - own).cross(centre - own).length();
                means[triangle[k] as usize] += area / 3.0 * (own + middle + centre);
                whole[triangle[k] as usize] += area;
            }
        }
    }
    for node in 0..ball.surface_nodes {
        let sum: f64 = ball.mechanics().unwrap().attachment.row(node).iter().map(|(_, weight)| weight).sum();
        assert!((sum - 1.0).abs() < 1e-12, "a shift moves every node alike: {sum}");
        let expected = strained(means[node] / whole[node]);
        assert!(
            (ball.mechanics().unwrap().attachment.follow(node, &displacement) - expected).length() < 1e-15,
            "node {node}"
        );
        assert!(areas[node].dot(ball.rest[node]) > 0.0);
    }
    let compliance = Compliance::new(&ball);
    let (i, j) = (5, 200);
    let force = DVec3::new(0.3, -0.2, 0.5);
    let mut forces = vec![DVec3::ZERO; ball.rest.len()];
    forces[j] = force;
    let follower = displaced(&ball, &forces)[i];
    assert!((compliance.block(i, j) * force - follower).length() < 1e-12 * follower.length());
}

/// A clamped bar under a shear force on its end, against beam theory with shear (Timoshenko).
#[test]
fn a_cantilever_bends_as_beam_theory_says() {
    let (width, length, load, poisson) = (0.04_f64, 0.2_f64, 0.1, 0.0);
    for cell in [0.02, 0.01] {
        let bar =
            solid(block([8, 8, 40], 0.005), elastic(poisson, Some(cell)), clamped(1e-6), DMat3::IDENTITY, DVec3::ZERO);
        let areas = own_areas(&bar);
        let end: Vec<usize> =
            (0..bar.surface_nodes).filter(|&node| areas[node].z > 0.0 && bar.rest[node].z > 0.1).collect();
        let area: f64 = end.iter().map(|&node| areas[node].z).sum();
        let mut forces = vec![DVec3::ZERO; bar.rest.len()];
        end.iter().for_each(|&node| forces[node].x = load * areas[node].z / area);
        let u = displaced(&bar, &forces);
        let deflection = end.iter().map(|&node| u[node].x * areas[node].z / area).sum::<f64>();
        let bending = load * length.powi(3) / (3.0 * YOUNG * width.powi(4) / 12.0);
        let shear = load * length / (5.0 / 6.0 * YOUNG / (2.0 * (1.0 + poisson)) * width * width);
        let error = deflection / (bending + shear) - 1.0;
        assert!(error.abs() < 0.01, "{error} with cells of {cell} m");
    }
}

/// Mass and damping of a body do not depend on its lattice, and every node carries some.
#[test]
fn nodes_share_the_mass_of_the_surface() {
    for cell in [0.03, 0.013] {
        let body = solid(block([4, 4, 4], 0.02), elastic(0.3, Some(cell)), bed(1e6), turned(), DVec3::ZERO);
        assert!(
            body.mechanics().unwrap().mass.iter().chain(&body.mechanics().unwrap().damping).all(|part| *part > 0.0)
        );
        assert!(
            (body.mechanics().unwrap().mass.iter().sum::<f64>() / (0.01 * body.rest.len() as f64) - 1.0).abs() < 1e-12
        );
        assert!(
            (body.mechanics().unwrap().damping.iter().sum::<f64>() / (0.1 * body.rest.len() as f64) - 1.0).abs()
                < 1e-12
        );
    }
}

/// Springs per area belong to the body: a finer surface changes nothing. Those per node do, as the name says.
#[test]
fn ground_per_area_and_per_volume_does_not_depend_on_the_mesh() {
    let height = 0.012;
    let energy_of = |edge: f64, count: i32, stiffness: GroundStiffness| {
        let ground = GroundSpec { stiffness, nodes: GroundNodes::Below(height) };
        let body =
            solid(block([count, count, count], edge), elastic(0.3, Some(0.007)), ground, DMat3::IDENTITY, DVec3::ZERO);
        energy(&body, |_| DVec3::X)
    };
    let (area, volume) = (0.04 * 0.04 + 4.0 * 0.04 * height, 0.04 * 0.04 * height);
    for (stiffness, expected) in
        [(GroundStiffness::PerArea(1e6), 0.5e6 * area), (GroundStiffness::PerVolume(1e9), 0.5e9 * volume)]
    {
        for (edge, count) in [(0.02, 2), (0.005, 8)] {
            let error = energy_of(edge, count, stiffness) / expected - 1.0;
            assert!(error.abs() < 0.02, "{stiffness:?}: {error}");
        }
    }
    let per_node = |edge, count| energy_of(edge, count, GroundStiffness::PerNode(10.0));
    assert!(per_node(0.005, 8) > 5.0 * per_node(0.02, 2));
}

/// A body of 40 m, drawn in millimetres, of which cubes of some millimetres were meant: nothing is laid on its surface
/// before they are counted, which would take all memory.
#[test]
fn cubes_are_counted_before_the_surface_is_looked_at() {
    let (nodes, triangles) = block([2, 2, 2], 20.0);
    let shape = Shape::Mesh { file: "body".into(), placement: Placement::METRES, refine: None };
    let ground = bed(1e3);
    let refused = Object::from_surface(&spec(shape, elastic(0.3, Some(0.004)), ground), nodes, triangles);
    let why = refused.err().unwrap().to_string();
    assert!(why.contains("cubes") && why.contains("millimetres"), "{why}");
}
