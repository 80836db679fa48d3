//! Names of columns and the units in them.

/// A column name and its parts.
#[derive(Clone, Debug, PartialEq)]
pub struct ColumnName {
    /// As the file has it, without the unit.
    pub text: String,
    /// Lower case, letters and digits alone, without the unit.
    pub stem: String,
    pub unit: Option<String>,
}

/// Names of positions before their axis; the axis may stand alone, too.
const POSITIONS: &str = "p pos position positions point points coord coords coordinate coordinates center";
/// The same behind the axis, as in `x_pos`.
const BEHIND: [&str; 9] = ["pos", "position", "coord", "coordinate", "center", "centre", "com", "cm", "c"];

impl ColumnName {
    pub fn parse(name: &str) -> ColumnName {
        let open = name.find(['[', '(']);
        let (stem, rest) = open.map_or((name, ""), |at| name.split_at(at));
        let inner = match rest.as_bytes() {
            [b'[', .., b']'] | [b'(', .., b')'] => rest[1..rest.len() - 1].trim(),
            _ => "",
        };
        // `pos[0]` counts, `x [kpc]` names a unit.
        let counts = inner.parse::<u32>().is_ok();
        let unit = (!inner.is_empty() && !counts && !stem.trim().is_empty()).then(|| inner.to_string());
        let text = if unit.is_some() { stem.trim() } else { name }.to_string();
        let stem = text.chars().filter(|c| c.is_alphanumeric()).flat_map(char::to_lowercase).collect();
        ColumnName { text, stem, unit }
    }

    pub fn is_mass(&self) -> bool {
        ["mass", "masses", "particlemass", "weight", "weights"].contains(&&self.stem[..])
    }
}

/// The columns x, y, z: plain ones first, else the first that are called so.
pub fn positions(names: &[ColumnName]) -> Option<[usize; 3]> {
    let find = |stem: &str| names.iter().position(|name| name.stem == stem);
    let triple = |axes: [&str; 3], join: &dyn Fn(&str) -> String| {
        let [x, y, z] = axes.map(|axis| find(&join(axis)));
        Some([x?, y?, z?])
    };
    const LETTERS: [&str; 3] = ["x", "y", "z"];
    for word in std::iter::once("").chain(POSITIONS.split(' ')) {
        let digits = (!word.is_empty()).then_some(["0", "1", "2"]);
        for axes in [Some(LETTERS), digits].into_iter().flatten() {
            if let Some(axes_columns) = triple(axes, &|axis| format!("{word}{axis}")) {
                return Some(axes_columns);
            }
        }
    }
    BEHIND.iter().find_map(|word| triple(LETTERS, &|axis| format!("{axis}{word}")))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_taken_apart() {
        let apart = |name| {
            let ColumnName { text, stem, unit } = ColumnName::parse(name);
            (text, stem, unit.unwrap_or_default())
        };
        assert_eq!(apart("Mass [Msun/h]"), ("Mass".into(), "mass".into(), "Msun/h".into()));
        assert_eq!(apart("Points:0"), ("Points:0".into(), "points0".into(), String::new()));
        assert_eq!(apart("pos[2]"), ("pos[2]".into(), "pos2".into(), String::new()));
        assert_eq!(apart("X (kpc)"), ("X".into(), "x".into(), "kpc".into()));
        assert_eq!(apart("[x]").2, "");
    }

    #[test]
    fn positions_are_found_by_their_names() {
        let find = |names: &[&str]| {
            let names: Vec<ColumnName> = names.iter().map(|n| ColumnName::parse(n)).collect();
            positions(&names)
        };
        assert_eq!(find(&["id", "z", "Y", "x"]), Some([3, 2, 1]));
        assert_eq!(find(&["Points_0", "Points_1", "Points_2"]), Some([0, 1, 2]));
        assert_eq!(find(&["px", "py", "pz", "x", "y", "z"]), Some([3, 4, 5]));
        assert_eq!(find(&["vx", "vy", "vz", "Coordinates:0", "Coordinates:1", "Coordinates:2"]), Some([3, 4, 5]));
        assert_eq!(find(&["x_pos", "y_pos", "z_pos"]), Some([0, 1, 2]));
        assert_eq!(find(&["vx", "vy", "vz"]), None);
        assert_eq!(find(&["0", "1", "2"]), None);
    }
}
