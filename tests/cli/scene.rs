//! Scene files: the shipped ones load, and broken ones say what is wrong, where, and what to do.

use glam::DVec3;
use haptize::scene::{
    ContactLaw, ContactSurface, GraphicsEffects, GraphicsSpec, GroundNodes, Interpolation, JointKind, Material,
    Rendering, Scene, Shape,
};
use haptize::{Error, ErrorKind, JointVector};
use std::{
    collections::BTreeSet,
    path::{Path, PathBuf},
};

fn dataset(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("datasets").join(name)
}

fn shipped(name: &str) -> Scene {
    Scene::load(dataset(name)).unwrap_or_else(|error| panic!("{error}"))
}

/// The least that a scene must say.
pub const LEAST: &str = r#"
[object.sphere]
radius = 0.05
rings = 4
segments = 6
[object.springs]
kind = "axial"
stiffness = 300
[object.ground]
stiffness = 100
[[proxy.joint]]
kind = "revolute"
axis = [0, 0, 2]
limits = [-1, 1]
nodes = [{ at = [0.1, 0, 0] }]
[contact]
stiffness = 1000
[grid]
spacing = 0.1
"#;

pub fn parse(text: &str) -> Result<Scene, Error> {
    Scene::parse(text, "folder/least.toml")
}

/// The error of a scene that is not valid, and its line and column.
pub fn refused(text: &str) -> (Error, (usize, usize)) {
    let error = parse(text).expect_err(text);
    assert_eq!(error.kind(), ErrorKind::Scene, "{error}");
    let place = error.location().unwrap().line.unwrap();
    (error, place)
}

#[test]
fn the_joints_of_the_shipped_scenes_reach_what_is_haptized_and_no_farther() {
    let files = std::fs::read_dir(dataset("")).unwrap().map(|entry| entry.unwrap().file_name().into_string().unwrap());
    let with_grid = |name: &String| {
        name.ends_with(".toml") && std::fs::read_to_string(dataset(name)).unwrap().contains("\n[grid]\n")
    };
    let mut found = BTreeSet::new();
    for name in files.filter(with_grid) {
        let scene = shipped(&name);
        for (joint, axis) in scene.proxy.joints.iter().zip(&scene.grid.axes) {
            let ends = [axis.start, axis.start + (axis.count - 1) as f64 * axis.step];
            for (limit, end) in joint.limits.iter().zip(ends) {
                let agrees = (limit - end).abs() <= axis.step;
                assert!(agrees, "{name}, {}: limit {limit}, grid to {end}", joint.name);
            }
            // But for the digits that a scene gives.
            let beyond = (ends[0] - joint.limits[0]).max(joint.limits[1] - ends[1]);
            assert!(beyond < 1e-3 * axis.step, "{name}, {}: {beyond} beyond the grid", joint.name);
        }
        found.insert(name);
    }
    assert!(found.len() >= 8, "{found:?}");
}

#[test]
fn spheres_have_the_papers_grid() {
    for name in ["paper.toml", "sphere.toml"] {
        let scene = shipped(name);
        assert_eq!(scene.proxy.joints.len(), 3, "{name}");
        assert_eq!(scene.grid.axes.iter().map(|axis| axis.count).product::<usize>(), 8_064, "{name}");
        for axis in &scene.grid.axes {
            assert!((axis.step - std::f64::consts::PI / 60.0).abs() < 1e-15, "{name}");
        }
        assert!(scene.graphics.is_some(), "{name}");
    }
}

#[test]
fn shipped_motions_stay_within_the_grid() {
    for name in ["paper", "sphere", "mesh", "organ", "nodule", "touch", "two_diy", "woodenhaptics"] {
        let scene = shipped(&format!("{name}.toml"));
        assert!(!scene.motion.press.is_empty() && !scene.motion.scrape.is_empty(), "{name}");
        for waypoint in scene.motion.press.iter().chain(&scene.motion.scrape) {
            for (value, axis) in waypoint.q.iter().zip(&scene.grid.axes) {
                let end = axis.start + (axis.count - 1) as f64 * axis.step;
                assert!(*value > axis.start - 1e-9 && *value < end, "{name}: {waypoint:?} leaves {axis:?}");
            }
        }
    }
}

#[test]
fn mesh_scene_mixes_joints_and_names_a_file_beside_it() {
    let scene = shipped("mesh.toml");
    let kinds: Vec<JointKind> = scene.proxy.joints.iter().map(|joint| joint.kind).collect();
    assert_eq!(kinds.len(), 4);
    assert!(kinds.contains(&JointKind::Prismatic) && kinds.contains(&JointKind::Revolute));
    assert!(matches!(&scene.object.shape, Shape::Mesh { file, .. } if *file == dataset("bean.obj")));
    assert!(matches!(scene.object.ground.unwrap().nodes, GroundNodes::Below(_)));
    let points: usize = scene.grid.axes.iter().map(|axis| axis.count).product();
    assert!((6_000..=10_000).contains(&points));
}

#[test]
fn the_organ_is_a_smooth_soft_body_under_six_joints() {
    let scene = shipped("organ.toml");
    assert_eq!(scene.proxy.joints.len(), 6);
    assert_eq!(scene.contact.surface, ContactSurface::Smooth);
    let object = haptize::sweep::build_object(&scene).unwrap();
    assert_eq!((object.surface_nodes, object.triangles.len()), (1002, 2000));
    assert!(object.skin.is_some());
    // The arm is that of the Touch up to its wrist.
    let touch = shipped("touch.toml");
    for (joint, other) in scene.proxy.joints.iter().zip(&touch.proxy.joints) {
        assert_eq!((joint.origin, joint.axis), (other.origin, other.axis), "{}", joint.name);
    }
}

#[test]
fn what_is_not_said_takes_the_documented_default() {
    let scene = parse(LEAST).unwrap();
    assert_eq!((scene.name.as_str(), scene.text.as_str()), ("least", LEAST));
    assert_eq!((scene.object.node_mass, scene.object.node_damping), (0.005, 0.5));
    assert_eq!(scene.object.ground.unwrap().nodes, GroundNodes::All);
    let joint = &scene.proxy.joints[0];
    assert_eq!((joint.name.as_str(), joint.axis, joint.origin), ("q1", DVec3::Z, DVec3::ZERO));
    assert_eq!((joint.mass, joint.rotor_inertia, joint.nodes[0].radius), (0.0, 1e-3, 0.0));
    assert_eq!(scene.contact.law, ContactLaw::Rest);
    assert_eq!((scene.contact.tolerance, scene.contact.max_iterations), (1e-8, 400));
    let axis = scene.grid.axes[0];
    assert_eq!((axis.start, axis.step, axis.count), (-1.0, 0.1, 21));
    let haptics = &scene.haptics;
    assert_eq!((haptics.rate, haptics.threshold, haptics.passivity_factor), (1000.0, 0.5, 1.0));
    assert_eq!(haptics.coupling_stiffness, JointVector::from_slice(&[20.0]));
    assert_eq!(scene.graphics, Some(GraphicsSpec { rate: 60.0, effects: GraphicsEffects::default() }));
    assert!(haptics.proxy_damping_is_free && scene.motion.press.is_empty() && scene.motion.scrape.is_empty());
    assert_eq!(parse(&format!("graphics = false\n{LEAST}")).unwrap().graphics, None);

    let sliding = parse(&LEAST.replace("revolute", "prismatic")).unwrap();
    assert!((sliding.haptics.coupling_stiffness[0] - 2000.0).abs() < 1e-9);
    assert!((sliding.haptics.torque_limit[0] - 15.0).abs() < 1e-9);
    assert_eq!(sliding.proxy.joints[0].rotor_inertia, 0.05);
}

#[test]
fn default_gains_meet_the_passivity_conditions() {
    for scene in [parse(LEAST).unwrap(), parse(&LEAST.replace("revolute", "prismatic")).unwrap(), shipped("mesh.toml")]
    {
        let h = &scene.haptics;
        for j in 0..scene.proxy.joints.len() {
            assert!(h.boundary_slope[j] <= h.passivity_factor * h.proxy_damping[j] * h.rate);
            assert!(h.device_damping[j] >= h.coupling_stiffness[j] / (2.0 * h.rate) + h.coupling_damping[j]);
        }
    }
}

/// A dataset holds its scene: one that was solved by a removed law still opens.
#[test]
fn a_scene_of_a_former_law_is_drawn_and_felt_but_not_solved() {
    let text = LEAST.replace("stiffness = 1000", "stiffness = 1000\nalgorithm = \"linearised\"\nupdates = 2");
    assert!(Rendering::parse(&text, "least.toml").is_ok());
    let text = text.replace("updates = 2", "");
    assert!(parse(&text).unwrap_err().to_string().contains("Take law = \"rest\""));
}

#[test]
fn the_law_of_contact_is_named_by_its_key_or_by_a_former_one() {
    let law = |entry: &str| {
        let text = LEAST.replace("stiffness = 1000", &format!("stiffness = 1000\n{entry}"));
        parse(&text).unwrap().contact.law
    };
    assert_eq!(law(""), ContactLaw::Rest);
    let names = [("following", ContactLaw::Following), ("energy", ContactLaw::Following), ("rest", ContactLaw::Rest)];
    for (name, expected) in names {
        for key in ["law", "geometry", "algorithm"] {
            assert_eq!(law(&format!("{key} = \"{name}\"")), expected);
        }
    }
}

#[test]
fn the_smooth_surface_is_touched_unless_the_scene_says_otherwise() {
    let surface = |contact: &str, node: &str| {
        let text = LEAST
            .replace("{ at = [0.1, 0, 0] }", node)
            .replace("stiffness = 1000", &format!("stiffness = 1000\n{contact}"));
        Scene::parse(&text, "surface.toml").map(|scene| scene.contact.surface)
    };
    let (point, ball) = ("{ at = [0.1, 0, 0] }", "{ at = [0.1, 0, 0], radius = 0.01 }");
    assert_eq!(surface("", point).unwrap(), ContactSurface::Smooth);
    assert_eq!(surface("", ball).unwrap(), ContactSurface::Smooth);
    assert_eq!(surface("surface = \"facets\"", point).unwrap(), ContactSurface::Facets);
    let refused = surface("surface = \"facets\"", ball).unwrap_err().to_string();
    assert!(refused.contains("leave surface out"), "{refused}");
}

#[test]
fn nodes_along_a_link_share_its_length_and_its_stiffness() {
    let line = |how: &str| {
        let nodes = format!("{{ from = [0, 0, 0], to = [0, 0, 0.3], {how} }}");
        parse(&LEAST.replace("{ at = [0.1, 0, 0] }", &nodes).replace("stiffness = 1000", "stiffness_per_length = 6e4"))
            .unwrap()
    };
    for (how, count) in [("spacing = 0.1", 4), ("spacing = 0.09", 5), ("spacing = 1", 2), ("count = 7", 7)] {
        let scene = line(how);
        let nodes = &scene.proxy.joints[0].nodes;
        assert_eq!(nodes.len(), count, "{how}");
        assert!((nodes[0].length * 2.0 - nodes[count - 1].length - nodes[0].length).abs() < 1e-15);
        let length: f64 = nodes.iter().map(|node| node.length).sum();
        // kc = 3 Kc of all nodes is the stiffness of the link, however many they are.
        let kc: f64 = nodes.iter().map(|node| 3.0 * scene.contact.node_stiffness(node.length)).sum();
        assert!((length - 0.3).abs() < 1e-15 && (kc - 6e4 * 0.3).abs() < 1e-9, "{how}: {length} {kc}");
    }
    // Without a stiffness per length each node has that of the scene.
    let plain = parse(LEAST).unwrap();
    assert_eq!(plain.contact.node_stiffness(plain.proxy.joints[0].nodes[0].length), 1000.0);
}

#[test]
fn a_skin_is_told_by_what_one_knows_of_it() {
    let skin = |keys: &str| {
        let spheres = "rings = 4\nsegments = 6\n\
         [object.springs]\nkind = \"axial\"\nstiffness = 300\n\
         [object.ground]\nstiffness = 100\n";
        assert!(LEAST.contains(spheres));
        parse(&LEAST.replace(spheres, &format!("edge = 0.004\n{keys}\n"))).unwrap().object
    };
    let object = skin("[object.skin]\ntension = 260\nwidth = 0.0175\nfoundation = 1.6e5");
    assert_eq!((&object.material, &object.ground), (&Material::Hollow, &None));
    assert!(matches!(object.shape, Shape::Icosphere { divisions: 16, .. }));
    let found = object.skin.unwrap();
    assert_eq!((found.tension, found.foundation), (260.0, 1.6e5));
    assert!((found.bending - 0.079_625).abs() < 1e-12);
    // A plate of 2 mm that keeps its volume.
    let plate = skin("[object.skin]\nthickness = 0.002\nyoung = 9e5\nfoundation = 1e5").skin.unwrap();
    assert!((plate.bending - 8e-4).abs() < 1e-15 && (plate.tension - 600.0).abs() < 1e-9);
    let foundation = skin("[object.skin]\nfoundation = 1e6\nwidth = 0.01").skin.unwrap();
    assert!((foundation.bending - 0.01).abs() < 1e-15);
    let solid = "[object.skin]\nwidth = 0.01\n[object.elasticity]\nyoung = 2e4\npoisson = 0.0\ncell = 0.01\n\
     [object.ground]\nstiffness = 1";
    assert!((skin(solid).skin.unwrap().bending - 0.01).abs() < 1e-15);
}

#[test]
fn interpolation_is_smooth_where_there_is_an_energy_to_interpolate() {
    let interpolation = |text: &str| parse(text).unwrap().haptics.interpolation;
    assert_eq!(interpolation(LEAST), Interpolation::Potential);
    assert_eq!(interpolation(&format!("{LEAST}[haptics]\ninterpolation = \"linear\"")), Interpolation::Linear);
    let scan = Rendering::load(dataset("sponge.toml")).unwrap();
    assert_eq!(scan.haptics.interpolation, Interpolation::Linear);
}

#[test]
fn an_axis_needs_any_two_of_step_stop_and_count() {
    let axis = |entry: &str| {
        let grid = format!("axes = [{{ start = -0.5, {entry} }}]\nspacing = 0.1");
        parse(&LEAST.replace("spacing = 0.1", &grid)).unwrap().grid.axes[0]
    };
    for entry in
        ["step = 0.1, count = 11", "count = 11", "stop = 0.5, count = 11", "stop = 0.5, step = 0.1", "stop = 0.5"]
    {
        let axis = axis(entry);
        assert_eq!(axis.count, 11, "{entry}");
        assert!((axis.step - 0.1).abs() < 1e-12, "{entry}");
    }
}

#[test]
fn gains_are_given_once_or_joint_by_joint() {
    let two = LEAST
        .replace("[contact]", "[[proxy.joint]]\nkind = \"revolute\"\naxis = [1, 0, 0]\nlimits = [0, 1]\n[contact]");
    let with =
        |gain: &str| parse(&format!("{two}[haptics]\ndevice_inertia = {gain}\n")).unwrap().haptics.device_inertia;
    assert_eq!(with("2"), JointVector::from_slice(&[2.0, 2.0]));
    assert_eq!(with("[2, 3.5]"), JointVector::from_slice(&[2.0, 3.5]));
}

/// A broken scene: what replaces what in [`LEAST`], the text at whose line the message must point, and words in it.
type Broken = (&'static str, &'static str, &'static str, &'static [&'static str]);

const BROKEN: &[Broken] = &[
    ("stiffness = 300", "stiffness = -300", "stiffness = -300", &["stiffness", "-300", "positive"]),
    ("stiffness = 100\n", "stiffness = nan\n", "stiffness = nan", &["NaN", "positive"]),
    ("stiffness = 1000", "stiffness = inf", "stiffness = inf", &["inf", "positive"]),
    ("stiffness = 1000", "stiffness = 1e30", "stiffness = 1e30", &["unit"]),
    ("stiffness = 1000", "stifness = 1000", "stifness", &["unknown field `stifness`", "`stiffness`", "`tolerance`"]),
    ("stiffness = 1000", "stiffness = \"1000\"", "stiffness = \"1000\"", &["string", "rigid"]),
    ("stiffness = 1000", "stiffness = 1000\ntolerance = 0", "tolerance = 0", &["between 0 and 1"]),
    ("stiffness = 1000", "stiffness = 1000\nmax_iterations = 0", "max_iterations", &["at least 1"]),
    ("stiffness = 1000", "stiffness = 1000\nlaw = \"magic\"", "magic", &["`rest`", "`following`"]),
    ("stiffness = 1000", "stiffness = 1000\nupdates = 2", "updates = 2", &["linearised", "leave it out"]),
    (
        "stiffness = 1000",
        "stiffness = 1000\nalgorithm = \"linearised\"",
        "linearised",
        &["was removed", "Take law = \"rest\""],
    ),
    (
        "stiffness = 1000",
        "stiffness = 1000\nlaw = \"rest\"\nalgorithm = \"following\"",
        "algorithm = \"following\"",
        &["named twice", "keep `law`"],
    ),
    ("stiffness = 1000", "stiffness = 1000\nsurface = \"round\"", "round", &["facets", "smooth"]),
    (
        "stiffness = 1000",
        "stiffness = 1000\nlaw = \"paper\"",
        "law = \"paper\"",
        &["only `haptize paper` solves by it", "Leave law out"],
    ),
    ("stiffness = 1000", "", "[contact]", &["no stiffness", "stiffness_per_length"]),
    ("stiffness = 1000", "stiffness_per_length = 1e5", "per_length = 1e5", &["{ at = .. }", "of each node instead"]),
    ("stiffness = 1000", "stiffness = \"rigid\"\nstiffness_per_length = 1e5", "rigid", &["leave out one"]),
    ("stiffness = 1000", "stiffness = 1000\nround = 0", "round = 0", &["positive"]),
    (
        "stiffness = 1000",
        "stiffness = 1000\nlaw = \"following\"\nround = 0.01",
        "round",
        &["at rest", "leave round out"],
    ),
    ("stiffness = 1000", "stiffness = 1000\nstiffness_per_length = 0", "per_length = 0", &["positive"]),
    ("stiffness = 1000", "stiffness = 1,000", "1,000", &[]),
    ("stiffness = 1000", "stiffness = 1000\nstiffness = 2", "stiffness = 2", &["duplicate key"]),
    ("radius = 0.05", "radius = 0", "radius = 0", &["positive"]),
    ("rings = 4", "rings = 0", "rings = 0", &["at least 1"]),
    ("rings = 4", "rings = -4", "rings = -4", &["-4"]),
    ("segments = 6", "segments = 2", "segments = 2", &["at least 3"]),
    ("segments = 6", "edge = 0.01", "radius = 0.05", &["one of edge", "rings with segments"]),
    (
        "[object.sphere]\nradius = 0.05\nrings = 4\nsegments = 6",
        "[object.mesh]\nfile = \"a.obj\"\nrefine = 0",
        "refine",
        &["positive"],
    ),
    ("rings = 4\nsegments = 6", "edge = 0", "edge = 0", &["between"]),
    ("rings = 4\nsegments = 6", "subdivisions = 40", "subdivisions = 40", &["at most 9"]),
    ("[object.ground]\nstiffness = 100", "", "[object", &["nothing holds", "foundation"]),
    ("[object.ground]", "[object.skin]\n[object.ground]", "[object.skin]", &["resists nothing", "bending or width"]),
    ("[object.ground]", "[object.skin]\nthickness = 1e-3\n[object.ground]", "thickness", &["go together"]),
    ("[object.ground]", "[object.skin]\npoisson = 0.4\nbending = 1\n[object.ground]", "poisson", &["goes with"]),
    ("[object.ground]", "[object.skin]\nbending = -1\n[object.ground]", "bending = -1", &["positive"]),
    ("[object.ground]", "[object.skin]\nbending = 1\nwidth = 0.01\n[object.ground]", "width", &["say the same"]),
    ("[object.ground]", "[object.skin]\nwidth = 0.01\n[object.ground]", "width", &["give tension, or bending"]),
    (
        "[object.ground]",
        "[object.skin]\nthickness = 1e-3\nyoung = 1e5\ntension = 10\n[object.ground]",
        "tension",
        &["follows from thickness"],
    ),
    (
        "[object.ground]",
        "[object.skin]\nthickness = 1e-3\nyoung = 1e5\npoisson = 0.6\n[object.ground]",
        "poisson",
        &["between"],
    ),
    (
        "[contact]",
        "[graphics]\nstiffening = { factor = 2, strain = 0.1 }\n[object.skin]\nbending = 1\n[contact]",
        "stiffening",
        &["has a skin"],
    ),
    ("rings = 4", "rings = 100000000000", "rings", &["at most"]),
    ("[object.sphere]", "[object.mesh]\nfile = \"a.obj\"\n[object.sphere]", "[object.", &["two shapes"]),
    ("[object.sphere]\nradius = 0.05\nrings = 4\nsegments = 6\n", "", "[object.springs]", &["no shape"]),
    ("kind = \"axial\"", "kind = \"rubber\"", "rubber", &["`axial`", "`isotropic`"]),
    ("stiffness = 100\n", "stiffness = 100\nnodes = []\n", "nodes = []", &["empty"]),
    ("stiffness = 100\n", "stiffness = 100\nnodes = [1]\nbelow = 0\n", "below", &["keep one"]),
    ("axis = [0, 0, 2]", "axis = [0, 0, 0]", "axis", &["zero", "direction"]),
    ("axis = [0, 0, 2]", "axis = [0, 2]", "axis", &["2 numbers", "needs 3"]),
    ("limits = [-1, 1]", "limits = [-1, 1, 7]", "limits", &["3 numbers", "needs 2"]),
    ("[object.ground]\nstiffness = 100", "[object]\nground = [100]", "ground", &["a table: name each value"]),
    ("nodes = [{ at = [0.1, 0, 0] }]", "nodes = [\n[[0.1, 0, 0]]]", "[[0.1", &["a table: name each value"]),
    ("[grid]", "[haptics]\ndevice_inertia = [\n0]\n[grid]", "0]", &["device_inertia is 0", "positive"]),
    ("limits = [-1, 1]", "limits = [1, -1]", "limits", &["first must be less"]),
    ("limits = [-1, 1]", "limits = [-inf, 1]", "limits", &["finite"]),
    ("limits = [-1, 1]", "limits = [-1, 1]\nmass = -1", "mass", &["zero or positive"]),
    ("limits = [-1, 1]", "limits = [-1, 1]\nrotor_inertia = 0", "rotor_inertia", &["positive"]),
    ("limits = [-1, 1]", "limits = [-1, 1]\ninertia = [1, -1, 1]", "inertia", &["negative"]),
    ("limits = [-1, 1]", "limits = [-1, 1]\ninertia = [1, 1]", "inertia", &["2 numbers", "products"]),
    ("limits = [-1, 1]", "limits = [-1, 1]\ninertia = [1, 1, 1, 2, 0, 0]", "inertia", &["eigenvalue"]),
    ("limits = [-1, 1]", "limits = [-1, 1]\nname = \"a,b\"", "name", &["letters"]),
    ("{ at = [0.1, 0, 0] }", "{ at = [0.1, 0, 0], count = 3 }", "nodes", &["either"]),
    ("{ at = [0.1, 0, 0] }", "{ from = [0, 0, 0], to = [0, 0, 1], count = 3, spacing = 0.1 }", "nodes", &["one of"]),
    ("{ at = [0.1, 0, 0] }", "{ from = [0, 0, 0], to = [0, 0, 1], spacing = 0 }", "nodes", &["spacing", "positive"]),
    ("{ at = [0.1, 0, 0] }", "{ from = [0, 0, 0], to = [0, 0, 1], spacing = 1e-9 }", "nodes", &["at most 4096"]),
    ("{ at = [0.1, 0, 0] }", "{ from = [0, 0, 0], to = [0, 0, 1], count = 1 }", "nodes", &["at least 2"]),
    ("{ at = [0.1, 0, 0] }", "{ at = [0.1, 0, 0], radius = -1 }", "nodes", &["radius", "zero or positive"]),
    ("{ at = [0.1, 0, 0] }", "", "[[proxy.joint]]", &["no link has contact nodes"]),
    ("spacing = 0.1", "spacing = 0", "spacing", &["positive"]),
    ("spacing = 0.1", "spacing = -0.1", "spacing", &["positive"]),
    ("spacing = 0.1", "", "[grid]", &["no resolution"]),
    ("spacing = 0.1", "spacing = 5", "[grid]", &["single point"]),
    ("spacing = 0.1", "spacing = 2e-12", "[grid]", &["1.000e12 points", "37000 GB", "widen the spacing"]),
    ("spacing = 0.1", "spacing = 1e-320", "[grid]", &["points"]),
    ("spacing = 0.1", "axes = []", "axes", &["0 axes for 1 joint"]),
    ("spacing = 0.1", "axes = [{ start = 0 }]", "axes", &["two of"]),
    ("spacing = 0.1", "axes = [{ start = 0, stop = 1, step = 0.1, count = 11 }]", "axes", &["leave one"]),
    ("spacing = 0.1", "axes = [{ start = 0, stop = -1, step = 0.1 }]", "axes", &["upwards"]),
    ("spacing = 0.1", "axes = [{ start = 0, step = 0.1, count = 99 }]", "axes", &["limited to [-1, 1]"]),
    ("spacing = 0.1", "spacing = 0.1\n[haptics]\nrate = 0", "rate", &["between"]),
    ("spacing = 0.1", "spacing = 0.1\n[haptics]\nrate = 1e-30", "rate", &["between 10 and 100000"]),
    ("spacing = 0.1", "spacing = 0.1\n[haptics]\nrate = 1e6", "rate", &["between 10 and 100000"]),
    ("spacing = 0.1", "spacing = 0.1\n[graphics]\nrate = 0.02", "rate", &["between 1 and 10000"]),
    ("spacing = 0.1", "spacing = 0.1\n[haptics]\nthreshold = 1.5", "threshold", &["between 0 and 1"]),
    ("spacing = 0.1", "spacing = 0.1\n[haptics]\ncoupling_stiffness = [1, 2]", "coupling", &["2 numbers for 1"]),
    ("spacing = 0.1", "spacing = 0.1\n[haptics]\ncoupling_stiffness = \"stiff\"", "stiff", &["a number, or a list"]),
    ("spacing = 0.1", "spacing = 0.1\n[haptics]\ntorque_limit = 0", "torque_limit", &["positive"]),
    ("spacing = 0.1", "spacing = 0.1\n[haptics.hand]\ndamping = -1", "damping", &["zero or positive"]),
    ("spacing = 0.1", "spacing = 0.1\n[graphics]\nrate = -60", "rate", &["between"]),
    ("spacing = 0.1", "spacing = 0.1\n[motion]\npress = []", "press", &["at least two"]),
    (
        "spacing = 0.1",
        "spacing = 0.1\n[motion]\npress = [\n{ time = 0, q = [0] },\n{ time = 1, q = [0, 1] }]",
        "{ time = 1",
        &["q has 2 numbers for 1 joint"],
    ),
    (
        "spacing = 0.1",
        "spacing = 0.1\n[motion]\nscrape = [\n{ time = 0, q = [0] },\n{ time = 0, q = [0.1] }]",
        "q = [0.1]",
        &["later than the waypoint before"],
    ),
    (
        "spacing = 0.1",
        "spacing = 0.1\n[motion]\npress = [\n{ time = 2, q = [0] },\n{ time = 3, q = [0.1] }]",
        "time = 2",
        &["begin at 0"],
    ),
    (
        "spacing = 0.1",
        "spacing = 0.1\n[motion]\npress = [\n{ time = 0, q = [0] },\n{ time = 3, q = [1.5] }]",
        "q = [1.5]",
        &["limits [-1, 1]"],
    ),
    ("[grid]", "[grid", "[grid", &[]),
    ("[contact]", "[friction]\n[contact]", "[friction]", &["unknown field `friction`", "`contact`", "`haptics`"]),
];

#[test]
fn broken_scenes_point_at_their_line_and_say_what_to_do() {
    for (old, new, place, words) in BROKEN {
        assert!(LEAST.contains(old), "{old}");
        let text = LEAST.replacen(old, new, 1);
        let (error, (number, column)) = refused(&text);
        let (shown, line) = (error.to_string(), text.lines().nth(number - 1).unwrap_or_default());
        assert!(line.contains(place), "{new:?} points at {line:?}\n{shown}");
        let message = shown.rsplit_once(&format!("\n{number} | ")).unwrap().0;
        for word in *words {
            assert!(message.contains(word), "{new:?} lacks {word:?}: {message}");
        }
        let head = format!("folder/least.toml:{number}:{column}: ");
        assert!(shown.starts_with(&head), "{shown}");
        assert!(shown.lines().last().unwrap().trim_end().ends_with('^'), "{shown}");
    }
}

#[test]
fn the_caret_stands_under_the_value() {
    let shown = refused(&LEAST.replace("stiffness = 300", "stiffness = -300")).0.to_string();
    let expected = "folder/least.toml:8:13: stiffness is -300: it must be positive\n  |\n\
                    8 | stiffness = -300\n  |             ^^^^";
    assert_eq!(shown, expected);
}

#[test]
fn long_lines_and_control_characters_do_not_reach_the_terminal() {
    let wide = format!("name = \"{}\"\nbroken = 1 \u{1b}[31m{}", "x".repeat(5000), "y".repeat(5000));
    let shown = refused(&wide).0.to_string();
    assert!(shown.len() < 1000 && !shown.contains('\u{1b}'), "{shown}");
    // A place far to the right in a line, and one at the end of the text.
    let far = LEAST.replace("limits = [-1, 1]", &format!("limits = [{}-1, nan]", " ".repeat(4000)));
    let shown = refused(&far).0.to_string();
    assert!(shown.len() < 1000 && shown.contains('^'), "{shown}");
    assert_eq!(refused("[object").1.0, 1);
}

#[test]
fn one_gain_for_radians_and_metres_alike_is_refused() {
    let slide = "[[proxy.joint]]\nkind = \"prismatic\"\naxis = [0, 0, 1]\nlimits = [0, 0.5]\n";
    let mixed = LEAST.replace("[contact]", &format!("{slide}[contact]"));
    assert!(parse(&mixed).is_ok());
    let error = parse(&format!("{mixed}[haptics]\nproxy_damping = 0.1\n")).unwrap_err().to_string();
    assert!(error.contains("list of 2 numbers"), "{error}");
}

#[test]
fn missing_files_are_named() {
    let missing = Scene::load("/nowhere/scene.toml").unwrap_err();
    assert!(missing.kind() == ErrorKind::File && missing.to_string().contains("/nowhere/scene.toml"));

    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("scene.toml");
    let text =
        LEAST.replace("[object.sphere]\nradius = 0.05\nrings = 4\nsegments = 6", "[object.mesh]\nfile = \"lost.obj\"");
    std::fs::write(&path, &text).unwrap();
    let error = Scene::load(&path).unwrap_err().to_string();
    assert!(error.contains("scene.toml:3:8: the mesh file") && error.contains("lost.obj"), "{error}");
    std::fs::write(folder.path().join("lost.obj"), "").unwrap();
    assert!(Scene::load(&path).is_ok());
    // The text alone needs no file: a dataset that carries it can be opened anywhere.
    assert!(parse(&text).is_ok());

    std::fs::write(&path, [0xff, 0xfe, 0x00]).unwrap();
    assert_eq!(Scene::load(&path).unwrap_err().kind(), ErrorKind::File);
    assert_eq!(Scene::load(folder.path()).unwrap_err().kind(), ErrorKind::File);
}

#[test]
fn a_scene_cut_short_anywhere_gives_an_error_or_a_whole_scene() {
    let text = std::fs::read_to_string(dataset("mesh.toml")).unwrap();
    for end in (0..text.len()).filter(|&end| text.is_char_boundary(end)).step_by(3) {
        if let Err(error) = Scene::parse(&text[..end], "cut.toml") {
            assert!(error.to_string().contains("cut.toml:"), "{error}");
        }
    }
}

#[test]
fn nested_brackets_do_not_exhaust_the_stack() {
    assert!(parse(&format!("a = {}", "[".repeat(100_000))).is_err());
    assert!(parse(&format!("a = {}", "{ b = ".repeat(100_000))).is_err());
}
