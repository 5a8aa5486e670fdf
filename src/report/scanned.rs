//! The surface of a scanned object with the places that were touched, coloured by how well it is known or how stiff it is.

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
    twin::{Modulus, ScannedShape},
};
use glam::DVec3;

const WIDTH: f64 = 800.0;
const PICTURE: [f64; 2] = [640.0, 400.0];
const TOUCHED: Colour = Colour::hex(0xd5_5e_00);
const UNMEASURED: Colour = Colour::hex(0xc4_c8_ce);
/// Radius of a touched place, in spacings (1).
const DOT: f64 = 0.08;

/// What the surface is coloured by, where it was touched.
struct Quantity<'a> {
    headline: &'a str,
    /// On the colour bar.
    title: &'a str,
    values: Vec<Option<f64>>,
}

/// The surface of `shape`, coloured by how well it is known; walls and ground, which nobody touched, are grey.
#[must_use]
pub fn surface(shape: &ScannedShape) -> Canvas {
    let values = shape.deviations.iter().map(|known| known.map(|deviation| 1e3 * deviation)).collect();
    let headline = "The surface of a scanned object, from joint torques alone";
    draw(shape, &Quantity { headline, title: "deviation [mm]", values }, 0.0)
}

/// The surface of `shape`, coloured by the apparent modulus of the nearest approach.
#[must_use]
pub fn stiffness(shape: &ScannedShape, modulus: &Modulus) -> Canvas {
    let nearest = |x: DVec3| {
        let places = shape.touched.iter().filter_map(|touched| Some((touched, modulus.apparent.get(&touched.line)?)));
        places
            .min_by(|(a, _), (b, _)| a.place.distance(x).total_cmp(&b.place.distance(x)))
            .map(|(_, young)| 1e-3 * young)
    };
    let measured = shape.nodes.iter().zip(&shape.deviations);
    let values: Vec<Option<f64>> = measured.map(|(x, known)| known.and_then(|_| nearest(*x))).collect();
    let least = values.iter().flatten().copied().fold(f64::INFINITY, f64::min);
    let headline = "What a scanned object is as stiff as, approach by approach";
    draw(shape, &Quantity { headline, title: "modulus [kPa]", values }, least)
}

/// The body from the side and from above.
fn draw(shape: &ScannedShape, quantity: &Quantity<'_>, low: f64) -> Canvas {
    let Quantity { headline, title, values } = quantity;
    let map = ColourMap::Pale { low, high: values.iter().flatten().copied().fold(0.0, f64::max) };
    let colours: Vec<Colour> = values.iter().map(|value| value.map_or(UNMEASURED, |value| map.colour(value))).collect();
    let size = PICTURE.map(|side| (side * PIXELS) as usize);
    let mut raster = Raster::new(Viewpoint::framing(&shape.nodes, DVec3::new(-0.7, -1.0, 0.7), size));
    raster.mesh(&shape.nodes, &shape.triangles, &colours);
    let dots = shape.touched.iter().map(|touched| Cone::ball(touched.place, DOT * shape.spacing, TOUCHED));
    raster.cones(&dots.collect::<Vec<_>>());
    let top = chart::MARGIN + 52.0;
    let mut canvas = Canvas::new(WIDTH, top + PICTURE[1] + chart::MARGIN);
    chart::headline(&mut canvas, headline);
    let entries = [
        Entry { name: format!("{} places touched", shape.touched.len()), colour: TOUCHED, mark: Mark::Dot },
        Entry { name: "not measured".to_owned(), colour: UNMEASURED, mark: Mark::Dot },
    ];
    plot::legend(&mut canvas, (WIDTH - chart::MARGIN, chart::MARGIN + 30.0), &entries);
    canvas.picture((chart::MARGIN, top), raster.picture());
    canvas.frame(Area { x: chart::MARGIN, y: top, width: PICTURE[0], height: PICTURE[1] }, GRID, 1.0);
    let bar = Area { x: WIDTH - 84.0, y: top + 80.0, width: 12.0, height: 240.0 };
    plot::colour_bar(&mut canvas, bar, map, title, Anchor::Start);
    canvas
}
