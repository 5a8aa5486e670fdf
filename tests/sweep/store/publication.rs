//! What may be published, in what order, and that order does not matter.

use super::fixture::{blocks, nodes, noise, space, store};
use crate::fixture::peak;
use haptize::{
    Error, MAX_AXES,
    contact::Status,
    dataset::{Axis, Grid},
    store::{Nodes, Place, Space, Store, record::width},
};

#[test]
fn a_look_up_allocates_nothing() {
    for joints in [2, 3, 5] {
        let store = store(joints, 3, 0.6, 1, noise(joints, 1));
        let mut found = 0;
        for k in 0..1000 {
            let mut q = [0.0; 5];
            q.iter_mut().enumerate().for_each(|(a, q)| *q = 0.25 * (0.3 * f64::from(k) + a as f64).sin());
            let (sample, held) = peak(|| store.sample(&q[..joints]));
            assert_eq!(held, 0, "bytes");
            found += u32::from(!sample.absent);
        }
        assert!(found > 100, "{found}");
    }
}

#[test]
fn the_same_blocks_in_another_order_make_the_same_store_to_the_bit() {
    for joints in [1, 3, 5] {
        let one = store(joints, 2, 0.7, 3, noise(joints, 5));
        let mut all = one.blocks();
        // Level by level, backwards.
        all.reverse();
        all.sort_by_key(|(key, _)| one.space().block(*key).unwrap().0);
        let mut other = Store::new(one.space().clone());
        for (key, block) in all {
            let (level, place) = one.space().block(key).unwrap();
            other.publish(level, &place, block.nodes().clone()).unwrap();
        }
        let mut q = one.space().configuration(0, &[0; MAX_AXES]);
        for k in 0..100 {
            q.iter_mut().enumerate().for_each(|(a, q)| *q = 0.1 + 0.25 * (0.3 * f64::from(k) + a as f64).sin());
            assert_eq!(one.sample(&q), other.sample(&q));
        }
    }
}

fn refusal<T>(done: Result<T, Error>) -> String {
    done.err().map(|error| error.to_string()).unwrap_or_default()
}

#[test]
fn a_block_without_its_foundation_or_twice_is_refused() {
    let space = space(2, 3);
    let mut store = Store::new(space.clone());
    let make = |level, block: &Place| nodes(&space, level, block, |_| true, noise(2, 1));
    let place = [1, 1, 0, 0, 0, 0];
    assert!(refusal(store.publish(1, &place, make(1, &place))).contains("on which it rests"));
    blocks(&space, 0).iter().for_each(|block| store.publish(0, block, make(0, block)).unwrap());
    store.publish(1, &place, make(1, &place)).unwrap();
    assert!(refusal(store.publish(1, &place, make(1, &place))).contains("there twice"));
    // Of the four blocks below only one is there.
    let above = [3, 3, 0, 0, 0, 0];
    assert!(refusal(store.publish(2, &above, make(2, &above))).contains("on which it rests"));
}

#[test]
fn what_is_not_sound_is_refused() {
    let space = space(2, 2);
    let mut store = Store::new(space.clone());
    let block = [0; MAX_AXES];
    let sound = nodes(&space, 0, &block, |_| true, noise(2, 1));
    let mut bad = vec![sound.clone(), sound.clone(), sound.clone(), sound.clone(), sound.clone()];
    bad[0].records[3] = f32::NAN;
    bad[1].records.pop();
    bad[2].gap[0] = f32::INFINITY;
    bad[3].status[1] = 9;
    bad[4].present |= 1 << 63;
    for nodes in bad {
        assert!(refusal(store.publish(0, &block, nodes)).contains("not sound"));
    }
    // Outside the grid, beyond the levels, and nodes of the level below.
    for (level, place) in [(0, [9, 0, 0, 0, 0, 0]), (2, block), (0, [u32::MAX; MAX_AXES])] {
        assert!(refusal(store.publish(level, &place, Nodes::default())).contains("not sound"));
    }
    store.publish(0, &block, sound).unwrap();
    let mut even = Nodes::default();
    even.push(0, &vec![0.0; width(2)], &[], 0.0, Status::Free);
    assert!(refusal(store.publish(1, &block, even)).contains("not sound"));
}

#[test]
fn keys_come_back_and_what_cannot_be_numbered_is_refused() {
    for joints in 1..=MAX_AXES {
        let space = space(joints, 2);
        for level in 0..2 {
            for block in blocks(&space, level) {
                assert_eq!(space.block(space.key(level, &block)), Some((level, block)));
            }
        }
        assert_eq!(space.block(u64::MAX), None);
    }
    let axis = |count| Axis { name: "a".into(), unit: "rad".into(), start: 0.0, step: 0.1, count };
    let grid = |count| Grid { axes: vec![axis(count); 6] };
    assert!(refusal(Space::new(&grid(1), 2)).contains("axis a has one grid line"));
    assert!(refusal(Space::new(&grid(500), 3)).contains("at most 2 are possible"));
    assert!(Space::new(&grid(500), 2).is_ok());
}
