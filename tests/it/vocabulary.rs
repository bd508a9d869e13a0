//! The field's words: identifiers and comments do without names that a reader would have to guess at.

use std::path::Path;

use crate::architecture::{files_below, sources};

/// Words that were replaced by the field's terms, as whole identifiers. docs/design/glossary.md has the terms.
const RETIRED: &[&str] = &[
    "Onward",
    "Room",
    "Apart",
    "Joining",
    "Joined",
    "NOTHING",
    "OUTSIDE",
    "Views",
    "Met",
    "Finish",
    "Lamp",
    "Glow",
    "Facet",
    "Parts",
    "Census",
    "Keeper",
    "Seen",
    "Terms",
    "Ran",
    "Place",
    "LOOK",
    "TAILS",
    "ROUGHLY",
    "LEFT",
    "go_on",
    "go_on_apart",
    "pass_on",
    "glows",
    "glow",
    "lamps",
    "is_open",
    "generalize",
    "raise",
    "places",
    "without_certainty",
    "bend",
    "lean",
    "complaint",
    "is_dark",
    "fill_dark_edges",
    "begun",
    "dealt",
];

/// Starts of doc comments that name no noun.
const RIDDLES: &[&str] = &["What ", "Which ", "Where ", "Whose ", "It ", "Those ", "Of ", "Told "];

/// Phrases that documents do without.
const PHRASES: &[&str] = &["gone on with", "dealt", "glow", "falls short", "asked for:", "have their say"];

/// Phrases that comments, help texts and messages do without: NaN is a term, and readers are told, not networks or options.
const IN_CODE: &[&str] =
    &["no number", "no numbers", "is told", "are told", "cannot be told", "to be had", "its say", "whichever end says"];

#[test]
fn retired_words_stay_out_of_the_code() {
    let mut found = Vec::new();
    for (name, text) in sources() {
        for (number, line) in text.lines().enumerate() {
            let words = line.split(|c: char| !c.is_alphanumeric() && c != '_');
            for word in words.filter(|word| RETIRED.contains(word)) {
                found.push(format!("{name}:{}: `{word}`", number + 1));
            }
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn comments_and_messages_are_in_plain_english() {
    let mut found = Vec::new();
    for (name, text) in sources() {
        for (number, line) in text.lines().enumerate() {
            let whole = |phrase: &&&str| {
                let after = line.split_once(**phrase).map(|(_, rest)| rest.chars().next());
                after.is_some_and(|next| !next.is_some_and(char::is_alphanumeric))
            };
            found.extend(IN_CODE.iter().filter(whole).map(|phrase| format!("{name}:{}: `{phrase}`", number + 1)));
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn doc_comments_start_with_a_noun() {
    let mut found = Vec::new();
    for (name, text) in sources() {
        // A sentence that goes on from the line above may start with any word.
        let mut starts = true;
        for (number, line) in text.lines().map(str::trim_start).enumerate() {
            let comment = line.strip_prefix("//!").or_else(|| line.strip_prefix("///"));
            let Some(comment) = comment.map(str::trim_start) else {
                starts = true;
                continue;
            };
            if starts && RIDDLES.iter().any(|riddle| comment.starts_with(riddle)) {
                found.push(format!("{name}:{}: {comment}", number + 1));
            }
            starts = comment.is_empty();
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}

#[test]
fn documents_are_in_plain_english() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let mut found = Vec::new();
    let documents = files_below(&root.join("docs"), "md").into_iter().chain([root.join("README.md")]);
    for path in documents {
        let text = std::fs::read_to_string(&path).unwrap();
        for (number, line) in text.lines().enumerate() {
            for phrase in PHRASES.iter().filter(|phrase| line.to_lowercase().contains(*phrase)) {
                found.push(format!("{}:{}: `{phrase}`", path.display(), number + 1));
            }
        }
    }
    assert!(found.is_empty(), "{}", found.join("\n"));
}
