//! The device that all tests share, and what they solve.

use haptize::{
    gpu::{AdapterChoice, Context},
    object::Object,
    proxy::Chain,
    scene::{Material, Scene},
};
use std::sync::{Arc, OnceLock};

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
    let mut scene = Scene::load(format!("{}/datasets/{name}", env!("CARGO_MANIFEST_DIR"))).unwrap();
    scene.object.material = material.unwrap_or(scene.object.material);
    let object = Object::build(&scene.object).unwrap();
    let chain = Chain::new(&scene.proxy);
    (scene, object, chain)
}
