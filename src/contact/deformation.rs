//! The surface where it is now, for searches near a point: packets of triangles, placed anew when a search first comes to them.

use super::bounding_volumes::{Leaf, Volume};
use super::model::Model;
use super::packet::{LANES, Packet, greatest};
use super::wide::{Kernel, widest};
use crate::tolerances::LENGTH_ROUNDING;
use glam::DVec3;

/// The greatest of the squares of vectors, three numbers each, that is a number.
struct GreatestSquare<'v>(&'v [f64]);

impl Kernel for GreatestSquare<'_> {
    type Output = f64;

    #[inline(always)]
    fn run(self) -> f64 {
        let square = |[a, b, c]: [f64; 3]| a * a + b * b + c * c;
        let (eights, rest) = self.0.as_chunks().0.as_chunks::<LANES>();
        let mut most = [0.0; LANES];
        for eight in eights {
            for (most, vector) in most.iter_mut().zip(eight) {
                *most = greatest(square(*vector), *most);
            }
        }
        let rest = rest.iter().map(|vector| square(*vector));
        most.into_iter().chain(rest).fold(0.0, |most, square| greatest(square, most))
    }
}

/// A leaf's triangles where they are now.
#[derive(Clone)]
struct Place {
    /// The surface's number when they were placed.
    surface: u64,
    packet: Packet,
    /// Box around them.
    volume: Volume,
}

/// The surface, as displaced last.
pub struct Deformation {
    /// How many surfaces there have been.
    surface: u64,
    /// An upper bound of how far any point of the surface is from where it rests [m].
    pub moved: f64,
    places: Vec<Place>,
}

impl Deformation {
    /// For the surface of `model`.
    #[must_use]
    pub fn new(model: &Model) -> Self {
        let place = |leaf: &Leaf| Place { surface: 0, packet: Packet::default(), volume: leaf.volume };
        Self { surface: 0, moved: 0.0, places: model.bounds.leaves.iter().map(place).collect() }
    }

    /// Another surface, displaced by `displacement` [m].
    pub fn take(&mut self, displacement: &[f64]) {
        self.surface += 1;
        self.moved = widest(GreatestSquare(displacement)).sqrt() * (1.0 + LENGTH_ROUNDING);
    }

    /// Calls `visit` with each triangle of the surface, nodes now at `positions`, that is nearer to `x` than the squared radius that
    /// `visit` returned last; `radius_squared` is the first [m^2]. Some that are as near but for rounding may be among them.
    pub fn search(
        &mut self,
        model: &Model,
        positions: &[DVec3],
        x: DVec3,
        radius_squared: f64,
        mut visit: impl FnMut(u32) -> f64,
    ) {
        let slack = model.bounds.slack(x);
        let moved = self.moved;
        // Of boxes at rest.
        let widened = |bound: f64| (bound.sqrt() + moved).powi(2) + slack;
        let mut bound = radius_squared + slack;
        let mut limit = widened(bound);
        model.bounds.walk(x, limit, |leaf| {
            let place = self.place(model, positions, leaf);
            if place.volume.distance_squared(x) <= bound {
                let mut nearer = false;
                for (&triangle, square) in
                    model.bounds.leaves[leaf].triangles.iter().zip(place.packet.distances_squared(x))
                {
                    if square <= bound {
                        bound = visit(triangle) + slack;
                        nearer = true;
                    }
                }
                if nearer {
                    limit = widened(bound);
                }
            }
            limit
        });
    }

    /// Where the triangles of leaf `leaf` are.
    fn place(&mut self, model: &Model, positions: &[DVec3], leaf: usize) -> &Place {
        let place = &mut self.places[leaf];
        if place.surface != self.surface {
            place.surface = self.surface;
            place.packet.set(positions, &model.bounds.leaves[leaf].nodes);
            place.volume = Volume::new(place.packet.bounds());
        }
        place
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Wherever it stands, whatever is beside the last eight, and however many are no numbers.
    #[test]
    fn the_greatest_square_is_found() {
        for count in 0..20 {
            for place in 0..count {
                let mut vectors = vec![[0.1, -0.2, 0.2]; count];
                vectors[(place + 1) % count] = [f64::NAN, 9.0, 9.0];
                vectors[place] = [2.0, -3.0, 6.0];
                assert_eq!(GreatestSquare(vectors.as_flattened()).run(), 49.0, "{place} of {count}");
                assert_eq!(widest(GreatestSquare(vectors.as_flattened())), 49.0);
            }
        }
        assert_eq!(GreatestSquare(&[]).run(), 0.0);
    }
}
