//! Bytes as text: UTF-8 with or without a mark, UTF-16, Windows-1252.

use std::borrow::Cow;

use encoding_rs::{UTF_16BE, UTF_16LE, WINDOWS_1252};

/// The text that `bytes` hold, without its byte order mark. What is not UTF-8 is taken as Windows-1252 if it is
/// mostly ASCII, since instruments write signs such as that of degrees in it.
///
/// # Errors
/// A description of content that is not text.
pub(crate) fn decode(bytes: &[u8]) -> Result<Cow<'_, str>, String> {
    let text = if let Some(rest) = bytes.strip_prefix(b"\xEF\xBB\xBF") {
        String::from_utf8_lossy(rest)
    } else if let Some(rest) = bytes.strip_prefix(b"\xFF\xFE") {
        UTF_16LE.decode_without_bom_handling(rest).0
    } else if let Some(rest) = bytes.strip_prefix(b"\xFE\xFF") {
        UTF_16BE.decode_without_bom_handling(rest).0
    } else if let Some(encoding) = wide(bytes) {
        encoding.decode_without_bom_handling(bytes).0
    } else if let Ok(text) = std::str::from_utf8(bytes) {
        Cow::Borrowed(text)
    } else {
        let ascii = bytes.iter().filter(|byte| byte.is_ascii()).count();
        if 4 * ascii < 3 * bytes.len() {
            return Err("binary data".to_owned());
        }
        WINDOWS_1252.decode_without_bom_handling(bytes).0
    };
    // Old editors of DOS end a text with this sign.
    let text = match text {
        Cow::Borrowed(text) => Cow::Borrowed(text.trim_end_matches(['\u{1A}', '\0'])),
        Cow::Owned(text) => Cow::Owned(text.trim_end_matches(['\u{1A}', '\0']).to_owned()),
    };
    match text.find(|c: char| c.is_control() && !c.is_whitespace()) {
        None => Ok(text),
        Some(place) => {
            let line = 1 + text[..place].matches('\n').count();
            Err(format!("a control character on line {line}"))
        }
    }
}

/// Like [`decode`] for the first bytes of a file: a character that is cut off at the end is left out.
pub(crate) fn decode_head(head: &[u8]) -> Option<Cow<'_, str>> {
    let whole = match std::str::from_utf8(head) {
        Err(error) if error.error_len().is_none() => &head[..error.valid_up_to()],
        _ => head,
    };
    decode(whole).ok()
}

/// UTF-16 without a mark: every other byte of ASCII is zero.
fn wide(bytes: &[u8]) -> Option<&'static encoding_rs::Encoding> {
    let head = &bytes[..bytes.len().min(256)];
    let pairs = head.chunks_exact(2);
    let count = pairs.len();
    let zeros = |place: usize| pairs.clone().filter(|pair| pair[place] == 0).count();
    let (low, high) = (zeros(0), zeros(1));
    if count < 4 {
        None
    } else if low == 0 && 10 * high >= 9 * count {
        Some(UTF_16LE)
    } else if high == 0 && 10 * low >= 9 * count {
        Some(UTF_16BE)
    } else {
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn utf16(text: &str, big: bool) -> Vec<u8> {
        let bytes = |unit: u16| if big { unit.to_be_bytes() } else { unit.to_le_bytes() };
        text.encode_utf16().flat_map(bytes).collect()
    }

    #[test]
    fn encodings_are_told_apart() {
        let text = "theta_i [°],f\n1,2\n";
        assert_eq!(decode(text.as_bytes()).unwrap(), text);
        assert_eq!(decode(&[b"\xEF\xBB\xBF", text.as_bytes()].concat()).unwrap(), text);
        for big in [false, true] {
            assert_eq!(decode(&utf16(text, big)).unwrap(), text);
            assert_eq!(decode(&utf16(&format!("\u{FEFF}{text}"), big)).unwrap(), text);
        }
        let old: Vec<u8> = text.chars().map(|c| u8::try_from(u32::from(c)).unwrap()).collect();
        assert_eq!(decode(&old).unwrap(), text);
        assert_eq!(decode(b"1,2\n\x1A").unwrap(), "1,2\n");
        assert_eq!(decode(b"").unwrap(), "");
    }

    #[test]
    fn binary_data_are_no_text() {
        assert_eq!(decode(b"a\nb\x01c").unwrap_err(), "a control character on line 2");
        assert_eq!(decode(&[0xDE, 0xAD, 0xBE, 0xEF]).unwrap_err(), "binary data");
        assert!(decode_head(b"caf\xC3").unwrap() == "caf");
        assert!(decode_head(&[0x93, 0, 1, 2, 0, 0, 7]).is_none());
    }
}
