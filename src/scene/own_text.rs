//! A scene's text brought to what the scene has become, so that a dataset's scene says what was baked.

use super::contact::LAW_KEYS;
use super::{AxisSpec, ContactLaw, Scene};
use crate::Error;
use toml::{Table, Value};

impl Scene {
    /// The same scene with a text that gives its grid, its interpolation, and law and tolerance of its contact as they
    /// are now, whatever they were read as. Comments are lost.
    ///
    /// # Errors
    /// When that makes no scene.
    pub fn with_own_text(&self) -> Result<Self, Error> {
        let mut text: Table = self.text.parse().unwrap_or_default();
        let axis = |axis: &AxisSpec| {
            let mut table = Table::new();
            table.insert("start".into(), axis.start.into());
            table.insert("step".into(), axis.step.into());
            table.insert("count".into(), Value::Integer(axis.count as i64));
            Value::Table(table)
        };
        let mut grid = Table::new();
        grid.insert("axes".into(), Value::Array(self.grid.axes.iter().map(axis).collect()));
        text.insert("grid".into(), grid.into());
        let mut set = |table: &str, key: &str, value: Value| {
            let table = text.entry(table).or_insert_with(|| Value::Table(Table::new()));
            if let Some(table) = table.as_table_mut() {
                table.insert(key.into(), value);
            }
        };
        set("haptics", "interpolation", self.haptics.interpolation.name().into());
        set("contact", "tolerance", self.contact.tolerance.into());
        let law = self.contact.law.name().into();
        if let Some(contact) = text.get_mut("contact").and_then(Value::as_table_mut) {
            contact.retain(|key, _| !LAW_KEYS.contains(&key));
            contact.insert(LAW_KEYS[0].into(), law);
            contact.retain(|key, _| key != "round" || self.contact.law == ContactLaw::Rest);
        }
        let Self { text, grid, haptics, contact, .. } = Self::parse(&text.to_string(), &self.path)?;
        Ok(Self { text, grid, haptics, contact, ..self.clone() })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Interpolation;

    #[test]
    fn the_text_says_what_the_scene_has_become() {
        let mut scene = Scene::parse(include_str!("../../tests/scenes/sphere.toml"), "sphere.toml").unwrap();
        scene.grid.axes[0] = AxisSpec { start: -0.9, step: 0.1 / 3.0, count: 9 };
        scene.grid.axes[1].count = 9;
        scene.grid.axes[2].count = 13;
        scene.contact.tolerance = 3e-5;
        scene.haptics.interpolation = Interpolation::Potential;
        for law in [ContactLaw::Rest, ContactLaw::Following] {
            scene.contact.law = law;
            assert_eq!(scene.with_own_text().unwrap().contact, scene.contact);
        }
        let own = scene.with_own_text().unwrap();
        assert_eq!(Scene { text: String::new(), ..own.clone() }, Scene { text: String::new(), ..scene.clone() });
        assert_eq!(Scene::parse(&own.text, "sphere.toml").unwrap(), own);
        assert_ne!(Scene::parse(&scene.text, "sphere.toml").unwrap().grid, own.grid);
    }
}
