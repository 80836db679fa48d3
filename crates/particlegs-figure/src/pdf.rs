//! A sheet as a PDF of one page: pictures without loss, lines and text as such. Of the embedded font it has the glyphs of
//! the page, with what each is as text. The unit is a point.

use super::FigureImage;
use super::font::{self, font};
use super::png_file::{PngMetadata, compressed_rows};
use super::sheet::{Mark, PageRectangle, RgbColour, Sheet, TextLine};
use ab_glyph::{Font, GlyphId};
use flate2::Compression;
use flate2::write::ZlibEncoder;
use particlegs_core::{Error, Result};
use pdf_writer::types::{
    CidFontType, FontFlags, LineCapStyle, LineJoinStyle, Predictor, SystemInfo, TextRenderingMode, UnicodeCmap,
};
use pdf_writer::{Content, Filter, Finish, Name, Pdf, Rect, Ref, Str, TextStr};
use std::collections::{BTreeMap, BTreeSet};
use std::io::Write;
use subsetter::GlyphRemapper;

const CATALOG: i32 = 1;
const PAGES: i32 = 2;
const PAGE: i32 = 3;
const CONTENT: i32 = 4;
const INFO: i32 = 5;
/// The font, and what belongs to it.
const FONT: i32 = 6;
const PICTURES: i32 = 12;

/// The bytes of the file; no date, so that the same page has the same bytes.
pub fn pdf(sheet: &Sheet, about: &PngMetadata) -> Result<Vec<u8>> {
    let texts = || sheet.marks.iter().filter_map(|m| if let Mark::Words(w) = m { Some(&w.text[..]) } else { None });
    let font = PageFont::of(texts());
    let pictures: Vec<&FigureImage> =
        sheet.marks.iter().filter_map(|m| if let Mark::Picture(_, image) = m { Some(image) } else { None }).collect();
    let mut pdf = Pdf::new();
    pdf.catalog(Ref::new(CATALOG)).pages(Ref::new(PAGES));
    pdf.pages(Ref::new(PAGES)).kids([Ref::new(PAGE)]).count(1);
    let mut page = pdf.page(Ref::new(PAGE));
    page.media_box(Rect::new(0.0, 0.0, sheet.width as f32, sheet.height as f32)).parent(Ref::new(PAGES));
    page.contents(Ref::new(CONTENT));
    let mut resources = page.resources();
    resources.fonts().pair(Name(b"F"), Ref::new(FONT));
    let mut named = resources.x_objects();
    for i in 0..pictures.len() {
        named.pair(Name(format!("P{i}").as_bytes()), Ref::new(PICTURES + i as i32));
    }
    named.finish();
    let mut states = resources.ext_g_states();
    // PDF has no operator for opacity: a page names a state among its resources.
    for percent in opacities(sheet) {
        states
            .insert(Name(format!("G{percent}").as_bytes()))
            .start::<pdf_writer::writers::ExtGraphicsState>()
            .stroking_alpha(percent as f32 / 100.0);
    }
    states.finish();
    resources.finish();
    page.finish();
    for (i, image) in pictures.iter().enumerate() {
        picture(&mut pdf, Ref::new(PICTURES + i as i32), image)?;
    }
    if texts().next().is_some() {
        font.write(&mut pdf, Ref::new(FONT))?;
    }
    pdf.stream(Ref::new(CONTENT), &deflated(content(sheet, &font).as_slice())).filter(Filter::FlateDecode);
    let mut info = pdf.document_info(Ref::new(INFO));
    if let Some(title) = &about.title {
        info.title(TextStr(title));
    }
    if !about.software.is_empty() {
        info.creator(TextStr(&about.software)).producer(TextStr(&about.software)).subject(TextStr(&about.provenance));
    }
    info.finish();
    Ok(pdf.finish())
}

fn picture(pdf: &mut Pdf, image_ref: Ref, image: &FigureImage) -> Result<()> {
    let (size, rows) = (image.size(), compressed_rows(image)?);
    let mut object = pdf.image_xobject(image_ref, &rows);
    object.filter(Filter::FlateDecode);
    object.width(size.width as i32).height(size.height as i32).bits_per_component(8);
    match image.channels() {
        1 => object.color_space().device_gray(),
        _ => object.color_space().device_rgb(),
    }
    // PDF undoes PNG's filters itself, so the compressed rows go in as they are.
    let mut rows = object.decode_parms();
    rows.predictor(Predictor::PngOptimum).colors(image.channels() as i32).columns(size.width as i32);
    Ok(())
}

/// Opacities of lines that can be seen through, in percent.
fn opacities(sheet: &Sheet) -> BTreeSet<u8> {
    let seen = |m: &Mark| if let Mark::Line { opacity, .. } = m { Some(percent(*opacity)) } else { None };
    sheet.marks.iter().filter_map(seen).filter(|p| *p < 100).collect()
}

fn percent(opacity: f64) -> u8 {
    (100.0 * opacity).round().clamp(0.0, 100.0) as u8
}

/// The marks as operators of the page, whose y points up.
fn content(sheet: &Sheet, font: &PageFont) -> pdf_writer::Buf {
    let mut to = Content::new();
    let up = |y: f64| (sheet.height - y) as f32;
    let fill = |to: &mut Content, a: &PageRectangle, ink: RgbColour| {
        let [r, g, b] = unit(ink);
        to.set_fill_rgb(r, g, b).rect(a.x as f32, up(a.bottom()), a.w as f32, a.h as f32).fill_nonzero();
    };
    let path = |to: &mut Content, points: &[[f64; 2]]| {
        for (i, p) in points.iter().enumerate() {
            let (x, y) = (p[0] as f32, up(p[1]));
            if i == 0 {
                to.move_to(x, y)
            } else {
                to.line_to(x, y)
            };
        }
    };
    fill(&mut to, &PageRectangle { x: 0.0, y: 0.0, w: sheet.width, h: sheet.height }, sheet.ground);
    let mut pictures = 0;
    for mark in &sheet.marks {
        match mark {
            Mark::Picture(a, _) => {
                // PDF draws every picture on the unit square, from its lower left corner.
                to.save_state().transform([a.w as f32, 0.0, 0.0, a.h as f32, a.x as f32, up(a.bottom())]);
                to.x_object(Name(format!("P{pictures}").as_bytes())).restore_state();
                pictures += 1;
            }
            Mark::Fill(area, ink) => fill(&mut to, area, *ink),
            Mark::Polygon(corners, ink) => {
                let [r, g, b] = unit(*ink);
                to.set_fill_rgb(r, g, b);
                path(&mut to, corners);
                to.fill_even_odd();
            }
            Mark::Line { points, width, ink, opacity } => {
                let [r, g, b] = unit(*ink);
                to.save_state().set_stroke_rgb(r, g, b).set_line_width(*width as f32);
                to.set_line_join(LineJoinStyle::RoundJoin).set_line_cap(LineCapStyle::ButtCap);
                if percent(*opacity) < 100 {
                    to.set_parameters(Name(format!("G{}", percent(*opacity)).as_bytes()));
                }
                path(&mut to, points);
                to.stroke().restore_state();
            }
            Mark::Words(words) => text(&mut to, words, font, sheet.height),
        }
    }
    to.finish()
}

fn text(to: &mut Content, w: &TextLine, font: &PageFont, height: f64) {
    let (glyphs, width) = font.coded(&w.text, w.em);
    let back = w.anchor.before(width);
    let (x, y) = (w.at[0], height - w.at[1]);
    let matrix = match w.turned {
        true => [0.0, 1.0, -1.0, 0.0, x as f32, (y - back) as f32],
        false => [1.0, 0.0, 0.0, 1.0, (x - back) as f32, y as f32],
    };
    let show = |to: &mut Content| {
        to.begin_text().set_font(Name(b"F"), w.em as f32).set_text_matrix(matrix).show(Str(&glyphs)).end_text();
    };
    let [r, g, b] = unit(w.ink);
    // The rim is drawn first: half of its stroke lies under the letters.
    if let Some(rim) = w.rim {
        let [r, g, b] = unit(rim);
        to.save_state().set_stroke_rgb(r, g, b).set_line_width(0.22 * w.em as f32);
        to.set_line_join(LineJoinStyle::RoundJoin).set_text_rendering_mode(TextRenderingMode::Stroke);
        show(to);
        to.restore_state();
    }
    to.set_fill_rgb(r, g, b);
    show(to);
}

fn unit(ink: RgbColour) -> [f32; 3] {
    ink.map(|v| f32::from(v) / 255.0)
}

/// Six capitals and a plus mark the part of a font.
const FONT_NAME: Name = Name(b"PRTCLG+DejaVuSans");
const ADOBE: SystemInfo = SystemInfo { registry: Str(b"Adobe"), ordering: Str(b"Identity"), supplement: 0 };

/// The glyphs that a page has, numbered anew.
struct PageFont {
    renumbered: GlyphRemapper,
    characters: BTreeMap<u16, char>,
}

impl PageFont {
    fn of<'a>(texts: impl Iterator<Item = &'a str>) -> Self {
        let (mut renumbered, mut characters) = (GlyphRemapper::new(), BTreeMap::new());
        for c in texts.flat_map(str::chars) {
            characters.insert(renumbered.remap(font().glyph_id(c).0), c);
        }
        PageFont { renumbered, characters }
    }

    /// A text as the page's numbers of glyphs, and its width.
    fn coded(&self, text: &str, em: f64) -> (Vec<u8>, f64) {
        let (glyphs, width) = font::placed(text, em);
        let number = |id: GlyphId| self.renumbered.get(id.0).unwrap_or(0);
        // Identity-H reads two bytes a glyph, the higher first.
        (glyphs.into_iter().flat_map(|(id, _)| number(id).to_be_bytes()).collect(), width)
    }

    /// Writes the font under the number `font_ref`, and what belongs to it under the five that follow.
    fn write(&self, pdf: &mut Pdf, font_ref: Ref) -> Result<()> {
        let ref_behind = |k: i32| Ref::new(font_ref.get() + k);
        let (cid, descriptor, file, unicode) = (ref_behind(1), ref_behind(2), ref_behind(3), ref_behind(4));
        let face = font();
        let units = face.units_per_em().unwrap_or(1.0);
        let thousandths = |v: f32| 1000.0 * v / units;
        pdf.type0_font(font_ref)
            .base_font(FONT_NAME)
            .encoding_predefined(Name(b"Identity-H"))
            .descendant_font(cid)
            .to_unicode(unicode);
        let mut descendant = pdf.cid_font(cid);
        descendant.subtype(CidFontType::Type2).base_font(FONT_NAME).system_info(ADOBE).font_descriptor(descriptor);
        descendant.default_width(0.0).cid_to_gid_map_predefined(Name(b"Identity"));
        let widths = self.renumbered.remapped_gids().map(|id| thousandths(face.h_advance_unscaled(GlyphId(id))));
        descendant.widths().consecutive(0, widths);
        descendant.finish();
        let (ascent, descent) = (thousandths(face.ascent_unscaled()), thousandths(face.descent_unscaled()));
        pdf.font_descriptor(descriptor)
            .name(FONT_NAME)
            // The font has letters beyond the standard Latin ones, such as Σ.
            .flags(FontFlags::SYMBOLIC)
            // The bounds of all of DejaVu Sans, in thousandths of an em.
            .bbox(Rect::new(-1021.0, -463.0, 1793.0, 1232.0))
            .italic_angle(0.0)
            .ascent(ascent)
            .descent(descent)
            .cap_height(1000.0 * font::CAPITALS as f32)
            .stem_v(80.0)
            .font_file2(file);
        let cut = subsetter::subset(font::FONT, 0, &self.renumbered)
            .map_err(|e| Error::argument(format!("the font cannot be embedded in the PDF: {e}")))?;
        // PDF wants the length before compression as well.
        let length = cut.len() as i32;
        pdf.stream(file, &deflated(&cut)).filter(Filter::FlateDecode).pair(Name(b"Length1"), length);
        let mut map = UnicodeCmap::new(Name(b"Custom"), ADOBE);
        self.characters.iter().for_each(|(glyph, c)| map.pair(*glyph, *c));
        pdf.cmap(unicode, &map.finish());
        Ok(())
    }
}

fn deflated(bytes: &[u8]) -> Vec<u8> {
    let mut coder = ZlibEncoder::new(Vec::new(), Compression::default());
    // Writing to memory cannot fail.
    let _ = coder.write_all(bytes);
    coder.finish().unwrap_or_default()
}
