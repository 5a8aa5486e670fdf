//! Nothing that touches is skipped, whatever the chain and wherever the slabs are cut.

use super::*;
use crate::object::Object;
use crate::random::Random;
use crate::scene::Scene as SceneFile;
use std::fmt::Write;

/// A random chain of one to four joints of either kind, somewhere about a sphere, over a grid of some thousand points.
fn random_scene(seed: u64) -> String {
    let mut random = Random::new(seed);
    let mut next = || random.between(0.0, 1.0);
    let joints = 1 + seed as usize % 4;
    let count = [2000, 60, 16, 8][joints - 1];
    let mut axes = String::new();
    let mut text = String::new();
    for _ in 0..joints {
        let mut vector = |size: f64| [0; 3].map(|_| size * (2.0 * next() - 1.0));
        let (origin, axis, tip) = (vector(0.12), vector(1.0), vector(0.12));
        let revolute = next() < 0.7;
        let (kind, width) =
            if revolute { ("revolute", 0.4 + 2.0 * next()) } else { ("prismatic", 0.02 + 0.2 * next()) };
        let start = -width * next();
        writeln!(
            text,
            "[[proxy.joint]]\nkind = \"{kind}\"\norigin = {origin:?}\naxis = {axis:?}\nlimits = [-9.0, 9.0]\n\
             nodes = [{{ from = [0.0, 0.0, 0.0], to = {tip:?}, count = 3, radius = {} }}]",
            0.01 * next()
        )
        .unwrap();
        write!(axes, "{{ start = {start}, stop = {}, count = {count} }},", start + width).unwrap();
    }
    format!(
        "[object]\nsphere = {{ radius = 0.05, rings = 6, segments = 7, centre = [0.1, 0.1, 0.0] }}\n\
         springs = {{ kind = \"isotropic\", stiffness = 300.0 }}\nground = {{ stiffness = 100.0 }}\n\
         [contact]\nstiffness = 1000.0\n[grid]\naxes = [{axes}]\n{text}"
    )
}

fn with_model<T>(text: &str, look: impl FnOnce(&Model<'_>, &Grid) -> T) -> T {
    let scene = SceneFile::parse(text, "random.toml").unwrap_or_else(|error| panic!("{error}"));
    let object = Object::build(&scene.object).unwrap();
    let chain = Chain::new(&scene.proxy);
    let sweep = crate::sweep::Sweep::new(&scene, &object, "cpu", "", "").unwrap();
    look(&Model::new(&object, &chain, scene.contact), sweep.grid())
}

#[test]
fn slabs_follow_each_other_and_are_blocks() {
    let mut cut = 0;
    for seed in 0..8 {
        with_model(&random_scene(seed), |model, grid| {
            for most in [1, 7, 16, 100, 600, 5000] {
                let free_space = FreeSpace { most, ..FreeSpace::new(model, grid) };
                let mut next = 0;
                while next < grid.points() {
                    let slab = free_space.slab(next);
                    assert!(slab.start == next && !slab.is_empty() && slab.len() <= most);
                    assert_eq!(Block::of(grid, &slab).unwrap().points(), slab.len());
                    assert_eq!(free_space.slab(slab.end - 1), slab);
                    next = slab.end;
                    cut += usize::from(slab.len() < grid.points());
                }
                assert_eq!(next, grid.points());
            }
            let lines = grid.axes[grid.joints() - 1].count;
            assert!(grid.joints() == 1 || Block::of(grid, &(0..lines + 1)).is_none());
        });
    }
    assert!(cut > 1000);
}

/// Against the gap of every point: what is skipped is free, and stays so [`FreeSpace::MARGIN`] steps all round; what is
/// stored is a lower bound.
#[test]
fn no_contact_is_missed_and_gaps_near_contact_are_left_to_the_solver() {
    let (mut skipped, mut points, mut touching, mut foretold) = (0, 0, 0, 0);
    for seed in 0..40 {
        with_model(&random_scene(seed), |model, grid| {
            // Every other scene slab by slab.
            let most = if seed % 2 == 0 { grid.points() } else { 600 };
            let free_space = FreeSpace { most, ..FreeSpace::new(model, grid) };
            let mut slabs: Vec<FreeGaps> = Vec::new();
            for point in 0..grid.points() {
                if slabs.last().is_none_or(|slab| slab.first + slab.bounds.len() <= point) {
                    slabs.push(free_space.find(free_space.slab(point)).unwrap());
                }
            }
            let gap_at = |point: usize| slabs.iter().find_map(|slab| slab.gap(point));
            let mut proximity = Proximity::new(model);
            let counts = grid.counts();
            let margin = FreeSpace::MARGIN as isize;
            for point in 0..grid.points() {
                let gap = proximity.gap(&grid.configuration(point));
                points += 1;
                let is_surrounded = free_space.is_surrounded(&mut proximity, point);
                assert!(gap > 0.0 || !is_surrounded, "seed {seed}, point {point}: {gap}");
                foretold += usize::from(is_surrounded == gap_at(point).is_some());
                match gap_at(point) {
                    Some(bound) => {
                        assert!(0.0 < bound && f64::from(bound) <= gap, "seed {seed}, point {point}: {bound} {gap}");
                        skipped += 1;
                    }
                    None if gap < 0.0 => {
                        touching += 1;
                        let index = grid.lines(point).map(|line| line as isize);
                        for shift in 0..5_isize.pow(counts.len() as u32) {
                            let (mut rest, mut neighbour, mut inside) = (shift, 0, true);
                            for (j, &count) in counts.iter().enumerate() {
                                let line = index[j] + rest % 5 - margin;
                                rest /= 5;
                                inside &= (0..count as isize).contains(&line);
                                neighbour = neighbour * count as isize + line;
                            }
                            assert!(!inside || gap_at(neighbour as usize).is_none(), "seed {seed}");
                        }
                    }
                    None => {}
                }
            }
        });
    }
    // What is skipped depends on how blocks are cut, which a point's surroundings do not know.
    assert!(10 * foretold > 9 * points, "of {points} points {foretold} are skipped as their surroundings say");
    assert!(skipped > points / 10 && touching > points / 50, "{skipped} skipped, {touching} touch of {points}");
}

/// In random steps away from random configurations, and the bound is not idle: some steps nearly reach it.
#[test]
fn slopes_bound_the_motion_of_every_node() {
    let mut sharpest = 0.0_f64;
    for seed in 0..40 {
        with_model(&random_scene(seed), |model, grid| {
            let free_space = FreeSpace::new(model, grid);
            let mut random = Random::new(seed + 100);
            let mut next = || random.between(0.0, 1.0);
            let mut proximity = Proximity::new(model);
            let joints = grid.joints();
            for _ in 0..50 {
                let (mut centre, mut wide, mut q) =
                    (JointVector::zeros(joints), JointVector::zeros(joints), JointVector::zeros(joints));
                for (j, axis) in grid.axes.iter().enumerate() {
                    let size = axis.step * axis.count as f64;
                    centre[j] = axis.start + size * next();
                    wide[j] = 0.2 * size * next();
                    q[j] = centre[j] + wide[j] * (2.0 * next() - 1.0);
                }
                proximity.gap(&q);
                let there = proximity.pose().nodes.clone();
                proximity.gap(&centre);
                for (node, there) in there.iter().enumerate() {
                    let moved = there.distance(proximity.pose().nodes[node]);
                    let bound: f64 = (0..=model.chain.nodes[node].link)
                        .map(|j| free_space.slope(&proximity, node, j, &wide) * (q[j] - centre[j]).abs())
                        .sum();
                    assert!(moved <= bound * (1.0 + 1e-12) + 1e-15, "seed {seed}: {moved} {bound}");
                    sharpest = sharpest.max(moved / bound.max(1e-9));
                }
            }
        });
    }
    assert!(sharpest > 0.9, "the bound is nearly reached: {sharpest}");
}
