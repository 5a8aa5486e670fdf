//! Depth of a node below a faceted surface whose facets pass into each other smoothly; a node with a radius lies deeper by that.
//!
//! The distance to the closest facet has a crease wherever another facet takes over, and a node that crosses it is pushed
//! another way at once. So the depth is a mean of the depths g_t below the triangles near the node ([`super::facet_depth`]: below their
//! planes, but for nodes far to the side of a facet),
//! `D = sum_t a_t r_t^2 g_t`, `r_t = max(0, R - e_t / w^2)`, `sum_t a_t r_t^2 = 1`,
//! e_t the squared distance to triangle t, w the scene's `blending`, and `a_t = A_t^2 / (A_t^2 + w^2 A_t0)` with the triangle's
//! area A_t, at rest A_t0: where it collapses its plane may turn any way, and has no say. The last equation determines R. Below a plane D is the depth. At a lateral distance l from the foot on a flat
//! surface e_t = s^2 + l^2, so w is a width along the surface, at any depth and, because of a_t, for any size of triangles:
//! R - min e_t / w^2 is about one for coarse and for fine ones. All of it is continuous with its first derivatives, as
//! squared distances and planes are (implicit moving least squares, Kolluri 2008, with triangles for points and weights of
//! compact support).
//!
//! With `P = sum_t a_t r_t`, `m = sum_t a_t r_t g_t / P`, and g_t a function of s_t, the depth below the plane, and of e_t:
//! `dD = sum_t a_t r_t^2 dg_t + 2 sum_t a_t r_t (m - g_t) de_t / w^2 + sum_t r_t^2 (g_t - m) da_t`,
//! `da_t = 2 a_t (1 - a_t) d ln A_t`, where `d ln A = sum_j g_j . v_j` along displacements v_j of the corners, g_j the gradients of
//! the barycentric weights, and the second variation of ln A is `sum_jk ((N . v_j) g_j . g_k (N . v_k) - (g_k . v_j) (g_j . v_k))`.
//! Rows of the list of contacts carry this: one for each plane, and one for the feature closest on each triangle where
//! that is not its face; `share` is what D changes by with the row's own distance: a_t r_t^2 dg/ds for a plane, and
//! 2 c (a_t r_t^2 dg/de + 2 a_t r_t (m - g_t) / w^2) for a feature at distance c, e_t = c^2; the sum of both where they are
//! the same; `stretch`, of a plane's row, is what D changes by with ln A.

use super::bounding_volumes::BoundingVolumes;
use super::closest_point::{ClosestPoint, Feature, closest_point, point_at};
use super::depth::{Contact, Curvature, face_gradients, measure, second_variation};
use super::facet_depth::FacetDepth;
use super::model::Model;
use super::surface;
use crate::tolerances::MINIMUM_SQUARE;
use glam::DVec3;

/// What a row of a smooth depth is part of.
#[derive(Clone, Copy, Debug)]
pub struct Part {
    /// a_t [1].
    area: f64,
    /// r_t [1].
    weight: f64,
    /// g_t.
    facet: FacetDepth,
    /// P [1].
    sum: f64,
    /// m [m].
    mean: f64,
    /// 1/w^2, or zero when frozen [1/m^2].
    scale: f64,
    role: Role,
}

/// Which of a triangle's two distances a row stands for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    /// s_t.
    Plane,
    /// The square root of e_t; the row before is the plane's.
    Feature,
    /// Both: the closest point is in the face.
    Face,
}

impl Part {
    /// dD/de_t [1/m].
    fn by_square(&self) -> f64 {
        let Self { area, weight, facet, mean, scale, .. } = self;
        area * weight * (weight * facet.by_square + 2.0 * (mean - facet.value) * scale)
    }

    /// dD/d ln A_t [m].
    fn by_area(&self) -> f64 {
        let Self { weight, facet, mean, .. } = self;
        self.area_slope() * weight * weight * (facet.value - mean)
    }

    /// d a_t/d ln A_t [1].
    fn area_slope(&self) -> f64 {
        2.0 * self.area * (1.0 - self.area)
    }
}

/// A triangle near a node.
#[derive(Clone, Copy)]
struct Near {
    triangle: u32,
    point: ClosestPoint,
    /// e_t / w^2.
    square: f64,
    /// a_t.
    area: f64,
}

/// Gathers the triangles near one node; its list is reused from node to node.
#[derive(Default)]
pub struct Blend {
    near: Vec<Near>,
}

impl Blend {
    /// No triangles.
    pub fn clear(&mut self) {
        self.near.clear();
    }

    /// Takes in triangle `t` of the surface at `positions` if it is within `reach` of `x` [m].
    pub fn consider(&mut self, model: &Model, x: DVec3, reach: f64, positions: &[DVec3], t: u32) {
        let corners = surface::corners(positions, model.object.triangles[t as usize]);
        let point = closest_point(x, corners);
        let square = x.distance_squared(point_at(corners, point.weights));
        let area = 0.25 * surface::area_vector(corners).length_squared();
        // A triangle without area has no plane, and no say.
        if square < reach * reach && area > MINIMUM_SQUARE {
            let w = model.blending * model.blending;
            let area = area / (area + w * model.rest_areas[t as usize]);
            self.near.push(Near { triangle: t, point, square: square / w, area });
        }
    }

    /// R - min e_t / w^2 for the triangles taken in: they are enough if all within `sqrt(e + that w^2)` are, e the least squared
    /// distance. Sorts them. Infinite where there are none.
    pub fn spread(&mut self) -> f64 {
        self.near.sort_unstable_by(|a, b| a.square.total_cmp(&b.square).then(a.triangle.cmp(&b.triangle)));
        let Some(first) = self.near.first() else { return f64::INFINITY };
        let least = first.square;
        // sum a (R - e)^2 = count (R - mean)^2 + spread.
        let (mut count, mut sum, mut square) = (0.0, 0.0, 0.0);
        let mut found = f64::INFINITY;
        for (k, near) in self.near.iter().enumerate() {
            let e = near.square - least;
            count += near.area;
            sum += near.area * e;
            square += near.area * e * e;
            let mean = sum / count;
            let spread = (square - sum * mean).max(0.0);
            found = mean + ((1.0 - spread).max(0.0) / count).sqrt();
            if self.near.get(k + 1).is_none_or(|next| found <= next.square - least) {
                break;
            }
        }
        found
    }

    /// Adds the rows of the smooth depth of node `i` at `x`, `outside` the surface or not, `spread` being what
    /// [`Blend::spread`] has found.
    pub fn rows(
        &self,
        model: &Model,
        (i, x, outside): (usize, DVec3, bool),
        positions: &[DVec3],
        spread: f64,
        rows: &mut Vec<Contact>,
    ) {
        let Some(first) = self.near.first() else { return };
        let begin = rows.len();
        let reach = first.square + spread;
        let width = model.blending * model.blending;
        let scale = 1.0 / width;
        let (mut depth, mut sum, mut moment) = (model.chain.nodes[i].radius, 0.0, 0.0);
        for near in &self.near {
            let weight = reach - near.square;
            if weight <= 0.0 {
                break;
            }
            let t = near.triangle as usize;
            let nodes = model.object.triangles[t];
            let corners = surface::corners(positions, nodes);
            let normal = surface::unit_or_zero(surface::area_vector(corners));
            let gradients = face_gradients(corners);
            let foot = [0, 1, 2].map(|j| 1.0 + gradients[j].dot(x - corners[j]));
            let plane = measure(x, 0.0, corners, foot, Feature::Face, normal);
            let facet = if outside {
                FacetDepth::outside(plane.1, near.square * width, model.blending)
            } else {
                FacetDepth::below_plane(plane.1)
            };
            let role = if near.point.feature == Feature::Face { Role::Face } else { Role::Plane };
            let part = Part { area: near.area, weight, facet, sum: 0.0, mean: 0.0, scale, role };
            rows.push(Contact { part: Some(part), ..Contact::new(i as u32, nodes, foot, plane) });
            if role == Role::Plane {
                let part = Part { role: Role::Feature, ..part };
                let feature = measure(x, 0.0, corners, near.point.weights, near.point.feature, normal);
                rows.push(Contact { part: Some(part), ..Contact::new(i as u32, nodes, near.point.weights, feature) });
            }
            depth += near.area * weight * weight * facet.value;
            sum += near.area * weight;
            moment += near.area * weight * facet.value;
        }
        let mean = moment / sum;
        for row in &mut rows[begin..] {
            let Some(part) = &mut row.part else { continue };
            part.sum = sum;
            part.mean = mean;
            let role = part.role;
            let plane = part.area * part.weight * part.weight * part.facet.by_plane;
            let feature = 2.0 * row.curvature.distance * part.by_square();
            row.share = match role {
                Role::Plane => plane,
                Role::Feature => feature,
                Role::Face => plane + feature,
            };
            row.stretch = if role == Role::Feature { 0.0 } else { part.by_area() };
            row.depth = depth;
        }
    }
}

/// The width for a surface at rest: half its mean edge, but no more than the least distance of a triangle's middle to a
/// triangle that faces the other way, whose plane must take no part across a thin wall or a slot [m].
#[must_use]
pub fn width(rest: &[DVec3], triangles: &[[u32; 3]], bounds: &BoundingVolumes) -> f64 {
    let mut least = f64::INFINITY;
    for &nodes in triangles {
        let corners = surface::corners(rest, nodes);
        let area_vector = surface::area_vector(corners);
        let middle = (corners[0] + corners[1] + corners[2]) / 3.0;
        bounds.search(middle, least * least, |t| {
            let other = surface::corners(rest, triangles[t as usize]);
            if surface::area_vector(other).dot(area_vector) < 0.0 {
                least = least.min(middle.distance(point_at(other, closest_point(middle, other).weights)));
            }
            least * least
        });
    }
    least.min(0.5 * surface::mean_edge(rest, triangles))
}

/// How far triangles may be from a node whose closest one is at `distance`, R - min e_t / w^2 being `spread` [m].
#[must_use]
pub fn reach(model: &Model, distance: f64, spread: f64) -> f64 {
    (distance * distance + spread * model.blending * model.blending).sqrt()
}

/// Whether two neighbours in a list of contacts are rows of one depth, or walls of one ball.
#[must_use]
pub fn together(a: &Contact, b: &Contact) -> bool {
    let alike = (a.part.is_some() && b.part.is_some()) || (a.wall.is_some() && b.wall.is_some());
    alike && a.proxy_node == b.proxy_node
}

/// What displacements do to one row.
#[derive(Clone, Copy, Debug)]
pub struct RowChange {
    /// What they bring it nearer by [m].
    deepening: f64,
    /// By what share they stretch its triangle: d ln A [1].
    stretching: f64,
}

/// What displacements deepen the node by, to first order, `rows` being those of its depth and `v` the displacements of each
/// row's three nodes; `own` takes what they do to each row [m].
pub fn deepening(rows: &[Contact], v: impl Fn(usize) -> [DVec3; 3], own: &mut Vec<RowChange>) -> f64 {
    own.clear();
    own.extend(rows.iter().enumerate().map(|(k, row)| {
        let v = v(k);
        RowChange { deepening: row.deepening(v), stretching: row.stretching(v) }
    }));
    match rows {
        [row] if row.part.is_none() => own[0].deepening,
        _ => rows.iter().zip(own).map(|(row, own)| row.share * own.deepening + row.stretch * own.stretching).sum(),
    }
}

/// Second variation of the depth along displacements `v`, which change the rows by `own`, see [`deepening`]: for row after row
/// one vector for each of its nodes.
pub fn vary(
    rows: &[Contact],
    v: impl Fn(usize) -> [DVec3; 3],
    own: &[RowChange],
    mut each: impl FnMut(usize, [DVec3; 3]),
) {
    let Some(Part { sum, mean, scale, .. }) = rows[0].part else {
        each(0, second_variation(&rows[0], v(0)).map(|part| part * rows[0].share));
        return;
    };
    if scale == 0.0 {
        (0..rows.len()).for_each(|k| each(k, [DVec3::ZERO; 3]));
        return;
    }
    // Changes of e_t, and by all of R, of sum a r g and of P.
    let square = |k: usize| 2.0 * rows[k].curvature.distance * own[k].deepening;
    let (mut reach, mut moment, mut weights, mut areas, mut depths) = (0.0, 0.0, 0.0, 0.0, 0.0);
    for (k, row) in rows.iter().enumerate() {
        let Some(part) = row.part else { continue };
        let Part { area, weight, facet, role, .. } = part;
        if role != Role::Plane {
            let square = square(k);
            let change = square * scale;
            reach += area * weight * change / sum;
            moment += area * (weight * facet.by_square * square - change * facet.value);
            weights -= area * change;
        }
        if role != Role::Feature {
            let area_change = part.area_slope() * own[k].stretching;
            reach -= 0.5 * area_change * weight * weight / sum;
            moment += area * weight * facet.by_plane * own[k].deepening + area_change * weight * facet.value;
            weights += area_change * weight;
            areas += area;
            depths += area * facet.value;
        }
    }
    moment += reach * depths;
    weights += reach * areas;
    let mean_change = (moment - mean * weights) / sum;
    let (mut plane, mut square_change) = (own[0], 0.0);
    for (k, row) in rows.iter().enumerate() {
        let Some(part) = row.part else { continue };
        let Part { area, weight, facet, role, .. } = part;
        if role != Role::Feature {
            plane = own[k];
            square_change = square(if role == Role::Plane { k + 1 } else { k });
        }
        let area_change = part.area_slope() * plane.stretching;
        let weight_change = reach - square_change * scale;
        let depth_change = facet.by_plane * plane.deepening + facet.by_square * square_change;
        let apart_change = mean_change - depth_change;
        let [slope_change, square_slope_change] = facet.slope_changes(plane.deepening, square_change);
        let (mut along, mut stretch_change) = (0.0, 0.0);
        if role != Role::Feature {
            let whole_weight_change = 2.0 * area * weight * weight_change + area_change * weight * weight;
            along += whole_weight_change * facet.by_plane + area * weight * weight * slope_change;
            stretch_change = 2.0 * (1.0 - 2.0 * area) * area_change * weight * weight * (facet.value - mean)
                + part.area_slope() * weight * (2.0 * weight_change * (facet.value - mean) - weight * apart_change);
        }
        if role != Role::Plane {
            let change = (area_change * weight + area * weight_change)
                * (weight * facet.by_square + 2.0 * (mean - facet.value) * scale)
                + area
                    * weight
                    * (weight_change * facet.by_square + weight * square_slope_change + 2.0 * apart_change * scale);
            along += 2.0 * (change * row.curvature.distance + part.by_square() * own[k].deepening);
        }
        let v = v(k);
        let bend = second_variation(row, v);
        let stretching = if row.stretch == 0.0 { [DVec3::ZERO; 3] } else { stretching_variation(row, v) };
        each(
            k,
            [0, 1, 2].map(|j| {
                bend[j] * row.share
                    + row.normal * (along * row.weights[j])
                    + stretching[j] * row.stretch
                    + row.curvature.gradients[j] * stretch_change
            }),
        );
    }
}

/// Second variation of ln A of a plane's row along displacements `v` of its nodes: one vector a node.
fn stretching_variation(row: &Contact, v: [DVec3; 3]) -> [DVec3; 3] {
    let g = row.curvature.gradients;
    let turn = g[0] * row.normal.dot(v[0]) + g[1] * row.normal.dot(v[1]) + g[2] * row.normal.dot(v[2]);
    [0, 1, 2].map(|k| {
        let carried = g[0] * g[k].dot(v[0]) + g[1] * g[k].dot(v[1]) + g[2] * g[k].dot(v[2]);
        row.normal * g[k].dot(turn) - carried
    })
}

/// Freezes rows at a state of the surface: they change in proportion to displacements from there.
pub fn freeze(rows: &mut [Contact]) {
    for row in rows {
        // The gradients belong to the first derivative too, where there is stretch.
        row.curvature = Curvature { gradients: row.curvature.gradients, ..Curvature::default() };
        if let Some(wall) = &mut row.wall {
            wall.freeze();
        }
        match &mut row.part {
            Some(part) => part.scale = 0.0,
            None => row.curvature = Curvature::default(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::detection::{Detection, Walls};
    use crate::object::Object;
    use crate::proxy::Chain;
    use crate::random::sequence;
    use crate::scene::Scene;

    const SCENE: &str = r#"
        [object]
        sphere = { radius = 0.05, rings = 6, segments = 8 }
        springs = { kind = "isotropic", stiffness = 300.0 }
        ground = { stiffness = 100.0 }
        [contact]
        stiffness = 300.0
        blending = 0.012
        [grid]
        axes = [{ start = 0.0, stop = 0.01, count = 2 }]
        [[proxy.joint]]
        kind = "prismatic"
        axis = [0.0, 0.0, -1.0]
        limits = [-0.1, 0.1]
        nodes = [{ at = [0.0, 0.0, 0.0], radius = 0.0 }]
    "#;

    /// Depth, its first and its second derivative along random displacements of a random surface, against central differences: of
    /// points below it, and of balls outside, over widths so small beside their radius that facets are also felt from their
    /// sides.
    #[test]
    fn derivatives_agree_with_finite_differences() {
        for (radius, width, least, most) in [(0.0, 0.012, 0.031, 0.049), (0.03, 0.012, 0.055, 0.075)] {
            let scene =
                SCENE.replace("radius = 0.0 ", &format!("radius = {radius} ")).replace("0.012", &width.to_string());
            let scene = Scene::parse(&scene, "blend.toml").unwrap();
            let object = Object::build(&scene.object).unwrap();
            let chain = Chain::new(&scene.proxy);
            let model = Model::new(&object, &chain, scene.contact);
            let counts = compare_derivatives(&model, least, most);
            assert!(counts[0] > 40 && counts[1] > 20 && (radius == 0.0 || counts[2] > 10), "{radius}: {counts:?}");
        }
    }

    /// How many places between two distances from the centre were compared, how many of them with more than six rows, and with
    /// facets felt from their sides.
    fn compare_derivatives(model: &Model, least: f64, most: f64) -> [usize; 3] {
        let mut detection = Detection::new(model);
        let mut next = sequence(5);
        let order = 3 * model.rest.len();
        let mut counts = [0; 3];
        for _ in 0..80 {
            let share = 0.5 + 0.5 * next();
            let x = DVec3::new(next(), next(), next()).normalize() * (least + share * (most - least));
            let u: Vec<f64> = (0..order).map(|_| 0.003 * next()).collect();
            let (v, w): (Vec<f64>, Vec<f64>) = (0..order).map(|_| (next(), next())).unzip();
            let at = |k: usize, vector: &[f64]| DVec3::from_slice(&vector[3 * k..]);
            let moved =
                |rows: &[Contact], k: usize, vector: &[f64]| rows[k].nodes.map(|node| at(node as usize, vector));
            let mut rows_at = |step: f64| {
                let u: Vec<f64> = u.iter().zip(&v).map(|(u, v)| u + step * v).collect();
                let positions: Vec<DVec3> = (0..model.rest.len()).map(|k| model.rest[k] + at(k, &u)).collect();
                detection.take_up(model, &[x + model.centre]);
                let mut rows = Vec::new();
                detection.deformed(model, &u, &positions, Walls::All, &mut rows);
                rows
            };
            let h = 1e-7;
            let (here, before, after) = (rows_at(0.0), rows_at(-h), rows_at(h));
            let rows = here.len();
            if rows == 0 || before.len() != rows || after.len() != rows {
                continue;
            }
            let (mut along_v, mut along_w, mut scratch) = (Vec::new(), Vec::new(), Vec::new());
            let slope = deepening(&here, |k| moved(&here, k, &v), &mut along_v);
            let found = (after[0].depth - before[0].depth) / (2.0 * h);
            assert!((slope - found).abs() < 1e-5 * (1.0 + slope.abs()), "{slope} {found}");
            deepening(&here, |k| moved(&here, k, &w), &mut along_w);
            let mut bend = 0.0;
            vary(
                &here,
                |k| moved(&here, k, &v),
                &along_v,
                |k, parts| {
                    bend += parts.iter().zip(moved(&here, k, &w)).map(|(part, w)| part.dot(w)).sum::<f64>();
                },
            );
            let mut slope_along_w = |rows: &[Contact]| deepening(rows, |k| moved(rows, k, &w), &mut scratch);
            let found = (slope_along_w(&after) - slope_along_w(&before)) / (2.0 * h);
            assert!((bend - found).abs() < 1e-3 * (100.0 + found.abs()), "{bend} {found}");
            counts[0] += 1;
            counts[1] += usize::from(rows > 6);
            counts[2] += usize::from(here.iter().filter_map(|row| row.part).any(|part| part.facet.by_square != 0.0));
        }
        counts
    }

    #[test]
    fn the_mesh_suggests_half_an_edge_but_less_across_thin_walls() {
        let plate = |thickness: f64| {
            let corner = |k: u32| {
                let z = if k & 4 == 0 { 0.0 } else { thickness };
                DVec3::new(f64::from(k & 1), f64::from(k >> 1 & 1), z)
            };
            let rest: Vec<DVec3> = (0..8).map(corner).collect();
            let quads = [[0, 2, 3, 1], [4, 5, 7, 6], [0, 1, 5, 4], [2, 6, 7, 3], [0, 4, 6, 2], [1, 3, 7, 5]];
            let triangles: Vec<[u32; 3]> = quads.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
            width(&rest, &triangles, &BoundingVolumes::new(&rest, &triangles))
        };
        // A cube: twelve edges and six diagonals, each diagonal in two triangles as each edge is.
        assert!((plate(1.0) - 0.5 * (12.0 + 6.0 * 2.0f64.sqrt()) / 18.0).abs() < 1e-12, "{}", plate(1.0));
        assert!((plate(0.1) - 0.1).abs() < 1e-12, "{}", plate(0.1));
    }
}
