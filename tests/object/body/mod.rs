//! The deformable object: its surface, its stiffness and its compliance; what is refused, and why.

mod collada;
mod gltf;
mod meshes;

use glam::{DMat3, DVec3};
use haptize::fixtures::Random;
use haptize::object::{Compliance, Object};
use haptize::scene::{
    GroundNodes, GroundSpec, GroundStiffness, Material, ObjectSpec, Placement, Scene, Shape, SpringKind, SpringSpec,
};
use std::path::{Path, PathBuf};

const CENTRE: DVec3 = DVec3::new(0.1, -0.2, 0.3);

fn sphere_spec(kind: SpringKind, nodes: GroundNodes) -> ObjectSpec {
    ObjectSpec {
        shape: Shape::Sphere { centre: CENTRE, radius: 0.05, rings: 10, segments: 10 },
        material: Material::Springs(SpringSpec { kind, stiffness: 300.0 }),
        skin: None,
        ground: Some(GroundSpec { stiffness: GroundStiffness::PerNode(100.0), nodes }),
        node_mass: 0.002,
        node_damping: 0.1,
    }
}

fn mesh_spec(file: impl Into<PathBuf>) -> ObjectSpec {
    let shape = Shape::Mesh {
        file: file.into(),
        placement: Placement { scale: 0.5, centre: CENTRE, ..Placement::METRES },
        refine: None,
    };
    ObjectSpec { shape, ..sphere_spec(SpringKind::Isotropic, GroundNodes::All) }
}

fn dataset(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets").join(name)
}

/// A file of tests/references/mesh_formats.py.
fn sample(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/object/meshes").join(name)
}

fn sphere() -> Object {
    Object::build(&sphere_spec(SpringKind::Isotropic, GroundNodes::All)).unwrap()
}

/// The defect for which the surface is refused.
fn defect(nodes: &[DVec3], triangles: &[[u32; 3]]) -> String {
    let spec = sphere_spec(SpringKind::Isotropic, GroundNodes::All);
    let refused = Object::from_surface(&spec, nodes.to_vec(), triangles.to_vec()).unwrap_err().to_string();
    refused.strip_prefix("sphere: ").unwrap().to_owned()
}

/// The numbers in a message, in their order.
fn numbers(text: &str) -> Vec<f64> {
    let words = text.split(|c: char| !(c.is_ascii_digit() || matches!(c, '.' | '-' | 'e')));
    words.filter_map(|word| word.parse().ok()).collect()
}

/// Six times the enclosed volume.
fn six_volumes(object: &Object) -> f64 {
    let corner = |node: u32| object.rest[node as usize] - CENTRE;
    object.triangles.iter().map(|t| corner(t[0]).dot(corner(t[1]).cross(corner(t[2])))).sum()
}

fn apply(object: &Object, displacement: &[DVec3]) -> Vec<DVec3> {
    let mut force = vec![DVec3::NAN; displacement.len()];
    object.mechanics().unwrap().stiffness.apply(displacement, &mut force);
    force
}

// ---- surface --------------------------------------------------------------------------------------------------------

#[test]
fn paper_sphere_has_102_nodes_and_200_outward_triangles() {
    let object = sphere();
    assert_eq!((object.rest.len(), object.surface_nodes, object.triangles.len()), (102, 102, 200));
    assert!(object.warnings.is_empty(), "{:?}", object.warnings);
    for triangle in &object.triangles {
        let [a, b, c] = triangle.map(|node| object.rest[node as usize]);
        assert!((b - a).cross(c - a).dot((a + b + c) / 3.0 - CENTRE) > 0.0, "{triangle:?} faces inward");
    }
    assert!(object.rest.iter().all(|node| (node.distance(CENTRE) - 0.05).abs() < 1e-15));
}

#[test]
fn neighbours_share_the_edge_they_are_listed_under() {
    for object in [sphere(), Object::build(&mesh_spec(dataset("bean.obj"))).unwrap()] {
        let mut visits = vec![0; object.rest.len()];
        for (t, triangle) in object.triangles.iter().enumerate() {
            for k in 0..3 {
                let (a, b) = (triangle[k], triangle[(k + 1) % 3]);
                let across = object.topology.across[t][k] as usize;
                let back = (0..3).find(|&m| object.topology.across[across][m] as usize == t).unwrap();
                let other = object.triangles[across];
                assert_eq!((other[back], other[(back + 1) % 3]), (b, a), "triangles {t} and {across}");
                assert!(object.topology.triangles_around(a as usize).contains(&(t as u32)));
                visits[a as usize] += 1;
            }
        }
        for (node, visits) in visits.into_iter().enumerate() {
            assert_eq!(object.topology.triangles_around(node).len(), visits);
        }
    }
}

#[test]
fn inverted_surfaces_are_turned_with_a_warning() {
    let whole = sphere();
    let spec = sphere_spec(SpringKind::Isotropic, GroundNodes::All);
    for (inverted, said) in [((0..200).collect::<Vec<_>>(), "200 of 200"), (vec![3, 77, 150], "3 of 200")] {
        let mut triangles = whole.triangles.clone();
        inverted.iter().for_each(|&t: &usize| triangles[t].swap(0, 1));
        let object = Object::from_surface(&spec, whole.rest.clone(), triangles).unwrap();
        assert!((six_volumes(&object) / six_volumes(&whole) - 1.0).abs() < 1e-12);
        assert_eq!(object.warnings.len(), 1);
        assert!(object.warnings[0].contains(said), "{:?}", object.warnings);
    }
}

#[test]
fn open_surfaces_are_refused_at_their_edge() {
    let whole = sphere();
    let mut triangles = whole.triangles.clone();
    let removed = triangles.remove(17);
    let text = defect(&whole.rest, &triangles);
    let [ends @ .., edges] = &numbers(&text)[..] else { panic!("{text}") };
    assert!(text.starts_with("the surface is open") && *edges == 3.0 && ends.len() == 6, "{text}");
    // Places are told to a tenth of a millimetre.
    let told =
        |end: &[f64]| removed.iter().any(|&node| whole.rest[node as usize].distance(DVec3::from_slice(end)) < 1e-4);
    assert!(ends.chunks(3).all(told), "{text}");
}

#[test]
fn sheets_that_meet_at_an_edge_or_a_node_are_refused() {
    // Two tetrahedra on one edge, then on one node.
    let corner = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
    let tetrahedron = |n: [u32; 4]| [[n[0], n[2], n[1]], [n[0], n[1], n[3]], [n[1], n[2], n[3]], [n[2], n[0], n[3]]];
    let first = tetrahedron([0, 1, 2, 3]);
    let mut nodes = corner.to_vec();
    nodes.extend([DVec3::new(0.0, -1.0, 0.0), DVec3::new(0.0, 0.0, -1.0)]);
    let on_edge = [first, tetrahedron([0, 1, 4, 5])].concat();
    assert!(defect(&nodes, &on_edge).ends_with(
        "not a manifold: the edge from (0.0000, 0.0000, 0.0000) to (1.0000, 0.0000, 0.0000) m has 4 triangles, not 2"
    ));
    nodes.push(DVec3::new(-1.0, 0.0, 0.0));
    let on_node = [first, tetrahedron([0, 6, 4, 5])].concat();
    assert!(defect(&nodes, &on_node).contains("separate sheets meet at node 0 at (0.0000, 0.0000, 0.0000) m only"));
}

#[test]
fn one_sided_surfaces_are_refused() {
    // The projective plane on six nodes: every edge has two triangles, and there is no inside.
    let triangles =
        [[0, 1, 4], [0, 1, 5], [0, 2, 3], [0, 2, 5], [0, 3, 4], [1, 2, 3], [1, 2, 4], [1, 3, 5], [2, 4, 5], [3, 4, 5]];
    assert!(defect(&Random::vectors(6, 7), &triangles).starts_with("the surface has no inside"));
}

/// What is done to the nodes and triangles of a surface.
type Alteration<'a> = &'a dyn Fn(&mut Vec<DVec3>, &mut Vec<[u32; 3]>);

#[test]
fn flat_and_broken_triangles_are_refused() {
    let whole = sphere();
    let altered = |alter: Alteration<'_>| {
        let (mut nodes, mut triangles) = (whole.rest.clone(), whole.triangles.clone());
        alter(&mut nodes, &mut triangles);
        defect(&nodes, &triangles)
    };
    assert_eq!(
        altered(&|_, triangles| triangles.clear()),
        "the surface has no triangles: export its faces, not points or lines alone"
    );
    assert!(altered(&|nodes, _| nodes[5].y = f64::NAN).starts_with("node 5 has a coordinate that is not a finite"));
    assert!(altered(&|nodes, _| nodes[9] = nodes[40]).starts_with("nodes 9 and 40 lie at the same point"));
    let alone = altered(&|nodes, _| nodes.push(DVec3::ONE));
    assert_eq!(alone, "node 102 at (1.0000, 1.0000, 1.0000) m belongs to no triangle: remove it");
    let out_of_range = "triangle 8 names node 102, but there are only 102 nodes";
    assert_eq!(altered(&|_, triangles| triangles[8][1] = 102), out_of_range);
    let has_no_area = |text: &str| text.starts_with("triangle ") && text.contains(" has no area");
    let flat = altered(&|_, t| t[8][1] = t[8][0]);
    assert!(has_no_area(&flat) && flat.starts_with("triangle 8 "), "{flat}");
    let on_one_line =
        altered(&|nodes, t| nodes[t[8][0] as usize] = nodes[t[8][1] as usize].lerp(nodes[t[8][2] as usize], 0.3));
    assert!(has_no_area(&on_one_line), "{on_one_line}");
    let twice = altered(&|_, t| t.push(t[4]));
    assert!(twice.starts_with("triangles 4 and 200 at (") && twice.contains("have the same three nodes"), "{twice}");
    let folded = altered(&|nodes, _| nodes.iter_mut().for_each(|node| node.z = 0.1 * node.x));
    assert!(folded.contains("encloses no volume") || folded.contains("lie at the same point"), "{folded}");
}

// ---- stiffness ------------------------------------------------------------------------------------------------------

#[test]
fn stored_energy_is_the_sum_over_the_springs() {
    let displacement = Random::vectors(102, 42);
    for kind in [SpringKind::Isotropic, SpringKind::Axial] {
        let object = Object::build(&sphere_spec(kind, GroundNodes::Listed(vec![3, 50, 51, 52, 90]))).unwrap();
        let force = apply(&object, &displacement);
        let stored: f64 = 0.5 * force.iter().zip(&displacement).map(|(f, u)| f.dot(*u)).sum::<f64>();

        let mut springs = 0.0;
        for triangle in &object.triangles {
            for k in 0..3 {
                let (a, b) = (triangle[k] as usize, triangle[(k + 1) % 3] as usize);
                let stretch = displacement[b] - displacement[a];
                let length = match kind {
                    SpringKind::Isotropic => stretch.length(),
                    SpringKind::Axial => stretch.dot((object.rest[b] - object.rest[a]).normalize()),
                };
                // Each edge is met twice, once from either side.
                springs += 0.5 * 0.5 * 300.0 * length * length;
            }
        }
        let ground: f64 =
            [3, 50, 51, 52, 90].map(|j: usize| 0.5 * 100.0 * displacement[j].length_squared()).iter().sum();
        assert!((stored / (springs + ground) - 1.0).abs() < 1e-12, "{kind:?}: {stored} {springs} {ground}");
    }
}

#[test]
fn only_the_ground_resists_rigid_motions() {
    let (shift, turn) = (DVec3::new(0.3, -0.1, 0.7), DVec3::new(-1.0, 2.0, 0.5));
    for (kind, turn) in [(SpringKind::Isotropic, DVec3::ZERO), (SpringKind::Axial, turn)] {
        let object = Object::build(&sphere_spec(kind, GroundNodes::All)).unwrap();
        let motion: Vec<DVec3> = object.rest.iter().map(|node| shift + turn.cross(*node - CENTRE)).collect();
        for (force, motion) in apply(&object, &motion).iter().zip(&motion) {
            assert!((*force - 100.0 * *motion).length() < 1e-10 * motion.length() * 300.0, "{kind:?}");
        }
    }
}

#[test]
fn compliance_inverts_stiffness() {
    let bean = Object::build(&mesh_spec(dataset("bean.obj"))).unwrap();
    let patch = GroundNodes::Below(CENTRE.z - 0.03);
    let spheres = [(SpringKind::Isotropic, GroundNodes::All), (SpringKind::Axial, GroundNodes::All)];
    let patched = [(SpringKind::Isotropic, patch.clone()), (SpringKind::Axial, patch)];
    let spheres =
        spheres.into_iter().chain(patched).map(|(kind, nodes)| Object::build(&sphere_spec(kind, nodes)).unwrap());
    for object in spheres.chain([bean]) {
        let (count, compliance) = (object.rest.len(), Compliance::new(&object));
        for j in (0..count).step_by(7) {
            for axis in DMat3::IDENTITY.to_cols_array_2d().map(DVec3::from_array) {
                let displacement: Vec<DVec3> = (0..count).map(|i| compliance.block(i, j) * axis).collect();
                for (i, force) in apply(&object, &displacement).iter().enumerate() {
                    let expected = if i == j { axis } else { DVec3::ZERO };
                    assert!((*force - expected).abs().max_element() < 1e-9, "{i} {j}: {force}");
                }
            }
        }
        for i in 0..count {
            for j in 0..i {
                assert_eq!(compliance.block(i, j), compliance.block(j, i).transpose());
            }
        }
    }
}

#[test]
fn every_part_must_be_grounded() {
    let one = sphere();
    let shifted = one.rest.iter().map(|node| *node + DVec3::X);
    let nodes: Vec<DVec3> = one.rest.iter().copied().chain(shifted).collect();
    let triangles: Vec<[u32; 3]> =
        one.triangles.iter().copied().chain(one.triangles.iter().map(|t| t.map(|node| node + 102))).collect();
    let build =
        |ground| Object::from_surface(&sphere_spec(SpringKind::Isotropic, ground), nodes.clone(), triangles.clone());

    let both = build(GroundNodes::Listed(vec![0, 102])).unwrap();
    assert_eq!(Compliance::new(&both).block(0, 150), DMat3::ZERO, "separate parts do not move each other");
    let refusal = |ground| build(ground).unwrap_err().to_string();
    let floating = refusal(GroundNodes::Listed(vec![0, 5]));
    let [nodes, node, x, ..] = numbers(&floating)[..] else { panic!("{floating}") };
    assert!(nodes == 102.0 && node >= 102.0 && x > 0.5 && floating.contains("would float away"), "{floating}");
    assert!(refusal(GroundNodes::Listed(vec![204])).contains("names node 204, but the object has nodes 0 to 203"));
    assert!(refusal(GroundNodes::Below(0.2)).starts_with("no node lies below z = 0.2 m"));
}

#[test]
fn a_mechanism_is_refused_and_its_place_named() {
    // Held at one node, axial springs leave the turning about it free; isotropic ones do not.
    let held = GroundNodes::Listed(vec![0]);
    let sphere = Object::build(&sphere_spec(SpringKind::Isotropic, held.clone())).unwrap();
    let text = Object::build(&sphere_spec(SpringKind::Axial, held)).unwrap_err().to_string();
    let told = numbers(&text);
    let [place, direction] = [1, 4].map(|k| DVec3::from_slice(&told[k..]));
    // Places are told to tenths of a millimetre, directions to two digits.
    let moves = sphere.rest.iter().position(|node| node.distance(place) < 1e-4);
    let is_direction = (direction.length() - 1.0).abs() < 0.01;
    assert!(moves.is_some_and(|node| node != 0) && is_direction && told[0] < 1e-9, "{text}");
    // A cube's faces are flat: with its diagonals it is stiff, but a node in the middle of a flat face is not.
    let cube = Object::build(&mesh_spec(dataset("cube.obj"))).unwrap();
    let (mut nodes, mut triangles) = (cube.rest, cube.triangles);
    let [a, b, c] = triangles.remove(0);
    let middle = (nodes[a as usize] + nodes[b as usize] + nodes[c as usize]) / 3.0;
    nodes.push(middle);
    triangles.extend([[a, b, 8], [b, c, 8], [c, a, 8]]);
    let spec = sphere_spec(SpringKind::Axial, GroundNodes::Listed((0..8).collect()));
    let text = Object::from_surface(&spec, nodes, triangles).unwrap_err().to_string();
    assert!(DVec3::from_slice(&numbers(&text)[1..]).distance(middle) < 1e-4, "{text}");
}

fn springs(stiffness: f64) -> Material {
    Material::Springs(SpringSpec { kind: SpringKind::Axial, stiffness })
}

#[test]
fn numbers_out_of_range_are_refused_without_a_scene_file_as_well() {
    let alterations: [fn(&mut ObjectSpec); 8] = [
        |spec| spec.material = springs(-1.0),
        |spec| spec.material = springs(f64::NAN),
        |spec| spec.ground.as_mut().unwrap().stiffness = GroundStiffness::PerNode(0.0),
        |spec| spec.node_mass = f64::INFINITY,
        |spec| spec.node_damping = -0.1,
        |spec| spec.shape = Shape::Sphere { centre: CENTRE, radius: -1.0, rings: 10, segments: 10 },
        |spec| spec.shape = Shape::Sphere { centre: CENTRE, radius: 1.0, rings: 0, segments: 10 },
        |spec| spec.shape = Shape::Sphere { centre: CENTRE, radius: 1.0, rings: 5, segments: 2 },
    ];
    for (index, alter) in alterations.iter().enumerate() {
        let mut spec = sphere_spec(SpringKind::Isotropic, GroundNodes::All);
        alter(&mut spec);
        let refused = Object::build(&spec).unwrap_err().to_string();
        assert!(refused.contains(": it must be "), "{index}: {refused}");
    }
    let mut spec = sphere_spec(SpringKind::Isotropic, GroundNodes::All);
    spec.shape = Shape::Sphere { centre: CENTRE, radius: 1.0, rings: usize::MAX, segments: 1000 };
    assert!(Object::build(&spec).unwrap_err().to_string().contains("use a coarser surface"));
}

// ---- refinement -----------------------------------------------------------------------------------------------------

/// The bean, its edges halved `times` times.
fn bean(times: i32) -> Object {
    let edge = |object: &Object| {
        let ends = object.triangles.iter().flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]]);
        let lengths: Vec<f64> = ends.map(|[a, b]| object.rest[a as usize].distance(object.rest[b as usize])).collect();
        lengths.iter().sum::<f64>() / lengths.len() as f64
    };
    let plain = Object::build(&mesh_spec(dataset("bean.obj"))).unwrap();
    let mut spec = mesh_spec(dataset("bean.obj"));
    let target = 1.05 * edge(&plain) * 0.5f64.powi(times);
    if let Shape::Mesh { refine, .. } = &mut spec.shape {
        *refine = Some(target);
    }
    let refined = Object::build(&spec).unwrap();
    assert!(edge(&refined) <= target);
    refined
}

/// Greatest angle between the normals of neighbouring triangles.
fn greatest_fold(object: &Object) -> f64 {
    let corners = object.triangles.iter().map(|t| t.map(|node| object.rest[node as usize]));
    let normals: Vec<DVec3> = corners.map(|[a, b, c]| (b - a).cross(c - a).normalize()).collect();
    let across = object.topology.across.iter().enumerate();
    let angles = across.flat_map(|(t, across)| across.map(|other| normals[t].angle_between(normals[other as usize])));
    angles.fold(0.0, f64::max)
}

#[test]
fn refinement_keeps_the_nodes_and_the_volume_and_smooths_the_folds() {
    let [plain, once, twice] = [0, 1, 2].map(bean);
    assert_eq!([&plain, &once, &twice].map(|object| object.triangles.len()), [500, 2000, 8000]);
    for refined in [&once, &twice] {
        assert_eq!(refined.rest[..plain.rest.len()], plain.rest[..]);
        assert!((six_volumes(refined) / six_volumes(&plain) - 1.0).abs() < 0.03);
        assert_eq!(refined.warnings, plain.warnings);
    }
    // Over a smooth surface folds halve with the edges; where edges were merely cut in two they would stay as they are.
    let [first, second, third] = [&plain, &once, &twice].map(greatest_fold);
    assert!(second < 0.7 * first && third < 0.7 * second, "{first} {second} {third}");
}

#[test]
fn refinement_brings_a_sphere_near_and_refuses_what_it_cannot_refine() {
    let mut spec = mesh_spec("sphere.obj");
    spec.shape = Shape::Icosphere { centre: CENTRE, radius: 0.05, divisions: 8 };
    let sphere = Object::build(&spec).unwrap();
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("sphere.obj");
    let vertices = sphere.rest.iter().map(|n| *n - CENTRE).map(|n| format!("v {} {} {}\n", n.x, n.y, n.z));
    let faces = sphere.triangles.iter().map(|[a, b, c]| format!("f {} {} {}\n", a + 1, b + 1, c + 1));
    std::fs::write(&file, vertices.chain(faces).collect::<String>()).unwrap();
    let refined = |edge: f64| {
        let shape = Shape::Mesh {
            file: file.clone(),
            placement: Placement { centre: CENTRE, ..Placement::METRES },
            refine: Some(edge),
        };
        Object::build(&ObjectSpec { shape, ..spec.clone() })
    };
    let finer = refined(0.005).unwrap();
    assert_eq!(finer.rest.len(), 2562);
    let worst = finer.rest.iter().map(|node| (node.distance(CENTRE) / 0.05 - 1.0).abs()).fold(0.0, f64::max);
    // The middle of a chord is 2.8e-3 of the radius below the sphere.
    assert!(worst < 5e-4, "{worst}");
    let refusal = |edge| refined(edge).unwrap_err().to_string();
    assert!(refusal(0.0).starts_with("refine is 0: it must be"));
    assert!(refusal(1e-6).contains("use a coarser surface"));
    // What is refined must be closed.
    std::fs::write(&file, "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\n").unwrap();
    assert!(refusal(0.1).contains("the surface is open"));
}

// ---- mesh files -----------------------------------------------------------------------------------------------------

#[test]
fn a_shell_inside_another_is_the_wall_of_a_cavity_and_one_inside_that_a_body() {
    let one = sphere();
    let (mut nodes, mut triangles) = (Vec::new(), Vec::new());
    for (number, size) in [1.0, 0.5, 0.25].into_iter().enumerate() {
        nodes.extend(one.rest.iter().map(|node| CENTRE + size * (*node - CENTRE)));
        triangles.extend(one.triangles.iter().map(|t| t.map(|node| node + 102 * number as u32)));
    }
    let beside = CENTRE + DVec3::X;
    nodes.extend(one.rest.iter().map(|node| beside + (*node - CENTRE)));
    triangles.extend(one.triangles.iter().map(|t| t.map(|node| node + 306)));
    let object =
        Object::from_surface(&sphere_spec(SpringKind::Isotropic, GroundNodes::All), nodes.clone(), triangles).unwrap();
    for (number, sign) in [1.0, -1.0, 1.0, 1.0].into_iter().enumerate() {
        let volume = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|node| nodes[node as usize] - CENTRE);
            a.dot(b.cross(c)) / 6.0
        };
        let part = object.triangles.iter().filter(|t| t[0] / 102 == number as u32);
        assert!(sign * part.map(volume).sum::<f64>() > 0.0, "shell {number}");
    }
    assert!(
        object.warnings.iter().any(|w| w.contains("1 closed shell lies") && w.contains("cavities")),
        "{:?}",
        object.warnings
    );
}

#[test]
fn the_bean_scene_is_an_object_held_at_its_underside() {
    let scene = Scene::load(dataset("mesh.toml")).unwrap();
    let object = Object::build(&scene.object).unwrap();
    assert_eq!((object.rest.len(), object.triangles.len()), (252, 500));
    assert!(object.warnings.is_empty(), "{:?}", object.warnings);
    let whole = Object::from_surface(&scene.object, object.rest.clone(), object.triangles.clone()).unwrap();
    assert_eq!(Compliance::new(&whole), Compliance::new(&object));
}
