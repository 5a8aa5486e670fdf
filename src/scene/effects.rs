//! The effects that a scene may name: what they are called, what they do, and how to put them into a scene or leave
//! them out, for pricing them, for turning them on and off while one feels, and for proving that what is not named is
//! not there.

use super::{GraphicsEffects, HapticsSpec, ProxyInertia, Scene};
use crate::Error;
use toml::{Table, Value};

/// An effect of a loop: absent unless the scene names it.
#[derive(Clone, Copy, Debug)]
pub struct Effect {
    /// Table of the scene's file that it stands in, `haptics`, `object` or `graphics`.
    pub table: &'static str,
    /// Its key there.
    pub key: &'static str,
    /// Its name, for people.
    pub name: &'static str,
    /// Its action, in words.
    pub what: &'static str,
    /// Its value where a scene does not give one: TOML, with figures that suit a desktop device and soft objects.
    usual: &'static str,
    /// Gives the first this effect as the second has it, or has it not.
    copy: fn(&mut Tuning, &Tuning),
}

/// No two have the same key.
impl PartialEq for Effect {
    fn eq(&self, other: &Self) -> bool {
        self.key == other.key
    }
}

impl Eq for Effect {}

/// The settings that loops can be given again without haptizing again.
#[derive(Clone, Debug, PartialEq)]
pub struct Tuning {
    /// Gains and effects of a tick.
    pub haptics: HapticsSpec,
    /// Effects of a frame; none where nothing is drawn.
    pub graphics: GraphicsEffects,
}

/// All effects, those of the tick first.
pub const EFFECTS: [Effect; 9] = [
    Effect {
        table: "haptics",
        key: "friction",
        name: "Contact friction",
        what: "Coulomb friction of the proxy on the object: sticks, gives a little, slides",
        usual: "{ coefficient = 0.4 }",
        copy: |to, from| to.haptics.friction = from.haptics.friction,
    },
    Effect {
        table: "object",
        key: "relaxation",
        name: "Relaxation",
        what: "The object's force fades while it is held, and its dent recovers",
        usual: "{ terms = [[0.55, 0.05], [0.2, 0.5]] }",
        copy: |to, from| to.haptics.relaxation.clone_from(&from.haptics.relaxation),
    },
    Effect {
        table: "haptics",
        key: "four_channel",
        name: "Four channels",
        what: "Forces and accelerations of hand and proxy are exchanged beside the coupling's spring and damper",
        usual: "{}",
        copy: |to, from| to.haptics.four_channel = from.haptics.four_channel,
    },
    Effect {
        table: "haptics",
        key: "passivity_control",
        name: "Passivity control",
        what: "Damping wherever the passivity observer says that energy came from nowhere",
        usual: "true",
        copy: |to, from| to.haptics.passivity_control = from.haptics.passivity_control,
    },
    Effect {
        table: "haptics",
        key: "proxy_inertia",
        name: "Varying inertia",
        what: "The proxy moves with the chain's inertia where it is, instead of that in the middle of the grid",
        usual: "\"configuration\"",
        copy: |to, from| to.haptics.proxy_inertia = from.haptics.proxy_inertia,
    },
    Effect {
        table: "graphics",
        key: "gravity",
        name: "Gravity",
        what: "The object's nodes have weight",
        usual: "[0.0, 0.0, -9.81]",
        copy: |to, from| to.graphics.gravity = from.graphics.gravity,
    },
    Effect {
        table: "graphics",
        key: "stiffening",
        name: "Strain stiffening",
        what: "The object's springs stiffen the more they are stretched",
        usual: "{ factor = 4.0, strain = 0.1 }",
        copy: |to, from| to.graphics.stiffening = from.graphics.stiffening,
    },
    Effect {
        table: "graphics",
        key: "smoothing",
        name: "Smoothing",
        what: "Contact forces pass a low-pass filter before they move the object",
        usual: "0.05",
        copy: |to, from| to.graphics.smoothing = from.graphics.smoothing,
    },
    Effect {
        table: "graphics",
        key: "quasi_static",
        name: "Quasi-static object",
        what: "The object has no dynamics: it is drawn in equilibrium with the contact forces",
        usual: "true",
        copy: |to, from| to.graphics.quasi_static = from.graphics.quasi_static,
    },
];

impl Effect {
    /// Whether it acts on what is drawn, and so needs `[graphics]`; else on what is felt.
    #[must_use]
    pub fn is_drawn(&self) -> bool {
        self.table == "graphics"
    }

    /// Whether it acts by what a dataset stores for it: contact forces on the object, or how contacts slip.
    #[must_use]
    pub fn is_stored(&self) -> bool {
        self.is_drawn() || self.key == "friction"
    }

    /// Its value in `scene`; none where the scene does not name it, or says that it is off.
    fn given(&self, scene: &Scene) -> Option<Value> {
        let given = table_of(scene).get(self.table)?.get(self.key).cloned();
        given.filter(|value| *value != Value::Boolean(false) && value.as_str() != Some("constant"))
    }

    /// Whether `scene` asks for it.
    #[must_use]
    pub fn is_named(&self, scene: &Scene) -> bool {
        self.given(scene).is_some()
    }

    /// Its value in `scene`; the usual one where the scene does not ask for it.
    #[must_use]
    pub fn value(&self, scene: &Scene) -> Value {
        let usual = || format!("usual = {}", self.usual).parse::<Table>().ok()?.remove("usual");
        self.given(scene).or_else(usual).unwrap_or(Value::Boolean(true))
    }

    /// Whether `tuning` has it.
    #[must_use]
    pub fn is_in(&self, tuning: &Tuning) -> bool {
        let mut without = tuning.clone();
        self.leave_out(&mut without);
        without != *tuning
    }

    /// Leaves it out of `tuning`.
    pub fn leave_out(&self, tuning: &mut Tuning) {
        let plain = HapticsSpec {
            proxy_inertia: ProxyInertia::Constant,
            friction: None,
            relaxation: None,
            four_channel: None,
            passivity_control: false,
            ..tuning.haptics.clone()
        };
        self.take_back(tuning, &Tuning { haptics: plain, graphics: GraphicsEffects::default() });
    }

    /// Takes it back into `tuning` as `scene` has it.
    pub fn take_back(&self, tuning: &mut Tuning, scene: &Tuning) {
        (self.copy)(tuning, scene);
    }
}

impl Scene {
    /// The same scene with `effects` and no others, and with or without its graphics loop, which effects on what is
    /// drawn bring with them. Its text says so, without the comments.
    ///
    /// # Errors
    /// When the effects cannot act here, or not together.
    pub fn with_effects(&self, graphics: bool, effects: &[Effect]) -> Result<Self, Error> {
        let mut text = table_of(self);
        if !graphics {
            text.insert("graphics".into(), false.into());
        } else if !text.get("graphics").is_some_and(Value::is_table) {
            text.insert("graphics".into(), Table::new().into());
        }
        for Effect { table, key, .. } in EFFECTS {
            if let Some(Value::Table(table)) = text.get_mut(table) {
                table.remove(key);
            }
        }
        for effect in effects {
            let table = text.entry(effect.table).or_insert_with(|| Table::new().into());
            if !table.is_table() {
                *table = Table::new().into();
            }
            if let Some(table) = table.as_table_mut() {
                table.insert(effect.key.to_owned(), effect.value(self));
            }
        }
        let Self { text, haptics, graphics, .. } = Self::parse(&text.to_string(), &self.path)?;
        Ok(Self { text, haptics, graphics, ..self.clone() })
    }
}

/// The text of `scene`, which was read from it, as tables.
fn table_of(scene: &Scene) -> Table {
    scene.text.parse().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sphere() -> Scene {
        let text = include_str!("../../tests/scenes/sphere.toml");
        // Relaxation asks for it.
        Scene::parse(&text.replace("\"linear\"", "\"potential\""), "sphere.toml").unwrap()
    }

    #[test]
    fn each_effect_can_be_put_in_alone_and_is_the_only_one() {
        let plain = sphere().with_effects(false, &[]).unwrap();
        assert_eq!(plain.graphics, None);
        assert_eq!(
            Scene { text: String::new(), graphics: None, ..sphere() },
            Scene { text: String::new(), ..plain.clone() }
        );
        for effect in EFFECTS {
            let scene = sphere().with_effects(false, &[effect]).unwrap();
            assert_eq!(scene.graphics.is_some(), effect.is_drawn());
            assert_ne!((&scene.haptics, scene.graphics), (&plain.haptics, None), "{}", effect.key);
            assert_eq!(scene.with_effects(false, &[]).unwrap(), plain, "{}", effect.key);
            // What is named is what is parsed.
            assert_eq!(scene.text.matches(effect.key).count(), 1, "{}", scene.text);
        }
    }

    #[test]
    fn each_effect_is_left_out_of_a_tuning_alone_and_taken_back_as_it_was() {
        let mut seen = [false; EFFECTS.len()];
        for excluded in ["stiffening", "quasi_static"] {
            let together: Vec<Effect> = EFFECTS.into_iter().filter(|effect| effect.key != excluded).collect();
            let scene = sphere().with_effects(true, &together).unwrap();
            let scene = Tuning { haptics: scene.haptics, graphics: scene.graphics.unwrap().effects };
            let named = |tuning: &Tuning| EFFECTS.map(|effect| effect.is_in(tuning));
            for (number, effect) in EFFECTS.into_iter().enumerate().filter(|(_, effect)| effect.is_in(&scene)) {
                seen[number] = true;
                let (mut tuning, mut left) = (scene.clone(), named(&scene));
                effect.leave_out(&mut tuning);
                left[number] = false;
                assert_eq!(named(&tuning), left, "{}", effect.name);
                effect.take_back(&mut tuning, &scene);
                assert_eq!(tuning, scene, "{}", effect.name);
            }
        }
        assert_eq!(seen, [true; EFFECTS.len()], "an effect is not tested");
    }

    #[test]
    fn a_scene_keeps_its_own_values_and_what_is_off_takes_the_usual_one() {
        let text = sphere().text.replace(
            "rate = 1000.0 ",
            "rate = 1000.0\npassivity_control = false\nfriction = { coefficient = 7.5 }\n# ",
        );
        let scene = Scene::parse(&text, "s.toml").unwrap();
        let value = |key: &str| EFFECTS.iter().find(|effect| effect.key == key).unwrap().value(&scene);
        assert_eq!(value("friction").get("coefficient"), Some(&Value::Float(7.5)));
        assert_eq!(value("passivity_control"), Value::Boolean(true));
        let named: Vec<&str> =
            EFFECTS.iter().filter(|effect| effect.is_named(&scene)).map(|effect| effect.key).collect();
        assert_eq!(named, ["friction"]);
    }

    #[test]
    fn effects_that_exclude_each_other_are_refused() {
        let [.., stiffening, _, quasi_static] = EFFECTS;
        let message = sphere().with_effects(true, &[stiffening, quasi_static]).unwrap_err().to_string();
        assert!(message.contains("leave out one"), "{message}");
    }
}
