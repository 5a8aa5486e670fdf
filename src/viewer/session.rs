//! A dataset being felt: its haptic loop, what was felt lately, and the panels that belong to it alone.

use super::{
    background::Following,
    cloud::Cloud,
    controls::Controls,
    feel::{Feel, TickSource},
    guide::Guide,
    history::History,
    lead::{DeviceChoice, Lead},
    loaded::Loaded,
    slices::Slices,
    theme::{FINE_GAP, GAP, PLANE_SHARE, ROOM_FOR_BOTH},
};
use crate::{
    Error, JointVector,
    render::{flags::Fault, haptic::Haptics, passivity::Advice},
    scene::HapticsSpec,
};
use eframe::egui::Ui;
use std::sync::Arc;

/// A dataset being felt.
pub struct Session {
    pub loaded: Loaded,
    pub feel: Feel,
    pub history: History,
    /// The haptic device that leads; none where pointer, keys or motions do.
    pub lead: Option<Lead>,
    pace: TickSource,
    /// The loop with the gains that the controls have, made in the background.
    retuning: Following<HapticsSpec, Result<Tuned, Error>>,
    slices: Slices,
    cloud: Cloud,
    pub controls: Controls,
    /// A warning about the gains, if they are beyond their passivity bounds.
    pub advice: Option<Advice>,
    /// Whether the cloud is shown where there is no height for plane and cloud.
    cloud_first: bool,
}

/// A loop, and what is wrong with its gains.
type Tuned = (Arc<Haptics>, Option<Advice>);

impl Session {
    /// Begins to feel `loaded`, with `device` where one is chosen.
    ///
    /// # Errors
    /// In words, when it cannot be felt as the scene has it, or with that device.
    pub fn new(loaded: Loaded, pace: TickSource, device: Option<&DeviceChoice>) -> Result<Self, String> {
        let controls = Controls::new(&loaded);
        let gains = controls.tuning.haptics.clone();
        let haptics = Arc::clone(&loaded.setup.haptics);
        let history = History::new(haptics.period()).ok_or("no memory for histograms; close other programs")?;
        let mut guide = Guide::new(&loaded);
        let (device, lead) = device.map(|device| device.open(&loaded)).transpose()?.unzip();
        if lead.is_some() {
            guide.hand_over();
        }
        let feel = Feel::start(haptics, &gains, guide, pace, device)?;
        let (slices, cloud) = (Slices::new(&loaded.dataset), Cloud::new(&loaded.dataset));
        let advice = loaded.setup.advice.clone();
        let retuning = Following::new(Some(gains));
        Ok(Self { loaded, feel, history, lead, pace, retuning, slices, cloud, controls, advice, cloud_first: false })
    }

    /// Plane and cloud of C-space, one below the other, or one of them where there is no height for both.
    /// A scene that is solved live has nothing to show there, and says what would fill them.
    pub fn configuration_space(&mut self, ui: &mut Ui, q: &JointVector) {
        if self.loaded.live.is_some() {
            ui.heading("C-space");
            ui.add_space(GAP);
            ui.label("Contact is solved live, in every tick, and nothing is stored. Bake the scene to see it over its grid here.");
            return;
        }
        let both = ui.available_height() > ROOM_FOR_BOTH;
        ui.horizontal(|ui| {
            ui.heading("C-space");
            if !both {
                ui.selectable_value(&mut self.cloud_first, false, "Plane");
                ui.selectable_value(&mut self.cloud_first, true, "Cloud");
            }
        });
        if both || !self.cloud_first {
            let height = if both { PLANE_SHARE * ui.available_height() } else { ui.available_height() };
            self.slices.show(ui, &self.loaded, q, &self.history, height);
            ui.add_space(GAP);
        }
        if both || self.cloud_first {
            let height = ui.available_height() - FINE_GAP;
            self.cloud.show(ui, &self.loaded, q, height);
        }
    }

    /// Lets a loop that was held up go on by itself where no device is led by it: there is nobody whom it could hurt.
    pub fn go_on_without_a_device(&mut self) {
        use Fault::{Late, Overrun, Stale, Unsolved};
        let fault = self.history.last().and_then(|tick| tick.fault);
        if self.lead.is_none() && matches!(fault, Some(Late | Overrun | Stale | Unsolved)) {
            self.feel.clear_fault();
        }
    }

    /// Whether gains or effects were changed that are not felt yet.
    #[must_use]
    pub fn is_retuning(&self) -> bool {
        self.retuning.is_busy()
    }

    /// Lets the loop follow gains and effects of the controls. It is made in the background, for the energies of a
    /// million points take seconds to interpolate; what is felt stays until then. `wake` is called when there is news.
    ///
    /// # Errors
    /// In words, when they do not make a loop; the last one goes on.
    pub fn follow(&mut self, wake: impl FnOnce() + Send + 'static) -> Result<(), String> {
        let loaded = self.loaded.clone();
        let gains = &self.controls.tuning.haptics;
        let made = self.retuning.follow(gains, "tuning", move |gains| loaded.tuned(gains), wake)?;
        made.map_or(Ok(()), |made| self.go_on(made))
    }

    /// Plays motion `number` from its beginning, where hand and proxy are put: for pictures, which have no past.
    ///
    /// # Errors
    /// In words, when the loop cannot be started.
    pub fn begin(&mut self, number: usize) -> Result<(), String> {
        self.feel.guide().begin(number);
        self.go_on(Ok((Arc::clone(&self.loaded.setup.haptics), self.advice.clone())))
    }

    /// Goes on with another loop, the hand where it is.
    fn go_on(&mut self, made: Result<Tuned, Error>) -> Result<(), String> {
        let (haptics, advice) = made.map_err(|error| error.to_string())?;
        let guide = self.feel.guide().clone();
        self.history.collect(&mut self.feel);
        let device = match &self.lead {
            // There is one of it: the last loop ends first.
            Some(lead) => {
                Some(self.feel.end().ok_or_else(|| format!("{} is lost: open the file again", lead.description))?)
            }
            None => None,
        };
        self.feel = Feel::start(haptics, &self.controls.tuning.haptics, guide, self.pace, device)?;
        self.history.begin_anew();
        self.advice = advice;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{
        scene::{Interpolation, Scene},
        sweep::baked,
    };
    use std::{sync::mpsc, thread, time::Duration};

    /// Follows the controls until the loop has their gains.
    fn settle(session: &mut Session) -> Result<(), String> {
        session.follow(|| ())?;
        while session.is_retuning() {
            thread::sleep(Duration::from_millis(1));
            session.follow(|| ())?;
        }
        Ok(())
    }

    #[test]
    fn what_is_felt_stays_until_another_loop_is_made() {
        let text = include_str!("../../tests/scenes/sphere.toml").replace("count = 36", "count = 3");
        let scene = Scene::parse(&text, "sphere.toml").unwrap();
        let loaded = Loaded::new(baked(&scene).unwrap().0, None, None).unwrap();
        let mut session = Session::new(loaded, TickSource::Steps, None).unwrap();
        let (open, gate) = mpsc::channel::<()>();
        let other = HapticsSpec { interpolation: Interpolation::Potential, ..session.controls.tuning.haptics.clone() };
        session.controls.tuning.haptics = other.clone();
        let loaded = session.loaded.clone();
        let slowly = move |gains: &HapticsSpec| {
            gate.recv().unwrap();
            loaded.tuned(gains)
        };
        assert!(session.retuning.follow(&other, "slow", slowly, || ()).unwrap().is_none());
        // The loop goes on while another one is made.
        for _ in 0..3 {
            session.follow(|| ()).unwrap();
            session.feel.step(10);
            session.history.collect(&mut session.feel);
        }
        assert!(session.is_retuning());
        let last = session.history.last().unwrap().time;
        assert!((last - 0.029).abs() < 1e-9, "{last}");
        open.send(()).unwrap();
        settle(&mut session).unwrap();
        session.feel.step(10);
        session.history.collect(&mut session.feel);
        // Its time goes on where the last one's ended.
        let ticks: Vec<f64> = session.history.recent(1.0, 100).map(|tick| tick.time).collect();
        assert!(ticks.len() == 40 && ticks.windows(2).all(|pair| (pair[1] - pair[0] - 1e-3).abs() < 1e-9), "{ticks:?}");
        // What does not make a loop is reported once, and the last one goes on.
        session.controls.tuning.haptics.boundary_slope[0] = -1.0;
        session.controls.tuning.haptics.interpolation = Interpolation::Linear;
        assert!(settle(&mut session).unwrap_err().contains("slope"));
        settle(&mut session).unwrap();
        session.feel.step(1);
    }
}
