//! Formatting of numbers and names in tables.

use std::borrow::Cow;

/// Returns the shortest text that reads back as the same number; empty if the number is not finite.
pub(super) fn exact(value: f64) -> String {
    let size = value.abs();
    if !value.is_finite() {
        String::new()
    } else if size == 0.0 || (1e-5..1e16).contains(&size) {
        value.to_string()
    } else {
        format!("{value:e}")
    }
}

/// Formats a name as a field of a comma-separated table (RFC 4180, rules 5 to 7).
pub(super) fn field(name: &str) -> Cow<'_, str> {
    if name.contains(['"', ',', '\n', '\r']) {
        format!("\"{}\"", name.replace('"', "\"\"")).into()
    } else {
        name.into()
    }
}

/// Formats a value to the second digit of its standard deviation, or with six digits if it has no
/// standard deviation.
pub(super) fn to_sigma(value: f64, sigma: f64) -> String {
    if !value.is_finite() {
        return "-".to_owned();
    }
    if !(sigma.is_finite() && sigma > 0.0) {
        return phasmid_report::plot::figures(value, 6);
    }
    let decimals = 1.0 - sigma.log10().floor();
    if (0.0..=12.0).contains(&decimals) && value.abs() < 1e12 {
        format!("{value:.*}", decimals as usize)
    } else if decimals < 0.0 && value.abs() < 1e12 {
        format!("{value:.0}")
    } else {
        format!("{value:.6e}")
    }
}

/// Makes a name safe for a terminal: replaces control characters.
pub(super) fn shown(name: &str) -> String {
    name.chars()
        .map(|c| if c.is_control() { '\u{fffd}' } else { c })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_back() {
        for value in [0.1 + 0.2, -1e-300, 6.02e23, 0.0, -0.0, 1e-5, f64::MAX] {
            assert_eq!(exact(value).parse::<f64>().unwrap(), value);
            assert!(exact(value).len() < 25);
        }
        assert_eq!(exact(f64::NAN), "");
    }

    #[test]
    fn names_with_special_characters_stay_one_csv_field() {
        assert_eq!(field("pose_00"), "pose_00");
        assert_eq!(field("a,\"b\""), "\"a,\"\"b\"\"\"");
        assert_eq!(shown("a\u{1b}[2J\n"), "a\u{fffd}[2J\u{fffd}");
    }

    #[test]
    fn values_are_shown_to_the_digits_of_their_sigma() {
        assert_eq!(to_sigma(632.123_456, 0.034), "632.123");
        assert_eq!(to_sigma(632.123_456, 3.4), "632.1");
        assert_eq!(to_sigma(632_123.456, 3400.0), "632123");
        assert_eq!(to_sigma(0.1, 0.0), "0.100000");
        assert_eq!(to_sigma(f64::NAN, 1.0), "-");
        assert_eq!(to_sigma(1.0, 1e-30), "1.000000e0");
    }
}
