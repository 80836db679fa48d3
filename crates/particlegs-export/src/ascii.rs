//! Texts for files that hold nothing but ASCII.

/// On one line, with an escape for what is not ASCII: many heads hold nothing else.
pub fn ascii(text: &str) -> String {
    let plain = |c: char| c == ' ' || c.is_ascii_graphic();
    text.chars().map(|c| if plain(c) { c.to_string() } else { c.escape_default().to_string() }).collect()
}
