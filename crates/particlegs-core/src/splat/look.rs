//! The looks a picture can have.

/// How optical depth, or a snapshot, becomes grey levels (docs/law/response.md, "Looks").
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Look {
    /// ParaView 6.0's default: four-layer dual depth peeling, 8-bit blending, FXAA.
    Paraview,
    /// The same without FXAA.
    ParaviewNoFxaa,
    /// 255 (1 - exp(-tau)).
    Expected,
}

impl Look {
    /// All looks that scores are given for.
    pub const ALL: [Look; 3] = [Look::Paraview, Look::ParaviewNoFxaa, Look::Expected];

    /// The name on the command line.
    pub fn name(self) -> &'static str {
        match self {
            Look::Paraview => "paraview",
            Look::ParaviewNoFxaa => "paraview-no-fxaa",
            Look::Expected => "expected",
        }
    }
}
