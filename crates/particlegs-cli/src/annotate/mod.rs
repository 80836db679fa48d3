//! Text on pictures, and numbers as pictures have them.

pub mod text;
