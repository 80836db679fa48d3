//! Selections of atoms, in words that users of MDAnalysis and VMD know: `name OW and resid 1:10`.

use super::elements::substance;
use super::{Topology, WordColumn};
use crate::TextResult;
use particlegs_core::{Error, Result};
use serde::{Deserialize, Serialize};

/// A selection of atoms, as its text says.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "String", into = "String")]
pub struct AtomSelection {
    text: String,
    test: AtomTest,
}

#[derive(Clone, Debug, PartialEq)]
enum AtomTest {
    All,
    Protein,
    Water,
    /// One of these, in which `*` stands for any letters.
    Word(AtomProperty, Vec<String>),
    /// Within one of these ranges, ends included.
    Number(AtomProperty, Vec<[i64; 2]>),
    Not(Box<AtomTest>),
    And(Vec<AtomTest>),
    Or(Vec<AtomTest>),
}

particlegs_core::named_values! {
    /// A property of an atom, by its word.
    #[derive(Clone, Copy, Debug, PartialEq, Eq)]
    enum AtomProperty {
        Name = "name",
        Residue = "resname",
        ResidueNumber = "resid",
        Element = "element",
        Type = "type",
        Index = "index",
    }
}

/// Words that are no values.
const WORDS: [&str; 6] = ["and", "or", "not", "all", "protein", "water"];
/// Parentheses and `not` within each other.
const MOST_DEPTH: usize = 64;

impl AtomSelection {
    /// Parses `name OW and resid 1:10`: `name`, `resname`, `resid`, `element`, `type` and `index` with values, `protein`,
    /// `water`, `all`, `not`, `and`, `or`, parentheses.
    ///
    /// # Errors
    /// Text that cannot be understood, or that MDAnalysis and VMD understand differently.
    pub fn parse(text: &str) -> Result<AtomSelection> {
        let test =
            parsed(text).map_err(|e| Error::argument(format!("the selection `{}`: {e}", text.escape_debug())))?;
        Ok(AtomSelection { text: text.into(), test })
    }

    /// Numbers of the atoms that are chosen.
    pub(crate) fn atoms(&self, topology: &Topology) -> TextResult<Vec<u32>> {
        let test = self.test.predicate(topology)?;
        Ok((0..topology.count).filter(|&atom| test(atom)).map(|atom| atom as u32).collect())
    }

    /// Whether it asks for elements.
    pub(crate) fn asks_for_elements(&self) -> bool {
        self.test.asks_for_elements()
    }
}

impl TryFrom<String> for AtomSelection {
    type Error = Error;

    fn try_from(text: String) -> Result<AtomSelection> {
        AtomSelection::parse(&text)
    }
}

impl From<AtomSelection> for String {
    fn from(selection: AtomSelection) -> String {
        selection.text
    }
}

impl std::fmt::Display for AtomSelection {
    fn fmt(&self, to: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        to.write_str(&self.text)
    }
}

fn parsed(text: &str) -> TextResult<AtomTest> {
    let spaced = text.replace('(', " ( ").replace(')', " ) ");
    let mut parser = SelectionParser { words: spaced.split_whitespace().collect(), at: 0, depth: 0 };
    let all = parser.any()?;
    match parser.next() {
        None => Ok(all),
        Some(")") => Err("a `)` has no `(`".into()),
        Some(word) => Err(format!("`and` or `or` is missing before `{}`", word.escape_debug())),
    }
}

struct SelectionParser<'t> {
    words: Vec<&'t str>,
    at: usize,
    depth: usize,
}

impl<'t> SelectionParser<'t> {
    fn peek(&self) -> Option<&'t str> {
        self.words.get(self.at).copied()
    }

    fn next(&mut self) -> Option<&'t str> {
        self.at += 1;
        self.words.get(self.at - 1).copied()
    }

    fn takes(&mut self, word: &str) -> bool {
        let is_next = self.peek() == Some(word);
        self.at += usize::from(is_next);
        is_next
    }

    fn any(&mut self) -> TextResult<AtomTest> {
        let mut parts = vec![self.every()?];
        while self.takes("or") {
            parts.push(self.one()?);
            if self.peek() == Some("and") {
                return Err("`a or b and c` means two things in MDAnalysis and VMD: add parentheses".into());
            }
        }
        Ok(if parts.len() == 1 { parts.remove(0) } else { AtomTest::Or(parts) })
    }

    fn every(&mut self) -> TextResult<AtomTest> {
        let mut parts = vec![self.one()?];
        while self.takes("and") {
            parts.push(self.one()?);
        }
        Ok(if parts.len() == 1 { parts.remove(0) } else { AtomTest::And(parts) })
    }

    fn one(&mut self) -> TextResult<AtomTest> {
        self.depth += 1;
        if self.depth > MOST_DEPTH {
            return Err(format!("more than {MOST_DEPTH} levels of parentheses"));
        }
        let one = match self.next() {
            Some("(") => {
                let inner = self.any()?;
                if !self.takes(")") {
                    return Err("a `(` has no `)`".into());
                }
                inner
            }
            Some("not") => AtomTest::Not(self.one()?.into()),
            Some("all") => AtomTest::All,
            Some("protein") => AtomTest::Protein,
            Some("water") => AtomTest::Water,
            Some(word) => match AtomProperty::ALL.into_iter().find(|property| property.name() == word) {
                Some(property) => self.values(property)?,
                None => {
                    let known: Vec<&str> = AtomProperty::ALL.iter().map(|p| p.name()).chain(WORDS).collect();
                    return Err(format!("`{}` is not one of {}", word.escape_debug(), known.join(", ")));
                }
            },
            None => return Err("it ends too early".into()),
        };
        self.depth -= 1;
        Ok(one)
    }

    fn values(&mut self, property: AtomProperty) -> TextResult<AtomTest> {
        let mut values = Vec::new();
        while let Some(word) = self.peek() {
            let is_word = WORDS.contains(&word) || AtomProperty::ALL.iter().any(|p| p.name() == word);
            if is_word || ["(", ")"].contains(&word) {
                break;
            }
            values.push(word);
            self.at += 1;
        }
        if values.is_empty() {
            return Err(format!("`{}` needs a value", property.name()));
        }
        Ok(match property {
            AtomProperty::ResidueNumber | AtomProperty::Index => {
                AtomTest::Number(property, values.into_iter().map(range).collect::<TextResult<_>>()?)
            }
            _ => AtomTest::Word(property, values.into_iter().map(String::from).collect()),
        })
    }
}

/// `7`, `1:10` or `1-10`.
fn range(word: &str) -> TextResult<[i64; 2]> {
    // A minus in front is a sign.
    let cut = word.find(':').or_else(|| Some(word.char_indices().skip(1).find(|(_, c)| *c == '-')?.0));
    let [low, high] = cut.map_or([word; 2], |at| [&word[..at], &word[at + 1..]]);
    match (low.parse(), high.parse()) {
        (Ok(low), Ok(high)) if low <= high => Ok([low, high]),
        _ => Err(format!("`{}` is not a number or a range such as 1:10", word.escape_debug())),
    }
}

/// Whether `pattern`, in which `*` stands for any letters, fits all of `word`.
fn fits(pattern: &str, word: &str) -> bool {
    let Some((first, rest)) = pattern.split_once('*') else { return pattern == word };
    let Some(mut left) = word.strip_prefix(first) else { return false };
    let mut parts: Vec<&str> = rest.split('*').collect();
    let last = parts.pop().unwrap_or_default();
    for part in parts {
        // The first place of a part leaves the most for those behind it.
        let Some(at) = left.find(part) else { return false };
        left = &left[at + part.len()..];
    }
    left.ends_with(last)
}

type AtomPredicate<'t> = Box<dyn Fn(usize) -> bool + 't>;

impl AtomTest {
    fn predicate<'t>(&self, topology: &'t Topology) -> TextResult<AtomPredicate<'t>> {
        let of_words =
            |column: &'t WordColumn, noun: &str, chooses: &dyn Fn(&str) -> bool| -> TextResult<AtomPredicate<'t>> {
                if column.words.iter().all(String::is_empty) && topology.count > 0 {
                    return Err(format!("{} states no {noun}", topology.place));
                }
                // A word is tested once, not once for each atom that has it.
                let chosen: Vec<bool> = column.words.iter().map(|word| chooses(word)).collect();
                Ok(Box::new(move |atom| chosen[column.of[atom] as usize]))
            };
        let is = |kind: &'static [u8]| move |residue: &str| substance(residue.as_bytes()) == kind;
        let tests =
            |parts: &[AtomTest]| parts.iter().map(|part| part.predicate(topology)).collect::<TextResult<Vec<_>>>();
        Ok(match self {
            AtomTest::All => Box::new(|_| true),
            AtomTest::Protein => of_words(&topology.residues, "residues", &is(b"protein"))?,
            AtomTest::Water => of_words(&topology.residues, "residues", &is(b"water"))?,
            AtomTest::Word(property, values) => {
                let (column, noun) = match property {
                    AtomProperty::Residue => (&topology.residues, "residues"),
                    AtomProperty::Element => (&topology.elements, "elements"),
                    AtomProperty::Type => (&topology.types, "types of atoms"),
                    _ => (&topology.names, "names of atoms"),
                };
                // Files write symbols of elements in either case.
                let exact = *property != AtomProperty::Element;
                let one = |value: &String, word: &str| {
                    if exact { fits(value, word) } else { value.eq_ignore_ascii_case(word) }
                };
                of_words(column, noun, &|word| !word.is_empty() && values.iter().any(|value| one(value, word)))?
            }
            AtomTest::Number(property, ranges) => {
                let ranges = ranges.clone();
                let within = move |number: i64| ranges.iter().any(|[low, high]| (*low..=*high).contains(&number));
                match property {
                    AtomProperty::Index => Box::new(move |atom| within(atom as i64)),
                    _ if topology.residue_numbers.len() < topology.count => {
                        return Err(format!("{} states no numbers of residues", topology.place));
                    }
                    _ => Box::new(move |atom| within(topology.residue_numbers[atom])),
                }
            }
            AtomTest::Not(inner) => {
                let inner = inner.predicate(topology)?;
                Box::new(move |atom| !inner(atom))
            }
            AtomTest::And(parts) => {
                let parts = tests(parts)?;
                Box::new(move |atom| parts.iter().all(|part| part(atom)))
            }
            AtomTest::Or(parts) => {
                let parts = tests(parts)?;
                Box::new(move |atom| parts.iter().any(|part| part(atom)))
            }
        })
    }

    fn asks_for_elements(&self) -> bool {
        match self {
            AtomTest::Word(property, _) => *property == AtomProperty::Element,
            AtomTest::Not(inner) => inner.asks_for_elements(),
            AtomTest::And(parts) | AtomTest::Or(parts) => parts.iter().any(AtomTest::asks_for_elements),
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::topology::AtomRow;
    use proptest::prelude::*;

    /// Two residues of a protein, three waters, an ion.
    fn system() -> Topology {
        let mut topology = Topology { place: "a.psf".into(), ..Topology::default() };
        let rows = [
            "N MET 1",
            "CA MET 1",
            "1HA MET 1",
            "CA GLY 2",
            "O GLY 2",
            "OW SOL 3",
            "HW1 SOL 3",
            "HW2 SOL 3",
            "NA NA 4",
        ];
        for row in rows {
            let [name, residue, number] = row.split(' ').collect::<Vec<_>>()[..] else { panic!() };
            let row = AtomRow {
                name: name.as_bytes(),
                residue: residue.as_bytes(),
                residue_number: number.parse().ok(),
                ..AtomRow::default()
            };
            topology.push(row).unwrap();
        }
        topology
    }

    fn chosen(text: &str) -> std::result::Result<Vec<u32>, String> {
        AtomSelection::parse(text).map_err(|e| e.to_string())?.atoms(&system())
    }

    #[test]
    fn words_choose_atoms() {
        for (text, atoms) in [
            ("all", &[0, 1, 2, 3, 4, 5, 6, 7, 8][..]),
            ("name CA", &[1, 3]),
            ("name OW HW*", &[5, 6, 7]),
            ("name *A", &[1, 2, 3, 8]),
            ("name *H*A* or name H*2", &[2, 7]),
            ("protein and not name CA", &[0, 2, 4]),
            ("not protein and not water", &[8]),
            ("not (protein or water)", &[8]),
            ("not not water", &[5, 6, 7]),
            ("resname SOL and name OW or index 0", &[0, 5]),
            ("index 1-2 8 and (element C na)", &[1, 8]),
            ("resid 2:3", &[3, 4, 5, 6, 7]),
            ("resid -3-1", &[0, 1, 2]),
            ("(name N)or(name O)", &[0, 4]),
        ] {
            assert_eq!(chosen(text).as_deref(), Ok(atoms), "{text}");
        }
    }

    #[test]
    fn what_is_not_understood_is_named() {
        for (text, why) in [
            ("", "it ends too early"),
            ("name", "`name` needs a value"),
            ("name and water", "`name` needs a value"),
            ("nme CA", "`nme` is not one of name, resname"),
            ("name CA protein", "`and` or `or` is missing before `protein`"),
            ("(name CA", "a `(` has no `)`"),
            ("name CA)", "a `)` has no `(`"),
            ("water or protein and name CA", "means two things in MDAnalysis and VMD"),
            ("water or not protein and name CA", "means two things in MDAnalysis and VMD"),
            ("resid 3:1", "`3:1` is not a number or a range"),
            ("resid A", "`A` is not a number or a range"),
            ("index 1:99999999999999999999", "is not a number or a range"),
            ("type OW", "a.psf states no types of atoms"),
        ] {
            let error = chosen(text).unwrap_err();
            assert!(error.contains(why) && !error.contains('\n'), "{text}: {error}");
        }
        let deep = chosen(&"(".repeat(100_000)).unwrap_err();
        assert!(deep.contains("more than 64 levels"), "{}", &deep[deep.len() - 80..]);
    }

    fn selections() -> impl Strategy<Value = String> {
        let leaf = prop::sample::select(vec![
            "protein",
            "water",
            "name CA",
            "resid 1:2",
            "index 3 5:6",
            "element H",
            "resname S*",
        ]);
        leaf.prop_map(String::from).prop_recursive(4, 24, 2, |inner| {
            prop_oneof![
                inner.clone().prop_map(|a| format!("not ({a})")),
                (inner.clone(), inner.clone()).prop_map(|(a, b)| format!("({a}) and ({b})")),
                (inner.clone(), inner).prop_map(|(a, b)| format!("({a}) or ({b})")),
            ]
        })
    }

    proptest! {
        #[test]
        fn selections_follow_the_laws_of_sets(a in selections(), b in selections()) {
            let atoms_of = |text: String| chosen(&text).unwrap();
            prop_assert_eq!(atoms_of(format!("not (({a}) and ({b}))")), atoms_of(format!("not ({a}) or not ({b})")));
            prop_assert_eq!(atoms_of(format!("({a}) and not ({a})")), Vec::<u32>::new());
            prop_assert_eq!(atoms_of(format!("({a}) or not ({a})")).len(), system().count);
            prop_assert_eq!(atoms_of(format!("({a}) and ({b})")), atoms_of(format!("({b}) and ({a})")));
        }

        #[test]
        fn any_text_is_a_selection_or_an_error(text in ".{0,80}", words in "((name|resid|index|not|and|or|\\(|\\)|CA|1:2|\\*) ?){0,12}") {
            let _ = (chosen(&text), chosen(&words));
        }
    }
}
