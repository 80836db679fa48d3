//! Results as plain text: tables as comma-separated values (RFC 4180), and whole results for a terminal.

use crate::results::{ExperimentResults, ResultTable, TableCell};

/// The table: a header line, then rows. Numbers of several seeds get two more columns for the smallest and largest.
pub fn csv(table: &ResultTable) -> String {
    let spread: Vec<bool> = (0..table.columns.len())
        .map(|c| table.rows.iter().any(|row| matches!(row.get(c), Some(TableCell::Spread { .. }))))
        .collect();
    let mut text = String::new();
    let heads = table.columns.iter().zip(&spread).flat_map(|(head, spread)| match spread {
        true => vec![head.clone(), format!("{head}: smallest"), format!("{head}: largest")],
        false => vec![head.clone()],
    });
    line(&mut text, heads);
    for row in &table.rows {
        let cells = row.iter().zip(&spread).flat_map(|(cell, spread)| match (cell, spread) {
            (TableCell::Spread { range: [low, high], .. }, _) => vec![cell.plain(), low.to_string(), high.to_string()],
            (_, true) => vec![cell.plain(), cell.plain(), cell.plain()],
            (_, false) => vec![cell.plain()],
        });
        line(&mut text, cells);
    }
    text
}

/// A name that a spreadsheet would take for a formula starts with an apostrophe.
fn as_text(cell: String) -> String {
    let formula = cell.starts_with(['=', '+', '-', '@', '\t', '\r']) && cell.parse::<f64>().is_err();
    if formula { format!("'{cell}") } else { cell }
}

fn line(text: &mut String, cells: impl Iterator<Item = String>) {
    let quoted = |cell: String| match cell.contains([',', '"', '\n', '\r']) {
        true => format!("\"{}\"", cell.replace('"', "\"\"")),
        false => cell,
    };
    *text += &cells.map(as_text).map(quoted).collect::<Vec<_>>().join(",");
    *text += "\n";
}

pub fn text(results: &ExperimentResults) -> String {
    results.notes.iter().cloned().chain(results.tables.iter().map(table)).collect::<Vec<_>>().join("\n\n")
}

fn table(t: &ResultTable) -> String {
    let cells = t.rows.iter().map(|row| row.iter().map(TableCell::describe).collect());
    let lines: Vec<Vec<String>> = std::iter::once(t.columns.clone()).chain(cells).collect();
    let width = |c: usize| lines.iter().map(|line| line[c].chars().count()).max().unwrap_or(0);
    let widths: Vec<(usize, bool)> =
        (0..t.columns.len()).map(|c| (width(c), t.rows.iter().any(|row| row[c].is_number()))).collect();
    let one = |line: &Vec<String>| {
        let padded = line.iter().zip(&widths).map(|(cell, (w, number))| match number {
            true => format!("{cell:>w$}"),
            false => format!("{cell:<w$}"),
        });
        format!("\n{}", padded.collect::<Vec<_>>().join("  ").trim_end())
    };
    t.title.clone() + &lines.iter().map(one).collect::<String>()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_do_not_become_formulas() {
        let names = ["=1+1", "+a", "-a", "@a", "-1.5", "a=1"].map(|c| as_text(c.into()));
        assert_eq!(names, ["'=1+1", "'+a", "'-a", "'@a", "-1.5", "a=1"]);
    }

    #[test]
    fn cells_are_quoted_and_spreads_have_columns() {
        let mut table = ResultTable::new("t", "T", &["method", "dB, masked"]);
        table.row([TableCell::text("a \"b\""), TableCell::spread(&[1.0, 2.0, 4.0], 1)]);
        table.row([TableCell::text("c"), TableCell::number(3.5, 1)]);
        let lines: Vec<String> = csv(&table).lines().map(str::to_string).collect();
        assert_eq!(lines[0], "method,\"dB, masked\",\"dB, masked: smallest\",\"dB, masked: largest\"");
        assert_eq!(lines[1..], ["\"a \"\"b\"\"\",2,1,4".to_string(), "c,3.5,3.5,3.5".to_string()]);
    }

    #[test]
    fn columns_are_aligned() {
        let mut t = ResultTable::new("t", "Steps", &["law", "steps/s"]);
        t.row([TableCell::text("alpha-blend"), TableCell::number(12.25, 1)]);
        t.row([TableCell::text("depth"), TableCell::Empty]);
        let results = ExperimentResults { tables: vec![t], notes: vec!["One note.".into()], ..Default::default() };
        assert_eq!(
            text(&results),
            "One note.\n\nSteps\nlaw          steps/s\nalpha-blend     12.2\ndepth              –"
        );
    }
}
