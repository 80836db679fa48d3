//! Elements and residues by their names: standard atomic weights, which element an atom is, and which residues are parts of
//! proteins or water.

/// Standard atomic weights in daltons, to five digits (IUPAC 2016); of deuterium its own.
const ELEMENTS: &str = "\
    D 2.0141 H 1.008 He 4.0026 Li 6.94 Be 9.0122 B 10.81 C 12.011 N 14.007 O 15.999 F 18.998 Ne 20.18 Na 22.99 \
    Mg 24.305 Al 26.982 Si 28.085 P 30.974 S 32.06 Cl 35.45 Ar 39.948 K 39.098 Ca 40.078 Sc 44.956 Ti 47.867 V \
    50.941 Cr 51.996 Mn 54.938 Fe 55.845 Co 58.933 Ni 58.693 Cu 63.546 Zn 65.38 Ga 69.723 Ge 72.63 As 74.922 Se \
    78.971 Br 79.904 Kr 83.798 Rb 85.468 Sr 87.62 Y 88.906 Zr 91.224 Nb 92.906 Mo 95.95 Ru 101.07 Rh 102.91 Pd \
    106.42 Ag 107.87 Cd 112.41 In 114.82 Sn 118.71 Sb 121.76 Te 127.6 I 126.9 Xe 131.29 Cs 132.91 Ba 137.33 La \
    138.91 Ce 140.12 Pr 140.91 Nd 144.24 Sm 150.36 Eu 151.96 Gd 157.25 Tb 158.93 Dy 162.5 Ho 164.93 Er 167.26 Tm \
    168.93 Yb 173.05 Lu 174.97 Hf 178.49 Ta 180.95 W 183.84 Re 186.21 Os 190.23 Ir 192.22 Pt 195.08 Au 196.97 Hg \
    200.59 Tl 204.38 Pb 207.2 Bi 208.98 Th 232.04 Pa 231.04 U 238.03";

/// Ions as CHARMM names them.
const IONS: &str = "SOD Na POT K CLA Cl CAL Ca CES Cs LIT Li RUB Rb BAR Ba CAD Cd IOD I";
/// Atoms of other residues whose names begin with two letters of an element, and nothing else.
const LONG: [&str; 6] = ["CL", "BR", "FE", "ZN", "MG", "SI"];
/// Sites of water models without a mass.
const SITES: [&str; 6] = ["MW", "LP", "EP", "EPW", "M", "L"];
/// An element without a mass: such a site.
pub const SITE: &str = "-";

/// The symbol as it is usually spelled, if there is such an element.
pub fn symbol(text: &str) -> Option<&'static str> {
    ELEMENTS.split(' ').step_by(2).find(|symbol| symbol.eq_ignore_ascii_case(text))
}

pub fn mass(symbol: &str) -> Option<f64> {
    let mut words = ELEMENTS.split(' ');
    if symbol == SITE {
        return Some(0.0);
    }
    words.find(|word| *word == symbol).and_then(|_| words.next()?.parse().ok())
}

/// The element of an atom by its name and that of its residue; `None` where they do not tell.
pub fn by_name(name: &[u8], residue: &[u8]) -> Option<&'static str> {
    let letters = |text: &[u8]| -> String {
        // Digits before the letters count atoms: `1HB2` is a hydrogen.
        let from = text.iter().skip_while(|b| b.is_ascii_digit());
        from.take_while(|b| b.is_ascii_alphabetic()).map(|&b| b.to_ascii_uppercase() as char).collect()
    };
    let (name_letters, residue_letters) = (letters(name), letters(residue));
    let first = |known: &str| name_letters.get(..1).filter(|first| known.contains(first)).and_then(symbol);
    // In water and proteins the first letter is the element: CA is a carbon there, and calcium where it stands alone.
    match substance(residue) {
        b"water" => first("HO").or_else(|| SITES.contains(&&name_letters[..]).then_some(SITE)),
        b"protein" => {
            if name_letters == "SE" {
                Some("Se")
            } else {
                first("HCNOS")
            }
        }
        // A residue of one atom is an ion.
        _ if name_letters == residue_letters => symbol(&name_letters).or_else(|| {
            let mut words = IONS.split(' ');
            words.find(|ion| *ion == name_letters).and_then(|_| words.next())
        }),
        _ if LONG.contains(&&name_letters[..]) => symbol(&name_letters),
        _ => first("HCNOPSF"),
    }
}

/// Residues of proteins, by the names that force fields have for them; and of water.
const PROTEIN: [&str; 60] = [
    "ALA", "ARG", "ASN", "ASP", "CYS", "GLN", "GLU", "GLY", "HIS", "ILE", "LEU", "LYS", "MET", "PHE", "PRO", "SER",
    "THR", "TRP", "TYR", "VAL", "ACE", "NME", "NH2", "MSE", "ARGN", "ASH", "ASPH", "ASPP", "CYM", "CYSH", "CYS2",
    "CYX", "GLH", "GLUH", "GLUP", "HID", "HIE", "HIP", "HISA", "HISB", "HISH", "HIS1", "HIS2", "HSD", "HSE", "HSP",
    "LYN", "LYSH", "HISE", "ALAD", "ASF", "ASN1", "CME", "CYS1", "DAB", "HISD", "HYP", "ORN", "PGLU", "QLN",
];
const WATER: [&str; 18] = [
    "SOL", "HOH", "WAT", "H2O", "SPC", "SPCE", "TIP", "TIP2", "TIP3", "TIP4", "TIP5", "T3P", "T4P", "T5P", "HHO",
    "OH2", "OHH", "W",
];

/// The species of a residue: residues of proteins are one, as are waters. Others are their own.
pub fn substance(residue: &[u8]) -> &[u8] {
    let is = |names: &[&str], residue: &[u8]| names.iter().any(|name| name.as_bytes() == residue);
    match residue {
        _ if is(&PROTEIN, residue) => b"protein",
        _ if is(&WATER, residue) => b"water",
        // Ends of chains, as AMBER calls them: NALA, CALA.
        [b'N' | b'C', rest @ ..] if rest.len() == 3 && is(&PROTEIN, rest) => b"protein",
        _ => residue,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_tell_elements() {
        let element_of = |name: &str, residue: &str| by_name(name.as_bytes(), residue.as_bytes());
        for (name, residue, element) in [
            ("CA", "ALA", Some("C")),
            ("CA", "CA", Some("Ca")),
            ("1HB2", "LEU", Some("H")),
            ("NA", "HEM", Some("N")),
            ("NA+", "NA", Some("Na")),
            ("SOD", "SOD", Some("Na")),
            ("SE", "MSE", Some("Se")),
            ("MW", "SOL", Some(SITE)),
            ("OW", "SOL", Some("O")),
            ("W", "W", None),
            ("BB", "ALA", None),
            ("CL1", "LIG", Some("Cl")),
            ("P", "POPC", Some("P")),
            ("GL1", "DPPC", None),
            ("", "ALA", None),
            ("17", "X", None),
        ] {
            assert_eq!(element_of(name, residue), element, "{name} of {residue}");
        }
        assert_eq!((mass("Cl"), mass(SITE), symbol("CL"), symbol("Xx")), (Some(35.45), Some(0.0), Some("Cl"), None));
    }
}
