//! The tree of an ASDF file: what asdf's library writes of YAML. Tags and anchors are passed over.

use crate::TextResult;

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
    let start = memchr::memmem::find(text, b"\n---").ok_or("it has no tree (no line `---`)")?;
    let mut parser = TreeParser { text, at: start + 4 };
    let value = parser.block(-1, false, 0)?;
    parser.blanks();
    if parser.peek().is_some() { Err(parser.fault()) } else { Ok(value) }
}

struct TreeParser<'a> {
    text: &'a [u8],
    at: usize,
}

impl TreeParser<'_> {
    fn fault(&self) -> String {
        let line = 1 + memchr::memchr_iter(b'\n', &self.text[..self.at.min(self.text.len())]).count();
        format!("line {line} of its tree is YAML that this program does not read")
    }

    fn peek(&self) -> Option<u8> {
        self.text.get(self.at).copied()
    }

    /// Whether `mark` comes next, and behind it a blank or an end.
    fn is_mark(&self, mark: u8) -> bool {
        self.peek() == Some(mark) && self.text.get(self.at + 1).is_none_or(u8::is_ascii_whitespace)
    }

    /// Passes over blanks, ends of lines and comments.
    fn blanks(&mut self) {
        while let Some(byte) = self.peek() {
            match byte {
                b'#' if self.at == 0 || self.text[self.at - 1].is_ascii_whitespace() => {
                    self.at += self.text[self.at..].iter().take_while(|&&b| b != b'\n').count();
                }
                b if b.is_ascii_whitespace() => self.at += 1,
                _ => return,
            }
        }
    }

    /// Passes over tags and anchors, and blanks about them.
    fn properties(&mut self) {
        self.blanks();
        while matches!(self.peek(), Some(b'!' | b'&')) {
            let ends = |b: u8| b.is_ascii_whitespace() || b",[]{}".contains(&b);
            self.at += self.text[self.at..].iter().take_while(|&&b| !ends(b)).count();
            self.blanks();
        }
    }

    fn column(&self) -> i64 {
        self.text[..self.at].iter().rev().take_while(|&&b| b != b'\n').count() as i64
    }

    /// The value of what stands at column `parent`: of a key where `of_key` is set, else of a dash or the tree's.
    fn block(&mut self, parent: i64, of_key: bool, depth: usize) -> TextResult<TreeValue> {
        if depth > DEEPEST {
            return Err(self.fault());
        }
        let before = self.at;
        self.properties();
        let same_line = !self.text[before..self.at].contains(&b'\n');
        let column = self.column();
        let is_item = self.is_mark(b'-');
        // Lists may stand at the column of their key.
        let is_own = same_line || column > parent || (of_key && is_item && column == parent);
        let Some(byte) = self.peek().filter(|_| is_own) else { return Ok(TreeValue::Text(String::new())) };
        let may_be_map = !same_line || !of_key;
        match byte {
            b'-' if is_item => self.items(column, depth),
            b'[' | b'{' => self.flow(depth),
            b'|' | b'>' => Ok(TreeValue::Text(self.literal(parent))),
            b'?' if self.is_mark(b'?') => Err(self.fault()),
            b'@' | b'`' | b'%' => Err(self.fault()),
            b'"' | b'\'' => {
                let start = self.at;
                let text = self.quoted()?;
                if !(may_be_map && self.is_mark(b':')) {
                    return Ok(TreeValue::Text(text));
                }
                self.at = start;
                self.map(column, depth)
            }
            _ if may_be_map && self.key_end().is_some() => self.map(column, depth),
            _ => self.plain(parent).map(TreeValue::Text),
        }
    }

    fn items(&mut self, column: i64, depth: usize) -> TextResult<TreeValue> {
        let mut items = Vec::new();
        while self.is_mark(b'-') && self.column() == column {
            self.at += 1;
            items.push(self.block(column, false, depth + 1)?);
            self.blanks();
        }
        Ok(TreeValue::List(items))
    }

    fn map(&mut self, column: i64, depth: usize) -> TextResult<TreeValue> {
        let mut entries = Vec::new();
        while self.peek().is_some() && self.column() == column {
            let key = match self.peek() {
                Some(b'"' | b'\'') => self.quoted()?,
                _ => {
                    let end = self.key_end().ok_or_else(|| self.fault())?;
                    let key = String::from_utf8_lossy(self.text[self.at..end].trim_ascii()).into_owned();
                    self.at = end;
                    key
                }
            };
            if !self.is_mark(b':') {
                return Err(self.fault());
            }
            self.at += 1;
            entries.push((key, self.block(column, true, depth + 1)?));
            self.blanks();
        }
        if self.peek().is_some() && self.column() > column { Err(self.fault()) } else { Ok(TreeValue::Map(entries)) }
    }

    /// The place of the colon that ends a key in this line, if there is one.
    fn key_end(&self) -> Option<usize> {
        let line = self.line();
        let is_end = |&i: &usize| line[i] == b':' && line.get(i + 1).is_none_or(u8::is_ascii_whitespace);
        (0..line.len()).find(is_end).map(|i| self.at + i)
    }

    /// The rest of the line, without a comment.
    fn line(&self) -> &[u8] {
        let rest = &self.text[self.at..];
        let line = &rest[..memchr::memchr(b'\n', rest).unwrap_or(rest.len())];
        &line[..memchr::memmem::find(line, b" #").unwrap_or(line.len())]
    }

    /// Text without quotes, and the lines that go on with it.
    fn plain(&mut self, parent: i64) -> TextResult<String> {
        let mut text = String::new();
        loop {
            if self.key_end().is_some() {
                return Err(self.fault());
            }
            let line = self.line();
            let end = self.at + line.len();
            text += &String::from_utf8_lossy(line.trim_ascii());
            self.at = end;
            self.blanks();
            if self.peek().is_none() || self.column() <= parent {
                return Ok(text);
            }
            text.push(' ');
        }
    }

    /// The lines further to the right than `parent`.
    fn literal(&mut self, parent: i64) -> String {
        let mut text = String::new();
        self.at += self.line().len();
        loop {
            self.blanks();
            if self.peek().is_none() || self.column() <= parent {
                return text;
            }
            let line = self.line();
            text += &String::from_utf8_lossy(line);
            text.push('\n');
            self.at += line.len();
        }
    }

    fn quoted(&mut self) -> TextResult<String> {
        let quote = self.peek();
        let mut text = Vec::new();
        loop {
            self.at += 1;
            match self.peek() {
                None => return Err(self.fault()),
                Some(b'\'') if quote == Some(b'\'') && self.text.get(self.at + 1) == Some(&b'\'') => {
                    text.push(b'\'');
                    self.at += 1;
                }
                Some(b'\\') if quote == Some(b'"') => {
                    self.at += 1;
                    text.extend(self.peek().filter(|&b| b != b'\n'));
                }
                byte if byte == quote => {
                    self.at += 1;
                    return Ok(String::from_utf8_lossy(&text).into_owned());
                }
                Some(b'\n') => {
                    text.truncate(text.trim_ascii_end().len());
                    text.push(b' ');
                    self.blanks_of_line();
                }
                Some(byte) => text.push(byte),
            }
        }
    }

    /// Goes to the last blank before the text of the next line.
    fn blanks_of_line(&mut self) {
        while self.text.get(self.at + 1).is_some_and(u8::is_ascii_whitespace) {
            self.at += 1;
        }
    }

    fn flow(&mut self, depth: usize) -> TextResult<TreeValue> {
        if depth > DEEPEST {
            return Err(self.fault());
        }
        self.properties();
        match self.peek() {
            Some(b'[') => {
                let mut items = Vec::new();
                while self.goes_on(b']', items.is_empty())? {
                    items.push(self.flow(depth + 1)?);
                }
                Ok(TreeValue::List(items))
            }
            Some(b'{') => {
                let mut entries = Vec::new();
                while self.goes_on(b'}', entries.is_empty())? {
                    let TreeValue::Text(key) = self.flow(depth + 1)? else { return Err(self.fault()) };
                    self.blanks();
                    let has_value = self.peek() == Some(b':');
                    self.at += usize::from(has_value);
                    let value = if has_value { self.flow(depth + 1)? } else { TreeValue::Text(String::new()) };
                    entries.push((key, value));
                }
                Ok(TreeValue::Map(entries))
            }
            Some(b'"' | b'\'') => Ok(TreeValue::Text(self.quoted()?)),
            _ => {
                let start = self.at;
                while self.peek().is_some_and(|b| !b",[]{}".contains(&b)) && !self.is_mark(b':') {
                    self.at += 1;
                }
                let words = String::from_utf8_lossy(&self.text[start..self.at]);
                Ok(TreeValue::Text(words.split_ascii_whitespace().collect::<Vec<_>>().join(" ")))
            }
        }
    }

    /// Whether a list or map, which ends with `end`, has another value; passes over what stands before it.
    fn goes_on(&mut self, end: u8, first: bool) -> TextResult<bool> {
        self.blanks();
        let wanted = if first { matches!(self.peek(), Some(b'[' | b'{')) } else { self.peek() == Some(b',') };
        self.at += usize::from(wanted);
        self.blanks();
        match self.peek() {
            Some(byte) if byte == end => {
                self.at += 1;
                Ok(false)
            }
            Some(_) if wanted => Ok(true),
            _ => Err(self.fault()),
        }
    }
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
        assert_eq!(header("Lines"), text("one\ntwo\n"));
        assert_eq!(header("Last").number(), Some(1500.0));
    }

    #[test]
    fn what_is_beyond_is_refused() {
        for text in ["? a\n: b\n", "a: [1, 2\n", "a: {b: 1]\n", "a: 'b\n", "a: 1\n   b: 2\n  c: 3\n", "@a\n"] {
            assert!(parsed(text).is_err(), "{text}: {:?}", parsed(text));
        }
        for deep in ["[".repeat(100_000), "{a: ".repeat(100_000), "- ".repeat(100_000)] {
            assert!(parsed(&deep).is_err());
        }
        assert!(parse(b"#ASDF 1.0.0\n").is_err());
    }
}
