//! The folder of a benchmark: results, images and the page, complete after every run.

use std::path::{Path, PathBuf};

use super::case::Case;
use super::cell::Ran;
use super::record::Results;
use crate::error::{Error, Result};
use crate::image::{Image, io};
use crate::reference::fingerprint;

/// The folder.
pub struct Store {
    folder: PathBuf,
    /// What is in it.
    pub results: Results,
}

impl Store {
    /// Opens a folder, which is made if it is not there. Results that are there already must be meant to be gone on
    /// with.
    pub fn open(folder: &Path, resume: bool) -> Result<Self> {
        std::fs::create_dir_all(folder.join("images")).map_err(|error| Error::io(folder, error))?;
        let file = folder.join("results.json");
        let results = if file.exists() { Results::load(&file)? } else { Results::default() };
        if !resume && !results.records.is_empty() {
            let what = "holds results already: add --resume to go on with them, or name another folder";
            return Err(Error::io(folder, what));
        }
        let store = Self { folder: folder.to_owned(), results };
        // Better now than after the first hour.
        store.save()?;
        Ok(store)
    }

    /// Whether a run is there. One of the same name on another scene or at another size is an error.
    pub fn has(&self, case: &Case, method: &str, budget: &str, seed: u64) -> Result<bool> {
        let Some(record) = self.results.records.iter().find(|record| record.is(&case.name, method, budget, seed))
        else {
            return Ok(false);
        };
        let size = (case.truth.image.width, case.truth.image.height);
        if record.fingerprint != fingerprint(&case.scene) || (record.width, record.height) != size {
            let what = format!("holds results of another version or size of {}: name another folder", case.name);
            return Err(Error::io(&self.folder, what));
        }
        Ok(true)
    }

    /// Writes the results.
    pub fn save(&self) -> Result<()> {
        self.write("results.json", &self.results.json()?)?;
        self.write("results.csv", &self.results.csv()?)
    }

    /// Adds a run. The images of the first seed are kept.
    pub fn add(&mut self, ran: Ran) -> Result<()> {
        let Ran { record, image } = ran;
        if record.seed == 1 {
            io::write_color(&self.image_file(&record.scene, &record.method, &record.budget), &image, None, &[])?;
        }
        self.results.records.push(record);
        self.save()
    }

    fn image_file(&self, scene: &str, method: &str, budget: &str) -> PathBuf {
        let method = method.replace([':', '=', ',', '/'], "_");
        self.folder.join("images").join(format!("{scene}-{method}-{budget}.exr"))
    }

    /// The image of a run, if it was kept.
    pub fn image(&self, scene: &str, method: &str, budget: &str) -> Option<Image> {
        io::read_color(&self.image_file(scene, method, budget)).ok()
    }

    /// Puts a file into the folder, in the place of an older one at once.
    pub fn write(&self, name: &str, text: &str) -> Result<()> {
        let (part, file) = (self.folder.join(format!("{name}.part")), self.folder.join(name));
        let written = std::fs::write(&part, text).and_then(|()| std::fs::rename(&part, &file));
        written.map_err(|error| Error::io(&file, error))
    }
}
