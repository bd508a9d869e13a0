//! Folders that a scene's files are looked for in.

use std::path::{Path, PathBuf};

/// Folders in the order that they are looked into.
#[derive(Clone, Debug, Default)]
pub struct Folders {
    folders: Vec<PathBuf>,
    /// Folders of included files, which are looked into last.
    included: Vec<PathBuf>,
}

impl Folders {
    /// The folder of a scene file, then the current one.
    pub fn of_scene(path: &Path) -> Self {
        Self { folders: vec![folder_of(path), PathBuf::new()], included: Vec::new() }
    }

    /// Adds a folder that comes before all others.
    pub fn prepend(&mut self, folder: PathBuf) {
        self.folders.insert(0, folder);
    }

    /// The folders while a file is read that `including` includes: its own first.
    pub fn for_included(&self, including: &Path) -> Self {
        let mut folders = self.clone();
        folders.prepend(folder_of(including));
        folders
    }

    /// Keeps folders that only an included file has named, for the files that are left to be found.
    pub fn remember(&mut self, inner: Self) {
        let all = inner.folders.into_iter().chain(inner.included);
        let mut new: Vec<_> = all.filter(|folder| !self.folders.contains(folder)).collect();
        new.retain(|folder| !self.included.contains(folder));
        self.included.append(&mut new);
    }

    fn all(&self) -> impl Iterator<Item = &PathBuf> {
        self.folders.iter().chain(&self.included)
    }

    /// The first file or folder of this name.
    pub fn find(&self, name: &str) -> Option<PathBuf> {
        self.all().map(|folder| folder.join(name)).find(|path| path.exists())
    }

    /// The first plain file of this name.
    pub fn find_file(&self, name: &str) -> Option<PathBuf> {
        self.all().map(|folder| folder.join(name)).find(|path| path.is_file())
    }

    /// The message that there is no file `name`, with the one that is probably meant.
    pub fn missing(&self, name: &str) -> String {
        let mut folders: Vec<_> = self.folders.iter().map(|folder| folder.display().to_string()).collect();
        folders.iter_mut().filter(|folder| folder.is_empty()).for_each(|folder| *folder = ".".into());
        folders.dedup();
        let what = format!("no file `{name}` in {}", folders.join(" or "));
        if self.find(name).is_some() {
            return format!("`{name}` is a folder, not a file");
        }
        match self.all().find_map(|folder| similar(folder, name)) {
            Some(path) => format!("{what}; there is `{}`: write its name so", path.display()),
            None => what,
        }
    }
}

fn folder_of(path: &Path) -> PathBuf {
    path.parent().unwrap_or(Path::new("")).to_path_buf()
}

/// The file that a name with other slashes or in other case stands for, as on the systems that do not distinguish them.
fn similar(folder: &Path, name: &str) -> Option<PathBuf> {
    let name = name.replace('\\', "/");
    // A drive's letter means nothing here.
    let name = name.split_once(":/").map_or(name.as_str(), |(_, rest)| rest);
    let mut found = PathBuf::new();
    for part in name.split('/').filter(|part| !part.is_empty()) {
        if folder.join(&found).join(part).exists() {
            found.push(part);
            continue;
        }
        let here = if found.as_os_str().is_empty() && folder.as_os_str().is_empty() {
            PathBuf::from(".")
        } else {
            folder.join(&found)
        };
        let mut entries = std::fs::read_dir(here).ok()?.filter_map(|entry| entry.ok()?.file_name().into_string().ok());
        found.push(entries.find(|entry| entry.to_lowercase() == part.to_lowercase())?);
    }
    folder.join(&found).exists().then_some(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_other_systems_are_recognised() {
        let root = tempfile::tempdir().unwrap();
        std::fs::create_dir(root.path().join("Textures")).unwrap();
        std::fs::write(root.path().join("Textures/Wood.PNG"), "").unwrap();
        let folders = Folders::of_scene(&root.path().join("scene.xml"));
        assert_eq!(folders.find_file("Textures/Wood.PNG"), Some(root.path().join("Textures/Wood.PNG")));
        for name in ["textures\\wood.png", "Textures/wood.png", ".\\TEXTURES\\Wood.png"] {
            assert_eq!(folders.find_file(name), None);
            let message = folders.missing(name);
            assert!(message.contains("Textures/Wood.PNG`: write its name so"), "{message}");
        }
        assert!(!folders.missing("other.png").contains("there is"));
    }
}
