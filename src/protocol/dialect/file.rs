//! Serialized form of a dialect file; [`super::check`] converts it to a dialect.

use super::checksum::Checksum;
use super::field::Unit;
use serde::Deserialize;
use std::collections::BTreeMap;

#[derive(Debug, Clone, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct File {
    pub(super) name: String,
    pub(super) description: String,
    pub(super) framing: FramingKind,
    pub(super) line: Option<LineFile>,
    pub(super) packet: Option<PacketFile>,
    #[serde(default)]
    pub(super) command: Vec<CommandFile>,
    pub(super) errors: Option<ErrorsFile>,
    #[serde(default)]
    pub(super) boot: Vec<BootFile>,
    #[serde(default)]
    pub(super) events: BTreeMap<String, String>,
    #[serde(default)]
    pub(super) host: BTreeMap<String, OperationFile>,
    #[serde(default)]
    pub(super) settings: BTreeMap<String, OperationFile>,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub(super) enum FramingKind {
    Scpi,
    Line,
    Packet,
}

#[derive(Debug, Clone, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields, default)]
pub(super) struct LineFile {
    pub(super) to_device: String,
    pub(super) to_host: String,
    pub(super) comment: Option<String>,
    pub(super) any_case: bool,
    pub(super) echo: bool,
    pub(super) ok: Option<String>,
    pub(super) max_bytes: usize,
}

impl Default for LineFile {
    fn default() -> Self {
        Self {
            to_device: "\n".to_owned(),
            to_host: "\n".to_owned(),
            comment: None,
            any_case: true,
            echo: false,
            ok: None,
            max_bytes: 4096,
        }
    }
}

#[derive(Debug, Clone, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct PacketFile {
    pub(super) size_bytes: Option<usize>,
    pub(super) max_bytes: Option<usize>,
    #[serde(default)]
    pub(super) start: Vec<u8>,
    pub(super) flags: Option<FlagsFile>,
    pub(super) sequence: Option<SequenceFile>,
    pub(super) length: Option<LengthFile>,
    pub(super) code: CodeFile,
    pub(super) data_at: usize,
    #[serde(default)]
    pub(super) reply: ReplyLayoutFile,
    #[serde(default)]
    pub(super) endian: Endian,
    pub(super) checksum: Option<Checksum>,
}

#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub(super) enum Endian {
    #[default]
    Little,
    Big,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct FlagsFile {
    pub(super) at: usize,
    pub(super) read: Option<u8>,
    pub(super) reply: Option<u8>,
    pub(super) error: Option<u8>,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct SequenceFile {
    pub(super) at: usize,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct LengthFile {
    pub(super) at: usize,
    pub(super) bytes: usize,
    pub(super) from: usize,
}

#[derive(Debug, Clone, Copy, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct CodeFile {
    pub(super) at: usize,
    pub(super) bytes: usize,
}

#[derive(Debug, Clone, Copy, Default, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct ReplyLayoutFile {
    pub(super) code: Option<bool>,
    pub(super) data_at: Option<usize>,
}

#[derive(Debug, Clone, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct CommandFile {
    pub(super) name: String,
    pub(super) line: Option<String>,
    pub(super) code: Option<u32>,
    #[serde(default)]
    pub(super) read: bool,
    #[serde(default)]
    pub(super) args: Vec<FieldFile>,
    #[serde(default)]
    pub(super) runs: Vec<String>,
    #[serde(default)]
    pub(super) answers: Vec<String>,
    #[serde(default)]
    pub(super) values: Vec<FieldFile>,
    pub(super) reply: Option<Vec<String>>,
    pub(super) chunk: Option<ChunkFile>,
}

#[derive(Debug, Clone, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct FieldFile {
    pub(super) name: String,
    #[serde(rename = "type")]
    pub(super) kind: super::field::Kind,
    #[serde(default)]
    pub(super) unit: Unit,
    pub(super) scale: Option<f64>,
    pub(super) min: Option<f64>,
    pub(super) max: Option<f64>,
    pub(super) choices: Option<BTreeMap<String, String>>,
    pub(super) bytes: Option<usize>,
    #[cfg_attr(feature = "schema", schemars(with = "Option<serde_json::Value>"))]
    pub(super) constant: Option<toml::Value>,
}

#[derive(Debug, Clone, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct ChunkFile {
    pub(super) data: String,
    pub(super) offset: String,
    pub(super) total: String,
    pub(super) check: Option<String>,
    pub(super) bytes: usize,
}

#[derive(Debug, Clone, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct ErrorsFile {
    pub(super) line: Option<String>,
    pub(super) number: Option<super::field::Kind>,
    pub(super) default: ErrorFile,
    pub(super) busy: ErrorFile,
    #[serde(default)]
    pub(super) map: Vec<MappedFile>,
}

#[derive(Debug, Clone, PartialEq, Eq, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct ErrorFile {
    pub(super) number: i32,
    pub(super) text: String,
}

#[derive(Debug, Clone, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct MappedFile {
    pub(super) scpi: Vec<i16>,
    pub(super) number: i32,
    pub(super) text: String,
}

#[derive(Debug, Clone, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct BootFile {
    pub(super) line: Option<String>,
    pub(super) bytes: Option<Vec<u8>>,
    #[serde(default)]
    pub(super) delay_ms: f64,
}

#[derive(Debug, Clone, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct OperationFile {
    pub(super) steps: Vec<StepFile>,
    pub(super) result: Option<String>,
    #[serde(default)]
    pub(super) allowed: Vec<String>,
}

#[derive(Debug, Clone, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(deny_unknown_fields)]
pub(super) struct StepFile {
    pub(super) command: String,
    #[serde(default)]
    #[cfg_attr(
        feature = "schema",
        schemars(with = "BTreeMap<String, serde_json::Value>")
    )]
    pub(super) args: BTreeMap<String, toml::Value>,
}
