//! Foreign text (names in files, paths, variables) on its way out: it must not move a cursor, set a title, change the
//! direction of text, begin a line of its own, be a formula in a spreadsheet or break a document.

use std::borrow::Cow;
use std::fmt::Write;

/// Escapes control and formatting characters, such as `\u{1b}`; line breaks stay.
pub fn printable(text: &str) -> Cow<'_, str> {
    escaped(text, |c| c != '\n' && is_dangerous(c), |out, c| write!(out, "{}", c.escape_default()))
}

/// [`printable`] on one line: for names, rows of tables, comments and messages.
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

/// A text as a cell of a table (CSV): on one line, in quotes where a comma, a quote or a comment's sign would be taken for
/// the table's own (RFC 4180), and behind an apostrophe where a spreadsheet would take it for a formula.
pub fn cell(text: &str) -> String {
    let formula = if text.starts_with(['=', '+', '-', '@', '\t', '\r']) { "'" } else { "" };
    let text = format!("{formula}{}", one_line(text));
    match text.contains([',', '"', '#', ';']) {
        true => format!("\"{}\"", text.replace('"', "\"\"")),
        false => text,
    }
}

/// A text as one word of a command that a shell reads.
pub fn shell_word(text: &str) -> String {
    let plain = |c: char| c.is_ascii_alphanumeric() || "/._-+:,@%=".contains(c);
    if !text.is_empty() && text.chars().all(plain) {
        return text.to_string();
    }
    format!("'{}'", text.replace('\'', "'\\''"))
}

/// A text on one line within XML, also within an attribute's quotes; as [`one_line`] it has no characters that XML lacks.
pub fn xml(text: &str) -> Cow<'_, str> {
    match one_line(text) {
        plain if !plain.contains(['&', '<', '>', '"', '\'']) => plain,
        text => {
            let text = text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
            Cow::Owned(text.replace('"', "&quot;").replace('\'', "&apos;"))
        }
    }
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

/// Control characters (C0, DEL, C1), line and paragraph separators, invisible or reordering characters (Unicode 16,
/// general category Cf), and the two that XML cannot hold.
fn is_dangerous(c: char) -> bool {
    c.is_control()
        || matches!(c, '\u{ad}' | '\u{600}'..='\u{605}' | '\u{61c}' | '\u{6dd}' | '\u{70f}' | '\u{180e}')
        || matches!(c, '\u{200b}'..='\u{200f}' | '\u{2028}'..='\u{202e}' | '\u{2060}'..='\u{206f}' | '\u{feff}')
        || matches!(c, '\u{fff9}'..='\u{fffb}' | '\u{fffe}' | '\u{ffff}' | '\u{e0000}'..='\u{e007f}')
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
        assert_eq!(one_line("a\nb\tc\0"), "a\\nb\\tc\\u{0}");
    }

    #[test]
    fn cells_are_texts_on_one_line() {
        assert_eq!(["Msun/h", "a b", "Größe"].map(cell), ["Msun/h", "a b", "Größe"]);
        assert_eq!(cell("a,\"b\""), "\"a,\"\"b\"\"\"");
        assert_eq!(["=cmd|x", "+1", "-1", "@x"].map(cell), ["'=cmd|x", "'+1", "'-1", "'@x"]);
        assert_eq!([cell("\tx"), cell("a\n=b"), cell("#x")], ["'\\tx", "a\\n=b", "\"#x\""]);
    }

    #[test]
    fn xml_holds_what_is_left() {
        assert_eq!(xml("a < b & \"c\"\u{7}\u{fffe}"), "a &lt; b &amp; &quot;c&quot;\\u{7}\\u{fffe}");
        assert!(matches!(xml("10⁻³ Mpc/h"), Cow::Borrowed(_)));
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
