//! The text of a scene file as a tree of elements, as forgiving as pugixml is, which Mitsuba reads its files with: any
//! Unicode encoding or Latin-1, text around the elements, bare ampersands, dashes in comments.

use std::path::Path;

use quick_xml::Reader;
use quick_xml::events::{BytesStart, Event};

use crate::error::{Result, SourceLoc};

/// Elements nested deeper than this are taken for a mistake.
const MAX_DEPTH: usize = 64;

/// An element with everything in it but text.
#[derive(Default)]
pub struct Element {
    /// Its name.
    pub tag: String,
    /// Line of the file, from 1.
    pub line: u32,
    /// The elements in it, in order.
    pub children: Vec<Element>,
    attributes: Vec<(String, String)>,
}

impl Element {
    /// The value of an attribute.
    pub fn attribute(&self, name: &str) -> Option<&str> {
        let found = self.attributes.iter().find(|(other, _)| other == name)?;
        Some(&found.1)
    }
}

/// Text in the encoding that its byte order mark or its declaration names. What is no UTF-8 without naming an encoding
/// is taken as Latin-1, in which any bytes are text.
pub fn decode(bytes: &[u8]) -> String {
    let utf16 = |rest: &[u8], word: fn([u8; 2]) -> u16| {
        let words: Vec<_> = rest.chunks_exact(2).map(|pair| word([pair[0], pair[1]])).collect();
        String::from_utf16_lossy(&words)
    };
    let utf32 = |rest: &[u8], word: fn([u8; 4]) -> u32| {
        let words = rest.chunks_exact(4).map(|four| word([four[0], four[1], four[2], four[3]]));
        words.map(|word| char::from_u32(word).unwrap_or(char::REPLACEMENT_CHARACTER)).collect()
    };
    match bytes {
        [0xff, 0xfe, 0, 0, rest @ ..] => utf32(rest, u32::from_le_bytes),
        [0, 0, 0xfe, 0xff, rest @ ..] => utf32(rest, u32::from_be_bytes),
        [0xff, 0xfe, rest @ ..] => utf16(rest, u16::from_le_bytes),
        [0xfe, 0xff, rest @ ..] => utf16(rest, u16::from_be_bytes),
        [b'<', 0, 0, 0, ..] => utf32(bytes, u32::from_le_bytes),
        [0, 0, 0, b'<', ..] => utf32(bytes, u32::from_be_bytes),
        [b'<', 0, ..] => utf16(bytes, u16::from_le_bytes),
        [0, b'<', ..] => utf16(bytes, u16::from_be_bytes),
        [0xef, 0xbb, 0xbf, rest @ ..] => String::from_utf8_lossy(rest).into_owned(),
        _ if declares_latin1(bytes) => latin1(bytes),
        _ => String::from_utf8(bytes.to_vec()).unwrap_or_else(|_| latin1(bytes)),
    }
}

fn latin1(bytes: &[u8]) -> String {
    bytes.iter().map(|&byte| char::from(byte)).collect()
}

/// Whether the declaration at the start of a file names Latin-1.
fn declares_latin1(bytes: &[u8]) -> bool {
    let text = bytes.trim_ascii_start();
    let end = text.windows(2).position(|pair| pair == b"?>").unwrap_or(0);
    let declaration = String::from_utf8_lossy(&text[..end]).to_ascii_lowercase();
    declaration.starts_with("<?xml") && ["iso-8859-1", "latin1"].iter().any(|name| declaration.contains(name))
}

/// The first element of a text. What stands before it and after it is ignored.
pub fn parse(path: &Path, text: &str) -> Result<Element> {
    let mut reader = Reader::from_str(text);
    reader.config_mut().allow_dangling_amp = true;
    let mut lines = Lines { text, line: 1, position: 0 };
    let mut open: Vec<Element> = Vec::new();
    loop {
        let line = lines.at(reader.buffer_position());
        let loc = || SourceLoc::line(path, line);
        let event = reader.read_event().map_err(|error| {
            let line = lines.at(reader.error_position());
            SourceLoc::line(path, line).invalid(format!("not readable as XML: {error}"))
        })?;
        let closed = match event {
            Event::Start(start) => {
                if open.len() >= MAX_DEPTH {
                    return Err(loc().invalid(format!("elements nested more than {MAX_DEPTH} deep")));
                }
                open.push(element(&start, line).map_err(|what| loc().invalid(what))?);
                continue;
            }
            Event::Empty(start) => Some(element(&start, line).map_err(|what| loc().invalid(what))?),
            Event::End(_) => open.pop(),
            Event::Eof => {
                return Err(match open.last() {
                    Some(Element { tag, line, .. }) => {
                        SourceLoc::line(path, *line).invalid(format!("<{tag}> is never closed: the file ends before"))
                    }
                    None => SourceLoc::file(path).invalid("there is no XML element in the file"),
                });
            }
            _ => None,
        };
        match (closed, open.last_mut()) {
            (Some(closed), Some(parent)) => parent.children.push(closed),
            (Some(root), None) => return Ok(root),
            (None, _) => {}
        }
    }
}

/// Line numbers of rising positions.
struct Lines<'a> {
    text: &'a str,
    line: u32,
    position: usize,
}

impl Lines<'_> {
    fn at(&mut self, position: u64) -> u32 {
        let bytes = self.text.as_bytes();
        let end = (position as usize).clamp(self.position, bytes.len());
        self.line += bytes[self.position..end].iter().filter(|&&byte| byte == b'\n').count() as u32;
        self.position = end;
        self.line
    }
}

/// The start of an element. Of an attribute that is given twice the first counts.
fn element(start: &BytesStart, line: u32) -> Result<Element, String> {
    let mut attributes = Vec::new();
    for attribute in start.attributes().with_checks(false) {
        let attribute = attribute.map_err(|error| format!("an attribute is malformed: {error}"))?;
        attributes.push((attribute.key.as_ref().to_owned(), unescape(&attribute.value)));
    }
    Ok(Element { tag: start.name().as_ref().to_owned(), line, children: Vec::new(), attributes })
}

/// Replaces the entities of XML; an ampersand that starts none stands for itself.
fn unescape(text: &str) -> String {
    let mut result = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(start) = rest.find('&') {
        result.push_str(&rest[..start]);
        rest = &rest[start + 1..];
        // No entity is longer than the number of a character.
        let end = rest.bytes().take(10).position(|byte| byte == b';');
        match end.and_then(|end| Some((entity(&rest[..end])?, end))) {
            Some((character, end)) => {
                result.push(character);
                rest = &rest[end + 1..];
            }
            None => result.push('&'),
        }
    }
    result + rest
}

fn entity(name: &str) -> Option<char> {
    match name {
        "amp" => Some('&'),
        "lt" => Some('<'),
        "gt" => Some('>'),
        "quot" => Some('"'),
        "apos" => Some('\''),
        _ => {
            let number = name.strip_prefix('#')?;
            let code = match number.strip_prefix(['x', 'X']) {
                Some(hex) => u32::from_str_radix(hex, 16),
                None => number.parse(),
            };
            char::from_u32(code.ok()?)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn id(bytes: &[u8]) -> String {
        let root = parse(Path::new("t.xml"), &decode(bytes)).unwrap();
        root.children[0].attribute("id").unwrap().to_owned()
    }

    #[test]
    fn every_encoding_gives_the_same_text() {
        let text = "<scene>\n<shape id='K\u{e4}se'/></scene>";
        let marked = format!("\u{feff}{text}");
        let latin1: Vec<u8> = text.chars().map(|c| c as u8).collect();
        let declared = [b"<?xml version='1.0' encoding='ISO-8859-1'?>", latin1.as_slice()].concat();
        let words = |text: &str, turn: fn(u16) -> [u8; 2]| text.encode_utf16().flat_map(turn).collect::<Vec<u8>>();
        let longs = |turn: fn(u32) -> [u8; 4]| marked.chars().flat_map(|c| turn(c as u32)).collect::<Vec<u8>>();
        for bytes in [
            text.as_bytes().to_vec(),
            marked.as_bytes().to_vec(),
            latin1,
            declared,
            words(&marked, u16::to_le_bytes),
            words(&marked, u16::to_be_bytes),
            words(text, u16::to_le_bytes),
            words(text, u16::to_be_bytes),
            longs(u32::to_le_bytes),
            longs(u32::to_be_bytes),
        ] {
            assert_eq!(id(&bytes), "K\u{e4}se", "{bytes:?}");
        }
    }

    #[test]
    fn what_pugixml_reads_is_read() {
        for (text, expected) in [
            ("\n\n<?xml version='1.0' encoding='utf-8'?><scene><a id='1'/></scene>", "1"),
            ("hello <scene>text<a id='1'>more</a></scene> after & <b", "1"),
            ("<!DOCTYPE scene SYSTEM 'x.dtd'><scene><a id='1'/></scene>\0\0", "1"),
            ("<scene><!-- a -- b ---- c ---><a id='1'/></scene>", "1"),
            (
                "<scene><a id='a & b &foo; &#65;&#x42; &lt;&gt;&amp;&quot;&apos; &#xffffff;'/></scene>",
                "a & b &foo; AB <>&\"' &#xffffff;",
            ),
            ("<scene><a id='a<b>c' id='2'/></scene>", "a<b>c"),
        ] {
            assert_eq!(id(text.as_bytes()), expected, "{text}");
        }
    }

    #[test]
    fn mistakes_are_named_with_their_line() {
        for (text, expected) in [
            ("<scene>\n<a>\n</scene>", "t.xml:3: not readable"),
            ("<scene>\n<a>", "t.xml:2: <a> is never closed"),
            ("<scene>\n<a b></scene>", "t.xml:2: an attribute is malformed"),
            ("nothing", "t.xml: there is no XML element"),
        ] {
            let message = parse(Path::new("t.xml"), text).err().unwrap().to_string();
            assert!(message.starts_with(expected), "{text}: {message}");
        }
    }
}
