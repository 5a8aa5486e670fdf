//! The 3-D picture over time, as a GIF or as a folder of PNG files. Another thread writes it.

use super::background::Pending;
use crate::{Error, dataset::replace_file, draw::canvas::encode_png, error};
use std::{
    fs, io,
    path::{Path, PathBuf},
    sync::mpsc,
};

/// A picture: pixels across and down, and red, green, blue, opacity of each, row by row.
pub type Still = ([u32; 2], Vec<u8>);

/// A film that is being taken.
pub struct Film {
    stills: mpsc::SyncSender<Still>,
    written: Pending<Result<PathBuf, Error>>,
    size: Option<[u32; 2]>,
    /// Time since the last still (s).
    since: f64,
}

/// Hundredths of a second between two stills, the unit of a GIF: every viewer keeps this pace.
const DELAY: u16 = 8;

/// The same (s).
pub const PERIOD: f64 = 0.01 * DELAY as f64;

/// How coarsely colours of a GIF are chosen, from 1 to 30: at ten an eye sees no other.
const COARSENESS: i32 = 10;

/// Stills that wait to be written; a window that takes more waits.
const WAITING: usize = 32;

impl Film {
    /// Begins a film at `path`, a GIF where the name ends so, else a folder, which must not be there. `wake` is called
    /// when it is written.
    ///
    /// # Errors
    /// In words, when the system gives no thread.
    pub fn begin(path: PathBuf, wake: impl FnOnce() + Send + 'static) -> Result<Self, String> {
        let (stills, taken) = mpsc::sync_channel(WAITING);
        let written = Pending::begin("film", move || write(&path, &taken).map(|()| path), wake)?;
        // The first still is due at once.
        Ok(Self { stills, written, size: None, since: PERIOD })
    }

    /// Whether another still is due, `elapsed` (s) after the last question.
    pub fn is_due(&mut self, elapsed: f64) -> bool {
        self.since += elapsed;
        let is_due = self.since >= PERIOD - 0.5 * elapsed;
        if is_due {
            self.since = 0.0;
        }
        is_due
    }

    /// Takes a still. One of another size than the first is left out: all of a film are alike.
    pub fn take(&mut self, still: Still) {
        if *self.size.get_or_insert(still.0) == still.0 {
            // A writer that ended has its reason, which is told in the end.
            let _ = self.stills.send(still);
        }
    }

    /// Ends it; answers with its file once it is written, or why it was not.
    #[must_use]
    pub fn end(self) -> Pending<Result<PathBuf, Error>> {
        self.written
    }
}

fn write(path: &Path, taken: &mpsc::Receiver<Still>) -> Result<(), Error> {
    let refused = |why: io::Error| error!("cannot write {}: {why}; choose another place", path.display());
    if !path.extension().is_some_and(|extension| extension.eq_ignore_ascii_case("gif")) {
        fs::create_dir(path).map_err(refused)?;
        for (number, (size, bytes)) in taken.iter().enumerate() {
            let still = path.join(format!("{:04}.png", number + 1));
            replace_file(&still, |file| encode_png(file, size, png::ColorType::Rgba, &bytes).map_err(io::Error::other))
                .map_err(refused)?;
        }
        return Ok(());
    }
    let Ok(first) = taken.recv() else { return Err(error!("{}: nothing was recorded", path.display())) };
    let [width, height] = first.0.map(|side| u16::try_from(side).unwrap_or(u16::MAX));
    let written = replace_file(path, |file| {
        let mut encoder = gif::Encoder::new(file, width, height, &[]).map_err(io::Error::other)?;
        encoder.set_repeat(gif::Repeat::Infinite).map_err(io::Error::other)?;
        encoder.write_raw_extension(gif::Extension::Comment.into(), &[b"haptize"]).map_err(io::Error::other)?;
        for (_, mut bytes) in std::iter::once(first).chain(taken.iter()) {
            let mut frame = gif::Frame::from_rgba_speed(width, height, &mut bytes, COARSENESS);
            frame.delay = DELAY;
            encoder.write_frame(&frame).map_err(io::Error::other)?;
        }
        Ok(())
    });
    written.map_err(refused)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A film of three plain pictures, and one of another size.
    fn film(path: PathBuf) -> Result<PathBuf, Error> {
        let mut film = Film::begin(path, || ()).unwrap();
        for shade in [0, 100, 200] {
            film.take(([4, 3], [shade, 0, 0, 255].repeat(12)));
        }
        film.take(([2, 2], vec![255; 16]));
        film.end().wait().unwrap()
    }

    #[test]
    fn a_film_is_a_gif_or_a_folder_and_has_all_its_stills() {
        let folder = tempfile::tempdir().unwrap();
        let file = film(folder.path().join("a.gif")).unwrap();
        let mut decoder = gif::DecodeOptions::new();
        decoder.set_color_output(gif::ColorOutput::RGBA);
        let mut decoder = decoder.read_info(fs::File::open(&file).unwrap()).unwrap();
        assert_eq!((decoder.width(), decoder.height()), (4, 3));
        for shade in [0_u8, 100, 200] {
            let frame = decoder.read_next_frame().unwrap().unwrap();
            assert_eq!(frame.delay, DELAY);
            assert!(frame.buffer[0].abs_diff(shade) < 4, "{} is not {shade}", frame.buffer[0]);
        }
        assert!(decoder.read_next_frame().unwrap().is_none());
        // So that another may take its place.
        assert!(fs::read(&file).unwrap().windows(7).any(|part| part == b"haptize"));
        let stills = film(folder.path().join("b")).unwrap();
        assert_eq!(fs::read_dir(&stills).unwrap().count(), 3);
        // What is there stays.
        assert!(film(stills).unwrap_err().to_string().contains("cannot write"));
    }

    #[test]
    fn stills_are_due_at_their_pace_whatever_the_windows() {
        for elapsed in [0.01, 0.02, 0.05, 0.08] {
            let mut film = Film::begin(PathBuf::from("never.gif"), || ()).unwrap();
            let frames = (4.0 / elapsed) as usize;
            let due = (0..frames).filter(|_| film.is_due(elapsed)).count() as f64;
            let expected = 4.0 / (elapsed * (PERIOD / elapsed).round());
            assert!((due - expected).abs() <= 1.0, "{due} stills at {elapsed} s, not {expected}");
        }
    }
}
