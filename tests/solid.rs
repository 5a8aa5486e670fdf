//! Elastic solids: tetrahedra from Gmsh files and lattices in closed surfaces, against closed forms.

// Helpers outside test functions may fail the test too.
#![allow(clippy::unwrap_used, clippy::panic)]

use glam::DVec3;
use haptize::object::Object;
use haptize::scene::{
    ElasticSpec, GroundNodes, GroundSpec, Material, ObjectSpec, Scene, Shape, SpringKind, SpringSpec,
};
use std::fmt::Write;

const YOUNG: f64 = 2e4;
const POISSON: f64 = 0.3;
/// Ground stiffness that keeps the solid in place and hardly adds to it (N/m).
const LIGHT: f64 = 1e-4;

fn spec(shape: Shape, material: Material, ground: GroundSpec) -> ObjectSpec {
    ObjectSpec { shape, material, skin: None, ground: Some(ground), node_mass: 0.01, node_damping: 0.1 }
}

fn elastic(cell: Option<f64>) -> Material {
    Material::Elastic(ElasticSpec { young: YOUNG, poisson: POISSON, cell, inclusions: Vec::new() })
}

fn light() -> GroundSpec {
    GroundSpec { stiffness: LIGHT, nodes: GroundNodes::All }
}

/// A block of 2 x 2 x 2 cubes of 0.1 m, its middle node out of place, in tetrahedra; some numbered inside out.
fn block() -> (Vec<DVec3>, Vec<[usize; 4]>) {
    let number = |x: usize, y: usize, z: usize| (x * 3 + y) * 3 + z;
    let (mut nodes, mut tetrahedra) = (Vec::new(), Vec::new());
    for x in 0..3 {
        for y in 0..3 {
            for z in 0..3 {
                nodes.push(0.1 * DVec3::new(x as f64, y as f64, z as f64));
            }
        }
    }
    nodes[number(1, 1, 1)] += DVec3::new(0.02, -0.03, 0.01);
    for cube in 0..8 {
        let low = [cube / 4, cube / 2 % 2, cube % 2];
        for path in [[0, 1, 2], [1, 2, 0], [2, 0, 1], [0, 2, 1], [2, 1, 0], [1, 0, 2]] {
            let mut at = low;
            let mut corners = [number(at[0], at[1], at[2]); 4];
            for (k, axis) in path.into_iter().enumerate() {
                at[axis] += 1;
                corners[k + 1] = number(at[0], at[1], at[2]);
            }
            tetrahedra.push(corners);
        }
    }
    (nodes, tetrahedra)
}

/// The block as Gmsh writes it, tags from 10 on, with a triangle and a physical name that are none of our business.
fn msh(version: &str) -> String {
    let (nodes, tetrahedra) = block();
    let mut text =
        format!("$MeshFormat\n{version} 0 8\n$EndMeshFormat\n$PhysicalNames\n1\n3 1 \"block\"\n$EndPhysicalNames\n");
    let (n, t) = (nodes.len(), tetrahedra.len());
    let tag = |node: usize| node + 10;
    if version == "2.2" {
        write!(text, "$Nodes\n{n}\n").unwrap();
        nodes.iter().enumerate().for_each(|(i, p)| writeln!(text, "{} {} {} {}", tag(i), p.x, p.y, p.z).unwrap());
        write!(text, "$EndNodes\n$Elements\n{}\n1 2 2 0 1 10 11 13\n", t + 1).unwrap();
        for (k, c) in tetrahedra.iter().enumerate() {
            writeln!(text, "{} 4 2 0 1 {} {} {} {}", k + 2, tag(c[0]), tag(c[1]), tag(c[2]), tag(c[3])).unwrap();
        }
    } else {
        write!(text, "$Nodes\n1 {n} 10 {}\n3 1 0 {n}\n", tag(n - 1)).unwrap();
        (0..n).for_each(|i| writeln!(text, "{}", tag(i)).unwrap());
        nodes.iter().for_each(|p| writeln!(text, "{} {} {}", p.x, p.y, p.z).unwrap());
        write!(text, "$EndNodes\n$Elements\n2 {} 1 {}\n2 1 2 1\n1 10 11 13\n3 1 4 {t}\n", t + 1, t + 1).unwrap();
        for (k, c) in tetrahedra.iter().enumerate() {
            writeln!(text, "{} {} {} {} {}", k + 2, tag(c[0]), tag(c[1]), tag(c[2]), tag(c[3])).unwrap();
        }
    }
    text + "$EndElements\n"
}

fn build(content: &[u8], material: Material) -> Result<Object, String> {
    let folder = tempfile::tempdir().unwrap();
    let file = folder.path().join("block.msh");
    std::fs::write(&file, content).unwrap();
    let shape = Shape::Tetrahedra { file, scale: 1.0, centre: DVec3::ZERO };
    Object::build(&spec(shape, material, light())).map_err(|error| error.to_string())
}

/// Elastic forces under the displacement `u`, the ground's left out.
fn forces(object: &Object, u: impl Fn(DVec3) -> DVec3) -> Vec<DVec3> {
    let displacement: Vec<DVec3> = object.rest.iter().map(|x| u(*x)).collect();
    let mut forces = vec![DVec3::ZERO; displacement.len()];
    object.stiffness.apply(&displacement, &mut forces);
    forces.iter_mut().zip(&displacement).for_each(|(force, u)| *force -= LIGHT * *u);
    forces
}

/// Uniaxial stress along z: strain there, contraction across.
fn stretch(x: DVec3) -> DVec3 {
    1e-3 * DVec3::new(-POISSON * x.x, -POISSON * x.y, x.z)
}

/// The patch test: a uniform strain leaves the inside of an irregular mesh in balance, and pulls at the ends with E
/// strain area.
#[test]
fn a_uniform_bar_stretches_exactly_whatever_its_mesh() {
    for version in ["2.2", "4.1"] {
        let object = build(msh(version).as_bytes(), elastic(None)).unwrap();
        assert_eq!((object.rest.len(), object.surface_nodes, object.triangles.len()), (27, 26, 48));
        assert!(object.warnings.iter().any(|w| w.contains("24 of 48 tetrahedra")), "{:?}", object.warnings);
        let forces = forces(&object, stretch);
        let pull = YOUNG * 1e-3 * 0.2 * 0.2;
        let mut top = DVec3::ZERO;
        for (x, force) in object.rest.iter().zip(&forces) {
            if x.z > 0.199 {
                top += *force;
            } else if x.z > 0.001 {
                assert!(force.length() < 1e-12 * pull, "{force} at {x}: sides and inside are free");
            }
        }
        assert!((top - pull * DVec3::Z).length() < 1e-12 * pull, "{top} instead of {pull}");
        let turned = self::forces(&object, |x| DVec3::new(0.1, 0.2, 0.3) + DVec3::new(1e-3, -2e-3, 3e-3).cross(x));
        assert!(turned.iter().all(|force| force.length() < 1e-12 * YOUNG), "rigid motions cost nothing");
    }
}

/// Nodes and outward triangles of a box.
fn cuboid(size: DVec3) -> (Vec<DVec3>, Vec<[u32; 3]>) {
    let corner = |k: u32| DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), f64::from(k >> 2 & 1)) * size;
    let faces = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
    let triangles = faces.iter().flat_map(|f| [[f[0], f[1], f[2]], [f[0], f[2], f[3]]]);
    ((0..8).map(corner).collect(), triangles.collect())
}

fn filled(size: DVec3, cell: f64, ground: GroundSpec) -> Object {
    let (nodes, triangles) = cuboid(size);
    let shape = Shape::Mesh { file: "box".into(), scale: 1.0, centre: DVec3::ZERO, refine: None };
    Object::from_surface(&spec(shape, elastic(Some(cell)), ground), nodes, triangles).unwrap()
}

#[test]
fn a_box_filled_with_a_whole_number_of_cubes_stretches_exactly() {
    let object = filled(DVec3::new(0.04, 0.06, 0.1), 0.02, light());
    assert_eq!((object.surface_nodes, object.rest.len()), (8, 8 + 3 * 4 * 6));
    let forces = forces(&object, stretch);
    let pull = YOUNG * 1e-3 * 0.04 * 0.06;
    let top: DVec3 = object.rest.iter().zip(&forces).filter(|(x, _)| x.z > 0.099).map(|(_, force)| *force).sum();
    assert!((top - pull * DVec3::Z).length() < 1e-10 * pull, "{top} instead of {pull}");
    let inner = object.rest.iter().zip(&forces).filter(|(x, _)| (0.001..0.099).contains(&x.z));
    assert!(inner.into_iter().all(|(_, force)| force.length() < 1e-10 * pull));
}

/// A lattice across the surface represents the volume of what it fills: the stretched share of a box that is no whole
/// number of cubes, and of a sphere, to some percent.
#[test]
fn cut_cubes_count_by_their_share() {
    let energy = |object: &Object| -> f64 {
        let u: Vec<DVec3> = object.rest.iter().map(|x| stretch(*x)).collect();
        forces(object, stretch).iter().zip(&u).map(|(f, u)| 0.5 * f.dot(*u)).sum()
    };
    let density = 0.5 * YOUNG * 1e-6;
    let odd = filled(DVec3::new(0.05, 0.07, 0.11), 0.02, light());
    let error = energy(&odd) / (density * 0.05 * 0.07 * 0.11) - 1.0;
    assert!(error.abs() < 0.1, "{error}");
    let shape = Shape::Sphere { centre: DVec3::ZERO, radius: 0.05, rings: 20, segments: 20 };
    let ball = Object::build(&spec(shape, elastic(Some(0.01)), light())).unwrap();
    let error = energy(&ball) / (density * 4.0 / 3.0 * std::f64::consts::PI * 0.05_f64.powi(3)) - 1.0;
    assert!(error.abs() < 0.05, "{error}");
}

/// A clamped bar under a force across its end, against beam theory with shear. Linear tetrahedra are too stiff in
/// bending; the error falls with their size.
#[test]
fn a_cantilever_converges_to_beam_theory() {
    let (width, length, load) = (0.04, 0.2, 0.1);
    let error = |cell: f64| {
        let clamp = GroundSpec { stiffness: 1e6, nodes: GroundNodes::Below(1e-6) };
        let bar = filled(DVec3::new(width, width, length), cell, clamp);
        let mut u = vec![DVec3::ZERO; bar.rest.len()];
        // Spread over the end's lattice nodes: a force on a corner would dent it.
        let end: Vec<usize> = (8..u.len()).filter(|&node| bar.rest[node].z > length - 1e-6).collect();
        end.iter().for_each(|&node| u[node].x = load / end.len() as f64);
        bar.factor.solve(&mut u);
        let deflection = end.iter().map(|&node| u[node].x).sum::<f64>() / end.len() as f64;
        let bending = load * length.powi(3) / (3.0 * YOUNG * width.powi(4) / 12.0);
        let shear = load * length / (5.0 / 6.0 * YOUNG / (2.0 * (1.0 + POISSON)) * width * width);
        deflection / (bending + shear) - 1.0
    };
    let errors = [0.02, 0.01, 0.005].map(error);
    assert!(errors[0] < errors[1] && errors[1] < errors[2] && errors[2] < 0.0, "too stiff, ever less: {errors:?}");
    assert!(errors[1] > 0.45 * errors[0] && errors[2] > 0.45 * errors[1], "{errors:?}");
    assert!(errors[2] > -0.12, "{errors:?}");
}

#[test]
fn springs_may_run_along_tetrahedra() {
    let springs = Material::Springs(SpringSpec { kind: SpringKind::Axial, stiffness: 100.0 });
    let object = build(msh("4.1").as_bytes(), springs).unwrap();
    let (middle, inner) = (26, object.stiffness.row(26).count());
    assert!(inner > 7, "node {middle} is joined to {inner} nodes");
}

/// Young's moduli of the whole solid count where its group or another one that holds it is named.
#[test]
fn a_tetrahedron_may_be_in_several_physical_volumes() {
    let inclusion = |region: u32, young: f64| haptize::scene::InclusionSpec {
        place: haptize::scene::InclusionPlace::Region(region),
        young,
        poisson: POISSON,
    };
    let material = |inclusions: Vec<haptize::scene::InclusionSpec>| {
        Material::Elastic(ElasticSpec { young: YOUNG, poisson: POISSON, cell: None, inclusions })
    };
    let pull = |object: &Object| -> f64 {
        let forces = forces(object, stretch);
        object.rest.iter().zip(&forces).filter(|(x, _)| x.z > 0.199).map(|(_, force)| force.z).sum()
    };
    let plain = msh("2.2");
    let once = build(plain.as_bytes(), elastic(None)).unwrap();
    // As Gmsh writes it: the elements of the second group behind those of the first, with the same numbers.
    let elements: Vec<&str> = plain.lines().filter(|line| line.contains(" 4 2 0 1 ")).collect();
    let of_group = |group: i32| -> String {
        elements.iter().map(|line| line.replace(" 4 2 0 1 ", &format!(" 4 2 {group} 1 ")) + "\n").collect()
    };
    let head = plain.split("\n2 4 2").next().unwrap().replace("$Elements\n49", "$Elements\n97");
    let twice = format!("{head}\n{}{}$EndElements\n", of_group(1), of_group(-2));
    let entities = "$Entities\n1 0 1 1\n1 0 0 0 0\n5 0 0 0\n1 1 1 0 0\n1 0 0 0 1 1 1 2 1\n-2 1 5\n$EndEntities\n$Nodes";
    let partitioned =
        "$PartitionedEntities\n2\n1\n7 1\n0 0 0 1\n1 3 4 2\n1 2 0 0 0 1 1 1 2 1 -2 0\n$EndPartitionedEntities\n$Nodes";
    let four = |section: &str| msh("4.1").replacen("$Nodes", section, 1);
    for (name, text) in [
        ("twice", twice.clone()),
        ("cp1252", twice.replace("\"block\"", "\"blöck\"")),
        ("entities over lines", four(entities)),
        ("partitioned", four(partitioned)),
    ] {
        let mut bytes = text.into_bytes();
        if name == "cp1252" {
            let at = bytes.iter().position(|byte| *byte == 0xc3).unwrap();
            bytes.remove(at);
        }
        let object = build(&bytes, elastic(None)).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!((object.rest.len(), object.triangles.len()), (once.rest.len(), once.triangles.len()), "{name}");
        for (inclusions, times) in [(vec![inclusion(1, 3.0 * YOUNG)], 3.0), (vec![inclusion(2, 5.0 * YOUNG)], 5.0)] {
            let stiff = build(&bytes, material(inclusions)).unwrap_or_else(|error| panic!("{name}: {error}"));
            assert!((pull(&stiff) / (times * pull(&once)) - 1.0).abs() < 1e-12, "{name}, {times} times");
        }
    }
    let both = vec![inclusion(2, 5.0 * YOUNG), inclusion(1, 3.0 * YOUNG)];
    let error = build(twice.as_bytes(), material(both)).unwrap_err();
    assert!(error.contains("no part of the solid"), "the later one covers the earlier: {error}");
    let parametric = plain.replace("$Nodes", "$ParametricNodes").replace("$EndNodes", "$EndParametricNodes");
    let parametric = parametric.replace("10 0 0 0\n", "10 0 0 0 2 1 0.5 0.5\n");
    assert_eq!(build(parametric.as_bytes(), elastic(None)).unwrap().rest, once.rest);
}

#[test]
fn a_file_that_is_not_from_gmsh_is_not_quoted() {
    for content in ["root:$6$secret:1:\n", "\u{feff}root:$6$secret:1:\n", "$root secret\n", "\n\nsecret"] {
        let error = build(content.as_bytes(), elastic(None)).unwrap_err();
        assert!(error.contains("line ") && !error.contains("secret") && !error.contains("root"), "{error}");
    }
    assert!(build(format!("\u{feff}{}", msh("4.1")).as_bytes(), elastic(None)).is_ok());
}

#[test]
fn damaged_files_are_refused_with_the_line_and_never_panic() {
    for (version, from, to, expected) in [
        ("2.2", "2.2 0 8", "2.2 1 8", "line 2: the file is binary"),
        ("4.1", "4.1 0 8", "3.0 0 8", "line 2: only versions 2.2 and 4.1"),
        ("2.2", "$Nodes\n27", "$Nodes\n28", "line 37: number 1 is missing or none: \"$EndNodes\""),
        ("2.2", "10 0 0 0", "10 0 x 0", "line 10: number 3 is missing or none"),
        ("2.2", "11 0 0 0.1", "10 0 0 0.1", "line 11: node 10 is there twice"),
        ("2.2", "\n2 4 2 0 1 10", "\n2 4 2 0 1 99", "line 41: there is no node 99"),
        ("2.2", "\n2 4 2 0 1 10", "\n2 4 1 0 1 10", "line 41: a tetrahedron must have four nodes"),
        ("4.1", "3 1 0 27", "3 1 0 9223372036854775807", "not such a number as belongs here"),
        ("4.1", "3 1 4 48", "3 1 11 48", "48 tetrahedra of ten nodes (type 11)"),
        ("4.1", "3 1 4 48", "2 1 2 48", "no tetrahedra of four nodes, but 49 triangles (type 2)"),
        ("2.2", "\n2 4 2 0 1 10", "\n2 5 2 0 1 10", "1 hexahedra (type 5) beside 47 tetrahedra"),
        ("2.2", "\n2 4 2 0 1 10", "\n2 6 2 0 1 10", "1 prisms (type 6)"),
        ("2.2", "\n2 4 2 0 1 10", "\n2 7 2 0 1 10", "1 pyramids (type 7)"),
        ("4.1", "2 1 2 1\n", "3 2 7 1\n", "1 pyramids (type 7) beside 48 tetrahedra"),
        ("4.1", "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n", "", "line 5: $Nodes comes before $MeshFormat"),
    ] {
        let text = msh(version);
        assert!(text.contains(from), "{from}");
        let error = build(text.replacen(from, to, 1).as_bytes(), elastic(None)).unwrap_err();
        assert!(error.contains(expected) && error.contains("block.msh"), "{from} -> {to}: {error}");
    }
    let mut refused = 0;
    for version in ["2.2", "4.1"] {
        let text = msh(version);
        for k in 0..60 {
            let mut bytes = text.clone().into_bytes();
            let place = k * 7919 % bytes.len();
            match k % 3 {
                0 => bytes.truncate(place),
                1 => bytes[place] = b"-.9 x\n\xff"[k % 7],
                _ => drop(bytes.drain(place..(place + 40).min(text.len()))),
            }
            refused += usize::from(build(&bytes, elastic(None)).is_err());
        }
    }
    assert!(refused > 60, "{refused} of 120");
}

#[test]
fn a_scene_names_one_shape_and_one_material() {
    let scene = |object: &str| {
        let text = format!(
            "[object]\nground = {{ stiffness = 10.0 }}\n{object}\n[contact]\nstiffness = 100.0\n[grid]\n\
             axes = [{{ start = 0.0, stop = 1.0, count = 2 }}]\n[[proxy.joint]]\nkind = \"revolute\"\n\
             axis = [0, 0, 1]\nlimits = [-1, 1]\nnodes = [{{ at = [1, 0, 0] }}]\n"
        );
        Scene::parse(&text, "solid.toml").map(|scene| scene.object).map_err(|error| error.to_string())
    };
    let sphere = "sphere = { radius = 0.05, rings = 5, segments = 5 }";
    let solid = scene(&format!("{sphere}\nelasticity = {{ young = 1e4, poisson = 0.4, cell = 0.02 }}")).unwrap();
    assert_eq!(
        solid.material,
        Material::Elastic(ElasticSpec { young: 1e4, poisson: 0.4, cell: Some(0.02), inclusions: Vec::new() })
    );
    let springs = "springs = { kind = \"axial\", stiffness = 1.0 }";
    for (object, expected) in [
        (sphere.to_owned(), "no material"),
        (format!("{sphere}\nelasticity = {{ young = 1e4, poisson = 0.4 }}"), "needs cell"),
        (format!("{sphere}\nelasticity = {{ young = 1e4, poisson = 0.5, cell = 0.1 }}"), "poisson"),
        (format!("{sphere}\n{springs}\nelasticity = {{ young = 1e4, poisson = 0.4, cell = 0.1 }}"), "two materials"),
        (format!("{sphere}\ntetrahedra = {{ file = \"a.msh\" }}\n{springs}"), "two shapes"),
        (
            "tetrahedra = { file = \"a.msh\" }\nelasticity = { young = 1e4, poisson = 0.4, cell = 0.1 }".into(),
            "leave cell out",
        ),
    ] {
        let error = scene(&object).unwrap_err();
        assert!(error.contains(expected), "{object}: {error}");
    }
}
