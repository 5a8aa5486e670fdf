//! Tetrahedra from Gmsh files.

use super::*;
use haptize::scene::{Scene, SpringKind, SpringSpec};
use std::collections::HashMap;
use std::fmt::Write;

const POISSON: f64 = 0.3;

/// Springs below the underside alone.
fn underside() -> GroundSpec {
    GroundSpec { stiffness: GroundStiffness::PerArea(1e3), nodes: GroundNodes::Below(1e-12) }
}

pub fn homogeneous() -> Material {
    elastic(POISSON, None)
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
pub fn msh(version: &str) -> String {
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
    let shape = Shape::Tetrahedra { file, placement: Placement::METRES };
    let ground = match material {
        Material::Springs(_) => GroundSpec { stiffness: GroundStiffness::PerNode(1.0), nodes: GroundNodes::All },
        _ => underside(),
    };
    Object::build(&spec(shape, material, ground)).map_err(|error| error.to_string())
}

/// Elastic forces on the nodes of K under the displacement `u`.
fn forces(object: &Object, u: impl Fn(DVec3) -> DVec3) -> Vec<DVec3> {
    let displacement: Vec<DVec3> = object.mechanics().unwrap().moved.iter().map(|x| u(*x)).collect();
    let mut forces = vec![DVec3::ZERO; displacement.len()];
    object.mechanics().unwrap().stiffness.apply(&displacement, &mut forces);
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
        let object = build(msh(version).as_bytes(), homogeneous()).unwrap();
        assert_eq!((object.rest.len(), object.surface_nodes, object.triangles.len()), (27, 26, 48));
        assert!(object.warnings.iter().any(|w| w.contains("of 48 tetrahedra 24 were turned")), "{:?}", object.warnings);
        let forces = forces(&object, stretch);
        let pull = YOUNG * 1e-3 * 0.2 * 0.2;
        let mut top = DVec3::ZERO;
        for (x, force) in object.mechanics().unwrap().moved.iter().zip(&forces) {
            if x.z > 0.199 {
                top += *force;
            } else if x.z > 0.001 {
                assert!(force.length() < 1e-12 * pull, "{force} at {x}: sides and inside are free");
            }
        }
        assert!((top - pull * DVec3::Z).length() < 1e-12 * pull, "{top} instead of {pull}");
        let turned = self::forces(&object, |x| DVec3::new(0.1, 0.2, 0.3) + DVec3::new(1e-3, -2e-3, 3e-3).cross(x));
        let held = |x: DVec3| x.z < 0.001;
        let free = object.mechanics().unwrap().moved.iter().zip(&turned).filter(|(x, _)| !held(**x));
        assert!(free.into_iter().all(|(_, force)| force.length() < 1e-12 * YOUNG), "rigid motions cost nothing");
    }
}

/// The block in second order, nodes in the middles of edges moved by `bend` (m), tetrahedra numbered as they are.
fn second_order(version: &str, bend: impl Fn(DVec3) -> DVec3) -> String {
    let (mut nodes, tetrahedra) = block();
    let mut middles = HashMap::new();
    let mut elements = Vec::new();
    for corners in tetrahedra {
        let mut element = corners.to_vec();
        for [a, b] in [[0, 1], [1, 2], [0, 2], [0, 3], [2, 3], [1, 3]] {
            let (a, b) = (corners[a], corners[b]);
            element.push(*middles.entry([a.min(b), a.max(b)]).or_insert_with(|| {
                let middle = nodes[a].midpoint(nodes[b]);
                nodes.push(middle + bend(middle));
                nodes.len() - 1
            }));
        }
        elements.push(element.iter().map(|node| (node + 1).to_string()).collect::<Vec<_>>().join(" "));
    }
    let mut text = format!("$MeshFormat\n{version} 0 8\n$EndMeshFormat\n");
    let (n, t) = (nodes.len(), elements.len());
    if version == "2.2" {
        write!(text, "$Nodes\n{n}\n").unwrap();
        nodes.iter().zip(1..).for_each(|(p, i)| writeln!(text, "{i} {} {} {}", p.x, p.y, p.z).unwrap());
        write!(text, "$EndNodes\n$Elements\n{t}\n").unwrap();
        elements.iter().zip(1..).for_each(|(element, k)| writeln!(text, "{k} 11 2 0 1 {element}").unwrap());
    } else {
        write!(text, "$Nodes\n1 {n} 1 {n}\n3 1 0 {n}\n").unwrap();
        (1..=n).for_each(|i| writeln!(text, "{i}").unwrap());
        nodes.iter().for_each(|p| writeln!(text, "{} {} {}", p.x, p.y, p.z).unwrap());
        write!(text, "$EndNodes\n$Elements\n1 {t} 1 {t}\n3 1 11 {t}\n").unwrap();
        elements.iter().zip(1..).for_each(|(element, k)| writeln!(text, "{k} {element}").unwrap());
    }
    text + "$EndElements\n"
}

#[test]
fn files_of_second_order_are_the_same_solid_with_finer_triangles_and_may_be_curved() {
    let once = build(msh("2.2").as_bytes(), homogeneous()).unwrap();
    let bulge = |x: DVec3| 0.01 * DVec3::new(0.0, 0.0, (x.x * 20.0).sin() * (x.y * 15.0).sin() * x.z / 0.2);
    for version in ["2.2", "4.1"] {
        let straight = build(second_order(version, |_| DVec3::ZERO).as_bytes(), homogeneous()).unwrap();
        assert_eq!((straight.rest.len(), straight.triangles.len()), (125, 4 * 48));
        assert_eq!(straight.mechanics().unwrap().moved.len(), once.mechanics().unwrap().moved.len());
        let [pull, again] = [&once, &straight].map(|object| energy(object, |x| x.z * DVec3::new(x.y, 0.0, x.x)));
        assert!((pull / again - 1.0).abs() < 1e-12, "{pull} {again}");
        // A uniform strain is exact in curved elements, too.
        let curved = build(second_order(version, bulge).as_bytes(), homogeneous()).unwrap();
        assert!(curved.rest.iter().any(|x| x.z > 0.203), "it bulges");
        let scale = YOUNG * 1e-3 * 0.04;
        let forces = forces(&curved, stretch);
        let inner = |x: DVec3| [x.x, x.y].iter().all(|c| (0.01..0.19).contains(c)) && (0.001..0.17).contains(&x.z);
        let count =
            curved.mechanics().unwrap().moved.iter().zip(&forces).filter(|(x, _)| inner(**x)).map(|(x, force)| {
                assert!(force.length() < 1e-11 * scale, "{force} at {x}: the inside is in balance");
            });
        assert!(count.count() > 10);
        let stored = haptize::dataset::Surface::of(&curved).object(&spec(
            Shape::Tetrahedra { file: "gone.msh".into(), placement: Placement::METRES },
            homogeneous(),
            underside(),
        ));
        assert_eq!(
            stored.unwrap().mechanics().unwrap().stiffness,
            curved.mechanics().unwrap().stiffness,
            "a dataset holds it"
        );
    }
    let springs = Material::Springs(SpringSpec { kind: SpringKind::Axial, stiffness: 100.0 });
    let refused = build(second_order("2.2", |_| DVec3::ZERO).as_bytes(), springs).unwrap_err();
    assert!(refused.contains("-order 1"), "{refused}");
    let folded = build(second_order("2.2", |x| 2.0 * (x - DVec3::splat(0.1))).as_bytes(), homogeneous());
    assert!(folded.is_err(), "an element turned inside out is refused");
}

#[test]
fn springs_may_run_along_tetrahedra() {
    let springs = Material::Springs(SpringSpec { kind: SpringKind::Axial, stiffness: 100.0 });
    let object = build(msh("4.1").as_bytes(), springs).unwrap();
    let (middle, inner) = (26, object.mechanics().unwrap().stiffness.row(26).count());
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
        object
            .mechanics()
            .unwrap()
            .moved
            .iter()
            .zip(&forces)
            .filter(|(x, _)| x.z > 0.199)
            .map(|(_, force)| force.z)
            .sum()
    };
    let plain = msh("2.2");
    let once = build(plain.as_bytes(), homogeneous()).unwrap();
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
        let object = build(&bytes, homogeneous()).unwrap_or_else(|error| panic!("{name}: {error}"));
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
    assert_eq!(build(parametric.as_bytes(), homogeneous()).unwrap().rest, once.rest);
}

#[test]
fn a_file_that_is_not_from_gmsh_is_not_quoted() {
    for content in ["root:$6$secret:1:\n", "\u{feff}root:$6$secret:1:\n", "$root secret\n", "\n\nsecret"] {
        let error = build(content.as_bytes(), homogeneous()).unwrap_err();
        assert!(error.contains("line ") && !error.contains("secret") && !error.contains("root"), "{error}");
    }
    assert!(build(format!("\u{feff}{}", msh("4.1")).as_bytes(), homogeneous()).is_ok());
}

#[test]
fn damaged_files_are_refused_with_the_line_and_never_panic() {
    for (version, from, to, expected) in [
        ("2.2", "2.2 0 8", "2.2 1 8", "the number one is expected here"),
        ("2.2", "2.2 0 8", "2.2 1 4", "line 2: its numbers have 4 bytes"),
        ("4.1", "4.1 0 8", "3.0 0 8", "line 2: only versions 2.2 and 4.1"),
        ("2.2", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$PhysicalNames", "$NOD", "line 1: only versions 2.2 and 4.1"),
        ("2.2", "$Nodes\n27", "$Nodes\n28", "line 37: such a number as belongs here"),
        ("2.2", "10 0 0 0", "10 0 x 0", "line 10: such a number as belongs here"),
        ("2.2", "11 0 0 0.1", "10 0 0 0.1", "line 11: node 10 is there twice"),
        ("2.2", "\n2 4 2 0 1 10", "\n2 4 2 0 1 99", "line 41: there is no node 99: save the mesh again"),
        ("2.2", "\n2 4 2 0 1 10", "\n2 4 1 0 1 10", "line 41: there is no node 1"),
        ("4.1", "3 1 0 27", "3 1 0 9223372036854775807", "such a number as belongs here"),
        ("4.1", "3 1 4 48", "3 1 11 48", "line 71: the line ends where a number belongs"),
        ("4.1", "3 1 4 48", "2 1 2 48", "line 71: an element of type 2 must have 3 nodes"),
        ("4.1", "3 1 4 48", "2 1 1 0", "$EndElements is expected here"),
        ("2.2", "\n2 4 2 0 1 10", "\n2 5 2 0 1 10", "line 41: the line ends where a number belongs"),
        ("2.2", "\n2 4 2 0 1 10", "\n2 29 2 0 1 10", "its volume has elements of type 29 (1), of another order"),
        ("4.1", "2 1 2 1\n", "3 2 7 1\n", "the line ends where a number belongs"),
        ("4.1", "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n", "", "line 5: $Nodes comes before $MeshFormat"),
    ] {
        let text = msh(version);
        assert!(text.contains(from), "{from}");
        let error = build(text.replacen(from, to, 1).as_bytes(), homogeneous()).unwrap_err();
        assert!(error.contains(expected) && error.contains("block.msh"), "{from} -> {to}: {error}");
    }
    // All tetrahedra of five nodes overlap, and have no face to themselves.
    let elements: String = (1..6)
        .map(|left_out| {
            let corners: Vec<String> = (1..6).filter(|node| *node != left_out).map(|node| node.to_string()).collect();
            format!("{left_out} 4 2 0 1 {}\n", corners.join(" "))
        })
        .collect();
    let closed = format!(
        "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n5\n1 0 0 0\n2 1 0 0\n3 0 1 0\n4 0 0 1\n5 1 1 1\n$EndNodes\n\
         $Elements\n5\n{elements}$EndElements\n"
    );
    let error = build(closed.as_bytes(), homogeneous()).err().unwrap();
    assert!(error.contains("mesh the solid anew") && error.contains("block.msh"), "{error}");
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
            refused += usize::from(build(&bytes, homogeneous()).is_err());
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
