//! Results as text for a terminal.

use crate::results::{ExperimentResults, ResultTable, TableCell};

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
