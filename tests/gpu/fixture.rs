//! The device that all tests share, and what they solve.

use haptize::{
    gpu::{AdapterChoice, Context},
    object::Object,
    proxy::Chain,
    scene::{ContactSurface, Material, Scene},
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
    // The kernels know the triangles.
    scene.contact.surface = ContactSurface::Facets;
    let object = Object::build(&scene.object).unwrap();
    let chain = Chain::new(&scene.proxy);
    (scene, object, chain)
}
