//! The effects that a scene names, of the loop and of the object that is drawn; each can be left out while one feels and
//! sees, and taken back as the scene has it.

use super::loaded::Loaded;
use crate::scene::{GraphicsEffects, HapticsSpec, ProxyInertia};

/// What can be turned without baking again.
#[derive(Clone, Debug, PartialEq)]
pub struct Tuning {
    /// Gains and effects of a tick.
    pub haptics: HapticsSpec,
    /// Effects of a frame; none where nothing is drawn.
    pub graphics: GraphicsEffects,
}

/// What an effect is part of, and so what it costs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// Of each tick of the haptic loop.
    Tick,
    /// Of each frame of the object.
    Frame,
}

/// Something that is done because the scene asks for it.
pub struct Effect {
    /// For its box.
    pub name: &'static str,
    /// What it does.
    pub what: &'static str,
    /// What it is part of.
    pub part: Part,
    /// Whether it is asked for.
    pub is_on: fn(&Tuning) -> bool,
    /// Leaves it out.
    pub leave_out: fn(&mut Tuning),
    /// Takes it back as the scene has it.
    pub take_back: fn(&mut Tuning, &Tuning),
}

/// All effects; a scene shows those that it names.
pub const EFFECTS: [Effect; 9] = [
    Effect {
        name: "Varying inertia",
        what: "The proxy moves with the chain's inertia where it is, instead of that in the middle of the grid",
        part: Part::Tick,
        is_on: |tuning| tuning.haptics.proxy_inertia == ProxyInertia::Configuration,
        leave_out: |tuning| tuning.haptics.proxy_inertia = ProxyInertia::Constant,
        take_back: |tuning, scene| tuning.haptics.proxy_inertia = scene.haptics.proxy_inertia,
    },
    Effect {
        name: "Contact friction",
        what: "Coulomb friction of elastic-plastic bristles at the proxy's nodes in contact: sticks, slips",
        part: Part::Tick,
        is_on: |tuning| tuning.haptics.effects.friction.is_some(),
        leave_out: |tuning| tuning.haptics.effects.friction = None,
        take_back: |tuning, scene| tuning.haptics.effects.friction.clone_from(&scene.haptics.effects.friction),
    },
    Effect {
        name: "Contact damping",
        what: "Dampers along the normals of the contacts",
        part: Part::Tick,
        is_on: |tuning| tuning.haptics.effects.contact_damping.is_some(),
        leave_out: |tuning| tuning.haptics.effects.contact_damping = None,
        take_back: |tuning, scene| {
            tuning.haptics.effects.contact_damping.clone_from(&scene.haptics.effects.contact_damping);
        },
    },
    Effect {
        name: "Four channels",
        what: "Four-channel coupling: forces and accelerations of hand and proxy are exchanged beside the coupling's spring and damper",
        part: Part::Tick,
        is_on: |tuning| tuning.haptics.effects.four_channel.is_some(),
        leave_out: |tuning| tuning.haptics.effects.four_channel = None,
        take_back: |tuning, scene| tuning.haptics.effects.four_channel = scene.haptics.effects.four_channel,
    },
    Effect {
        name: "Passivity control",
        what: "Damping wherever the passivity observer says that energy came from nowhere",
        part: Part::Tick,
        is_on: |tuning| tuning.haptics.effects.passivity_control,
        leave_out: |tuning| tuning.haptics.effects.passivity_control = false,
        take_back: |tuning, scene| {
            tuning.haptics.effects.passivity_control = scene.haptics.effects.passivity_control;
        },
    },
    Effect {
        name: "Gravity",
        what: "The object's nodes have weight",
        part: Part::Frame,
        is_on: |tuning| tuning.graphics.gravity.is_some(),
        leave_out: |tuning| tuning.graphics.gravity = None,
        take_back: |tuning, scene| tuning.graphics.gravity = scene.graphics.gravity,
    },
    Effect {
        name: "Strain stiffening",
        what: "The object's springs stiffen the more they are stretched",
        part: Part::Frame,
        is_on: |tuning| tuning.graphics.stiffening.is_some(),
        leave_out: |tuning| tuning.graphics.stiffening = None,
        take_back: |tuning, scene| tuning.graphics.stiffening = scene.graphics.stiffening,
    },
    Effect {
        name: "Smoothing",
        what: "Contact forces pass a low-pass filter before they move the object",
        part: Part::Frame,
        is_on: |tuning| tuning.graphics.smoothing.is_some(),
        leave_out: |tuning| tuning.graphics.smoothing = None,
        take_back: |tuning, scene| tuning.graphics.smoothing = scene.graphics.smoothing,
    },
    Effect {
        name: "Quasi-static object",
        what: "The object has no dynamics: it is drawn in equilibrium with the contact forces",
        part: Part::Frame,
        is_on: |tuning| tuning.graphics.quasi_static,
        leave_out: |tuning| tuning.graphics.quasi_static = false,
        take_back: |tuning, scene| tuning.graphics.quasi_static = scene.graphics.quasi_static,
    },
];

impl Tuning {
    /// As the scene of `loaded` has it.
    #[must_use]
    pub fn of(loaded: &Loaded) -> Self {
        let scene = &loaded.setup.scene;
        let drawn = loaded.setup.object.as_ref().and(scene.graphics.as_ref());
        Self { haptics: scene.haptics.clone(), graphics: drawn.map(|graphics| graphics.effects).unwrap_or_default() }
    }

    /// Numbers of the effects that it asks for.
    pub fn named(&self) -> impl Iterator<Item = usize> {
        (0..EFFECTS.len()).filter(|&number| (EFFECTS[number].is_on)(self))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Rendering;

    /// The sphere with every effect that goes with the others named.
    fn scene(graphics: &str) -> Tuning {
        let text = include_str!("../../datasets/sphere.toml");
        let (head, tail) = text.split_once("[graphics]").unwrap();
        let text = format!(
            "{head}\n[graphics]\n{graphics}{tail}\n[haptics.friction]\ncoefficient = 0.3\n\
             [haptics.four_channel]\nchannels = [0.5, 0.5, 0.5, 0.5]\n"
        );
        let text = text.replacen(
            "[haptics]",
            "[haptics]\nproxy_inertia = \"configuration\"\ncontact_damping = 0.5\npassivity_control = true",
            1,
        );
        let scene = Rendering::parse(&text, "all.toml").unwrap();
        Tuning { haptics: scene.haptics, graphics: scene.graphics.unwrap().effects }
    }

    #[test]
    fn each_effect_is_left_out_alone_and_taken_back_as_it_was() {
        let mut seen = [false; EFFECTS.len()];
        for graphics in [
            "gravity = [0.0, 0.0, -9.81]\nstiffening = { factor = 3.0, strain = 0.2 }\nsmoothing = 0.05\n",
            "quasi_static = true\n",
        ] {
            let scene = scene(graphics);
            for number in scene.named() {
                seen[number] = true;
                let mut tuning = scene.clone();
                (EFFECTS[number].leave_out)(&mut tuning);
                let left: Vec<usize> = tuning.named().collect();
                assert!(scene.named().filter(|&other| other != number).eq(left), "{}", EFFECTS[number].name);
                (EFFECTS[number].take_back)(&mut tuning, &scene);
                assert_eq!(tuning, scene, "{}", EFFECTS[number].name);
            }
        }
        assert_eq!(seen, [true; EFFECTS.len()], "an effect is not tested");
    }
}
