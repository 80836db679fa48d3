//! The tree of an ASDF file, in YAML. Tags and anchors are passed over.

use crate::TextResult;
use saphyr_parser::{Event, Parser, ScalarStyle};

#[derive(Clone, Debug, PartialEq)]
pub enum TreeValue {
    Text(String),
    List(Vec<TreeValue>),
    Map(Vec<(String, TreeValue)>),
}

/// Values within values at most.
const DEEPEST: usize = 32;

impl TreeValue {
    pub fn get(&self, key: &str) -> Option<&TreeValue> {
        let TreeValue::Map(entries) = self else { return None };
        entries.iter().find(|e| e.0 == key).map(|e| &e.1)
    }

    pub fn text(&self) -> Option<&str> {
        let TreeValue::Text(text) = self else { return None };
        Some(text)
    }

    pub fn list(&self) -> Option<&[TreeValue]> {
        let TreeValue::List(items) = self else { return None };
        Some(items)
    }

    pub fn whole(&self) -> Option<u64> {
        self.text()?.parse().ok()
    }

    /// A finite number.
    pub fn number(&self) -> Option<f64> {
        self.text()?.parse().ok().filter(|n: &f64| n.is_finite())
    }
}

/// The value behind `---`; errors name lines of `text`.
pub fn parse(text: &[u8]) -> TextResult<TreeValue> {
    let start = memchr::memmem::find(text, b"\n---").ok_or("it has no tree (no line `---`)")? + 1;
    let tree = String::from_utf8_lossy(&text[start..]);
    let lines_before = memchr::memchr_iter(b'\n', &text[..start]).count();
    let unreadable =
        |line: usize| format!("line {} of its tree is YAML that this program does not read", lines_before + line);
    // Values that have begun and not ended, from the outermost; a map has its last key while it waits for a value.
    let mut open: Vec<(TreeValue, Option<String>)> = Vec::new();
    for event in Parser::new_from_str(&tree) {
        let (event, span) = event.map_err(|e| unreadable(e.marker().line()))?;
        let value = match event {
            Event::SequenceStart(..) | Event::MappingStart(..) if open.len() == DEEPEST => {
                return Err(unreadable(span.start.line()));
            }
            Event::SequenceStart(..) => {
                open.push((TreeValue::List(Vec::new()), None));
                continue;
            }
            Event::MappingStart(..) => {
                open.push((TreeValue::Map(Vec::new()), None));
                continue;
            }
            Event::SequenceEnd | Event::MappingEnd => open.pop().map(|(value, _)| value),
            Event::Scalar(text, style, ..) if style == ScalarStyle::Plain && text == "~" => {
                Some(TreeValue::Text(String::new()))
            }
            Event::Scalar(text, ..) => Some(TreeValue::Text(text.into_owned())),
            Event::Alias(_) => Some(TreeValue::Text(String::new())),
            Event::DocumentEnd => break,
            _ => None,
        };
        let Some(value) = value else { continue };
        match (open.last_mut(), value) {
            (None, value) => return Ok(value),
            (Some((TreeValue::List(items), _)), value) => items.push(value),
            (Some((TreeValue::Map(entries), key)), value) => match (key.take(), value) {
                (Some(key), value) => entries.push((key, value)),
                (None, TreeValue::Text(text)) => *key = Some(text),
                (None, _) => return Err(unreadable(span.start.line())),
            },
            (Some((TreeValue::Text(_), _)), _) => {}
        }
    }
    Err("its tree is empty".into())
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> TextResult<TreeValue> {
        parse(format!("#ASDF 1.0.0\n%YAML 1.1\n--- !core/asdf-1.1.0\n{text}").as_bytes())
    }

    #[test]
    fn what_the_library_writes_is_read() {
        let text = "asdf_library: !core/software-1.0.0 {author: The ASDF Developers, homepage: 'http://a.org/b',\n  \
            name: asdf, version: 2.9.0}\nhistory:\n  extensions:\n  - !core/extension_metadata-1.0.0\n    \
            class: a.B\n    supported: [blsc]\n  - &id001\n    class: c\n- odd\n";
        assert!(parsed(text).unwrap_err().contains("line 13"), "{:?}", parsed(text));
        let text = text.replace("- odd\n", "data:\n  pack9: !core/ndarray-1.0.0 # here\n    source: 0\n    shape: [4, 9]\n\
            header:\n  Empty:\n  Long: some words that\n    go on\n  'A B': \"it \\\"is\n    so\"\n  List: [-1, [2, '3,]'], {a: b}]\n  \
            Nested:\n  - - 1\n    - 2\n  Lines: |-\n    one\n    two\n  Last: 1.5e3\n");
        let tree = parsed(&text).unwrap();
        assert_eq!(tree.get("asdf_library").unwrap().get("homepage").unwrap().text(), Some("http://a.org/b"));
        let history = tree.get("history").unwrap().get("extensions").unwrap().list().unwrap();
        assert_eq!(history[1].get("class").unwrap().text(), Some("c"));
        let array = tree.get("data").unwrap().get("pack9").unwrap();
        assert_eq!(array.get("source").unwrap().whole(), Some(0));
        assert_eq!(array.get("shape").unwrap().list().unwrap()[1].whole(), Some(9));
        let header = |key: &str| tree.get("header").unwrap().get(key).unwrap().clone();
        let text = |text: &str| TreeValue::Text(text.into());
        assert_eq!(header("Empty"), text(""));
        assert_eq!(header("Long"), text("some words that go on"));
        assert_eq!(header("A B"), text("it \"is so"));
        let inner = TreeValue::List(vec![text("2"), text("3,]")]);
        let map = TreeValue::Map(vec![("a".into(), text("b"))]);
        assert_eq!(header("List"), TreeValue::List(vec![text("-1"), inner, map]));
        assert_eq!(header("Nested"), TreeValue::List(vec![TreeValue::List(vec![text("1"), text("2")])]));
        assert_eq!(header("Lines"), text("one\ntwo"));
        assert_eq!(header("Last").number(), Some(1500.0));
    }

    #[test]
    fn what_is_beyond_is_refused() {
        for text in ["? [a]\n: b\n", "a: [1, 2\n", "a: {b: 1]\n", "a: 'b\n", "a: 1\n   b: 2\n  c: 3\n", "@a\n"] {
            assert!(parsed(text).is_err(), "{text}: {:?}", parsed(text));
        }
        for deep in ["[".repeat(100_000), "{a: ".repeat(100_000), "- ".repeat(100_000)] {
            assert!(parsed(&deep).is_err());
        }
        assert!(parse(b"#ASDF 1.0.0\n").is_err());
    }
}
