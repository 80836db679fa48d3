//! Attributes as numbers or text, and the groups whose attributes say something about a snapshot.

use crate::numbers::NumberType;
use hdf5_reader::{Attribute, ByteOrder, Datatype};

/// Numbers of an attribute that are looked at; real ones have at most some dozens.
const MAX_NUMBERS: usize = 1 << 12;

/// Texts of an attribute that are kept.
const MAX_TEXTS: usize = 16;

#[derive(Clone, Debug, PartialEq)]
enum AttributeValue {
    Numbers(Vec<f64>),
    /// One or more.
    Text(Vec<String>),
}

/// Attributes of a group or data set, by name; what is neither number nor text is left out.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Attributes(Vec<(String, AttributeValue)>);

impl Attributes {
    pub(super) fn new(attributes: &[Attribute]) -> Self {
        Attributes(attributes.iter().filter_map(|a| Some((a.name.clone(), value(a)?))).collect())
    }

    fn get(&self, name: &str) -> Option<&AttributeValue> {
        self.0.iter().find(|a| a.0 == name).map(|a| &a.1)
    }

    pub fn has(&self, name: &str) -> bool {
        self.get(name).is_some()
    }

    pub fn numbers(&self, name: &str) -> Option<&[f64]> {
        match self.get(name)? {
            AttributeValue::Numbers(numbers) => Some(numbers),
            AttributeValue::Text(_) => None,
        }
    }

    /// The first number of the first of `names` that there is.
    pub fn number(&self, names: &[&str]) -> Option<f64> {
        names.iter().find_map(|n| self.numbers(n)?.first().copied())
    }

    pub fn single(&self) -> Vec<(String, f64)> {
        let one = |(name, value): &(String, AttributeValue)| match value {
            AttributeValue::Numbers(numbers) if numbers.len() == 1 => Some((name.clone(), numbers[0])),
            _ => None,
        };
        self.0.iter().filter_map(one).collect()
    }

    /// The text of the first of `names` that there is and that is not blank.
    pub fn text(&self, names: &[&str]) -> Option<&str> {
        names.iter().find_map(|n| match self.get(n)? {
            AttributeValue::Text(texts) => texts.first().map(|text| text.trim()).filter(|text| !text.is_empty()),
            AttributeValue::Numbers(_) => None,
        })
    }

    /// All texts of an attribute.
    pub fn texts(&self, name: &str) -> Option<&[String]> {
        match self.get(name)? {
            AttributeValue::Text(texts) => Some(texts),
            AttributeValue::Numbers(_) => None,
        }
    }
}

fn value(attribute: &Attribute) -> Option<AttributeValue> {
    // h5py stores what is true or false as an enumeration.
    let datatype = match &attribute.datatype {
        Datatype::Enum { base, .. } => base,
        other => other,
    };
    let (kind, order) = match datatype {
        Datatype::FloatingPoint { size: size @ (4 | 8), byte_order } => {
            (NumberType::float((*size).into())?, byte_order)
        }
        Datatype::FixedPoint { size, signed, byte_order } => {
            (NumberType::integer((*size).into(), *signed)?, byte_order)
        }
        _ => {
            let strings = attribute.read_strings().or_else(|_| attribute.read_string().map(|s| vec![s])).ok()?;
            let plain = |text: &String| text.chars().filter(|c| !c.is_control()).take(1000).collect();
            return Some(AttributeValue::Text(strings.iter().take(MAX_TEXTS).map(plain).collect()));
        }
    };
    let count = attribute.num_elements().ok()?;
    let stored = attribute.raw_data.chunks_exact(kind.bytes() as usize).take(MAX_NUMBERS);
    let numbers: Vec<f64> = stored.map(|b| kind.get(b, *order == ByteOrder::BigEndian)).collect();
    (numbers.len() as u64 >= count.min(MAX_NUMBERS as u64)).then_some(AttributeValue::Numbers(numbers))
}

#[cfg(test)]
impl Attributes {
    pub fn from_numbers(numbers: &[(&str, f64)]) -> Self {
        Attributes(numbers.iter().map(|&(n, v)| (n.to_string(), AttributeValue::Numbers(vec![v]))).collect())
    }
}

#[derive(Clone, Default)]
pub struct HeaderGroups {
    /// `Header`.
    pub header: Attributes,
    /// `Parameters` (Gadget-4, AREPO, SWIFT).
    pub parameters: Attributes,
    /// `Config` (Gadget-4, AREPO).
    pub config: Attributes,
    /// `Units` (SWIFT).
    pub units: Attributes,
    /// `Cosmology` (SWIFT).
    pub cosmology: Attributes,
}
