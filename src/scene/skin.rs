//! `[object.skin]`: from what a person knows of a skin to its tension, bending stiffness and foundation.
//!
//! Tension and bending stiffness may be given as such, or by the thickness t, Young's modulus E and Poisson's ratio nu
//! of the skin. A plate then has b = E t^3 / (12 (1 - nu^2)) (Timoshenko & Woinowsky-Krieger, Theory of Plates and
//! Shells, 1959, section 2). Its membrane has two moduli, and an isotropic skin, which treats the three coordinates
//! alike, has one number for them: the shear modulus T = E t / (2 (1 + nu)), the smaller of the two, which is exact in
//! shear.
//!
//! Bending stiffness may be given by the width w over which the dent of a point is rounded instead: b = T w^2 beside a
//! tension, b = E w^3 / (2 (1 - nu^2)) on an elastic solid, b = k w^4 on a foundation. A ripple of wave number 1 / w is
//! then resisted as much by the skin's bending, b / w^4, as by what is below it: T / w^2, E / (2 (1 - nu^2) w)
//! (Johnson, Contact Mechanics, 1985, section 13.2) or k.

use super::check::Checker;
use super::value::{Range, positive};
use super::{ElasticSpec, Material};
use crate::Error;
use serde::{Deserialize, Deserializer};

/// Default Poisson's ratio of a skin: rubber and living tissue hardly change their volume, and a plate's formulas hold
/// up to 1/2.
const POISSON: f64 = 0.5;

/// A skin on the surface, per area: the same body on every mesh. At least one of the three is positive, none is
/// negative.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SkinSpec {
    /// Membrane tension T: resists a gradient of the displacement, in all directions alike (N/m).
    pub tension: f64,
    /// Bending stiffness b: resists a Laplacian of the displacement (N m).
    pub bending: f64,
    /// Foundation k: resists displacement (N/m^3).
    pub foundation: f64,
}

/// `[object.skin]` as it is written.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct SkinTable {
    #[serde(default, deserialize_with = "positive")]
    tension: Option<f64>,
    #[serde(default, deserialize_with = "positive")]
    bending: Option<f64>,
    #[serde(default, deserialize_with = "positive")]
    width: Option<f64>,
    #[serde(default, deserialize_with = "positive")]
    thickness: Option<f64>,
    #[serde(default, deserialize_with = "positive")]
    young: Option<f64>,
    #[serde(default, deserialize_with = "up_to_half")]
    poisson: Option<f64>,
    #[serde(default, deserialize_with = "positive")]
    foundation: Option<f64>,
}

/// Reads a Poisson's ratio, 1/2 included.
fn up_to_half<'de, D: Deserializer<'de>>(value: D) -> Result<Option<f64>, D::Error> {
    Range::Between(-1.0, 0.5 + f64::EPSILON).number(value)
}

impl SkinTable {
    /// The skin on `material`.
    pub fn check(self, checker: &Checker<'_>, material: &Material) -> Result<SkinSpec, Error> {
        let at = |key: &str, message: &str| Err(checker.at(&format!("object.skin.{key}"), message));
        let foundation = self.foundation.unwrap_or(0.0);
        let (tension, bending) = match (self.thickness, self.young) {
            (Some(t), Some(e)) => {
                let doubled = [("tension", self.tension), ("bending", self.bending), ("width", self.width)];
                if let Some((key, _)) = doubled.into_iter().find(|(_, value)| value.is_some()) {
                    let message = "follows from thickness and young already: leave out one or the other";
                    return at(key, &format!("{key} {message}"));
                }
                let nu = self.poisson.unwrap_or(POISSON);
                (e * t / (2.0 * (1.0 + nu)), e * t.powi(3) / (12.0 * (1.0 - nu * nu)))
            }
            (None, None) => {
                if self.poisson.is_some() {
                    return at("poisson", "poisson goes with thickness and young: add them, or leave it out");
                }
                let tension = self.tension.unwrap_or(0.0);
                let bending = match (self.bending, self.width) {
                    (bending, None) => bending.unwrap_or(0.0),
                    (None, Some(width)) => match bending_by_width(width, tension, foundation, material) {
                        Some(bending) => bending,
                        None => {
                            let message = "width says how far a dent spreads against a tension, an elastic solid or a \
                                           foundation: give tension, or bending instead of width";
                            return at("width", message);
                        }
                    },
                    (Some(_), Some(_)) => {
                        return at("width", "bending and width say the same: leave out one of them");
                    }
                };
                (tension, bending)
            }
            (thickness, _) => {
                let key = if thickness.is_some() { "thickness" } else { "young" };
                return at(key, "thickness and young go together: give both");
            }
        };
        if tension + bending + foundation == 0.0 {
            let message =
                "the skin resists nothing: give bending or width, thickness with young, tension, or foundation";
            return Err(checker.at("object.skin", message));
        }
        Ok(SkinSpec { tension, bending, foundation })
    }
}

/// Bending stiffness of a skin that rounds dents over the width `w` (N m), where there is something to dent.
fn bending_by_width(w: f64, tension: f64, foundation: f64, material: &Material) -> Option<f64> {
    match material {
        _ if tension > 0.0 => Some(tension * w.powi(2)),
        Material::Elastic(ElasticSpec { young, poisson, .. }) => {
            Some(*young / (2.0 * (1.0 - *poisson * *poisson)) * w.powi(3))
        }
        Material::Hollow if foundation > 0.0 => Some(foundation * w.powi(4)),
        Material::Hollow | Material::Springs(_) => None,
    }
}
