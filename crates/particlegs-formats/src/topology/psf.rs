//! PSF, of X-PLOR, CHARMM and NAMD: the atoms of a system with their types and masses, and no positions:
//! <https://www.ks.uiuc.edu/Training/Tutorials/namd/namd-tutorial-unix-html/node23.html>.

use super::elements::substance;
use super::{AtomRow, Topology};
use crate::format::{FileHead, is_whole};
use crate::text::content::{TextContent, TextPosition};
use crate::text::lines::LineReader;
use crate::text::split::{Separator, number, shown, tokens};
use particlegs_core::{Error, Result};
use std::path::Path;

pub fn is_psf(head: &FileHead) -> bool {
    matches!(head.words(0).first(), Some(&b"PSF"))
}

/// Bytes of number, segment, residue's number, residue, name, type, charge and mass: of files of CHARMM and X-PLOR, of
/// wide ones (EXT), and of wide ones with types in letters (XPLOR).
const COLUMNS: [[[usize; 2]; 8]; 3] = [
    [[0, 8], [9, 13], [14, 18], [19, 23], [24, 28], [29, 33], [34, 48], [48, 62]],
    [[0, 10], [11, 19], [20, 28], [29, 37], [38, 46], [47, 51], [52, 66], [66, 80]],
    [[0, 10], [11, 19], [20, 28], [29, 37], [38, 46], [47, 53], [54, 68], [68, 82]],
];

pub fn read(path: &Path) -> Result<Topology> {
    let content = TextContent::open(path)?;
    let mut lines = LineReader::open(&content, TextPosition::START, None)?;
    let error = |line: u64, message: String| Error::input(path, format!("line {line}: {message}"));
    let first = lines.line()?.unwrap_or_default();
    let has = |flag: &[u8]| tokens(first, Separator::Blanks).contains(&flag);
    // Letters for types change the widths of wide files alone.
    let columns = &COLUMNS[usize::from(has(b"EXT")) * (1 + usize::from(has(b"XPLOR")))];
    let count = loop {
        let Some(line) = lines.line()? else { return Err(Error::input(path, "it has no section !NATOM")) };
        if let [count, b"!NATOM" | b"!NATOM:", ..] = tokens(line, Separator::Blanks)[..] {
            let count = std::str::from_utf8(count).ok().and_then(|text| text.parse::<u64>().ok());
            break count.ok_or_else(|| Error::input(path, "the number of atoms is damaged"))?;
        }
    };
    let mut topology = Topology { mass_unit: Some("amu"), ..Topology::new(path) };
    for have in 0..count {
        let at = lines.place().line;
        let Some(line) = lines.line()?.filter(|line| !line.trim_ascii().is_empty()) else {
            return Err(error(at, format!("the file states {count} atoms, but only {have} lines follow")));
        };
        let row = by_columns(line, columns).or_else(|| by_words(line));
        let row = row.ok_or_else(|| error(at, format!("{} does not describe an atom", shown(line))))?;
        topology.species.push(substance(row.residue));
        topology.push(row)?;
    }
    Ok(topology)
}

fn row<'a>(values: [&'a [u8]; 8]) -> Option<AtomRow<'a>> {
    let [_, _, residue_number, residue, name, kind, charge, mass] = values;
    // A letter that tells insertions apart may follow.
    let digits = residue_number.iter().rposition(u8::is_ascii_digit)? + 1;
    let residue_number = Some(std::str::from_utf8(&residue_number[..digits]).ok()?.parse().ok()?);
    let mass = number(mass).filter(|m| m.is_finite() && *m >= 0.0)?;
    number(charge)?;
    let has_names = !name.is_empty() && !residue.is_empty() && !kind.is_empty();
    has_names.then_some(AtomRow {
        name,
        residue,
        residue_number,
        kind: Some(kind),
        mass: Some(mass),
        ..AtomRow::default()
    })
}

/// The row of a line in which each value has its own bytes, and blanks before and behind.
fn by_columns<'a>(line: &'a [u8], columns: &[[usize; 2]; 8]) -> Option<AtomRow<'a>> {
    let values = columns.map(|[start, end]| line.get(start..line.len().min(end)).unwrap_or_default().trim_ascii());
    let is_gap = columns[..6].iter().all(|c| line.get(c[1]).is_none_or(|&b| b == b' '));
    let is_apart = is_gap && values.iter().all(|v| !v.contains(&b' ')) && is_whole(values[0]);
    row(values).filter(|_| is_apart)
}

/// The row of a line of words, as NAMD has it: nine, for where one is missing the others mean something else.
fn by_words(line: &[u8]) -> Option<AtomRow<'_>> {
    let words: Vec<&[u8]> = line.split(u8::is_ascii_whitespace).filter(|word| !word.is_empty()).collect();
    row(words.get(..9)?[..8].try_into().ok()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Result<Topology> {
        read(crate::testing::scratch(text.as_bytes()).path())
    }

    fn words(topology: &Topology, atom: usize) -> [&str; 4] {
        [&topology.names, &topology.residues, &topology.types, &topology.elements].map(|column| column.get(atom))
    }

    #[test]
    fn narrow_wide_and_free_rows_are_read() {
        let atoms =
            |head: &str, rows: &str| parsed(&format!("{head}\n\n       1 !NTITLE\n\n       2 !NATOM\n{rows}\n"));
        let narrow = "       1 4AKE 1    MET  N    NH3   -0.300000       14.0070           0\n\
                      \u{20}      2 4AKE 52A  MET  HT1  HC     0.330000        1.0080           0";
        let wide = "         1 4AKE     1        MET      N        NH3    -0.300000       14.0070           0\n\
                    \u{20}        2          52       MET      HT1      HC      0.330000        1.0080           0";
        let numbered = "         1 4AKE     1        MET      N          54  -0.300000      14.0070           0\n\
                        \u{20}        2 4AKE     52       MET      HT1         3   0.330000       1.0080           0";
        let free = "1 A 1 MET N NH3 -0.3 14.007 0\n2 A 52 MET HT1 HC 0.33 1.008 0";
        for (head, rows) in [
            ("PSF", narrow),
            ("PSF EXT XPLOR", wide),
            ("PSF EXT CMAP", numbered),
            ("PSF NAMD", free),
            ("PSF CMAP", free),
        ] {
            let topology = atoms(head, rows).unwrap_or_else(|e| panic!("{head}: {e}"));
            assert_eq!(
                (&topology.masses[..], &topology.residue_numbers[..]),
                (&[14.007, 1.008][..], &[1, 52][..]),
                "{head}"
            );
            let kinds = if head.contains("CMAP") && rows == numbered { ["54", "3"] } else { ["NH3", "HC"] };
            assert_eq!(words(&topology, 0), ["N", "MET", kinds[0], "N"]);
            assert_eq!(words(&topology, 1), ["HT1", "MET", kinds[1], "H"]);
        }
        // A word less, and every number behind it would mean something else.
        let less = atoms("PSF NAMD", "1 1 MET N NH3 -0.3 14.007 0").map(drop).unwrap_err().to_string();
        assert!(less.contains("line 6: `1 1 MET N NH3 -0.3 14.00...` does not describe an atom"), "{less}");
        let cut = atoms("PSF", "1 A 1 MET N NH3 -0.3 14.007 0").map(drop).unwrap_err().to_string();
        assert!(cut.contains("the file states 2 atoms, but only 1 lines follow"), "{cut}");
        assert!(parsed("PSF\n").map(drop).unwrap_err().to_string().contains("no section !NATOM"));
    }
}
