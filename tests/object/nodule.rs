//! Inclusions in elastic solids: by a sphere and by a region of a Gmsh file, against closed forms.

use glam::DVec3;
use haptize::{
    Error, JointVector,
    contact::Model,
    dataset::Surface,
    object::Object,
    proxy::Chain,
    scene::{
        ElasticSpec, GroundNodes, GroundSpec, GroundStiffness, InclusionPlace, InclusionSpec, Material, ObjectSpec,
        Placement, Scene, Shape,
    },
    sweep::Inspection,
};
use std::fmt::Write;

const YOUNG: f64 = 2e4;
/// Ground per area that keeps the solid in place and hardly adds to it (N/m^3).
const LIGHT: f64 = 100.0;

/// A solid that is held below z = 1 nm, which for a box is its underside, or as a whole.
fn spec(shape: Shape, poisson: f64, cell: Option<f64>, inclusions: Vec<InclusionSpec>) -> ObjectSpec {
    let underside = if matches!(shape, Shape::Icosphere { .. }) { f64::INFINITY } else { 1e-9 };
    ObjectSpec {
        shape,
        material: Material::Elastic(ElasticSpec { young: YOUNG, poisson, cell, inclusions }),
        skin: None,
        ground: Some(GroundSpec { stiffness: GroundStiffness::PerArea(LIGHT), nodes: GroundNodes::Below(underside) }),
        node_mass: 0.01,
        node_damping: 0.1,
    }
}

fn sphere(centre: DVec3, radius: f64, young: f64, poisson: f64) -> InclusionSpec {
    InclusionSpec { place: InclusionPlace::Sphere { centre, radius }, young, poisson }
}

/// Forces on the nodes of K under the displacement `u`.
fn forces(object: &Object, u: impl Fn(DVec3) -> DVec3) -> Vec<DVec3> {
    let displacement: Vec<DVec3> = object.mechanics().unwrap().moved.iter().map(|x| u(*x)).collect();
    let mut forces = vec![DVec3::ZERO; displacement.len()];
    object.mechanics().unwrap().stiffness.apply(&displacement, &mut forces);
    forces
}

/// Two layers of cubes of 0.1 m in tetrahedra, four cubes each, as physical volumes 1 and 7.
fn layers(version: &str) -> String {
    let tag = |at: [usize; 3]| (at[0] * 3 + at[1]) * 3 + at[2] + 1;
    let mut text = format!("$MeshFormat\n{version} 0 8\n$EndMeshFormat\n");
    if version == "4.1" {
        text +=
            "$Entities\n0 0 1 2\n5 0 0 0 1 1 1 0 0\n1 0 0 0 .2 .2 .1 1 1 0\n2 0 0 .1 .2 .2 .2 1 7 0\n$EndEntities\n";
        text += "$Nodes\n1 27 1 27\n3 1 0 27\n";
        (1..=27).for_each(|tag| writeln!(text, "{tag}").unwrap());
    } else {
        text += "$Nodes\n27\n";
    }
    let places = (0..27).map(|k| [k / 9, k / 3 % 3, k % 3]);
    for at in places {
        let [x, y, z] = at.map(|i| 0.1 * i as f64);
        if version == "2.2" {
            write!(text, "{} ", tag(at)).unwrap();
        }
        writeln!(text, "{x} {y} {z}").unwrap();
    }
    text += "$EndNodes\n$Elements\n";
    text += if version == "4.1" { "2 48 1 48\n" } else { "48\n" };
    let mut number = 0;
    for layer in 0..2 {
        if version == "4.1" {
            writeln!(text, "3 {} 4 24", layer + 1).unwrap();
        }
        for cube in 0..4 {
            for path in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]] {
                let mut at = [cube / 2, cube % 2, layer];
                let mut corners = vec![tag(at)];
                for axis in path {
                    at[axis] += 1;
                    corners.push(tag(at));
                }
                number += 1;
                let corners: Vec<String> = corners.iter().map(usize::to_string).collect();
                let labels = if version == "4.1" { String::new() } else { format!(" 4 2 {} 9", [1, 7][layer]) };
                writeln!(text, "{number}{labels} {}", corners.join(" ")).unwrap();
            }
        }
    }
    text + "$EndElements\n"
}

/// Layers in series under one stress: strain is stress over each layer's modulus. Exact where no tetrahedron is cut,
/// since Poisson's ratio is zero.
fn check_series(object: &Object, height: f64, interface: f64, area: f64, young: [f64; 2]) {
    let stress = 1e-3 * YOUNG;
    let stretch = |x: DVec3| {
        let [low, high] = [x.z.min(interface), (x.z - interface).max(0.0)];
        DVec3::Z * stress * (low / young[0] + high / young[1])
    };
    let mut top = DVec3::ZERO;
    for (x, force) in object.mechanics().unwrap().moved.iter().zip(forces(object, stretch)) {
        if x.z > height - 1e-6 {
            top += force;
        } else if x.z > 1e-6 {
            assert!(force.length() < 1e-9 * stress * area, "{force} at {x}: the inside is in balance");
        }
    }
    assert!((top - stress * area * DVec3::Z).length() < 1e-9 * stress * area, "{top}");
}

#[test]
fn layers_by_region_are_springs_in_series_and_outlive_the_file() {
    for version in ["2.2", "4.1"] {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("layers.msh");
        std::fs::write(&file, layers(version)).unwrap();
        let upper = InclusionSpec { place: InclusionPlace::Region(7), young: 5.0 * YOUNG, poisson: 0.0 };
        let shape = Shape::Tetrahedra { file: file.clone(), placement: Placement::METRES };
        let spec = spec(shape, 0.0, None, vec![upper]);
        let object = Object::build(&spec).unwrap();
        check_series(&object, 0.2, 0.1, 0.04, [YOUNG, 5.0 * YOUNG]);
        // A dataset holds the regions: the file is no longer needed.
        drop(folder);
        let stored = Surface::of(&object).object(&spec).unwrap();
        assert_eq!(stored.mechanics().unwrap().stiffness, object.mechanics().unwrap().stiffness);
        // What names no part of the solid is refused.
        let nowhere = InclusionSpec { place: InclusionPlace::Region(3), ..upper };
        let material =
            Material::Elastic(ElasticSpec { young: YOUNG, poisson: 0.0, cell: None, inclusions: vec![nowhere] });
        let error = Surface::of(&object).object(&ObjectSpec { material, ..spec }).unwrap_err().to_string();
        assert!(error.contains("region 3") && error.contains("no part"), "{error}");
    }
}

#[test]
fn layers_by_a_wide_sphere_are_springs_in_series() {
    // A sphere of 10 km through z = 0.04: its curvature is 20 nm over the box.
    let lower = sphere(DVec3::new(0.02, 0.02, 0.04 - 1e4), 1e4, 3.0 * YOUNG, 0.0);
    let corner =
        |k: u32| DVec3::new(f64::from(k & 1) * 0.04, f64::from(k >> 1 & 1) * 0.04, f64::from(k >> 2 & 1) * 0.1);
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = faces.iter().flat_map(|f| [[f[0], f[1], f[2]], [f[0], f[2], f[3]]]).collect();
    let shape = Shape::Mesh { file: "box".into(), placement: Placement::METRES, refine: None };
    let spec = spec(shape, 0.0, Some(0.02), vec![lower]);
    let object = Object::from_surface(&spec, (0..8).map(corner).collect(), triangles).unwrap();
    check_series(&object, 0.1, 0.04, 0.0016, [3.0 * YOUNG, YOUNG]);
}

fn ball(cell: f64, inclusions: Vec<InclusionSpec>) -> Result<Object, Error> {
    let shape = Shape::Icosphere { centre: DVec3::ZERO, radius: 0.05, divisions: 12 };
    Object::build(&spec(shape, 0.3, Some(cell), inclusions))
}

#[test]
fn an_inclusion_like_the_rest_changes_nothing() {
    // Large enough for the cubes that it cuts.
    let same = sphere(DVec3::new(0.002, 0.0, 0.003), 0.04, YOUNG, 0.3);
    let (plain, same) = (ball(0.02, vec![]).unwrap(), ball(0.02, vec![same]).unwrap());
    let scale = plain.mechanics().unwrap().stiffness.norm();
    for (a, b) in plain.mechanics().unwrap().stiffness.blocks.iter().zip(&same.mechanics().unwrap().stiffness.blocks) {
        assert!((*a - *b).to_cols_array().iter().all(|x| x.abs() < 1e-13 * scale));
    }
}

/// A ball with a ball in its middle under pressure: its bulk modulus is that of Hashin's composite sphere (Hashin 1962,
/// Journal of Applied Mechanics 29), K = Km + c (Ki - Km) (3 Km + 4 Gm) / (3 Km + 4 Gm + 3 (1 - c) (Ki - Km)), c the
/// inner share of the volume.
#[test]
fn a_composite_sphere_has_hashins_bulk_modulus() {
    let bulk = |young: f64, poisson: f64| young / (3.0 * (1.0 - 2.0 * poisson));
    let radial = |object: &Object| {
        let mut forces = vec![DVec3::ZERO; object.rest.len()];
        for triangle in &object.triangles {
            let [a, b, c] = triangle.map(|node| object.rest[node as usize]);
            let force = 0.5 * (b - a).cross(c - a) / 3.0;
            triangle.iter().for_each(|&node| forces[node as usize] += force);
        }
        let mut u = vec![DVec3::ZERO; object.mechanics().unwrap().moved.len()];
        object.mechanics().unwrap().attachment.spread(&forces, &mut u);
        object.mechanics().unwrap().factor.solve(&mut u);
        let outward =
            |node: usize| object.mechanics().unwrap().attachment.follow(node, &u).dot(object.rest[node].normalize());
        (0..object.surface_nodes).map(outward).sum::<f64>() / object.surface_nodes as f64
    };
    let plain = [0.02, 0.01].map(|cell| ball(cell, vec![]).unwrap());
    let cone = |triangle: &[u32; 3]| {
        let [a, b, c] = triangle.map(|node| plain[0].rest[node as usize]);
        a.dot(b.cross(c)) / 6.0
    };
    let volume: f64 = plain[0].triangles.iter().map(cone).sum();
    for (factor, poisson, part) in [(10.0, 0.3, 0.6), (10.0, 0.2, 0.8), (0.1, 0.3, 0.6)] {
        let radius = 0.05 * part;
        let c = 4.0 / 3.0 * std::f64::consts::PI * f64::powi(radius, 3) / volume;
        let (km, ki) = (bulk(YOUNG, 0.3), bulk(factor * YOUNG, poisson));
        let shear = 4.0 * YOUNG / (2.0 * 1.3);
        let hashin = 1.0 + c * (ki - km) / km * (3.0 * km + shear) / (3.0 * km + shear + 3.0 * (1.0 - c) * (ki - km));
        let inner = sphere(DVec3::ZERO, radius, factor * YOUNG, poisson);
        // Cells of half the size, which take thirty times as long, for the largest one alone.
        for (cell, plain) in [(0.02, &plain[0]), (0.01, &plain[1])].into_iter().take(1 + usize::from(part == 0.8)) {
            let error = radial(plain) / radial(&ball(cell, vec![inner]).unwrap()) / hashin - 1.0;
            assert!(error.abs() < 0.03, "{factor} {poisson} {part}, cells of {cell}: {error} of {hashin}");
        }
    }
}

#[test]
fn the_last_of_overlapping_inclusions_counts() {
    let ball = |inclusions: Vec<InclusionSpec>| ball(0.018, inclusions);
    // The elements about the middle end within the core.
    let (stiff, core) = (sphere(DVec3::ZERO, 0.045, 1e6, 0.3), sphere(DVec3::ZERO, 0.036, YOUNG, 0.3));
    let (plain, hollow) = (ball(vec![]).unwrap(), ball(vec![stiff, core]).unwrap());
    // Near the middle the core is like the plain ball, and farther out it is not.
    let same = |near: DVec3| {
        let node = (0..plain.mechanics().unwrap().moved.len()).min_by(|&a, &b| {
            plain.mechanics().unwrap().moved[a]
                .distance(near)
                .total_cmp(&plain.mechanics().unwrap().moved[b].distance(near))
        });
        let rows = node.into_iter().flat_map(|node| {
            plain.mechanics().unwrap().stiffness.row(node).zip(hollow.mechanics().unwrap().stiffness.row(node))
        });
        rows.into_iter().all(|((_, a), (_, b))| {
            (*a - *b).to_cols_array().iter().all(|x| x.abs() < 1e-12 * plain.mechanics().unwrap().stiffness.norm())
        })
    };
    assert!(same(DVec3::ZERO) && !same(DVec3::X * 0.04));
    for hidden in [vec![core, stiff], vec![stiff, sphere(DVec3::X, 0.01, 1e5, 0.3)]] {
        let hidden = ball(hidden).unwrap_err();
        assert!(hidden.to_string().contains("no part of the solid is in the inclusion"), "{hidden}");
    }
}

/// The scene that ships: a stroke at one depth feels most torque over the nodule.
#[test]
fn a_finger_finds_the_nodule() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets/nodule.toml");
    let scene = Scene::load(path).unwrap();
    let object = Object::build(&scene.object).unwrap();
    let chain = Chain::new(&scene.proxy);
    let stroke: Vec<JointVector> =
        (-10..=10).map(|k| JointVector::from_slice(&[0.02 * f64::from(k), 0.05, 0.0])).collect();
    let model = Model::reaching(&object, &chain, scene.contact, &stroke).unwrap();
    let found = stroke.iter().map(|q| Inspection::new(&model, q).unwrap());
    let torques: Vec<f64> = found.map(|inspection| inspection.torque[1].abs()).collect();
    let (most, place) = torques.iter().zip(&stroke).max_by(|a, b| a.0.total_cmp(b.0)).unwrap();
    let yaw = place[0];
    // The nodule lies at x = 12 mm, which a finger of 120 mm reaches at 0.1 rad.
    assert!((yaw - 0.1).abs() < 0.03, "most torque, {most}, at {yaw} rad");
    // As far from the middle on the other side.
    assert!(*most > 1.08 * torques[5], "{most} over the nodule, {} beside: {torques:?}", torques[5]);
}

#[test]
fn scenes_say_what_an_inclusion_needs() {
    let scene = |object: &str| {
        let text = format!(
            "[object]\nground = {{ stiffness = 10.0 }}\n{object}\n[contact]\nstiffness = 100.0\n[grid]\n\
             axes = [{{ start = 0.0, stop = 1.0, count = 2 }}]\n[[proxy.joint]]\nkind = \"revolute\"\n\
             axis = [0, 0, 1]\nlimits = [-1, 1]\nnodes = [{{ at = [1, 0, 0] }}]\n"
        );
        Scene::parse(&text, "nodule.toml").map(|scene| scene.object).map_err(|error| error.to_string())
    };
    let solid = |inclusion: &str| {
        format!(
            "sphere = {{ radius = 0.05, edge = 0.02 }}\n[object.elasticity]\nyoung = 1e4\npoisson = 0.4\ncell = 0.02\n\
             [[object.elasticity.inclusion]]\n{inclusion}"
        )
    };
    let object = scene(&solid("sphere = { centre = [0, 0, 0.01], radius = 0.01 }\nyoung = 1e5")).unwrap();
    let Material::Elastic(elastic) = object.material else { panic!("an elastic solid") };
    assert_eq!(elastic.inclusions, [sphere(DVec3::Z * 0.01, 0.01, 1e5, 0.4)]);
    for (inclusion, expected) in [
        ("young = 1e5", "one of sphere"),
        ("sphere = { centre = [0, 0, 0], radius = 0.01 }\nregion = 1\nyoung = 1e5", "one of sphere"),
        ("sphere = { centre = [0, 0, 0], radius = -1 }\nyoung = 1e5", "radius"),
        ("sphere = { centre = [0, 0, 0], radius = 1 }\nyoung = 0", "young"),
        ("sphere = { centre = [0, 0, 0], radius = 1 }\nyoung = 1\npoisson = 0.5", "poisson"),
        ("region = 1\nyoung = 1e5", "Gmsh"),
    ] {
        let error = scene(&solid(inclusion)).unwrap_err();
        assert!(error.contains(expected) && error.contains("nodule.toml:"), "{inclusion}: {error}");
    }
}

/// Cubes that a sphere cuts are halved until they are half of its radius, and a quarter where it comes out of the body;
/// the others stay as they are.
#[test]
fn small_inclusions_are_cut_by_small_cubes() {
    let nodes = |inclusions| ball(0.02, inclusions).unwrap().mechanics().unwrap().moved.clone();
    let plain = nodes(vec![]);
    // Nodes lie half a cube apart.
    let pitch = |nodes: &[DVec3]| {
        let mut along: Vec<f64> = nodes.iter().map(|node| node.x).collect();
        along.sort_by(f64::total_cmp);
        along.windows(2).map(|two| two[1] - two[0]).filter(|gap| *gap > 1e-9).fold(f64::INFINITY, f64::min)
    };
    assert!((pitch(&plain) - 0.01).abs() < 1e-9);
    for (centre, expected) in [(DVec3::ZERO, 0.0025), (0.048 * DVec3::Z, 0.00125)] {
        let found = nodes(vec![sphere(centre, 0.01, 1e5, 0.3)]);
        assert!((pitch(&found) - expected).abs() < 1e-9, "{centre}: {}", pitch(&found));
        // No cube that far away is cut: its diagonal is 35 mm.
        let far: Vec<&DVec3> = plain.iter().filter(|x| x.distance(centre) > 0.01 + 0.035).collect();
        assert!(far.len() > 20 && far.iter().all(|x| found.iter().any(|y| y.distance(**x) < 1e-9)));
    }
}
