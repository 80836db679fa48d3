//! A number that may be missing, which files write as 0.

use serde::{Deserialize, Deserializer, Serialize, Serializer};

pub fn serialize<S: Serializer>(number: &Option<u64>, to: S) -> Result<S::Ok, S::Error> {
    number.unwrap_or(0).serialize(to)
}

pub fn deserialize<'a, D: Deserializer<'a>>(from: D) -> Result<Option<u64>, D::Error> {
    Ok(Some(u64::deserialize(from)?).filter(|n| *n > 0))
}
