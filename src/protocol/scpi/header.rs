//! Matching of headers against SCPI notation: capitals are the short form, and brackets
//! enclose optional parts, as in `TRIGger[:SEQuence][:IMMediate]`.

use super::param::keyword_matches;
use super::parse::{Node, Unit};

/// Result of comparing a unit's header with a pattern.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum HeaderMatch {
    /// A different header.
    No,
    /// A match.
    Yes,
    /// A match except for a numeric suffix other than 1.
    Suffix,
}

/// Compares a unit's header with a pattern. The device has one instance of each node, so only the
/// numeric suffix 1 is valid.
pub fn match_header(pattern: &str, unit: &Unit) -> HeaderMatch {
    let (common, pattern) = match pattern.strip_prefix('*') {
        Some(rest) => (true, rest),
        None => (false, pattern),
    };
    if common != unit.common {
        return HeaderMatch::No;
    }
    walk(pattern, &unit.path, HeaderMatch::Yes)
}

fn walk(pattern: &str, path: &[Node], so_far: HeaderMatch) -> HeaderMatch {
    let pattern = pattern.trim_start_matches(':');
    if pattern.is_empty() {
        return if path.is_empty() {
            so_far
        } else {
            HeaderMatch::No
        };
    }
    if let Some(inner) = pattern.strip_prefix('[') {
        let (optional, rest) = inner.split_once(']').unwrap_or((inner, ""));
        let with = step(optional.trim_start_matches(':'), rest, path, so_far);
        return if with == HeaderMatch::No {
            walk(rest, path, so_far)
        } else {
            with
        };
    }
    let end = pattern.find([':', '[']).unwrap_or(pattern.len());
    step(&pattern[..end], &pattern[end..], path, so_far)
}

fn step(keyword: &str, rest: &str, path: &[Node], so_far: HeaderMatch) -> HeaderMatch {
    match path {
        [node, path @ ..] if keyword_matches(keyword, &node.name) => {
            let so_far = match node.suffix {
                None | Some(1) => so_far,
                Some(_) => HeaderMatch::Suffix,
            };
            walk(rest, path, so_far)
        }
        _ => HeaderMatch::No,
    }
}

#[cfg(test)]
mod tests {
    use super::super::parse;
    use super::*;

    #[test]
    fn matches_short_and_long_forms_and_optional_nodes() {
        let trigger = "TRIGger[:SEQuence][:IMMediate]";
        for (pattern, header, expected) in [
            ("CAMera:EXPosure", "cam:exposure", HeaderMatch::Yes),
            ("CAMera:EXPosure", "CAME:EXP", HeaderMatch::No),
            ("CAMera:EXPosure", "CAM", HeaderMatch::No),
            ("CAMera:EXPosure", "CAM:EXP:X", HeaderMatch::No),
            ("CAMera:EXPosure", "CAM1:EXP", HeaderMatch::Yes),
            ("CAMera:EXPosure", "CAM2:EXP", HeaderMatch::Suffix),
            (trigger, "TRIG", HeaderMatch::Yes),
            (trigger, "TRIGGER:IMM", HeaderMatch::Yes),
            (trigger, "TRIG:SEQ", HeaderMatch::Yes),
            (trigger, "TRIG:SEQ:IMM", HeaderMatch::Yes),
            (trigger, "TRIG:IMM:SEQ", HeaderMatch::No),
            ("SYSTem:ERRor[:NEXT]", "SYST:ERR?", HeaderMatch::Yes),
            ("*IDN", "*idn?", HeaderMatch::Yes),
            ("*IDN", "IDN?", HeaderMatch::No),
        ] {
            let program = parse(header.as_bytes());
            assert_eq!(
                match_header(pattern, &program.units[0]),
                expected,
                "{header}"
            );
        }
    }
}
