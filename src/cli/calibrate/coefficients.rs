//! Values of `--camera-distortion` and `--projector-distortion`.

use phasmid_calibrate::solve::Coefficients;
use std::str::FromStr;

/// The names of the coefficients in OpenCV's order.
const NAMES: [&str; 5] = ["k1", "k2", "p1", "p2", "k3"];

/// The coefficients that an option selects.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Choice(pub(super) Coefficients);

impl FromStr for Choice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text {
            "auto" => return Ok(Self(Coefficients::Auto)),
            "none" => return Ok(Self(Coefficients::Fixed([false; 5]))),
            "all" => return Ok(Self(Coefficients::Fixed([true; 5]))),
            _ => {}
        }
        let mut chosen = [false; 5];
        for name in text.split(',') {
            let place = NAMES.iter().position(|known| *known == name.trim());
            let place = place.ok_or_else(|| {
                format!("unknown {name:?}; expected auto, none, all, or some of k1,k2,p1,p2,k3")
            })?;
            chosen[place] = true;
        }
        Ok(Self(Coefficients::Fixed(chosen)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn accepts_words_and_lists_of_coefficients() {
        let choice = |text: &str| text.parse::<Choice>().map(|choice| choice.0);
        assert_eq!(choice("auto"), Ok(Coefficients::Auto));
        assert_eq!(choice("none"), Ok(Coefficients::Fixed([false; 5])));
        assert_eq!(choice("all"), Ok(Coefficients::Fixed([true; 5])));
        let some = Coefficients::Fixed([true, false, false, true, false]);
        assert_eq!(choice("k1,p2"), Ok(some));
        assert_eq!(choice("p2, k1"), Ok(some));
        for bad in ["", "k4", "k1,", "k1;k2", "Auto"] {
            assert!(choice(bad).unwrap_err().contains("k1,k2,p1,p2,k3"), "{bad}");
        }
    }
}
