//! Readers beside writers: no half block is seen, nothing is allocated.

use crate::fixture::{blocks, nodes, space};
use assert_no_alloc::{AllocDisabler, assert_no_alloc};
use haptize::store::{
    Nodes, Place, Store,
    record::{slope, width},
};
use std::{
    collections::HashSet,
    sync::atomic::{AtomicBool, Ordering},
    thread,
};

#[global_allocator]
static ALLOCATOR: AllocDisabler = AllocDisabler;

/// An affine function: the store gives it from the base on, whatever blocks come, if it reads whole ones.
fn affine(q: &[f64]) -> Vec<f64> {
    let mut record = vec![0.0; width(q.len())];
    record[0] = 1.0 + q.iter().sum::<f64>();
    (0..q.len()).for_each(|a| record[slope(a)] = 1.0);
    record
}

#[test]
fn readers_see_whole_blocks_beside_writers_and_never_allocate() {
    for joints in [3, 5] {
        let space = space(joints, 2);
        let store = Store::new(space.clone(), blocks(&space, 0).len() + blocks(&space, 1).len());
        let make = |level, block: &Place| nodes(&space, level, block, |_| true, affine);
        blocks(&space, 0).iter().for_each(|block| store.publish(0, block, make(0, block)).unwrap());
        let done = AtomicBool::new(false);
        thread::scope(|scope| {
            let readers: Vec<_> = (0..2)
                .map(|reader| {
                    let (store, done) = (&store, &done);
                    scope.spawn(move || {
                        let (mut k, mut finest, mut after) = (reader, 0, 0);
                        // Until all is there, and some more.
                        while after < 1000 {
                            after += u32::from(done.load(Ordering::Acquire));
                            k += 1;
                            let mut q = [0.0; 5];
                            for (a, q) in q.iter_mut().enumerate().take(joints) {
                                *q = -0.2 + 0.1 * (1.0 + (0.01 * f64::from(k) + a as f64).sin());
                            }
                            let root = assert_no_alloc(|| store.sample(&q[..joints]));
                            let exact = 1.0 + q[..joints].iter().sum::<f64>();
                            assert!((root.value - exact).abs() < 1e-5, "{} for {exact}", root.value);
                            finest = finest.max(root.levels);
                        }
                        finest
                    })
                })
                .collect();
            let all = blocks(&space, 1);
            thread::scope(|writers| {
                // Both write all blocks: each is published once.
                let writing: Vec<_> = (0..2)
                    .map(|_| {
                        let (store, all, make) = (&store, &all, &make);
                        writers.spawn(move || {
                            all.iter().filter(|block| store.publish(1, block, make(1, block)).is_ok()).count()
                        })
                    })
                    .collect();
                let published: usize = writing.into_iter().map(|writer| writer.join().unwrap()).sum();
                assert_eq!(published, all.len());
            });
            done.store(true, Ordering::Release);
            for reader in readers {
                assert_eq!(reader.join().unwrap(), 2);
            }
        });
    }
}

#[test]
fn a_list_of_blocks_beside_writers_has_all_on_which_each_rests() {
    let space = space(3, 3);
    let all: Vec<_> = (0..3).flat_map(|level| blocks(&space, level).into_iter().map(move |b| (level, b))).collect();
    let mut beside = 0;
    // Again and again, until a list was taken while blocks were published.
    for _ in 0..2000 {
        let store = Store::new(space.clone(), all.len());
        thread::scope(|scope| {
            let writer = scope.spawn(|| {
                for (level, block) in &all {
                    store.publish(*level, block, Nodes::default()).unwrap();
                }
            });
            while !writer.is_finished() {
                let (before, list) = (store.horizon(), store.blocks());
                beside += usize::from(store.horizon() > before);
                let keys: HashSet<u64> = list.iter().map(|(key, _)| *key).collect();
                for key in &keys {
                    let (level, place) = space.block(*key).unwrap();
                    let rests = |(below, place)| keys.contains(&space.key(below, &place));
                    assert!(store.foundation(level, &place).all(rests), "of {} blocks", keys.len());
                }
            }
        });
        if beside > 1000 {
            return;
        }
    }
    panic!("{beside} lists were taken beside the writer");
}
