//! What the command says of an error: its exit code, and what to do, in the command's own terms.

use particlegs::{Error, Remedy};

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
        // Reading or writing, and what is to come.
        _ => 6,
    }
}

/// An argument that an option gave, with the option's name.
pub fn of_option(option: &str, error: Error) -> Error {
    match error {
        Error::Argument { what, remedy } => Error::Argument { what: format!("{option}: {what}"), remedy },
        other => other,
    }
}

/// A remedy with the options and commands that bring it about.
pub fn in_words(remedy: &Remedy) -> String {
    let run_again = |broken: bool, run: String| if broken { format!("delete it and {run}") } else { run };
    match remedy {
        Remedy::Both(both) => format!("{}; {}", in_words(&both.0), in_words(&both.1)),
        Remedy::CopyAgain => "copy the file again from its source; `particlegs verify` checks it".into(),
        Remedy::UseNewer => "use a newer particlegs".into(),
        Remedy::AllowMemory => "allow that much with `--memory`, or ask for a smaller model".into(),
        Remedy::GoOn => "run the same command again to continue".into(),
        Remedy::StateBox => "state it by `--box Lx,Ly,Lz`".into(),
        Remedy::StateBoxOrRegion => "state it by `--box Lx,Ly,Lz`, or use --region, which does not wrap around".into(),
        Remedy::LeaveOutInvalid => {
            "`--skip-invalid` leaves them out; `--weights none` counts all particles alike".into()
        }
        Remedy::WeighByMass => {
            "leave `--weights` out to weigh by masses, or give `--weights none` to count particles".into()
        }
        Remedy::LayersBySpecies => "use `--layers-by species`".into(),
        Remedy::ChooseSpecies => "choose fewer with --particle-type".into(),
        Remedy::NameFormat(formats) => format!("`--format` forces one of: {formats}"),
        Remedy::NameFormatOfFolder => "name one of them; `--format` leaves files of other formats out".into(),
        Remedy::NamePositions(there) => format!("`--positions A,B,C` names them; there are: {}", there.join(", ")),
        Remedy::ChoosePositions(there) => format!("choose with `--positions`: {}", there.join(", ")),
        Remedy::NameBlocks => {
            "`--gadget-blocks POS,VEL,ID,-,MASS` names the blocks after the header; - skips a block".into()
        }
        Remedy::ReadFrame(frame) => format!("`--frame {frame}` reads the last whole frame"),
        Remedy::LargerFile { bytes, ratio: None } => format!("ask for `--size {bytes}B` or more"),
        Remedy::LargerFile { bytes, ratio: Some(ratio) } => {
            format!("ask for `--size {bytes}B` or more, or for a ratio of {ratio:.4} or less")
        }
        Remedy::LargerFileOrNoNetwork => {
            "ask for a larger file, or set `vizmapper = false` in [alpha_blend] of --config".into()
        }
        Remedy::MoreGaussians(number) => format!("ask for `--gaussians {number}` or more"),
        Remedy::NoQuality => "ask for a size, a ratio or a number of Gaussians; `compress` takes a PSNR target".into(),
        Remedy::TrainFromSnapshot => "`compress --train` trains such a model from its snapshot".into(),
        Remedy::DrawParticles => "draw particles from it with `recover`".into(),
        Remedy::PlanJob => "`particlegs plan` makes one".into(),
        Remedy::SortChunk { folder, chunk, broken } => {
            run_again(*broken, format!("run `particlegs scatter {} {chunk}`", folder.display()))
        }
        Remedy::FitBlock { folder, block, broken } => {
            run_again(*broken, format!("run `particlegs block {} {block}`", folder.display()))
        }
        Remedy::IsSnapshot => "`particlegs compress` makes a model of it".into(),
        Remedy::IsModel => {
            "`particlegs recover` draws particles from it; `particlegs render` draws pictures of it".into()
        }
        Remedy::IsJob => "`particlegs merge` makes the model of it; `particlegs status` tells how far it is".into(),
        Remedy::IsFileOfJob => "`particlegs merge` makes a model of the job's folder".into(),
        Remedy::NameModel => "name a model file, as `particlegs compress` writes it".into(),
        other => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn remedies_name_the_options_that_bring_them_about() {
        let fit = |broken| Remedy::FitBlock { folder: "job".into(), block: 3, broken };
        assert_eq!(in_words(&fit(false)), "run `particlegs block job 3`");
        assert_eq!(in_words(&fit(true)), "delete it and run `particlegs block job 3`");
        let both = Remedy::from("look closer").and(Remedy::ReadFrame(2));
        assert_eq!(in_words(&both), "look closer; `--frame 2` reads the last whole frame");
        assert_eq!(in_words(&Remedy::None.and(Remedy::StateBox)), in_words(&Remedy::StateBox));
        assert_eq!((exit_code(&Error::Cancelled), exit_code(&Error::argument("x"))), (130, 2));
    }
}
