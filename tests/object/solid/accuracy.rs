//! Compliance under a pressure as contact has it, against converged solutions (`tests/references/solids.csv`).

use super::*;

/// Radius of the pressure (m).
const RADIUS: f64 = 0.01;

/// The converged compliance of `body` (m/N).
pub fn reference(body: &str, poisson: f64) -> f64 {
    let text = include_str!("../../references/solids.csv");
    let row = text.lines().find(|line| line.starts_with(&format!("{body},{poisson},"))).unwrap();
    row.rsplit(',').next().unwrap().parse().unwrap()
}

/// Mean displacement under the pressure `3/(pi a^2) (1 - r^2/a^2)^2` around `middle` along `-up`, over its force (m/N).
pub fn compliance(object: &Object, middle: DVec3, up: DVec3) -> f64 {
    let areas = own_areas(object);
    let mut forces = vec![DVec3::ZERO; object.rest.len()];
    for (node, area) in areas.iter().enumerate() {
        let across = object.rest[node] - middle;
        let squared = (across - up * across.dot(up)).length_squared() / (RADIUS * RADIUS);
        if squared < 1.0 && across.length() < 2.0 * RADIUS {
            forces[node] = -up * (1.0 - squared).powi(2) * area.dot(up);
        }
    }
    let force: f64 = forces.iter().map(|force| force.length()).sum();
    let u = displaced(object, &forces);
    forces.iter().zip(&u).map(|(force, u)| force.dot(*u)).sum::<f64>() / (force * force)
}

/// Squares of the surface of a block: a quarter of the radius of contact (m).
const SQUARE: f64 = 0.0025;

/// The block of the references, in squares.
const BLOCK: [i32; 3] = [40, 40, 20];

/// A block of `squares` on a side, pressed in the middle of its top.
fn pressed_block(squares: [i32; 3], (poisson, cell): (f64, Option<f64>), ground: GroundSpec, turn: DMat3) -> f64 {
    let block = solid(block(squares, SQUARE), elastic(poisson, cell), ground, turn, DVec3::ZERO);
    compliance(&block, turn * DVec3::Z * (f64::from(squares[2]) * SQUARE), turn * DVec3::Z)
}

pub const RATIOS: [f64; 4] = [0.3, 0.45, 0.49, 0.499];

/// The ratios between are those of the ball that presses a block of the same size.
#[test]
fn a_block_gives_way_as_converged_solutions_do_whatever_the_ratio_of_poisson() {
    for poisson in [RATIOS[0], RATIOS[3]] {
        let found = pressed_block(BLOCK, (poisson, None), clamped(1e-6), DMat3::IDENTITY);
        let error = found / reference("block", poisson) - 1.0;
        println!("block, nu {poisson}: {error:.4}");
        assert!(error.abs() < 0.03, "nu {poisson}: {error}");
    }
}

#[test]
fn a_ball_on_springs_per_volume_gives_way_as_the_axisymmetric_solution_does() {
    let ground = GroundSpec { stiffness: GroundStiffness::PerVolume(4e9), nodes: GroundNodes::Below(-0.035) };
    for poisson in RATIOS {
        let shape = Shape::Icosphere { centre: DVec3::ZERO, radius: 0.05, divisions: 18 };
        let ball = Object::build(&spec(shape, elastic(poisson, None), ground.clone())).unwrap();
        let error = compliance(&ball, DVec3::Z * 0.05, DVec3::Z) / reference("sphere", poisson) - 1.0;
        println!("sphere, nu {poisson}: {error:.4}");
        assert!(error.abs() < 0.03, "nu {poisson}: {error}");
    }
}

/// Where the lattice lies does not matter: other sizes of cubes shift all of them against the block, or it is turned.
#[test]
fn offsets_and_turns_of_the_lattice_change_compliance_by_less_than_two_percent() {
    let on_bed = |squares, cell, turn| {
        let (nodes, _) = block(squares, SQUARE);
        let under = (0..).zip(&nodes).filter(|(_, node)| node.z < 1e-6).map(|(node, _)| node).collect();
        let bed = GroundSpec { stiffness: GroundStiffness::PerArea(1e8), nodes: GroundNodes::Listed(under) };
        pressed_block(squares, (0.45, cell), bed, turn)
    };
    let error = on_bed(BLOCK, None, DMat3::IDENTITY) / reference("bed", 0.45) - 1.0;
    assert!(error.abs() < 0.03, "{error}");
    // On a smaller block: lattices are compared with each other.
    let compliance = |cell, turn| on_bed([24, 24, 12], cell, turn);
    let aligned = compliance(None, DMat3::IDENTITY);
    for cell in [0.0063, 0.0065, 0.0067, 0.0069, 0.0071, 0.0073] {
        let error = compliance(Some(cell), DMat3::IDENTITY) / aligned - 1.0;
        println!("cells of {cell} m: {error:.4}");
        assert!(error.abs() < 0.02, "cells of {cell} m: {error}");
    }
    for (axis, degrees) in [(DVec3::ONE, 30.0), (DVec3::new(1.0, 2.0, 0.0), 17.0), (DVec3::Z, 40.0)] {
        let turn = DMat3::from_axis_angle(axis.normalize(), f64::to_radians(degrees));
        let error = compliance(None, turn) / aligned - 1.0;
        println!("turned by {degrees} degrees: {error:.4}");
        assert!(error.abs() < 0.02, "turned by {degrees} degrees around {axis}: {error}");
    }
}

/// What is stated of a lattice, against one of half the size: up to a quarter less, and not ten times as much.
#[test]
fn the_error_that_is_stated_of_a_lattice_is_what_finer_cubes_change() {
    for (poisson, cell) in [(0.3, 0.015), (0.45, 0.01), (0.49, 0.015)] {
        let [found, finer] = [cell, 0.5 * cell].map(|cell| {
            let shell = super::block([16, 16, 8], 0.00375);
            let block = solid(shell, elastic(poisson, Some(cell)), clamped(1e-6), DMat3::IDENTITY, DVec3::ZERO);
            let middle = (0..block.surface_nodes as u32).min_by(|&a, &b| {
                let from = |node: u32| block.rest[node as usize].distance(0.03 * DVec3::Z);
                from(a).total_cmp(&from(b))
            });
            let near = haptize::object::Compliance::on(&block, middle.into_iter().collect()).unwrap();
            let stated = block.lattice_error(&near).unwrap();
            assert_eq!(stated.cell, cell);
            (compliance(&block, 0.03 * DVec3::Z, DVec3::Z), stated.relative)
        });
        let error = (found.0 / finer.0 - 1.0).abs();
        println!("nu {poisson}, cells of {cell} m: {:.4} stated, {error:.4} found", found.1);
        let bounds = error / 1.25..10.0 * error;
        assert!(bounds.contains(&found.1), "nu {poisson}: {error}, {} stated", found.1);
    }
}
