//! The typeface of figures: Inter by The Inter Project Authors, cut down to Latin, Greek and signs.

use std::sync::LazyLock;

use ttf_parser::{Face as Parsed, GlyphId, OutlineBuilder, Tag};

/// One cut of the typeface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Face {
    Regular,
    Italic,
    SemiBold,
}

/// The name of the typeface in files.
pub(super) const FAMILY: &str = "Inter";

static PARSED: LazyLock<[Option<Parsed<'static>>; 3]> =
    LazyLock::new(|| Face::ALL.map(|face| Parsed::parse(face.file(), 0).ok()));

impl Face {
    pub(super) const ALL: [Self; 3] = [Self::Regular, Self::Italic, Self::SemiBold];

    /// The whole OpenType file.
    pub(super) fn file(self) -> &'static [u8] {
        match self {
            Self::Regular => include_bytes!("../../assets/fonts/Inter-Regular.otf"),
            Self::Italic => include_bytes!("../../assets/fonts/Inter-Italic.otf"),
            Self::SemiBold => include_bytes!("../../assets/fonts/Inter-SemiBold.otf"),
        }
    }

    /// The name under which a document knows this cut.
    pub(super) fn post_script_name(self) -> &'static str {
        match self {
            Self::Regular => "Inter-Regular",
            Self::Italic => "Inter-Italic",
            Self::SemiBold => "Inter-SemiBold",
        }
    }

    /// Weight as in CSS: 400 is regular.
    pub(super) fn weight(self) -> u16 {
        if self == Self::SemiBold { 600 } else { 400 }
    }

    pub(super) fn is_italic(self) -> bool {
        self == Self::Italic
    }

    fn parsed(self) -> Option<&'static Parsed<'static>> {
        PARSED[self as usize].as_ref()
    }

    /// The compact outlines alone, which is what a PDF embeds.
    pub(super) fn compact_outlines(self) -> &'static [u8] {
        self.parsed().and_then(|face| face.raw_face().table(Tag::from_bytes(b"CFF "))).unwrap_or_default()
    }

    /// The glyph of a character; that of a question mark where the typeface has none.
    pub(super) fn glyph(self, character: char) -> u16 {
        let Some(face) = self.parsed() else { return 0 };
        face.glyph_index(character).or_else(|| face.glyph_index('?')).unwrap_or_default().0
    }

    /// How far a glyph moves the pen, as a part of the size of the text.
    pub(super) fn advance(self, glyph: u16) -> f64 {
        let Some(face) = self.parsed() else { return 0.0 };
        let advance = face.glyph_hor_advance(GlyphId(glyph)).unwrap_or_default();
        f64::from(advance) / f64::from(face.units_per_em())
    }

    /// Hands the outline of a glyph to `builder`, in units of which [`Face::units_per_em`] are the size of the text.
    pub(super) fn outline(self, glyph: u16, builder: &mut dyn OutlineBuilder) {
        if let Some(face) = self.parsed() {
            // A blank has no outline.
            let _ = face.outline_glyph(GlyphId(glyph), builder);
        }
    }

    pub(super) fn units_per_em(self) -> f64 {
        self.parsed().map_or(1.0, |face| f64::from(face.units_per_em()))
    }

    /// Number of glyphs.
    pub(super) fn glyphs(self) -> u16 {
        self.parsed().map_or(0, Parsed::number_of_glyphs)
    }

    /// Ascent, descent and height of capitals, as parts of the size of the text.
    pub(super) fn heights(self) -> [f64; 3] {
        let Some(face) = self.parsed() else { return [0.0; 3] };
        [face.ascender(), face.descender(), face.capital_height().unwrap_or_default()]
            .map(|height| f64::from(height) / self.units_per_em())
    }

    /// The box around all glyphs: left, bottom, right, top, as parts of the size of the text.
    pub(super) fn bounds(self) -> [f64; 4] {
        let Some(face) = self.parsed() else { return [0.0; 4] };
        let found = face.global_bounding_box();
        [found.x_min, found.y_min, found.x_max, found.y_max].map(|x| f64::from(x) / self.units_per_em())
    }

    /// Angle of the stems, degrees; negative where they lean to the right.
    pub(super) fn italic_angle(self) -> f64 {
        self.parsed().map_or(0.0, |face| f64::from(face.italic_angle()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_cut_is_whole_and_has_the_signs_of_figures() {
        for face in Face::ALL {
            let unknown = face.glyph('?');
            assert!(face.parsed().is_some() && face.compact_outlines().len() > 10_000);
            for sign in "AZaz09 θφσπμäß°−×·±≤–…".chars() {
                assert!(face.glyph(sign) != unknown, "{face:?} {sign}");
                assert!((0.1..1.2).contains(&face.advance(face.glyph(sign))), "{face:?} {sign}");
            }
            assert_eq!(face.glyph('\u{4e2d}'), unknown);
            let [ascent, descent, capital] = face.heights();
            assert!(ascent > capital && capital > 0.6 && descent < -0.1, "{ascent} {descent} {capital}");
        }
        assert!(Face::Italic.italic_angle() < -5.0 && Face::Regular.italic_angle() == 0.0);
    }
}
