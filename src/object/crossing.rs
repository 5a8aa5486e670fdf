//! Does a closed surface cross or touch itself?
//!
//! Where two sheets of a surface cross, "inside" has no meaning for contact: the signed distance changes its sign in
//! the middle of the material. Two triangles cross exactly where an edge of one meets the other, so all pairs of an
//! edge and a triangle that share no node are tested with exact predicates (Shewchuk, Adaptive precision floating-point
//! arithmetic and fast robust geometric predicates, 1997). A surface without such a pair has each of its connected
//! parts wholly inside or wholly outside every other.
//!
//! Pairs of triangles whose boxes overlap are found by a sweep along the longest axis of the surface.

use glam::DVec3;
use robust::{Coord3D, orient3d};

/// Refuses a surface of which an edge meets a triangle that it shares no node with.
///
/// # Errors
/// Names the pair and its place, for the one that the sweep finds first.
pub(super) fn check(nodes: &[DVec3], triangles: &[[u32; 3]]) -> Result<(), String> {
    let corners = |t: u32| triangles[t as usize].map(|node| nodes[node as usize]);
    let low = nodes.iter().copied().fold(DVec3::MAX, DVec3::min);
    let high = nodes.iter().copied().fold(DVec3::MIN, DVec3::max);
    let axis = (high - low).max_position();
    let boxes: Vec<[DVec3; 2]> = (0..triangles.len() as u32)
        .map(|t| {
            let [a, b, c] = corners(t);
            [a.min(b).min(c), a.max(b).max(c)]
        })
        .collect();
    let mut order: Vec<u32> = (0..triangles.len() as u32).collect();
    order.sort_unstable_by(|&s, &t| boxes[s as usize][0][axis].total_cmp(&boxes[t as usize][0][axis]).then(s.cmp(&t)));
    let mut active: Vec<u32> = Vec::new();
    for &t in &order {
        let [low, high] = boxes[t as usize];
        active.retain(|&s| boxes[s as usize][1][axis] >= low[axis]);
        for &s in &active {
            let [other_low, other_high] = boxes[s as usize];
            if !(low.cmple(other_high).all() && other_low.cmple(high).all()) {
                continue;
            }
            let (one, other) = (triangles[s as usize], triangles[t as usize]);
            if let Some(place) = meeting(nodes, one, other).or_else(|| meeting(nodes, other, one)) {
                let ([one, other], [x, y, z]) = ([s.min(t), s.max(t)], place.to_array());
                return Err(format!(
                    "the surface crosses or touches itself: triangles {one} and {other} meet near ({x:.4}, {y:.4}, {z:.4}) \
                     m: part the pieces, or join them into one surface (a boolean union in Blender or MeshLab)"
                ));
            }
        }
        active.push(t);
    }
    Ok(())
}

/// Returns where an edge of `one` meets the triangle `other` without sharing a node with it.
fn meeting(nodes: &[DVec3], one: [u32; 3], other: [u32; 3]) -> Option<DVec3> {
    let facet = other.map(|node| nodes[node as usize]);
    (0..3).map(|k| [one[k], one[(k + 1) % 3]]).filter(|ends| !ends.iter().any(|end| other.contains(end))).find_map(
        |ends| {
            let ends = ends.map(|node| nodes[node as usize]);
            meets(ends, facet).then(|| ends[0].midpoint(ends[1]))
        },
    )
}

/// Whether the segment between `ends`, neither of them left out, meets the triangle `facet`, its border included. A
/// segment in the plane of the triangle does not: the edges that leave that plane tell.
fn meets(ends: [DVec3; 2], facet: [DVec3; 3]) -> bool {
    let [a, b] = ends;
    let [p, q, r] = facet;
    let [above, below] = ends.map(|end| sign(p, q, r, end));
    if above == below {
        return false;
    }
    let sides = [sign(a, b, p, q), sign(a, b, q, r), sign(a, b, r, p)];
    sides.iter().all(|&side| side >= 0) || sides.iter().all(|&side| side <= 0)
}

/// On which side of the plane through the first three points the last lies: 1, 0 or -1, exactly.
fn sign(a: DVec3, b: DVec3, c: DVec3, d: DVec3) -> i8 {
    let [a, b, c, d] = [a, b, c, d].map(|v| Coord3D { x: v.x, y: v.y, z: v.z });
    let volume = orient3d(a, b, c, d);
    i8::from(volume > 0.0) - i8::from(volume < 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::object::sphere;
    use crate::random::sequence;

    type Surface = (Vec<DVec3>, Vec<[u32; 3]>);

    fn ball(centre: DVec3, radius: f64) -> Surface {
        sphere::generate(centre, radius, 10, 10).unwrap()
    }

    fn together(parts: &[Surface]) -> Surface {
        let (mut nodes, mut triangles) = (Vec::new(), Vec::new());
        for (points, facets) in parts {
            let first = nodes.len() as u32;
            nodes.extend(points);
            triangles.extend(facets.iter().map(|facet| facet.map(|node| first + node)));
        }
        (nodes, triangles)
    }

    fn crosses((nodes, triangles): &Surface) -> bool {
        check(nodes, triangles).is_err()
    }

    /// Two balls of radius 1 at many distances: they cross between nested and apart, also where nodes and edges meet
    /// exactly.
    #[test]
    fn parts_that_overlap_are_found_and_parts_apart_or_nested_are_not() {
        for step in 1..40 {
            let distance = 0.1 * f64::from(step);
            for axis in [DVec3::X, DVec3::Y, DVec3::Z, DVec3::new(0.6, 0.8, 0.0)] {
                let both = together(&[ball(DVec3::ZERO, 1.0), ball(axis * distance, 1.0)]);
                // The polyhedra lie within their spheres and contain those of 0.9 of the radius.
                if distance > 2.0 {
                    assert!(!crosses(&both), "{distance} along {axis}");
                } else if distance < 1.8 {
                    assert!(crosses(&both), "{distance} along {axis}");
                }
                let nested = together(&[ball(DVec3::ZERO, 5.0), ball(axis * distance.min(3.0), 1.0)]);
                assert!(!crosses(&nested));
            }
        }
    }

    /// A cap pushed through the bottom of the same sphere.
    #[test]
    fn a_part_that_crosses_itself_is_found_with_its_place() {
        let (mut nodes, triangles) = ball(DVec3::ZERO, 0.05);
        assert!(check(&nodes, &triangles).is_ok());
        let top = (0..nodes.len()).max_by(|&i, &j| nodes[i].z.total_cmp(&nodes[j].z)).unwrap();
        nodes[top].z = 0.0;
        assert!(check(&nodes, &triangles).is_ok(), "a dent is no crossing");
        nodes[top].z = -0.08;
        let text = check(&nodes, &triangles).unwrap_err();
        let numbers = text.split(|c: char| !(c.is_ascii_digit() || matches!(c, '.' | '-')));
        let numbers: Vec<f64> = numbers.filter_map(|number| number.parse().ok()).collect();
        let has_top = |number: f64| triangles[number as usize].contains(&(top as u32));
        assert!(has_top(numbers[0]) != has_top(numbers[1]), "the cap leaves through the bottom: {text}");
        assert!(DVec3::new(numbers[2], numbers[3], numbers[4]).length() < 0.1, "{text}");
    }

    /// Segments and triangles in general position against barycentric coordinates in floating point.
    #[test]
    fn the_exact_test_agrees_with_barycentric_coordinates() {
        let mut next = sequence(3);
        let mut seen = [0usize; 2];
        for _ in 0..4000 {
            let mut point = || DVec3::new(next(), next(), next());
            let (a, b, p, q, r) = (point(), point(), point(), point(), point());
            let normal = (q - p).cross(r - p);
            let (from, to) = (normal.dot(a - p), normal.dot(b - p));
            let hit = a + (b - a) * (from / (from - to));
            let share = |s: DVec3, t: DVec3| (t - s).cross(hit - s).dot(normal) / normal.length_squared();
            let inside = [share(p, q), share(q, r), share(r, p)].iter().all(|&share| share > 0.0);
            let expected = from * to < 0.0 && inside;
            assert_eq!(meets([a, b], [p, q, r]), expected);
            seen[usize::from(expected)] += 1;
        }
        assert!(seen.iter().all(|&count| count > 100), "{seen:?}");
    }
}
