//! Makes foreign text (names in files, paths, variables) safe for a terminal: it must not move the cursor, set a title
//! or change the direction of text.

use std::borrow::Cow;
use std::fmt::Write;

/// Escapes control and formatting characters, such as `\u{1b}`; line breaks stay.
pub fn printable(text: &str) -> Cow<'_, str> {
    escaped(text, |c| c != '\n' && is_dangerous(c), |out, c| write!(out, "{}", c.escape_default()))
}

/// [`printable`] on one line: for names, rows of tables and messages.
pub fn one_line(text: &str) -> Cow<'_, str> {
    escaped(text, is_dangerous, |out, c| write!(out, "{}", c.escape_default()))
}

/// JSON with these characters escaped, too; the values stay the same.
pub fn printable_json(text: &str) -> Cow<'_, str> {
    escaped(
        text,
        |c| c != '\n' && is_dangerous(c),
        |out, c| c.encode_utf16(&mut [0; 2]).iter().try_for_each(|u| write!(out, "\\u{u:04x}")),
    )
}

fn escaped(
    text: &str,
    escape: impl Fn(char) -> bool,
    write: impl Fn(&mut String, char) -> std::fmt::Result,
) -> Cow<'_, str> {
    if !text.contains(&escape) {
        return Cow::Borrowed(text);
    }
    let mut out = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        // Writing to a string cannot fail.
        let _ = if escape(c) { write(&mut out, c) } else { out.write_char(c) };
    }
    Cow::Owned(out)
}

/// Control characters (C0, DEL, C1), line and paragraph separators, and invisible or reordering characters (Unicode 16,
/// general category Cf).
fn is_dangerous(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{ad}' | '\u{600}'..='\u{605}' | '\u{61c}' | '\u{6dd}' | '\u{70f}' | '\u{180e}')
        || matches!(c, '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}')
        || matches!(c, '\u{fff9}'..='\u{fffb}' | '\u{e0000}'..='\u{e007f}')
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cursor_movements_are_escaped() {
        assert!(matches!(printable("Größe 10⁻³ (Mpc/h)³\nnext"), Cow::Borrowed(_)));
        assert_eq!(printable("a\u{1b}]0;title\u{7}b"), "a\\u{1b}]0;title\\u{7}b");
        assert_eq!(printable("\u{9b}2J\u{7f}\r"), "\\u{9b}2J\\u{7f}\\r");
        assert_eq!(printable("a\u{202e}b\u{200b}"), "a\\u{202e}b\\u{200b}");
        assert_eq!(one_line("a\nb\tc"), "a\\nb\\tc");
    }

    #[test]
    fn json_means_the_same() {
        let name = "a\u{9b}2J\u{202e}\u{e0041}\n\u{1b}";
        let text = serde_json::to_string_pretty(&serde_json::json!({ "name": name })).unwrap();
        let shown = printable_json(&text);
        assert!(!shown.chars().any(|c| c != '\n' && is_dangerous(c)), "{shown}");
        assert_eq!(serde_json::from_str::<serde_json::Value>(&shown).unwrap()["name"], name);
    }
}
