//! Pictures as text.

use particlegs_figure::number;
use particlegs_pictures::PictureReport;

/// A row for each picture, or lines about a film or a figure of panels.
pub fn pictures_text(report: &PictureReport) -> String {
    let mut text = String::new();
    if let (Some(neighbours), Some(seconds)) = (report.smooth, report.smooth_seconds) {
        text = format!("{:<16} {seconds:>9.3}\n", format!("({neighbours} neighbours)"));
    }
    if !report.lines.is_empty() {
        return text + &report.lines.join("\n");
    }
    let of_particles = report.views.iter().any(|v| v.radius_px.is_some());
    text += &match of_particles {
        true => format!("{:<16} {:>8} {:>9} {:>14}", "view", "r px", "seconds", "particles/s"),
        false => format!("{:<16} {:>9}", "view", "seconds"),
    };
    for v in &report.views {
        text += &match (v.radius_px, v.particles_per_second) {
            (Some(radius), Some(rate)) => {
                format!("\n{:<16} {radius:>8.3} {:>9.3} {:>14}", v.view.name, v.seconds, number(rate))
            }
            _ => format!("\n{:<16} {:>9.3}", v.view.name, v.seconds),
        };
    }
    text
}
