//! Mitsuba scene files as objects with typed properties: `<default>`, `$name`, `<include>`, `<path>`,
//! `<alias>` and transforms are resolved here, so that plugins only see values.

use std::collections::{BTreeSet, HashMap};
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

use super::document::{self, Element};
use super::folders::Folders;
use super::warnings::Warnings;
use crate::error::{Error, Result, SourceLoc};
use crate::scene::plugin::{Object, Value};

/// Includes nested deeper than this are taken for a loop.
const MAX_INCLUDES: usize = 15;
/// More files than this in one scene are taken for a mistake.
const MAX_FILES: usize = 1000;
/// Parameters longer than this are taken for a mistake.
const MAX_PARAMETER: usize = 1 << 16;

/// A parsed scene file with everything it includes.
pub struct Tree {
    /// Elements directly under `<scene>`, in order.
    pub objects: Vec<Rc<Object>>,
    /// Every object with an `id`, at any depth.
    pub ids: HashMap<String, Rc<Object>>,
    /// Folders to look for files in.
    pub folders: Folders,
    /// The text of all files read, for the scene's fingerprint.
    pub sources: Vec<String>,
    /// Warnings so far.
    pub warnings: Warnings,
}

/// The text of a scene file.
#[derive(Clone, Copy)]
pub enum Source<'a> {
    /// In the file itself.
    File,
    /// In place of the file's.
    Text(&'a str),
    /// Line by line, each of an element that stands somewhere else.
    Lines(&'a [Line]),
}

/// A line of XML that was made from something else.
#[derive(Clone, Debug)]
pub struct Line {
    /// Its origin, for messages in place of file and line.
    pub origin: Arc<Path>,
    /// The text, without a line break.
    pub xml: String,
}

/// Reads a scene file, or a text in its place. `parameters` override the file's `<default>` values; each must be used.
pub fn parse(path: &Path, source: Source, parameters: &[(String, String)], strict: bool) -> Result<Tree> {
    let tree = Tree {
        objects: Vec::new(),
        ids: HashMap::new(),
        folders: Folders::of_scene(path),
        sources: Vec::new(),
        warnings: Warnings::new(strict),
    };
    let mut parser = Parser {
        tree,
        defaults: parameters.iter().cloned().collect(),
        names: BTreeSet::new(),
        values: HashMap::new(),
        aliases: Vec::new(),
        references: Vec::new(),
        includes: Vec::new(),
        literal: matches!(source, Source::Lines(_)),
        legacy: false,
    };
    let receive = &mut Parser::top_level;
    match source {
        Source::File => parser.file(path, receive)?,
        Source::Text(text) => parser.text((path, &[]), text.to_owned(), receive)?,
        Source::Lines(lines) => {
            let text: Vec<_> = lines.iter().map(|line| line.xml.as_str()).collect();
            parser.text((path, lines), text.join("\n"), receive)?;
        }
    }
    for (id, alias, loc) in std::mem::take(&mut parser.aliases) {
        let object = parser.tree.ids.get(&id).cloned();
        let object = object.ok_or_else(|| loc.invalid(format!("alias of the unknown id `{id}`")))?;
        if parser.tree.ids.insert(alias.clone(), object).is_some() {
            return Err(loc.invalid(format!("the id `{alias}` is given twice")));
        }
    }
    for (id, loc) in std::mem::take(&mut parser.references) {
        let found = parser.tree.ids.get(&id).cloned();
        let object = found.ok_or_else(|| loc.invalid(format!("nothing has the id `{id}`")))?;
        if !parser.tree.objects.iter().any(|other| Rc::ptr_eq(other, &object)) {
            parser.tree.objects.push(object);
        }
    }
    match parameters.iter().find(|(name, _)| !parser.names.contains(name)) {
        Some((name, _)) => Err(parser.unused(path, name)),
        None => Ok(parser.tree),
    }
}

pub struct Parser {
    pub tree: Tree,
    /// Values of parameters.
    defaults: HashMap<String, String>,
    /// Names of parameters that the text has.
    names: BTreeSet<String>,
    /// Values with an `id`, to be referred to.
    pub values: HashMap<String, Value>,
    aliases: Vec<(String, String, SourceLoc)>,
    /// References directly under the scene.
    references: Vec<(String, SourceLoc)>,
    includes: Vec<PathBuf>,
    /// Whether `$` stands for itself: lines that were made from something else have no parameters.
    literal: bool,
    /// Whether the file that is being read has the names of version 0.6 and before.
    pub legacy: bool,
}

/// An element with what is needed to name its location in messages.
#[derive(Clone, Copy)]
pub struct At<'a> {
    pub element: &'a Element,
    file: &'a Arc<Path>,
    /// Lines of the text, where they have origins of their own.
    lines: &'a [Line],
}

impl<'a> At<'a> {
    pub fn loc(self) -> SourceLoc {
        match self.lines.get((self.element.line as usize).saturating_sub(1)) {
            Some(line) => SourceLoc { file: Arc::clone(&line.origin), line: 0 },
            None => SourceLoc { file: Arc::clone(self.file), line: self.element.line },
        }
    }

    pub fn tag(self) -> &'a str {
        &self.element.tag
    }

    pub fn children(self) -> impl Iterator<Item = At<'a>> {
        self.element.children.iter().map(move |element| At { element, ..self })
    }
}

/// Receiver of the elements of a file.
pub type Receiver<'a> = &'a mut dyn FnMut(&mut Parser, At) -> Result<()>;

impl Parser {
    fn file(&mut self, path: &Path, receive: Receiver) -> Result<()> {
        let bytes = std::fs::read(path).map_err(|error| Error::io(path, error))?;
        self.text((path, &[]), document::decode(&bytes), receive)
    }

    /// Text that stands in a file, or might. An included file may hold one object in place of a scene.
    fn text(&mut self, (path, lines): (&Path, &[Line]), text: String, receive: Receiver) -> Result<()> {
        let root = document::parse(path, &text)?;
        let root = At { element: &root, file: &Arc::from(path), lines };
        let is_scene = root.tag() == "scene";
        if !is_scene && self.includes.is_empty() {
            return Err(root.loc().invalid(format!("a scene file starts with <scene>, not <{}>", root.tag())));
        }
        let version = root.element.attribute("version").unwrap_or(if self.legacy { "0.6.0" } else { "3.0.0" });
        let version = version.trim();
        if version.starts_with('1') || !version.starts_with(|first: char| first.is_ascii_digit()) {
            let what = format!("scene version {version}; versions 0.x and from 2 on are supported");
            return Err(root.loc().unsupported(what));
        }
        let outer = std::mem::replace(&mut self.legacy, version.starts_with('0'));
        if is_scene {
            root.children().try_for_each(|at| receive(self, at))?;
        } else {
            receive(self, root)?;
        }
        self.tree.sources.push(text);
        self.legacy = outer;
        Ok(())
    }

    pub fn include(&mut self, at: At, receive: Receiver) -> Result<()> {
        let name = self.attribute(at, "filename")?;
        let folders = self.tree.folders.for_included(at.file);
        let path = folders.find_file(&name).ok_or_else(|| at.loc().invalid(folders.missing(&name)))?;
        if self.includes.len() >= MAX_INCLUDES || self.includes.contains(&path) || *path == **at.file {
            return Err(at.loc().invalid(format!("`{name}` includes itself")));
        }
        if self.tree.sources.len() >= MAX_FILES {
            return Err(at.loc().invalid(format!("more than {MAX_FILES} files in one scene")));
        }
        self.includes.push(path.clone());
        let outer = std::mem::replace(&mut self.tree.folders, folders);
        self.file(&path, receive)?;
        let inner = std::mem::replace(&mut self.tree.folders, outer);
        self.tree.folders.remember(inner);
        self.includes.pop();
        Ok(())
    }

    /// The error that a parameter was given which the text does not have.
    fn unused(&self, path: &Path, name: &str) -> Error {
        let nearest = self.names.iter().min_by_key(|other| strsim::damerau_levenshtein(name, other));
        let hint = match nearest {
            Some(nearest) if self.names.len() == 1 => format!("it has `{nearest}`"),
            Some(nearest) => format!("did you mean `{nearest}`?"),
            None => "it has none".to_owned(),
        };
        Error::Usage(format!("{} has no parameter `{name}`; {hint}", path.display()))
    }

    fn top_level(&mut self, at: At) -> Result<()> {
        match at.tag() {
            "default" => {
                let (name, value) = (self.attribute(at, "name")?, self.attribute(at, "value")?);
                self.names.insert(name.clone());
                self.defaults.entry(name).or_insert(value);
            }
            "include" => self.include(at, &mut Self::top_level)?,
            "path" => {
                let value = self.attribute(at, "value")?;
                let folder = self.tree.folders.find(&value);
                let folder = folder.ok_or_else(|| at.loc().invalid(self.tree.folders.missing(&value)))?;
                self.tree.folders.prepend(folder);
            }
            "alias" => {
                let (id, alias) = (self.attribute(at, "id")?, self.attribute(at, "as")?);
                self.aliases.push((id, alias, at.loc()));
            }
            _ => match self.property(at)?.value {
                Value::Object(object) => self.tree.objects.push(object),
                Value::Reference(id) => self.references.push((id, at.loc())),
                // Defined here to be referred to.
                _ if at.element.attribute("id").is_some() => {}
                _ => return Err(at.loc().invalid(format!("<{}> is out of place directly under <scene>", at.tag()))),
            },
        }
        Ok(())
    }

    /// An attribute with `$name` replaced; it must be there.
    pub fn attribute(&mut self, at: At, name: &str) -> Result<String> {
        let missing = || at.loc().invalid(format!("<{}> needs the attribute `{name}`", at.tag()));
        self.optional(at, name)?.ok_or_else(missing)
    }

    pub fn optional(&mut self, at: At, name: &str) -> Result<Option<String>> {
        let Some(text) = at.element.attribute(name) else { return Ok(None) };
        if self.literal || !text.contains('$') {
            return Ok(Some(text.to_owned()));
        }
        let mut result = String::new();
        let mut rest = text;
        while let Some(start) = rest.find('$') {
            result.push_str(&rest[..start]);
            let after = &rest[start + 1..];
            let end = after.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(after.len());
            self.names.insert(after[..end].to_owned());
            let value = self.defaults.get(&after[..end]).ok_or_else(|| {
                let what = format!("parameter `${}` has no value: add a <default> or give it with -D", &after[..end]);
                at.loc().invalid(what)
            })?;
            result.push_str(value);
            rest = &after[end..];
            if result.len() > MAX_PARAMETER {
                break;
            }
        }
        result.push_str(rest);
        if result.len() > MAX_PARAMETER {
            return Err(at.loc().invalid(format!("`{name}` is longer than {MAX_PARAMETER} bytes")));
        }
        Ok(Some(result))
    }
}
