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

use super::super::check::Checker;
use super::super::error::SceneError;
use super::super::file::{Number, SkinTable};
use super::super::{ElasticSpec, Material, SkinSpec};
use toml::Spanned;

/// Default Poisson's ratio of a skin: rubber and living tissue hardly change their volume, and a plate's formulas hold
/// up to 1/2.
const POISSON: f64 = 0.5;

/// Largest Poisson's ratio plus what lets a range without its ends include it.
const ABOVE_HALF: f64 = 0.5 + f64::EPSILON;

/// `material`: what the skin covers.
pub(super) fn convert(
    checker: &Checker<'_>,
    table: &Spanned<SkinTable>,
    material: &Material,
) -> Result<SkinSpec, SceneError> {
    let span = table.span();
    let table = table.get_ref();
    let positive =
        |key: &str, value: &Option<Number>| value.as_ref().map(|value| checker.positive(key, value)).transpose();
    let foundation = positive("foundation", &table.foundation)?.unwrap_or(0.0);
    let (tension, bending) = match (&table.thickness, &table.young) {
        (Some(thickness), Some(young)) => {
            let doubled = [("tension", &table.tension), ("bending", &table.bending), ("width", &table.width)];
            if let Some((key, Some(value))) = doubled.into_iter().find(|(_, value)| value.is_some()) {
                let message = format!("{key} follows from thickness and young already: leave out one or the other");
                return Err(checker.error(value.span(), message));
            }
            let (t, e) = (checker.positive("thickness", thickness)?, checker.positive("young", young)?);
            let poisson = table.poisson.as_ref().map(|value| checker.between("poisson", value, -1.0, ABOVE_HALF));
            let nu = poisson.unwrap_or(Ok(POISSON))?;
            (e * t / (2.0 * (1.0 + nu)), e * t.powi(3) / (12.0 * (1.0 - nu * nu)))
        }
        (None, None) => {
            if let Some(poisson) = &table.poisson {
                return Err(
                    checker.error(poisson.span(), "poisson goes with thickness and young: add them, or leave it out")
                );
            }
            let tension = positive("tension", &table.tension)?.unwrap_or(0.0);
            let bending = match (positive("bending", &table.bending)?, &table.width) {
                (Some(bending), None) => bending,
                (None, None) => 0.0,
                (None, Some(width)) => bending_by_width(checker, width, tension, foundation, material)?,
                (Some(_), Some(width)) => {
                    return Err(checker.error(width.span(), "bending and width say the same: leave out one of them"));
                }
            };
            (tension, bending)
        }
        (Some(value), None) | (None, Some(value)) => {
            return Err(checker.error(value.span(), "thickness and young go together: give both"));
        }
    };
    if tension + bending + foundation == 0.0 {
        let message = "the skin resists nothing: give bending or width, thickness with young, tension, or foundation";
        return Err(checker.error(span, message));
    }
    Ok(SkinSpec { tension, bending, foundation })
}

/// Bending stiffness of a skin that rounds dents over `width` (N m).
fn bending_by_width(
    checker: &Checker<'_>,
    width: &Number,
    tension: f64,
    foundation: f64,
    material: &Material,
) -> Result<f64, SceneError> {
    let w = checker.positive("width", width)?;
    match material {
        _ if tension > 0.0 => Ok(tension * w.powi(2)),
        Material::Elastic(ElasticSpec { young, poisson, .. }) => {
            Ok(*young / (2.0 * (1.0 - *poisson * *poisson)) * w.powi(3))
        }
        Material::Hollow if foundation > 0.0 => Ok(foundation * w.powi(4)),
        Material::Hollow | Material::Springs(_) => {
            let message = "width says how far a dent spreads against a tension, an elastic solid or a foundation: give \
                           tension, or bending instead of width";
            Err(checker.error(width.span(), message))
        }
    }
}
