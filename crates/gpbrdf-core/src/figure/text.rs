//! Lines of text: greek letters in italics, subscripts, superscripts, and where a line ends.

use crate::figure::font::Face;

/// Letters in one cut and size, at a place relative to the start of their line.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Run {
    pub(super) face: Face,
    pub(super) size: f64,
    /// To the right of the start.
    pub(super) x: f64,
    /// Above the line.
    pub(super) rise: f64,
    pub(super) text: String,
}

/// A line of text, set.
#[derive(Clone, Debug, Default, PartialEq)]
pub(super) struct Line {
    pub(super) runs: Vec<Run>,
    pub(super) width: f64,
}

/// Size of subscripts and superscripts, and how far they are below and above the line, as parts of the size.
const SMALL: f64 = 0.72;
const DROP: f64 = -0.18;
const RISE: f64 = 0.36;

#[derive(Clone, Copy, PartialEq)]
enum Place {
    Line,
    Below,
    Above,
}

/// A character with its style.
#[derive(Clone, Copy)]
struct Letter {
    character: char,
    place: Place,
    is_greek: bool,
}

fn is_greek(character: char) -> bool {
    ('\u{391}'..='\u{3c9}').contains(&character)
}

/// Reads the marks of subscripts and superscripts.
///
/// An underscore after a Greek letter makes the next character a subscript; `_{...}` and `^{...}` make what is between
/// the braces one, or a superscript.
fn letters(text: &str) -> Vec<Letter> {
    let mut found: Vec<Letter> = Vec::new();
    let mut rest = text.chars().filter(|c| !c.is_control()).peekable();
    while let Some(character) = rest.next() {
        let place = match character {
            '_' => Place::Below,
            '^' => Place::Above,
            _ => Place::Line,
        };
        let follows_greek = found.last().is_some_and(|last| last.is_greek && last.place == Place::Line);
        let plain = |character, place| Letter { character, place, is_greek: is_greek(character) };
        if place != Place::Line && rest.peek() == Some(&'{') {
            rest.next();
            found.extend(rest.by_ref().take_while(|&c| c != '}').map(|c| plain(c, place)));
        } else if place == Place::Below && follows_greek {
            found.extend(rest.next().map(|c| plain(c, place)));
        } else {
            found.push(plain(character, Place::Line));
        }
    }
    found
}

fn set(letters: &[Letter], size: f64, face: Face) -> Line {
    let mut line = Line::default();
    for letter in letters {
        let italic = letter.is_greek && letter.place == Place::Line && face == Face::Regular;
        let face = if italic { Face::Italic } else { face };
        let (size, rise) = match letter.place {
            Place::Line => (size, 0.0),
            Place::Below => (SMALL * size, DROP * size),
            Place::Above => (SMALL * size, RISE * size),
        };
        match line.runs.last_mut() {
            Some(run) if run.face == face && run.rise == rise => run.text.push(letter.character),
            _ => line.runs.push(Run { face, size, x: line.width, rise, text: letter.character.to_string() }),
        }
        line.width += size * face.advance(face.glyph(letter.character));
    }
    line
}

/// Sets a text in one line.
pub(super) fn line(text: &str, size: f64, face: Face) -> Line {
    set(&letters(text), size, face)
}

/// The width of a text in one line.
pub(super) fn width(text: &str, size: f64, face: Face) -> f64 {
    line(text, size, face).width
}

/// Sets a text in as many lines as it needs to be no wider than `limit`; no line for an empty text. A word that is
/// wider has a line of its own, broken where it has to be.
pub(super) fn wrap(text: &str, size: f64, face: Face, limit: f64) -> Vec<Line> {
    let all = letters(text);
    let mut lines = Vec::new();
    let mut start = 0;
    while start < all.len() {
        let mut end = start;
        let mut space = None;
        while end < all.len() {
            if end > start && set(&all[start..=end], size, face).width > limit && all[end].character != ' ' {
                break;
            }
            if all[end].character == ' ' {
                space = Some(end);
            }
            end += 1;
        }
        if end == all.len() {
            lines.push(set(&all[start..], size, face));
            break;
        }
        let stop = space.filter(|&space| space > start).unwrap_or(end);
        lines.push(set(&all[start..stop], size, face));
        start = stop + all[stop..].iter().take_while(|letter| letter.character == ' ').count();
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(line: &Line) -> String {
        line.runs.iter().map(|run| run.text.as_str()).collect()
    }

    #[test]
    fn greek_is_italic_and_marks_make_small_letters() {
        let found = line("satin_purple, θ_h 10^{-3}", 10.0, Face::Regular);
        let shown: Vec<_> = found.runs.iter().map(|r| (r.text.as_str(), r.face, r.rise.signum())).collect();
        let (regular, italic) = (Face::Regular, Face::Italic);
        assert_eq!(
            shown,
            [
                ("satin_purple, ", regular, 1.0),
                ("θ", italic, 1.0),
                ("h", regular, -1.0),
                (" 10", regular, 1.0),
                ("-3", regular, 1.0)
            ]
        );
        assert!(found.runs.windows(2).all(|pair| pair[1].x > pair[0].x) && found.width > found.runs[4].x);
        assert_eq!(read(&line("a^b _x θ", 9.0, Face::SemiBold)), "a^b _x θ");
        assert_eq!(read(&line("x^{1", 9.0, Face::Regular)), "x1");
        assert_eq!(line("", 9.0, Face::Regular), Line::default());
    }

    #[test]
    fn lines_keep_to_the_width_and_all_words_stay() {
        let text = "truth, prediction and difference of a material with an uncommonlylongnameofasinglewordthatisbroken";
        for limit in [40.0, 90.0, 1000.0] {
            let lines = wrap(text, 8.0, Face::Regular, limit);
            assert!(lines.iter().all(|line| line.width <= limit && !line.runs.is_empty()), "{limit}");
            let joined: String = lines.iter().map(read).collect();
            assert_eq!(joined.replace(' ', ""), text.replace(' ', ""));
        }
        assert_eq!(wrap(text, 8.0, Face::Regular, 1000.0).len(), 1);
        assert_eq!(wrap("a", 8.0, Face::Regular, 0.0).len(), 1);
        assert!(wrap("", 8.0, Face::Regular, 10.0).is_empty());
    }
}
