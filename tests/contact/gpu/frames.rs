//! The frame update of the object's nodes against its twin on the CPU.

use super::fixture::{context, load, load_of};
use glam::DVec3;
use haptize::{
    gpu::FrameUpdate,
    object::Object,
    render::graphics::ObjectMotion,
    scene::{ElasticSpec, GraphicsEffects, Material, Scene, SkinSpec, SpringKind, SpringSpec, StiffeningSpec},
};

/// A push on one node for some frames, then none: states of both sides after each frame.
fn frames(check: impl Fn(usize, &ObjectMotion, &[DVec3], &[DVec3])) {
    frames_of(&load("sphere.toml").1, check);
}

/// The same for another object.
fn frames_of(object: &Object, check: impl Fn(usize, &ObjectMotion, &[DVec3], &[DVec3])) {
    let period = 1.0 / 60.0;
    let mut twin = ObjectMotion::new(object, period, &GraphicsEffects::default()).unwrap();
    let mut gpu = FrameUpdate::new(context(), object, period, &GraphicsEffects::default()).unwrap();
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
        // Sums of some hundred terms rounded by 6e-8 each.
        let follow = |node: usize| object.mechanics().unwrap().attachment.follow(node, &displacement);
        let followers: Vec<DVec3> = (0..object.rest.len()).map(follow).collect();
        assert!(relative(&followers, &gpu.drawn().unwrap()) < 1e-5, "frame {frame}: what is drawn");
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
    // The surface of an elastic solid follows the nodes of its elements.
    let elastic = ElasticSpec { young: 1e4, poisson: 0.3, cell: Some(0.03), inclusions: Vec::new() };
    let (_, solid, _) = load_of("sphere.toml", Some(Material::Elastic(elastic)));
    assert!(!solid.mechanics().unwrap().attachment.is_identity());
    frames_of(&solid, |frame, twin, displacement, velocity| {
        assert!(relative(twin.displacement(), displacement) < 1e-3, "frame {frame}");
        assert!(relative(twin.velocity(), velocity) < 1e-3, "frame {frame}");
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
        let update = FrameUpdate::new(context(), &object, 1.0 / 60.0, &GraphicsEffects::default()).unwrap();
        // Numbers of four bytes: two parameters, the structure of K and its blocks, mass and damping, force, state, and
        // right-hand side.
        let others = 2 + (nodes + 1 + blocks) + 9 * blocks + (2 + 4 + 8 + 3) * nodes;
        (stiffness.is_isotropic(), update.takes().bytes / 4 - others, nodes.pow(2))
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
    assert!(FrameUpdate::suits(object.mechanics().unwrap()));
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

#[test]
fn effects_follow_the_cpus_and_leave_nothing_behind_where_they_are_not_named() {
    let (_, object, _) = load("sphere.toml");
    let period = 1.0 / 60.0;
    let none = GraphicsEffects::default();
    let gravity = GraphicsEffects { gravity: Some(DVec3::new(0.0, 2.0, -9.81)), ..none };
    let stiffening = GraphicsEffects { stiffening: Some(StiffeningSpec { factor: 6.0, strain: 0.02 }), ..none };
    let both = GraphicsEffects { gravity: gravity.gravity, ..stiffening };
    let quasi_static = GraphicsEffects { quasi_static: true, ..gravity };
    let mut costs = Vec::new();
    for effects in [none, gravity, stiffening, both, quasi_static] {
        let mut twin = ObjectMotion::new(&object, period, &effects).unwrap();
        let mut update = FrameUpdate::new(context(), &object, period, &effects).unwrap();
        let mut forces = vec![DVec3::ZERO; object.rest.len()];
        for frame in 0..20 {
            forces[17] = if frame < 12 { DVec3::new(1.0, -0.5, 2.0) } else { DVec3::ZERO };
            twin.step(&forces);
            update.step(&forces).unwrap();
            let (displacement, velocity) = update.read().unwrap();
            assert!(relative(twin.displacement(), &displacement) < 1e-3, "{effects:?}, frame {frame}");
            assert_eq!(velocity.len(), twin.velocity().len());
        }
        costs.push(update.takes());
    }
    // A load buffer for gravity and stiffening, reaches and a stage for stiffening; less without dynamics.
    let [plain, heavy, stiff, all, still] = costs[..] else { panic!("{costs:?}") };
    let (nodes, blocks) = (object.rest.len() as u64, object.mechanics().unwrap().stiffness.blocks.len() as u64);
    let beyond = |cost: haptize::gpu::FrameCost| {
        (cost.bytes - plain.bytes, cost.buffers - plain.buffers, cost.dispatches - plain.dispatches)
    };
    assert_eq!(beyond(heavy), (16 * nodes, 1, 0));
    assert_eq!(beyond(stiff), (16 * nodes + 4 * blocks, 2, 1));
    assert_eq!(beyond(all), beyond(stiff));
    assert_eq!(stiff.pipelines, plain.pipelines + 1);
    assert_eq!((heavy.bytes - still.bytes, heavy.buffers - still.buffers), (16 * nodes + 8 * nodes, 1));
}

#[test]
fn on_the_gpu_too_effects_never_raise_energy() {
    let (_, object, _) = load("sphere.toml");
    let stiffening = StiffeningSpec { factor: 20.0, strain: 0.01 };
    let effects = GraphicsEffects { stiffening: Some(stiffening), ..GraphicsEffects::default() };
    let law = haptize::object::Stiffening::new(object.mechanics().unwrap(), stiffening.factor, stiffening.strain);
    for period in [1e-3, 0.3] {
        let mut update = FrameUpdate::new(context(), &object, period, &effects).unwrap();
        let mut forces = vec![DVec3::ZERO; object.rest.len()];
        let (mut before, mut greatest) = (f64::MAX, 0.0_f64);
        for frame in 0..60 {
            let pushed = frame < 20;
            forces[60] = if pushed { DVec3::new(3.0, -5.0, 9.0) } else { DVec3::ZERO };
            update.step(&forces).unwrap();
            let (u, v) = update.read().unwrap();
            let kinetic: f64 =
                v.iter().zip(&object.mechanics().unwrap().mass).map(|(v, m)| 0.5 * m * v.length_squared()).sum();
            let now = kinetic + law.energy(object.mechanics().unwrap(), &u);
            assert!(pushed || now <= before * (1.0 + 1e-6), "{period} s, frame {frame}: {now} after {before}");
            (before, greatest) = (now, greatest.max(now));
        }
        assert!(greatest > 1e-6, "{greatest}");
    }
}

#[test]
fn a_frame_period_that_is_no_time_is_refused() {
    let (_, object, _) = load("sphere.toml");
    for period in [0.0, -0.1, f64::NAN, f64::INFINITY] {
        assert!(FrameUpdate::new(context(), &object, period, &GraphicsEffects::default()).is_err());
    }
}
