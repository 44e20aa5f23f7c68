//! Control port: `[control]` of a profile.

use super::TomlSource;
use phasmid_core::check::Check;
use phasmid_core::error::{Error, Result};
use phasmid_protocol::dialect::Dialect;
use phasmid_protocol::usb::cdc::LineCoding;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Control port of a device: dialect and serial settings. Every field is optional.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub struct Control {
    /// Dialect of the port: a built-in name, or a file relative to the profile's folder.
    pub dialect: String,
    /// Bits per second. If set, transfers are paced in both directions; if absent, they take no
    /// time.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub baud: Option<u32>,
    /// Data bits: 8, or 7, which drops the highest bit of each byte.
    pub data_bits: u8,
    /// Parity bit after the data bits.
    pub parity: Parity,
    /// Stop bits: 1, 1.5 or 2.
    pub stop_bits: f64,
    /// Source locations of these settings, for messages.
    #[serde(skip)]
    pub places: Places,
}

/// Source locations of the settings that can only be checked once the dialect is loaded.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Places {
    /// Location of the dialect: `FILE:LINE: control.dialect`, or a command-line option.
    pub dialect: String,
    /// Location of the data bits.
    pub data_bits: String,
}

impl Default for Places {
    fn default() -> Self {
        Self {
            dialect: "control.dialect".to_owned(),
            data_bits: "control.data_bits".to_owned(),
        }
    }
}

impl Places {
    /// Looks up the locations of these settings in a profile's source.
    pub(super) fn of(source: &TomlSource) -> Self {
        let all = Self::default();
        Self {
            dialect: source.place_of(&all.dialect),
            data_bits: source.place_of(&all.data_bits),
        }
    }
}

impl Default for Control {
    fn default() -> Self {
        Self {
            dialect: "scpi".to_owned(),
            baud: None,
            data_bits: 8,
            parity: Parity::None,
            stop_bits: 1.0,
            places: Places::default(),
        }
    }
}

/// Parity of a serial line.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Parity {
    /// No parity bit.
    None,
    /// Odd number of ones, parity bit included.
    Odd,
    /// Even number of ones, parity bit included.
    Even,
    /// Parity bit is always 1.
    Mark,
    /// Parity bit is always 0.
    Space,
}

impl Control {
    /// Returns the dialect as [`Dialect::load`] expects it: a built-in name or a file path. Paths
    /// in the profile are relative to the profile's `folder`.
    pub fn dialect_path(&self, folder: &Path) -> String {
        let name = &self.dialect;
        let built_in = Dialect::names().any(|built_in| built_in == name);
        // If the file does not exist, return the name unchanged, so that messages quote it as
        // written.
        let path = Some(folder.join(name)).filter(|path| !built_in && path.is_file());
        let path = path.and_then(|path| path.to_str().map(str::to_owned));
        path.unwrap_or_else(|| name.clone())
    }

    /// Loads the dialect; a file path is relative to the profile's folder.
    ///
    /// # Errors
    /// Returns an error if [`Dialect::load`] fails or if a binary dialect is combined with 7 data
    /// bits. Both errors name the location of the setting.
    pub fn load_dialect(&self, folder: &Path) -> Result<Dialect> {
        let dialect = Dialect::load(&self.dialect_path(folder));
        let dialect = dialect.map_err(|error| error.at(&self.places.dialect))?;
        if self.data_bits < 8 && dialect.is_binary() {
            return Err(Error::input(
                &self.places.data_bits,
                format!(
                    "{} with the packets of dialect {}",
                    self.data_bits, self.dialect
                ),
                "8",
            ));
        }
        Ok(dialect)
    }

    /// Returns the line settings as USB CDC encodes them; 115,200 baud if no baud rate is set.
    pub fn line_coding(&self) -> LineCoding {
        LineCoding {
            baud: self.baud.unwrap_or(LineCoding::default().baud),
            stop_bits: (self.stop_half_bits() - 2) as u8,
            parity: match self.parity {
                Parity::None => 0,
                Parity::Odd => 1,
                Parity::Even => 2,
                Parity::Mark => 3,
                Parity::Space => 4,
            },
            data_bits: self.data_bits,
        }
    }

    /// Returns the length of a byte on the line in half bits: start bit, data, parity, stop bits.
    pub fn half_bits(&self) -> u32 {
        let parity = u32::from(self.parity != Parity::None);
        2 * (1 + u32::from(self.data_bits) + parity) + self.stop_half_bits()
    }

    fn stop_half_bits(&self) -> u32 {
        (self.stop_bits * 2.0).round() as u32
    }
}

/// Rejects settings that no serial line supports.
pub(super) fn check(control: &Control, check: &Check<'_>) -> Result<()> {
    if let Some(baud) = control.baud {
        check.within("control.baud", baud, 50..=12_000_000)?;
    }
    check.within("control.data_bits", control.data_bits, 7..=8)?;
    check.that(
        [1.0, 1.5, 2.0].contains(&control.stop_bits),
        "control.stop_bits",
        control.stop_bits,
        "1, 1.5 or 2",
    )?;
    check.that(
        !control.dialect.is_empty(),
        "control.dialect",
        "an empty name",
        "a built-in dialect's name or the path of a TOML file",
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Profile;

    const BENCH: &str = phasmid_device_profiles::PMP_BENCH;

    fn with(control: &str) -> Result<Control> {
        Profile::parse(&format!("{BENCH}\n[control]\n{control}\n"), "it").map(|p| p.control)
    }

    #[test]
    fn line_coding_follows_the_profile() {
        let line = BENCH.lines().count() + 2;
        let places = Places {
            dialect: format!("it:{line}: control.dialect"),
            data_bits: format!("it:{line}: control.data_bits"),
        };
        let none = Control {
            places,
            ..Control::default()
        };
        assert_eq!(with("").unwrap(), none);
        for (text, half_bits, coding) in [
            ("baud = 9600", 20, (9600, 0, 0, 8)),
            (
                "baud = 300\nparity = \"even\"\ndata_bits = 7",
                20,
                (300, 0, 2, 7),
            ),
            ("parity = \"space\"\nstop_bits = 2", 24, (115_200, 2, 4, 8)),
            ("stop_bits = 1.5", 21, (115_200, 1, 0, 8)),
        ] {
            let control = with(text).unwrap();
            assert_eq!(control.half_bits(), half_bits, "{text}");
            let (baud, stop_bits, parity, data_bits) = coding;
            let coding = LineCoding {
                baud,
                stop_bits,
                parity,
                data_bits,
            };
            assert_eq!(control.line_coding(), coding, "{text}");
        }
    }

    #[test]
    fn lines_that_cannot_be_are_refused_with_their_line() {
        let line = BENCH.lines().count() + 3;
        for (text, found) in [
            ("baud = 10", "10"),
            ("baud = 0", "0"),
            ("data_bits = 9", "9"),
            ("stop_bits = 3", "3"),
            ("parity = \"some\"", "some"),
            ("dialect = \"\"", "an empty name"),
            ("speed = 1", "speed"),
        ] {
            let message = with(text).unwrap_err().to_string();
            assert!(message.contains(found), "{message}");
            assert!(message.contains(&format!("it:{line}")), "{message}");
        }
    }
}
