//! Object and proxy of a scene.

use haptize::{contact::Model, object::Object, proxy::Chain, scene::Scene, sweep::build_object};

pub struct World {
    pub scene: Scene,
    pub object: Object,
    pub chain: Chain,
}

impl World {
    pub fn of(scene: &str) -> Self {
        let scene = Scene::parse(scene, "scene.toml").unwrap();
        Self { object: build_object(&scene).unwrap(), chain: Chain::new(&scene.proxy), scene }
    }

    /// With tangents.
    pub fn model(&self) -> Model<'_> {
        let mut model = Model::new(&self.object, &self.chain, self.scene.contact);
        model.with_tangent = true;
        model
    }
}
