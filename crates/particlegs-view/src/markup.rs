//! Escapes text for HTML.

use serde::Serialize;

/// Text between tags or in a quoted attribute.
pub fn text(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            c => out.push(c),
        }
    }
    out
}

/// A file's name as a relative address.
pub fn path_segment(name: &str) -> String {
    let plain = |b: &u8| b.is_ascii_alphanumeric() || b"-._~".contains(b);
    name.bytes().map(|b| if plain(&b) { char::from(b).to_string() } else { format!("%{b:02X}") }).collect()
}

/// JSON for a script element, without any `<` that could end it.
pub fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).expect("plain data").replace('<', "\\u003c")
}

/// Whether a browser reads the text inside a script or style element as the same bytes. It must not end the element or
/// begin what HTML calls an escaped script, and its line ends must be the ones that browsers keep.
#[cfg(test)]
pub fn can_stand_inside(text: &str) -> bool {
    let lower = text.to_ascii_lowercase();
    let no = ["</script", "</style", "<!--", "<script", "\r", "\0"];
    no.iter().all(|n| !lower.contains(n))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn addresses_of_any_name() {
        assert_eq!(path_segment("run-1_a.pgs"), "run-1_a.pgs");
        assert_eq!(path_segment("a b#1:ä%.pgs"), "a%20b%231%3A%C3%A4%25.pgs");
    }

    #[test]
    fn nothing_ends_the_element_that_it_stands_in() {
        assert_eq!(text("a<b>&\"'ä"), "a&lt;b&gt;&amp;&quot;&#39;ä");
        let hostile = "</script><script>alert(1)</script><!-- \" \u{2028}";
        let json = json(&hostile);
        assert!(!json.contains('<'));
        assert_eq!(serde_json::from_str::<String>(&json).unwrap(), hostile);
        for bad in ["x</SCRIPT >", "<!-- ", "a\r\n", "<ScRiPt"] {
            assert!(!can_stand_inside(bad), "{bad}");
        }
        assert!(can_stand_inside("if (a < b && c > d) x = '<p>';\n"));
    }
}
