//! Where panels lie, and the bars about them.

use super::{
    app::{Viewer, not_drawn},
    feel::TickSource,
    files::Files,
    guide::Guide,
    job::{Job, Task, short},
    lead::Lead,
    loaded::Loaded,
    number,
    plots::{self, Plots},
    session::Session,
    steering::{self, Side},
    steps,
    theme::{
        BAR_MARGIN, CONTROLS_RANGE, CONTROLS_WIDTH, GAP, GROUP_GAP, LEAST_MOTION, LONE_BUTTON, MESSAGE_WIDTH,
        MOTION_WIDTH, NAME_SHARE, NARROW, PANEL_MARGIN, PAUSE_WIDTH, PLOTS_RANGE, PROGRESS, PROGRESS_HEIGHT,
        SIDE_SHARE, SPACE_RANGE, TIME_WIDTH, WIDE_PROGRESS,
    },
};
use crate::{
    dataset::rewrite_file,
    gpu::ADAPTER_VARIABLE,
    render::{flags::Flags, setup::border_stiffness, trace::Tick},
};
use eframe::egui::{
    self, Align, Button, CentralPanel, CollapsingHeader, Color32, Frame, Grid, Key, Label, Layout, Modifiers, Panel,
    ProgressBar, RichText, ScrollArea, Slider, TextStyle, Ui, vec2,
};
use std::path::Path;

impl Viewer {
    /// The whole window.
    pub fn ui(&mut self, ui: &mut Ui) {
        self.name_window(ui.ctx());
        self.keys(ui);
        let dropped = ui.input(|input| input.raw.dropped_files.first().map(|file| file.path().to_owned()));
        if let Some(path) = dropped {
            self.open_file(&path, &ui.ctx().clone());
        }
        Panel::top("bar").frame(bar(ui)).show(ui, |ui| self.bar(ui));
        let status = Panel::bottom("status").frame(bar(ui)).show(ui, |ui| self.status(ui)).response.rect.height();
        if self.session.is_some() {
            self.panels(ui);
        } else {
            CentralPanel::default().show(ui, |ui| self.welcome(ui));
        }
        if let Some(path) = self.files.show(ui) {
            self.open_file(&path, &ui.ctx().clone());
        }
        self.notice.take_if(|notice| !notice.show(ui.ctx(), status));
        self.complaint(ui);
    }

    /// Gives the window the name of what is open, with a mark where it was changed and not saved.
    fn name_window(&mut self, ctx: &egui::Context) {
        let name = self.session.as_ref().map(|session| {
            let (loaded, mark) = (&session.loaded, if self.is_unsaved { "*" } else { "" });
            let path = loaded.file.as_deref().or(loaded.scene.as_ref().map(|scene| &*scene.path));
            let file = path.and_then(Path::file_name).map_or(loaded.name.clone().into(), |file| file.to_string_lossy());
            format!("{mark}{file} - haptize")
        });
        let name = name.unwrap_or_else(|| "haptize".into());
        if self.title != name {
            ctx.send_viewport_cmd(egui::ViewportCommand::Title(name.clone()));
            self.title = name;
        }
    }

    /// Does what keys ask for, unless something is typed.
    fn keys(&mut self, ui: &Ui) {
        if ui.memory(|memory| memory.focused().is_some()) {
            return;
        }
        let asks = |modifiers, key| ui.input_mut(|input| input.consume_key(modifiers, key));
        if asks(Modifiers::COMMAND, Key::O) {
            self.files.toggle();
        }
        if asks(Modifiers::COMMAND, Key::S) {
            self.save();
        }
        if asks(Modifiers::COMMAND, Key::Q) {
            ui.ctx().send_viewport_cmd(egui::ViewportCommand::Close);
        }
        for (key, side) in [(Key::Num1, Side::Front), (Key::Num2, Side::Right), (Key::Num3, Side::Top)] {
            if asks(Modifiers::NONE, key) {
                self.scene.steering.look_from(side);
            }
        }
        if asks(Modifiers::NONE, Key::Num5) {
            self.scene.steering.reset();
        }
        let Some(session) = &self.session else { return };
        if asks(Modifiers::NONE, Key::Num4) {
            self.scene.fit(&session.loaded);
        }
        // Where a device leads, the space bar is its dead-man key.
        if session.lead.is_none() && asks(Modifiers::NONE, Key::Space) {
            session.feel.guide().toggle();
        }
    }

    /// Title, opening, motions, theme. In a narrow window the name and the motion's slider make room for all that is
    /// beside them.
    fn bar(&mut self, ui: &mut Ui) {
        let name_width = NAME_SHARE * ui.available_width();
        ui.horizontal(|ui| {
            ui.with_layout(Layout::right_to_left(Align::Center), |ui| {
                let dark = ui.visuals().dark_mode;
                if ui.button(if dark { "Light" } else { "Dark" }).on_hover_text("Colours of the window").clicked() {
                    ui.ctx().set_theme(if dark { egui::Theme::Light } else { egui::Theme::Dark });
                }
                ui.menu_button("View", |ui| self.views(ui));
                let shows_steps = &mut self.shows_steps;
                let menu = ui.menu_button("Help", |ui| {
                    help(ui);
                    *shows_steps |= ui.button("Three steps").on_hover_text("From a scene to a force").clicked();
                });
                menu.response.on_hover_text("What pointer and keys do");
                ui.with_layout(Layout::left_to_right(Align::Center), |ui| self.opening_and_motions(ui, name_width));
            });
        });
    }

    /// Whence the scene is seen.
    fn views(&mut self, ui: &mut Ui) {
        for (name, side) in [("Front", Side::Front), ("Right", Side::Right), ("Top", Side::Top)] {
            if ui.button(name).clicked() {
                self.scene.steering.look_from(side);
            }
        }
        if let (true, Some(session)) = (ui.button("Fit object and tip").clicked(), &self.session) {
            self.scene.fit(&session.loaded);
        }
        if ui.button("Reset").on_hover_text("Or double-click the scene").clicked() {
            self.scene.steering.reset();
        }
        ui.separator();
        let where_to = "Into the folder that Open… shows";
        if ui.button("Save picture").on_hover_text(where_to).clicked() {
            self.save_picture(&ui.visuals().clone());
        }
        let film = if self.film.is_some() { "Stop recording" } else { "Record a GIF" };
        if ui.button(film).on_hover_text(where_to).clicked() {
            self.toggle_film(&ui.ctx().clone());
        }
    }

    fn opening_and_motions(&mut self, ui: &mut Ui, name_width: f32) {
        ui.heading("haptize");
        if let Some(session) = &self.session {
            name(ui, &session.loaded, name_width);
        }
        ui.add_space(GAP);
        if ui.button("Open…").on_hover_text("A scene (.toml) or a dataset (.haptize)").clicked() {
            self.files.toggle();
        }
        let computed = self.session.as_ref().is_some_and(|session| session.loaded.report.is_some());
        let what = match () {
            () if self.is_unsaved => Some(("Save scene", "Into its file; its comments stay")),
            () if computed => Some(("Save dataset", "Into the folder that Open… shows")),
            () => None,
        };
        if let Some((what, how)) = what
            && ui.button(what).on_hover_text(how).clicked()
        {
            self.save();
        }
        ui.separator();
        match &self.session {
            Some(Session { lead: Some(lead), .. }) => led(ui, lead),
            Some(session) => motions(ui, &mut session.feel.guide()),
            None => {}
        }
    }

    /// Shows how the loop is doing, and which adapter draws, in as many lines as that takes; a fault stands first.
    fn status(&mut self, ui: &mut Ui) {
        ui.horizontal_wrapped(|ui| {
            if let Some(session) = &mut self.session {
                // A dataset knows them at its points, a scene that is solved live where the arm is.
                let touched = match session.history.last() {
                    Some(tick) if session.loaded.knows_nodes() => Some(tick.sample.contact_nodes as usize),
                    _ => self.scene.touched().map(|(vertices, _)| vertices),
                };
                faults(ui, session);
                felt(ui, session, touched);
                if self.film.is_some() {
                    ui.separator();
                    ui.colored_label(ui.visuals().error_fg_color, RichText::new("recording").small());
                }
                self.progress_or_punctuality(ui);
                ui.separator();
            }
            self.drawn_by(ui);
        });
    }

    /// The adapter, and how many frames a second.
    fn drawn_by(&self, ui: &mut Ui) {
        let adapter = self.context.adapter();
        let rate = self.frame_rate.map_or_else(String::new, |rate| format!(", {rate:.0} frames/s"));
        let drawn = format!("drawn by {} ({}){rate}", short(&adapter.name), adapter.kind);
        ui.label(RichText::new(drawn).weak().small()).on_hover_text(format!(
            "{adapter}\nAnother adapter draws and computes where {ADAPTER_VARIABLE} is set to a part of its name or to \
             its address before haptize starts; haptize doctor lists them"
        ));
    }

    /// What is under way; otherwise how punctual the loop is.
    fn progress_or_punctuality(&self, ui: &mut Ui) {
        let Some(session) = &self.session else { return };
        if let Some(job) = &self.job {
            ui.separator();
            ui.label(RichText::new(&job.title).small());
            progress(ui, job, PROGRESS);
            return;
        }
        let coming = [
            (session.is_retuning(), "The loop is set up again …"),
            (self.scene.is_redrawing(), "The object is set up again …"),
        ];
        if let Some((_, what)) = coming.into_iter().find(|(is_coming, _)| *is_coming) {
            ui.separator();
            ui.spinner();
            ui.label(RichText::new(what).small());
            return;
        }
        let jitter = session.history.jitter.percentiles();
        let cost = session.history.cost.percentiles();
        if cost.count > 0 && self.pace == TickSource::Clock {
            let words = format!("tick {} µs, jitter {} µs at 99 %", number(cost.p50), number(jitter.p99));
            let refused = &session.history.refused;
            ui.separator();
            let label = ui.label(RichText::new(words).small());
            if !refused.is_empty() {
                label.on_hover_text(refused.join("\n"));
            }
        }
    }

    fn panels(&mut self, ui: &mut Ui) {
        let Some(session) = &mut self.session else { return };
        let size = ui.available_size();
        let side = Frame::new().fill(ui.visuals().panel_fill).inner_margin(PANEL_MARGIN);
        let (mut bake, mut edit) = (false, None);
        let share = |length: f32, [least, greatest]: [f32; 2]| (SIDE_SHARE * length).clamp(least, greatest);
        let below = share(size.y, PLOTS_RANGE);
        // In a narrow window the plots get its whole width, in a wide one C-space gets its whole height.
        let narrow = size.x < NARROW;
        let mut written = None;
        if narrow {
            written = plots_panel(ui, side, below, &mut self.plots, session, &self.files);
        }
        Panel::left("controls")
            .frame(side)
            .resizable(true)
            .default_size(CONTROLS_WIDTH)
            .size_range(CONTROLS_RANGE)
            .show(ui, |ui| {
                ScrollArea::vertical().auto_shrink([false, false]).show(ui, |ui| {
                    if let Some(placement) = &mut self.scene.placement {
                        let q = session.feel.guide().goal();
                        let place = CollapsingHeader::new("Place the object").show(ui, |ui| placement.show(ui, &q));
                        edit = place.body_returned.flatten();
                    }
                    let (controls, loaded) = (&mut session.controls, &session.loaded);
                    bake = controls.show(ui, loaded, session.advice.as_ref(), &mut self.scene.shown, &self.solvers);
                });
            });
        let right = share(size.x, SPACE_RANGE);
        Panel::right("C-space").frame(side).resizable(true).default_size(right).show(ui, |ui| {
            let q = session.history.last().map_or_else(|| session.loaded.start(), |tick| tick.proxy);
            session.configuration_space(ui, &q);
        });
        if !narrow {
            written = plots_panel(ui, side, below, &mut self.plots, session, &self.files);
        }
        let shows_steps = &mut self.shows_steps;
        CentralPanel::no_frame().show(ui, |ui| {
            if *shows_steps {
                *shows_steps = steps::show(ui, &session.loaded);
            }
            match self.scene.show(ui, &session.loaded, &session.feel, session.history.last()) {
                Ok(moved) => edit = edit.or(moved),
                Err(error) => self.error = Some(not_drawn(error)),
            }
        });
        self.solver = session.controls.solver.clone();
        let task = match (session.controls.scene.clone(), edit) {
            (Some(scene), Some(edit)) => Some(Task::Edit(scene, edit)),
            (Some(scene), None) if bake => Some(Task::Bake(scene, session.loaded.dataset.surface.clone())),
            _ => None,
        };
        written.into_iter().for_each(|written| self.told(written));
        task.into_iter().for_each(|task| self.begin(task, ui.ctx()));
    }

    /// Shows the progress of what is being opened, before there is anything to feel.
    fn welcome(&mut self, ui: &mut Ui) {
        ui.vertical_centered(|ui| {
            // Somewhat above the middle, where one looks first.
            ui.add_space(ui.available_height() / 3.0);
            match &self.job {
                Some(job) => {
                    ui.heading(&job.title);
                    let what =
                        "Contact is solved at every point of the grid over the joints, once; then it is felt at 1 kHz.";
                    ui.label(RichText::new(what).weak());
                    ui.add_space(GROUP_GAP);
                    let size = vec2(WIDE_PROGRESS + LONE_BUTTON.x, LONE_BUTTON.y);
                    ui.allocate_ui(size, |ui| ui.horizontal(|ui| progress(ui, job, WIDE_PROGRESS)));
                }
                None => {
                    ui.heading("Nothing is open");
                    ui.label(RichText::new("Open a scene or a dataset, or drop one on this window.").weak());
                    ui.add_space(GROUP_GAP);
                    if ui.button("Open…").clicked() {
                        self.files.toggle();
                    }
                }
            }
        });
    }

    fn complaint(&mut self, ui: &Ui) {
        let Some(error) = &self.error else { return };
        let mut dismissed = false;
        egui::Window::new("This did not work")
            .collapsible(false)
            .resizable(false)
            .anchor(egui::Align2::CENTER_CENTER, vec2(0.0, 0.0))
            .show(ui.ctx(), |ui| {
                ui.set_max_width(MESSAGE_WIDTH);
                // Messages point at a line with a caret: that needs letters of one width.
                let text = RichText::new(error).color(ui.visuals().error_fg_color);
                ui.label(if error.contains('\n') { text.monospace() } else { text });
                ui.add_space(GROUP_GAP);
                dismissed = ui.add_sized(LONE_BUTTON, Button::new("Dismiss")).clicked();
            });
        if dismissed {
            self.error = None;
        }
    }

    fn save(&mut self) {
        let Some(session) = &self.session else { return };
        let saved = match (&session.loaded.scene, &session.loaded.report) {
            (Some(scene), _) if self.is_unsaved => {
                let written = rewrite_file(&scene.path, &self.scene_text, &scene.text);
                let written = written.map_err(|error| format!("cannot write {}: {error}", scene.path.display()));
                written.map(|()| {
                    self.scene_text.clone_from(&scene.text);
                    scene.path.clone()
                })
            }
            (_, Some(_)) => {
                let file = self.files.fresh(&session.loaded.name, "haptize");
                session.loaded.dataset.save(&file).map(|()| file).map_err(|error| error.to_string())
            }
            _ => return,
        };
        if let Ok(file) = &saved {
            self.is_unsaved = false;
            self.files.remember(file);
        }
        self.told(saved.map(|file| format!("wrote {}", file.display())));
    }
}

/// Name of what is open, in at most `width` points, and its file.
fn name(ui: &mut Ui, loaded: &Loaded, width: f32) {
    let text = RichText::new(&loaded.name).weak();
    let whole =
        ui.painter().layout_no_wrap(loaded.name.clone(), TextStyle::Body.resolve(ui.style()), Color32::PLACEHOLDER);
    let size = vec2(whole.size().x.min(width), whole.size().y);
    let shown = ui.add_sized(size, Label::new(text).truncate());
    if let Some(file) = &loaded.file {
        shown.on_hover_text(file.display().to_string());
    }
}

/// Lists the actions of pointer and keys.
fn help(ui: &mut Ui) {
    Grid::new("help").spacing(vec2(GROUP_GAP, GAP)).show(ui, |ui| {
        for (how, what) in steering::HELP.into_iter().chain(plots::HELP) {
            ui.strong(how);
            ui.label(what);
            ui.end_row();
        }
    });
}

/// Shows the plots, and returns where files were written, if they were, or why not.
fn plots_panel(
    ui: &mut Ui,
    frame: Frame,
    height: f32,
    plots: &mut Plots,
    session: &mut Session,
    files: &Files,
) -> Option<Result<String, String>> {
    let panel = Panel::bottom("plots").frame(frame).resizable(true).default_size(height);
    let asked = panel.show(ui, |ui| plots.show(ui, &session.loaded, &mut session.history, files)).inner;
    if asked.hold_still {
        session.history.hold_still(&mut session.feel);
    }
    asked.written
}

/// Says which device leads, and presses its dead-man key while the space bar is held.
fn led(ui: &mut Ui, lead: &Lead) {
    ui.label(RichText::new(format!("led by {}", lead.description)).weak());
    if let Some(caution) = lead.caution {
        ui.colored_label(ui.visuals().warn_fg_color, "no watchdog").on_hover_text(caution);
    }
    if let Some(key) = &lead.key {
        ui.label("hold the space bar for torque");
        if ui.input(|input| input.focused && input.key_down(egui::Key::Space)) {
            key.press();
        }
    }
}

/// Motions of the scene: choose, play, pause, scrub.
fn motions(ui: &mut Ui, guide: &mut Guide) {
    let names = guide.names();
    if names.is_empty() {
        ui.label(RichText::new("drag the proxy by one of its nodes").weak());
        return;
    }
    let mut chosen = guide.playing();
    if ui.selectable_label(chosen.is_none(), "Pointer").on_hover_text("Drag the proxy by one of its nodes").clicked() {
        let goal = guide.goal();
        guide.point(goal);
    }
    for (number, name) in names.iter().enumerate() {
        let title = format!("{}{}", name[..1].to_uppercase(), &name[1..]);
        let what = "The hand follows this motion of the scene, over and over";
        if ui.selectable_label(chosen == Some(number), title).on_hover_text(what).clicked() {
            guide.play(number);
            chosen = Some(number);
        }
    }
    if let (Some((mut time, duration)), true) = (guide.time(), chosen.is_some()) {
        let text = if guide.is_running() { "Pause" } else { "Play" };
        if ui.add_sized(vec2(PAUSE_WIDTH, ui.spacing().interact_size.y), Button::new(text)).clicked() {
            guide.toggle();
        }
        ui.spacing_mut().slider_width = (ui.available_width() - TIME_WIDTH).clamp(LEAST_MOTION, MOTION_WIDTH);
        let slider = Slider::new(&mut time, 0.0..=duration).show_value(false);
        let response = ui.add(slider);
        response.widget_info(|| egui::WidgetInfo::slider(true, time, "Time in the motion"));
        if response.changed() {
            guide.scrub(time);
        }
        ui.label(RichText::new(format!("{time:.1} of {duration:.1} s")).weak());
    }
}

fn progress(ui: &mut Ui, job: &Job, width: f32) {
    let done = job.progress;
    let share = if done.points > 0 { done.done as f32 / done.points as f32 } else { 0.0 };
    let text = if done.points == 0 {
        "preparing".to_owned()
    } else if done.rate > 0.0 {
        format!("{} of {}, {:.0} s left", done.done, done.points, (done.points - done.done) as f64 / done.rate)
    } else {
        format!("{} of {}", done.done, done.points)
    };
    let bar = ProgressBar::new(share).desired_width(width).desired_height(PROGRESS_HEIGHT);
    ui.add(bar.text(RichText::new(text).small()));
    if ui.button("Cancel").clicked() {
        job.cancel();
    }
}

/// Why there is no torque, if there is none.
fn faults(ui: &mut Ui, session: &mut Session) {
    let Some(&Tick { fault, applied, .. }) = session.history.last() else { return };
    let colour = ui.visuals().error_fg_color;
    if let Some(fault) = fault {
        // First, so that it can be hit however long the reason.
        if ui.small_button("Clear fault").clicked() {
            session.feel.clear_fault();
        }
        ui.colored_label(colour, RichText::new(fault.to_string()).small());
        ui.separator();
    }
    if let (Some(halt), Some(_)) = (applied.halt, &session.lead) {
        ui.colored_label(colour, RichText::new(format!("no torque: {halt}")).small());
        ui.separator();
    }
}

/// What is touched, how much of its dent stays, and how it is solved. `touched`: vertices in contact, where they are
/// known.
fn felt(ui: &mut Ui, session: &mut Session, touched: Option<usize>) {
    let Some(tick) = session.history.last() else { return };
    let mut contact = contact(tick, touched);
    let held = tick.flags.contains(Flags::HELD);
    let began_inside = tick.sample.contact && !session.history.was_free;
    if began_inside {
        contact += " since the session began: with the closest surface, from whichever side the arm came";
    }
    let colour = if held || began_inside { ui.visuals().error_fg_color } else { ui.visuals().text_color() };
    if held {
        let gains = &session.controls.tuning.haptics;
        contact += &format!(", Kvc {}", border_stiffness(gains, &session.loaded.dataset.grid));
    }
    ui.colored_label(colour, RichText::new(contact).small());
    if let Some(dent) = tick.dent {
        ui.separator();
        ui.label(RichText::new(format!("dent {:.0} %", 100.0 * dent)).small())
            .on_hover_text("What would stay of the dent if the arm let go now, or is left since it did");
    }
    if session.loaded.setup.haptics.source().twinned().is_some() {
        ui.separator();
        ui.label(RichText::new(format!("twin {:.0} %", 100.0 * tick.sample.twin)).small()).on_hover_text(
            "The part of the torque that the twin answers, where nothing was measured; it is what is drawn",
        );
    }
    if let Some(scene) = &session.loaded.live {
        ui.separator();
        let text = scene.notice().unwrap_or("contact is solved in every tick, before the surface at rest");
        ui.label(RichText::new("solved live").small()).on_hover_text(text);
    }
}

fn bar(ui: &Ui) -> Frame {
    Frame::new().fill(ui.visuals().panel_fill).inner_margin(BAR_MARGIN)
}

/// Returns the state of contact in words. `touched`: vertices in contact, where they are known.
fn contact(tick: &Tick, touched: Option<usize>) -> String {
    match (tick.sample.contact, touched) {
        _ if tick.flags.contains(Flags::HELD) => "held at the border of the haptized range".into(),
        (false, _) if tick.flags.contains(Flags::OUTSIDE) => "free, outside the haptized range".into(),
        (false, _) => "free".into(),
        (true, Some(1)) => "1 vertex in contact".into(),
        (true, Some(touched)) => format!("{touched} vertices in contact"),
        (true, None) => "in contact, vertices not known".into(),
    }
}
