//! Whether the species of a snapshot share Gaussians.

use particlegs_core::model::Recipe;
use std::fmt;

/// Whether the species of a snapshot share Gaussians.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum SharingPolicy {
    /// They do if that describes them better in as many bytes.
    #[default]
    Automatic,
    /// They do.
    Yes,
    /// Each has Gaussians of its own.
    No,
}

/// Its name in recipes.
pub(super) const OPTION: &str = "share-gaussians";

impl SharingPolicy {
    /// The one that made a model.
    pub(super) fn of_recipe(recipe: &Recipe) -> Self {
        recipe.read.get(OPTION).and_then(|text| text.parse().ok()).unwrap_or_default()
    }

    const NAMES: [(&str, SharingPolicy); 3] =
        [("auto", SharingPolicy::Automatic), ("yes", SharingPolicy::Yes), ("no", SharingPolicy::No)];
}

impl fmt::Display for SharingPolicy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(Self::NAMES[*self as usize].0)
    }
}

impl std::str::FromStr for SharingPolicy {
    type Err = String;

    fn from_str(text: &str) -> std::result::Result<Self, String> {
        let policy = Self::NAMES.iter().find(|(name, _)| *name == text);
        policy.map(|f| f.1).ok_or_else(|| "use `auto`, `yes` or `no`".into())
    }
}
