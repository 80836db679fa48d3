//! Hints of errors, in terms of the command line.

use particlegs_core::Hint;

pub fn hint_text(hint: &Hint) -> String {
    let typed = |name: String, more: &str| format!("`{}`", [&name, more].join(" ").trim_end());
    hint.spell(|name, value| typed(format!("--{name}"), value), |name, more| typed(format!("particlegs {name}"), more))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn hints_name_the_options_that_help() {
        let fit = |broken| {
            let hint = Hint::from(if broken { "delete it and run " } else { "run " });
            hint.command("block", "job 3")
        };
        assert_eq!(hint_text(&fit(false)), "run `particlegs block job 3`");
        assert_eq!(hint_text(&fit(true)), "delete it and run `particlegs block job 3`");
        let frame = Hint::default().option("frame", 2).words(" reads the last whole frame");
        let both = Hint::from("look closer").and(frame);
        assert_eq!(hint_text(&both), "look closer; `--frame 2` reads the last whole frame");
        assert_eq!(hint_text(&Hint::default().and(Hint::state_box())), hint_text(&Hint::state_box()));
    }
}
