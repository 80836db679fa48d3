//! Named columns: what particles and Gaussians carry beside their places and shapes.

/// Columns in the order in which they were added, each under a name of its own. All have the length of
/// what carries them.
#[derive(Clone, Debug, PartialEq)]
pub struct Columns<T>(Vec<(String, T)>);

/// Weights of particles, masses of Gaussians.
pub const MASS: &str = "mass";

impl<T> Default for Columns<T> {
    fn default() -> Self {
        Columns(Vec::new())
    }
}

impl<T> Columns<T> {
    /// The column of that name.
    pub fn get(&self, name: &str) -> Option<&T> {
        self.0.iter().find(|c| c.0 == name).map(|c| &c.1)
    }

    /// The column of that name, to be changed.
    pub fn get_mut(&mut self, name: &str) -> Option<&mut T> {
        self.0.iter_mut().find(|c| c.0 == name).map(|c| &mut c.1)
    }

    /// Adds a column, or replaces the one of that name.
    pub fn set(&mut self, name: &str, column: T) {
        match self.get_mut(name) {
            Some(old_column) => *old_column = column,
            None => self.0.push((name.to_string(), column)),
        }
    }

    /// Takes a column away.
    pub fn remove(&mut self, name: &str) -> Option<T> {
        let at = self.0.iter().position(|c| c.0 == name)?;
        Some(self.0.remove(at).1)
    }

    /// All columns and their names.
    pub fn iter(&self) -> impl Iterator<Item = (&str, &T)> {
        self.0.iter().map(|(name, column)| (&name[..], column))
    }

    /// All columns and their names, to be changed.
    pub fn iter_mut(&mut self) -> impl Iterator<Item = (&str, &mut T)> {
        self.0.iter_mut().map(|(name, column)| (&name[..], column))
    }

    /// Leaves out the columns that `keep` does not want.
    pub fn retain(&mut self, keep: impl Fn(&str) -> bool) {
        self.0.retain(|(name, _)| keep(name));
    }

    /// The same names, with what `f` makes of each column.
    pub fn map<U>(&self, f: impl Fn(&T) -> U) -> Columns<U> {
        Columns(self.0.iter().map(|(name, column)| (name.clone(), f(column))).collect())
    }
}
