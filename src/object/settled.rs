//! Where an object comes to rest under constant loads.

use super::{Factor, Mechanics, Stiffening};
use crate::Error;
use glam::DVec3;

/// Last step of an equilibrium of stiffening springs over its displacement (1): a pixel is a thousandth of a
/// picture.
const SETTLED: f64 = 1e-9;

/// Steps after which an equilibrium of stiffening springs is as good as it gets: each leaves at most 1 - 1/kappa of the
/// error, and kappa is at most 100.
const STEPS: usize = 5000;

/// Displacements at which the springs in `mechanics` carry `loads`, one per node (N); springs stiffen as `stiffening`
/// says. For these the energy is lowered by steps u += K1^-1 (loads - grad W(u)), each of which cannot fail to lower
/// it.
///
/// # Errors
/// When there is no memory for the factor of K1.
pub fn settled(mechanics: &Mechanics, loads: &[DVec3], stiffening: Option<&Stiffening>) -> Result<Vec<DVec3>, Error> {
    let mut displacement = loads.to_vec();
    mechanics.factor.solve(&mut displacement);
    let Some(stiffening) = stiffening else { return Ok(displacement) };
    let factor = Factor::of(stiffening.bound(), 1.0, &vec![0.0; loads.len()])?;
    let size = |vectors: &[DVec3]| vectors.iter().map(|v| v.length_squared()).sum::<f64>().sqrt();
    let mut step = displacement.clone();
    for _ in 0..STEPS {
        stiffening.bound().apply(&displacement, &mut step);
        for (step, load) in step.iter_mut().zip(loads) {
            *step = *load - *step;
        }
        stiffening.relieve(&displacement, &mut step);
        factor.solve(&mut step);
        displacement.iter_mut().zip(&step).for_each(|(u, step)| *u += *step);
        // False for what is not a number.
        if size(&step) <= SETTLED * size(&displacement) {
            break;
        }
    }
    Ok(displacement)
}
