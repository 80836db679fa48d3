//! Wraps text for a terminal.

/// Width of a terminal.
pub const COLUMNS: usize = 100;

/// `1 block`, `2 blocks`.
pub fn counted(n: usize, noun: &str) -> String {
    format!("{n} {noun}{}", if n == 1 { "" } else { "s" })
}

/// `lead` and `text`, wrapped at spaces; further lines are indented by `indent` spaces.
pub fn wrapped(lead: &str, text: &str, indent: usize) -> String {
    let (mut out, mut column, mut empty) = (lead.to_string(), lead.chars().count(), true);
    for word in text.split(' ') {
        let width = word.chars().count();
        if !empty && column + 1 + width > COLUMNS {
            out += &format!("\n{:indent$}", "");
            (column, empty) = (indent, true);
        }
        if !empty {
            out.push(' ');
            column += 1;
        }
        out += word;
        column += width;
        empty = false;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn long_rows_are_wrapped_at_spaces() {
        let fields = (0..60).map(|i| format!("Field{i} f32[3]")).collect::<Vec<_>>().join(", ");
        let text = wrapped("  fields           ", &fields, 19);
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines.len() > 5 && lines.iter().all(|l| l.chars().count() <= COLUMNS));
        assert!(lines[1..].iter().all(|l| l.starts_with(&" ".repeat(19))));
        let words = text.split_whitespace().skip(1).collect::<Vec<_>>();
        assert_eq!(words, fields.split_whitespace().collect::<Vec<_>>());
        // What has no blank is left whole, and a short text as it is.
        let long = "x".repeat(200);
        assert_eq!([wrapped("", &long, 19), wrapped("", "a  b", 19)], [long, "a  b".to_string()]);
    }
}
