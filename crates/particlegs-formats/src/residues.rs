//! Names of residues: which are parts of proteins, and which are water.

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
