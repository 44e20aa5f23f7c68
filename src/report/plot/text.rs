//! Escapes text for XML and HTML, and formats numbers with few digits.

/// Escapes text for use between tags or in a quoted attribute of XML and HTML. Characters that XML 1.0
/// does not allow (section 2.2, "Characters"), such as most control characters, become U+FFFD.
pub fn escaped(text: &str) -> String {
    let mut out = String::with_capacity(text.len());
    for c in text.chars() {
        match c {
            '&' => out.push_str("&amp;"),
            '<' => out.push_str("&lt;"),
            '>' => out.push_str("&gt;"),
            '"' => out.push_str("&quot;"),
            '\'' => out.push_str("&#39;"),
            '\t' | '\n' | ' '..='~' => out.push(c),
            '\u{A0}'..='\u{FFFD}' | '\u{10000}'..='\u{10FFFF}' => out.push(c),
            _ => out.push('\u{FFFD}'),
        }
    }
    out
}

/// Formats a number with `digits` significant digits, without an exponent if the result is short; "-" if
/// it is not finite.
pub fn figures(value: f64, digits: usize) -> String {
    let digits = digits.clamp(1, 17);
    if !value.is_finite() {
        return "-".to_owned();
    }
    if value == 0.0 {
        return "0".to_owned();
    }
    // Rounds first: 0.09996 in three digits is 0.100.
    let rounded = format!("{value:.*e}", digits - 1);
    let exponent: i32 = rounded
        .rsplit_once('e')
        .and_then(|(_, e)| e.parse().ok())
        .unwrap_or(0);
    if (-5..=6).contains(&exponent) {
        let decimals = (digits as i32 - 1 - exponent).max(0) as usize;
        format!("{value:.decimals$}")
    } else {
        rounded
    }
}

/// Formats a coordinate on a sheet with two decimals, which is finer than visible.
pub(super) fn coordinate(value: f64) -> String {
    // The limit is far outside any sheet, and keeps the text short.
    let mut text = format!("{:.2}", value.clamp(-1e5, 1e5));
    while text.ends_with('0') {
        text.pop();
    }
    if text.ends_with('.') {
        text.pop();
    }
    if text == "-0" { "0".to_owned() } else { text }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn markup_and_control_characters_are_escaped() {
        assert_eq!(
            escaped("<a href=\"x\">'&\u{0}\u{1b}\u{FFFE}ü木\t"),
            "&lt;a href=&quot;x&quot;&gt;&#39;&amp;\u{FFFD}\u{FFFD}\u{FFFD}ü木\t"
        );
    }

    #[test]
    fn numbers_keep_their_digits() {
        for (value, digits, text) in [
            (0.0123456, 3, "0.0123"),
            (0.09996, 3, "0.100"),
            (999.96, 4, "1000"),
            (632.1234, 5, "632.12"),
            (-12345.6, 3, "-12346"),
            (1.5e-9, 3, "1.50e-9"),
            (2.5e12, 2, "2.5e12"),
            (0.0, 3, "0"),
            (f64::NAN, 3, "-"),
            (f64::INFINITY, 3, "-"),
        ] {
            assert_eq!(figures(value, digits), text, "{value} {digits}");
        }
    }

    #[test]
    fn coordinates_are_short() {
        assert_eq!(coordinate(1.0), "1");
        assert_eq!(coordinate(-0.001), "0");
        assert_eq!(coordinate(10.506), "10.51");
        assert_eq!(coordinate(100.0), "100");
        assert_eq!(coordinate(1e300), "100000");
    }
}
