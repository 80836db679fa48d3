//! The whole report as one self-contained page.

use super::{Provenance, ReportSection};
use crate::results::{ExperimentResults, Pictures, ResultTable, TableCell};
use base64::Engine;
use particlegs_figure::{FileKind, plot_bytes};

const STYLE: &str = include_str!("style.css");

/// The page; `png` encodes a picture.
pub fn html(sections: &[ReportSection], provenance: &Provenance, png: &dyn Fn(&Pictures) -> Vec<u8>) -> String {
    let mut text = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\
         <title>particlegs: measured</title><style>{STYLE}</style></head><body><main>\n<h1>particlegs: measured</h1>\n<ul class=\"from\">"
    );
    for line in provenance.describe() {
        text += &format!("<li>{}</li>", code(&line));
    }
    text += "</ul>\n<nav><ol>";
    for s in sections {
        text += &format!("<li><a href=\"#{}\">{}</a></li>", s.experiment.name, escaped(s.experiment.title));
    }
    text += "</ol></nav>\n";
    sections.iter().for_each(|s| text += &section(s, png));
    text + "</main></body></html>\n"
}

fn section(s: &ReportSection, png: &dyn Fn(&Pictures) -> Vec<u8>) -> String {
    let e = s.experiment;
    let paper = if e.paper.is_empty() { String::new() } else { format!("; in the paper: {}", e.paper) };
    let mut text = format!(
        "<section id=\"{}\"><h2>{}</h2>\n<p class=\"how\"><code>particlegs bench {}</code>{}</p>\n",
        e.name,
        escaped(e.title),
        e.name,
        escaped(&paper)
    );
    match &s.found {
        Ok(results) => text += &body(results, png),
        Err(why) => text += &format!("<p class=\"failed\">Not measured: {}</p>\n", escaped(why)),
    }
    text + "</section>\n"
}

fn body(results: &ExperimentResults, png: &dyn Fn(&Pictures) -> Vec<u8>) -> String {
    let mut text = String::new();
    for note in &results.notes {
        text += &format!("<p>{}</p>\n", code(note));
    }
    for p in &results.plots {
        if let Ok(Some(svg)) = plot_bytes(std::slice::from_ref(p), FileKind::Svg) {
            text += &format!("<figure>{}</figure>\n", String::from_utf8_lossy(&svg));
        }
    }
    results.tables.iter().for_each(|t| text += &table(t));
    for p in &results.pictures {
        let data = base64::engine::general_purpose::STANDARD.encode(png(p));
        text += &format!(
            "<figure><figcaption><strong>{}</strong></figcaption><img alt=\"{}\" src=\"data:image/png;base64,{data}\">\
             <figcaption>{}</figcaption></figure>\n",
            escaped(&p.title),
            escaped(&p.title),
            escaped(&p.caption)
        );
    }
    text
}

fn table(t: &ResultTable) -> String {
    let mut text = format!("<div class=\"table\"><table><caption>{}</caption><thead><tr>", code(&t.title));
    let numbers = |c: usize| t.rows.iter().any(|row| row[c].is_number());
    let class = |c: usize| if numbers(c) { " class=\"n\"" } else { "" };
    for (c, head) in t.columns.iter().enumerate() {
        text += &format!("<th{}>{}</th>", class(c), code(head));
    }
    text += "</tr></thead><tbody>\n";
    for row in &t.rows {
        let cell = |(c, cell): (usize, &TableCell)| format!("<td{}>{}</td>", class(c), words(cell));
        text += &format!("<tr>{}</tr>\n", row.iter().enumerate().map(cell).collect::<String>());
    }
    text + "</tbody></table></div>\n"
}

/// Text of a cell; a range is on a line of its own, to save width.
fn words(cell: &TableCell) -> String {
    let text = code(&cell.describe());
    match (cell, text.split_once(" (")) {
        (TableCell::Spread { .. }, Some((value, range))) => format!("{value}<span class=\"range\">({range}</span>"),
        _ => text,
    }
}

fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// Escapes text, and turns backticks into code.
fn code(text: &str) -> String {
    let parts = escaped(text);
    let marked = |(i, part): (usize, &str)| if i % 2 == 1 { format!("<code>{part}</code>") } else { part.to_string() };
    parts.split('`').enumerate().map(marked).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn text_is_escaped() {
        assert_eq!(code("a < `b & c`"), "a &lt; <code>b &amp; c</code>");
    }

    /// A reader of the page sees no backtick, wherever code is named, and no range beside the number that it is of.
    #[test]
    fn tables_show_code_and_ranges() {
        let mut t = ResultTable::new("t", "Growth of `compress`", &["look", "`paraview`, s"]);
        t.row([TableCell::text("`paraview` (ours)"), TableCell::spread(&[1.0, 2.0, 4.0], 0)]);
        let text = table(&t);
        assert!(!text.contains('`') && text.contains("<caption>Growth of <code>compress</code></caption>"), "{text}");
        assert!(text.contains("<td><code>paraview</code> (ours)</td>"), "{text}");
        assert!(text.contains("<td class=\"n\">2<span class=\"range\">(1 to 4)</span></td>"), "{text}");
    }
}
