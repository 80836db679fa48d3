//! Units as people write them. They are labels: nothing is converted by them.

/// Units of length, as files and people write them, lower case.
const LENGTHS: [&str; 36] = [
    "pc",
    "kpc",
    "mpc",
    "gpc",
    "parsec",
    "parsecs",
    "kiloparsec",
    "megaparsec",
    "gigaparsec",
    "ly",
    "lyr",
    "au",
    "rsun",
    "r_sun",
    "km",
    "m",
    "cm",
    "mm",
    "um",
    "\u{b5}m",
    "\u{3bc}m",
    "micron",
    "nm",
    "pm",
    "fm",
    "meter",
    "metre",
    "meters",
    "centimeter",
    "angstrom",
    "angstroms",
    "\u{e5}",
    "\u{212b}",
    "a",
    "bohr",
    "sigma",
];
/// Units of mass, likewise.
const MASSES: [&str; 22] = [
    "msun",
    "m_sun",
    "msol",
    "m\u{2609}",
    "solar mass",
    "solar masses",
    "solarmass",
    "mearth",
    "mjup",
    "g",
    "kg",
    "mg",
    "ug",
    "t",
    "gram",
    "grams",
    "amu",
    "u",
    "da",
    "g/mol",
    "gram/mole",
    "kda",
];

/// Is it a unit of length that is known by name, such as `Mpc/h`, `ckpc/h` or `Angstrom`?
pub fn is_known_length(unit: &str) -> bool {
    is_known(unit, &LENGTHS)
}

/// Is it a unit of mass that is known by name, such as `Msun/h` or `1e10 Msun/h`?
pub fn is_known_mass(unit: &str) -> bool {
    is_known(unit, &MASSES)
}

/// A factor may stand before the name, powers of h about it, and `c` (comoving) or `p` at its front.
fn is_known(unit: &str, names: &[&str]) -> bool {
    let unit = unit.trim().to_lowercase();
    let factor = |c: char| c.is_ascii_digit() || ".^*x_+- \u{d7}".contains(c);
    let behind = unit.trim_start_matches(factor);
    // The e of 1e10 belongs to the factor.
    let behind = match unit.len() > behind.len() {
        true => {
            behind.strip_prefix('e').filter(|b| b.starts_with(factor)).map_or(behind, |b| b.trim_start_matches(factor))
        }
        false => behind,
    };
    let name = ["/h", "h^-1", "h-1", "/ h"].iter().fold(behind, |name, h| {
        let name = name.strip_prefix(h).unwrap_or(name);
        name.strip_suffix(h).unwrap_or(name).trim()
    });
    let known = |name: &str| names.contains(&name);
    known(name) || name.strip_prefix(['c', 'p']).is_some_and(known)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_files_say_is_known_and_other_words_are_not() {
        for unit in
            ["Mpc/h", "ckpc/h", "kpc", "h^-1 Mpc", "Mpc h^-1", "Angstrom", "nm", "\u{c5}", "cMpc", "1e3 km", "sigma"]
        {
            assert!(is_known_length(unit), "{unit}");
        }
        for unit in ["Msun/h", "1e10 Msun/h", "10^10 Msun", "g", "amu", "1.989e+43 g", "Msun"] {
            assert!(is_known_mass(unit), "{unit}");
        }
        for unit in ["parsecs-ish", "", "Mpcs", "furlong", "Msun", "1e10", "h"] {
            assert!(!is_known_length(unit), "{unit}");
        }
    }
}
