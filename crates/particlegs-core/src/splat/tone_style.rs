//! The looks a picture can have.

crate::named_values! {
    /// Grey levels of optical depth or of a snapshot; scores are given for all (docs/law/response.md, "Looks").
    #[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, serde::Serialize, serde::Deserialize)]
    #[serde(rename_all = "kebab-case")]
    pub enum ToneStyle {
        /// ParaView 6.0's default: four-layer dual depth peeling, 8-bit blending, FXAA.
        Paraview = "paraview",
        /// The same without FXAA.
        ParaviewNoFxaa = "paraview-no-fxaa",
        /// 255 (1 - exp(-tau)).
        Expected = "expected",
    }
}
