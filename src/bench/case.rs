//! A scene with its reference image.

use std::path::{Path, PathBuf};
use std::time::Instant;

use crate::error::{Error, Result};
use crate::image::{Image, io};
use crate::mitsuba;
use crate::reference::{Reference, check, relative};
use crate::scene::Scene;

/// A reference image.
pub struct Truth {
    /// Radiance, directly seen emitters included.
    pub image: Image,
    /// Expected relMSE of the reference itself, if known.
    pub floor: Option<f64>,
}

/// A loaded scene and its reference.
pub struct Case {
    /// Name of the folder, or of the file if it is not a `scene.xml`.
    pub name: String,
    /// The scene, at the reference's size.
    pub scene: Scene,
    /// The reference image that images are measured against.
    pub truth: Truth,
    /// Seconds that reading it and building the hierarchy took.
    pub load: f64,
}

impl Case {
    /// Loads a scene, finds its reference and makes sure that it is one. `reference` is a file, a folder with files
    /// named after scenes, or none: then it lies beside the scene, or in a folder `references` beside the scene's.
    pub fn load(path: &Path, reference: Option<&Path>, size: Option<(usize, usize)>) -> Result<Self> {
        let name = mitsuba::name(path);
        let file = find(path, &name, reference)?;
        let (truth, known) = truth(&file)?;
        let there = (truth.image.width, truth.image.height);
        let start = Instant::now();
        let scene =
            mitsuba::load(path, &mitsuba::Options { size: size.or(Some(there)), ..mitsuba::Options::default() })?;
        let load = start.elapsed().as_secs_f64();
        let wanted = (scene.sensor().width, scene.sensor().height);
        if wanted != there {
            let what = format!("has {}x{} pixels, not {}x{}", there.0, there.1, wanted.0, wanted.1);
            return Err(Error::mismatch(&file, what));
        }
        if let Some(known) = known {
            check(&known, &file, &scene)?;
        }
        Ok(Self { name, scene, truth, load })
    }
}

impl Truth {
    /// The reference of a scene, as [`Case::load`] finds it, with the scene's name.
    pub fn of(path: &Path, reference: Option<&Path>) -> Result<(String, Self)> {
        let name = mitsuba::name(path);
        let (truth, _) = truth(&find(path, &name, reference)?)?;
        Ok((name, truth))
    }
}

/// The image of a file, with the fingerprint of its scene if it is one of Fluxion's own references.
fn truth(path: &Path) -> Result<(Truth, Option<String>)> {
    if Reference::is_one(path)? {
        let reference = Reference::load(path)?;
        let floor = Some(reference.floor());
        return Ok((Truth { image: reference.image, floor }, Some(reference.fingerprint)));
    }
    let image = io::read_color(path)?;
    if let Some((x, y, _)) = image.not_finite() {
        return Err(Error::bad_data(path, format!("the value at pixel {x},{y} is not finite")));
    }
    let floor = noise(path)?.map(|variance| {
        // Infinite variances and those below zero do not count.
        let sane = |&variance: &f32| if variance.is_finite() { f64::from(variance.max(0.0)) } else { 0.0 };
        relative(&image, variance.data.iter().map(sane))
    });
    Ok((Truth { image, floor }, None))
}

/// The variance of a foreign reference, if it lies beside it: NAME_var.exr beside NAME.exr.
fn noise(path: &Path) -> Result<Option<Image>> {
    let beside = path.file_stem().map(|stem| path.with_file_name(format!("{}_var.exr", stem.to_string_lossy())));
    beside.filter(|file| file.is_file()).map(|file| io::read_color(&file)).transpose()
}

fn find(path: &Path, name: &str, reference: Option<&Path>) -> Result<PathBuf> {
    let folder = path.parent().map_or(PathBuf::from("."), Path::to_path_buf);
    let file = format!("{name}.exr");
    let candidates = match reference {
        Some(reference) if reference.is_dir() => vec![reference.join(file)],
        Some(reference) => vec![reference.to_path_buf()],
        None => vec![
            folder.join("reference.exr"),
            folder.join("../references").join(&file),
            Path::new("scenes/references").join(&file),
        ],
    };
    candidates.iter().find(|path| path.is_file()).cloned().ok_or_else(|| {
        let names: Vec<_> = candidates.iter().map(|path| path.display().to_string()).collect();
        let what = format!("no reference at {}; `fluxion reference` makes one", names.join(", "));
        Error::io(path, what)
    })
}
