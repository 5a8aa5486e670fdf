//! The frame update of the object's nodes against its twin on the CPU.

use super::fixture::{context, load, load_of};
use glam::DVec3;
use haptize::{
    gpu::FrameUpdate,
    object::Object,
    render::graphics::ObjectMotion,
    scene::{ElasticSpec, GraphicsEffects, Material, Scene, Shape, SkinSpec, SpringKind, SpringSpec, StiffeningSpec},
};

/// A push on one node for some frames, then none: states of both sides after each frame.
fn frames(check: impl Fn(usize, &ObjectMotion, &[DVec3], &[DVec3])) {
    frames_of(&load("sphere.toml").1, check);
}

/// The same for another object.
fn frames_of(object: &Object, check: impl Fn(usize, &ObjectMotion, &[DVec3], &[DVec3])) {
    let period = 1.0 / 60.0;
    let mut twin = ObjectMotion::new(object, period, &GraphicsEffects::default()).unwrap();
    let mut gpu = FrameUpdate::new(context(), object, period).unwrap();
    for frame in 0..40 {
        let mut forces = vec![DVec3::ZERO; object.rest.len()];
        if frame < 15 {
            forces[17] = DVec3::new(1.0, -0.5, 2.0);
            forces[60] = DVec3::new(0.0, 0.3, 0.0);
        }
        twin.step(&forces);
        gpu.step(&forces).unwrap();
        let (displacement, velocity) = gpu.read().unwrap();
        check(frame, &twin, &displacement, &velocity);
    }
}

/// Largest difference of two fields over the largest of the first.
fn relative(reference: &[DVec3], other: &[DVec3]) -> f64 {
    let size = reference.iter().map(|v| v.length()).fold(0.0, f64::max);
    let error = reference.iter().zip(other).map(|(a, b)| a.distance(*b)).fold(0.0, f64::max);
    error / size
}

/// Stored and kinetic energy of the object (J).
fn energy(object: &Object, displacement: &[DVec3], velocity: &[DVec3]) -> f64 {
    let mut force = vec![DVec3::ZERO; displacement.len()];
    object.mechanics().unwrap().stiffness.apply(displacement, &mut force);
    let stored: f64 = displacement.iter().zip(&force).map(|(u, f)| u.dot(*f)).sum();
    let kinetic: f64 =
        velocity.iter().zip(&object.mechanics().unwrap().mass).map(|(v, m)| m * v.length_squared()).sum();
    0.5 * (stored + kinetic)
}

#[test]
fn frames_follow_the_cpus() {
    // Forty frames of sums of three hundred terms rounded by 6e-8 each.
    frames(|frame, twin, displacement, velocity| {
        assert!(relative(twin.displacement(), displacement) < 1e-4, "frame {frame}");
        assert!(relative(twin.velocity(), velocity) < 1e-4, "frame {frame}");
    });
    // Springs along the edges couple the coordinates: the inverse has nine numbers for a pair of nodes, of which the
    // others need one.
    let axial = Material::Springs(SpringSpec { kind: SpringKind::Axial, stiffness: 300.0 });
    let (_, axial, _) = load_of("sphere.toml", Some(axial));
    frames_of(&axial, |frame, twin, displacement, velocity| {
        assert!(relative(twin.displacement(), displacement) < 1e-4, "frame {frame}");
        assert!(relative(twin.velocity(), velocity) < 1e-4, "frame {frame}");
    });
    let rotated: Vec<DVec3> = [DVec3::X, DVec3::Y].into();
    assert!(relative(&[DVec3::X, DVec3::X], &rotated) > 1.0, "the comparator tells fields apart");
}

/// Where the three coordinates are alike, with a skin too, one number serves a pair of nodes.
#[test]
fn an_isotropic_body_binds_one_number_for_a_pair_of_nodes() {
    let of = |change: &dyn Fn(&mut Scene)| {
        let mut scene = load("sphere.toml").0;
        change(&mut scene);
        let object = Object::build(&scene.object).unwrap();
        let stiffness = &object.mechanics().unwrap().stiffness;
        let (nodes, blocks) = (object.rest.len() as u64, stiffness.blocks.len() as u64);
        let update = FrameUpdate::new(context(), &object, 1.0 / 60.0).unwrap();
        // Numbers of four bytes: room for four parameters, the structure of K and its blocks, mass and damping, force,
        // state, and right-hand side.
        let others = 4 + (nodes + 1 + blocks) + 9 * blocks + (2 + 4 + 8 + 3) * nodes;
        (stiffness.is_isotropic(), update.bytes() / 4 - others, nodes.pow(2))
    };
    let (is_isotropic, numbers, pairs) = of(&|_| ());
    assert!(is_isotropic && numbers == pairs, "{numbers} numbers for {pairs} pairs");
    let skin = SkinSpec { tension: 260.0, bending: 0.08, foundation: 1.6e5 };
    let (is_isotropic, numbers, pairs) = of(&|scene| scene.object.skin = Some(skin));
    assert!(is_isotropic && numbers == pairs, "{numbers} numbers for {pairs} pairs");
    let axial = Material::Springs(SpringSpec { kind: SpringKind::Axial, stiffness: 300.0 });
    let (is_isotropic, numbers, pairs) = of(&|scene| scene.object.material = axial.clone());
    assert!(!is_isotropic && numbers == 9 * pairs, "{numbers} numbers for {pairs} pairs");
}

/// The sphere that ships, 2,562 nodes of which all are drawn, reaches the CPU's frames.
#[test]
fn the_sphere_that_ships_is_drawn_where_the_cpu_has_it() {
    let scene = Scene::load(concat!(env!("CARGO_MANIFEST_DIR"), "/datasets/sphere.toml")).unwrap();
    let object = Object::build(&scene.object).unwrap();
    assert!(FrameUpdate::suits(object.mechanics().unwrap(), &GraphicsEffects::default()));
    frames_of(&object, |frame, twin, displacement, _| {
        // Forty frames of sums of 2,562 terms, rounded by 6e-8 each.
        let error = relative(twin.displacement(), displacement);
        assert!(error < 6e-3, "frame {frame}: {error}");
    });
}

#[test]
fn without_forces_the_objects_energy_never_rises() {
    let (_, object, _) = load("sphere.toml");
    let before = std::cell::Cell::new(f64::MAX);
    let greatest = std::cell::Cell::new(0.0f64);
    frames(|frame, _, displacement, velocity| {
        let now = energy(&object, displacement, velocity);
        assert!(now.is_finite());
        greatest.set(greatest.get().max(now));
        if frame > 15 {
            // To rounding of what is stored: 1e-6 of it.
            assert!(now <= before.get() * (1.0 + 1e-6), "frame {frame}: {now} after {}", before.get());
        }
        before.set(now);
    });
    assert!(greatest.get() > 1e-6 && before.get() < 0.9 * greatest.get(), "it moved, and came to rest");
}

/// Bodies whose surface follows the nodes of their elements, effects, and large bodies are the CPU's.
#[test]
fn what_the_cpu_moves_is_not_taken() {
    let none = GraphicsEffects::default();
    let (_, sphere, _) = load("sphere.toml");
    let suits = |effects: GraphicsEffects| FrameUpdate::suits(sphere.mechanics().unwrap(), &effects);
    assert!(suits(none) && suits(GraphicsEffects { smoothing: Some(0.05), ..none }));
    assert!(!suits(GraphicsEffects { gravity: Some(DVec3::NEG_Z), ..none }));
    assert!(!suits(GraphicsEffects { stiffening: Some(StiffeningSpec { factor: 6.0, strain: 0.02 }), ..none }));
    assert!(!suits(GraphicsEffects { quasi_static: true, ..none }));
    let elastic = ElasticSpec { young: 1e4, poisson: 0.3, cell: Some(0.03), inclusions: Vec::new() };
    let (_, solid, _) = load_of("sphere.toml", Some(Material::Elastic(elastic)));
    assert!(!FrameUpdate::suits(solid.mechanics().unwrap(), &none));
    let refused = FrameUpdate::new(context(), &solid, 1.0 / 60.0).err().unwrap();
    assert!(refused.to_string().contains("the CPU moves it"), "{refused}");
    // 3,602 nodes.
    let mut scene = load("sphere.toml").0;
    let Shape::Sphere { rings, segments, .. } = &mut scene.object.shape else { panic!("a sphere") };
    (*rings, *segments) = (60, 60);
    assert!(!FrameUpdate::suits(Object::build(&scene.object).unwrap().mechanics().unwrap(), &none));
}

#[test]
fn a_frame_period_that_is_no_time_is_refused() {
    let (_, object, _) = load("sphere.toml");
    for period in [0.0, -0.1, f64::NAN, f64::INFINITY] {
        assert!(FrameUpdate::new(context(), &object, period).is_err());
    }
}
