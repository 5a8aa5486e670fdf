//! The first screen: from a scene to what is felt in three steps, over the live scene.

use super::{
    loaded::Loaded,
    theme::{GAP, GROUP_GAP, LONE_BUTTON, STEPS_WIDTH},
};
use eframe::egui::{self, Align2, Button, RichText, Ui, vec2};

/// Shows the steps in the upper left of `ui`, and returns whether they are still wanted.
pub fn show(ui: &Ui, loaded: &Loaded) -> bool {
    let mut wanted = true;
    let place = ui.max_rect().left_top() + vec2(GROUP_GAP, 3.0 * GROUP_GAP);
    egui::Window::new("From a scene to a force in three steps")
        .collapsible(false)
        .resizable(false)
        .pivot(Align2::LEFT_TOP)
        .default_pos(place)
        .default_width(STEPS_WIDTH)
        .show(ui.ctx(), |ui| {
            ui.set_max_width(STEPS_WIDTH);
            for (title, text) in texts(loaded) {
                ui.label(RichText::new(title).strong());
                ui.label(text);
                ui.add_space(GAP);
            }
            ui.label(
                RichText::new("Try it: drag the arm by one of its nodes into the object, or click Press above.")
                    .strong(),
            );
            ui.add_space(GAP);
            wanted = !ui.add_sized(LONE_BUTTON, Button::new("Got it")).clicked();
        });
    wanted
}

/// Titles and texts of the steps, with the numbers of `loaded`.
fn texts(loaded: &Loaded) -> [(&'static str, String); 3] {
    let grid = &loaded.dataset.grid;
    let joints: Vec<&str> = grid.axes.iter().map(|axis| axis.name.as_str()).collect();
    let (points, joints) = (grid.points(), joints.join(", "));
    if loaded.live.is_some() {
        return [
            ("1  Prepare", "The object's compliance was formed: how each node moves under a force on any other.".into()),
            (
                "2  Solve",
                "1000 times a second the equilibrium of arm and object is solved where the arm is, before the surface at \
                 rest."
                    .into(),
            ),
            (
                "3  Store",
                format!(
                    "Nothing is stored yet. Bake, under Haptization, solves the scene by its own law over the joints \
                     {joints}, for a loop that only looks up."
                ),
            ),
        ];
    }
    let solve = match &loaded.report {
        Some(report) => {
            format!("Contact of arm and object was solved at {points} joint configurations in {:.1} s.", report.seconds)
        }
        None if loaded.dataset.surface.is_none() => {
            format!("Torque was measured and brought to {points} joint configurations.")
        }
        None => format!("Contact of arm and object was solved beforehand at {points} joint configurations."),
    };
    [
        ("1  Solve", solve),
        (
            "2  Store",
            format!(
                "Each configuration holds a torque. The map on the right shows them over the joints {joints}; \
                 all of them are the dataset."
            ),
        ),
        (
            "3  Look up",
            "1000 times a second the torque is interpolated where the arm is: the ring on the map. \
             The plots show what is felt."
                .into(),
        ),
    ]
}
