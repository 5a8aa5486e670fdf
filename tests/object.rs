//! The deformable object: its surface, its stiffness and its compliance.

use glam::{DMat3, DVec3};
use haptize::object::{Object, ObjectError, SurfaceDefect};
use haptize::scene::{GroundNodes, GroundSpec, ObjectSpec, Shape, SpringKind, SpringSpec};

fn sphere_spec(kind: SpringKind, nodes: GroundNodes) -> ObjectSpec {
    ObjectSpec {
        shape: Shape::Sphere { centre: DVec3::new(0.1, -0.2, 0.3), radius: 0.05, rings: 10, segments: 10 },
        springs: SpringSpec { kind, stiffness: 300.0 },
        ground: GroundSpec { stiffness: 100.0, nodes },
        node_mass: 0.002,
        node_damping: 0.1,
    }
}

#[test]
fn paper_sphere_has_102_nodes_and_200_outward_triangles() {
    let object = Object::build(&sphere_spec(SpringKind::Isotropic, GroundNodes::All)).unwrap();
    assert_eq!((object.rest.len(), object.surface_nodes, object.triangles.len()), (102, 102, 200));
    assert!(object.warnings.is_empty(), "{:?}", object.warnings);
    let centre = DVec3::new(0.1, -0.2, 0.3);
    for triangle in &object.triangles {
        let [a, b, c] = triangle.map(|node| object.rest[node as usize]);
        assert!((b - a).cross(c - a).dot((a + b + c) / 3.0 - centre) > 0.0, "{triangle:?} faces inward");
    }
}

#[test]
fn compliance_inverts_stiffness() {
    for kind in [SpringKind::Isotropic, SpringKind::Axial] {
        let object = Object::build(&sphere_spec(kind, GroundNodes::All)).unwrap();
        let count = object.rest.len();
        for j in 0..count {
            for axis in DMat3::IDENTITY.to_cols_array_2d().map(DVec3::from_array) {
                let displacement: Vec<DVec3> = (0..count).map(|i| object.compliance.block(i, j) * axis).collect();
                let mut force = vec![DVec3::NAN; count];
                object.stiffness.apply(&displacement, &mut force);
                for (i, force) in force.iter().enumerate() {
                    let expected = if i == j { axis } else { DVec3::ZERO };
                    assert!((*force - expected).abs().max_element() < 1e-12, "{kind:?} {i} {j}: {force}");
                }
            }
        }
    }
}

#[test]
fn an_open_surface_is_refused_at_its_edge() {
    let spec = sphere_spec(SpringKind::Isotropic, GroundNodes::All);
    let whole = Object::build(&spec).unwrap();
    let mut triangles = whole.triangles;
    triangles.remove(17);
    let refused = Object::from_surface(&spec, whole.rest, triangles);
    assert!(
        matches!(refused, Err(ObjectError::Surface { defect: SurfaceDefect::Open { edges: 3, .. }, .. })),
        "{refused:?}"
    );
}
