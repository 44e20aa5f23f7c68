//! A sequence as a scanner runs it, and as recordings note it.

use phasmid_geometry::Rig;
use phasmid_pattern::Manifest;
use phasmid_protocol::service::{Reply, SequenceAbout};

/// A sequence, with all that is needed to decode its frames.
#[derive(Debug, Clone, PartialEq)]
pub struct Sequence {
    /// Name, if it has one.
    pub name: Option<String>,
    /// Patterns, frame by frame.
    pub manifest: Manifest,
    /// Calibration of the scanner, required for depth.
    pub calibration: Option<Rig>,
}

impl Sequence {
    /// Returns the note that a recording keeps ([`SequenceAbout::to_note`]).
    pub fn to_note(&self) -> String {
        let about = SequenceAbout {
            name: self.name.clone().unwrap_or_default(),
            manifest: self.manifest.to_toml(),
        };
        about.to_note(self.calibration.as_ref().map(Rig::to_toml))
    }

    /// Parses the sequence from a note of a recording; `None` if the note does not describe a
    /// sequence.
    pub fn of_note(note: &str) -> Option<Self> {
        let reply = Reply::parse(note.as_bytes()).ok()?;
        let SequenceAbout { name, manifest } = reply.sequence?;
        let calibration = reply.calibration.map(|toml| Rig::from_toml(&toml, "note"));
        Some(Self {
            manifest: Manifest::parse(&manifest, "note").ok()?,
            name: Some(name).filter(|name| !name.is_empty()),
            calibration: calibration.transpose().ok()?,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sequence_survives_its_note() {
        let text = "[projector]\nwidth_px = 8\nheight_px = 4\n\
            [[frame]]\npattern = { kind = \"white\" }\n[[frame]]\npattern = { kind = \"black\" }\n";
        let sequence = Sequence {
            name: Some("two".into()),
            manifest: Manifest::parse(text, "test").unwrap(),
            calibration: None,
        };
        assert_eq!(Sequence::of_note(&sequence.to_note()), Some(sequence));
        for other in [
            "",
            "{}",
            r#"{"fault":3}"#,
            r#"{"sequence":{"name":"a","manifest":"x"}}"#,
        ] {
            assert_eq!(Sequence::of_note(other), None, "{other}");
        }
    }
}
