//! Exit codes and hints of errors, in terms of the command line.

use particlegs_core::{Error, Hint};

/// The process exit code (docs/guide/exit-codes.md).
pub fn exit_code(error: &Error) -> u8 {
    match error {
        Error::Argument { .. } => 2,
        Error::Input { .. } => 3,
        Error::Corrupt { .. } | Error::Compatibility { .. } => 4,
        Error::Unreachable { .. } => 5,
        Error::Memory { .. } | Error::Bound { .. } => 7,
        Error::Output { .. } => 8,
        Error::Differs { .. } => 9,
        Error::Checkpointed { .. } => 75,
        Error::Cancelled => 130,
        // Reading, writing and future kinds.
        _ => 6,
    }
}

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
        assert_eq!((exit_code(&Error::Cancelled), exit_code(&Error::argument("x"))), (130, 2));
    }
}
