//! Number formats of OpenCV.

/// Parses a number, including OpenCV's `.Nan` and `.Inf`. Returns `None` if the word is not a
/// number.
pub(super) fn number(word: &str) -> Option<f64> {
    let (sign, rest) = match word.as_bytes().first()? {
        b'-' => (-1.0, &word[1..]),
        b'+' => (1.0, &word[1..]),
        _ => (1.0, word),
    };
    match rest {
        ".Nan" | ".NaN" | ".nan" => return Some(f64::NAN),
        ".Inf" | ".inf" => return Some(sign * f64::INFINITY),
        _ => {}
    }
    let begins = rest.bytes().next()?;
    (begins.is_ascii_digit() || begins == b'.')
        .then(|| rest.parse::<f64>().ok())
        .flatten()
        .map(|value| sign * value)
}

/// Formats a finite number with a decimal point, by which OpenCV recognises a real number, and with
/// enough digits to read back the same bits.
pub(super) fn written(value: f64) -> String {
    let text = format!("{value:?}");
    match text.split_once('e') {
        Some((mantissa, exponent)) if !mantissa.contains('.') => format!("{mantissa}.e{exponent}"),
        _ => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_back_bit_for_bit() {
        for value in [
            0.0,
            -0.0,
            1.0,
            -1.5,
            880.961853,
            1.0 / 3.0,
            f64::MAX,
            f64::MIN_POSITIVE,
            5e-324,
            1e22,
        ] {
            let text = written(value);
            assert!(text.contains('.'), "{text}");
            assert_eq!(number(&text).unwrap().to_bits(), value.to_bits(), "{text}");
        }
    }

    #[test]
    fn words_are_no_numbers() {
        for word in [
            "", "-", ".", "nan", "inf", "x1", "1x", "--1", "0x10", "infinity", "-é",
        ] {
            assert_eq!(number(word), None, "{word}");
        }
        assert_eq!(number("+1.e+02"), Some(100.0));
        assert_eq!(number("-.Inf"), Some(f64::NEG_INFINITY));
        assert!(number(".Nan").unwrap().is_nan());
    }
}
