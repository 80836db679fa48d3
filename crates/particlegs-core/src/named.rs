//! Values that have names.

/// An enum of [`named_values`](crate::named_values).
pub trait NamedValue: Copy + Send + Sync + 'static {
    /// Each value, its name, and what it means in a line for the command's help (empty: nothing).
    const VALUES: &'static [(Self, &'static str, &'static str)];

    /// The value of a name; where there is none, the names that there are.
    ///
    /// # Errors
    /// "there are a, b, c" for any other name.
    fn from_name(name: &str) -> Result<Self, String> {
        let names = || Self::VALUES.iter().map(|(_, name, _)| *name).collect::<Vec<_>>().join(", ");
        let value = Self::VALUES.iter().find(|(_, text, _)| *text == name);
        value.map(|(value, ..)| *value).ok_or_else(|| format!("there are {}", names()))
    }
}

/// An enum whose values have names on the command line, in files and in Python: `Value = "name": "help",`. The help
/// is the value's documentation, too.
#[macro_export]
macro_rules! named_values {
    ($(#[$meta:meta])* $vis:vis enum $of:ident {
        $($(#[$attribute:meta])* $value:ident = $name:literal $(: $help:literal)?,)+
    }) => {
        $(#[$meta])*
        $vis enum $of {
            $($(#[doc = concat!($help, ".")])? $(#[$attribute])* $value,)+
        }

        impl $of {
            /// All values.
            pub const ALL: [$of; [$($name),+].len()] = [$($of::$value),+];

            /// The value's name.
            pub fn name(self) -> &'static str {
                [$($name),+][self as usize]
            }
        }

        impl $crate::NamedValue for $of {
            const VALUES: &'static [($of, &'static str, &'static str)] =
                &[$(($of::$value, $name, concat!($($help)?))),+];
        }
    };
}
