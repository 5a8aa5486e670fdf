//! One HTML file that shows a session, a configuration or a dataset without anything beside it: the object and the arm
//! in three dimensions, turned by hand, the contact forces, a plane of C-space, and the torque against time.
//!
//! Numbers lie in the page as JSON and as packed arrays. Displacements are 16-bit multiples of a thousandth of the
//! greatest, each frame as its difference from the one before; all else is f32. Frames, ticks and cells of a plane are
//! thinned so that a page takes some 300 kB.

mod pack;

use super::{
    object::{FORCE, Instant, LINK, LINK_THICKNESS, Magnitudes, PROXY_NODE, links, view},
    slices::{Plane, torque_size},
};
use crate::{
    Error,
    contact::NodeForce,
    dataset::{Dataset, JointLabel, Surface},
    draw::{
        colour::{self, ColourMap},
        solid::{self, Cone},
        ticks,
    },
    names::Xml,
    object::Object,
    proxy::{Chain, Triangles, shape_frame},
    render::{
        live::LiveScene,
        setup::labels,
        trace::{Tick, Trace},
    },
    scene::{JointSpec, Rendering, Scene, effort_unit},
};
use glam::DVec3;
use pack::Pack;
use serde_json::{Value, json};
use std::sync::Arc;

/// How every page begins.
pub const OPENING: &str = "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n<meta name=\"generator\" content=\"haptize\">";

const HTML: &str = include_str!("page.html");
const CSS: &str = include_str!("page.css");
const JS: &str = include_str!("page.js");

/// Positions of nodes that a page holds, over all frames (1): 60 frames of the sphere of 2,562 nodes, some 150 kB.
const MOST_POSITIONS: usize = 160_000;
/// Ticks whose torque a page holds (1): two a pixel of the plot.
const MOST_ROWS: usize = 2000;
/// Triangles of all links' shapes that a page holds (1), some 100 kB; an arm of more is drawn from joint to joint.
const MOST_TRIANGLES: usize = 10_000;
/// Steps of the greatest displacement (1): on a screen one is a fraction of a pixel, and the colours have fewer.
const STEPS: f64 = 1000.0;
/// Colours of a map that a page holds (1).
const COLOURS: u32 = 64;

/// What a page shows.
pub struct Page<'a> {
    /// Its title.
    pub title: String,
    /// Figures below it: what, and how much.
    pub facts: Vec<(String, String)>,
    /// The arm's joints.
    pub joints: Vec<JointLabel>,
    /// Object and arm.
    pub body: Option<Body>,
    /// The session.
    pub trace: Option<&'a Trace>,
    /// The torque over two joints.
    pub plane: Option<Plane>,
}

/// Object and arm at some instants.
pub struct Body {
    /// Nodes of the object's surface at rest (m).
    rest: Vec<DVec3>,
    /// Its triangles.
    triangles: Vec<[u32; 3]>,
    /// The arm.
    chain: Chain,
    /// Shapes of its links, each with the joint that moves it.
    shapes: Vec<(Option<usize>, Triangles)>,
    /// Both, ascending in time; one at least. Nodes that are not on the surface come last, and are not shown.
    instants: Vec<Instant>,
}

impl Body {
    /// The object with `surface` and the arm `chain`, as the `scene` shows it, at `instants`; none where there are none.
    #[must_use]
    pub fn new(surface: &Surface, chain: Chain, scene: &str, instants: Vec<Instant>) -> Option<Self> {
        let is_shown = !instants.is_empty();
        is_shown.then(|| Self {
            rest: surface.places().collect(),
            triangles: surface.facets().to_vec(),
            chain,
            shapes: links(scene),
            instants,
        })
    }

    /// Rods and balls of those links that are drawn without a shape, at the first instant; each end with the joint in
    /// whose frame it lies still. A rod ends where the next joint is, which may slide.
    fn rods(&self, is_plain: impl Fn(usize) -> bool, thickness: f64) -> Vec<(Cone, [(usize, DVec3); 2])> {
        let (chain, pose) = (&self.chain, &self.instants[0].pose);
        let mut rods = Vec::new();
        for link in (0..chain.links.len()).filter(|link| is_plain(*link)) {
            let joint = |end: &DVec3| link + usize::from(pose.origins.get(link + 1) == Some(end));
            let links = solid::links(chain, pose, |other| other == link, thickness, LINK);
            rods.extend(links.into_iter().map(|cone| (cone, cone.ends.map(|end| (joint(&end), end)))));
            let nodes = solid::nodes(chain, pose, |other| other == link, thickness, PROXY_NODE);
            rods.extend(nodes.into_iter().map(|cone| (cone, cone.ends.map(|end| (link, end)))));
        }
        rods
    }

    fn packed(&self, pack: &mut Pack) -> Value {
        let Self { rest, triangles, chain, shapes, instants } = self;
        let Magnitudes { middle, radius, displacement: largest, force } = Magnitudes::of(rest, instants);
        let unit = if largest > 0.0 { largest / STEPS } else { 1.0 };

        let mut before = vec![0_i16; 3 * rest.len()];
        let moves: Vec<i16> = instants
            .iter()
            .flat_map(|instant| {
                let displacement = rest.iter().zip(&instant.nodes).flat_map(|(n0, n)| ((*n - *n0) / unit).to_array());
                let now: Vec<i16> = displacement.map(|u| u.round() as i16).collect();
                let moved: Vec<i16> =
                    now.iter().zip(&before).map(|(now, before)| now.saturating_sub(*before)).collect();
                before = now;
                moved
            })
            .collect();

        // Where an arm's shapes would fill the page, it is drawn as one without shapes.
        let count: usize = shapes.iter().map(|(_, (_, triangles))| triangles.len()).sum();
        let shapes: &[_] = if count > MOST_TRIANGLES { &[] } else { shapes };
        let is_plain = |link: usize| !shapes.iter().any(|(joint, _)| *joint == Some(link));
        let poses = instants.iter().flat_map(|instant| {
            (0..chain.links.len()).flat_map(|joint| shape_frame(Some(joint), &instant.pose).to_cols_array())
        });
        let rods = self.rods(is_plain, LINK_THICKNESS * radius);
        let place = |(joint, end): &(usize, DVec3)| {
            shape_frame(Some(*joint), &instants[0].pose).inverse().transform_point3(*end).to_array()
        };
        let flat = |nodes: &[DVec3]| nodes.iter().flat_map(|node| node.to_array()).collect::<Vec<f64>>();
        let links: Vec<Value> = shapes
            .iter()
            .map(|(joint, (nodes, triangles))| {
                json!({
                    "joint": joint,
                    "nodes": pack.put_f32(flat(nodes)),
                    "triangles": pack.put(triangles.as_flattened()),
                })
            })
            .collect();
        let of_force = |at: &NodeForce| [f64::from(at.node), at.force.x, at.force.y, at.force.z];
        json!({
            "rest": pack.put_f32(flat(rest)),
            "triangles": pack.put(triangles.as_flattened()),
            "view": view(middle, instants).to_array(),
            "times": instants.iter().map(|instant| instant.time).collect::<Vec<_>>(),
            "unit": unit,
            "largest": largest,
            "moves": pack.put(&moves),
            "rods": pack.put_f32(rods.iter().flat_map(|(_, ends)| ends.iter().flat_map(place))),
            "owners": pack.put(&rods.iter().flat_map(|(_, ends)| ends.map(|(joint, _)| joint as u8)).collect::<Vec<_>>()),
            "radii": pack.put_f32(rods.iter().flat_map(|(cone, _)| cone.radii)),
            "kinds": pack.put(&rods.iter().map(|(cone, _)| u8::from(cone.colour == PROXY_NODE)).collect::<Vec<_>>()),
            "frames": chain.links.len(),
            "poses": pack.put_f32(poses),
            "links": links,
            "force": force,
            "forces": pack.put_f32(instants.iter().flat_map(|instant| &instant.forces).flat_map(of_force)),
            "counts": instants.iter().map(|instant| instant.forces.len()).collect::<Vec<_>>(),
            "touching": instants.iter().map(|instant| instant.contact_nodes).collect::<Vec<_>>(),
        })
    }
}

impl<'a> Page<'a> {
    /// A session: `trace` of `chain` over `dataset`. `live`: its scene, where contact was solved in every tick.
    ///
    /// # Errors
    /// When frames, dataset and chain do not belong together.
    pub fn session(
        title: String,
        dataset: &Dataset,
        chain: &Chain,
        trace: &'a Trace,
        live: Option<&Arc<LiveScene>>,
    ) -> Result<Self, Error> {
        let nodes: usize = trace.frames.iter().map(|frame| frame.nodes.len()).sum();
        let frames = trace.frames.iter().step_by(nodes.div_ceil(MOST_POSITIONS).max(1));
        let instants = super::object::instants_at(dataset, chain, trace, frames, live.cloned())?;
        let deepest = super::press::deepest(trace);
        let knows = live.is_none() || dataset.energy.is_some();
        let summary = trace.summary();
        let mut facts = vec![
            ("duration".to_owned(), format!("{:.2} s", summary.seconds)),
            ("in contact".into(), format!("{:.0} % of the time", 100.0 * summary.contact_share)),
        ];
        let sizes = [("torque", summary.max_contact_torque, "N m"), ("force", summary.max_contact_force, "N")];
        for (what, size, unit) in sizes.into_iter().filter(|(_, size, _)| *size > 0.0) {
            facts.push((format!("largest contact {what}"), format!("{} {unit}", ticks::number(size, 3))));
        }
        facts.push(solved_by(dataset));
        Ok(Self {
            title,
            facts,
            joints: trace.joints.clone(),
            body: dataset
                .surface
                .as_ref()
                .and_then(|surface| Body::new(surface, chain.clone(), &dataset.scene, instants)),
            trace: Some(trace),
            plane: if knows { Plane::of(dataset, deepest.as_deref()) } else { None },
        })
    }

    /// A dataset: its object at rest, the arm where the torque is largest, and the forces on the arm there.
    #[must_use]
    pub fn dataset(title: String, dataset: &Dataset) -> Self {
        let grid = &dataset.grid;
        let touching = || (0..grid.points()).filter(|point| dataset.status(*point).is_in_contact());
        let size = |point: &usize| torque_size(dataset, *point);
        let deepest = touching().max_by(|a, b| size(a).total_cmp(&size(b))).unwrap_or(0);
        let q = grid.configuration(deepest);
        let counts: Vec<String> = grid.axes.iter().map(|axis| axis.count.to_string()).collect();
        let share = 100.0 * touching().count() as f64 / grid.points().max(1) as f64;
        let facts = vec![
            ("grid".to_owned(), format!("{} points", counts.join(" × "))),
            ("in contact".into(), format!("{share:.0} %")),
            ("shown".into(), "where the torque is largest, the object at rest".into()),
            solved_by(dataset),
        ];
        let chain = Rendering::parse(&dataset.scene, "scene").ok().map(|scene| Chain::new(&scene.proxy));
        let body = dataset.surface.as_ref().zip(chain).and_then(|(surface, chain)| {
            let instant = at_rest(surface, &chain, &q, dataset.forces(deepest).collect());
            Body::new(surface, chain, &dataset.scene, vec![instant])
        });
        let plane = Plane::of(dataset, Some(&q));
        Self { title, facts, joints: labels(grid), body, trace: None, plane }
    }

    /// A scene: its object at rest, and the arm in the middle of its grid or, without one, of its limits.
    ///
    /// # Errors
    /// As for [`Object::build`].
    pub fn scene(scene: &Scene) -> Result<Self, Error> {
        let chain = Chain::new(&scene.proxy);
        let middle = |(number, joint): (usize, &JointSpec)| match scene.grid.axes.get(number) {
            Some(axis) => axis.start + (axis.count / 2) as f64 * axis.step,
            None => (joint.limits[0] + joint.limits[1]) / 2.0,
        };
        let q: Vec<f64> = chain.joints.iter().enumerate().map(middle).collect();
        let object = Object::build(&scene.object)?;
        let surface = Surface::of(&object);
        let facts = vec![
            ("joints".to_owned(), chain.joints.len().to_string()),
            ("nodes of the surface".into(), object.surface_nodes.to_string()),
        ];
        let label = |joint: &JointSpec| JointLabel { name: joint.name.clone(), unit: joint.kind.unit().into() };
        Ok(Self {
            title: scene.name.clone(),
            facts,
            joints: chain.joints.iter().map(label).collect(),
            body: Body::new(&surface, chain.clone(), &scene.text, vec![at_rest(&surface, &chain, &q, Vec::new())]),
            trace: None,
            plane: None,
        })
    }

    /// Returns the page within a frame, to be shown within another page, such as a notebook.
    ///
    /// # Errors
    /// As for [`Page::html`].
    pub fn frame(&self) -> Result<String, Error> {
        let height = if self.trace.is_some() { 960 } else { 640 };
        let (title, html) = (Xml(&self.title), self.html()?);
        Ok(format!(
            r#"<iframe title="{title}" srcdoc="{}" style="width: 100%; height: {height}px; border: 0"></iframe>"#,
            Xml(&html)
        ))
    }

    /// Returns the page.
    ///
    /// # Errors
    /// When memory ends.
    pub fn html(&self) -> Result<String, Error> {
        let mut pack = Pack::default();
        let joint = |(number, joint): (usize, &JointLabel)| {
            let colour = colour::series(number).to_string();
            json!({ "name": joint.name, "unit": joint.unit, "effort": effort_unit(&joint.unit), "colour": colour })
        };
        let colours = |map: ColourMap| -> Vec<String> {
            let share = |k| f64::from(k) / f64::from(COLOURS - 1);
            (0..COLOURS).map(|k| map.at(share(k)).to_string()).collect()
        };
        let deepest = |trace: &Trace| {
            let size = |tick: &&Tick| tick.sample.torque.norm();
            trace.ticks.iter().max_by(|a, b| size(a).total_cmp(&size(b))).map(|tick| tick.time)
        };
        let scene = json!({
            "facts": self.facts,
            "joints": self.joints.iter().enumerate().map(joint).collect::<Vec<_>>(),
            "palette": {
                "arm": LINK.to_string(),
                "node": PROXY_NODE.to_string(),
                "force": FORCE.to_string(),
                "pale": colours(ColourMap::Pale { low: 0.0, high: 1.0 }),
                "diverging": colours(ColourMap::Diverging { bound: 1.0 }),
            },
            "begin": self.trace.and_then(deepest).unwrap_or(0.0),
            "body": self.body.as_ref().map(|body| body.packed(&mut pack)),
            "rows": self.trace.map(|trace| rows(trace, &mut pack)),
            "plane": self.plane.as_ref().map(|plane| packed_plane(plane, &mut pack)),
        });
        // No name within ends the element that holds it.
        let scene = serde_json::to_string(&scene).map_err(|error| crate::error!("the page: {error}"))?;
        let (title, scene) = (Xml(&self.title).to_string(), scene.replace('<', "\\u003c"));
        let data = pack.finish()?;
        // Texts and names of what is filled in take turns; nothing is replaced in what is.
        let parts = HTML.split(['{', '}']).map(|piece| match piece {
            "title" => &title,
            "css" => CSS,
            "version" => env!("CARGO_PKG_VERSION"),
            "scene" => &scene,
            "data" => &data,
            "js" => JS,
            text => text,
        });
        Ok(parts.collect())
    }
}

/// The object at rest, and the arm at `q` (rad or m), on which `forces` act from it (N).
fn at_rest(surface: &Surface, chain: &Chain, q: &[f64], forces: Vec<NodeForce>) -> Instant {
    let mut pose = chain.new_pose();
    chain.pose(q, &mut pose);
    let nodes = surface.places().collect();
    Instant { time: 0.0, nodes, contact_nodes: forces.len() as u32, forces, pose }
}

/// By what the contacts of `dataset` were found.
fn solved_by(dataset: &Dataset) -> (String, String) {
    let provenance = &dataset.provenance;
    ("contact".into(), format!("{} on {}", provenance.algorithm, provenance.backend))
}

/// Ticks of `trace`: of each run of as many as have to be left out but one, that with the largest torque.
fn rows(trace: &Trace, pack: &mut Pack) -> Value {
    let size = |tick: &&Tick| tick.sample.torque.norm();
    let run = trace.ticks.len().div_ceil(MOST_ROWS).max(1);
    let kept = trace.ticks.chunks(run).filter_map(|run| run.iter().max_by(|a, b| size(a).total_cmp(&size(b))));
    let kept: Vec<&Tick> = kept.collect();
    json!({
        "time": pack.put_f32(kept.iter().map(|tick| tick.time)),
        "torque": pack.put_f32(kept.iter().flat_map(|tick| tick.sample.torque.to_vec())),
        "q": pack.put_f32(kept.iter().flat_map(|tick| tick.proxy.to_vec())),
        "contact": pack.put(&kept.iter().map(|tick| u8::from(tick.sample.contact)).collect::<Vec<_>>()),
    })
}

fn packed_plane(plane: &Plane, pack: &mut Pack) -> Value {
    let Plane { axes, start, step, count, torque, bounds, boundary, at, caption } = plane;
    json!({
        "axes": axes,
        "start": start,
        "step": step,
        "count": count,
        "torque": pack.put_f32(torque.iter().copied()),
        "bounds": bounds,
        "boundary": pack.put_f32(boundary.iter().flatten().flat_map(|&(x, y)| [x, y])),
        "at": at,
        "caption": caption,
    })
}
