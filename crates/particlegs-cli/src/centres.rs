//! A list of centres: a table of text with x, y, z and perhaps a radius in each line.

use particlegs::progress::Progress;
use particlegs::{Error, Result};
use particlegs_files::input::{Begins, Form, name_of, read_whole};
use std::path::Path;

/// A million centres.
const FORM: Form = Form { title: "a list of centres", begins: Begins::Text, most: 64 << 20, expansion: 16 };

/// A centre, and the radius stated with it.
pub type Centre = ([f64; 3], Option<f64>);

/// Where a line has x, y, z and the radius.
struct Columns {
    position: [usize; 3],
    radius: Option<usize>,
}

/// The first columns.
const FIRST: Columns = Columns { position: [0, 1, 2], radius: Some(3) };

/// Reads a list of centres; `-` is standard input. Words are apart by commas, semicolons or blanks; empty lines and
/// lines that begin with # are passed over. A first line of names says which columns are meant, where it has x, y and
/// z among them.
///
/// # Errors
/// [`Error::Input`] for a line that is not that, and where there is no centre; those of [`read_whole`].
pub fn read(path: &Path, progress: &dyn Progress) -> Result<Vec<Centre>> {
    let bytes = read_whole(path, FORM, progress)?;
    let text = std::str::from_utf8(&bytes).map_err(|_| Error::input(path, "not a list of centres: it is no text"))?;
    parsed(text.trim_start_matches('\u{feff}')).map_err(|what| Error::input(name_of(path), what))
}

fn words(line: &str) -> Vec<&str> {
    // Between separators there may be nothing, between blanks there is always something.
    match line.contains([',', ';']) {
        true => line.split([',', ';']).map(str::trim).collect(),
        false => line.split_whitespace().collect(),
    }
}

fn parsed(text: &str) -> std::result::Result<Vec<Centre>, String> {
    let lines = text.lines().enumerate().map(|(i, l)| (i + 1, l.trim()));
    let mut rows = lines.filter(|(_, l)| !l.is_empty() && !l.starts_with('#')).peekable();
    let head = rows.next_if(|(_, l)| words(l).iter().all(|w| w.parse::<f64>().is_err()));
    let columns = head.map_or(FIRST, |(_, l)| named(&words(l)));
    let centres = rows.map(|(i, l)| centre(&words(l), &columns).map_err(|what| format!("line {i}: {what}")));
    let centres: Vec<Centre> = centres.collect::<std::result::Result<_, _>>()?;
    if centres.is_empty() { Err("no centres in it".into()) } else { Ok(centres) }
}

/// The columns of these names; the first ones where x, y and z are not among them.
fn named(names: &[&str]) -> Columns {
    let at = |wanted: &[&str]| names.iter().position(|n| wanted.iter().any(|w| n.eq_ignore_ascii_case(w)));
    match [at(&["x"]), at(&["y"]), at(&["z"])] {
        [Some(x), Some(y), Some(z)] => {
            Columns { position: [x, y, z], radius: at(&["r", "radius", "rvir", "r200", "r200c", "r200m"]) }
        }
        _ => FIRST,
    }
}

fn centre(words: &[&str], columns: &Columns) -> std::result::Result<Centre, String> {
    let number = |column: usize| -> std::result::Result<f64, String> {
        let word = words.get(column).ok_or_else(|| format!("{} columns are too few for x, y and z", words.len()))?;
        let value = word.parse::<f64>().ok().filter(|v| v.is_finite());
        value.ok_or_else(|| format!("`{}` is not a finite number", word.chars().take(40).collect::<String>()))
    };
    let [x, y, z] = columns.position.map(number);
    let radius = match columns.radius.filter(|r| words.get(*r).is_some_and(|w| !w.is_empty())) {
        Some(column) => Some(number(column)?),
        None => None,
    };
    if let Some(r) = radius.filter(|r| *r <= 0.0) {
        return Err(format!("the radius {r} is not above 0"));
    }
    Ok(([x?, y?, z?], radius))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tables_of_every_kind_are_read() {
        let two = vec![([1.0, 2.0, 3.0], None), ([4.0, 5.0, -6.0], None)];
        for text in ["1,2,3\n4,5,-6\n", "x y z\n1 2 3\n\n# more\n4\t5 -6e0", "a;b;c\r\n1; 2;3\r\n4;5;-6"] {
            assert_eq!(parsed(text).unwrap(), two, "{text}");
        }
        assert_eq!(parsed("1 2 3 0.5\n").unwrap(), [([1.0, 2.0, 3.0], Some(0.5))]);
        let named = parsed("id,Radius,mass,z,y,x\n7,0.5,9,3,2,1\n8,,9,3,2,1\n").unwrap();
        assert_eq!(named, [([1.0, 2.0, 3.0], Some(0.5)), ([1.0, 2.0, 3.0], None)]);
    }

    #[test]
    fn what_is_no_list_is_refused_by_its_line() {
        for (text, what) in [
            ("", "no centres"),
            ("x,y,z\n", "no centres"),
            ("1,2,3\n1,2\n", "line 2: 2 columns"),
            ("1,2,3\n1,b,3\n", "line 2: `b` is not"),
            ("1,2,inf\n", "line 1: `inf` is not"),
            ("1,2,3,-1\n", "line 1: the radius -1"),
            ("1,2,3,NaN\n", "`NaN` is not"),
        ] {
            let refused = parsed(text).unwrap_err();
            assert!(refused.contains(what), "{text}: {refused}");
        }
    }
}
