//! The spongy block with the arm that scans it, from above and from the side (the paper's Fig. 7, there photographs), and the
//! twin that explains its torques, pressed.
//!
//! The block is drawn at rest: its deformation is not part of a scan. Dots are the measured positions of the visiting
//! node that lie clear of it.

use super::{Scanned, Scans};
use crate::{
    JointVector,
    draw::{
        canvas::{Area, Canvas, Picture},
        chart,
        colour::{self, Colour, ColourMap},
        plot,
        raster::{Raster, Vertex, Viewpoint},
        ticks,
    },
    report::{PIXELS, object::draw_proxy},
    scene::SpecimenSpec,
};
use glam::DVec3;

const WIDTH: f64 = 1272.0;
const CELL: [f64; 2] = [400.0, 320.0];
const TOP: f64 = 88.0;
/// Radius of a link and of a dot (m).
const LINK: f64 = 3e-3;
const DOT: f64 = 8e-4;
/// Distance from the block below which a dot is left out: it would be half inside (m).
const CLEAR: f64 = 1e-3;
const SPONGE: Colour = Colour::hex(0xf2_d3_7d);
const MEASURED: Colour = Colour::hex(0x00_72_b2);

/// The twin of the block, scanned from above, where the arm pushes hardest (see [`hardest`]).
pub struct PressedTwin {
    /// Its nodes (m).
    pub nodes: Vec<DVec3>,
    /// Triangles of its surface.
    pub triangles: Vec<[u32; 3]>,
    /// How far each node is from its place at rest (m).
    pub displacements: Vec<f64>,
}

/// Draws both scans, and the `twin`.
#[must_use]
pub fn specimen(scans: Scans<'_>, twin: &PressedTwin) -> Canvas {
    let mut canvas = Canvas::new(WIDTH, TOP + CELL[1] + 24.0);
    chart::headline(&mut canvas, "The simulated spongy block, scanned from above and from the side, and its twin");
    let deepest = 1e3 * twin.displacements.iter().copied().fold(0.0, f64::max);
    let pressed = format!("The twin of the first, pressed {deepest:.0} mm deep: its shape is of torques alone");
    let pictures = [
        (caption("From above", scans.bare), picture(scans.bare, None)),
        (caption("From the side", scans.side), picture(scans.side, None)),
        (pressed, picture(scans.bare, Some(twin))),
    ];
    for (number, (caption, picture)) in pictures.into_iter().enumerate() {
        let x = chart::MARGIN + number as f64 * (CELL[0] + 12.0);
        canvas.text((x, TOP - 10.0), &caption, plot::NOTE);
        canvas.picture((x, TOP), picture);
        canvas.frame(Area { x, y: TOP, width: CELL[0], height: CELL[1] }, colour::GRID, 1.0);
    }
    canvas
}

fn caption(what: &str, scanned: Scanned<'_>) -> String {
    let mut sides = scanned.scene.scan.simulated.size.to_array().map(|side| 100.0 * side);
    sides.sort_by(|a, b| b.total_cmp(a));
    let sides = sides.map(|side| ticks::number(side, 0)).join(" × ");
    let count = ticks::thousands(scanned.samples.len());
    format!("{what}: a block of {sides} cm, {count} points; dots are those clear of it")
}

/// Where the arm pushes hardest, if it does (rad or m).
#[must_use]
pub fn hardest(scanned: Scanned<'_>) -> Option<JointVector> {
    let ticks = scanned.trace.ticks.iter();
    let by_torque = ticks.max_by(|a, b| a.sample.torque.norm().total_cmp(&b.sample.torque.norm()));
    by_torque.map(|tick| tick.proxy)
}

/// The block, the arm where it pushes hardest, and where the visiting node was measured; or the `twin` in their place.
fn picture(scanned: Scanned<'_>, twin: Option<&PressedTwin>) -> Picture {
    let block = &scanned.scene.scan.simulated;
    let chain = scanned.chain;
    let mut pose = chain.new_pose();
    let node = scanned.scene.scan.plan.node(chain.nodes.len());
    let mut visited = |q: &[f64]| {
        chain.pose(&JointVector::from_slice(q), &mut pose);
        pose.nodes[node]
    };
    let configurations = scanned.samples.configurations.chunks_exact(chain.joints.len());
    let dots: Vec<DVec3> = configurations.map(&mut visited).filter(|&x| !holds(block, x)).collect();
    let pressed = hardest(scanned).map(|q| {
        let mut pose = chain.new_pose();
        chain.pose(&q, &mut pose);
        pose
    });

    let mut framed = corners(block).to_vec();
    framed.extend(dots.iter().copied());
    let joints = pressed.iter().flat_map(|pose| &pose.origins);
    framed.extend(joints.flat_map(|&joint| [joint - 2.0 * LINK, joint + 2.0 * LINK]));
    // From the front left above: the arm stands behind the block's near end, not before it.
    let direction = DVec3::new(0.45, -1.0, 0.6);
    let mut raster = Raster::new(Viewpoint::framing(&framed, direction, CELL.map(|side| (side * PIXELS) as usize)));
    match twin {
        Some(PressedTwin { nodes, triangles, displacements }) => {
            let map = ColourMap::Pale { low: 0.0, high: displacements.iter().copied().fold(0.0, f64::max) };
            let colours: Vec<Colour> = displacements.iter().map(|moved| map.colour(*moved)).collect();
            raster.mesh(nodes, triangles, &colours);
        }
        None => {
            draw_block(&mut raster, block);
            dots.into_iter().for_each(|dot| raster.sphere(dot, DOT, MEASURED));
        }
    }
    if let Some(pose) = &pressed {
        draw_proxy(&mut raster, chain, pose, LINK, &[]);
    }
    raster.picture()
}

/// Whether the block, or the layer [`CLEAR`] around it, holds `point`.
fn holds(block: &SpecimenSpec, point: DVec3) -> bool {
    point.cmpge(block.corner - CLEAR).all() && point.cmple(block.corner + block.size + CLEAR).all()
}

/// Corners of the block, the bits of their number being x, y and z.
fn corners(block: &SpecimenSpec) -> [DVec3; 8] {
    std::array::from_fn(|k| block.corner + block.size * DVec3::from_array([0, 1, 2].map(|axis| (k >> axis & 1) as f64)))
}

/// Draws six flat faces with their edges.
fn draw_block(raster: &mut Raster, block: &SpecimenSpec) {
    let corners = corners(block);
    for axis in 0..3 {
        let [first, second] = [(axis + 1) % 3, (axis + 2) % 3];
        for side in [0, 1] {
            let [a, b] = [1 << first, 1 << second];
            let base = side << axis;
            let face = [base, base | a, base | a | b, base | b].map(|corner| corners[corner]);
            let mut normal = DVec3::ZERO;
            normal[axis] = if side == 1 { 1.0 } else { -1.0 };
            let vertex = |position: DVec3| Vertex { position, normal, colour: SPONGE };
            for triangle in [[face[0], face[1], face[2]], [face[0], face[2], face[3]]] {
                raster.triangle(triangle.map(vertex));
            }
            for edge in 0..4 {
                raster.line([face[edge], face[(edge + 1) % 4]], 1.4, colour::SOFT_INK, 0.0);
            }
        }
    }
}
