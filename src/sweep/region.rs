//! The region of C-space in which a scene is solved: its grid, or the joint limits where it has none.

use crate::{
    Error, JointVector, MAX_AXES,
    contact::{Model, NodeTree},
    object::Object,
    proxy::Chain,
    random::Random,
    scene::{AxisSpec, Scene},
};
use rayon::prelude::*;

/// Configurations that are spread over a region at most (1): between them the proxy's reach grows by less than what is
/// added to it.
const SPREAD: usize = 1 << 16;

/// Configurations in contact by which a region is known (1): the outermost ones lie within some thousandths of the ends
/// of their range.
const TOUCHING: usize = 4096;

/// Random configurations of one round, and most rounds (1): contact of one in a hundred thousand is still seen.
const ROUND: usize = 1 << 15;
const ROUNDS: usize = 16;

/// Object and proxy of `scene` in contact within its region.
///
/// # Errors
/// As [`Model::reaching`].
pub fn model_within<'a>(scene: &Scene, object: &'a Object, chain: &'a Chain) -> Result<Model<'a>, Error> {
    sampled(scene, object, chain).map(|(model, _)| model)
}

/// The same, and the [configurations](sample) that stand for the region.
pub(super) fn sampled<'a>(
    scene: &Scene,
    object: &'a Object,
    chain: &'a Chain,
) -> Result<(Model<'a>, Vec<JointVector>), Error> {
    let mut model = Model::reaching(object, chain, scene.contact, &[])?;
    let configurations = sample(scene, &model);
    model.reach(&configurations)?;
    Ok((model, configurations))
}

/// Configurations that stand for the region of `scene`, whose `model` may know no compliance: spread over it, all points
/// of a grid that has few, and, where contact is rare among them, random ones in contact.
pub fn sample(scene: &Scene, model: &Model<'_>) -> Vec<JointVector> {
    let (mut configurations, is_all) = spread(scene);
    if is_all {
        return configurations;
    }
    let tree = NodeTree::new(model.chain);
    let touches = |q: &JointVector| !tree.is_apart(model, q);
    let mut touching = 0;
    for share in configurations.chunks(TOUCHING) {
        if touching < TOUCHING {
            touching += share.par_iter().filter(|q| touches(q)).count();
        }
    }
    let (ranges, mut random) = (ranges(scene), Random::new(1));
    for _ in 0..ROUNDS {
        if touching >= TOUCHING {
            break;
        }
        let drawn: Vec<JointVector> = (0..ROUND).map(|_| drawn(&mut random, ranges.iter().copied())).collect();
        let before = configurations.len();
        configurations.par_extend(drawn.into_par_iter().filter(touches));
        touching += configurations.len() - before;
    }
    configurations
}

/// A random configuration within `ranges`.
pub(super) fn drawn(random: &mut Random, ranges: impl Iterator<Item = [f64; 2]>) -> JointVector {
    ranges.map(|[low, high]| random.between(low, high)).collect()
}

/// The region's range of each joint (rad or m).
fn ranges(scene: &Scene) -> Vec<[f64; 2]> {
    match &scene.grid.axes[..] {
        [] => scene.proxy.joints.iter().map(|joint| joint.limits).collect(),
        axes => axes.iter().map(|axis| [axis.start, axis.start + axis.step * (axis.count - 1) as f64]).collect(),
    }
}

/// Configurations spread over the region, and whether they are all points of a grid. At random where the arm has more
/// joints than a grid has axes.
fn spread(scene: &Scene) -> (Vec<JointVector>, bool) {
    let ranges = ranges(scene);
    if ranges.len() > MAX_AXES {
        let mut random = Random::new(1);
        return ((0..SPREAD).map(|_| drawn(&mut random, ranges.iter().copied())).collect(), false);
    }
    let count = (SPREAD as f64).powf(1.0 / ranges.len().max(1) as f64) as usize;
    let limits =
        |[least, greatest]: [f64; 2]| AxisSpec { start: least, step: (greatest - least) / (count - 1) as f64, count };
    let axes = match &scene.grid.axes[..] {
        [] => ranges.into_iter().map(limits).collect(),
        axes => axes.to_vec(),
    };
    let points: usize = axes.iter().map(|axis| axis.count).fold(1, usize::saturating_mul);
    // The same stride along each axis, the last line always included.
    let stride = (1..).find(|stride| points / usize::pow(*stride, axes.len() as u32).max(1) <= SPREAD).unwrap_or(1);
    let mut configurations = vec![JointVector::zeros(axes.len())];
    for (j, axis) in axes.iter().enumerate() {
        let lines = (0..axis.count - 1).step_by(stride).chain([axis.count - 1]);
        let values: Vec<f64> = lines.map(|k| axis.start + k as f64 * axis.step).collect();
        let grown = configurations.iter().flat_map(|q| {
            values.iter().map(move |&value| {
                let mut q = *q;
                q[j] = value;
                q
            })
        });
        configurations = grown.collect();
    }
    (configurations, stride == 1 && !scene.grid.axes.is_empty())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sweep::build_object;

    /// Six joints with wide limits: of their poses more than one in a thousand touches the ball, and none of those that
    /// are spread over them.
    const RARE: &str = r#"
        [object]
        sphere = { radius = 0.05, edge = 0.02, centre = [0.35, 0.0, 0.2] }
        skin = { tension = 100.0, width = 0.05, foundation = 4e4 }
        [contact]
        stiffness = 200.0
        [[proxy.joint]]
        kind = "revolute"
        axis = [0, 0, 1]
        limits = [-2.9, 2.9]
        [[proxy.joint]]
        origin = [0, 0, 0.2]
        kind = "revolute"
        axis = [0, 1, 0]
        limits = [-1.5, 1.5]
        [[proxy.joint]]
        origin = [0.2, 0, 0]
        kind = "revolute"
        axis = [0, 1, 0]
        limits = [-2.5, 2.5]
        nodes = [{ at = [0.1, 0, 0], radius = 0.01 }]
        [[proxy.joint]]
        origin = [0.2, 0, 0]
        kind = "revolute"
        axis = [1, 0, 0]
        limits = [-2.9, 2.9]
        [[proxy.joint]]
        kind = "revolute"
        axis = [0, 1, 0]
        limits = [-1.8, 1.8]
        [[proxy.joint]]
        kind = "revolute"
        axis = [1, 0, 0]
        limits = [-2.9, 2.9]
        nodes = [{ at = [0.1, 0, 0.02], radius = 0.008 }]
    "#;

    #[test]
    fn rare_contact_is_found_where_no_spread_configuration_touches() {
        let scene = Scene::parse(RARE, "rare.toml").unwrap();
        let (object, chain) = (build_object(&scene).unwrap(), Chain::new(&scene.proxy));
        let model = Model::reaching(&object, &chain, scene.contact, &[]).unwrap();
        let tree = NodeTree::new(&chain);
        let touching = |all: &[JointVector]| all.iter().filter(|q| !tree.is_apart(&model, q)).count();
        assert_eq!(touching(&spread(&scene).0), 0);
        let all = sample(&scene, &model);
        let least = ROUNDS * ROUND / 1000;
        assert!(touching(&all) > least, "{} of {least}", touching(&all));
        let within = |q: &JointVector| q.iter().zip(ranges(&scene)).all(|(q, [low, high])| (low..=high).contains(q));
        assert!(all.iter().all(within));
        assert!(all == sample(&scene, &model), "the same every time");
    }
}
