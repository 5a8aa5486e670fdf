//! The skin: what it resists, on every mesh alike; and the sphere of nearly equal triangles that carries it best.

use glam::DVec3;
use haptize::fixtures::Random;
use haptize::object::{Compliance, Object};
use haptize::scene::{
    ElasticSpec, GroundNodes, GroundSpec, GroundStiffness, Material, ObjectSpec, Shape, SkinSpec, SpringKind,
    SpringSpec,
};

const CENTRE: DVec3 = DVec3::new(0.1, -0.2, 0.3);
const RADIUS: f64 = 0.05;
const SKIN: SkinSpec = SkinSpec { tension: 260.0, bending: 0.08, foundation: 1.6e5 };

fn hollow(divisions: usize, skin: SkinSpec) -> ObjectSpec {
    ObjectSpec {
        shape: Shape::Icosphere { centre: CENTRE, radius: RADIUS, divisions },
        material: Material::Hollow,
        skin: Some(skin),
        ground: None,
        node_mass: 1e-3,
        node_damping: 0.1,
    }
}

fn build(spec: &ObjectSpec) -> Object {
    Object::build(spec).unwrap()
}

fn apply(object: &Object, displacement: &[DVec3]) -> Vec<DVec3> {
    let mut force = vec![DVec3::NAN; displacement.len()];
    object.mechanics().unwrap().stiffness.apply(displacement, &mut force);
    force
}

#[test]
fn an_icosphere_is_closed_outward_and_even() {
    for divisions in [1, 2, 3, 8] {
        let object = build(&hollow(divisions, SKIN));
        let squares = divisions * divisions;
        assert_eq!((object.rest.len(), object.triangles.len()), (10 * squares + 2, 20 * squares));
        assert!(object.warnings.is_empty(), "its triangles were turned: {:?}", object.warnings);
        assert!(object.rest.iter().all(|node| (node.distance(CENTRE) - RADIUS).abs() < 1e-15));
        let edges = object.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        let lengths: Vec<f64> = edges.map(|[a, b]| object.rest[a as usize].distance(object.rest[b as usize])).collect();
        let [least, most] =
            [f64::min, f64::max].map(|pick: fn(f64, f64) -> f64| lengths.iter().copied().reduce(pick).unwrap());
        assert!(most < 1.2 * least, "{divisions}: edges from {least} to {most}");
    }
    for (divisions, refusal) in [(0, "at least 1"), (usize::MAX, "more than")] {
        let error = Object::build(&hollow(divisions, SKIN)).unwrap_err().to_string();
        assert!(error.contains(refusal), "{error}");
    }
}

#[test]
fn a_translation_costs_the_foundation_alone() {
    let object = build(&hollow(6, SKIN));
    let shift = DVec3::new(0.3, -0.1, 0.7);
    let force = apply(&object, &vec![shift; object.rest.len()]);
    let scale = object.mechanics().unwrap().stiffness.norm();
    let total: DVec3 = force.iter().sum();
    // The area of the triangles, a little less than the sphere's.
    let area: f64 = object
        .triangles
        .iter()
        .map(|t| t.map(|node| object.rest[node as usize]))
        .map(|[a, b, c]| 0.5 * (b - a).cross(c - a).length())
        .sum();
    assert!((total - SKIN.foundation * area * shift).length() < 1e-12 * scale, "{total}");
    // The other two terms give way to the last digit at every node, not only in sum.
    let bare = build(&hollow(6, SkinSpec { tension: 0.0, bending: 0.0, ..SKIN }));
    for (force, foundation) in force.iter().zip(apply(&bare, &vec![shift; bare.rest.len()])) {
        assert!((*force - foundation).length() < 1e-14 * scale, "{force} and {foundation}");
    }
    // A turn is resisted: an isotropic skin does not tell it from a strain.
    let turn: Vec<DVec3> = object.rest.iter().map(|node| DVec3::Z.cross(*node - CENTRE)).collect();
    assert!(
        object.mechanics().unwrap().stiffness.energy(&turn) > 1.01 * bare.mechanics().unwrap().stiffness.energy(&turn)
    );
}

/// Bending stiffness at which the foundation of 1 N/m^3 still leaves the factorisation its digits (N m).
const BENDING: f64 = 1e-3;

/// Energies of the displacement `harmonic` of degree l along x, whose mean square over the sphere is given, in units of
/// the continuum's: for tension l (l + 1) / R^2, for bending the square of that, for the foundation one.
fn ratios(divisions: usize, degree: u32, mean_square: f64, harmonic: fn(DVec3) -> f64) -> [f64; 3] {
    let unit = SkinSpec { tension: 0.0, bending: 0.0, foundation: 1.0 };
    // The foundation, which makes them definite, is taken off again.
    let skins = [SkinSpec { tension: 1.0, ..unit }, SkinSpec { bending: BENDING, ..unit }];
    let object = build(&hollow(divisions, unit));
    let field: Vec<DVec3> = object.rest.iter().map(|node| harmonic((*node - CENTRE) / RADIUS) * DVec3::X).collect();
    let norm = object.mechanics().unwrap().stiffness.energy(&field);
    let eigenvalue = f64::from(degree * (degree + 1)) / (RADIUS * RADIUS);
    let [tension, bending] =
        skins.map(|skin| build(&hollow(divisions, skin)).mechanics().unwrap().stiffness.energy(&field) / norm - 1.0);
    let area = 4.0 * std::f64::consts::PI * RADIUS * RADIUS;
    [tension / eigenvalue, bending / (BENDING * eigenvalue * eigenvalue), 2.0 * norm / (mean_square * area)]
}

#[test]
fn spherical_harmonics_are_resisted_as_by_the_continuum_to_second_order() {
    type Harmonic = (u32, f64, fn(DVec3) -> f64);
    let harmonics: [Harmonic; 2] = [
        (2, 1.0 / 15.0 + 0.09 * 0.8, |p| p.x * p.y + 0.3 * (3.0 * p.z * p.z - 1.0)),
        (3, 4.0 / 7.0 + 16.0 / 105.0, |p| 5.0 * p.z.powi(3) - 3.0 * p.z + 4.0 * p.x * p.y * p.z),
    ];
    for (degree, mean_square, harmonic) in harmonics {
        let [coarse, fine] =
            [8, 16].map(|divisions| ratios(divisions, degree, mean_square, harmonic).map(|ratio| (ratio - 1.0).abs()));
        for (term, (coarse, fine)) in ["tension", "bending", "foundation"].iter().zip(coarse.into_iter().zip(fine)) {
            let order = (coarse / fine).log2();
            assert!(fine < 0.02 && order > 1.8, "degree {degree}, {term}: {coarse:.2e}, {fine:.2e}, order {order:.2}");
        }
        // With a wrong degree none of this holds.
        assert!((ratios(8, degree + 1, mean_square, harmonic)[0] - 1.0).abs() > 0.3);
    }
}

#[test]
fn every_term_is_positive_semidefinite_on_obtuse_meshes() {
    let even = build(&hollow(5, SKIN));
    let edge = even.skin.unwrap().mean_edge;
    for seed in 1..6 {
        let moved = Random::vectors(even.rest.len(), seed);
        let nodes: Vec<DVec3> = even.rest.iter().zip(&moved).map(|(node, by)| *node + 0.25 * edge * *by).collect();
        let obtuse = even.triangles.iter().flat_map(|&[a, b, c]| [[a, b, c], [b, c, a], [c, a, b]]);
        let obtuse = obtuse.map(|corners| corners.map(|node| nodes[node as usize]));
        let obtuse = obtuse.filter(|[own, a, b]| (*a - *own).dot(*b - *own) < 0.0).count();
        assert!(obtuse > 50, "{obtuse} obtuse angles put nothing to the test");
        for skin in
            [SkinSpec { tension: 260.0, ..SkinSpec::default() }, SkinSpec { bending: 0.08, ..SkinSpec::default() }]
        {
            // A foundation of 1e-7 of the rest is all that the factorisation needs to go through.
            let norm = Object::from_surface(
                &hollow(5, SkinSpec { foundation: 1e5, ..skin }),
                nodes.clone(),
                even.triangles.clone(),
            )
            .unwrap()
            .mechanics()
            .unwrap()
            .stiffness
            .norm();
            let foundation = 1e-7 * norm / (edge * edge);
            let object = Object::from_surface(
                &hollow(5, SkinSpec { foundation, ..skin }),
                nodes.clone(),
                even.triangles.clone(),
            )
            .unwrap();
            assert!(object.mechanics().unwrap().stiffness.is_isotropic());
            for k in 0..object.rest.len() {
                let row: f64 = object.mechanics().unwrap().stiffness.row(k).map(|(_, block)| block.x_axis.x).sum();
                assert!(row > 0.0 && row < 1e-6 * norm, "row {k} sums to {row}, of {norm}");
            }
        }
    }
}

/// Displacement of node 0 under a force on it (m/N).
fn compliance(object: &Object) -> f64 {
    let mut displacement = vec![DVec3::ZERO; object.rest.len()];
    displacement[0] = DVec3::Z;
    object.mechanics().unwrap().factor.solve(&mut displacement);
    displacement[0].z
}

#[test]
fn the_compliance_of_a_point_converges_with_bending_and_grows_without() {
    let [with, without] = [SKIN, SkinSpec { bending: 0.0, ..SKIN }]
        .map(|skin| [4, 8, 16, 32].map(|divisions| compliance(&build(&hollow(divisions, skin)))));
    let steps = |c: [f64; 4]| [c[1] - c[0], c[2] - c[1], c[3] - c[2]];
    let [first, second, third] = steps(with).map(f64::abs);
    assert!(second < 0.5 * first && third < 0.5 * second && third < 0.005 * with[3], "{with:?}");
    // On a membrane each halving of the edges adds ln 2 / (2 pi T).
    let expected = 2.0f64.ln() / (2.0 * std::f64::consts::PI * SKIN.tension);
    let last = steps(without)[2];
    assert!((last / expected - 1.0).abs() < 0.05, "{last} and {expected}: {without:?}");
}

#[test]
fn skins_of_isotropic_objects_keep_the_small_compliance() {
    let springs = |kind| Material::Springs(SpringSpec { kind, stiffness: 150.0 });
    for (material, rows) in
        [(Material::Hollow, 1), (springs(SpringKind::Isotropic), 1), (springs(SpringKind::Axial), 3)]
    {
        let object = build(&ObjectSpec { material, ..hollow(2, SKIN) });
        assert_eq!(Compliance::new(&object).rows_per_node, rows);
    }
}

#[test]
fn a_skin_adds_to_springs_and_to_solids_what_it_is_alone() {
    let solid = Material::Elastic(ElasticSpec { young: 1e4, poisson: 0.4, cell: Some(0.02), inclusions: Vec::new() });
    let springs = Material::Springs(SpringSpec { kind: SpringKind::Axial, stiffness: 150.0 });
    let ground = Some(GroundSpec { stiffness: GroundStiffness::PerNode(50.0), nodes: GroundNodes::All });
    let alone = build(&hollow(3, SKIN));
    for material in [solid, springs] {
        let both = ObjectSpec { material, ground: ground.clone(), ..hollow(3, SKIN) };
        let bare = build(&ObjectSpec { skin: None, ..both.clone() });
        let both = build(&both);
        assert!(bare.skin.is_none() && both.skin == alone.skin);
        let field = Random::vectors(both.mechanics().unwrap().moved.len(), 3);
        let followers: Vec<DVec3> =
            (0..alone.rest.len()).map(|node| both.mechanics().unwrap().attachment.follow(node, &field)).collect();
        let expected = bare.mechanics().unwrap().stiffness.energy(&field)
            + alone.mechanics().unwrap().stiffness.energy(&followers);
        assert!((both.mechanics().unwrap().stiffness.energy(&field) / expected - 1.0).abs() < 1e-12);
    }
}

#[test]
fn what_it_amounts_to_is_told_beside_the_mesh() {
    let skin = build(&hollow(16, SKIN)).skin.unwrap();
    assert!((skin.rounding.unwrap() - (0.08f64 / 260.0).sqrt()).abs() < 1e-12);
    assert!((skin.spreading.unwrap() - (260.0f64 / 1.6e5).sqrt()).abs() < 1e-12);
    assert!((skin.mean_edge / (1.2046 * RADIUS / 16.0) - 1.0).abs() < 0.01);
    for part in ["bending 8.000e-2 N m", "rounded over 17.5 mm", "spread over 40.3 mm", "mean edge 3.8 mm"] {
        assert!(skin.to_string().contains(part), "{skin}");
    }
    let membrane = build(&hollow(2, SkinSpec { bending: 0.0, ..SKIN })).skin.unwrap();
    assert_eq!(membrane.rounding, None);
}

#[test]
fn skins_that_cannot_be_are_refused() {
    let nothing = SkinSpec::default();
    for skin in [
        nothing,
        SkinSpec { bending: -0.01, ..SKIN },
        SkinSpec { tension: f64::NAN, ..SKIN },
        SkinSpec { foundation: f64::INFINITY, ..SKIN },
    ] {
        let refused = Object::build(&hollow(2, skin)).unwrap_err().to_string();
        assert!(refused.contains(": it must be "), "{skin:?}: {refused}");
    }
    let floating = SkinSpec { foundation: 0.0, ..SKIN };
    assert!(Object::build(&hollow(2, floating)).unwrap_err().to_string().contains("would float away"));
}
