//! Tells where the arm pushes through a part of the object within a cell that a dataset interpolates.

use crate::{
    JointVector,
    contact::{Model, PastMiddle, Proximity, Status},
    names::counted,
    random::Random,
    store::{Place, Store, beyond},
};
use rayon::prelude::*;

/// Configurations in cells of a store that are looked at (1): a part that is passed in a twentieth of the cells is
/// passed at more than [`LEAST_SHARE`] of these in all but one case of four hundred.
const LOOKED_AT: usize = 200;

/// Share of them that has to pass a middle for it to be told (1): of the 64 corners of a cell of six joints one may lie
/// far behind the surface of a part that the arm never gets through. The plates of the tests are passed in a fifth of
/// the cells, or more.
const LEAST_SHARE: f64 = 0.01;

/// Seed of these configurations.
const SEED: u64 = 0xbf58_476d_1ce4_e5b9;

/// Returns what to tell where the arm gets past the middle of a part of the object between one of `places` and the
/// corners of its cell, a sentence without its full stop. None where that is at no more than `share` of them.
pub(super) fn notice(
    model: &Model<'_>,
    share: f64,
    places: impl IndexedParallelIterator<Item = (JointVector, Vec<JointVector>)>,
) -> Option<String> {
    let count = places.len();
    let looked = places
        .map_init(|| Proximity::new(model), |proximity, (q, corners)| Some((proximity.past_middle(&q, corners)?, q)));
    let passed: Vec<(PastMiddle, JointVector)> = looked.flatten().collect();
    if passed.len() as f64 <= share * count as f64 {
        return None;
    }
    let consequence = thinnest(&passed)?;
    Some(format!(
        "near {} of {} in contact the arm {consequence}: shorten the ranges of the joints, or \
         make the part thicker",
        passed.len(),
        counted(count, ["random configuration", "random configurations"])
    ))
}

/// Words of a notice by which a dataset tells it.
const PASSES: &str = "passes the middle of a part of the object";

/// Returns what the `notices` of a dataset tell of thin parts.
#[must_use]
pub fn told(notices: &[String]) -> Option<String> {
    notices.iter().find(|notice| notice.contains(PASSES)).cloned()
}

/// Says of which part the middle is passed, and what becomes of the torque there; none where no part is.
fn thinnest(passed: &[(PastMiddle, JointVector)]) -> Option<String> {
    let (thinnest, q) = passed.iter().min_by(|(a, _), (b, _)| a.thickness.total_cmp(&b.thickness))?;
    Some(format!(
        "{PASSES}, {:.1} mm thick at its thinnest, at q = [{}]: contact is with the \
         closest surface, so the torque changes its sign in the middle and is zero beyond the part",
        1e3 * thinnest.thickness,
        q.iter().map(|q| format!("{q:.4}")).collect::<Vec<_>>().join(", ")
    ))
}

/// Steps of a path that are looked at (1): some tenths of a second, which a session that ends by a signal has. Those of
/// a longer path are longer.
const STEPS: usize = 20_000;

/// As [`notice`], of an arm that moved along `path` in small steps, with the configurations that are in contact.
#[must_use]
pub fn on_path(model: &Model<'_>, path: &[(JointVector, bool)]) -> Option<String> {
    let path: Vec<_> = path.iter().step_by(path.len().div_ceil(STEPS).max(1)).collect();
    let steps = path.par_windows(2).filter(|step| step.iter().any(|place| place.1));
    let looked = steps.map_init(
        || Proximity::new(model),
        |proximity, step| Some((proximity.past_middle(&step[0].0, [step[1].0])?, step[1].0)),
    );
    let consequence = thinnest(&looked.flatten().collect::<Vec<_>>())?;
    Some(format!("the arm {consequence}: press less deep, or make the part thicker"))
}

/// As [`notice`], for random configurations in the finest cells of `store` that have a corner in contact.
#[must_use]
pub fn of_store(model: &Model<'_>, store: &Store) -> Option<String> {
    let (space, mut random) = (store.space(), Random::new(SEED));
    let touching = store.nodes().filter(|node| node.status == Status::Contact as u8);
    let mut touching: Vec<(u32, Place)> = touching.map(|node| (node.level, node.place)).collect();
    let level = touching.iter().map(|(level, _)| *level).max()?;
    touching.retain(|(at, _)| *at == level);
    let last = space.last(level);
    let draw = |k: usize| {
        let (_, node) = touching[k * touching.len() / LOOKED_AT];
        let low: Place = std::array::from_fn(|a| {
            // One of the two cells on either side, where there are both.
            let beneath = u32::from(random.between(0.0, 1.0) < 0.5);
            node[a].saturating_sub(beneath).min(last[a].saturating_sub(1))
        });
        let mut q = space.configuration(level, &low);
        q.iter_mut().enumerate().for_each(|(a, q)| *q += random.between(0.0, 1.0) * space.step(level, a));
        let corners = (0..1_usize << space.joints()).map(|set| space.configuration(level, &beyond(&low, set)));
        (q, corners.collect())
    };
    let places: Vec<_> = (0..LOOKED_AT).map(draw).collect();
    notice(model, LEAST_SHARE, places.into_par_iter())
}
