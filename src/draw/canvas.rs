//! A sheet to draw on: marks in, SVG and PNG out.
//!
//! Coordinates are points from the top left corner, x to the right, y down. SVG and PNG are made from the same list of
//! marks; the PNG has the sheet's pictures under them. Nothing depends on fonts, display or time of the machine: equal
//! marks give equal bytes.

use super::{
    colour::{Colour, WHITE},
    font,
};
use crate::{Error, error, names::Xml};
use std::fmt::{Display, Write as _};
use tiny_skia::{FillRule, LineCap, LineJoin, Mask, Paint, PathBuilder, Pixmap, Rect, Stroke, StrokeDash, Transform};

pub use font::Weight;

/// A rectangle of the sheet.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Area {
    /// Left edge.
    pub x: f64,
    /// Top edge.
    pub y: f64,
    /// Extent to the right.
    pub width: f64,
    /// Extent down.
    pub height: f64,
}

impl Area {
    /// Right edge.
    #[must_use]
    pub fn right(&self) -> f64 {
        self.x + self.width
    }

    /// Bottom edge.
    #[must_use]
    pub fn bottom(&self) -> f64 {
        self.y + self.height
    }
}

/// Which point of a text lies at its position.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Anchor {
    /// Left end of the base line.
    Start,
    /// Middle of the base line.
    Middle,
    /// Right end of the base line.
    End,
}

/// Look of a text.
#[derive(Clone, Copy, Debug)]
pub struct TextStyle {
    /// Size of the font, in points of the sheet.
    pub size: f64,
    /// How heavy.
    pub weight: Weight,
    /// Its colour.
    pub colour: Colour,
    /// The point of the text that lies at its position.
    pub anchor: Anchor,
}

impl TextStyle {
    /// The same text anchored elsewhere.
    #[must_use]
    pub fn anchored(self, anchor: Anchor) -> Self {
        Self { anchor, ..self }
    }

    /// Width of `text` in this style.
    #[must_use]
    pub fn width(&self, text: &str) -> f64 {
        font::width(text, self.size, self.weight)
    }
}

/// The error of a sheet of so many pixels across and down that could not be made into a picture.
fn not_rasterised([width, height]: [u32; 2], why: impl Display) -> Error {
    error!("cannot rasterise a figure of {width} x {height} pixels: {why}; ask for a smaller scale")
}

/// A picture made of pixels, rows from the top.
#[derive(Clone, Debug, PartialEq)]
pub struct Picture {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
    /// sRGB, `width * height`.
    pub pixels: Vec<[u8; 3]>,
}

/// A mark on a sheet.
enum Mark {
    /// A filled area.
    Fill { shape: Shape, colour: Colour },
    /// A line, dashed where lengths of dash and gap are given.
    Line { points: Vec<(f64, f64)>, colour: Colour, width: f64, dashes: Option<[f64; 2]> },
    /// A text whose anchor is at `position`.
    Text { position: (f64, f64), text: String, style: TextStyle },
    /// Marks of which only the part inside `area` is seen.
    Clipped { area: Area, marks: Vec<Mark> },
}

/// Outline of a filled area.
enum Shape {
    Rectangle(Area),
    Polygon(Vec<(f64, f64)>),
    Disc { centre: (f64, f64), radius: f64 },
}

/// A sheet with marks on it.
pub struct Canvas {
    width: f64,
    height: f64,
    marks: Vec<Mark>,
    pictures: Vec<(f64, f64, Picture)>,
}

impl Canvas {
    /// An empty white sheet.
    #[must_use]
    pub fn new(width: f64, height: f64) -> Self {
        Self { width, height, marks: Vec::new(), pictures: Vec::new() }
    }

    /// Extent of the sheet.
    #[must_use]
    pub fn area(&self) -> Area {
        Area { x: 0.0, y: 0.0, width: self.width, height: self.height }
    }

    /// A filled rectangle.
    pub fn rectangle(&mut self, area: Area, fill: Colour) {
        self.marks.push(Mark::Fill { shape: Shape::Rectangle(area), colour: fill });
    }

    /// The outline of a rectangle.
    pub fn frame(&mut self, area: Area, colour: Colour, width: f64) {
        let Area { x, y, .. } = area;
        let corners = [(x, y), (area.right(), y), (area.right(), area.bottom()), (x, area.bottom()), (x, y)];
        self.polyline(&corners, colour, width, None);
    }

    /// A stroke through `points`; `dashes` gives the lengths of dash and gap. Points that are no numbers are left out.
    pub fn polyline(&mut self, points: &[(f64, f64)], colour: Colour, width: f64, dashes: Option<[f64; 2]>) {
        self.marks.push(Mark::Line { points: finite(points), colour, width, dashes });
    }

    /// A filled polygon. Points that are no numbers are left out.
    pub fn polygon(&mut self, points: &[(f64, f64)], fill: Colour) {
        self.marks.push(Mark::Fill { shape: Shape::Polygon(finite(points)), colour: fill });
    }

    /// A filled disc.
    pub fn disc(&mut self, centre: (f64, f64), radius: f64, fill: Colour) {
        self.marks.push(Mark::Fill { shape: Shape::Disc { centre, radius }, colour: fill });
    }

    /// A line of text at `position`, which is a point of its base line. Control characters are left out.
    pub fn text(&mut self, position: (f64, f64), text: &str, style: TextStyle) {
        let text = text.chars().filter(|character| !character.is_control()).collect();
        self.marks.push(Mark::Text { position, text, style });
    }

    /// Draws `marks` on the part of the sheet inside `area` only.
    pub fn clipped(&mut self, area: Area, marks: impl FnOnce(&mut Self)) {
        let before = std::mem::take(&mut self.marks);
        marks(self);
        let marks = std::mem::replace(&mut self.marks, before);
        self.marks.push(Mark::Clipped { area, marks });
    }

    /// Puts a picture under all marks, its top left corner at `corner`. It appears in the PNG, one pixel of it a pixel
    /// there; the SVG has no pictures.
    pub fn picture(&mut self, corner: (f64, f64), picture: Picture) {
        self.pictures.push((corner.0, corner.1, picture));
    }

    /// The sheet as SVG, its fonts inside.
    #[must_use]
    pub fn svg(&self) -> String {
        let Self { width, height, marks, .. } = self;
        let mut text = format!(
            concat!(
                r#"<svg xmlns="http://www.w3.org/2000/svg" width="{w}" height="{h}" viewBox="0 0 {w} {h}" "#,
                r#"font-family="{family}, sans-serif" style="font-kerning:none">"#,
                "\n<!-- haptize -->\n",
                r#"<rect width="100%" height="100%" fill="{white}"/>"#,
                "\n<style>{style}</style>\n"
            ),
            w = width,
            h = height,
            family = font::FAMILY,
            white = WHITE,
            style = font::style_sheet()
        );
        for mark in marks {
            // Writing to a string cannot fail.
            let _ = writeln!(text, "{mark}");
        }
        text + "</svg>\n"
    }

    /// The sheet as pixels, `scale` pixels a point.
    ///
    /// # Errors
    /// When the sheet has no area or is too large for memory.
    pub fn pixels(&self, scale: f64) -> Result<Picture, Error> {
        let [width, height] = [self.width, self.height].map(|side| (side * scale).ceil().clamp(0.0, 1e6) as u32);
        let mut sheet = Pixmap::new(width, height)
            .ok_or_else(|| not_rasterised([width, height], "it has no area or does not fit into memory"))?;
        sheet.fill(tiny_skia::Color::WHITE);
        for (x, y, picture) in &self.pictures {
            let corner = [x * scale, y * scale].map(|coordinate| coordinate.round() as i64);
            put(&mut sheet, corner, picture);
        }
        let scale = Transform::from_scale(scale as f32, scale as f32);
        self.marks.iter().for_each(|mark| mark.draw(&mut sheet, scale, None));
        let pixels = sheet.pixels().iter().map(|pixel| [pixel.red(), pixel.green(), pixel.blue()]).collect();
        Ok(Picture { width: width as usize, height: height as usize, pixels })
    }
}

/// Those of `points` that are numbers.
fn finite(points: &[(f64, f64)]) -> Vec<(f64, f64)> {
    points.iter().copied().filter(|(x, y)| x.is_finite() && y.is_finite()).collect()
}

impl Mark {
    /// Draws the mark, under `mask` where there is one. What has no extent is not seen.
    fn draw(&self, sheet: &mut Pixmap, scale: Transform, mask: Option<&Mask>) {
        let paint = |colour: &Colour| {
            let [red, green, blue] = colour.rgb;
            let mut paint = Paint::default();
            paint.set_color_rgba8(red, green, blue, (255.0 * colour.opacity).round() as u8);
            paint
        };
        match self {
            Self::Fill { shape, colour } => {
                if let Some(path) = shape.path() {
                    sheet.fill_path(&path, &paint(colour), FillRule::Winding, scale, mask);
                }
            }
            Self::Line { points, colour, width, dashes } => {
                let Some(path) = path(points, false) else { return };
                let dash = dashes.and_then(|lengths| StrokeDash::new(lengths.map(|length| length as f32).into(), 0.0));
                let (line_cap, line_join) = (LineCap::Round, LineJoin::Round);
                let stroke = Stroke { width: *width as f32, line_cap, line_join, dash, ..Stroke::default() };
                sheet.stroke_path(&path, &paint(colour), &stroke, scale, mask);
            }
            Self::Text { position: (x, y), text, style } => {
                let before = match style.anchor {
                    Anchor::Start => 0.0,
                    Anchor::Middle => 0.5 * style.width(text),
                    Anchor::End => style.width(text),
                };
                if let Some(path) = font::outline(text, style.size, style.weight) {
                    let place = scale.pre_translate((x - before) as f32, *y as f32);
                    sheet.fill_path(&path, &paint(&style.colour), FillRule::Winding, place, mask);
                }
            }
            Self::Clipped { area, marks } => {
                let Some(path) = Shape::Rectangle(*area).path() else { return };
                let Some(mut inside) = mask.cloned().or_else(|| Mask::new(sheet.width(), sheet.height())) else {
                    return;
                };
                if mask.is_some() {
                    inside.intersect_path(&path, FillRule::Winding, true, scale);
                } else {
                    inside.fill_path(&path, FillRule::Winding, true, scale);
                }
                marks.iter().for_each(|mark| mark.draw(sheet, scale, Some(&inside)));
            }
        }
    }
}

impl Shape {
    fn path(&self) -> Option<tiny_skia::Path> {
        match self {
            Self::Rectangle(area) => {
                let [x, y, width, height] = [area.x, area.y, area.width, area.height].map(|number| number as f32);
                Rect::from_xywh(x, y, width, height).map(PathBuilder::from_rect)
            }
            Self::Polygon(points) => path(points, true),
            Self::Disc { centre: (x, y), radius } => PathBuilder::from_circle(*x as f32, *y as f32, *radius as f32),
        }
    }
}

/// The path through `points`.
fn path(points: &[(f64, f64)], is_closed: bool) -> Option<tiny_skia::Path> {
    let mut path = PathBuilder::new();
    let mut points = points.iter().map(|&(x, y)| (x as f32, y as f32));
    let (x, y) = points.next()?;
    path.move_to(x, y);
    points.for_each(|(x, y)| path.line_to(x, y));
    if is_closed {
        path.close();
    }
    path.finish()
}

/// As an element of an SVG.
impl std::fmt::Display for Mark {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Fill { shape, colour } => write!(f, r#"<{shape} fill="{colour}"{}/>"#, Opacity(*colour)),
            Self::Line { points, colour, width, dashes } => {
                let (path, width) = (Path(points, false), Number(*width));
                write!(f, r#"<path d="{path}" fill="none" stroke="{colour}" stroke-width="{width}" "#)?;
                f.write_str(r#"stroke-linejoin="round" stroke-linecap="round""#)?;
                if let Some([dash, gap]) = dashes {
                    write!(f, r#" stroke-dasharray="{dash} {gap}""#)?;
                }
                write!(f, "{}/>", Opacity(*colour))
            }
            Self::Text { position: (x, y), text, style } => {
                let anchor = match style.anchor {
                    Anchor::Start => "start",
                    Anchor::Middle => "middle",
                    Anchor::End => "end",
                };
                write!(
                    f,
                    r#"<text x="{}" y="{}" font-size="{}" font-weight="{}" fill="{}"{} text-anchor="{anchor}">{}</text>"#,
                    Number(*x),
                    Number(*y),
                    Number(style.size),
                    style.weight.css(),
                    style.colour,
                    Opacity(style.colour),
                    Xml(text)
                )
            }
            Self::Clipped { area, marks } => {
                let [x, y, width, height] = [area.x, area.y, area.width, area.height].map(Number);
                // Named after its rectangle: of several sheets in one page, only equal clips have equal names.
                let name = format!("clip_{x}_{y}_{width}_{height}");
                let clip = Shape::Rectangle(*area);
                writeln!(f, r#"<clipPath id="{name}"><{clip}/></clipPath><g clip-path="url(#{name})">"#)?;
                marks.iter().try_for_each(|mark| writeln!(f, "{mark}"))?;
                f.write_str("</g>")
            }
        }
    }
}

/// Name and geometry of an SVG's element.
impl std::fmt::Display for Shape {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Rectangle(area) => {
                let [x, y, width, height] = [area.x, area.y, area.width, area.height].map(Number);
                write!(f, r#"rect x="{x}" y="{y}" width="{width}" height="{height}""#)
            }
            Self::Polygon(points) => write!(f, r#"path d="{}""#, Path(points, true)),
            Self::Disc { centre: (x, y), radius } => {
                write!(f, r#"circle cx="{}" cy="{}" r="{}""#, Number(*x), Number(*y), Number(*radius))
            }
        }
    }
}

/// Copies `picture` onto the opaque `sheet`, its top left corner at pixel `corner`; what lies outside is cut.
fn put(sheet: &mut tiny_skia::Pixmap, corner: [i64; 2], picture: &Picture) {
    let [across, down] = [i64::from(sheet.width()), i64::from(sheet.height())];
    for (index, &[red, green, blue]) in picture.pixels.iter().enumerate() {
        let x = corner[0] + (index % picture.width) as i64;
        let y = corner[1] + (index / picture.width) as i64;
        let inside = (0..across).contains(&x) && (0..down).contains(&y);
        let colour = tiny_skia::PremultipliedColorU8::from_rgba(red, green, blue, u8::MAX);
        if let (true, Some(colour)) = (inside, colour) {
            sheet.pixels_mut()[(y * across + x) as usize] = colour;
        }
    }
}

impl Picture {
    /// The picture as a PNG file.
    ///
    /// # Errors
    /// When the encoder refuses it.
    pub fn png(&self) -> Result<Vec<u8>, Error> {
        let [width, height] = [self.width as u32, self.height as u32];
        let mut bytes = Vec::new();
        encode_png(&mut bytes, [width, height], png::ColorType::Rgb, self.pixels.as_flattened())
            .map_err(|error| not_rasterised([width, height], error))?;
        Ok(bytes)
    }
}

/// Writes `pixels`, rows from the top, as a PNG file with a byte a channel.
pub(crate) fn encode_png(
    out: impl std::io::Write,
    [width, height]: [u32; 2],
    channels: png::ColorType,
    pixels: &[u8],
) -> Result<(), png::EncodingError> {
    let mut encoder = png::Encoder::new(out, width, height);
    encoder.set_color(channels);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    encoder.add_text_chunk("Software".into(), "haptize".into())?;
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels)?;
    writer.finish()
}

/// A coordinate with two decimals, without trailing zeros: small files, the same on every machine.
struct Number(f64);

impl std::fmt::Display for Number {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let text = format!("{:.2}", if self.0.is_finite() { self.0 } else { 0.0 });
        let short = text.trim_end_matches('0').trim_end_matches('.');
        f.write_str(if short == "-0" { "0" } else { short })
    }
}

/// Path data through points, closed or open.
struct Path<'a>(&'a [(f64, f64)], bool);

impl std::fmt::Display for Path<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (index, &(x, y)) in self.0.iter().enumerate() {
            write!(f, "{}{} {}", if index == 0 { 'M' } else { 'L' }, Number(x), Number(y))?;
        }
        f.write_str(if self.1 { "Z" } else { "" })
    }
}

/// The attribute of a translucent colour; nothing for an opaque one.
struct Opacity(Colour);

impl std::fmt::Display for Opacity {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        if self.0.opacity < 1.0 { write!(f, r#" opacity="{}""#, Number(self.0.opacity.into())) } else { Ok(()) }
    }
}
