//! The device that all tests share, and what they solve.

use haptize::{
    JointVector,
    gpu::{AdapterChoice, Context},
    object::Object,
    proxy::Chain,
    scene::{ContactLaw, Material, Scene},
};
use std::{
    path::Path,
    sync::{Arc, OnceLock},
};

/// One device for all tests of this process: opening one costs a second, and drivers dislike many.
pub fn context() -> Arc<Context> {
    static CONTEXT: OnceLock<Arc<Context>> = OnceLock::new();
    Arc::clone(CONTEXT.get_or_init(|| {
        Arc::new(Context::open(AdapterChoice::Any).unwrap_or_else(|error| panic!("GPU tests need an adapter: {error}")))
    }))
}

/// Scene, object and proxy of a file in `datasets/`.
pub fn load(name: &str) -> (Scene, Object, Chain) {
    load_of(name, None)
}

/// The same of another material.
pub fn load_of(name: &str, material: Option<Material>) -> (Scene, Object, Chain) {
    let mut scene = {
        // The tests' own scene of this name before the shipped one.
        let folders = ["tests/scenes", "datasets"].map(|folder| Path::new(env!("CARGO_MANIFEST_DIR")).join(folder));
        let path = folders.into_iter().map(|folder| folder.join(name)).find(|path| path.exists());
        Scene::load(path.unwrap()).unwrap()
    };
    scene.object.material = material.unwrap_or(scene.object.material);
    // That is what the kernel solves.
    scene.contact.law = ContactLaw::Rest;
    let object = Object::build(&scene.object).unwrap();
    let chain = Chain::new(&scene.proxy);
    (scene, object, chain)
}

/// Every `stride`-th configuration of the scene's grid, from number `first` on.
pub fn on_grid(scene: &Scene, first: usize, stride: usize) -> Vec<JointVector> {
    let axes = &scene.grid.axes;
    let points: usize = axes.iter().map(|axis| axis.count).product();
    let configuration = |mut point: usize| {
        let mut q = JointVector::zeros(axes.len());
        for (axis, value) in axes.iter().zip(q.iter_mut()).rev() {
            *value = axis.start + (point % axis.count) as f64 * axis.step;
            point /= axis.count;
        }
        q
    };
    (first..points).step_by(stride).map(configuration).collect()
}
