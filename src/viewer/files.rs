//! The chooser of scenes and datasets: what was opened before, and the folders of this machine. Files can be dropped on
//! the window as well.

use super::theme::{CHOOSER, FIELD_WIDTH, GROUP_GAP, LIST_HEIGHT};
use crate::dataset::replace_file;
use eframe::egui::{self, Key, RichText, ScrollArea, TextEdit, Ui};
use std::{
    fs,
    io::Write,
    path::{self, Path, PathBuf},
};

/// The chooser; shown while it is open.
pub struct Files {
    /// Whether it is shown.
    pub open: bool,
    folder: PathBuf,
    typed: String,
    recent: Vec<PathBuf>,
    /// Where that list is kept from one window to the next, if it is.
    kept: Option<PathBuf>,
    listing: Result<Vec<Entry>, String>,
}

struct Entry {
    name: String,
    path: PathBuf,
    folder: bool,
}

/// Files opened before that are kept.
const RECENT: usize = 6;

impl Files {
    /// Looks at `folder`.
    #[must_use]
    pub fn new(folder: PathBuf) -> Self {
        Self { open: false, typed: String::new(), recent: Vec::new(), kept: None, listing: list(&folder), folder }
    }

    /// Keeps the list of files in `list` from now on, a path a line; answers whether there was one.
    pub fn keep_in(&mut self, list: PathBuf) -> bool {
        let known = fs::read_to_string(&list);
        self.recent = known.iter().flat_map(|known| known.lines()).take(RECENT).map(PathBuf::from).collect();
        self.kept = Some(list);
        known.is_ok()
    }

    /// The folder that it looks at, where exports go too.
    #[must_use]
    pub fn folder(&self) -> &Path {
        &self.folder
    }

    /// Returns a file of the folder that is not there yet: `name` and the extension, with a number between them where
    /// needed. Returns `name` with a hyphen for every character that is no letter, digit, dot or underscore.
    #[must_use]
    pub fn fresh(&self, name: &str, extension: &str) -> PathBuf {
        let is_plain = |c: char| c.is_alphanumeric() || c == '_' || c == '.';
        let name: String = name.chars().map(|c| if is_plain(c) { c } else { '-' }).collect();
        let name = if name.trim_matches(['.', '-']).is_empty() { "haptize" } else { &name };
        let names = std::iter::once(name.to_owned()).chain((2..).map(|number| format!("{name}-{number}")));
        let mut files = names.map(|name| self.folder.join(format!("{name}.{extension}")));
        files.find(|file| file.symlink_metadata().is_err()).unwrap_or_default()
    }

    /// Remembers that `file` was opened.
    pub fn remember(&mut self, file: &Path) {
        // Another window may be opened elsewhere.
        let file = path::absolute(file).unwrap_or_else(|_| file.to_owned());
        self.recent.retain(|known| *known != file);
        self.recent.insert(0, file);
        self.recent.truncate(RECENT);
        if let Some(list) = &self.kept {
            let lines: String = self.recent.iter().map(|file| format!("{}\n", file.display())).collect();
            // A comfort: where it cannot be kept, it is not.
            let folder = list.parent().map_or(Ok(()), fs::create_dir_all);
            let _ = folder.and_then(|()| replace_file(list, |out| out.write_all(lines.as_bytes())));
        }
    }

    /// Opens or closes the chooser; what lies in the folder is read again.
    pub fn toggle(&mut self) {
        self.open = !self.open;
        self.enter(self.folder.clone());
    }

    fn enter(&mut self, folder: PathBuf) {
        self.listing = list(&folder);
        self.folder = folder;
    }

    /// The chooser, if it is open; answers with the file that was chosen.
    pub fn show(&mut self, ui: &Ui) -> Option<PathBuf> {
        let (mut open, mut chosen, mut entered) = (self.open, None, None);
        egui::Window::new("Open a scene or a dataset")
            .open(&mut open)
            .collapsible(false)
            .resizable(false)
            .default_size(CHOOSER)
            .anchor(egui::Align2::CENTER_CENTER, egui::Vec2::ZERO)
            .show(ui.ctx(), |ui| {
                ui.label(
                    RichText::new("A scene (.toml) or a dataset (.haptize); a file dropped on the window does as well")
                        .weak(),
                );
                ui.horizontal(|ui| {
                    let label = ui.label("Path");
                    let field = TextEdit::singleline(&mut self.typed).hint_text("type or paste a path");
                    let response = ui.add(field.desired_width(FIELD_WIDTH)).labelled_by(label.id);
                    let entered_key = response.lost_focus() && ui.input(|input| input.key_pressed(Key::Enter));
                    if (ui.button("Open").clicked() || entered_key) && !self.typed.trim().is_empty() {
                        chosen = Some(PathBuf::from(self.typed.trim()));
                    }
                });
                if !self.recent.is_empty() {
                    ui.add_space(GROUP_GAP);
                    ui.strong("Recent");
                    for file in &self.recent {
                        if ui.link(file.display().to_string()).clicked() {
                            chosen = Some(file.clone());
                        }
                    }
                }
                ui.add_space(GROUP_GAP);
                ui.horizontal(|ui| {
                    ui.strong("Folder");
                    if ui.button("Up").clicked() {
                        entered = self.folder.parent().map(Path::to_owned);
                    }
                    ui.add(egui::Label::new(RichText::new(self.folder.display().to_string()).weak()).truncate());
                });
                match &self.listing {
                    Err(reason) => {
                        ui.colored_label(ui.visuals().error_fg_color, reason);
                    }
                    Ok(entries) if entries.is_empty() => {
                        ui.label(RichText::new("no scene or dataset here").weak());
                    }
                    Ok(entries) => {
                        let list = ScrollArea::vertical().max_height(LIST_HEIGHT).auto_shrink([false, true]);
                        list.show(ui, |ui| {
                            for entry in entries {
                                let text = if entry.folder { format!("{}/", entry.name) } else { entry.name.clone() };
                                if ui.selectable_label(false, text).clicked() {
                                    let target = if entry.folder { &mut entered } else { &mut chosen };
                                    *target = Some(entry.path.clone());
                                }
                            }
                        });
                    }
                }
            });
        self.open = open && chosen.is_none();
        if let Some(folder) = entered {
            self.enter(folder);
        }
        chosen
    }
}

/// Folders, scenes and datasets in `folder`, by name.
fn list(folder: &Path) -> Result<Vec<Entry>, String> {
    let unreadable = |error| format!("{}: {error}; choose another folder", folder.display());
    let mut entries: Vec<Entry> = fs::read_dir(folder)
        .map_err(unreadable)?
        .filter_map(|entry| {
            let path = entry.ok()?.path();
            let name = path.file_name()?.to_string_lossy().into_owned();
            let folder = path.is_dir();
            let wanted = path.extension().is_some_and(|ending| ending == "toml" || ending == "haptize");
            (!name.starts_with('.') && (folder || wanted)).then_some(Entry { name, path, folder })
        })
        .collect();
    entries.sort_by(|a, b| (!a.folder, &a.name).cmp(&(!b.folder, &b.name)));
    Ok(entries)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_saved_replaces_nothing() {
        let folder = tempfile::tempdir().unwrap();
        let files = Files::new(folder.path().to_owned());
        for expected in ["a-b-c.haptize", "a-b-c-2.haptize", "a-b-c-3.haptize"] {
            let file = files.fresh("a/b c", "haptize");
            assert_eq!(file, folder.path().join(expected));
            std::fs::write(file, "").unwrap();
        }
        for name in ["", "..", "../../x", "\u{1b}[2J", "-"] {
            let file = files.fresh(name, "csv");
            assert_eq!(file.parent(), Some(folder.path()), "{name:?}");
            std::fs::write(file, "").unwrap();
        }
    }

    #[test]
    fn a_folder_lists_folders_then_scenes_and_datasets_only() {
        let folder = tempfile::tempdir().unwrap();
        for file in ["b.toml", "a.haptize", "c.txt", ".hidden.toml"] {
            std::fs::write(folder.path().join(file), "").unwrap();
        }
        std::fs::create_dir(folder.path().join("z")).unwrap();
        let names: Vec<String> = list(folder.path()).unwrap().into_iter().map(|entry| entry.name).collect();
        assert_eq!(names, ["z", "a.haptize", "b.toml"]);
        assert!(list(&folder.path().join("none")).is_err());
    }

    #[test]
    fn the_latest_files_come_first_and_once() {
        let folder = tempfile::tempdir().unwrap();
        let list = folder.path().join("haptize/recent");
        let mut files = Files::new(PathBuf::from("."));
        assert!(!files.keep_in(list.clone()), "there is none before the first window");
        for name in ["/a", "/b", "/a", "/c"] {
            files.remember(Path::new(name));
        }
        // The next window knows them.
        let mut next = Files::new(PathBuf::from("."));
        assert!(next.keep_in(list));
        for files in [files, next] {
            assert_eq!(files.recent, [Path::new("/c"), Path::new("/a"), Path::new("/b")]);
        }
    }
}
