//! Parses options with three numbers.

use glam::DVec3;
use phasmid_core::error::{Error, Result};

/// Parses `X,Y,Z`, each with a magnitude of at most `most`; `allowed` describes them in messages.
///
/// # Errors
/// Returns an error if the text is not three numbers within the limit.
pub(super) fn vector(option: &str, text: &str, most: f64, allowed: &str) -> Result<DVec3> {
    let numbers: Option<Vec<f64>> = text.split(',').map(|n| n.trim().parse().ok()).collect();
    match numbers.as_deref() {
        Some(&[x, y, z]) if [x, y, z].iter().all(|n| n.abs() <= most) => Ok(DVec3::new(x, y, z)),
        found => Err(Error::input(
            format!("{option} {text}"),
            match found {
                Some([_, _, _]) => format!("numbers beyond {most}"),
                _ => "not three numbers".to_owned(),
            },
            allowed,
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_three_numbers_and_refuses_anything_else() {
        let read = |text| vector("--at", text, 1e5, "X,Y,Z in millimetres, as 1,2,3");
        assert_eq!(
            read("-12.5, 140,-812").unwrap(),
            DVec3::new(-12.5, 140.0, -812.0)
        );
        for (text, found) in [
            (
                "1,2",
                "--at 1,2: not three numbers; expected X,Y,Z in millimetres, as 1,2,3",
            ),
            ("1,2,x", "not three numbers"),
            ("1,2,3,4", "not three numbers"),
            ("1,NaN,3", "numbers beyond 100000"),
            ("1,2,1e6", "numbers beyond 100000"),
        ] {
            let error = read(text).unwrap_err().to_string();
            assert!(error.contains(found), "{error}");
        }
    }
}
