//! The Python literal in an array's header: strings, numbers, tuples, lists, one dictionary.

#[derive(Clone, Debug, PartialEq)]
pub enum Literal {
    /// `'...'` or `"..."`.
    Text(String),
    Number(u64),
    /// `True` or `False`.
    Flag(bool),
    /// `None`.
    Nothing,
    /// `(...)` or `[...]`.
    List(Vec<Literal>),
    /// `{...}`.
    Map(Vec<(Literal, Literal)>),
}

/// Lists within lists at most: nested records have some.
const DEEPEST: usize = 16;

/// Reads one literal; blanks may follow.
pub fn parse(text: &str) -> Option<Literal> {
    let mut parser = LiteralParser { rest: text };
    let value = parser.value(0)?;
    parser.blanks();
    parser.rest.is_empty().then_some(value)
}

struct LiteralParser<'a> {
    rest: &'a str,
}

impl LiteralParser<'_> {
    fn blanks(&mut self) {
        self.rest = self.rest.trim_start();
    }

    /// Takes `token` if it is next, blanks before it.
    fn take(&mut self, token: &str) -> bool {
        self.blanks();
        match self.rest.strip_prefix(token) {
            Some(rest) => {
                self.rest = rest;
                true
            }
            None => false,
        }
    }

    fn value(&mut self, depth: usize) -> Option<Literal> {
        if depth > DEEPEST {
            return None;
        }
        self.blanks();
        match self.rest.bytes().next()? {
            quote @ (b'\'' | b'"') => self.text(quote as char),
            b'(' => self.list("(", ")", depth),
            b'[' => self.list("[", "]", depth),
            b'{' => self.map(depth),
            b'0'..=b'9' => self.number(),
            _ if self.take("True") => Some(Literal::Flag(true)),
            _ if self.take("False") => Some(Literal::Flag(false)),
            _ if self.take("None") => Some(Literal::Nothing),
            _ => None,
        }
    }

    /// Names of fields are rarely escaped: a backslash keeps what follows it.
    fn text(&mut self, quote: char) -> Option<Literal> {
        let mut out = String::new();
        let mut chars = self.rest.char_indices().skip(1);
        while let Some((at, c)) = chars.next() {
            match c {
                '\\' => out.push(chars.next()?.1),
                c if c == quote => {
                    self.rest = &self.rest[at + 1..];
                    return Some(Literal::Text(out));
                }
                c => out.push(c),
            }
        }
        None
    }

    /// Python 2 wrote an `L` behind some.
    fn number(&mut self) -> Option<Literal> {
        let end = self.rest.bytes().position(|b| !b.is_ascii_digit()).unwrap_or(self.rest.len());
        let number = self.rest[..end].parse().ok()?;
        self.rest = &self.rest[end..];
        self.rest = self.rest.strip_prefix('L').unwrap_or(self.rest);
        Some(Literal::Number(number))
    }

    fn list(&mut self, open: &str, close: &str, depth: usize) -> Option<Literal> {
        self.take(open);
        let mut out = Vec::new();
        while !self.take(close) {
            out.push(self.value(depth + 1)?);
            if !self.take(",") && !self.rest.trim_start().starts_with(close) {
                return None;
            }
        }
        Some(Literal::List(out))
    }

    fn map(&mut self, depth: usize) -> Option<Literal> {
        self.take("{");
        let mut out = Vec::new();
        while !self.take("}") {
            let key = self.value(depth + 1)?;
            if !self.take(":") {
                return None;
            }
            out.push((key, self.value(depth + 1)?));
            if !self.take(",") && !self.rest.trim_start().starts_with('}') {
                return None;
            }
        }
        Some(Literal::Map(out))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headers_are_read() {
        let text = "{'descr': [('x', '<f4'), (\"p\", '<f8', (3,))], 'fortran_order': False, 'shape': (5L, 3), }  \n";
        let Some(Literal::Map(entries)) = parse(text) else { panic!() };
        assert_eq!(entries[2].1, Literal::List(vec![Literal::Number(5), Literal::Number(3)]));
        assert_eq!(entries[1].1, Literal::Flag(false));
        let Literal::List(fields) = &entries[0].1 else { panic!() };
        let text = |s: &str| Literal::Text(s.into());
        let sides = Literal::List(vec![Literal::Number(3)]);
        assert_eq!(fields[1], Literal::List(vec![text("p"), text("<f8"), sides]));
    }

    #[test]
    fn what_is_none_is_refused() {
        for text in ["", "{", "{'a'", "{'a': 1 'b': 2}", "(1 2)", "-1", "'a", "'a\\", "99999999999999999999", "1 2"] {
            assert_eq!(parse(text), None, "{text}");
        }
        assert_eq!(parse(&"[".repeat(100_000)), None);
    }
}
