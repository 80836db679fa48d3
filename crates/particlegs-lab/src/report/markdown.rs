//! An experiment as a Markdown page.

use super::{Provenance, ReportSection};
use crate::results::{ExperimentResults, ResultTable};
use particlegs_figure::shows;

/// The page; it refers to figures in the folder `figures`.
pub fn markdown(section: &ReportSection, provenance: &Provenance, figures: &str) -> String {
    let e = section.experiment;
    let mut text = format!("# {}\n\nMade by `particlegs bench {}` without manual edits", e.title, e.name);
    text += &if e.paper.is_empty() { ".\n".into() } else { format!("; in the paper: {}.\n", e.paper) };
    match &section.found {
        Ok(results) => text += &body(results, figures),
        Err(why) => text += &format!("\nNot measured: {}\n", escaped(why)),
    }
    text += "\n## Provenance\n\n";
    provenance.describe().iter().for_each(|line| text += &format!("- {}\n", escaped(line)));
    text
}

fn body(results: &ExperimentResults, figures: &str) -> String {
    let mut text = String::new();
    for note in &results.notes {
        text += &format!("\n{}\n", escaped(note));
    }
    for plot in results.plots.iter().filter(|p| shows(p)) {
        text += &format!("\n![{}]({figures}/{}.svg)\n", escaped(&plot.title), plot.name);
    }
    for t in &results.tables {
        text += &table(t);
    }
    for p in &results.pictures {
        let (title, caption) = (escaped(&p.title), escaped(&p.caption));
        text += &format!("\n## {title}\n\n![{title}]({figures}/{}.png)\n\n{caption}\n", p.name);
    }
    text
}

fn table(t: &ResultTable) -> String {
    let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
    let cleaned = |words: String| escaped(&words).replace('|', "\\|").replace('\n', " ");
    let mut text =
        format!("\n## {}\n\n{}", escaped(&t.title), line(t.columns.clone().into_iter().map(cleaned).collect()));
    let numbers = |c: usize| t.rows.iter().any(|row| row[c].is_number());
    text += &line((0..t.columns.len()).map(|c| if numbers(c) { "---:".into() } else { "---".into() }).collect());
    for row in &t.rows {
        text += &line(row.iter().map(|c| cleaned(c.describe())).collect());
    }
    text
}

/// Escapes HTML, except between backticks.
fn escaped(text: &str) -> String {
    let outside = |(i, part): (usize, &str)| match i % 2 {
        0 => part.replace('&', "&amp;").replace('<', "&lt;"),
        _ => part.to_string(),
    };
    text.split('`').enumerate().map(outside).collect::<Vec<_>>().join("`")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::results::TableCell;

    #[test]
    fn names_are_text() {
        assert_eq!(escaped("<b> & `a < b` > c"), "&lt;b> &amp; `a < b` > c");
        let mut t = ResultTable::new("t", "of <i>", &["a|b"]);
        t.row([TableCell::text("<b>|x")]);
        assert_eq!(table(&t), "\n## of &lt;i>\n\n| a\\|b |\n| --- |\n| &lt;b>\\|x |\n");
    }
}
