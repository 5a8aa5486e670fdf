//! The deformed object with the proxy at a few instants (paper's Fig. 6), coloured by displacement, with the contact
//! forces as arrows.

use super::PIXELS;
use crate::{
    Error,
    contact::NodeForce,
    dataset::Dataset,
    draw::{
        canvas::{Anchor, Area, Canvas, Picture},
        chart,
        colour::{Colour, ColourMap, GRID, INK},
        plot::{self, Entry, Mark},
        raster::{Raster, Viewpoint},
        solid::{self, Cone},
        ticks,
    },
    error,
    names::counted,
    object::corners,
    proxy::{Chain, Pose, Triangles, shape_frame, shape_triangles},
    render::{
        graphics::ContactForces,
        live::LiveScene,
        trace::{Frame, Tick, Trace},
    },
    scene::Rendering,
};
use glam::DVec3;
use rayon::prelude::*;
use std::sync::Arc;

/// The object and the proxy at one instant.
pub struct Instant {
    /// (s)
    pub time: f64,
    /// Positions n of the surface nodes (m).
    pub nodes: Vec<DVec3>,
    /// Contact forces on them (N).
    pub forces: Vec<NodeForce>,
    /// Object nodes in contact at the nearest grid point in contact (the recording's number; `forces`, interpolated
    /// between grid points, act on more).
    pub contact_nodes: u32,
    /// The proxy.
    pub pose: Pose,
}

pub(super) const LINK: Colour = Colour::hex(0x8d_97_a5);
pub(super) const PROXY_NODE: Colour = Colour::hex(0x2b_34_40);
pub(super) const FORCE: Colour = Colour::hex(0xd5_5e_00);
const EDGE: Colour = INK.with_opacity(0.28);

/// Radius of the rods that stand for links over the object's (1).
pub(super) const LINK_THICKNESS: f64 = 0.032;

const WIDTH: f64 = 800.0;
const COLUMNS: usize = 3;
const CELL: [f64; 2] = [226.0, 200.0];

/// `count` instants of a recording: from the frame before the first contact to that of the last, evenly. Frames every
/// 50 ms or closer leave something to choose from. `live`: the scene, where its contact was solved in every tick.
///
/// # Errors
/// When frames, dataset and chain do not belong together.
pub fn instants(
    dataset: &Dataset,
    chain: &Chain,
    trace: &Trace,
    count: usize,
    live: Option<Arc<LiveScene>>,
) -> Result<Vec<Instant>, Error> {
    let frames = &trace.frames;
    let touching = |frame: &Frame| tick(trace, frame).is_some_and(|tick| tick.sample.contact);
    let first = frames.iter().position(touching).unwrap_or(0).saturating_sub(1);
    let last = frames.iter().rposition(touching).unwrap_or(frames.len().saturating_sub(1));
    let chosen = (0..count).filter_map(|k| frames.get(first + k * (last - first) / count.saturating_sub(1).max(1)));
    instants_at(dataset, chain, trace, chosen, live)
}

/// The error of a frame that shows only a part of the surface.
fn too_few_nodes(time: f64, nodes: usize, surface: usize) -> Error {
    error!("cannot draw the deformed object: the frame at {time} s has {nodes} nodes, the dataset's surface {surface}")
}

/// The tick of a frame.
fn tick<'a>(trace: &'a Trace, frame: &Frame) -> Option<&'a Tick> {
    let number = trace.ticks.partition_point(|tick| tick.time <= frame.time).checked_sub(1)?;
    Some(&trace.ticks[number])
}

/// The instants of those `frames` of a recording; see [`instants`].
///
/// # Errors
/// As there.
pub fn instants_at<'a>(
    dataset: &Dataset,
    chain: &Chain,
    trace: &'a Trace,
    frames: impl Iterator<Item = &'a Frame>,
    live: Option<Arc<LiveScene>>,
) -> Result<Vec<Instant>, Error> {
    let refused = |reason: String| error!("cannot draw the deformed object: {reason}");
    if chain.joints.len() != dataset.grid.joints() {
        let (joints, axes) = (chain.joints.len(), dataset.grid.joints());
        let joints = counted(joints, ["joint", "joints"]);
        return Err(refused(format!("the chain has {joints}, the dataset {axes}; load both from one scene")));
    }
    if trace.frames.is_empty() {
        return Ok(Vec::new());
    }
    let surface = dataset.surface.as_ref().map_or(0, |surface| surface.nodes.len() / 3);
    let mut pose = chain.new_pose();
    let nodes = trace.frames.iter().map(|frame| frame.nodes.len()).max().unwrap_or(0);
    let all = match live {
        Some(scene) => Ok(Some(ContactForces::live(scene))),
        None => ContactForces::known(dataset).then(|| ContactForces::new(dataset, nodes)).transpose(),
    };
    let all = all.map_err(|error| refused(error.to_string()))?;
    frames
        .map(|frame| {
            let tick = tick(trace, frame);
            let is_touching = tick.is_some_and(|tick| tick.sample.contact);
            if frame.proxy.len() != chain.joints.len() {
                let joints = counted(frame.proxy.len(), ["joint", "joints"]);
                return Err(refused(format!("the frame at {} s has {joints}", frame.time)));
            }
            if frame.nodes.len() < surface {
                return Err(too_few_nodes(frame.time, frame.nodes.len(), surface));
            }
            chain.pose(&frame.proxy, &mut pose);
            let mut forces = vec![DVec3::ZERO; nodes];
            if let (Some(all), true) = (&all, is_touching) {
                all.at(&frame.proxy, 1.0, &mut forces);
            }
            let acting = forces.into_iter().enumerate().filter(|(_, force)| *force != DVec3::ZERO);
            let forces: Vec<_> = acting.map(|(node, force)| NodeForce { node: node as u32, force }).collect();
            // A store does not say how many nodes are in contact.
            let contact_nodes = match tick.map_or(0, |tick| tick.sample.contact_nodes) {
                0 => forces.len() as u32,
                stored => stored,
            };
            Ok(Instant { time: frame.time, nodes: frame.nodes.clone(), forces, contact_nodes, pose: pose.clone() })
        })
        .collect()
}

/// The object at all `instants`, in rows of three, one camera and one colour map for all.
///
/// # Errors
/// When there is no surface or an instant has another number of nodes.
pub fn object(dataset: &Dataset, chain: &Chain, instants: &[Instant]) -> Result<Canvas, Error> {
    let refused = |reason: String| error!("cannot draw the deformed object: {reason}");
    let surface = dataset
        .surface
        .as_ref()
        .ok_or_else(|| refused("the dataset has no surface (it was scanned); there is nothing to draw".to_owned()))?;
    let rest: Vec<DVec3> = surface.places().collect();
    if let Some(instant) = instants.iter().find(|instant| instant.nodes.len() < rest.len()) {
        return Err(too_few_nodes(instant.time, instant.nodes.len(), rest.len()));
    }
    if instants.is_empty() {
        return Err(refused("the recording has no frames; give the scene a [graphics] table".to_owned()));
    }
    let mut scene = Scene::new(chain, &rest, surface.facets(), instants);
    scene.links = links(&dataset.scene);
    let rows = instants.len().div_ceil(COLUMNS);
    let top = chart::MARGIN + 52.0;
    let mut canvas = Canvas::new(WIDTH, top + rows as f64 * (CELL[1] + 34.0) + 8.0);
    chart::headline(&mut canvas, "The object deforms under the haptized contact forces");
    let mut entries = vec![
        Entry { name: "proxy node".to_owned(), colour: PROXY_NODE, mark: Mark::Dot },
        Entry {
            name: format!("force on the arm, longest {} N", ticks::number(scene.magnitudes.force, 2)),
            colour: FORCE,
            mark: Mark::Line,
        },
    ];
    // Nodes of links that are drawn with their shapes lie on these, and are not drawn.
    if chain.nodes.iter().all(|node| scene.links.iter().any(|(joint, _)| *joint == Some(node.link))) {
        entries.remove(0);
    }
    plot::legend(&mut canvas, (WIDTH - chart::MARGIN, chart::MARGIN + 12.0), &entries);
    let pictures: Vec<Picture> = instants.par_iter().map(|instant| scene.picture(instant)).collect();
    for (number, (instant, picture)) in instants.iter().zip(pictures).enumerate() {
        let x = chart::MARGIN + (number % COLUMNS) as f64 * (CELL[0] + 6.0);
        let y = top + (number / COLUMNS) as f64 * (CELL[1] + 34.0);
        let total: DVec3 = instant.forces.iter().map(|force| force.force).sum();
        let time = format!("{} s", ticks::number(instant.time, 2));
        canvas.text((x, y), &time, plot::TITLE);
        let what = match instant.contact_nodes {
            0 => "free".to_owned(),
            nodes => format!("{nodes} nodes in contact, {} N", ticks::number(total.length(), 1)),
        };
        canvas.text((x + plot::TITLE.width(&time) + 10.0, y), &what, plot::NOTE);
        canvas.picture((x, y + 8.0), picture);
        canvas.frame(Area { x, y: y + 8.0, width: CELL[0], height: CELL[1] }, GRID, 1.0);
    }
    let height = 180.0;
    let middle = top + 8.0 + (rows as f64 * (CELL[1] + 34.0) - 34.0) / 2.0;
    let bar = Area { x: WIDTH - 72.0, y: middle - height / 2.0, width: 12.0, height };
    plot::colour_bar(&mut canvas, bar, scene.map, "|u| [mm]", Anchor::Start);
    Ok(canvas)
}

/// Everything that all instants share.
struct Scene<'a> {
    chain: &'a Chain,
    /// Shapes of the links, each with the joint that moves it.
    links: Vec<(Option<usize>, Triangles)>,
    rest: &'a [DVec3],
    triangles: &'a [[u32; 3]],
    view: Viewpoint,
    map: ColourMap,
    magnitudes: Magnitudes,
}

/// How large the object and what happens to it are, over some instants.
#[derive(Clone, Copy)]
pub(super) struct Magnitudes {
    /// Middle of the object at rest, and half its diagonal (m).
    pub(super) middle: DVec3,
    pub(super) radius: f64,
    /// Greatest displacement of a node (m), and greatest force at one (N).
    pub(super) displacement: f64,
    pub(super) force: f64,
}

impl Magnitudes {
    /// That of an object with nodes `rest` at rest (m), at `instants`.
    pub(super) fn of(rest: &[DVec3], instants: &[Instant]) -> Self {
        let [low, high] = corners(rest);
        let moved = instants.iter().flat_map(|instant| rest.iter().zip(&instant.nodes)).map(|(n0, n)| n.distance(*n0));
        let forces = instants.iter().flat_map(|instant| &instant.forces).map(|at| at.force.length());
        let greatest = |sizes: &mut dyn Iterator<Item = f64>| sizes.filter(|size| size.is_finite()).fold(0.0, f64::max);
        Self {
            middle: (low + high) / 2.0,
            radius: (high - low).length() / 2.0,
            displacement: greatest(&mut moved.into_iter()),
            force: greatest(&mut forces.into_iter()),
        }
    }

    /// From tail to tip of the arrow of `force` on the object, as it is felt by the arm and as the window draws it: away
    /// from the node that pushes. That of the greatest force is a little shorter than the object's radius.
    pub(super) fn arrow(&self, force: DVec3) -> DVec3 {
        -(0.7 * self.radius / self.force.max(f64::MIN_POSITIVE)) * force
    }
}

impl<'a> Scene<'a> {
    fn new(chain: &'a Chain, rest: &'a [DVec3], triangles: &'a [[u32; 3]], instants: &[Instant]) -> Self {
        let magnitudes = Magnitudes::of(rest, instants);
        let high = if magnitudes.displacement > 0.0 { 1e3 * magnitudes.displacement } else { 1.0 };
        let mut scene = Self {
            chain,
            links: Vec::new(),
            rest,
            triangles,
            view: Viewpoint::framing(&[], DVec3::NEG_Y, [1, 1]),
            map: ColourMap::Pale { low: 0.0, high },
            magnitudes,
        };
        let mut framed: Vec<DVec3> =
            instants.iter().flat_map(|instant| instant.nodes.iter().take(rest.len())).copied().collect();
        for instant in instants {
            // Proxy nodes at the object, not the whole arm.
            framed
                .extend(instant.pose.nodes.iter().filter(|x| x.distance(magnitudes.middle) < 1.3 * magnitudes.radius));
            framed.extend(scene.arrows(instant).into_iter().map(|(_, tip)| tip));
        }
        scene.view =
            Viewpoint::framing(&framed, view(magnitudes.middle, instants), CELL.map(|side| (side * PIXELS) as usize));
        scene
    }

    /// Returns tail and tip of the arrow of each force on the arm.
    fn arrows(&self, instant: &Instant) -> Vec<(DVec3, DVec3)> {
        // Those under a fiftieth of the greatest would be specks.
        let visible = instant.forces.iter().filter(|at| at.force.length() > 0.02 * self.magnitudes.force);
        let tail = |at: &NodeForce| instant.nodes.get(at.node as usize).copied();
        visible.filter_map(|at| Some((tail(at)?, tail(at)? + self.magnitudes.arrow(at.force)))).collect()
    }

    fn picture(&self, instant: &Instant) -> Picture {
        let mut raster = Raster::new(self.view);
        let displacement = |(n0, n): (&DVec3, &DVec3)| 1e3 * (*n - *n0).length();
        let colours: Vec<Colour> =
            self.rest.iter().zip(&instant.nodes).map(|pair| self.map.colour(displacement(pair))).collect();
        let nodes = &instant.nodes[..self.rest.len()];
        raster.mesh(nodes, self.triangles, &colours);
        draw_proxy(&mut raster, self.chain, &instant.pose, LINK_THICKNESS * self.magnitudes.radius, &self.links);
        let arrows = self.arrows(instant).into_iter();
        let arrows =
            arrows.flat_map(|(tail, tip)| Cone::arrow(tail, tip - tail, 0.022 * self.magnitudes.radius, FORCE));
        raster.cones(&arrows.collect::<Vec<_>>());
        raster.edges(nodes, self.triangles, 1.2, EDGE);
        raster.picture()
    }
}

/// The shapes of the links in the text of a `scene`; none where it says nothing of them.
pub(super) fn links(scene: &str) -> Vec<(Option<usize>, Triangles)> {
    let shapes = Rendering::parse(scene, "scene").map(|scene| scene.shapes).unwrap_or_default();
    shapes.iter().map(|shape| (shape.joint, shape_triangles(shape))).collect()
}

/// Draws the links with their shapes, and those that have none from joint to joint, with the contact nodes on them.
pub(crate) fn draw_proxy(
    raster: &mut Raster,
    chain: &Chain,
    pose: &Pose,
    thickness: f64,
    shapes: &[(Option<usize>, Triangles)],
) {
    for (joint, (nodes, triangles)) in shapes {
        let frame = shape_frame(*joint, pose);
        let nodes: Vec<DVec3> = nodes.iter().map(|node| frame.transform_point3(*node)).collect();
        raster.facets(&nodes, triangles, LINK);
    }
    let is_plain = |link: usize| !shapes.iter().any(|(joint, _)| *joint == Some(link));
    raster.cones(&solid::links(chain, pose, is_plain, thickness, LINK));
    raster.cones(&solid::nodes(chain, pose, is_plain, thickness, PROXY_NODE));
}

/// From the side of the arm and a little from where it pushes, above: the dent is seen in profile.
pub(super) fn view(centre: DVec3, instants: &[Instant]) -> DVec3 {
    let force: DVec3 = instants.iter().flat_map(|instant| &instant.forces).map(|at| at.force).sum();
    let flat = |v: DVec3| DVec3::new(v.x, v.y, 0.0).normalize_or_zero();
    let base = instants.first().and_then(|instant| instant.pose.origins.first()).copied().unwrap_or(centre - DVec3::Y);
    let arm = flat(centre - base);
    let side = if arm == DVec3::ZERO { DVec3::NEG_Y } else { arm.cross(DVec3::Z) };
    let outward = flat(-force);
    let side = if side.dot(outward) < 0.0 { -side } else { side };
    side + 0.55 * outward + 0.45 * DVec3::Z
}

#[cfg(test)]
mod tests {
    use super::*;

    /// An octahedron of radius 50 mm around (0.2, 0, 0).
    fn octahedron() -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        let nodes = axes.into_iter().flat_map(|axis| [axis, -axis]).map(|n| DVec3::X * 0.2 + 0.05 * n).collect();
        let upper = [[0, 2, 4], [2, 1, 4], [1, 3, 4], [3, 0, 4]];
        let lower = [[2, 0, 5], [1, 2, 5], [3, 1, 5], [0, 3, 5]];
        (nodes, upper.into_iter().chain(lower).collect())
    }

    fn instant(nodes: &[DVec3], lowered: f64) -> Instant {
        let mut nodes = nodes.to_vec();
        nodes[4].z -= lowered;
        let pose = Pose { origins: vec![DVec3::new(-0.5, 0.0, 0.4)], ..Pose::default() };
        let force = NodeForce { node: 4, force: DVec3::NEG_Z * 20.0 * lowered };
        let forces = if lowered > 0.0 { vec![force] } else { vec![] };
        Instant { time: 0.0, nodes, contact_nodes: forces.len() as u32, forces, pose }
    }

    fn at(picture: &Picture, scene: &Scene, point: DVec3) -> [u8; 3] {
        let seen = scene.view.project(point).unwrap();
        picture.pixels[seen.y as usize * picture.width + seen.x as usize]
    }

    #[test]
    fn vertices_end_where_the_camera_projects_them() {
        let (nodes, triangles) = octahedron();
        let chain = Chain::default();
        let instants = [instant(&nodes, 0.0)];
        let scene = Scene::new(&chain, &nodes, &triangles, &instants);
        let picture = scene.picture(&instants[0]);
        let centre = DVec3::X * 0.2;
        // Upper, lower and the two lateral vertices are on the silhouette of a view from the side.
        for vertex in [4, 5] {
            let beside = |share: f64| at(&picture, &scene, centre + share * (nodes[vertex] - centre));
            assert_ne!(beside(0.93), [255; 3], "vertex {vertex} is missing");
            assert_eq!(beside(1.05), [255; 3], "something beyond vertex {vertex}");
        }
    }

    #[test]
    fn a_pressed_vertex_moves_on_the_picture_and_takes_the_deepest_colour() {
        let (nodes, triangles) = octahedron();
        let chain = Chain::default();
        let instants = [instant(&nodes, 0.0), instant(&nodes, 0.02)];
        let scene = Scene::new(&chain, &nodes, &triangles, &instants);
        let [free, pressed] = [0, 1].map(|number: usize| scene.picture(&instants[number]));
        // Half way between the vertex's two places, beside the arrow: object before, nothing after.
        let [right, ..] = scene.view.camera.axes();
        let between = nodes[4] - DVec3::Z * 0.009 + 0.005 * right;
        assert_ne!(at(&free, &scene, between), [255; 3]);
        assert_eq!(at(&pressed, &scene, between), [255; 3]);
        let tip = nodes[4] - DVec3::Z * 0.0215 + 0.001 * right;
        let [red, _, blue] = at(&pressed, &scene, tip).map(f64::from);
        assert!(blue > 1.4 * red, "deep blue where the displacement is greatest: {red} {blue}");
        let [red, _, blue] = at(&free, &scene, tip).map(f64::from);
        assert!(blue < 1.2 * red, "pale where nothing moved: {red} {blue}");
    }

    #[test]
    fn the_arrow_of_a_force_begins_at_its_node_and_pushes_the_arm_out() {
        let (nodes, triangles) = octahedron();
        let chain = Chain::default();
        let instants = [instant(&nodes, 0.02)];
        let scene = Scene::new(&chain, &nodes, &triangles, &instants);
        let [(tail, tip)] = scene.arrows(&instants[0])[..] else { panic!("one arrow") };
        assert_eq!(tail, instants[0].nodes[4]);
        assert!((tip - tail).normalize().abs_diff_eq(DVec3::Z, 1e-12), "the node is pushed down and pushes up");
        let [red, _, blue] = at(&scene.picture(&instants[0]), &scene, tail.lerp(tip, 0.6)).map(f64::from);
        assert!(red > 3.0 * blue, "an orange shaft: {red} {blue}");
    }
}
