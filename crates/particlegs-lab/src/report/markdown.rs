//! An experiment as a page of Markdown, beside the files of its figures.

use super::{Provenance, Section};
use crate::found::{Found, Table};

/// The page; figures are looked for in the folder `figures`, relative to it.
pub fn markdown(section: &Section, provenance: &Provenance, figures: &str) -> String {
    let e = section.experiment;
    let mut text = format!("# {}\n\nMade by `particlegs bench {}`, and nothing of it by hand", e.title, e.name);
    text += &if e.paper.is_empty() { ".\n".into() } else { format!("; of the paper: {}.\n", e.paper) };
    match &section.found {
        Ok(found) => text += &body(found, figures),
        Err(why) => text += &format!("\nNot measured: {why}\n"),
    }
    text += "\n## Where it is from\n\n";
    provenance.in_words().iter().for_each(|line| text += &format!("- {line}\n"));
    text
}

fn body(found: &Found, figures: &str) -> String {
    let mut text = String::new();
    for note in &found.notes {
        text += &format!("\n{note}\n");
    }
    for plot in &found.plots {
        text += &format!("\n![{}]({figures}/{}.svg)\n", plot.title, plot.name);
    }
    for t in &found.tables {
        text += &table(t);
    }
    for p in &found.pictures {
        text += &format!("\n## {}\n\n![{}]({figures}/{}.png)\n\n{}\n", p.title, p.title, p.name, p.caption);
    }
    text
}

fn table(t: &Table) -> String {
    let line = |cells: Vec<String>| format!("| {} |\n", cells.join(" | "));
    let cleaned = |words: String| words.replace('|', "\\|").replace('\n', " ");
    let mut text = format!("\n## {}\n\n{}", t.title, line(t.columns.clone().into_iter().map(cleaned).collect()));
    let numbers = |c: usize| t.rows.iter().any(|row| row[c].is_number());
    text += &line((0..t.columns.len()).map(|c| if numbers(c) { "---:".into() } else { "---".into() }).collect());
    for row in &t.rows {
        text += &line(row.iter().map(|c| cleaned(c.in_words())).collect());
    }
    text
}
