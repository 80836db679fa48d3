//! The embedded font in a PDF: of its glyphs those that the page has, with what each is as text.

use super::font::{self, font};
use ab_glyph::{Font, GlyphId};
use flate2::Compression;
use flate2::write::ZlibEncoder;
use particlegs_core::{Error, Result};
use pdf_writer::types::{CidFontType, FontFlags, SystemInfo, UnicodeCmap};
use pdf_writer::{Filter, Finish, Name, Pdf, Rect, Ref, Str};
use std::collections::BTreeMap;
use std::io::Write;
use subsetter::GlyphRemapper;

const NAME: Name = Name(b"PRTCLG+DejaVuSans");
const ADOBE: SystemInfo = SystemInfo { registry: Str(b"Adobe"), ordering: Str(b"Identity"), supplement: 0 };

/// The glyphs that a page has, numbered anew.
pub struct PageFont {
    renumbered: GlyphRemapper,
    characters: BTreeMap<u16, char>,
}

impl PageFont {
    pub fn of<'a>(texts: impl Iterator<Item = &'a str>) -> Self {
        let (mut renumbered, mut characters) = (GlyphRemapper::new(), BTreeMap::new());
        for c in texts.flat_map(str::chars) {
            characters.insert(renumbered.remap(font().glyph_id(c).0), c);
        }
        PageFont { renumbered, characters }
    }

    /// A text as the page's numbers of glyphs, and its width.
    pub fn coded(&self, text: &str, em: f64) -> (Vec<u8>, f64) {
        let (glyphs, width) = font::placed(text, em);
        let number = |id: GlyphId| self.renumbered.get(id.0).unwrap_or(0);
        (glyphs.into_iter().flat_map(|(id, _)| number(id).to_be_bytes()).collect(), width)
    }

    /// Writes the font under the number `own`, and what belongs to it under the five that follow.
    pub fn write(&self, pdf: &mut Pdf, font_ref: Ref) -> Result<()> {
        let ref_behind = |k: i32| Ref::new(font_ref.get() + k);
        let (cid, descriptor, file, unicode) = (ref_behind(1), ref_behind(2), ref_behind(3), ref_behind(4));
        let face = font();
        let units = face.units_per_em().unwrap_or(1.0);
        let thousandths = |v: f32| 1000.0 * v / units;
        pdf.type0_font(font_ref)
            .base_font(NAME)
            .encoding_predefined(Name(b"Identity-H"))
            .descendant_font(cid)
            .to_unicode(unicode);
        let mut descendant = pdf.cid_font(cid);
        descendant.subtype(CidFontType::Type2).base_font(NAME).system_info(ADOBE).font_descriptor(descriptor);
        descendant.default_width(0.0).cid_to_gid_map_predefined(Name(b"Identity"));
        let widths = self.renumbered.remapped_gids().map(|id| thousandths(face.h_advance_unscaled(GlyphId(id))));
        descendant.widths().consecutive(0, widths);
        descendant.finish();
        let (ascent, descent) = (thousandths(face.ascent_unscaled()), thousandths(face.descent_unscaled()));
        pdf.font_descriptor(descriptor)
            .name(NAME)
            .flags(FontFlags::SYMBOLIC)
            .bbox(Rect::new(-1021.0, -463.0, 1793.0, 1232.0))
            .italic_angle(0.0)
            .ascent(ascent)
            .descent(descent)
            .cap_height(1000.0 * font::CAPITALS as f32)
            .stem_v(80.0)
            .font_file2(file);
        let cut = subsetter::subset(font::FONT, 0, &self.renumbered)
            .map_err(|e| Error::argument(format!("the font cannot be embedded in the PDF: {e}")))?;
        let length = cut.len() as i32;
        pdf.stream(file, &deflated(&cut)).filter(Filter::FlateDecode).pair(Name(b"Length1"), length);
        let mut map = UnicodeCmap::new(Name(b"Custom"), ADOBE);
        self.characters.iter().for_each(|(glyph, c)| map.pair(*glyph, *c));
        pdf.cmap(unicode, &map.finish());
        Ok(())
    }
}

pub fn deflated(bytes: &[u8]) -> Vec<u8> {
    let mut coder = ZlibEncoder::new(Vec::new(), Compression::default());
    // Writing to memory cannot fail.
    let _ = coder.write_all(bytes);
    coder.finish().unwrap_or_default()
}
