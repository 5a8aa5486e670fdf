//! `[graphics]`: the graphics loop and its effects.

use super::super::check::Checker;
use super::super::error::SceneError;
use super::super::file::GraphicsTable;
use super::super::{GraphicsEffects, GraphicsSpec, Material, ObjectSpec, StiffeningSpec};

/// Lowest frame rate (Hz): motion is no longer seen long before.
const LOWEST_RATE: f64 = 1.0;
/// Highest frame rate (Hz).
const HIGHEST_RATE: f64 = 1e4;
/// Default frame rate (Hz).
const RATE: f64 = 60.0;

/// Greatest factor of stiffening: what the integrator takes beyond the springs' own energy grows with it.
const MOST_STIFFENING: f64 = 100.0;

/// `object`: the virtual object, which the effects act on, where the scene has one.
pub(super) fn convert(
    checker: &Checker<'_>,
    table: &GraphicsTable,
    object: Option<&ObjectSpec>,
) -> Result<GraphicsSpec, SceneError> {
    let rate = table.rate.as_ref().map(|value| checker.within("rate", value, LOWEST_RATE, HIGHEST_RATE));
    let quasi_static = table.quasi_static.as_ref().filter(|value| *value.get_ref());
    let named = [
        ("gravity", table.gravity.as_ref().map(|value| value.span())),
        ("stiffening", table.stiffening.as_ref().map(|value| value.span())),
        ("smoothing", table.smoothing.as_ref().map(|value| value.span())),
        ("quasi_static", quasi_static.map(|value| value.span())),
    ];
    for (key, span) in named {
        if let (Some(span), None) = (span, object) {
            let message = format!("{key} acts on the virtual object, and the scene has none: leave it out");
            return Err(checker.error(span, message));
        }
    }
    let gravity = table.gravity.as_ref().map(|value| checker.vector("gravity", Some(value))).transpose()?;
    if let (Some(value), Some(0.0)) = (&table.gravity, gravity.map(|g| g.length())) {
        return Err(
            checker.error(value.span(), "gravity is zero: give a direction and a size in m/s^2, or leave it out")
        );
    }
    let stiffening = table.stiffening.as_ref().map(|value| -> Result<_, SceneError> {
        if quasi_static.is_some() {
            let message = "stiffening cannot act where quasi_static graphics solves with one constant stiffness: leave \
                           out one of them";
            return Err(checker.error(value.span(), message));
        }
        if object.is_some_and(|object| matches!(object.material, Material::Elastic(_)) || object.skin.is_some()) {
            let message =
                "stiffening acts on springs alone, and the object is an elastic solid or has a skin: leave it out";
            return Err(checker.error(value.span(), message));
        }
        let stiffening = value.get_ref();
        Ok(StiffeningSpec {
            factor: checker.between("factor", &stiffening.factor, 1.0, MOST_STIFFENING)?,
            strain: checker.positive("strain", &stiffening.strain)?,
        })
    });
    let effects = GraphicsEffects {
        gravity,
        stiffening: stiffening.transpose()?,
        smoothing: table.smoothing.as_ref().map(|value| checker.positive("smoothing", value)).transpose()?,
        quasi_static: quasi_static.is_some(),
    };
    Ok(GraphicsSpec { rate: rate.unwrap_or(Ok(RATE))?, effects })
}
