//! Command lines of the documents are ones that the program takes.

use std::path::{Path, PathBuf};

use clap::Parser;

use super::Args;

/// Documents with commands.
fn pages() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let folders = ["docs/guide", "docs/design"].map(|name| std::fs::read_dir(root.join(name)).unwrap());
    let pages = folders.into_iter().flatten().map(|entry| entry.unwrap().path());
    let tops = ["README.md", "CONTRIBUTING.md", "scenes/README.md"].map(|name| root.join(name));
    pages.filter(|path| path.extension().is_some_and(|end| end == "md")).chain(tops).collect()
}

/// Words of a line as a shell takes them, up to a comment or another command.
fn words(line: &str) -> Vec<String> {
    let (mut words, mut word, mut quote) = (Vec::new(), String::new(), None);
    for c in line.chars() {
        match (c, quote) {
            (c, Some(open)) if c == open => quote = None,
            ('\'' | '"', None) => quote = Some(c),
            (' ', None) if !word.is_empty() => words.push(std::mem::take(&mut word)),
            (' ', None) => {}
            ('#' | '&' | '|' | ';' | '>', None) if word.is_empty() => break,
            (c, _) => word.push(c),
        }
    }
    words.extend((!word.is_empty()).then_some(word));
    words
}

#[test]
fn commands_of_documents_are_understood() {
    let mut tried = 0;
    for path in pages() {
        let text = std::fs::read_to_string(&path).unwrap();
        for line in text.lines().filter_map(|line| line.strip_prefix("    fluxion ")) {
            let arguments = std::iter::once("fluxion".to_owned()).chain(words(line));
            if let Err(error) = Args::try_parse_from(arguments) {
                panic!("{}: {line}: {error}", path.display());
            }
            tried += 1;
        }
    }
    assert!(tried > 100, "{tried} commands");
}
