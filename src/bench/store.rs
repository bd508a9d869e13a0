//! The folder of a benchmark: results and images, complete after every run, and the page.

use std::path::{Path, PathBuf};

use super::case::Case;
use super::cell::{Budget, RunResult};
use super::record::{LeftOut, Record, Results, machine};
use crate::error::{Error, Result};
use crate::files;
use crate::image::{Image, io};

/// The folder.
pub struct Store {
    folder: PathBuf,
    /// Records in the folder.
    pub results: Results,
}

impl Store {
    /// Opens a folder, which is created if necessary. Existing results are continued only if `resume` says so.
    pub fn open(folder: &Path, resume: bool) -> Result<Self> {
        std::fs::create_dir_all(folder.join("images")).map_err(|error| Error::io(folder, error))?;
        let file = folder.join("results.json");
        let results = if file.exists() { Results::load(&file)? } else { Results::default() };
        if !resume && !results.records.is_empty() {
            let what = "holds results already: add --resume to continue them, or name another folder";
            return Err(Error::io(folder, what));
        }
        let store = Self { folder: folder.to_owned(), results };
        // Better now than after the first hour.
        store.save()?;
        Ok(store)
    }

    /// Whether a run is there.
    pub fn has(&self, case: &Case, method: &str, budget: Budget, seed: u64) -> Result<bool> {
        let budget = budget.to_string();
        Ok(self.of(case)?.any(|record| record.method == method && record.budget == budget && record.seed == seed))
    }

    /// The runs on a scene. They must be of the same version of it, measured by the same reference on the same machine.
    pub fn of<'a>(&'a self, case: &'a Case) -> Result<impl Iterator<Item = &'a Record>> {
        let (size, floor) = ((case.truth.image.width, case.truth.image.height), case.truth.floor);
        let (fingerprint, machine) = (case.scene.fingerprint_hex(), machine());
        let own = self.results.records.iter().filter(|record| record.scene == case.name);
        for record in own.clone() {
            let different = [
                (record.fingerprint != fingerprint, "another version of the scene"),
                ((record.width, record.height) != size, "another size"),
                (record.floor != floor, "another reference"),
                (record.machine != machine, "another machine or number of threads"),
            ];
            if let Some((_, what)) = different.into_iter().find(|(differs, _)| *differs) {
                let what = format!("holds results on {} with {what}: name another folder", case.name);
                return Err(Error::io(&self.folder, what));
            }
        }
        Ok(own)
    }

    /// Writes the results.
    pub fn save(&self) -> Result<()> {
        self.write("results.json", &self.results.json()?)?;
        self.write("results.csv", &self.results.csv()?)
    }

    /// Adds a run. The images of the first seed are kept.
    pub fn add(&mut self, ran: RunResult) -> Result<()> {
        let RunResult { record, image } = ran;
        let file = (record.seed == 1).then(|| self.image_file(&record.scene, &record.method, &record.budget));
        let same = |left: &LeftOut| {
            (&left.scene, &left.method, &left.budget) == (&record.scene, &record.method, &record.budget)
        };
        self.results.left_out.retain(|left| !same(left));
        self.results.records.push(record);
        self.save()?;
        file.map_or(Ok(()), |file| io::write_color(&file, &image, &io::Extras::default()))
    }

    /// Notes that runs were not worth starting, once for all seeds.
    pub fn leave_out(&mut self, run: LeftOut) {
        let same =
            |other: &LeftOut| (&other.scene, &other.method, &other.budget) == (&run.scene, &run.method, &run.budget);
        if !self.results.left_out.iter().any(same) {
            self.results.left_out.push(run);
        }
    }

    fn image_file(&self, scene: &str, method: &str, budget: &str) -> PathBuf {
        let plain = |c: char| if c.is_ascii_alphanumeric() || c == '-' || c == '.' { c } else { '_' };
        let name: String = format!("{scene}-{method}-{budget}").chars().map(plain).collect();
        // File systems allow 255 bytes.
        let start: String = name.chars().take(200).collect();
        self.folder.join("images").join(format!("{start}.exr"))
    }

    /// The image of a run, if it was kept.
    pub fn image(&self, scene: &str, method: &str, budget: &str) -> Option<Image> {
        io::read_color(&self.image_file(scene, method, budget)).ok()
    }

    /// Puts a file into the folder, in the place of an older one at once.
    pub fn write(&self, name: &str, text: &str) -> Result<()> {
        files::write(&self.folder.join(name), text)
    }
}
