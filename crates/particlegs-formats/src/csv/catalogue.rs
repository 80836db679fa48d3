//! Lists of centres: tables with x, y, z and perhaps a radius, as halo finders and people write them.

use super::guess::{ColumnName, Guess, positions};
use crate::text::split::{number_with, shown, tokens};
use particlegs_core::Error;
use particlegs_core::context::Context;
use particlegs_core::model::{Dimension, Unit, UnitSystem, Units};
use particlegs_files::input::{Begins, Form, name_of, read_whole};
use std::path::Path;

/// A million centres.
const FORM: Form = Form { title: "a list of centres", begins: Begins::Text, most: 64 << 20, expansion: 16 };

/// A centre, and the radius stated with it.
type Centre = ([f64; 3], Option<f64>);

/// Names of radii, the most welcome first.
const RADII: &str =
    "radius r rvir rhalo r200 r200c r200m r200b r200crit r200mean rcrit200 rmean200 rtophat200 r500c r500";

/// Names of the numbers of haloes.
const IDS: [&str; 2] = ["id", "haloid"];

/// Boxes whose sides differ by no more than this share are the same.
const SAME_BOX: f64 = 1e-3;

/// A list of centres.
#[derive(Debug)]
pub struct Catalogue {
    /// Centres, in the units of the file.
    centres: Vec<Centre>,
    /// The numbers of the haloes, where a column has them.
    ids: Option<Vec<u64>>,
    /// Units of positions and radii, where the header or the program that wrote it says.
    units: [Units; 2],
    scale_factor: Option<f64>,
    hubble: Option<f64>,
    /// Side of the box that the header states, with its unit.
    box_length: Option<(f64, String)>,
    notes: Vec<String>,
}

struct CentreColumns {
    position: [usize; 3],
    radius: Option<usize>,
    id: Option<usize>,
}

impl Catalogue {
    /// Reads a file.
    ///
    /// # Errors
    /// [`Error::Input`]: the file cannot be read, or is no list of centres.
    pub fn read(path: &Path, context: &Context<'_>) -> particlegs_core::Result<Catalogue> {
        let bytes = read_whole(path, FORM, context)?;
        let hint = "put names above the columns, such as `# id x y z radius`";
        Catalogue::parse(&bytes).map_err(|message| Error::input_with(name_of(path), message, hint))
    }

    /// Reads a list from a file's bytes.
    ///
    /// # Errors
    /// The fault, with the line where that is one; the columns, where they do not tell which are meant.
    pub fn parse(bytes: &[u8]) -> Result<Catalogue, String> {
        let nothing = |text: String| if text == "there are no rows" { "there are no centres".into() } else { text };
        let guess = Guess::new(bytes, true).map_err(nothing)?;
        let lines = || bytes.split(|&b| b == b'\n').enumerate().skip(guess.rows_after as usize);
        let rows = || lines().filter(|(_, line)| guess.layout.is_row(line));
        let first = rows().next().ok_or("there are no centres")?.1;
        let chosen = chosen(&guess, &tokens(first, guess.layout.separator))?;
        let read = |(i, line): (usize, &[u8])| {
            let values = tokens(line, guess.layout.separator);
            centre(&values, &chosen, guess.layout.comma).map_err(|message| format!("line {}: {message}", i + 1))
        };
        let centres = rows().map(read).collect::<Result<Vec<Centre>, String>>()?;
        let id = |(_, line): (usize, &[u8])| {
            let word = tokens(line, guess.layout.separator).get(chosen.id?).copied()?;
            std::str::from_utf8(word).ok()?.trim().parse().ok()
        };
        // One row without a whole number shows that the column does not number haloes.
        let ids = rows().map(id).collect::<Option<Vec<u64>>>();
        let header = CatalogueHeader::new(&guess.remarks);
        let CatalogueHeader { scale_factor, hubble, .. } = header;
        let (units, box_length, notes) = (Default::default(), header.box_length.clone(), Vec::new());
        let mut catalogue = Catalogue { centres, ids, units, scale_factor, hubble, box_length, notes };
        catalogue.state_units(&guess, &chosen, header);
        Ok(catalogue)
    }

    /// The place in the list of the halo of a number: that of its column of ids, else of its row, from 1.
    pub fn place_of(&self, number: u64) -> Option<usize> {
        match &self.ids {
            Some(ids) => ids.iter().position(|id| *id == number),
            None => usize::try_from(number).ok()?.checked_sub(1).filter(|row| *row < self.centres.len()),
        }
    }

    /// The scale factor that the header states.
    pub fn scale_factor(&self) -> Option<f64> {
        self.scale_factor
    }

    /// Units of positions and radii: those of the columns' names, else the header's, else those of the program that
    /// writes such columns.
    fn state_units(&mut self, guess: &Guess, chosen: &CentreColumns, header: CatalogueHeader) {
        let named = |column: Option<usize>| column.and_then(|c| guess.names[c].unit.clone());
        let program = Program::from_names(&guess.names);
        let places = named(Some(chosen.position[0])).or(header.positions).or(header.all.clone());
        let radii = named(chosen.radius).or(header.radii).or(header.all);
        if let Some(program) = program.filter(|_| places.is_none() || chosen.radius.is_some() && radii.is_none()) {
            let Program { name, positions, radii } = program;
            self.notes.push(format!("the header does not state all units; assuming those of {name}: positions in {positions}, radii in {radii}"));
        }
        let places = places.or(program.map(|p| p.positions.into()));
        let radii = radii.or(program.map(|p| p.radii.into())).or(places.clone());
        self.units = [places, radii].map(|unit| Units::new(unit.as_deref(), None, None));
    }

    /// The centres in other units, those of a snapshot whose periodic box has these sides, and what a user should know.
    ///
    /// # Errors
    /// In words, where units cannot be converted.
    pub fn convert(
        self,
        to: &UnitSystem<'_>,
        sides: Option<[f64; 3]>,
    ) -> Result<(Vec<([f64; 3], Option<f64>)>, Vec<String>), String> {
        let [places, radii] =
            [0, 1].map(|k| UnitSystem { units: &self.units[k], scale_factor: self.scale_factor, hubble: self.hubble });
        let mut notes = self.notes;
        let taken = places.conversion(to)?;
        let (length, unit) = (taken.length, places.units.length_text());
        if let (Some(unit), None) = (unit, to.units.length_text()) {
            notes.push(format!(
                "centres are in {unit}; the snapshot states no unit of length and is assumed to use the same"
            ));
        }
        if let (Some((length, unit)), Some(sides)) = (&self.box_length, sides) {
            let units = Units::new(Some(unit), None, None);
            let stated = UnitSystem { units: &units, ..places }.conversion(to).map(|c| c.length * length);
            if stated.is_ok_and(|stated| sides.iter().any(|side| (side / stated - 1.0).abs() > SAME_BOX)) {
                let unit_text = to.units.length_text().map_or(String::new(), |text| format!(" {text}"));
                let [x, y, z] = sides;
                notes.push(format!("the header states a box of {length} {unit}, but the snapshot's box is {x} x {y} x {z}{unit_text}: they may come from different runs"));
            }
        }
        // Without a unit of the snapshot centres stay as they are, and radii take the centres' unit.
        let radius = match to.units.length_text() {
            Some(_) => radii.conversion(to)?.length,
            None => radii.conversion(&places)?.length,
        };
        let centres = self.centres.into_iter().map(|(p, r)| (p.map(|v| v * length), r.map(|r| r * radius)));
        Ok((centres.collect(), notes))
    }
}

/// A program whose lists are known by the names of their columns, and its units.
#[derive(Clone, Copy)]
struct Program {
    name: &'static str,
    positions: &'static str,
    radii: &'static str,
}

impl Program {
    fn from_names(names: &[ColumnName]) -> Option<Program> {
        let has = |stem: &str| names.iter().any(|name| name.stem == stem);
        let rockstar = has("descid") || has("numchildparticles") || has("mboundvir");
        if rockstar || has("descscale") {
            let name = if rockstar { "Rockstar" } else { "consistent-trees" };
            return Some(Program { name, positions: "comoving Mpc/h", radii: "comoving kpc/h" });
        }
        let ahf = has("xc") && (has("hosthalo") || has("fmhires") || has("mbpoffset"));
        ahf.then_some(Program { name: "AHF", positions: "comoving kpc/h", radii: "comoving kpc/h" })
    }
}

fn chosen(guess: &Guess, first: &[&[u8]]) -> Result<CentreColumns, String> {
    let names = &guess.names;
    let listed = || guess.layout.columns.join(", ");
    if guess.named
        && let Some(position) = positions(names)
    {
        let radius = RADII.split(' ').find_map(|radius| names.iter().position(|name| name.stem == radius));
        let id = names.iter().position(|name| IDS.contains(&&name.stem[..]));
        return Ok(CentreColumns { position, radius, id });
    }
    let columns = names.len() - guess.first_column;
    if guess.named && columns > 3 {
        return Err(format!("no columns are named x, y and z; the columns are: {}", listed()));
    }
    let whole = |c: usize| first.get(c).is_some_and(|v| !v.is_empty() && v.iter().all(u8::is_ascii_digit));
    let from = guess.first_column;
    let position = [from, from + 1, from + 2];
    // The number of a halo may stand before its place; a fourth column alone is a radius.
    let is_unambiguous = match columns {
        ..=3 => true,
        4 => !whole(from) || whole(from + 1),
        _ => !position.iter().any(|&c| whole(c)) || (from..from + columns).all(whole),
    };
    if !is_unambiguous {
        let values: Vec<String> = first.iter().take(8).map(|v| String::from_utf8_lossy(v).into_owned()).collect();
        return Err(format!(
            "the {columns} columns have no names ({}, ...): it is not clear which are x, y and z",
            values.join(", ")
        ));
    }
    Ok(CentreColumns { position, radius: (columns == 4).then_some(from + 3), id: None })
}

fn centre(values: &[&[u8]], chosen: &CentreColumns, comma: bool) -> Result<Centre, String> {
    let number = |column: usize| {
        let word = values
            .get(column)
            .ok_or_else(|| format!("there are only {} columns, too few for x, y and z", values.len()))?;
        let value = number_with(word, comma).filter(|v| v.is_finite());
        value.ok_or_else(|| format!("{} is not a finite number", shown(word)))
    };
    let [x, y, z] = chosen.position.map(number);
    let stated = chosen.radius.filter(|r| values.get(*r).is_some_and(|w| !w.is_empty()));
    let radius = stated.map(number).transpose()?;
    if let Some(r) = radius.filter(|r| *r <= 0.0) {
        return Err(format!("the radius {r} is not positive"));
    }
    Ok(([x?, y?, z?], radius))
}

/// Content of the comments above the rows.
#[derive(Default)]
struct CatalogueHeader {
    positions: Option<String>,
    radii: Option<String>,
    /// Of lengths without a word of which.
    all: Option<String>,
    scale_factor: Option<f64>,
    hubble: Option<f64>,
    box_length: Option<(f64, String)>,
}

impl CatalogueHeader {
    fn new(remarks: &[String]) -> CatalogueHeader {
        let mut header = CatalogueHeader::default();
        for line in remarks {
            let lower = line.to_lowercase();
            let says = |words: &[&str]| words.iter().any(|word| lower.contains(word));
            let unit = length_in(line);
            if lower.contains("box size") {
                header.box_length = length_stated(line);
            }
            let radii = says(&["radii", "radius", "rvir"]);
            let positions = says(&["position", "coordinate", "centre", "center", "x/y/z"]);
            let place = match () {
                _ if radii && !positions => &mut header.radii,
                _ if positions && !radii => &mut header.positions,
                // The units of these lengths say nothing about those of centres.
                _ if says(&["box", "particle mass", "resolution", "softening"]) => continue,
                _ => &mut header.all,
            };
            *place = place.take().or(unit);
            for part in line.split([';', ',']) {
                let Some((name, value)) = part.split_once('=') else { continue };
                let value = value.trim().parse::<f64>().ok().filter(|v| v.is_finite() && *v > 0.0);
                match name.trim_matches(['#', '%', ' ']) {
                    "a" | "scale" | "scale factor" | "scale_factor" => header.scale_factor = value,
                    "h" | "h0" | "hubble" | "HubbleParam" => header.hubble = value,
                    _ => {}
                }
            }
        }
        header
    }
}

/// The length that a line states: `Box size: 20.0 Mpc/h`.
fn length_stated(line: &str) -> Option<(f64, String)> {
    let words: Vec<&str> = line.split_whitespace().collect();
    let stated = words.iter().enumerate().find_map(|(i, word)| Some((i, word.parse::<f64>().ok()?)));
    let (i, length) = stated.filter(|(_, v)| v.is_finite() && *v > 0.0)?;
    Some((length, known_length(&words[i + 1..].join(" "))?))
}

/// The unit of length that a line of words ends with, or has in brackets: `Positions in Mpc / h (comoving)`.
fn length_in(line: &str) -> Option<String> {
    let plain = line.trim_end_matches(['.', ' ', '\r']);
    let behind = |mark: &str| plain.rsplit_once(mark).map(|(_, rest)| rest);
    let inside = |open: char, close: char| {
        let (_, rest) = plain.split_once(open)?;
        Some(rest.split_once(close)?.0)
    };
    let candidates = [behind(" in "), inside('[', ']'), inside('(', ')'), behind(":"), behind("=")];
    candidates.into_iter().flatten().find_map(known_length)
}

/// A unit of length, without brackets and with no more blanks than it needs.
fn known_length(text: &str) -> Option<String> {
    let plain = text.replace(['(', ')', '[', ']', '.'], " ");
    let clean = plain.split_whitespace().collect::<Vec<_>>().join(" ").replace(" / ", "/");
    Unit::is_known(&clean, Dimension::Length).then_some(clean)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn parsed(text: &str) -> Result<Vec<Centre>, String> {
        Catalogue::parse(text.as_bytes()).map(|c| c.centres)
    }

    fn converted(text: &str, unit: Option<&str>) -> Vec<Centre> {
        let units = Units::new(unit, None, None);
        let to = UnitSystem { units: &units, scale_factor: None, hubble: None };
        Catalogue::parse(text.as_bytes()).unwrap().convert(&to, None).unwrap().0
    }

    #[test]
    fn tables_of_every_kind_are_read() {
        let two = vec![([1.0, 2.0, 3.0], None), ([4.0, 5.0, -6.0], None)];
        for text in [
            "1,2,3\n4,5,-6\n",
            "\x0c\r\n\x0c\n1 2 3\n\x0c\n4 5 -6\n\x0c\r\n",
            "x y z\n1 2 3\n\n# more\n4\t5 -6e0",
            "a;b;c\r\n1; 2;3\r\n4;5;-6",
            "\u{feff}sep=;\nx;y;z\n1,0;2,0;3,0\n4,0;5,0;-6,0\n",
            "0,1,2\n1.0,2.0,3.0\n4.0,5.0,-6.0\n",
            ",0,1,2\n0,1.0,2.0,3.0\n1,4.0,5.0,-6.0\n",
            "1.0 2.0 3.0 7 8 9\n4.0 5.0 -6.0 7 8 9\n",
        ] {
            assert_eq!(parsed(text).unwrap(), two, "{text}");
        }
        assert_eq!(parsed("1 2 3 0.5\n").unwrap(), [([1.0, 2.0, 3.0], Some(0.5))]);
        let named = parsed("id,Radius,mass,z,y,x\n7,0.5,9,3,2,1\n8,,9,3,2,1\n").unwrap();
        assert_eq!(named, [([1.0, 2.0, 3.0], Some(0.5)), ([1.0, 2.0, 3.0], None)]);
    }

    #[test]
    fn haloes_are_found_by_their_ids_or_rows() {
        let place = |text: &str, number: u64| Catalogue::parse(text.as_bytes()).unwrap().place_of(number);
        let named = "id,x,y,z\n7,1,2,3\n4,4,5,6\n";
        assert_eq!([7, 4, 1].map(|n| place(named, n)), [Some(0), Some(1), None]);
        let plain = "1.5 2 3\n4 5 6\n";
        assert_eq!([0, 1, 2, 3].map(|n| place(plain, n)), [None, Some(0), Some(1), None]);
    }

    #[test]
    fn halo_finders_are_read_by_their_headers() {
        let close = |text: &str, unit: Option<&str>, centre: [f64; 3], radius: f64| {
            let got = converted(text, unit)[0];
            let near = |a: f64, b: f64| (a - b).abs() <= 1e-12 * b.abs();
            assert!((0..3).all(|k| near(got.0[k], centre[k])) && near(got.1.unwrap(), radius), "{text}: {got:?}");
        };
        let rockstar = "#ID DescID Mvir Rvir X Y Z\n#a = 0.5\n#Om = 0.3; Ol = 0.7; h = 0.7\n#Box size: 20.0 Mpc/h\n\
            #Units: Positions in Mpc / h (comoving)\n#Units: Velocities in km / s (physical)\n0 -1 1e12 35 1 2 3\n";
        close(rockstar, Some("Mpc/h"), [1.0, 2.0, 3.0], 0.035);
        close(rockstar, Some("kpc/h"), [1e3, 2e3, 3e3], 35.0);
        close(rockstar, Some("kpc"), [1e3 / 0.7, 2e3 / 0.7, 3e3 / 0.7], 35.0 / 0.7);
        close(rockstar, None, [1.0, 2.0, 3.0], 0.035);
        let stated = rockstar.replace("#a", "#Units: Halo Distances, Lengths, and Radii in Mpc / h (comoving)\n#a");
        close(&stated, Some("Mpc/h"), [1.0, 2.0, 3.0], 35.0);
        let trees = "#scale(0) desc_scale(1) Rvir(2) x(3) y(4) z(5)\n#Rvir: Halo radius (kpc/h comoving).\n\
            #x/y/z: Halo position (Mpc/h comoving).\n1.0 0 50 1 2 3\n";
        close(trees, Some("Mpc/h"), [1.0, 2.0, 3.0], 0.05);
        let ahf = "#ID(1)\thostHalo(2)\tMhalo(4)\tXc(6)\tYc(7)\tZc(8)\tRhalo(12)\n7\t0\t1e12\t1000\t2000\t3000\t50\n";
        close(ahf, Some("Mpc/h"), [1.0, 2.0, 3.0], 0.05);
        close(ahf, None, [1e3, 2e3, 3e3], 50.0);
        close("R [kpc],x [Mpc],y [Mpc],z [Mpc]\n5,1,2,3\n", Some("Mpc"), [1.0, 2.0, 3.0], 0.005);
        close("# positions and radii in kpc\n# x y z r\n1 2 3 5\n", Some("pc"), [1e3, 2e3, 3e3], 5e3);
    }

    #[test]
    fn another_box_than_that_of_the_snapshot_is_said() {
        let list = "# Box size: 20.0 Mpc/h\n# Positions in Mpc / h (comoving)\n# x y z\n1 2 3\n";
        let units = Units::new(Some("kpc/h"), None, None);
        let to = UnitSystem { units: &units, scale_factor: None, hubble: None };
        let notes = |sides| Catalogue::parse(list.as_bytes()).unwrap().convert(&to, Some(sides)).unwrap().1;
        assert_eq!(notes([20_000.0; 3]), [""; 0]);
        let said = notes([14_000.0; 3]).concat();
        assert!(said.contains("a box of 20 Mpc/h, but the snapshot's box is 14000 x 14000 x 14000 kpc/h"), "{said}");
    }

    #[test]
    fn what_is_no_list_is_refused_by_its_line() {
        for (text, message) in [
            ("", "no centres"),
            ("x,y,z\n", "no centres"),
            ("1,2,3\n1,2\n", "line 2: there are only 2 columns"),
            ("1,2,3\n1,b,3\n", "line 2: `b` is not"),
            ("1,2,inf\n", "line 1: `inf` is not"),
            ("1,2,3,-1\n", "line 1: the radius -1"),
            ("1,2,3,NaN\n", "`NaN` is not"),
            ("#id mass a b c\n1 2 3 4 5\n", "the columns are: id, mass, a, b, c"),
            ("1 10.5 8.5 1.5\n", "4 columns have no names (1, 10.5, 8.5, 1.5"),
            ("1 -1 1e12 35.0 1.0\n", "5 columns have no names"),
        ] {
            let refused = parsed(text).unwrap_err();
            assert!(refused.contains(message), "{text}: {refused}");
        }
    }
}
