//! Escaping of text from devices and servers for display on a terminal.

/// Escapes terminal control characters in a text.
pub fn printable(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        let escaped = c.escape_debug();
        // Keep quotes and backslashes, which `escape_debug` would escape: they are harmless and
        // frequent.
        if c.is_ascii_graphic() || escaped.len() == 1 {
            shown.push(c);
        } else {
            shown.extend(escaped);
        }
    }
    shown
}

/// Formats JSON and escapes the control characters that JSON allows unescaped in strings, such as
/// U+007F and U+009B.
pub fn printable_json(value: &serde_json::Value) -> String {
    let mut shown = String::new();
    for c in value.to_string().chars() {
        if c.is_control() {
            shown += &format!("\\u{:04x}", u32::from(c));
        } else {
            shown.push(c);
        }
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn control_characters_are_escaped_in_text_and_json() {
        let odd = "Gr\u{fc}n \"C:\\\" \u{1b}[2J\u{7}\u{7f}\u{9b}1m\u{202e}\n";
        let shown = printable(odd);
        assert!(shown.starts_with("Gr\u{fc}n \"C:\\\" \\u{1b}[2J\\u{7}"));
        let steers = |c: char| c.is_control() || c == '\u{202e}';
        assert!(!shown.contains(steers), "{shown:?}");
        let json = printable_json(&serde_json::json!({ "name": odd }));
        assert!(!json.contains(char::is_control), "{json:?}");
        let read: serde_json::Value = serde_json::from_str(&json).unwrap();
        assert_eq!(read["name"], odd);
    }
}
