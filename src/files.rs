//! Files that are replaced at once or not at all: there is never half of one, and what was there before stays until the
//! new one is complete.

use std::fs::{self, File, OpenOptions};
use std::os::unix::fs::{FileExt as _, MetadataExt, PermissionsExt};
use std::path::{Path, PathBuf};

use fs4::{FileExt, TryLockError};
use tempfile::TempPath;

use crate::error::{Error, Result};

/// Has `write` write a file beside `path`, which then takes its place. What is no plain file, such as a pipe, is written
/// as it is.
pub fn replace(path: &Path, write: impl FnOnce(&Path) -> Result<()>) -> Result<()> {
    let target = target(path);
    if fs::metadata(&target).is_ok_and(|found| !found.is_file()) {
        return write(path);
    }
    // When it goes out of scope it is removed: it is worth nothing, and on a full disk its room is.
    let part = part(&target).map_err(|error| Error::io(path, error))?;
    let name = part.to_path_buf();
    let swap = || {
        // Without this a power cut may leave the new name with nothing behind it.
        File::open(&name)?.sync_all()?;
        part.persist(&target)?;
        // Not every file system can do this for folders; the file itself is safe either way.
        let _ = File::open(folder(&target)).and_then(|folder| folder.sync_all());
        Ok(())
    };
    let done = write(&name).and_then(|()| swap().map_err(|error: std::io::Error| Error::io(path, error)));
    done.map_err(|error| match error {
        // The temporary file is no concern of the user's.
        Error::Io { path: of, what } => {
            let of = if of == name { path } else { &of };
            Error::io(of, what.replace(&*name.to_string_lossy(), &path.to_string_lossy()))
        }
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
        part(&target).map_err(|error| {
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

/// Characters that make the names of temporary files unique: another process may be writing the same file.
const UNIQUE: usize = 6;

/// A temporary file beside `path` with its extension, by which image formats are chosen. Of a name that is as long as names may be
/// its start is enough.
fn part(path: &Path) -> std::io::Result<TempPath> {
    let extension = path.extension().map_or(String::new(), |extension| format!(".{}", extension.to_string_lossy()));
    let stem = start_of(path, LONGEST.saturating_sub("...part".len() + UNIQUE + extension.len()));
    let (prefix, suffix) = (format!(".{stem}."), format!(".part{extension}"));
    let mut named = tempfile::Builder::new();
    named.prefix(&prefix).suffix(&suffix).rand_bytes(UNIQUE);
    // Everyone whom the mask lets may read what is written, as with files that are made directly.
    named.permissions(fs::Permissions::from_mode(0o666));
    Ok(named.tempfile_in(folder(path))?.into_temp_path())
}

/// The start of a file's name without its extension, of at most so many bytes.
fn start_of(path: &Path, most: usize) -> String {
    let stem = path.file_stem().unwrap_or_default().to_string_lossy();
    let mut length = most.min(stem.len());
    while !stem.is_char_boundary(length) {
        length -= 1;
    }
    stem[..length].to_owned()
}

/// A file that one process at a time works on. The lock ends with the process, however that ends.
#[derive(Debug)]
pub struct Lock {
    path: PathBuf,
    file: File,
}

impl Lock {
    /// Locks `path` by a file beside it. The error says who holds the lock.
    pub fn new(path: &Path) -> Result<Self> {
        let target = target(path);
        let name = target.with_file_name(format!(".{}.lock", start_of(&target, LONGEST - "..lock".len())));
        let failed = |error: std::io::Error| Error::io(path, format!("cannot be locked: {error}"));
        loop {
            let file =
                OpenOptions::new().create(true).truncate(false).read(true).write(true).open(&name).map_err(failed)?;
            match FileExt::try_lock(&file) {
                Ok(()) => {}
                Err(TryLockError::WouldBlock) => {
                    let holder = fs::read_to_string(&name).unwrap_or_default();
                    return Err(Error::io(path, format!("is being written by another process: {}", holder.trim())));
                }
                // Some network file systems have no locks; unique names keep files whole there, too.
                Err(TryLockError::Error(error)) if error.kind() == std::io::ErrorKind::Unsupported => {}
                Err(TryLockError::Error(error)) => return Err(failed(error)),
            }
            // Whoever held it before may have removed the file since it was opened.
            let same = |found: fs::Metadata| file.metadata().is_ok_and(|mine| mine.ino() == found.ino());
            if fs::metadata(&name).is_ok_and(same) {
                let host = fs::read_to_string("/proc/sys/kernel/hostname").unwrap_or_default();
                let holder = format!("process {} on {}", std::process::id(), host.trim());
                file.set_len(0).and_then(|()| file.write_all_at(holder.as_bytes(), 0)).map_err(failed)?;
                return Ok(Self { path: name, file });
            }
        }
    }
}

impl Drop for Lock {
    fn drop(&mut self) {
        let _ = fs::remove_file(&self.path);
        let _ = FileExt::unlock(&self.file);
    }
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

    #[test]
    fn a_file_has_one_writer_at_a_time_and_twins_do_not_disturb_each_other() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.ckpt");
        let lock = Lock::new(&path).unwrap();
        let refused = Lock::new(&path).unwrap_err().to_string();
        assert!(
            refused.contains("a.ckpt") && refused.contains(&format!("process {}", std::process::id())),
            "{refused}"
        );
        drop(lock);
        drop(Lock::new(&path).unwrap());
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0);
        let put = |text: &str, part: &Path| fs::write(part, text).map_err(|error| Error::io(part, error));
        replace(&path, |outer| {
            put("outer", outer)?;
            replace(&path, |inner| put("inner", inner))
        })
        .unwrap();
        assert_eq!(fs::read_to_string(&path).unwrap(), "outer");
        assert_eq!(fs::metadata(&path).unwrap().permissions().mode() & 0o600, 0o600);
        assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
