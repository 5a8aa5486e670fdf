//! A sheet to draw on: marks in, SVG and PNG out.
//!
//! Coordinates are points from the top left corner, x to the right, y down. The SVG holds its fonts; the PNG is the
//! same SVG rasterised (resvg) over the sheet's pictures, so both always show the same marks. Nothing depends on fonts,
//! display or time of the machine: equal marks give equal bytes.

use super::{
    ReportError,
    colour::{Colour, WHITE},
    font,
};
use resvg::{tiny_skia, usvg};
use std::fmt::Write as _;

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

/// A sheet with marks on it.
pub struct Canvas {
    width: f64,
    height: f64,
    marks: String,
    pictures: Vec<(f64, f64, Picture)>,
}

impl Canvas {
    /// An empty white sheet.
    #[must_use]
    pub fn new(width: f64, height: f64) -> Self {
        Self { width, height, marks: String::new(), pictures: Vec::new() }
    }

    /// Extent of the sheet.
    #[must_use]
    pub fn area(&self) -> Area {
        Area { x: 0.0, y: 0.0, width: self.width, height: self.height }
    }

    /// A filled rectangle.
    pub fn rectangle(&mut self, area: Area, fill: Colour) {
        self.mark(format_args!(
            r#"<rect x="{}" y="{}" width="{}" height="{}" fill="{fill}"{}/>"#,
            Number(area.x),
            Number(area.y),
            Number(area.width),
            Number(area.height),
            Opacity(fill)
        ));
    }

    /// The outline of a rectangle.
    pub fn frame(&mut self, area: Area, colour: Colour, width: f64) {
        let Area { x, y, .. } = area;
        let corners = [(x, y), (area.right(), y), (area.right(), area.bottom()), (x, area.bottom()), (x, y)];
        self.polyline(&corners, colour, width, None);
    }

    /// A stroke through `points`; `dashes` gives the lengths of dash and gap. Points that are no numbers are left out.
    pub fn polyline(&mut self, points: &[(f64, f64)], colour: Colour, width: f64, dashes: Option<[f64; 2]>) {
        let path = Path(points, false);
        let dashes = dashes.map_or_else(String::new, |[dash, gap]| format!(r#" stroke-dasharray="{dash} {gap}""#));
        let ends = r#"stroke-linejoin="round" stroke-linecap="round""#;
        self.mark(format_args!(
            r#"<path d="{path}" fill="none" stroke="{colour}" stroke-width="{}" {ends}{dashes}{}/>"#,
            Number(width),
            Opacity(colour)
        ));
    }

    /// A filled polygon.
    pub fn polygon(&mut self, points: &[(f64, f64)], fill: Colour) {
        self.mark(format_args!(r#"<path d="{}" fill="{fill}"{}/>"#, Path(points, true), Opacity(fill)));
    }

    /// A filled disc.
    pub fn disc(&mut self, centre: (f64, f64), radius: f64, fill: Colour) {
        self.mark(format_args!(
            r#"<circle cx="{}" cy="{}" r="{}" fill="{fill}"{}/>"#,
            Number(centre.0),
            Number(centre.1),
            Number(radius),
            Opacity(fill)
        ));
    }

    /// A line of text at `position`, which is a point of its base line.
    pub fn text(&mut self, position: (f64, f64), text: &str, style: TextStyle) {
        let anchor = match style.anchor {
            Anchor::Start => "start",
            Anchor::Middle => "middle",
            Anchor::End => "end",
        };
        self.mark(format_args!(
            r#"<text x="{}" y="{}" font-size="{}" font-weight="{}" fill="{}" text-anchor="{anchor}">{}</text>"#,
            Number(position.0),
            Number(position.1),
            Number(style.size),
            style.weight.css(),
            style.colour,
            Escaped(text)
        ));
    }

    /// Draws `marks` on the part of the sheet inside `area` only.
    pub fn clipped(&mut self, area: Area, marks: impl FnOnce(&mut Self)) {
        let [x, y, width, height] = [area.x, area.y, area.width, area.height].map(Number);
        // Named after its rectangle: of several sheets in one page, only equal clips have equal names.
        let name = format!("clip_{x}_{y}_{width}_{height}");
        let clip = format_args!(r#"<rect x="{x}" y="{y}" width="{width}" height="{height}"/>"#);
        self.mark(format_args!(r#"<clipPath id="{name}">{clip}</clipPath><g clip-path="url(#{name})">"#));
        marks(self);
        self.mark(format_args!("</g>"));
    }

    /// Puts a picture under all marks, its top left corner at `corner`. It appears in the PNG, one pixel of it a pixel
    /// there; the SVG has no pictures.
    pub fn picture(&mut self, corner: (f64, f64), picture: Picture) {
        self.pictures.push((corner.0, corner.1, picture));
    }

    fn mark(&mut self, mark: std::fmt::Arguments<'_>) {
        // Writing to a string cannot fail.
        let _ = self.marks.write_fmt(mark);
        self.marks.push('\n');
    }

    /// The sheet as SVG, its fonts inside.
    #[must_use]
    pub fn svg(&self) -> String {
        let background =
            format!(r#"<rect width="100%" height="100%" fill="{WHITE}"/>"#) + "\n<style>" + &font::style_sheet();
        self.document(&(background + "</style>\n"))
    }

    fn document(&self, before: &str) -> String {
        let Self { width, height, marks, .. } = self;
        format!(
            concat!(
                r#"<svg xmlns="http://www.w3.org/2000/svg" width="{w}" height="{h}" viewBox="0 0 {w} {h}" "#,
                r#"font-family="{family}, sans-serif">"#,
                "\n{before}{marks}</svg>\n"
            ),
            w = width,
            h = height,
            family = font::FAMILY,
            before = before,
            marks = marks
        )
    }

    /// The sheet as pixels, `scale` pixels a point.
    ///
    /// # Errors
    /// [`ReportError::Rasterise`] when the sheet has no area or is too large for memory.
    pub fn pixels(&self, scale: f64) -> Result<Picture, ReportError> {
        let [width, height] = [self.width, self.height].map(|side| (side * scale).ceil().clamp(0.0, 1e6) as u32);
        let refused = |reason: String| ReportError::Rasterise { width, height, reason };
        let options = usvg::Options { fontdb: font::database(), ..usvg::Options::default() };
        let tree = usvg::Tree::from_str(&self.document(""), &options).map_err(|error| refused(error.to_string()))?;
        let mut sheet = tiny_skia::Pixmap::new(width, height)
            .ok_or_else(|| refused("it has no area or does not fit into memory".to_owned()))?;
        sheet.fill(tiny_skia::Color::WHITE);
        for (x, y, picture) in &self.pictures {
            let corner = [x * scale, y * scale].map(|coordinate| coordinate.round() as i64);
            put(&mut sheet, corner, picture);
        }
        let scale = tiny_skia::Transform::from_scale(scale as f32, scale as f32);
        resvg::render(&tree, scale, &mut sheet.as_mut());
        let pixels = sheet.pixels().iter().map(|pixel| [pixel.red(), pixel.green(), pixel.blue()]).collect();
        Ok(Picture { width: width as usize, height: height as usize, pixels })
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
    /// [`ReportError::Rasterise`] when the encoder refuses it.
    pub fn png(&self) -> Result<Vec<u8>, ReportError> {
        let [width, height] = [self.width as u32, self.height as u32];
        let mut bytes = Vec::new();
        image::ImageEncoder::write_image(
            image::codecs::png::PngEncoder::new(&mut bytes),
            self.pixels.as_flattened(),
            width,
            height,
            image::ExtendedColorType::Rgb8,
        )
        .map_err(|error| ReportError::Rasterise { width, height, reason: error.to_string() })?;
        Ok(bytes)
    }
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

/// Path data through points, closed or open; points that are no numbers are left out.
struct Path<'a>(&'a [(f64, f64)], bool);

impl std::fmt::Display for Path<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let finite = self.0.iter().filter(|(x, y)| x.is_finite() && y.is_finite());
        for (index, &(x, y)) in finite.enumerate() {
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

/// Text with XML's signs replaced and control characters, which XML forbids, left out.
struct Escaped<'a>(&'a str);

impl std::fmt::Display for Escaped<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        self.0.chars().filter(|character| !character.is_control()).try_for_each(|character| match character {
            '&' => f.write_str("&amp;"),
            '<' => f.write_str("&lt;"),
            '>' => f.write_str("&gt;"),
            other => f.write_char(other),
        })
    }
}
