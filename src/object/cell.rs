//! The size of the cubes that a solid gets by itself: what contact asks for, or what memory and time allow.
//!
//! Nested dissection leaves O(n^(4/3)) entries in the factor of a solid of n nodes, and takes O(n^2) operations
//! (George, Nested dissection of a regular finite element mesh, 1973). So nodes are counted, and nothing is
//! factorised, to tell what cubes of a size would take.

use super::{corners, inclusion::Materials, lattice::Lattice, level::Level, solid::Elements, spacing::Spacing};
use crate::{memory, scene::ElasticSpec};
use glam::DVec3;

/// Factor of a solid over n^(4/3) (B): 490 to 860 between 5,000 and 70,000 nodes. For more the other half of the memory
/// has room.
const FACTOR: f64 = 800.0;

/// By how much more it is where a skin with a bending stiffness couples cubes around each node of the surface (1): 4.4
/// times in the slab of `docs/solids.md`.
const BENT: f64 = 5.0;

/// K, for each node (B): a node of cubes shares some with 64 nodes on average, and their blocks have nine numbers.
const MATRIX: f64 = 64.0 * 9.0 * size_of::<f64>() as f64;

/// Most that the set-up of a lattice may take, where so much is left (B): such a factor takes some minutes on a laptop.
const MOST: usize = 3 << 30;

/// By how much cubes grow from one trial to the next, at least and at most (1).
const GROWTH: [f64; 2] = [1.03, 1.5];

/// Memory that is left to a lattice (B): half of all, since compliance and contact take theirs.
pub(super) fn limit() -> f64 {
    memory::left().map_or(MOST, |left| MOST.min(left / 2)) as f64
}

/// Memory that a lattice of `nodes` takes to be set up, about (B). `bends`: whether its skin resists bending.
fn needed(nodes: usize, bends: bool) -> f64 {
    let nodes = nodes as f64;
    MATRIX * nodes + if bends { BENT * FACTOR } else { FACTOR } * nodes.powf(4.0 / 3.0)
}

/// Returns the size of cubes that suits a closed surface, and the least from there on that takes no more than `limit`
/// (B) to be set up; that is at most the body's least extent (m).
pub(super) fn sizes(surface: (&[DVec3], &[[u32; 3]]), elastic: &ElasticSpec, bends: bool, limit: f64) -> [f64; 2] {
    let (nodes, triangles) = surface;
    let materials = Materials::new(elastic, nodes);
    let [low, high] = corners(nodes);
    let largest = (high - low).min_element();
    let suitable = Spacing::new(nodes, triangles).suitable_size().min(largest);
    let mut size = suitable;
    loop {
        let over = Level::around(nodes, size).map_or(f64::INFINITY, |level| {
            let most = needed((2 * level.counts + 1).element_product() as usize, bends);
            if elastic.inclusions.is_empty() && most <= limit {
                return most / limit;
            }
            let filled = Lattice::fill(size, surface, &materials);
            filled.map_or(f64::INFINITY, |(lattice, _)| needed(lattice.positions().len(), bends) / limit)
        });
        if over <= 1.0 || size >= largest {
            return [suitable, size];
        }
        let [least, most] = GROWTH;
        // Cubes throughout, of which the factor is most, would fit then.
        size = (size * over.powf(0.25).clamp(least, most)).min(largest);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::object::{Body, Compliance, Mechanics, Object, icosphere};
    use crate::scene::{
        GroundNodes, GroundSpec, GroundStiffness, InclusionPlace, InclusionSpec, Material, ObjectSpec, Shape,
    };

    fn elastic(cell: Option<f64>) -> ElasticSpec {
        ElasticSpec { young: 1e4, poisson: 0.45, cell, inclusions: Vec::new() }
    }

    fn ball(cell: Option<f64>, limit: f64) -> Object {
        let shape = Shape::Icosphere { centre: DVec3::ZERO, radius: 0.05, divisions: 10 };
        let ground = GroundSpec { stiffness: GroundStiffness::PerArea(1e6), nodes: GroundNodes::All };
        let material = Material::Elastic(elastic(cell));
        let spec = ObjectSpec { shape, material, skin: None, ground: Some(ground), node_mass: 0.01, node_damping: 0.1 };
        let body = Body::shell(icosphere(DVec3::ZERO, 0.05, 10).unwrap());
        Object::assemble(&spec, body, Vec::new(), limit).unwrap()
    }

    /// What is left is given from outside.
    #[test]
    fn cubes_are_the_finest_that_fit_and_set_up_takes_no_more() {
        let (nodes, triangles) = icosphere(DVec3::ZERO, 0.05, 10).unwrap();
        let surface = (&nodes[..], &triangles[..]);
        let sizes = |bends, limit| sizes(surface, &elastic(None), bends, limit);
        let [suitable, size] = sizes(false, f64::INFINITY);
        assert_eq!(suitable, size);
        let taken = |size| {
            let (lattice, _) = Lattice::fill(size, surface, &Materials::new(&elastic(None), &nodes)).unwrap();
            needed(lattice.positions().len(), false)
        };
        let mut last = suitable;
        for limit in [4e7, 2e7, 1e7] {
            let [same, size] = sizes(false, limit);
            assert_eq!(same, suitable);
            assert!(size > last && taken(size) <= limit && taken(size / 1.25) > limit, "{limit}: {size}");
            assert!(sizes(true, limit)[1] > size, "a skin that bends takes more");
            last = size;
        }
        // What does not fit is tried with a cube as large as the body, and what is given is taken.
        assert!((sizes(false, 1.0)[1] - 0.1).abs() < 0.01);
        let [free, small] = [f64::INFINITY, 1e7].map(|limit| ball(None, limit));
        assert!(ball(Some(suitable), 1e7).mechanics().unwrap().moved.len() == free.mechanics().unwrap().moved.len());
        for (object, limit) in [(&free, taken(suitable)), (&small, 1e7)] {
            let Mechanics { factor, stiffness, .. } = object.mechanics().unwrap();
            let bytes = factor.bytes() + size_of_val(&stiffness.blocks[..]);
            assert!((0.3 * limit..limit).contains(&(bytes as f64)), "{bytes} of {limit}");
        }
        // Who bakes is told of it, whatever the error.
        let error = |object: &Object| object.lattice_error(&Compliance::new(object)).unwrap();
        assert!(error(&free).suitable.is_none());
        let told = error(&small);
        assert!(told.is_coarse() && told.cell == last && told.suitable == Some(suitable), "{told}");
        assert!(told.to_string().ends_with(&format!("object.elasticity.cell = {suitable:.4}")), "{told}");
        assert!(small.key() != free.key(), "what is kept of one is not the other's");
    }

    /// Cubes that an inclusion cuts are smaller than `cell`, and count.
    #[test]
    fn cubes_at_inclusions_count() {
        let (nodes, triangles) = icosphere(DVec3::ZERO, 0.05, 10).unwrap();
        let place = InclusionPlace::Sphere { centre: DVec3::ZERO, radius: 0.004 };
        let elastic =
            ElasticSpec { inclusions: vec![InclusionSpec { place, young: 1e5, poisson: 0.45 }], ..elastic(None) };
        let plain = ElasticSpec { inclusions: Vec::new(), ..elastic.clone() };
        let [with, without] = [&elastic, &plain].map(|elastic| sizes((&nodes, &triangles), elastic, false, 4e7)[1]);
        assert!(with > without, "{with} {without}");
    }
}
