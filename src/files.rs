//! Files that are replaced at once or not at all: there is never half of one, and what was there before stays until the
//! new one is complete.

use std::fs::{self, File, OpenOptions};
use std::path::{Path, PathBuf};

use crate::error::{Error, Result};

/// Has `write` write a file beside `path`, which then takes its place. What is no plain file, such as a pipe, is written
/// as it is.
pub fn replace(path: &Path, write: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
    let target = target(path);
    if fs::metadata(&target).is_ok_and(|found| !found.is_file()) {
        return write(path);
    }
    let part = part(&target);
    let swap = || {
        // Without this a power cut may leave the new name with nothing behind it.
        File::open(&part)?.sync_all()?;
        fs::rename(&part, &target)?;
        // Not every file system can do this for folders; the file itself is safe either way.
        let _ = File::open(folder(&target)).and_then(|folder| folder.sync_all());
        Ok(())
    };
    let done = write(&part).and_then(|()| swap().map_err(|error: std::io::Error| Error::io(path, error)));
    if done.is_err() {
        // It is worth nothing, and on a full disk its room is.
        let _ = fs::remove_file(&part);
    }
    done.map_err(|error| match error {
        // The temporary file is no concern of the user's.
        Error::Io { what, .. } => Error::io(path, what.replace(&*part.to_string_lossy(), &path.to_string_lossy())),
        other => other,
    })
}

/// Writes bytes, all of them or none.
pub fn write(path: &Path, bytes: impl AsRef<[u8]>) -> Result<()> {
    replace(path, |part| fs::write(part, bytes).map_err(|error| Error::io(part, error)))
}

/// Fails if `path` cannot be replaced, so that it can be found out before the work. Makes an empty file where there is
/// none.
pub fn claim(path: &Path) -> Result<()> {
    let open = |path: &Path| OpenOptions::new().create(true).append(true).open(path);
    let refused = |error: std::io::Error| Error::io(path, format!("cannot be written: {error}"));
    open(path).map_err(refused)?;
    let target = target(path);
    if fs::metadata(&target).is_ok_and(|found| found.is_file()) {
        let part = part(&target);
        open(&part).and_then(|_| fs::remove_file(&part)).map_err(|error| {
            Error::io(path, format!("cannot be replaced, since its folder cannot be written: {error}"))
        })?;
    }
    Ok(())
}

/// The file itself, where `path` is a link to it.
fn target(path: &Path) -> PathBuf {
    path.canonicalize().unwrap_or_else(|_| path.to_path_buf())
}

fn folder(path: &Path) -> &Path {
    path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

/// Longest name of a file, in bytes.
const LONGEST: usize = 255;

/// A name beside `path` with its extension, by which image formats are chosen. Of a name that is as long as names may be
/// its start is enough.
fn part(path: &Path) -> PathBuf {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let extension = path.extension().map_or(String::new(), |extension| format!(".{}", extension.to_string_lossy()));
    let room = LONGEST.saturating_sub("..part".len() + extension.len());
    let mut length = room.min(stem.len());
    while !stem.is_char_boundary(length) {
        length -= 1;
    }
    path.with_file_name(format!(".{}.part{extension}", &stem[..length]))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_failed_write_leaves_what_was_there_and_nothing_beside_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.txt");
        let put = |text: &'static str| move |part: &Path| fs::write(part, text).map_err(|error| Error::io(part, error));
        replace(&path, put("one")).unwrap();
        let error = replace(&path, |part| {
            put("half of t")(part)?;
            Err(Error::io(part, format!("no room for {}", part.display())))
        });
        assert_eq!(error.unwrap_err().to_string(), format!("{0}: no room for {0}", path.display()));
        assert_eq!(fs::read_to_string(&path).unwrap(), "one");
        replace(&path, put("two")).unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "two");
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }

    #[test]
    fn names_may_be_as_long_as_they_can() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["x".repeat(251) + ".exr", "\u{e4}".repeat(125) + "y.exr"] {
            let path = folder.path().join(&name);
            claim(&path).unwrap();
            write(&path, "x").unwrap();
            assert_eq!((name.len() > 250, fs::read_to_string(&path).unwrap().as_str()), (true, "x"));
        }
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 2);
    }

    #[test]
    fn links_stay_links_and_devices_are_not_replaced() {
        let folder = tempfile::tempdir().unwrap();
        let (file, link, full) = (folder.path().join("file"), folder.path().join("link"), folder.path().join("full"));
        std::os::unix::fs::symlink(&file, &link).unwrap();
        std::os::unix::fs::symlink("/dev/full", &full).unwrap();
        claim(&link).unwrap();
        replace(&link, |part| fs::write(part, "x").map_err(|error| Error::io(part, error))).unwrap();
        assert!(link.is_symlink() && fs::read_to_string(&file).unwrap() == "x");
        let error = replace(&full, |part| fs::write(part, "x").map_err(|error| Error::io(part, error)));
        assert!(error.unwrap_err().to_string().contains("No space left"));
        assert!(full.is_symlink() && !fs::metadata("/dev/full").unwrap().is_file());
    }
}
