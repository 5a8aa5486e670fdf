//! The rest of a force that touching contact springs leave: the preconditioner of a Newton step.
//!
//! Stiff springs are what conjugate gradients take longest for. With g_a the gradient of the depth of spring a, W the
//! stiffness of the springs and the object stiffened by 1 + mu, Woodbury's identity
//! `P = ((1 + mu) K + G^T W G)^-1 = (C - C G^T ((1 + mu) W^-1 + G C G^T)^-1 G C) / (1 + mu)` takes them out, at the
//! price of a dense system with as many unknowns as springs touch. What is left to the iterations is how contacts bend.
//! P r is kept twice like all directions: as the force (r - G^T y) / (1 + mu), y being the push of the springs, and as
//! the displacement C of it.

use crate::contact::law::springs::Springs;
use crate::contact::linear::cholesky;
use crate::contact::linear::rows::add_rows;
use crate::contact::linear::support::Support;

/// Springs of a block for [`add_rows`].
const BLOCK_SIZE: usize = 3;

/// The preconditioner for the springs that touch; its vectors are reused.
#[derive(Default)]
pub struct Woodbury {
    /// Places of the touching rows in the list of contacts.
    taken: Vec<usize>,
    /// C g_a on the support for each of them, filled up with zeros to whole blocks (m/N).
    columns: Vec<f64>,
    /// The one of them at hand, as [`Support::respond_along`] has it (m/N).
    response: Vec<f64>,
    order: usize,
    /// 1 + mu (1).
    stiffening: f64,
    /// That of (1 + mu) W^-1 + G C G^T; see [`crate::contact::linear::cholesky`].
    factor: Vec<f64>,
    /// y, filled up with zeros (N).
    pushes: Vec<f64>,
}

impl Woodbury {
    /// Takes up the springs for which `touching` is true, on an object stiffened by the factor `stiffening`.
    pub fn set_up(&mut self, support: &Support, springs: Springs, touching: &[bool], stiffening: f64) {
        let Self { taken, columns, response, order, factor, pushes, .. } = self;
        taken.clear();
        taken.extend((0..touching.len()).filter(|&row| touching[row]));
        let count = taken.len();
        self.stiffening = stiffening;
        *order = support.order();
        pushes.clear();
        pushes.resize(count.next_multiple_of(BLOCK_SIZE), 0.0);
        columns.clear();
        columns.resize(pushes.len() * *order, 0.0);
        response.resize(support.response_width() * support.nodes().len(), 0.0);
        factor.resize(count * count, 0.0);
        for (a, &row) in taken.iter().enumerate() {
            let column = &mut columns[a * *order..][..*order];
            let contact = &springs.contacts[row];
            let deepened = &mut factor[a * count..][..=a];
            springs.respond(support, (row, taken[..=a].iter().copied()), response, deepened);
            support.add_response(contact.normal, response, 1.0, column);
            factor[a * count + a] += stiffening / (springs.kc * contact.share);
        }
        cholesky::factorize(factor, count);
    }

    /// P r as `force` and `displacement`, from r and C r.
    pub fn apply(
        &mut self,
        springs: Springs,
        (residual, product): (&[f64], &[f64]),
        force: &mut [f64],
        displacement: &mut [f64],
    ) {
        force.copy_from_slice(residual);
        displacement.copy_from_slice(product);
        let Self { taken, columns, order, stiffening, factor, pushes, .. } = self;
        let count = taken.len();
        for (push, &row) in pushes.iter_mut().zip(&*taken) {
            *push = -springs.depth_change(row, product);
        }
        cholesky::solve(factor, pushes[..count].as_chunks_mut::<1>().0);
        for (&row, &push) in taken.iter().zip(&*pushes) {
            springs.add_reaction(row, &springs.contacts[row].spread(push), force);
        }
        let blocks = columns.chunks_exact((BLOCK_SIZE * *order).max(1));
        add_rows(blocks.zip(pushes.as_chunks::<BLOCK_SIZE>().0.iter().copied()), displacement);
        if *stiffening > 1.0 {
            force.iter_mut().chain(displacement).for_each(|entry| *entry /= *stiffening);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::contact::law::springs::samples::{ball, off, sample};
    use crate::random::sequence;
    use crate::scene::SpringKind;

    /// Applying object and springs to the result of the inverse gives the input.
    #[test]
    fn woodbury_is_the_inverse_of_object_and_springs() {
        for kind in [SpringKind::Isotropic, SpringKind::Axial] {
            let object = ball(kind);
            for (kc, stiffening) in [(1.0, 1.0), (1e3, 3.0), (1e6, 1.0), (1e6, 1e3)] {
                let sample = sample(&object, kc, 0.0);
                assert_eq!(sample.touching().iter().filter(|&&touches| touches).count(), 7);
                let order = sample.support().order();
                let mut next = sequence(3);
                let residual: Vec<f64> = (0..order).map(|_| next()).collect();
                let mut product = vec![0.0; order];
                sample.support().multiply(&residual, &mut product);
                let (mut force, mut displacement) = (vec![0.0; order], vec![0.0; order]);
                let mut woodbury = Woodbury::default();
                woodbury.set_up(sample.support(), sample.springs(), &sample.touching(), stiffening);
                woodbury.apply(sample.springs(), (&residual, &product), &mut force, &mut displacement);
                sample.support().multiply(&force, &mut product);
                let size = displacement.iter().fold(0.0_f64, |size, entry| size.max(entry.abs()));
                assert!(off(&displacement, &product) < 1e-12 * size, "{kc} {stiffening}");
                // Rounding of a spring's depth_change, of about 1e-2 m, times kc.
                let rounding = 1e-13 * kc.max(1.0);
                assert!(off(&sample.resist(stiffening, &force), &residual) < rounding, "{kc} {stiffening}");
                assert!(off(&sample.resist(1.01 * stiffening, &force), &residual) > rounding);
            }
        }
    }
}
