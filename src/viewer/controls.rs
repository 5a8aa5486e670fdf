//! What can be turned while one feels: gains with their passivity bounds, the contact threshold, what is shown, and how
//! the scene is baked.

use super::{
    effects::{EFFECTS, Prices},
    loaded::Loaded,
    number,
    scene::Shown,
    stage::Quantity,
    theme::{self, GAP, GROUP_GAP},
};
use crate::{
    JointVector,
    haptize::BackendChoice,
    render::passivity::{self, Bound},
    scene::{Algorithm, HapticsSpec, Scene},
};
use eframe::egui::{self, ComboBox, DragValue, RichText, Slider, SliderClamping, Stroke, Ui, style::HandleShape};
use std::sync::Arc;

/// What the user asked for.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Asked {
    /// The gains have changed.
    pub retune: bool,
    /// The scene is to be baked again.
    pub bake: bool,
}

/// The panel's state.
pub struct Controls {
    /// Gains as they are turned.
    pub gains: HapticsSpec,
    /// The joint whose gains the sliders show; none for all.
    joint: Option<usize>,
    /// The scene as it would be baked.
    pub scene: Option<Arc<Scene>>,
    /// What solves.
    pub backend: BackendChoice,
    /// Whether a change of the scene is baked at once.
    bake_on_change: bool,
    prices: Prices,
}

/// One gain of the loop.
struct Gain {
    name: &'static str,
    unit: &'static str,
    what: &'static str,
    of: fn(&mut HapticsSpec) -> &mut JointVector,
    /// Greatest passive value at a joint.
    bound: fn(&HapticsSpec, usize) -> Option<f64>,
}

const GAINS: [Gain; 4] = [
    Gain {
        name: "Coupling stiffness Kvc",
        unit: "N m/rad",
        what: "Between device and proxy. Passive up to 2 (bd - Bvc) / T, without the hand's damping",
        of: |gains| &mut gains.coupling_stiffness,
        bound: |gains, joint| Some(passivity::greatest_stiffness(gains, joint)),
    },
    Gain {
        name: "Boundary slope Ks",
        unit: "N m/rad",
        what: "How steeply torque may begin at the contact boundary. Passive up to mu bv / T",
        of: |gains| &mut gains.boundary_slope,
        bound: |gains, joint| Some(passivity::greatest_slope(gains, joint)),
    },
    Gain {
        name: "Coupling damping Bvc",
        unit: "N m s/rad",
        what: "Between device and proxy. Passive up to bd - Kvc T/2",
        of: |gains| &mut gains.coupling_damping,
        bound: |gains, joint| {
            Some((gains.device_damping[joint] - 0.5 * gains.coupling_stiffness[joint] / gains.rate).max(0.0))
        },
    },
    Gain {
        name: "Proxy damping bv",
        unit: "N m s/rad",
        what: "Of the proxy against the ground; more of it allows a steeper Ks",
        of: |gains| &mut gains.proxy_damping,
        bound: |_, _| None,
    },
];

impl Controls {
    /// As `loaded` has them. Effects are priced in the background, and `wake` is called whenever there is news.
    #[must_use]
    pub fn new(loaded: &Loaded, wake: impl Fn() + Send + 'static) -> Self {
        let gains = loaded.setup.scene.haptics.clone();
        let prices = Prices::measure(loaded, wake);
        let scene = loaded.scene.clone();
        Self { gains, joint: None, scene, backend: BackendChoice::Auto, bake_on_change: false, prices }
    }

    /// Keeps of `before` what a new bake of the same scene does not change.
    pub fn keep(&mut self, before: &Self) {
        (self.backend, self.bake_on_change) = (before.backend, before.bake_on_change);
    }

    /// The panel. `exceeded`: gains beyond their bound.
    pub fn show(&mut self, ui: &mut Ui, loaded: &Loaded, exceeded: &[Bound], shown: &mut Shown, object: bool) -> Asked {
        let mut asked = Asked::default();
        ui.heading("Feel");
        asked.retune |= self.feel(ui, loaded, exceeded);
        asked.retune |= self.effects(ui, &loaded.setup.scene.haptics);
        ui.add_space(GROUP_GAP);
        ui.heading("Scene");
        if object {
            self.look(ui, shown);
        } else {
            ui.label(
                RichText::new(
                    "A scanned dataset: nothing of the object is known but its torques, so the proxy alone is drawn.",
                )
                .weak(),
            );
            ui.checkbox(&mut shown.ghost, "Device's ghost");
        }
        ui.add_space(GROUP_GAP);
        ui.heading("Haptization");
        asked.bake |= self.haptization(ui, loaded);
        asked
    }

    fn feel(&mut self, ui: &mut Ui, loaded: &Loaded, exceeded: &[Bound]) -> bool {
        let axes = &loaded.dataset.grid.axes;
        let mut changed = false;
        ui.horizontal(|ui| {
            let label = ui.label("Joint");
            let name = self.joint.map_or("all", |joint| &axes[joint].name);
            ComboBox::from_id_salt("joint")
                .selected_text(name)
                .show_ui(ui, |ui| {
                    ui.selectable_value(&mut self.joint, None, "all");
                    for (joint, axis) in axes.iter().enumerate() {
                        ui.selectable_value(&mut self.joint, Some(joint), &axis.name);
                    }
                })
                .response
                .labelled_by(label.id);
        });
        let original = &loaded.setup.scene.haptics;
        for gain in &GAINS {
            changed |= self.gain(ui, gain, original);
        }
        let mut threshold = self.gains.threshold;
        let label = ui.label("Contact threshold Ith [1]");
        ui.horizontal(|ui| {
            ui.spacing_mut().slider_width = ui.available_width() - 66.0;
            let slider = Slider::new(&mut threshold, 0.0..=0.95).show_value(false).handle_shape(HandleShape::Circle);
            let response = ui.add(slider).on_hover_text("Contact where the interpolated contact index exceeds it");
            response.widget_info(|| egui::WidgetInfo::slider(true, threshold, "Contact threshold Ith"));
            let value = DragValue::new(&mut threshold).range(0.0..=0.95).speed(0.01).fixed_decimals(2);
            ui.add(value).labelled_by(label.id);
        });
        if (threshold - self.gains.threshold).abs() > 0.0 {
            self.gains.threshold = threshold;
            changed = true;
        }
        ui.horizontal(|ui| {
            if ui.add_enabled(self.gains != *original, egui::Button::new("Gains of the scene")).clicked() {
                self.gains = original.clone();
                changed = true;
            }
        });
        for gain in exceeded {
            ui.colored_label(ui.visuals().warn_fg_color, RichText::new(gain.to_string()).small());
        }
        if exceeded.is_empty() {
            let palette = theme::palette(ui.visuals());
            ui.colored_label(palette.good, RichText::new("All gains within their passivity bounds").small());
        }
        changed
    }

    /// A box for every effect that the scene names, with its price.
    fn effects(&mut self, ui: &mut Ui, scene: &HapticsSpec) -> bool {
        let mut changed = false;
        let mut any = false;
        for (number, effect) in EFFECTS.iter().enumerate().filter(|(_, effect)| (effect.is_on)(scene)) {
            if !any {
                ui.add_space(GROUP_GAP);
                ui.heading("Effects");
                any = true;
            }
            let mut on = (effect.is_on)(&self.gains);
            ui.checkbox(&mut on, effect.name).on_hover_text(effect.what);
            let price = match self.prices.of(number) {
                Some(price) => format!("{price:+.2} µs a tick"),
                None => "its price is being measured".into(),
            };
            ui.indent(effect.name, |ui| ui.label(RichText::new(price).weak().small()));
            if on != (effect.is_on)(&self.gains) {
                if on {
                    (effect.take_back)(&mut self.gains, scene);
                } else {
                    (effect.leave_out)(&mut self.gains);
                }
                changed = true;
            }
        }
        changed
    }

    /// A slider with its bound drawn on it: everything to the right of the mark may create energy.
    fn gain(&mut self, ui: &mut Ui, gain: &Gain, original: &HapticsSpec) -> bool {
        let joints = (gain.of)(&mut self.gains).len();
        let chosen: Vec<usize> = self.joint.map_or_else(|| (0..joints).collect(), |joint| vec![joint]);
        let first = chosen[0];
        let bound = chosen.iter().filter_map(|&joint| (gain.bound)(&self.gains, joint)).reduce(f64::min);
        let before = (gain.of)(&mut self.gains)[first];
        let from = (gain.of)(&mut original.clone())[first];
        let top = 2.0 * from.max(bound.unwrap_or(0.0)).max(1e-3);
        let mut value = before;
        ui.add_space(2.0);
        let label = ui.label(format!("{} [{}]", gain.name, gain.unit));
        ui.horizontal(|ui| {
            ui.spacing_mut().slider_width = ui.available_width() - 66.0;
            let slider = Slider::new(&mut value, 0.0..=top)
                .show_value(false)
                .smart_aim(false)
                .clamping(SliderClamping::Edits)
                .handle_shape(HandleShape::Circle);
            let response = ui.add(slider);
            response.widget_info(|| egui::WidgetInfo::slider(true, value, gain.name));
            let rect = response.rect;
            if let Some(bound) = bound {
                let palette = theme::palette(ui.visuals());
                let radius = rect.height() / 2.5;
                let rail = rect.x_range().shrink(radius);
                let x = egui::lerp(rail, (bound / top).clamp(0.0, 1.0) as f32);
                let colour = if value > bound { palette.bad } else { palette.good };
                let y = rect.center().y;
                ui.painter().line_segment([egui::pos2(x, y - 8.0), egui::pos2(x, y + 8.0)], Stroke::new(2.0, colour));
                response.on_hover_text(format!("{}. Bound here: {} {}", gain.what, number(bound), gain.unit));
            } else {
                response.on_hover_text(gain.what);
            }
            let number = DragValue::new(&mut value).range(0.0..=1e3 * top).speed(0.005 * top).max_decimals(4);
            ui.add(number).labelled_by(label.id);
        });
        // Ks and bv must be positive for there to be a boundary layer at all.
        let value = value.max(1e-6 * top);
        let changed = (value - before).abs() > 1e-9 * top;
        if changed {
            chosen.iter().for_each(|&joint| (gain.of)(&mut self.gains)[joint] = value);
        }
        changed
    }

    fn look(&mut self, ui: &mut Ui, shown: &mut Shown) {
        ui.horizontal(|ui| {
            ui.label("Colour");
            ui.selectable_value(&mut shown.quantity, Quantity::Displacement, "displacement");
            ui.selectable_value(&mut shown.quantity, Quantity::Force, "force");
        });
        ui.horizontal_wrapped(|ui| {
            ui.checkbox(&mut shown.edges, "Edges");
            ui.checkbox(&mut shown.forces, "Force arrows");
            ui.checkbox(&mut shown.ghost, "Device's ghost");
        });
    }

    fn haptization(&mut self, ui: &mut Ui, loaded: &Loaded) -> bool {
        let provenance = &loaded.dataset.provenance;
        let summary = format!(
            "{} points, {} on {}",
            loaded.dataset.grid.points(),
            provenance.algorithm,
            if provenance.adapter.is_empty() { &provenance.backend } else { &provenance.adapter }
        );
        ui.label(RichText::new(summary).weak().small());
        let Some(scene) = &mut self.scene else {
            ui.label(RichText::new("Scanned: it cannot be baked again.").weak());
            return false;
        };
        let mut contact = scene.contact;
        ui.horizontal(|ui| {
            let label = ui.label("Solve");
            ComboBox::from_id_salt("algorithm")
                .width(92.0)
                .selected_text(algorithm_name(contact.algorithm))
                .show_ui(ui, |ui| {
                    for algorithm in [Algorithm::Energy, Algorithm::Paper, Algorithm::Linearised] {
                        ui.selectable_value(&mut contact.algorithm, algorithm, algorithm_name(algorithm));
                    }
                })
                .response
                .labelled_by(label.id);
            let label = ui.label("on");
            ComboBox::from_id_salt("backend")
                .width(64.0)
                .selected_text(backend_name(self.backend))
                .show_ui(ui, |ui| {
                    for backend in [BackendChoice::Auto, BackendChoice::Cpu, BackendChoice::Gpu] {
                        ui.selectable_value(&mut self.backend, backend, backend_name(backend));
                    }
                })
                .response
                .labelled_by(label.id);
        });
        ui.horizontal(|ui| {
            let label = ui.label("Contact Kc [N/m]");
            ui.add(DragValue::new(&mut contact.stiffness).range(1.0..=1e6).speed(5.0)).labelled_by(label.id);
        });
        let changed = contact != scene.contact;
        if changed {
            Arc::make_mut(scene).contact = contact;
        }
        ui.checkbox(&mut self.bake_on_change, "Bake on change").on_hover_text("A change above is baked at once");
        ui.add_space(GAP);
        let differs = loaded.scene.as_ref().is_some_and(|known| known.contact != scene.contact);
        let text = if differs { RichText::new("Bake again").strong() } else { RichText::new("Bake again") };
        let bake = ui.button(text).on_hover_text("In the background; what is felt now stays until it is done");
        bake.clicked() || (self.bake_on_change && changed)
    }
}

fn algorithm_name(algorithm: Algorithm) -> &'static str {
    match algorithm {
        Algorithm::Energy => "energy",
        Algorithm::Paper => "paper",
        Algorithm::Linearised => "linearised",
    }
}

fn backend_name(backend: BackendChoice) -> &'static str {
    match backend {
        BackendChoice::Auto => "auto",
        BackendChoice::Cpu => "CPU",
        BackendChoice::Gpu => "GPU",
    }
}
