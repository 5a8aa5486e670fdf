//! What a scene does not name is not there: nothing of it in the dataset, in a tick or in a frame; and what it names
//! but cannot act is refused. One table of all effects for each claim.

use glam::DVec3;
use haptize::{
    JointVector,
    contact::Model,
    dataset::Dataset,
    device::{Motion, Recorded},
    field::range::HaptizedRange,
    gpu::{AdapterChoice, Context, GpuSolver},
    object::{Factor, Object},
    proxy::Chain,
    render::{
        coupling::Coupling,
        npmi,
        session::{self, Latest},
        setup::Setup,
        trace::Trace,
    },
    scene::{ContactLaw, ContactSpec, EFFECTS, Effect, Rendering, Scene},
    sweep,
};
use std::{
    collections::{BTreeMap, BTreeSet},
    sync::Arc,
};

/// The sphere under the arm of three joints, every third line of its grid.
fn sphere() -> Scene {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/scenes/sphere.toml");
    // Relaxation asks for a potential.
    let text = std::fs::read_to_string(path).unwrap().replace("\"linear\"", "\"potential\"");
    let mut scene = Scene::parse(&text, path).unwrap();
    for axis in &mut scene.grid.axes {
        (axis.count, axis.step) = (axis.count / 3, 3.0 * axis.step);
    }
    scene
}

/// A scene, haptized.
struct Baked {
    scene: Scene,
    data: Dataset,
    setup: Setup,
}

fn baked(scene: Scene) -> Baked {
    let (data, _) = sweep::baked(&scene).unwrap();
    let setup = Setup::new(&data).unwrap();
    Baked { scene, data, setup }
}

/// With these effects and no others.
fn with(graphics: bool, effects: &[Effect]) -> Baked {
    baked(sphere().with_effects(graphics, effects).unwrap())
}

impl Baked {
    fn motion(&self) -> Motion {
        Motion::through(&self.scene.motion.press, 3).unwrap()
    }

    /// The press, felt by a device that follows it exactly.
    fn felt(&self) -> Trace {
        let plan = self.setup.plan(&self.data, 3.5, 0);
        session::run(&self.setup.haptics, &mut Recorded::new(self.motion()), None, &plan).unwrap()
    }

    /// The object's nodes frame by frame, with the proxy at `places`.
    fn drawn(&self, places: &[(JointVector, f64)]) -> Vec<Vec<DVec3>> {
        let mut graphics = self.setup.graphics(&self.data).unwrap().unwrap();
        let frame = |(q, share): &(JointVector, f64)| {
            graphics.frame(&Latest { proxy: *q, share: *share, ..Latest::default() }, true);
            graphics.motion().nodes().collect()
        };
        places.iter().map(frame).collect()
    }

    /// Where the proxy of `trace` was at each frame, and how much of the contact forces acted.
    fn places(&self, trace: &Trace) -> Vec<(JointVector, f64)> {
        let place = |tick: &haptize::render::trace::Tick| {
            let sample = self.setup.haptics.source().field().unwrap().sample(&tick.proxy);
            (tick.proxy, if sample.contact { sample.share } else { 0.0 })
        };
        trace.ticks.iter().step_by(16).map(place).collect()
    }

    /// Names of the fields in the dataset's file.
    fn fields(&self) -> BTreeSet<String> {
        let file = tempfile::NamedTempFile::new().unwrap();
        self.data.save(file.path()).unwrap();
        let bytes = std::fs::read(file.path()).unwrap();
        let length = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
        let header: serde_json::Map<String, serde_json::Value> = serde_json::from_slice(&bytes[8..8 + length]).unwrap();
        header.into_iter().map(|(name, _)| name).filter(|name| name != "__metadata__").collect()
    }

    /// Everything that is stored at the grid's points, but contact forces, to the last bit.
    fn columns(&self) -> [Vec<u64>; 6] {
        let Dataset { torque, energy, gap, status, residual, iterations, .. } = &self.data;
        let narrow = |column: &[f32]| column.iter().map(|x| x.to_bits().into()).collect();
        [
            torque.iter().map(|x| x.to_bits()).collect(),
            energy.as_ref().unwrap().iter().map(|x| x.to_bits()).collect(),
            narrow(gap.as_ref().unwrap()),
            status.iter().map(|x| u64::from(*x)).collect(),
            narrow(residual.as_ref().unwrap()),
            iterations.as_ref().unwrap().iter().map(|x| u64::from(*x)).collect(),
        ]
    }
}

/// To the last bit: numbers print as the shortest text that reads back as the same ones, and zeros with their sign.
fn bits(what: &impl std::fmt::Debug) -> String {
    format!("{what:?}")
}

#[test]
fn a_dataset_holds_what_its_effects_need_and_all_else_is_the_same_bits() {
    let plain = with(false, &[]);
    let graphics = with(true, &[]);
    let forces: Vec<String> = graphics.fields().difference(&plain.fields()).cloned().collect();
    assert_eq!(forces, ["contact_forces", "contact_nodes", "contact_offsets"]);
    let contacts = graphics.data.contacts.as_ref().unwrap();
    assert!(contacts.nodes.len() > 100);
    for effect in EFFECTS {
        let named = with(false, &[effect]);
        let mut fields = if effect.is_drawn() { graphics.fields() } else { plain.fields() };
        if effect.key == "friction" {
            fields.extend(["normal_force", "slip_jacobian"].map(str::to_owned));
        }
        assert_eq!(named.fields(), fields, "{}", effect.key);
        assert!(named.columns() == plain.columns(), "{}", effect.key);
        if let Some(stored) = &named.data.contacts {
            assert_eq!(
                bits(&(&stored.nodes[..], &stored.forces[..])),
                bits(&(&contacts.nodes[..], &contacts.forces[..]))
            );
        }
    }
}

#[test]
fn each_effect_changes_its_own_loop_and_no_bit_of_the_other() {
    let plain = with(true, &[]);
    let trace = plain.felt();
    let places = plain.places(&trace);
    let (felt, drawn) = (bits(&trace.ticks), bits(&plain.drawn(&places)));
    assert!(trace.ticks.iter().filter(|tick| tick.sample.contact).count() > 500);
    assert!(trace.ticks.iter().all(|tick| tick.fault.is_none()));
    for effect in EFFECTS {
        let named = with(true, &[effect]);
        assert_eq!(bits(&named.felt().ticks) == felt, effect.is_drawn(), "a tick with {}", effect.key);
        assert_eq!(bits(&named.drawn(&places)) == drawn, !effect.is_drawn(), "a frame with {}", effect.key);
    }
}

/// Frames that are not seen change nothing in what is seen later: memory and inertia go on.
#[test]
fn frames_that_are_not_seen_leave_their_traces() {
    let effect = |key: &str| EFFECTS.into_iter().find(|effect| effect.key == key).unwrap();
    for effects in [&[effect("quasi_static"), effect("smoothing")][..], &[effect("smoothing")]] {
        let named = with(true, effects);
        let places = named.places(&named.felt());
        let last = |is_seen: bool| {
            let mut graphics = named.setup.graphics(&named.data).unwrap().unwrap();
            for (k, (q, share)) in places.iter().enumerate().take(100) {
                let latest = Latest { proxy: *q, share: *share, ..Latest::default() };
                graphics.frame(&latest, is_seen || k == 99);
            }
            graphics.motion().nodes().collect::<Vec<_>>()
        };
        let seen = last(true);
        assert!(seen.iter().zip(&named.setup.object.as_ref().unwrap().rest).any(|(n, rest)| n.distance(*rest) > 1e-4));
        assert_eq!(
            bits(&last(false)),
            bits(&seen),
            "{:?}",
            effects.iter().map(|effect| effect.key).collect::<Vec<_>>()
        );
    }
}

#[test]
fn what_is_named_to_be_off_is_what_was_never_named() {
    let off = [
        ("passivity_control", "[haptics]", "passivity_control = false"),
        ("proxy_inertia", "[haptics]", "proxy_inertia = \"constant\""),
        ("quasi_static", "[graphics]", "quasi_static = false"),
    ];
    let plain = with(true, &[]);
    let trace = plain.felt();
    let places = plain.places(&trace);
    let (felt, drawn) = (bits(&trace.ticks), bits(&plain.drawn(&places)));
    for (key, table, line) in off {
        assert!(EFFECTS.iter().any(|effect| effect.key == key));
        let text = plain.scene.text.replacen(table, &format!("{table}\n{line}"), 1);
        assert_ne!(text, plain.scene.text, "{key}");
        let Scene { grid, .. } = sphere();
        let named = baked(Scene { grid, ..Scene::parse(&text, &plain.scene.path).unwrap() });
        assert!(named.columns() == plain.columns(), "{key}");
        assert!(bits(&named.felt().ticks) == felt && bits(&named.drawn(&places)) == drawn, "{key}");
    }
}

/// Section 3.1 written out: look-up, virtual coupling, one step of the proxy. Where no effect is named that is all
/// there is.
#[test]
fn a_tick_without_effects_is_the_papers_to_the_last_bit() {
    let scene = sphere().with_effects(false, &[]).unwrap();
    // Beyond all limits, which come after.
    let text = scene.text.replace("torque_limit = 1.5", "torque_limit = 1e6").replace("= 500.0", "= 1e9");
    let Scene { grid, .. } = sphere();
    let plain = baked(Scene { grid, contact: scene.contact, ..Scene::parse(&text, &scene.path).unwrap() });
    let Setup { haptics, scene, .. } = &plain.setup;
    assert_eq!((scene.haptics.torque_limit[0], scene.haptics.torque_rate_limit[0]), (1e6, 1e9));
    let coupling = Coupling::new(&scene.haptics);
    let proxy = {
        let mut middle = JointVector::zeros(3);
        for (q, axis) in middle.iter_mut().zip(&plain.data.grid.axes) {
            *q = 0.5 * (axis.coordinate(0) + axis.coordinate(axis.count - 1));
        }
        let mut pose = plain.setup.chain.new_pose();
        plain.setup.chain.pose(&middle, &mut pose);
        let limits: Vec<[f64; 2]> = plain.setup.chain.joints.iter().map(|joint| joint.limits).collect();
        npmi::Npmi::new(&plain.setup.chain.inertia(&pose), &limits).unwrap()
    };
    let range = HaptizedRange::new(&plain.data, &plain.setup.chain).unwrap();
    let period = haptics.period();
    let trace = plain.felt();
    let mut motion = npmi::Motion::at_rest(&range.nearest(&trace.start));
    let (mut before, mut v_hat) = (trace.start, JointVector::zeros(3));
    let mut touched = 0;
    for (k, tick) in trace.ticks.iter().enumerate() {
        let y = tick.device;
        let mut w = JointVector::zeros(3);
        w.iter_mut().enumerate().for_each(|(a, w)| *w = (y[a] - before[a]) / period);
        let sample = haptics.source().field().unwrap().sample(&motion.position);
        let torque = coupling.device_torque(&y, &w, &motion.position, &v_hat);
        assert_eq!(bits(&(motion.position, torque)), bits(&(tick.proxy, tick.device_torque)), "tick {k}");
        let stops = range.stops(&motion.position, &motion.velocity, period, proxy.limits());
        v_hat = proxy.step(&mut motion, period, &coupling.proxy_load(&y, &w, &sample.torque, stops)).velocity;
        before = y;
        touched += usize::from(sample.contact);
    }
    assert!(touched > 500);
}

/// Section 3.2 written out: one passive step of the nodes under the interpolated forces.
#[test]
fn a_frame_without_effects_is_the_papers_to_the_last_bit() {
    let plain = with(true, &[]);
    let object = plain.setup.object.as_ref().unwrap();
    let places = plain.places(&plain.felt());
    let period = 1.0 / 60.0;
    let inertia = || object.mechanics().unwrap().mass.iter().zip(&object.mechanics().unwrap().damping);
    let diagonal: Vec<f64> = inertia().map(|(m, b)| 2.0 * m / period + b).collect();
    let factor = Factor::of(&object.mechanics().unwrap().stiffness, 0.5 * period, &diagonal).unwrap();
    let forces = haptize::render::graphics::ContactForces::new(&plain.data, object.rest.len()).unwrap();
    let zero = vec![DVec3::ZERO; object.rest.len()];
    let (mut u, mut v, mut f, mut right) = (zero.clone(), zero.clone(), zero.clone(), zero);
    let mut most: f64 = 0.0;
    for ((q, share), nodes) in places.iter().zip(plain.drawn(&places)) {
        forces.at(q, *share, &mut f);
        object.mechanics().unwrap().stiffness.apply(&u, &mut right);
        for (k, right) in right.iter_mut().enumerate() {
            *right = f[k] + (2.0 * object.mechanics().unwrap().mass[k] / period) * v[k] - *right;
        }
        factor.solve(&mut right);
        for (k, v_hat) in right.iter().enumerate() {
            u[k] += period * v_hat;
            v[k] = 2.0 * v_hat - v[k];
            most = most.max(u[k].length());
        }
        let here: Vec<DVec3> = object.rest.iter().zip(&u).map(|(rest, u)| rest + u).collect();
        assert_eq!(bits(&here), bits(&nodes));
    }
    assert!(most > 1e-3, "{most}");
}

/// Labels of all buffers in the memory of `context`, by the allocator's own books, and pipelines, by wgpu's.
fn held(context: &Context) -> (BTreeMap<String, usize>, usize) {
    let (instance, _, device, _) = context.shared();
    // What was written is on its way in buffers of wgpu's own.
    device.poll(wgpu::PollType::wait_indefinitely()).unwrap();
    let mut labels = BTreeMap::new();
    for allocation in device.generate_allocator_report().unwrap().allocations {
        if !allocation.name.starts_with("(wgpu internal)") {
            *labels.entry(allocation.name).or_default() += 1;
        }
    }
    (labels, instance.generate_report().unwrap().hub.compute_pipelines.num_kept_from_user)
}

/// What `make` has made on the device, label by label, and pipelines.
fn made<T>(context: &Context, make: impl FnOnce() -> T) -> (T, (BTreeMap<String, usize>, usize)) {
    let before = held(context);
    let thing = make();
    let (mut labels, pipelines) = held(context);
    for (label, count) in before.0 {
        *labels.get_mut(&label).unwrap() -= count;
    }
    labels.retain(|_, count| *count > 0);
    (thing, (labels, pipelines - before.1))
}

#[test]
fn a_gpu_that_haptizes_knows_of_no_effect() {
    let context = Arc::new(Context::open(AdapterChoice::Any).unwrap());
    if context.adapter().interface != "Vulkan" {
        // Others keep no such books.
        return;
    }
    let [plain, felt] = [&[][..], &EFFECTS[..5]].map(|effects| {
        let scene = sphere().with_effects(false, effects).unwrap();
        let (object, chain) = (Object::build(&scene.object).unwrap(), Chain::new(&scene.proxy));
        let model = Model::new(&object, &chain, ContactSpec { law: ContactLaw::Rest, ..scene.contact });
        let context = Arc::new(Context::open(AdapterChoice::Any).unwrap());
        let (solver, found) = made(&context, || GpuSolver::new(Arc::clone(&context), &model).unwrap());
        drop(solver);
        found
    });
    assert!(plain == felt && plain.0.len() > 5 && plain.1 == 1, "{plain:?} {felt:?}");
}

#[test]
fn an_effect_that_cannot_act_is_an_error_that_says_so() {
    // A real object tells torques alone, and has no nodes to draw.
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/datasets/sponge.toml");
    let scan = std::fs::read_to_string(path).unwrap();
    assert!(Rendering::parse(&scan, path).is_ok());
    // A virtual one whose dataset was gridized from measurements, or has lost its contact forces.
    let without_forces = |effect: Effect| {
        let mut baked = with(true, &[effect]);
        (baked.data.contacts, baked.data.slip) = (None, None);
        Setup::new(&baked.data).err().map(|error| error.to_string())
    };
    for effect in EFFECTS {
        let told = without_forces(effect);
        let lacks = if effect.is_drawn() { "contact forces" } else { "how contacts slip" };
        match (effect.is_stored(), &told) {
            (true, Some(told)) => assert!(told.contains(effect.key) && told.contains(lacks), "{told}"),
            (needs, _) => assert!(!needs && told.is_none(), "{}: {told:?}", effect.key),
        }
        if effect.is_drawn() {
            let text = format!("{scan}\n[graphics]\n{} = {}\n", effect.key, effect.value(&sphere()));
            let told = Rendering::parse(&text, path).unwrap_err().to_string();
            assert!(told.contains(effect.key) && told.contains("the scene has none: leave it out"), "{told}");
            let line = 1 + text[..text.rfind(effect.key).unwrap()].matches('\n').count();
            assert!(told.contains(&format!("sponge.toml:{line}:")), "{told}");
        }
    }
    // A graphics loop without effects is only not there where nothing moves the object.
    let mut plain = with(true, &[]);
    plain.data.contacts = None;
    assert!(Setup::new(&plain.data).unwrap().object.is_none());
    // Channels of no share.
    let text = sphere().text.replacen("[haptics]", "[haptics]\nfour_channel = { channels = [0, 0, 0, 0] }", 1);
    let told = Scene::parse(&text, "s.toml").unwrap_err().to_string();
    assert!(told.contains("four_channel cannot act") && told.contains("leave it out"), "{told}");
}
