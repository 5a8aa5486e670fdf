//! The surface of a scanned object, coloured by how well it is known, with the places that were touched.

use super::PIXELS;
use crate::{
    draw::{
        canvas::{Anchor, Area, Canvas},
        chart,
        colour::{Colour, ColourMap, GRID},
        plot::{self, Entry, Mark},
        raster::{Raster, Viewpoint},
        solid::Cone,
    },
    twin::ScannedShape,
};
use glam::DVec3;

const WIDTH: f64 = 800.0;
const PICTURE: [f64; 2] = [640.0, 400.0];
const TOUCHED: Colour = Colour::hex(0xd5_5e_00);
const UNMEASURED: Colour = Colour::hex(0xc4_c8_ce);
/// Radius of a touched place, in spacings (1).
const DOT: f64 = 0.08;

/// The body from the side and from above; walls and ground, which nobody touched, are grey.
#[must_use]
pub fn scanned(shape: &ScannedShape) -> Canvas {
    let measured = || shape.deviations.iter().flatten().copied();
    let map = ColourMap::Pale { low: 0.0, high: 1e3 * measured().fold(0.0, f64::max) };
    let colours: Vec<Colour> = shape
        .deviations
        .iter()
        .map(|known| known.map_or(UNMEASURED, |deviation| map.colour(1e3 * deviation)))
        .collect();
    let size = PICTURE.map(|side| (side * PIXELS) as usize);
    let mut raster = Raster::new(Viewpoint::framing(&shape.nodes, DVec3::new(-0.7, -1.0, 0.7), size));
    raster.mesh(&shape.nodes, &shape.triangles, &colours);
    let dots = shape.touched.iter().map(|touched| Cone::ball(touched.place, DOT * shape.spacing, TOUCHED));
    raster.cones(&dots.collect::<Vec<_>>());
    let top = chart::MARGIN + 52.0;
    let mut canvas = Canvas::new(WIDTH, top + PICTURE[1] + chart::MARGIN);
    chart::headline(&mut canvas, "The surface of a scanned object, from joint torques alone");
    let entries = [
        Entry { name: format!("{} places touched", shape.touched.len()), colour: TOUCHED, mark: Mark::Dot },
        Entry { name: "not measured".to_owned(), colour: UNMEASURED, mark: Mark::Line },
    ];
    plot::legend(&mut canvas, (WIDTH - chart::MARGIN, chart::MARGIN + 30.0), &entries);
    canvas.picture((chart::MARGIN, top), raster.picture());
    canvas.frame(Area { x: chart::MARGIN, y: top, width: PICTURE[0], height: PICTURE[1] }, GRID, 1.0);
    let bar = Area { x: WIDTH - 84.0, y: top + 80.0, width: 12.0, height: 240.0 };
    plot::colour_bar(&mut canvas, bar, map, "deviation [mm]", Anchor::Start);
    canvas
}
