//! Mitsuba scene files as objects with typed properties: `<default>`, `$name`, `<include>`, `<path>`,
//! `<alias>` and transforms are resolved here, so that plugins only see values.

use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::rc::Rc;
use std::sync::Arc;

use roxmltree::{Document, Node};

use super::props::{Object, Property, Value};
use super::spectrum::Spectrum;
use super::{legacy, transform};
use crate::error::{Error, Result, SourceLoc};
use crate::math::{Rgb, Vec3, srgb_decode, vec3};

/// Includes nested deeper than this are taken for a loop.
const MAX_INCLUDES: usize = 15;
/// More files than this in one scene are taken for a mistake.
const MAX_FILES: usize = 1000;
/// Elements nested deeper than this are taken for a mistake.
const MAX_DEPTH: usize = 64;
/// Parameters longer than this are taken for a mistake.
const MAX_PARAMETER: usize = 1 << 16;

/// A parsed scene file with everything it includes.
pub struct Tree {
    /// Elements directly under `<scene>`, in order.
    pub objects: Vec<Rc<Object>>,
    /// Every object with an `id`, at any depth.
    pub ids: HashMap<String, Rc<Object>>,
    /// Folders to look for files in: the scene's own first, then those of `<path>`.
    pub folders: Vec<PathBuf>,
    /// The text of all files read, for the scene's fingerprint.
    pub sources: Vec<String>,
}

/// Reads a scene file, or `text` in its place. `parameters` override the file's `<default>` values.
pub fn parse(path: &Path, text: Option<&str>, parameters: &[(String, String)]) -> Result<Tree> {
    let folder = path.parent().unwrap_or(Path::new("")).to_path_buf();
    let tree = Tree { objects: Vec::new(), ids: HashMap::new(), folders: vec![folder], sources: Vec::new() };
    let defaults = parameters.iter().cloned().collect();
    let mut parser = Parser { tree, defaults, aliases: Vec::new(), includes: Vec::new(), depth: 0, legacy: false };
    match text {
        Some(text) => parser.text(path, text.to_owned())?,
        None => parser.file(path)?,
    }
    for (id, alias, loc) in std::mem::take(&mut parser.aliases) {
        let object = parser.tree.ids.get(&id).cloned();
        let object = object.ok_or_else(|| loc.invalid(format!("alias of the unknown id `{id}`")))?;
        if parser.tree.ids.insert(alias.clone(), object).is_some() {
            return Err(loc.invalid(format!("the id `{alias}` is given twice")));
        }
    }
    Ok(parser.tree)
}

struct Parser {
    tree: Tree,
    defaults: HashMap<String, String>,
    aliases: Vec<(String, String, SourceLoc)>,
    includes: Vec<PathBuf>,
    depth: usize,
    /// Whether the file that is being read has the names of version 0.6 and before.
    legacy: bool,
}

/// A node with what is needed to name its location in messages.
#[derive(Clone, Copy)]
struct At<'a> {
    node: Node<'a, 'a>,
    file: &'a File,
}

/// A file with where its lines start.
struct File {
    path: Arc<Path>,
    lines: Vec<usize>,
}

impl File {
    fn new(path: &Path, text: &str) -> Self {
        let ends = text.bytes().enumerate().filter(|(_, byte)| *byte == b'\n');
        Self { path: Arc::from(path), lines: ends.map(|(at, _)| at).collect() }
    }
}

impl<'a> At<'a> {
    fn loc(self) -> SourceLoc {
        let line = self.file.lines.partition_point(|&end| end < self.node.range().start) as u32 + 1;
        SourceLoc { file: Arc::clone(&self.file.path), line }
    }

    fn tag(self) -> &'a str {
        self.node.tag_name().name()
    }

    fn children(self) -> impl Iterator<Item = At<'a>> {
        self.node.children().filter(Node::is_element).map(move |node| At { node, file: self.file })
    }
}

impl Parser {
    fn file(&mut self, path: &Path) -> Result<()> {
        self.text(path, std::fs::read_to_string(path).map_err(|error| Error::io(path, error))?)
    }

    /// Text that stands in a file, or might.
    fn text(&mut self, path: &Path, text: String) -> Result<()> {
        let loc = |row: u32| SourceLoc::line(path, row);
        let document = Document::parse(&text).map_err(|error| loc(error.pos().row).invalid(error.to_string()))?;
        let file = File::new(path, &text);
        let root = At { node: document.root_element(), file: &file };
        if root.tag() != "scene" {
            return Err(root.loc().invalid(format!("a scene file starts with <scene>, not <{}>", root.tag())));
        }
        let version = root.node.attribute("version").unwrap_or("3.0.0");
        let outer = std::mem::replace(&mut self.legacy, version.starts_with('0'));
        if !version.starts_with(['0', '2', '3']) {
            let what = format!("scene version {version}; versions 0.x, 2 and 3 are supported");
            return Err(root.loc().unsupported(what));
        }
        for at in root.children() {
            self.top_level(at)?;
        }
        self.tree.sources.push(text);
        self.legacy = outer;
        Ok(())
    }

    fn spectrum_file(&self, name: &str, loc: &SourceLoc) -> Result<Spectrum> {
        let path = self.find(name).ok_or_else(|| loc.invalid(format!("no file `{name}`")))?;
        let text = std::fs::read_to_string(&path).map_err(|error| Error::io(&path, error))?;
        Spectrum::parse_file(&text, &SourceLoc::file(&path))
    }

    fn top_level(&mut self, at: At) -> Result<()> {
        match at.tag() {
            "default" => {
                let (name, value) = (self.attribute(at, "name")?, self.attribute(at, "value")?);
                self.defaults.entry(name).or_insert(value);
            }
            "include" => {
                let name = self.attribute(at, "filename")?;
                let path = self.find(&name).ok_or_else(|| at.loc().invalid(format!("no file `{name}`")))?;
                if self.includes.len() >= MAX_INCLUDES || self.includes.contains(&path) || *path == *at.file.path {
                    return Err(at.loc().invalid(format!("`{name}` includes itself")));
                }
                if self.tree.sources.len() >= MAX_FILES {
                    return Err(at.loc().invalid(format!("more than {MAX_FILES} files in one scene")));
                }
                self.includes.push(path.clone());
                self.file(&path)?;
                self.includes.pop();
            }
            "path" => {
                let value = self.attribute(at, "value")?;
                let folder = self.find(&value).ok_or_else(|| at.loc().invalid(format!("no folder `{value}`")))?;
                self.tree.folders.push(folder);
            }
            "alias" => {
                let (id, alias) = (self.attribute(at, "id")?, self.attribute(at, "as")?);
                self.aliases.push((id, alias, at.loc()));
            }
            _ => {
                let property = self.property(at)?;
                if let Value::Object(object) = property.value {
                    self.tree.objects.push(object);
                } else {
                    return Err(at.loc().invalid(format!("<{}> is out of place directly under <scene>", at.tag())));
                }
            }
        }
        Ok(())
    }

    fn find(&self, name: &str) -> Option<PathBuf> {
        let candidates = self.tree.folders.iter().map(|folder| folder.join(name));
        candidates.chain([PathBuf::from(name)]).find(|path| path.exists())
    }

    /// An attribute with `$name` replaced; it must be there.
    fn attribute(&self, at: At, name: &str) -> Result<String> {
        let missing = || at.loc().invalid(format!("<{}> needs the attribute `{name}`", at.tag()));
        self.optional(at, name)?.ok_or_else(missing)
    }

    fn optional(&self, at: At, name: &str) -> Result<Option<String>> {
        let Some(text) = at.node.attribute(name) else { return Ok(None) };
        if !text.contains('$') {
            return Ok(Some(text.to_owned()));
        }
        let mut result = String::new();
        let mut rest = text;
        while let Some(start) = rest.find('$') {
            result.push_str(&rest[..start]);
            let after = &rest[start + 1..];
            let end = after.find(|c: char| !c.is_alphanumeric() && c != '_').unwrap_or(after.len());
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

    fn property(&mut self, at: At) -> Result<Property> {
        let name = self.optional(at, "name")?.unwrap_or_default();
        let name = if self.legacy { legacy::snake_case(&name) } else { name };
        Ok(Property::new(name, self.value(at)?, at.loc()))
    }

    fn value(&mut self, at: At) -> Result<Value> {
        let loc = at.loc();
        let text = |parser: &Self| parser.attribute(at, "value");
        Ok(match at.tag() {
            "float" => Value::Float(number(&text(self)?, &loc)?),
            "integer" => {
                let text = text(self)?;
                let parsed = text.trim().parse();
                Value::Integer(parsed.map_err(|_| loc.invalid(format!("`{text}` is not a whole number")))?)
            }
            "boolean" => match text(self)?.trim() {
                "true" => Value::Boolean(true),
                "false" => Value::Boolean(false),
                other => return Err(loc.invalid(format!("`{other}` is neither true nor false"))),
            },
            "string" => Value::String(text(self)?),
            "rgb" => Value::Color(rgb(&text(self)?, &loc)?),
            "srgb" => Value::Color(srgb(&text(self)?, &loc)?),
            "spectrum" => {
                if at.node.has_attribute("type") {
                    return Ok(Value::Object(self.object(at)?));
                }
                Value::Spectrum(match self.optional(at, "filename")? {
                    Some(name) => self.spectrum_file(&name, &loc)?,
                    None => Spectrum::parse(&text(self)?, &loc)?,
                })
            }
            "point" | "vector" => Value::Vector(self.vector(at, 0.0)?),
            "transform" => Value::Transform(self.transform(at)?),
            "ref" => Value::Reference(self.attribute(at, "id")?),
            _ => Value::Object(self.object(at)?),
        })
    }

    fn object(&mut self, at: At) -> Result<Rc<Object>> {
        let plugin = self.attribute(at, "type")?;
        let mut properties = Vec::new();
        if self.depth >= MAX_DEPTH {
            return Err(at.loc().invalid(format!("elements nested more than {MAX_DEPTH} deep")));
        }
        self.depth += 1;
        for child in at.children() {
            properties.push(self.property(child)?);
        }
        self.depth -= 1;
        if self.legacy {
            legacy::rename(&plugin, &mut properties);
        }
        let id = self.optional(at, "id")?;
        let object = Rc::new(Object { class: at.tag().to_owned(), plugin, loc: at.loc(), properties });
        if let Some(id) = id {
            if self.tree.ids.insert(id.clone(), Rc::clone(&object)).is_some() {
                return Err(at.loc().invalid(format!("the id `{id}` is given twice")));
            }
        }
        Ok(object)
    }

    /// x, y, z attributes, or three numbers in `value`.
    fn vector(&self, at: At, missing: f32) -> Result<Vec3> {
        if let Some(text) = self.optional(at, "value")? {
            return triple(&text, &at.loc());
        }
        let mut result = [missing; 3];
        for (slot, name) in result.iter_mut().zip(["x", "y", "z"]) {
            if let Some(text) = self.optional(at, name)? {
                *slot = number(&text, &at.loc())? as f32;
            }
        }
        Ok(Vec3::from_array(result))
    }

    fn transform(&self, at: At) -> Result<glam::Mat4> {
        let mut steps = Vec::new();
        for child in at.children() {
            let loc = child.loc();
            steps.push(match child.tag() {
                "translate" => transform::translate(self.vector(child, 0.0)?),
                "scale" => {
                    let uniform = self.optional(child, "value")?.filter(|text| numbers(text).count() == 1);
                    match uniform {
                        Some(text) => transform::scale(Vec3::splat(number(&text, &loc)? as f32)),
                        None => transform::scale(self.vector(child, 1.0)?),
                    }
                }
                "rotate" => {
                    let angle = number(&self.attribute(child, "angle")?, &loc)?;
                    transform::rotate(self.vector(child, 0.0)?, angle, &loc)?
                }
                "lookat" | "lookAt" | "look_at" => {
                    let [origin, target] = ["origin", "target"].map(|name| self.attribute(child, name));
                    let up = self.optional(child, "up")?;
                    let up = up.map_or(Ok(Vec3::ZERO), |text| triple(&text, &loc))?;
                    transform::look_at(triple(&origin?, &loc)?, triple(&target?, &loc)?, up, &loc)?
                }
                "matrix" => transform::matrix(&all_numbers(&self.attribute(child, "value")?, &loc)?, &loc)?,
                other => {
                    let known = "translate, scale, rotate, lookat, matrix";
                    return Err(loc.invalid(format!("unknown transform <{other}>; there are {known}")));
                }
            });
        }
        Ok(transform::chain(&steps))
    }
}

fn numbers(text: &str) -> impl Iterator<Item = &str> {
    text.split(|c: char| c == ',' || c.is_whitespace()).filter(|part| !part.is_empty())
}

fn all_numbers(text: &str, loc: &SourceLoc) -> Result<Vec<f64>> {
    numbers(text).map(|part| number(part, loc)).collect()
}

fn number(text: &str, loc: &SourceLoc) -> Result<f64> {
    match text.trim().parse::<f64>() {
        Ok(value) if value.is_finite() => Ok(value),
        _ => Err(loc.invalid(format!("`{text}` is not a finite number"))),
    }
}

fn triple(text: &str, loc: &SourceLoc) -> Result<Vec3> {
    match all_numbers(text, loc)?.as_slice() {
        &[x, y, z] => Ok(vec3(x as f32, y as f32, z as f32)),
        other => Err(loc.invalid(format!("`{text}` has {} numbers; three are needed", other.len()))),
    }
}

/// One number or three.
fn rgb(text: &str, loc: &SourceLoc) -> Result<Rgb> {
    match numbers(text).count() {
        1 => Ok(Rgb::splat(number(text, loc)? as f32)),
        _ => triple(text, loc),
    }
}

/// A display colour: `#rrggbb`, or one or three numbers.
fn srgb(text: &str, loc: &SourceLoc) -> Result<Rgb> {
    let encoded = match text.trim().strip_prefix('#') {
        Some(hex) if hex.len() == 6 => {
            let bits = u32::from_str_radix(hex, 16).map_err(|_| loc.invalid(format!("`{text}` is not #rrggbb")))?;
            vec3((bits >> 16) as f32, (bits >> 8 & 255) as f32, (bits & 255) as f32) / 255.0
        }
        _ => rgb(text, loc)?,
    };
    Ok(Rgb::from_array(encoded.to_array().map(srgb_decode)))
}
