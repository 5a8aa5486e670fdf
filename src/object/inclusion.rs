//! Parts of an elastic solid with a stiffness of their own: a nodule in tissue.
//!
//! A region of a mesh has one material in each element. A sphere cuts elements. Where it is softer than the body, each
//! point of quadrature has the material that is there. Where it is stiffer, that overrates it, since strain gathers in
//! the soft part: then each part of an element, an eighth of a cube or a tetrahedron, has the harmonic mean of shear
//! and bulk modulus over it, as layers in series have (Reuss 1929).
//!
//! Strain jumps at the sphere, and cannot within an element: stiffness errs by a share of the cut elements' volume, of
//! the first order in their size. So cubes that a sphere cuts are small beside it: some 1 % of its effect is lost then
//! (measured against meshes that fit: `docs/nodule.md`).

use super::element::Lame;
use crate::{
    Error, error,
    scene::{ElasticSpec, InclusionPlace, InclusionSpec},
};
use glam::DVec3;
use std::sync::atomic::{AtomicBool, Ordering};

/// Largest cubes that a sphere within the body may cut, in its radii (1).
const LARGEST_CUT: f64 = 0.5;

/// The same where it comes to the surface: contact then feels the sphere alone.
const LARGEST_CUT_AT_SURFACE: f64 = 0.25;

/// The materials of a solid.
pub(super) struct Materials<'a> {
    elastic: &'a ElasticSpec,
    /// Of the body, then of each inclusion.
    lame: Vec<Lame>,
    /// Largest cubes that each inclusion may cut (m).
    largest: Vec<f64>,
    /// Whether a point has each inclusion's material.
    found: Vec<AtomicBool>,
}

impl<'a> Materials<'a> {
    /// Those of a body whose surface has its nodes at `shell` (m).
    pub fn new(elastic: &'a ElasticSpec, shell: &[DVec3]) -> Self {
        let largest = elastic.inclusions.iter().map(|inclusion| match inclusion.place {
            InclusionPlace::Sphere { centre, radius } if shell.iter().any(|x| x.distance(centre) < radius) => {
                LARGEST_CUT_AT_SURFACE * radius
            }
            InclusionPlace::Sphere { radius, .. } => LARGEST_CUT * radius,
            InclusionPlace::Region(_) => f64::INFINITY,
        });
        let largest = largest.collect();
        let inclusions = elastic.inclusions.iter().map(|inclusion| Lame::new(inclusion.young, inclusion.poisson));
        let lame: Vec<Lame> = [Lame::new(elastic.young, elastic.poisson)].into_iter().chain(inclusions).collect();
        Self { elastic, found: lame.iter().map(|_| AtomicBool::new(false)).collect(), lame, largest }
    }

    /// The material outside all inclusions.
    pub fn body(&self) -> Lame {
        self.lame[0]
    }

    /// Number of the material at `place` (m) in the physical volume `region`: zero outside all inclusions, else that of
    /// the last one that holds it.
    pub fn number(&self, place: DVec3, region: Option<u32>) -> usize {
        let inside = self.elastic.inclusions.iter().rposition(|inclusion| match inclusion.place {
            InclusionPlace::Sphere { centre, radius } => place.distance_squared(centre) < radius * radius,
            InclusionPlace::Region(wanted) => region == Some(wanted),
        });
        inside.map_or(0, |number| number + 1)
    }

    /// The material there; its inclusion holds a part of the solid.
    pub fn at(&self, place: DVec3, region: Option<u32>) -> Lame {
        let number = self.number(place, region);
        self.found[number].store(true, Ordering::Relaxed);
        self.lame[number]
    }

    /// Largest cubes that some inclusion may cut (m).
    pub fn largest_cut(&self) -> f64 {
        self.largest.iter().copied().fold(f64::INFINITY, f64::min)
    }

    /// Largest size that the spheres which cut the box between two corners (m) leave to it; none where no sphere does.
    pub fn cut(&self, [low, high]: [DVec3; 2]) -> Option<f64> {
        let cuts = |inclusion: &InclusionSpec| match inclusion.place {
            InclusionPlace::Sphere { centre, radius } => {
                let nearest = centre.clamp(low, high).distance(centre);
                let farthest = (centre - low).abs().max((high - centre).abs()).length();
                nearest < radius && radius < farthest
            }
            InclusionPlace::Region(_) => false,
        };
        let sizes = self.elastic.inclusions.iter().zip(&self.largest);
        sizes.filter(|(inclusion, _)| cuts(inclusion)).map(|(_, size)| *size).reduce(f64::min)
    }

    /// The harmonic mean over `points` (m), each of a weight, if a sphere in which some of them lie is stiffer than the
    /// body.
    pub fn stiff_mean(&self, points: impl Iterator<Item = (DVec3, f64)>, region: Option<u32>) -> Option<Lame> {
        let (mut sum, mut stiff, mut compliance) = (0.0, false, [0.0; 2]);
        for (place, weight) in points {
            let lame = self.lame[self.number(place, region)];
            stiff |= lame.mu > self.lame[0].mu;
            compliance = [compliance[0] + weight / lame.mu, compliance[1] + weight / lame.bulk()];
            sum += weight;
        }
        let [mu, bulk] = compliance.map(|compliance| sum / compliance);
        stiff.then_some(Lame { lambda: bulk - 2.0 / 3.0 * mu, mu })
    }

    /// Refuses inclusions that hold no part of the solid.
    ///
    /// # Errors
    /// Names the first one.
    pub fn check(&self) -> Result<(), Error> {
        let mut found = self.elastic.inclusions.iter().zip(&self.found[1..]).enumerate();
        match found.find(|(_, (_, found))| !found.load(Ordering::Relaxed)) {
            Some((number, (inclusion, _))) => Err(error!(
                "no part of the solid is in the inclusion ({inclusion}), or a later one covers it: correct its place or the \
                 order, or remove it"
            )
            .about(format!("object.elasticity.inclusion.{number}"))),
            None => Ok(()),
        }
    }
}
