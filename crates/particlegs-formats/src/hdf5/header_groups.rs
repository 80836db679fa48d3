//! The groups that say something about a snapshot.

use super::attributes::Attributes;

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
