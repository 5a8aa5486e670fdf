//! Figures: complete, deterministic, and robust against broken data.

use glam::{DMat3, DVec3};
use haptize::{
    JointVector,
    contact::Status,
    dataset::{Axis, Contacts, Dataset, Grid, JointLabel, Surface},
    device::Applied,
    draw::canvas::{Anchor, Canvas, TextStyle, Weight},
    field::Sample,
    object::Object,
    proxy::{Chain, Node as ProxyNode},
    render::{
        accounts::Accounts,
        haptic::Inputs,
        timing::{Durations, Timing},
        trace::{Frame, Tick, Trace},
    },
    report::{self},
    scene::{
        GroundNodes, GroundSpec, GroundStiffness, JointKind, JointSpec, Material, ObjectSpec, ProxySpec, Shape,
        SpringKind, SpringSpec,
    },
};
use resvg::{
    tiny_skia::{Pixmap, Rect, Transform},
    usvg::{Group, Node, Options, Tree},
};
use std::{collections::BTreeSet, path::PathBuf, sync::Arc, time::Duration};

const CENTRE: DVec3 = DVec3::new(0.2, 0.0, -0.02);
const RADIUS: f64 = 0.05;

pub fn sphere() -> Object {
    let shape = Shape::Sphere { centre: CENTRE, radius: RADIUS, rings: 10, segments: 10 };
    Object::build(&ObjectSpec {
        shape,
        material: Material::Springs(SpringSpec { kind: SpringKind::Isotropic, stiffness: 300.0 }),
        skin: None,
        ground: Some(GroundSpec { stiffness: GroundStiffness::PerNode(100.0), nodes: GroundNodes::All }),
        node_mass: 1e-3,
        node_damping: 0.1,
    })
    .unwrap()
}

/// An arm whose first joint turns about the vertical and whose others bend downwards, nodes along the last two links.
pub fn arm(joints: usize) -> Chain {
    let length = 0.3 / (joints.max(2) - 1) as f64;
    let joint = |number: usize| JointSpec {
        follows: None,
        name: ["base", "shoulder", "elbow", "wrist", "hand", "finger"][number].to_owned(),
        kind: JointKind::Revolute,
        origin: match number {
            0 => DVec3::new(-0.06, 0.0, 0.12),
            1 => DVec3::ZERO,
            _ => DVec3::X * length,
        },
        axis: if number == 0 { DVec3::Z } else { DVec3::Y },
        limits: [-3.0, 3.0],
        mass: 0.1,
        centre_of_mass: DVec3::ZERO,
        inertia: DMat3::from_diagonal(DVec3::splat(1e-4)),
        rotor_inertia: 1e-4,
        nodes: Vec::new(),
    };
    let node = |link: usize, k: usize| ProxyNode {
        link,
        position: DVec3::X * length * k as f64 / 5.0,
        radius: 0.0,
        length: 0.0,
    };
    let nodes = (joints.saturating_sub(2)..joints).flat_map(|link| (1..=5).map(move |k| node(link, k)));
    let joints = (0..joints).map(joint).collect();
    Chain { nodes: nodes.collect(), ..Chain::new(&ProxySpec { joints, ..Default::default() }) }
}

/// Forces of independent springs on nodes near each buried proxy node, and the torque they make.
fn touch(chain: &Chain, object: &Object, q: &[f64]) -> (JointVector, Vec<(u32, DVec3)>, f64) {
    let mut pose = chain.new_pose();
    chain.pose(q, &mut pose);
    let (mut torque, mut forces, mut gap) = (JointVector::zeros(q.len()), vec![], f64::INFINITY);
    for (number, &x) in pose.nodes.iter().enumerate() {
        let depth = RADIUS - (x - CENTRE).length();
        gap = gap.min(-depth);
        if depth <= 0.0 {
            continue;
        }
        let force = 120.0 * depth * (x - CENTRE).normalize();
        chain.add_torque(&pose, number, force, &mut torque);
        let mut near: Vec<usize> = (0..object.surface_nodes).collect();
        near.sort_by(|&a, &b| object.rest[a].distance(x).total_cmp(&object.rest[b].distance(x)));
        for &node in &near[..3] {
            match forces.iter_mut().find(|(known, _)| *known == node as u32) {
                Some((_, sum)) => *sum -= force / 3.0,
                None => forces.push((node as u32, -force / 3.0)),
            }
        }
    }
    forces.sort_by_key(|&(node, _)| node);
    (torque, forces, gap)
}

/// A dataset of an arm over a sphere, without solving anything: good enough to look at.
pub fn dataset(chain: &Chain, object: &Object, counts: &[usize]) -> Dataset {
    let starts = [-0.5, 0.1, -0.1, -0.2, -0.2, -0.2];
    let axis = |(number, &count): (usize, &usize)| Axis {
        name: chain.joints[number].name.clone(),
        unit: "rad".to_owned(),
        start: starts[number],
        step: std::f64::consts::PI / 60.0,
        count,
    };
    let grid = Grid { axes: counts.iter().enumerate().map(axis).collect() };
    let points = grid.points();
    let (mut torques, mut statuses, mut gaps) = (vec![], vec![], vec![]);
    let (mut offsets, mut nodes, mut forces) = (vec![0_u64], vec![], vec![]);
    for point in 0..points {
        let (torque, touched, gap) = touch(chain, object, &grid.configuration(point));
        torques.extend_from_slice(&torque);
        statuses.push(if touched.is_empty() { Status::Free } else { Status::Contact } as u8);
        gaps.push(gap as f32);
        for (node, force) in touched {
            nodes.push(node);
            forces.extend(force.as_vec3().to_array());
        }
        offsets.push(nodes.len() as u64);
    }
    Dataset {
        gap: Some(gaps.into()),
        contacts: Some(Contacts { offsets: offsets.into(), nodes: nodes.into(), forces: forces.into() }),
        surface: Some(Surface::of(object)),
        ..Dataset::bare(grid, torques, statuses)
    }
}

/// A press into the sphere between 0.6 s and 2.4 s.
pub fn recording(chain: &Chain, object: &Object, ticks: usize) -> Trace {
    let joints = chain.joints.len();
    let push = |time: f64| (std::f64::consts::PI * (time - 0.5) / 2.0).sin().max(0.0);
    let tick = |index: usize| {
        let time = index as f64 * 1e-3;
        let q: Vec<f64> =
            (0..joints).map(|joint| [0.15, 0.22 + 0.32 * push(time), 0.2, 0.1, 0.1, 0.1][joint]).collect();
        let (torque, forces, _) = touch(chain, object, &q);
        let q = JointVector::from_slice(&q);
        let stored = 0.02 * torque.norm();
        Tick {
            time,
            inputs: Inputs { position: q, age: 0.0, elapsed: 1e-3, interval: 1e-3 },
            hand: q,
            device: q,
            proxy: q,
            device_torque: torque,
            applied: Applied::whole(&torque),
            sample: Sample {
                torque,
                index: f64::from(u8::from(!forces.is_empty())),
                contact: !forces.is_empty(),
                contact_nodes: forces.len() as u32,
                ..Sample::default()
            },
            accounts: Accounts {
                stored,
                kinetic: 1e-4 * (5.0 * time).sin().powi(2),
                spring: 0.3 * stored,
                coupling_work: 1.3 * stored + 1e-3 * time,
                field_work: -stored,
                proxy_dissipation: 4e-4 * time,
                coupling_dissipation: 6e-4 * time,
                leak: 2e-5 * (9.0 * time).sin(),
                ..Accounts::default()
            },
            ..Tick::default()
        }
    };
    let ticks: Vec<Tick> = (0..ticks).map(tick).collect();
    let frame = |tick: &Tick| {
        let (_, forces, _) = touch(chain, object, &tick.proxy);
        let mut displacement = vec![DVec3::ZERO; object.rest.len()];
        forces.iter().for_each(|&(node, force)| displacement[node as usize] = force);
        object.mechanics().unwrap().factor.solve(&mut displacement);
        let nodes = object.rest.iter().zip(&displacement).map(|(rest, u)| *rest + *u);
        Frame { time: tick.time, proxy: tick.proxy, nodes: nodes.take(object.surface_nodes).collect() }
    };
    Trace {
        joints: chain
            .joints
            .iter()
            .map(|joint| JointLabel { name: joint.name.clone(), unit: "rad".to_owned() })
            .collect(),
        frames: ticks.iter().step_by(16).map(frame).collect(),
        ticks,
        ..Trace::default()
    }
}

fn folder(name: &str) -> PathBuf {
    PathBuf::from(env!("CARGO_TARGET_TMPDIR")).join(name)
}

/// Every mark of an SVG, with the fonts that the figures are made for.
fn parsed(svg: &str) -> Tree {
    let mut options = Options::default();
    let fonts = [
        &include_bytes!("../../src/draw/fonts/Roboto-Regular.ttf")[..],
        include_bytes!("../../src/draw/fonts/Roboto-Medium.ttf"),
    ];
    fonts.into_iter().for_each(|font| options.fontdb_mut().load_font_data(font.to_vec()));
    Tree::from_str(svg, &options).unwrap()
}

/// Texts with the boxes of their glyphs.
fn texts(group: &Group, found: &mut Vec<(String, Rect)>) {
    for node in group.children() {
        match node {
            Node::Group(group) => texts(group, found),
            Node::Text(text) => {
                let characters = text.chunks().iter().map(|chunk| chunk.text()).collect();
                found.push((characters, text.abs_bounding_box()));
            }
            Node::Path(_) | Node::Image(_) => {}
        }
    }
}

/// Complains about text that leaves the sheet or runs into other text.
fn misplaced_text(canvas: &Canvas) -> Vec<String> {
    let tree = parsed(&canvas.svg());
    let mut found = Vec::new();
    texts(tree.root(), &mut found);
    assert!(!found.is_empty());
    let mut complaints = Vec::new();
    for (number, (text, area)) in found.iter().enumerate() {
        let sheet = tree.size();
        if area.left() < 0.0 || area.top() < 0.0 || area.right() > sheet.width() || area.bottom() > sheet.height() {
            complaints.push(format!("{text:?} leaves the sheet: {area:?}"));
        }
        for (other, other_area) in &found[number + 1..] {
            if area.left() < other_area.right()
                && other_area.left() < area.right()
                && area.top() < other_area.bottom()
                && other_area.top() < area.bottom()
            {
                complaints.push(format!("{text:?} runs into {other:?}"));
            }
        }
    }
    complaints
}

/// Whether the sheet's texts include `wanted`.
fn says(canvas: &Canvas, wanted: &str) -> bool {
    canvas.svg().contains(wanted)
}

/// Share of the pixels that are not white.
fn ink(canvas: &Canvas) -> f64 {
    let picture = canvas.pixels(1.0).unwrap();
    picture.pixels.iter().filter(|&&pixel| pixel != [255; 3]).count() as f64 / picture.pixels.len() as f64
}

/// Counts of grid points that keep chains of one to six joints small.
pub fn counts(joints: usize) -> &'static [usize] {
    [&[30][..], &[12, 30], &[7, 24, 5], &[5, 12, 4, 3], &[3, 9, 3, 2, 2], &[3, 8, 2, 2, 2, 2]][joints - 1]
}

/// All figures of a dataset and a recording.
fn all(dataset: &Dataset, chain: &Chain, trace: &Trace) -> Vec<(&'static str, Canvas)> {
    let mut figures = vec![
        ("space", report::space::space(dataset)),
        ("slices", report::slices::slices(dataset, None)),
        ("press", report::press::press(trace)),
        ("energy", report::press::energy(trace)),
    ];
    if !trace.frames.is_empty() {
        let instants = report::object::instants(dataset, chain, trace, 6, None).unwrap();
        figures.push(("object", report::object::object(dataset, chain, &instants).unwrap()));
    }
    figures
}

/// What a real-time session would say about ticks that came as late as `nanoseconds`.
fn timing(nanoseconds: impl Iterator<Item = u64>) -> Timing {
    let mut durations = Durations::new().unwrap();
    nanoseconds.for_each(|value| durations.record(Duration::from_nanos(value)));
    Timing { lateness: durations.percentiles(), lateness_bins: durations.bins(), ..Timing::default() }
}

#[test]
fn files_are_complete_and_the_same_twice() {
    let (chain, object) = (arm(3), sphere());
    let dataset = dataset(&chain, &object, counts(3));
    let trace = recording(&chain, &object, 1000);
    let write = |name: &str, trace: &Trace| -> Vec<(String, Vec<u8>)> {
        let paths = report::write_figures(&folder(name), &dataset, Some((&chain, trace))).unwrap();
        let name = |path: &PathBuf| path.file_name().unwrap().to_string_lossy().into_owned();
        paths.iter().map(|path| (name(path), std::fs::read(path).unwrap())).collect()
    };
    let once = write("once", &trace);
    let names: Vec<&str> = once.iter().map(|(name, _)| name.as_str()).collect();
    let wanted = [
        "cspace.png",
        "torque.svg",
        "torque.png",
        "motion.svg",
        "motion.png",
        "energy.svg",
        "energy.png",
        "object.png",
    ];
    assert_eq!(names, wanted);
    assert!(once == write("twice", &trace), "the same data gave other bytes");

    let mut other = trace.clone();
    other.ticks[700].sample.torque[1] += 0.05;
    let differing: Vec<String> =
        once.into_iter().zip(write("other", &other)).filter(|(a, b)| a != b).map(|(a, _)| a.0).collect();
    assert_eq!(differing, ["motion.svg", "motion.png"]);
}

/// Several figures stand in one page: a name that two clips share must mean one rectangle, or the page clips one figure
/// as the other.
#[test]
fn clips_of_equal_names_are_equal_rectangles() {
    let figures = all(&dataset(&arm(3), &sphere(), counts(3)), &arm(3), &recording(&arm(3), &sphere(), 1000));
    let mut known = std::collections::BTreeMap::new();
    for (figure, canvas) in &figures {
        let svg = canvas.svg();
        for clip in svg.lines().filter_map(|line| line.split("<clipPath id=\"").nth(1)) {
            let (name, rest) = clip.split_once('"').unwrap();
            let rectangle = rest.split("/>").next().unwrap().to_owned();
            assert!(svg.contains(&format!("url(#{name})")), "{figure}: {name} is not used");
            assert_eq!(
                *known.entry(name.to_owned()).or_insert_with(|| rectangle.clone()),
                rectangle,
                "{figure}: {name}"
            );
        }
    }
    assert!(known.len() > 5, "{known:?}");
}

/// Mean difference between the pixels of `canvas` and those that a renderer of SVG makes of its text, relative to the
/// mean distance from white of the one that is farther from it.
fn difference(canvas: &Canvas, svg: &str) -> f64 {
    let own = canvas.pixels(2.0).unwrap();
    let mut other = Pixmap::new(own.width as u32, own.height as u32).unwrap();
    resvg::render(&parsed(svg), Transform::from_scale(2.0, 2.0), &mut other.as_mut());
    let (mut difference, mut ink) = (0.0, 0.0);
    for (own, other) in own.pixels.iter().zip(other.pixels()) {
        for (&own, other) in own.iter().zip([other.red(), other.green(), other.blue()]) {
            difference += f64::from(own.abs_diff(other));
            ink += f64::from(255 - own.max(other));
        }
    }
    difference / ink
}

/// What [`difference`] may be: the SVG gives coordinates to a hundredth of a point, so that edges differ by shades. One
/// title that is left out makes more.
const ALIKE: f64 = 0.02;

#[test]
fn svg_and_png_show_the_same() {
    let trace = recording(&arm(3), &sphere(), 1000);
    let canvas = report::press::press(&trace);
    let svg = canvas.svg();
    let found = difference(&canvas, &svg);
    assert!(found < ALIKE, "{found}");
    let title = svg.find("<text").unwrap();
    let end = title + svg[title..].find("</text>").unwrap() + "</text>".len();
    let without = difference(&canvas, &(svg[..title].to_owned() + &svg[end..]));
    assert!(without > ALIKE, "{without}");
}

#[test]
fn pictures_have_two_pixels_a_point() {
    let trace = recording(&arm(2), &sphere(), 100);
    let canvas = report::press::press(&trace);
    let png = report::write_png(&folder("size"), "press", &canvas).unwrap();
    let (width, height) = image::image_dimensions(png).unwrap();
    let area = canvas.area();
    assert_eq!((f64::from(width), f64::from(height)), (2.0 * area.width, (2.0 * area.height).ceil()));
}

#[test]
fn no_text_is_clipped_or_overlapped_for_one_to_six_joints() {
    let object = sphere();
    for joints in 1..=6 {
        let chain = arm(joints);
        let dataset = dataset(&chain, &object, counts(joints));
        let trace = recording(&chain, &object, 1000);
        for (name, canvas) in all(&dataset, &chain, &trace) {
            let complaints = misplaced_text(&canvas);
            assert!(complaints.is_empty(), "{name}, {joints} joints: {complaints:#?}");
            assert!(ink(&canvas) > 0.01, "{name}, {joints} joints: nearly empty");
        }
    }
}

#[test]
fn the_check_for_misplaced_text_finds_it() {
    let style =
        TextStyle { size: 12.0, weight: Weight::Regular, colour: haptize::draw::colour::INK, anchor: Anchor::Start };
    let mut canvas = Canvas::new(200.0, 100.0);
    canvas.text((10.0, 50.0), "fits", style);
    assert!(misplaced_text(&canvas).is_empty());
    canvas.text((25.0, 52.0), "overlaps", style);
    assert_eq!(misplaced_text(&canvas).len(), 1);
    canvas.text((190.0, 90.0), "leaves", style);
    assert_eq!(misplaced_text(&canvas).len(), 2);
}

#[test]
fn the_press_has_a_curve_for_every_joint_and_shades_every_contact() {
    let (chain, object) = (arm(3), sphere());
    let trace = recording(&chain, &object, 3000);
    let svg = report::press::press(&trace).svg();
    for joint in 0..3 {
        // A curve and a legend entry in each of three panels; the first colour also draws the number of nodes.
        let strokes = svg.matches(&format!(r#"stroke="{}""#, haptize::draw::colour::series(joint))).count();
        assert_eq!(strokes, 6 + usize::from(joint == 0));
    }
    let contacts = trace.ticks.windows(2).filter(|pair| !pair[0].sample.contact && pair[1].sample.contact).count();
    let shades = svg.matches(&format!(r#"fill="{}""#, haptize::draw::colour::SHADE)).count();
    assert_eq!(contacts, 2);
    assert_eq!(shades, 4 * contacts + 1, "four panels and the legend");
    for title in [
        "Contact torque on the proxy [N m]",
        "Motion from the start [rad]",
        "Object nodes in contact, as its grid point knows them [1]",
        "Time [s]",
    ] {
        assert!(svg.contains(title), "{title}");
    }
}

#[test]
fn prismatic_joints_have_panels_of_their_own() {
    let mut trace = recording(&arm(3), &sphere(), 200);
    trace.joints[2].unit = "m".to_owned();
    let canvas = report::press::press(&trace);
    for title in ["Contact torque on the proxy [N m]", "Contact force on the proxy [N]", "Motion from the start [m]"] {
        assert!(says(&canvas, title), "{title}");
    }
    assert!(misplaced_text(&canvas).is_empty());
}

#[test]
fn the_cloud_has_a_ball_for_every_configuration_in_contact() {
    let (chain, object) = (arm(3), sphere());
    let mut dataset = dataset(&chain, &object, counts(3));
    let contacts = dataset.status.iter().filter(|&&status| status == Status::Contact as u8).count();
    let full = report::space::space(&dataset);
    assert!(says(&full, &format!("{contacts} of 840 configurations in contact")));
    let with_balls = ink(&full);
    dataset.status = vec![Status::Free as u8; 840].into();
    let empty = report::space::space(&dataset);
    assert!(says(&empty, "none of 840 configurations in contact"));
    assert!(with_balls > ink(&empty) + 0.005);
}

#[test]
fn slices_show_the_boundary_and_mark_what_did_not_converge() {
    let (chain, object) = (arm(3), sphere());
    let mut dataset = dataset(&chain, &object, counts(3));
    let sound = report::slices::slices(&dataset, None);
    assert!(says(&sound, "contact boundary") && !says(&sound, "not converged") && !says(&sound, "no data"));
    let cells = sound.svg().matches("<rect").count();
    assert!(cells > 3 * 24 * 5, "{cells} rectangles");
    // One cell of a torque that outdoes all others does not pale these.
    let size = |point: usize| dataset.torque(point)[0].abs();
    let deepest = (0..dataset.status.len()).max_by(|a, b| size(*a).total_cmp(&size(*b))).unwrap();
    let q = dataset.grid.configuration(deepest);
    let drawn = |dataset: &Dataset| report::slices::slices(dataset, Some(&q));
    let colours = |canvas: &Canvas| {
        let svg = canvas.svg();
        svg.split("fill=\"#").skip(1).map(|rest| rest[..6].to_owned()).collect::<BTreeSet<_>>().len()
    };
    let whole = drawn(&dataset);
    let mut torque = dataset.torque.to_vec();
    torque[3 * deepest] *= 100.0;
    dataset.torque = torque.into();
    let cut = drawn(&dataset);
    assert!(says(&cut, "colours end where all but 2 %") && !says(&whole, "colours end"));
    assert!(2 * colours(&cut) > colours(&whole), "{} of {} colours", colours(&cut), colours(&whole));
    let bad =
        |status: &u8| if *status == Status::Contact as u8 { Status::Unconverged as u8 } else { Status::Outside as u8 };
    dataset.status = dataset.status.iter().map(bad).collect::<Vec<u8>>().into();
    let unsound = report::slices::slices(&dataset, None);
    assert!(says(&unsound, "not converged") && says(&unsound, "no data"));
    assert!(unsound.svg().matches("<circle").count() > 10);
    assert!(says(&report::space::space(&dataset), "not converged"));
}

#[test]
fn empty_and_broken_data_give_annotated_figures() {
    let (chain, object) = (arm(3), sphere());
    let trace = Trace::default();
    for canvas in [report::press::press(&trace), report::press::energy(&trace)] {
        assert!(says(&canvas, "no data") && misplaced_text(&canvas).is_empty());
    }
    let no_lateness = report::jitter::jitter(&timing(std::iter::empty()));
    assert!(says(&no_lateness, "no data"));
    assert!(misplaced_text(&no_lateness).is_empty(), "{:?}", misplaced_text(&no_lateness));

    let mut broken = recording(&chain, &object, 300);
    for tick in &mut broken.ticks {
        tick.sample.torque = JointVector::from_slice(&[f64::NAN, f64::INFINITY, 1e300]);
        tick.proxy = JointVector::from_slice(&[f64::NAN]);
        tick.accounts.leak = f64::NEG_INFINITY;
    }
    broken.ticks[7].time = f64::NAN;
    for canvas in [report::press::press(&broken), report::press::energy(&broken)] {
        assert!(says(&canvas, "no data"));
        assert!(ink(&canvas) > 0.01);
    }

    for counts in [&[1, 1, 1][..], &[1], &[1, 1], &[2, 1, 1, 1]] {
        let chain = arm(counts.len());
        let mut dataset = dataset(&chain, &object, counts);
        for (name, canvas) in all(&dataset, &chain, &Trace::default()) {
            assert!(misplaced_text(&canvas).is_empty(), "{name} of {counts:?}: {:?}", misplaced_text(&canvas));
        }
        dataset.torque = vec![f64::NAN; dataset.torque.len()].into();
        dataset.status = vec![Status::Contact as u8; dataset.status.len()].into();
        dataset.gap = None;
        dataset.grid.axes[0].step = f64::NAN;
        for (name, canvas) in all(&dataset, &chain, &Trace::default()) {
            assert!(ink(&canvas) > 0.001, "{name} of {counts:?}");
        }
    }
}

#[test]
fn parts_that_do_not_belong_together_are_refused() {
    let (chain, object) = (arm(3), sphere());
    let mut dataset = dataset(&chain, &object, counts(3));
    let mut trace = recording(&chain, &object, 100);
    let refusal = |chain: &Chain, dataset: &Dataset, trace: &Trace| {
        report::write_figures(&folder("refused"), dataset, Some((chain, trace))).unwrap_err().to_string()
    };
    assert!(refusal(&arm(2), &dataset, &trace).contains("the chain has 2 joints, the dataset 3"));
    trace.frames[0].nodes.truncate(5);
    assert!(refusal(&chain, &dataset, &trace).contains("has 5 nodes, the dataset's surface 102"));
    trace.frames[0].proxy = JointVector::zeros(1);
    assert!(refusal(&chain, &dataset, &trace).ends_with("has 1 joint"));
    dataset.surface = None;
    assert!(report::write_figures(&folder("scanned"), &dataset, Some((&chain, &trace))).is_ok());

    let file = folder("refused").join("cspace.png");
    let error = report::write_figures(&file, &dataset, None).unwrap_err().to_string();
    assert!(error.contains("cannot be written") && error.contains("cspace.png"), "{error}");
}

#[test]
fn figures_are_left_out_when_there_is_no_time_for_them_and_told() {
    let (chain, object) = (Arc::new(arm(3)), sphere());
    let trace = Arc::new(recording(&chain, &object, 20));
    let dataset = Arc::new(dataset(&chain, &object, counts(3)));
    let drawn = |name: &str, is_late: bool| {
        let figures = report::figures(&dataset, Some((&chain, &trace)), None);
        report::write_until(|| is_late, &folder(name), figures).unwrap()
    };
    let all = drawn("in time", false);
    assert!(all.left_out.is_empty() && all.written.iter().all(|file| file.is_file()), "{all:?}");
    assert_eq!(all.written, report::write_figures(&folder("in time"), &dataset, Some((&chain, &trace))).unwrap());
    let late = drawn("late", true);
    assert!(!late.left_out.is_empty() && late.written.iter().all(|file| file.is_file()), "{late:?}");
    assert_eq!(late.left_out.len() + late.written.len(), all.written.len());
}

#[test]
fn lateness_is_counted_in_logarithmic_bins_with_its_quantiles() {
    let values = (0..20_000_u64).map(|k| 300 + k * k % 5_003 + if k == 9 { 400_000 } else { 0 });
    let canvas = report::jitter::jitter(&timing(values));
    assert!(misplaced_text(&canvas).is_empty(), "{:?}", misplaced_text(&canvas));
    for text in ["median", "99 %", "99.9 %", "latest 400 µs", "Lateness [µs]"] {
        assert!(says(&canvas, text), "{text}");
    }
    let bars = canvas.svg().matches("<rect").count() - 1;
    assert!((10..30).contains(&bars), "{bars} bars");
}
