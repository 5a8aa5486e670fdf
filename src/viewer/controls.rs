//! Settings that can be turned while one feels: gains, interpolation, effects, what is shown, and how
//! the scene is baked.

use super::{
    gains,
    job::Solver,
    legend::choice,
    loaded::Loaded,
    palette,
    scene::Shown,
    theme::{CHOICE_WIDTH, GROUP_GAP},
    view_renderer::Quantity,
};
use crate::render::passivity::Advice;
use crate::scene::{ContactLaw, EFFECTS, Effect, Interpolation, Scene, Tuning};
use clap::ValueEnum as _;
use eframe::egui::{Align, Button, DragValue, Layout, Response, RichText, Ui};
use std::sync::Arc;

/// The panel's state.
pub struct Controls {
    /// Gains and effects as they are turned.
    pub tuning: Tuning,
    /// As the scene has them.
    original: Tuning,
    /// The joint whose gains the sliders show; none for all.
    joint: Option<usize>,
    /// The scene as it would be baked.
    pub scene: Option<Arc<Scene>>,
    /// Backend of the next bake.
    pub solver: Solver,
    /// Whether a change of the scene is baked at once.
    bake_on_change: bool,
}

/// Greatest stiffness of contact that can be typed (N/m), and the change for each point of the pointer's way
/// (N/m/point).
const CONTACT_STIFFNESS: std::ops::RangeInclusive<f64> = 1.0..=1e6;
const CONTACT_STIFFNESS_DRAG: f64 = 5.0;

impl Controls {
    /// As `loaded` has them.
    #[must_use]
    pub fn new(loaded: &Loaded) -> Self {
        let original = loaded.tuning();
        let (tuning, scene) = (original.clone(), loaded.scene.clone());
        Self { tuning, original, joint: None, scene, solver: Solver::Auto, bake_on_change: false }
    }

    /// Keeps of `before` what a new bake of the same scene does not change.
    pub fn keep(&mut self, before: &Self) {
        (self.solver, self.bake_on_change) = (before.solver.clone(), before.bake_on_change);
    }

    /// Shows the panel, and returns whether the scene is to be baked again. `advice`: what is wrong with the gains, if
    /// anything; `solvers`: what this machine bakes with.
    pub fn show(
        &mut self,
        ui: &mut Ui,
        loaded: &Loaded,
        advice: Option<&Advice>,
        shown: &mut Shown,
        solvers: &[Solver],
    ) -> bool {
        ui.horizontal(|ui| {
            ui.heading("Feel").on_hover_text("The 1 kHz loop: gains and interpolation, felt at once");
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                let changed = self.tuning.haptics != self.original.haptics;
                let reset = ui.add_enabled(changed, Button::new("Reset gains"));
                if reset.on_hover_text("Takes the gains of the scene again").clicked() {
                    self.tuning.haptics = self.original.haptics.clone();
                }
            });
        });
        self.feel(ui, loaded, advice);
        self.effects(ui);
        ui.add_space(GROUP_GAP);
        ui.heading("Scene").on_hover_text("What the 3-D picture shows");
        if loaded.forces.is_some() {
            look(ui, shown);
        } else {
            let why = "A scanned dataset: nothing of the object is known but its torques, so the proxy alone is drawn.";
            ui.label(RichText::new(why).weak());
            ui.checkbox(&mut shown.ghost, "Device's ghost");
        }
        ui.add_space(GROUP_GAP);
        ui.heading("Haptization").on_hover_text("How the dataset was solved, and solving it again");
        self.haptization(ui, loaded, solvers)
    }

    fn feel(&mut self, ui: &mut Ui, loaded: &Loaded, advice: Option<&Advice>) {
        let axes = &loaded.dataset.grid.axes;
        gains::joint(ui, axes, &mut self.joint);
        gains::legend(ui);
        gains::sliders(ui, axes, self.joint, &mut self.tuning.haptics, &self.original.haptics);
        gains::threshold(ui, &mut self.tuning.haptics);
        self.interpolation(ui, loaded);
        let Some(advice) = advice else {
            let good = palette::of(ui.visuals()).good;
            ui.colored_label(good, RichText::new("All gains within their passivity bounds").small());
            return;
        };
        ui.colored_label(ui.visuals().warn_fg_color, RichText::new(&advice.text).small());
        let button = ui.add_enabled(advice.passive.is_some(), Button::new("Use passive gains"));
        let button = button.on_hover_text("Change what is beyond a bound so that it keeps it");
        if let (Some(passive), true) = (&advice.passive, button.clicked()) {
            self.tuning.haptics = passive.clone();
        }
    }

    /// Shows how the torque is interpolated between grid points.
    fn interpolation(&mut self, ui: &mut Ui, loaded: &Loaded) {
        ui.horizontal(|ui| {
            let label = ui.label("Interpolation").on_hover_text("How the torque follows from the grid points around");
            let chosen = &mut self.tuning.haptics.interpolation;
            choice(ui, &label, "interpolation", Some(CHOICE_WIDTH), chosen.name(), |ui| {
                for interpolation in Interpolation::ALL {
                    let lacking = lacking(interpolation, loaded);
                    ui.add_enabled_ui(lacking.is_none(), |ui| {
                        let choice = ui.selectable_value(chosen, interpolation, interpolation.name());
                        if let Some(lacking) = lacking {
                            choice.on_disabled_hover_text(lacking);
                        }
                    });
                }
            });
        });
    }

    /// A box for every effect that the scene names.
    fn effects(&mut self, ui: &mut Ui) {
        ui.add_space(GROUP_GAP);
        ui.heading("Effects").on_hover_text("What the scene adds to plain contact");
        let named: Vec<Effect> = EFFECTS.into_iter().filter(|effect| effect.is_in(&self.original)).collect();
        if named.is_empty() {
            let there_are: Vec<String> =
                EFFECTS.iter().map(|effect| format!("{}: {} in [{}]", effect.name, effect.key, effect.table)).collect();
            let why = RichText::new("This scene names none.").weak().small();
            ui.label(why).on_hover_text(format!("There are:\n{}", there_are.join("\n")));
        }
        for effect in named {
            let mut on = effect.is_in(&self.tuning);
            let changed = ui.checkbox(&mut on, effect.name).on_hover_text(effect.what).changed();
            if changed && on {
                effect.take_back(&mut self.tuning, &self.original);
            } else if changed {
                effect.leave_out(&mut self.tuning);
            }
        }
    }

    fn haptization(&mut self, ui: &mut Ui, loaded: &Loaded, solvers: &[Solver]) -> bool {
        let provenance = &loaded.dataset.provenance;
        let by = if provenance.adapter.is_empty() { &provenance.backend } else { &provenance.adapter };
        let points = match &loaded.live {
            Some(_) => "solved live".into(),
            None => format!("{} points", loaded.dataset.grid.points()),
        };
        note(ui, format!("{points}, {} on {by}", provenance.algorithm));
        if let Some(error) = provenance.error.as_ref().and_then(|error| error.lines().into_iter().next()) {
            note(ui, format!("error: {error}"));
        }
        let Some(scene) = &mut self.scene else {
            ui.label(RichText::new("Scanned: it cannot be baked again.").weak());
            return false;
        };
        let mut contact = scene.contact;
        ui.horizontal(|ui| {
            let label = ui.label("Solve").on_hover_text(
                "The law of contact: depths and directions before the surface at rest, or before the deformed one",
            );
            choice(ui, &label, "law", Some(CHOICE_WIDTH), contact.law.name(), |ui| {
                for &law in ContactLaw::value_variants() {
                    ui.selectable_value(&mut contact.law, law, law.name());
                }
            });
        });
        ui.horizontal(|ui| {
            let label = ui.label("on").on_hover_text("The CPU or a GPU");
            choice(ui, &label, "solver", None, self.solver.to_string(), |ui| {
                for solver in solvers {
                    let choice = ui.selectable_value(&mut self.solver, solver.clone(), solver.to_string());
                    choice.on_hover_text(solver.what());
                }
            });
        });
        ui.horizontal(|ui| {
            let label = ui.label("Contact Kc [N/m]").on_hover_text("Stiffness of a contact spring");
            let number = DragValue::new(&mut contact.stiffness).range(CONTACT_STIFFNESS).speed(CONTACT_STIFFNESS_DRAG);
            ui.add(number).labelled_by(label.id);
        });
        let changed = contact != scene.contact;
        if changed {
            Arc::make_mut(scene).contact = contact;
        }
        let differs = loaded.scene.as_ref().is_some_and(|known| known.contact != scene.contact);
        let text = RichText::new(if loaded.live.is_some() { "Bake" } else { "Bake again" });
        let text = if differs { text.strong() } else { text };
        let bake = ui.horizontal(|ui| {
            let bake = ui.button(text).on_hover_text("In the background; what is felt now stays until it is done");
            ui.checkbox(&mut self.bake_on_change, "on change").on_hover_text("A change above is baked at once");
            bake
        });
        bake.inner.clicked() || (self.bake_on_change && changed)
    }
}

/// Shows the choices of colour, edges, arrows and ghost.
fn look(ui: &mut Ui, shown: &mut Shown) {
    ui.horizontal(|ui| {
        ui.label("Colour").on_hover_text("What the colour of the object means");
        ui.selectable_value(&mut shown.quantity, Quantity::Displacement, "displacement");
        ui.selectable_value(&mut shown.quantity, Quantity::Force, "force");
    });
    ui.horizontal_wrapped(|ui| {
        ui.checkbox(&mut shown.edges, "Edges").on_hover_text("Edges of the mesh");
        ui.checkbox(&mut shown.forces, "Force arrows").on_hover_text("Forces of the object on the arm");
        ui.checkbox(&mut shown.ghost, "Device's ghost")
            .on_hover_text("Where the device is: the arm that the hand holds");
    });
}

fn note(ui: &mut Ui, text: String) -> Response {
    ui.label(RichText::new(text).weak().small())
}

/// What `interpolation` needs and is not `loaded`, in words.
fn lacking(interpolation: Interpolation, loaded: &Loaded) -> Option<&'static str> {
    match interpolation {
        _ if loaded.live.is_some() => Some("Contact is solved in every tick: haptize the scene first"),
        of if of.is_potential() && loaded.dataset.energy.is_none() => Some("This dataset holds no energy"),
        _ => None,
    }
}
