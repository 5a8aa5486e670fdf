//! A plane of C-space as a heat map: any two joints across and up, the others at a grid line each, which follows the
//! configuration or is set by a slider. A cell is a grid point with the number that is stored there, not interpolated.

use super::{
    column::{Column, status_colour},
    friction::friction_ellipse,
    history::History,
    legend,
    loaded::Loaded,
    number,
    palette::{self, Palette},
    theme::{
        self, COLOUR_BAR, COLUMN_WIDTH, CROSS, FINE_CURVE, FINE_GAP, HAIRLINE, JOINT_WIDTH, KEY_HEIGHT, LEAST_MAP,
        SWATCH,
    },
};
use crate::{
    JointVector,
    contact::Status,
    dataset::{Dataset, Grid},
    draw::colour::ColourMap,
};
use eframe::egui::{
    self, ColorImage, Painter, Rect, RichText, ScrollArea, Slider, Stroke, StrokeKind, TextureHandle, TextureOptions,
    Ui, pos2, vec2,
};
use egui_plot::{HoverPosition, Line, MarkerShape, Plot, PlotImage, PlotPoint, Points};

/// Length of the trail behind the configuration (s), and its points.
const TRAIL: f64 = 2.0;
const TRAIL_POINTS: usize = 200;

/// Width left for name and value beside a slider, and for the ends of the range beside a colour bar; least width of
/// slider and bar (points).
const NAMES_WIDTH: f32 = 150.0;
const RANGE_WIDTH: f32 = 60.0;
const LEAST_WIDTH: f32 = 40.0;

/// The panel's state.
pub struct Slices {
    column: Column,
    axes: [usize; 2],
    /// Whether the other joints follow the configuration.
    follow: bool,
    /// Grid line of every joint.
    lines: Vec<usize>,
    drawn: Option<Drawn>,
}

/// A plane as it was drawn.
struct Drawn {
    key: Key,
    picture: TextureHandle,
    map: ColourMap,
    /// The edge of contact: lines between cells, from end to end.
    edge: Vec<[[f64; 2]; 2]>,
}

/// Everything that a picture depends on.
#[derive(Clone, PartialEq)]
struct Key {
    column: Column,
    axes: [usize; 2],
    lines: Vec<usize>,
    dark: bool,
    dataset: *const Dataset,
}

impl Slices {
    /// The plane of the last two joints, or of a single one along itself, in the middle of the grid.
    #[must_use]
    pub fn new(dataset: &Dataset) -> Self {
        let joints = dataset.grid.joints();
        let axes = [joints.saturating_sub(2), joints - 1];
        let lines = dataset.grid.axes.iter().map(|axis| axis.count / 2).collect();
        Self { column: Column::Torque(axes[0]), axes, follow: true, lines, drawn: None }
    }

    /// The panel, `height` points of it. The heat map has what the sliders of many joints leave of that; where it would
    /// be too low one scrolls.
    pub fn show(&mut self, ui: &mut Ui, loaded: &Loaded, q: &JointVector, history: &History, height: f32) {
        let scrolled = ScrollArea::vertical().id_salt("plane").max_height(height).min_scrolled_height(height);
        scrolled.show(ui, |ui| self.widgets(ui, loaded, q, history, height));
    }

    fn widgets(&mut self, ui: &mut Ui, loaded: &Loaded, q: &JointVector, history: &History, height: f32) {
        let end = ui.cursor().top() + height;
        let grid = &loaded.dataset.grid;
        self.choices(ui, &loaded.dataset);
        if self.follow {
            for ((line, axis), q) in self.lines.iter_mut().zip(&grid.axes).zip(q.iter()) {
                *line = axis.nearest_line(*q);
            }
        }
        self.others(ui, grid);
        let map = self.refresh(ui, &loaded.dataset);
        let height = (end - KEY_HEIGHT - ui.cursor().top()).max(LEAST_MAP);
        self.plot(ui, loaded, q, history, height);
        self.key(ui, &loaded.dataset, map);
    }

    fn choices(&mut self, ui: &mut Ui, dataset: &Dataset) {
        let grid = &dataset.grid;
        ui.horizontal(|ui| {
            let label = ui.label("Show");
            legend::choice(ui, &label, "column", Some(COLUMN_WIDTH), self.column.name(grid), |ui| {
                for column in Column::all(dataset) {
                    ui.selectable_value(&mut self.column, column, column.name(grid));
                }
            });
        });
        if grid.joints() < 2 {
            return;
        }
        ui.horizontal(|ui| {
            for (side, name) in ["Across", "Up"].into_iter().enumerate() {
                let label = ui.label(name);
                let chosen = &grid.axes[self.axes[side]].name;
                let mut axis = self.axes[side];
                legend::choice(ui, &label, name, Some(JOINT_WIDTH), chosen, |ui| {
                    for (joint, of) in grid.axes.iter().enumerate() {
                        ui.selectable_value(&mut axis, joint, &of.name);
                    }
                });
                if axis != self.axes[side] {
                    // Choosing the other side's joint swaps the two.
                    if axis == self.axes[1 - side] {
                        self.axes[1 - side] = self.axes[side];
                    }
                    self.axes[side] = axis;
                }
            }
            if grid.joints() > 2 {
                ui.checkbox(&mut self.follow, "follow q").on_hover_text("The plane goes through the configuration");
            }
        });
    }

    /// Sliders for the joints that are not shown.
    fn others(&mut self, ui: &mut Ui, grid: &Grid) {
        for (joint, axis) in grid.axes.iter().enumerate() {
            if self.axes.contains(&joint) {
                continue;
            }
            ui.horizontal(|ui| {
                let value = axis.coordinate(self.lines[joint]);
                ui.spacing_mut().slider_width = (ui.available_width() - NAMES_WIDTH).max(LEAST_WIDTH);
                let slider = Slider::new(&mut self.lines[joint], 0..=axis.count - 1).show_value(false).text(&axis.name);
                let response = ui.add_enabled(!self.follow, slider);
                ui.label(RichText::new(format!("{} {}", number(value), axis.unit)).weak());
                response.on_hover_text("Grid line of the joint that is not shown");
            });
        }
    }

    /// Redraws the picture if something has changed.
    fn refresh(&mut self, ui: &Ui, dataset: &std::sync::Arc<Dataset>) -> ColourMap {
        let mut lines = self.lines.clone();
        self.axes.iter().for_each(|&axis| lines[axis] = 0);
        let dark = ui.visuals().dark_mode;
        let key = Key { column: self.column, axes: self.axes, lines, dark, dataset: std::sync::Arc::as_ptr(dataset) };
        match &self.drawn {
            Some(drawn) if drawn.key == key => drawn.map,
            drawn => {
                let map = match drawn {
                    Some(drawn) if drawn.key.column == key.column && drawn.key.dataset == key.dataset => drawn.map,
                    _ => self.column.map(dataset),
                };
                let image = picture(dataset, &key, map, &palette::of(ui.visuals()));
                let picture = ui.ctx().load_texture("C-space plane", image, TextureOptions::NEAREST);
                let edge = edge(dataset, &key);
                self.drawn = Some(Drawn { key, picture, map, edge });
                map
            }
        }
    }

    fn plot(&mut self, ui: &mut Ui, loaded: &Loaded, q: &JointVector, history: &History, height: f32) {
        let grid = &loaded.dataset.grid;
        let palette = palette::of(ui.visuals());
        let Some(Drawn { key, picture, edge, .. }) = &self.drawn else { return };
        let [across, up] = self.axes.map(|axis| &grid.axes[axis]);
        let single = grid.joints() == 1;
        let extent = |axis: &crate::dataset::Axis| [axis.start - 0.5 * axis.step, axis.last() + 0.5 * axis.step];
        let ([left, right], [low, high]) = (extent(across), if single { [0.0, 1.0] } else { extent(up) });
        let image = PlotImage::new(
            "grid points",
            picture.id(),
            PlotPoint::new(0.5 * (left + right), 0.5 * (low + high)),
            vec2((right - left) as f32, (high - low) as f32),
        )
        .allow_hover(false);
        let place = |q: &JointVector| if single { [q[0], 0.5] } else { [q[self.axes[0]], q[self.axes[1]]] };
        let trail: Vec<[f64; 2]> = history.recent(TRAIL, TRAIL_POINTS).map(|tick| place(&tick.proxy)).collect();
        let flagged: Vec<[f64; 2]> = plane(grid, key)
            .filter(|&(_, point)| loaded.dataset.status(point).is_failed())
            .map(|(_, point)| place(&grid.configuration(point)))
            .collect();
        let inside = grid.clamp(q);
        let (here, outside) = (place(&inside), inside != *q);
        let friction = history.last().and_then(|tick| friction_ellipse(loaded, tick, &inside, self.axes));
        let dataset = &loaded.dataset;
        let column = self.column;
        let (axes, lines) = (self.axes, self.lines.clone());
        let plot = Plot::new(("slice", self.axes))
            .height(height)
            .show_grid(false)
            .show_background(false)
            .default_x_bounds(left, right)
            .default_y_bounds(low, high)
            .set_margin_fraction(vec2(0.0, 0.0))
            .custom_x_axes(vec![
                theme::across(&format!("{} [{}]", across.name, across.unit)).formatter(theme::mark_number),
            ])
            .custom_y_axes(vec![theme::upward(&format!("{} [{}]", up.name, up.unit)).formatter(theme::mark_number)])
            .x_grid_spacer(theme::marks)
            .y_grid_spacer(theme::marks)
            .show_axes([true, !single])
            .show_crosshair(false)
            .label_formatter(move |position| {
                let (HoverPosition::NearDataPoint { position: at, .. } | HoverPosition::Elsewhere { position: at }) =
                    position;
                let mut q = JointVector::zeros(dataset.grid.joints());
                for ((q, axis), line) in q.iter_mut().zip(&dataset.grid.axes).zip(&lines) {
                    *q = axis.coordinate(*line);
                }
                (q[axes[0]], q[axes[1]]) = if single { (at.x, at.x) } else { (at.x, at.y) };
                let point = dataset.grid.nearest(&q)?;
                let status = format!("{:?}", dataset.status(point)).to_lowercase();
                Some(format!("{}: {}\n{status}", column.name(&dataset.grid), number(column.value(dataset, point))))
            });
        let shown = plot.show(ui, |plot| {
            plot.image(image);
            for ends in edge {
                let line = Line::new("edge of contact", ends.to_vec()).color(palette.here).width(HAIRLINE);
                plot.line(line.allow_hover(false));
            }
            plot.line(Line::new("trail", trail).color(palette.force).width(FINE_CURVE).allow_hover(false));
            if !flagged.is_empty() {
                let marks = Points::new("not converged", flagged).shape(MarkerShape::Cross).radius(CROSS);
                plot.points(marks.color(palette.flagged).allow_hover(false));
            }
            if let Some(ellipse) = friction {
                plot.line(Line::new("friction", ellipse).color(palette.axis).width(FINE_CURVE).allow_hover(false));
            }
            for (radius, colour) in palette::ring(&palette, outside) {
                plot.points(Points::new("q", vec![here]).radius(radius).color(colour).allow_hover(false));
            }
        });
        let name = || egui::WidgetInfo::labeled(egui::Role::Canvas, true, "Plane of C-space");
        shown.response.widget_info(name);
    }

    /// Colour bar, or what the colours of the statuses mean.
    fn key(&self, ui: &mut Ui, dataset: &Dataset, map: ColourMap) {
        let palette = palette::of(ui.visuals());
        if self.column == Column::Status {
            ui.horizontal_wrapped(|ui| {
                for status in [Status::Free, Status::Contact, Status::Unconverged, Status::Overflow, Status::Outside] {
                    let rect = legend::entry(ui, vec2(SWATCH, SWATCH), &format!("{status:?}").to_lowercase());
                    // Some colours are nearly that of the ground.
                    let rim = Stroke::new(HAIRLINE, palette.axis);
                    ui.painter().rect(rect, FINE_GAP, status_colour(status, &palette), rim, StrokeKind::Inside);
                }
            });
            return;
        }
        let [low, high] = map.range();
        ui.horizontal(|ui| {
            ui.label(RichText::new(number(low)).small());
            let width = ui.available_width() - RANGE_WIDTH;
            let (rect, _) = ui.allocate_exact_size(vec2(width.max(LEAST_WIDTH), COLOUR_BAR), egui::Sense::hover());
            gradient(ui.painter(), rect, map);
            ui.label(RichText::new(number(high)).small());
        });
        let lost = dataset.status_counts();
        if lost.unconverged + lost.overflow > 0 {
            let note =
                format!("× {} of {} points not converged", lost.unconverged + lost.overflow, dataset.grid.points());
            ui.colored_label(palette.flagged, RichText::new(note).small());
        }
    }
}

/// Cells of a plane, row by row from the top, with their grid points.
fn plane<'a>(grid: &'a Grid, key: &'a Key) -> impl Iterator<Item = ([usize; 2], usize)> + 'a {
    let [across, up] = key.axes;
    let single = across == up;
    let rows = if single { 1 } else { grid.axes[up].count };
    (0..rows).rev().flat_map(move |row| {
        (0..grid.axes[across].count).map(move |column| {
            let line = |joint: usize| match joint {
                joint if joint == across => column,
                joint if joint == up => row,
                joint => key.lines[joint],
            };
            ([column, row], grid.point((0..grid.joints()).map(line)))
        })
    })
}

/// The edge of contact in a plane: the lines between its cells where one is in contact and the next is not.
fn edge(dataset: &Dataset, key: &Key) -> Vec<[[f64; 2]; 2]> {
    let grid = &dataset.grid;
    let [across, up] = key.axes;
    let single = across == up;
    let [columns, rows] = [grid.axes[across].count, if single { 1 } else { grid.axes[up].count }];
    let mut touches = vec![false; columns * rows];
    for ([column, row], point) in plane(grid, key) {
        touches[row * columns + column] = dataset.status(point).is_in_contact();
    }
    // Lines between cells, counted from the first one's outer side.
    let line = |joint: usize, line: usize| grid.axes[joint].start + grid.axes[joint].step * (line as f64 - 0.5);
    let height = |row: usize| if single { row as f64 } else { line(up, row) };
    let differ = |a: [usize; 2], b: [usize; 2]| touches[a[1] * columns + a[0]] != touches[b[1] * columns + b[0]];
    let mut lines = Vec::new();
    for row in 0..rows {
        for column in 0..columns {
            let [left, right] = [line(across, column), line(across, column + 1)];
            if column > 0 && differ([column - 1, row], [column, row]) {
                lines.push([[left, height(row)], [left, height(row + 1)]]);
            }
            if row > 0 && differ([column, row - 1], [column, row]) {
                lines.push([[left, height(row)], [right, height(row)]]);
            }
        }
    }
    lines
}

fn picture(dataset: &Dataset, key: &Key, map: ColourMap, palette: &Palette) -> ColorImage {
    let grid = &dataset.grid;
    let [across, up] = key.axes;
    let size = [grid.axes[across].count, if across == up { 1 } else { grid.axes[up].count }];
    let colour = |point: usize| {
        let status = dataset.status(point);
        match (key.column, status) {
            (Column::Status, _) => status_colour(status, palette),
            (_, Status::Outside) => palette.absent,
            // Nothing is felt there, which is not the same as little.
            (Column::Torque(_) | Column::Energy | Column::Residual, Status::Free) => palette.free,
            _ => palette::egui_colour(map.colour(key.column.value(dataset, point))),
        }
    };
    ColorImage::new(size, plane(grid, key).map(|(_, point)| colour(point)).collect())
}

/// A colour bar from left to right.
pub fn gradient(painter: &Painter, rect: Rect, map: ColourMap) {
    const STEPS: usize = 48;
    /// Overlap of neighbours, so that no ground shows between them (points).
    const SEAM: f32 = 0.6;
    for step in 0..STEPS {
        let share = (step as f64 + 0.5) / STEPS as f64;
        let left = rect.left() + rect.width() * step as f32 / STEPS as f32;
        let cell = Rect::from_min_size(pos2(left, rect.top()), vec2(rect.width() / STEPS as f32 + SEAM, rect.height()));
        painter.rect_filled(cell.intersect(rect), 0.0, palette::egui_colour(map.at(share)));
    }
}
