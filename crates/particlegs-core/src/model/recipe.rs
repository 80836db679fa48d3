//! The recipe of a model.

use super::{LawKind, Target};
use serde::{Deserialize, Serialize};
use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

/// The recipe of a model: the demands on the fit, the options of reading, and the later steps. Two models of one
/// snapshot and one recipe are the same, if no limit of time ended their training.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct Recipe {
    /// Size, ratio, number or quality.
    #[serde(skip_serializing_if = "is_default")]
    pub target: Target,
    /// Time for quality.
    pub effort: Effort,
    /// Seed of the fit, of what it reads, and of the views.
    pub seed: u64,
    /// The law by which Gaussians become pictures.
    #[serde(skip_serializing_if = "is_default")]
    pub law: LawKind,
    /// Further training of the fit; `None` = there was none.
    #[serde(skip_serializing_if = "is_default")]
    pub training: Option<TrainingRecipe>,
    /// Options of reading the snapshot: those of the command by name, with their values (empty for a switch). The field
    /// of masses is `weights`.
    #[serde(skip_serializing_if = "is_default")]
    pub read: BTreeMap<String, String>,
    /// Default particle radius that was stated, world units.
    #[serde(skip_serializing_if = "is_default")]
    pub radius: Option<f64>,
    /// Default opacity that was stated.
    #[serde(skip_serializing_if = "is_default")]
    pub opacity: Option<f64>,
    /// Blocks that were fitted on their own.
    pub blocks: u32,
    /// Later steps, in this order.
    #[serde(skip_serializing_if = "is_default")]
    pub steps: Vec<RecipeStep>,
    /// Fields in which the parts of a merge differ: they have the value of [`Recipe::default`], the steps are one merge.
    #[serde(skip_serializing_if = "is_default")]
    pub differing: BTreeSet<String>,
}

/// A later step in the making of a model.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum RecipeStep {
    /// It was merged with others.
    Merge,
    /// It was reduced without the particles.
    Simplify(Target),
    /// It was trained further on the whole snapshot.
    Finetune {
        /// Size, ratio or number.
        target: Target,
        /// Seed of the pictures.
        seed: u64,
        /// Its training.
        training: TrainingRecipe,
    },
}

/// Names of the hyper-parameters of a training run.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct TrainingRecipe {
    /// The preset that they are.
    #[serde(skip_serializing_if = "is_default")]
    pub preset: Option<String>,
    /// Steps in all, where they are another number than the preset's.
    #[serde(skip_serializing_if = "is_default")]
    pub iterations: Option<u64>,
    /// The beginning of a hash of all of them, where they are none of the presets.
    #[serde(skip_serializing_if = "is_default")]
    pub config: Option<String>,
}

crate::named_values! {
    /// Time that a fit spends.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
    #[serde(rename_all = "snake_case")]
    pub enum Effort {
        Fast = "fast": "One iteration of expectation maximisation: eight times as fast, with fewer small groups, and the power spectrum is not held",
        #[default]
        Default = "default": "Six rounds of split and merge, with expectation maximisation after each",
        Best = "best": "Twelve rounds: takes nearly twice as long, for about 0.01 bits a particle",
    }
}

impl TrainingRecipe {
    /// The preset of fine-tuning, which is no option.
    pub const FINE_TUNING: &str = "finetune";
}

impl Default for Recipe {
    fn default() -> Self {
        Recipe {
            target: Target::Default,
            effort: Effort::Default,
            seed: 0,
            law: LawKind::default(),
            training: None,
            read: BTreeMap::new(),
            radius: None,
            opacity: None,
            blocks: 1,
            steps: Vec::new(),
            differing: BTreeSet::new(),
        }
    }
}

fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl Recipe {
    /// The field that differs where nothing is known.
    const ALL: &str = "all";

    /// Of a model that does not say what made it.
    pub fn unknown() -> Self {
        Recipe { differing: [Self::ALL.into()].into(), ..Recipe::default() }
    }

    /// With another step.
    pub fn then(mut self, step: RecipeStep) -> Self {
        self.steps.push(step);
        self
    }

    /// As a part of a merge.
    pub fn merged(self) -> Self {
        if self.steps.last() == Some(&RecipeStep::Merge) { self } else { self.then(RecipeStep::Merge) }
    }

    /// The common recipe of two merged parts. Associative and commutative, and takes a recipe with itself to itself.
    pub fn joined(mut self, other: &Recipe) -> Self {
        // Steps that differ become one merge (docs/format.md, section 12).
        let nothing = Recipe::default().merged();
        self.differing.extend(other.differing.iter().cloned());
        macro_rules! join {
            ($($field:ident)*) => {
                $(if self.$field != other.$field {
                    self.$field = nothing.$field;
                    self.differing.insert(stringify!($field).into());
                })*
            };
        }
        join!(target effort seed law training read radius opacity blocks steps);
        self
    }

    /// Whether a field is known, and the same in all parts of a merge.
    fn says(&self, field: &str) -> bool {
        !self.differing.contains(field) && !self.differing.contains(Self::ALL)
    }

    /// The effort of the fit, where the Gaussians are what it gave: neither trained nor reduced.
    pub fn fitted(&self) -> Option<Effort> {
        let fit = self.training.is_none() && self.steps.iter().all(|s| *s == RecipeStep::Merge);
        let known = ["effort", "training", "steps"].iter().all(|field| self.says(field));
        (fit && known).then_some(self.effort)
    }
}

/// As the command that makes it: `merge of: compress --ratio 300 --effort default --seed 42`. A `*` stands for what
/// differs among the parts of a merge.
impl fmt::Display for Recipe {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        // The last step is said first: it is of what the earlier ones made.
        for step in self.steps.iter().rev() {
            match step {
                RecipeStep::Merge => write!(f, "merge of: ")?,
                RecipeStep::Simplify(target) => write!(f, "simplify{target} of: ")?,
                RecipeStep::Finetune { target, seed, training } => {
                    write!(f, "finetune{target} --seed {seed}{training} of: ")?;
                }
            }
        }
        if self.differing.contains(Self::ALL) {
            return write!(f, "unknown");
        }
        if self.differing.contains("steps") {
            write!(f, "* of: ")?;
        }
        write!(f, "compress")?;
        let option = |name: &str, value: Option<String>| value.map_or(String::new(), |v| format!(" --{name} {v}"));
        let read = self.read.iter().map(|(name, value)| {
            let name = if name == "weights" { "mass-field" } else { name };
            let quote = if value.contains(' ') { "\"" } else { "" };
            format!(" --{name} {quote}{value}{quote}").trim_end().to_string()
        });
        let fields = [
            ("target", self.target.to_string()),
            ("effort", option("effort", Some(self.effort.name().into()))),
            ("seed", option("seed", Some(self.seed.to_string()))),
            ("training", self.training.as_ref().map_or(String::new(), TrainingRecipe::to_string)),
            ("law", option("law", (self.law != LawKind::default()).then(|| self.law.name().into()))),
            ("read", read.collect()),
            ("radius", option("radius", self.radius.map(|v| v.to_string()))),
            ("opacity", option("opacity", self.opacity.map(|v| v.to_string()))),
            ("blocks", option("blocks", (self.blocks > 1).then(|| self.blocks.to_string()))),
        ];
        fields.into_iter().try_for_each(|(field, text)| match self.differing.contains(field) {
            true => write!(f, " --{field} *"),
            false => f.write_str(&text),
        })
    }
}

/// As options of the command, each behind a space.
impl fmt::Display for TrainingRecipe {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let preset = self.preset.iter().filter(|name| *name != Self::FINE_TUNING);
        preset.into_iter().try_for_each(|name| write!(f, " --train {name}"))?;
        self.config.iter().try_for_each(|hash| write!(f, " --config blake3:{hash}"))?;
        self.iterations.iter().try_for_each(|n| write!(f, " --iterations {n}"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn asked(ratio: f64) -> Recipe {
        Recipe { target: Target::Ratio(ratio), seed: 42, ..Recipe::default() }
    }

    #[test]
    fn recipes_are_shown_as_the_command() {
        assert_eq!(asked(65.0).to_string(), "compress --ratio 65 --effort default --seed 42");
        let training = TrainingRecipe { preset: Some("best".into()), ..TrainingRecipe::default() };
        let read = [("every", "2"), ("left-out", ""), ("select", "name OW"), ("weights", "none")]
            .map(|(n, v)| (n.into(), v.into()));
        let recipe =
            Recipe { read: read.into(), training: Some(training), blocks: 3, opacity: Some(0.1), ..asked(65.0) };
        let all = "compress --ratio 65 --effort default --seed 42 --train best --every 2 --left-out --select \"name OW\" --mass-field none --opacity 0.1 --blocks 3";
        assert_eq!(recipe.to_string(), all);
        let small = recipe.merged().then(RecipeStep::Simplify(Target::Gaussians(20)));
        assert_eq!(small.to_string(), format!("simplify --gaussians 20 of: merge of: {all}"));
    }

    #[test]
    fn what_is_usual_takes_no_room_and_comes_back() {
        let json = |recipe: &Recipe| serde_json::to_string(recipe).unwrap();
        let usual = Recipe { seed: 42, ..Recipe::default() };
        assert_eq!(json(&usual), r#"{"effort":"default","seed":42,"blocks":1}"#);
        let training = TrainingRecipe { preset: Some(TrainingRecipe::FINE_TUNING.into()), ..TrainingRecipe::default() };
        let step = RecipeStep::Finetune { target: Target::Size(7), seed: 1, training };
        let recipe = asked(0.1).merged().then(step).joined(&asked(1.0 / 3.0));
        assert_eq!(serde_json::from_str::<Recipe>(&json(&recipe)).unwrap(), recipe);
    }

    #[test]
    fn the_effort_is_that_of_a_fit_alone() {
        let fast = Recipe { effort: Effort::Fast, ..asked(65.0) };
        let trained = Recipe { training: Some(TrainingRecipe::default()), ..fast.clone() };
        assert_eq!(fast.clone().merged().fitted(), Some(Effort::Fast));
        assert_eq!(fast.clone().merged().joined(&asked(5.0).merged()).fitted(), None, "two efforts");
        let others = Recipe { seed: 9, target: Target::Ratio(5.0), ..fast.clone() }.merged();
        assert_eq!(fast.clone().merged().joined(&others).fitted(), Some(Effort::Fast));
        assert_eq!(fast.clone().merged().joined(&trained.clone().merged()).fitted(), None);
        let small = fast.then(RecipeStep::Simplify(Target::Ratio(500.0)));
        assert_eq!([trained.fitted(), small.fitted(), Recipe::unknown().fitted()], [None; 3]);
    }
}
