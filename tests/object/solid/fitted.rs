//! Inclusions that the lattice cuts, against meshes that fit them: hexahedra of 27 nodes around a ball.

use super::accuracy::compliance;
use super::cells::{HEXAHEDRON, build, written};
use super::*;
use haptize::scene::{InclusionPlace, InclusionSpec};
use std::collections::HashMap;

/// Height of a block of 60 x 60 mm (m).
const HEIGHT: f64 = 0.03;

/// Half side of the box in which the mesh goes over from the ball to the block, and of the cube in the ball's middle, in
/// radii of the ball (1).
const BOX: f64 = 1.5;
const CORE: f64 = 0.5;

/// Pitch of the mesh beside that box, at least (m).
const PITCH: f64 = 0.004;

const POISSON: f64 = 0.45;

/// Physical volume of the ball.
const INNER: u32 = 2;

/// Nodes, each once, and hexahedra.
#[derive(Default)]
struct Mesh {
    numbers: HashMap<[i64; 3], usize>,
    places: Vec<DVec3>,
    elements: Vec<(u32, Vec<usize>)>,
}

impl Mesh {
    /// Adds `counts` hexahedra, whose nodes `place` puts from the numbers of half cells in space; none above the block.
    fn add(&mut self, counts: [usize; 3], region: u32, place: impl Fn([usize; 3]) -> DVec3) {
        let corner = |k: usize| [[0, 1, 1, 0][k % 4], [0, 0, 1, 1][k % 4], k / 4].map(|i| 2 * i);
        let mean = |of: &[usize]| [0, 1, 2].map(|axis| of.iter().map(|&k| corner(k)[axis]).sum::<usize>() / of.len());
        let corners = (0..8).map(corner);
        let edges = HEXAHEDRON.edges.iter().map(|edge| mean(edge));
        let squares = HEXAHEDRON.squares.iter().map(|square| mean(square));
        let offsets: Vec<[usize; 3]> = corners.chain(edges).chain(squares).chain([[1; 3]]).collect();
        for k in 0..counts.iter().product() {
            let cell = [k / (counts[1] * counts[2]), k / counts[2] % counts[1], k % counts[2]];
            let at = |offset: &[usize; 3]| place([0, 1, 2].map(|axis| 2 * cell[axis] + offset[axis]));
            if at(&[1; 3]).z > HEIGHT {
                continue;
            }
            let nodes = offsets.iter().map(|offset| {
                let x = at(offset);
                let key = (x * 1e8).to_array().map(|x| x.round() as i64);
                *self.numbers.entry(key).or_insert_with(|| {
                    self.places.push(x);
                    self.places.len() - 1
                })
            });
            self.elements.push((region, nodes.collect()));
        }
    }
}

/// The block with the ball of `radius` around `centre`, `cells` of which lie along each side of the box around it; what is above
/// the block's top is cut off.
fn fitted(cells: usize, centre: DVec3, radius: f64) -> Mesh {
    let [around, core] = [BOX, CORE].map(|part| part * radius);
    let mut mesh = Mesh::default();
    let fraction = |i: usize| 2.0 * i as f64 / (2 * cells) as f64 - 1.0;
    let cube = |at: [usize; 3]| DVec3::from_array(at.map(fraction));
    mesh.add([cells; 3], INNER, |at| centre + core * cube(at));
    for (axis, side) in (0..3).flat_map(|axis| [(axis, -1.0), (axis, 1.0)]) {
        let direction = |[u, v, _]: [usize; 3]| {
            let mut direction = DVec3::ZERO;
            direction[axis] = side;
            direction[(axis + 1) % 3] = fraction(u);
            direction[(axis + 2) % 3] = fraction(v);
            direction
        };
        let layers = cells / 2;
        let part = |at: [usize; 3]| at[2] as f64 / (2 * layers) as f64;
        let on_ball = |at: [usize; 3]| radius * direction(at).normalize();
        let counts = [cells, cells, layers];
        mesh.add(counts, INNER, |at| centre + (core * direction(at)).lerp(on_ball(at), part(at)));
        mesh.add(counts, 1, |at| centre + on_ball(at).lerp(around * direction(at), part(at)));
    }
    // The rest: planes along each axis.
    let planes = |low: f64, high: f64, middle: f64| {
        let pitch = 2.0 * around / cells as f64;
        let beside = |from: f64, to: f64| {
            let count = ((to - from).abs() / pitch.max(PITCH) - 1e-9).ceil() as usize;
            (0..count).map(move |k| from + (to - from) * k as f64 / count as f64)
        };
        let mut planes: Vec<f64> = beside(low, middle - around).collect();
        planes.extend((0..=cells).map(|k| middle - around + pitch * k as f64));
        let above: Vec<f64> = beside(high, middle + around).collect();
        planes.extend(above.into_iter().rev().filter(|plane| *plane > middle + around));
        planes
    };
    let along = [planes(-0.03, 0.03, centre.x), planes(-0.03, 0.03, centre.y), planes(0.0, HEIGHT, centre.z)];
    let half = |axis: usize, i: usize| 0.5 * (along[axis][i / 2] + along[axis][i.div_ceil(2)]);
    let [x, y, z] = [0, 1, 2].map(|axis| along[axis].len() - 1);
    for k in 0..x * y * z {
        let cell = [k / (y * z), k / z % y, k % z];
        let place = |at: [usize; 3]| DVec3::from_array([0, 1, 2].map(|axis| half(axis, 2 * cell[axis] + at[axis])));
        if ((place([1; 3]) - centre).abs() - around).max_element() > 0.0 {
            mesh.add([1; 3], 1, place);
        }
    }
    mesh
}

fn holding(inclusion: Option<(InclusionPlace, f64)>) -> Material {
    let inclusion = inclusion.map(|(place, young)| InclusionSpec { place, young, poisson: POISSON });
    let inclusions = inclusion.into_iter().collect();
    Material::Elastic(ElasticSpec { young: YOUNG, poisson: POISSON, cell: None, inclusions })
}

/// By how much less the block gives way over the ball, and beside it: a ball in the middle, aside, half out of the top, and
/// a small one below the top, its cubes of the size that they get by themselves. Other stiffnesses, where errors are
/// greatest.
#[test]
fn inclusions_count_as_in_meshes_that_fit_them() {
    let cut = |ball| solid(block([24, 24, 12], 0.0025), holding(ball), clamped(1e-6), DMat3::IDENTITY, DVec3::ZERO);
    let plain = cut(None);
    let top = HEIGHT * DVec3::Z;
    for (centre, radius, factors) in [
        (0.5 * top, 0.008, &[10.0, 0.1][..]),
        (DVec3::new(0.007, 0.004, 0.017), 0.008, &[10.0, 0.1]),
        (top, 0.008, &[30.0, 10.0, 3.0, 0.1]),
        (top - 0.006 * DVec3::Z, 0.004, &[30.0, 0.1]),
    ] {
        let mesh = fitted(4, centre, radius);
        let text = written(12, &mesh.places, &mesh.elements);
        let fitted = |ball| build(&text, holding(ball), clamped(1e-6));
        let plain = [&plain, &fitted(None)];
        for factor in factors {
            let young = factor * YOUNG;
            let ball = InclusionPlace::Sphere { centre, radius };
            let with = [cut(Some((ball, young))), fitted(Some((InclusionPlace::Region(INNER), young)))];
            for aside in [0.0, radius] {
                let gives = |object: &Object| compliance(object, DVec3::new(aside, 0.0, HEIGHT), DVec3::Z);
                let [found, expected] = [0, 1].map(|k| gives(plain[k]) / gives(&with[k]) - 1.0);
                println!(
                    "ball of {radius} m at {centre}, {factor} times as stiff, {aside} m aside: {found:+.3} of {expected:+.3}"
                );
                assert!((found - expected).abs() < 0.02, "{centre}, {factor}: {found} of {expected}");
            }
        }
    }
}
