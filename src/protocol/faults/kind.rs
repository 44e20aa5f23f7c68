//! Kinds of faults: one list of what goes wrong, with the parameters of each kind, their defaults and
//! their limits; and [`Flaw`], the problem that a check finds.

use serde::{Deserialize, Deserializer, Serialize, Serializer, de, ser::SerializeMap};
use std::fmt::Display;
use toml::{Table, Value};

/// Unit that a fault's conditions count.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// Frames.
    Camera,
    /// Messages on the control port.
    Port,
}

/// Direction of bytes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "kebab-case")]
pub enum Direction {
    /// From the client to the device.
    ToDevice,
    /// From the device to the client.
    #[default]
    ToHost,
}

/// A parameter of a kind of fault.
#[derive(Debug)]
pub struct Parameter {
    /// Name of its field.
    pub name: &'static str,
    /// One line of documentation.
    pub about: &'static str,
    /// Smallest and largest number.
    pub(super) limits: Option<[f64; 2]>,
    /// Unit of a number, or the allowed texts.
    unit: &'static str,
    #[cfg_attr(not(feature = "schema"), expect(dead_code))]
    type_name: &'static str,
}

/// A kind of fault.
#[derive(Debug)]
pub struct Kind {
    /// Its name in files.
    pub name: &'static str,
    /// One line of documentation.
    pub about: &'static str,
    /// Units that may be counted; the first is the default.
    pub sides: &'static [Side],
    /// Its parameters.
    pub parameters: &'static [Parameter],
    /// The fault with the default of each parameter.
    pub what: What,
}

/// A problem with a fault.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{field}: {found}; expected {allowed}")]
pub struct Flaw {
    /// The field, such as `when.nth`.
    pub field: String,
    /// Value found.
    pub found: String,
    /// Allowed values.
    pub allowed: String,
}

impl Flaw {
    pub(super) fn new(field: &str, found: impl Display, allowed: impl Display) -> Self {
        Self {
            field: field.to_owned(),
            found: found.to_string(),
            allowed: allowed.to_string(),
        }
    }
}

macro_rules! kinds {
    ($(
        $(#[doc = $about:literal])+
        $name:literal = $kind:ident on $first:ident $($other:ident)? $({ $(
            $(#[doc = $meaning:literal])+
            $field:ident: $type:ty = $default:expr, $([$low:literal, $high:literal])? $unit:literal;
        )+ })?
    )+) => {
        /// A kind of fault with its parameters. Times are in milliseconds of device time.
        #[derive(Debug, Clone, Copy, PartialEq)]
        pub enum What {
            $(
                $(#[doc = $about])+
                $kind $({ $($(#[doc = $meaning])+ $field: $type,)+ })?,
            )+
        }

        impl Kind {
            /// All kinds, frame faults first.
            pub const ALL: &'static [Self] = &[$(Self {
                name: $name,
                about: concat!($($about),+).trim_ascii(),
                sides: &[Side::$first $(, Side::$other)?],
                parameters: &[$($(Parameter {
                    name: stringify!($field),
                    about: concat!($($meaning),+).trim_ascii(),
                    limits: limits!($($low, $high)?),
                    unit: $unit,
                    type_name: stringify!($type),
                },)+)?],
                what: What::$kind $({ $($field: $default,)+ })?,
            },)+];
        }

        impl What {
            /// Returns the name of the kind in files.
            pub fn name(&self) -> &'static str {
                match self {
                    $(Self::$kind { .. } => $name,)+
                }
            }

            /// Returns the parameters' values by name; none for one that is absent.
            pub(super) fn values(&self) -> Vec<(&'static str, Option<Value>)> {
                match self {
                    $(Self::$kind $({ $($field,)+ })? => vec![$($(
                        (stringify!($field), Value::try_from($field).ok()),
                    )+)?],)+
                }
            }

            /// Sets a parameter; `None` if the value is of another type.
            fn set(&mut self, name: &str, value: Value) -> Option<()> {
                match (self, name) {
                    $($($((Self::$kind { $field, .. }, stringify!($field)) => {
                        *$field = <$type>::deserialize(value).ok()?;
                    })+)?)+
                    _ => return None,
                }
                Some(())
            }
        }
    };
}

macro_rules! limits {
    () => {
        None
    };
    ($low:literal, $high:literal) => {
        Some([$low, $high])
    };
}

kinds! {
    /// The frame never arrives.
    "dropped" = Dropped on Camera
    /// The frame arrives twice.
    "repeated" = Repeated on Camera
    /// The frame arrives late, and later frames wait behind it.
    "late" = Late on Camera {
        /// Delay.
        by_ms: f64 = 500.0, [0.0, 3.6e6] "ms";
    }
    /// The frame arrives after the next one.
    "swapped" = Swapped on Camera {
        /// Maximum wait for the next frame.
        by_ms: f64 = 1000.0, [0.0, 3.6e6] "ms";
    }
    /// From a given row down, the frame shows the previous frame.
    "torn" = Torn on Camera {
        /// First affected row of the transmitted image, from its top; the middle row when absent.
        row: Option<u32> = None, [1.0, 65535.0] "";
    }
    /// Rows are missing: the rows below move up, and black rows fill the bottom.
    "rows-missing" = RowsMissing on Camera {
        /// First missing row of the transmitted image, from its top; the middle row when absent.
        row: Option<u32> = None, [0.0, 65535.0] "";
        /// Number of rows.
        rows: u32 = 8, [1.0, 65535.0] "";
    }
    /// Bits anywhere in the frame, including its embedded data line, are flipped.
    "bits-flipped" = BitsFlipped on Camera {
        /// Number of bits.
        count: u32 = 64, [1.0, 1e6] "bits";
    }
    /// The projector's lamp is off.
    "dark" = Dark on Camera
    /// The projector shows another pattern of the sequence.
    "wrong-pattern" = WrongPattern on Camera {
        /// Offset from the correct pattern to the shown pattern; the sequence wraps around.
        offset: i32 = 1, [-4096.0, 4096.0] "patterns, not 0";
    }
    /// The projector is lit for only a fraction of the exposure.
    "partial-exposure" = PartialExposure on Camera {
        /// Fraction of the exposure during which the projector is lit.
        fraction: f64 = 0.5, [0.0, 1.0] "";
    }
    /// The reply never arrives.
    "no-reply" = NoReply on Port
    /// The reply arrives late, and later replies wait behind it.
    "late-reply" = LateReply on Port {
        /// Delay.
        by_ms: f64 = 500.0, [0.0, 3.6e6] "ms";
    }
    /// The reply arrives twice.
    "reply-twice" = ReplyTwice on Port
    /// Random bytes arrive before the reply.
    "garbage-before" = GarbageBefore on Port {
        /// Number of bytes.
        count: u32 = 8, [1.0, 4096.0] "bytes";
    }
    /// Random bytes arrive within the reply.
    "garbage-inside" = GarbageInside on Port {
        /// Number of bytes.
        count: u32 = 8, [1.0, 4096.0] "bytes";
    }
    /// Bits of a message are flipped.
    "bit-errors" = BitErrors on Port {
        /// Direction of the message.
        direction: Direction = Direction::ToHost, "to-device or to-host";
        /// Number of bits to flip in a message; 1 when `rate` is absent too.
        count: Option<u32> = None, [1.0, 4096.0] "bits";
        /// Probability that each bit is flipped, instead of a count.
        rate: Option<f64> = None, [0.0, 1.0] "";
    }
    /// The command is refused as if the device were busy, and is not executed.
    "nak" = Nak on Port
    /// The control port disappears for a while, and data in transit is lost.
    "disconnect" = Disconnect on Port Camera {
        /// Time until the port is back.
        for_ms: f64 = 1000.0, [0.0, 3.6e6] "ms";
    }
    /// The device restarts: settings, uploads and frames in transit are lost.
    "reset" = Reset on Camera Port
}

impl Parameter {
    /// Returns the allowed values, such as `0 to 3600000 ms`.
    pub fn allowed(&self) -> String {
        match self.limits {
            Some([low, high]) => format!("{low} to {high} {}", self.unit).trim().to_owned(),
            None => self.unit.to_owned(),
        }
    }
}

impl Kind {
    /// Returns the default of a parameter as written in a file; `None` if it has no default or the
    /// kind lacks the parameter.
    pub fn default(&self, parameter: &str) -> Option<String> {
        let (_, value) = self
            .what
            .values()
            .into_iter()
            .find(|(n, _)| *n == parameter)?;
        Some(match value? {
            Value::Float(number) => number.to_string(),
            value => value.to_string(),
        })
    }
}

impl What {
    /// Returns the kind.
    pub fn kind(&self) -> &'static Kind {
        let kind = Kind::ALL.iter().find(|kind| kind.name == self.name());
        kind.expect("each kind stands in the list")
    }

    /// Reads the field `what` and the parameters of that kind from all fields of a table.
    pub(super) fn read(mut fields: Table) -> Result<Self, Flaw> {
        let name = fields.remove("what");
        let named = name.as_ref().and_then(Value::as_str);
        let Some(kind) = Kind::ALL.iter().find(|kind| Some(kind.name) == named) else {
            let names: Vec<_> = Kind::ALL.iter().map(|kind| kind.name).collect();
            let found = name.map_or_else(|| "missing".to_owned(), |name| name.to_string());
            return Err(Flaw::new("what", found, names.join(", ")));
        };
        let mut what = kind.what;
        for (name, value) in fields {
            let Some(parameter) = kind.parameters.iter().find(|p| p.name == name) else {
                let own: Vec<_> = kind.parameters.iter().map(|p| p.name).collect();
                let own = if own.is_empty() {
                    "none".to_owned()
                } else {
                    own.join(", ")
                };
                let found = format!("not a parameter of {}", kind.name);
                return Err(Flaw::new(&name, found, own));
            };
            let found = value.to_string();
            if what.set(&name, value).is_none() {
                return Err(Flaw::new(&name, found, parameter.allowed()));
            }
        }
        Ok(what)
    }
}

impl std::fmt::Display for What {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(self.name())
    }
}

impl<'de> Deserialize<'de> for What {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Self::read(Table::deserialize(deserializer)?).map_err(de::Error::custom)
    }
}

/// The field `what`, and the parameters that are not the kind's defaults.
impl Serialize for What {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut map = serializer.serialize_map(None)?;
        map.serialize_entry("what", self.name())?;
        for (own, default) in self.values().iter().zip(self.kind().what.values()) {
            if let (name, Some(value)) = own
                && *own != default
            {
                map.serialize_entry(name, value)?;
            }
        }
        map.end()
    }
}

#[cfg(feature = "schema")]
impl schemars::JsonSchema for What {
    fn schema_name() -> std::borrow::Cow<'static, str> {
        "What".into()
    }

    fn inline_schema() -> bool {
        true
    }

    fn json_schema(_: &mut schemars::SchemaGenerator) -> schemars::Schema {
        let names = Kind::ALL.iter().map(|kind| {
            serde_json::json!({ "type": "string", "const": kind.name, "description": kind.about })
        });
        let mut properties = serde_json::Map::new();
        let what = serde_json::json!({ "description": "What goes wrong.", "oneOf": Vec::from_iter(names) });
        properties.insert("what".to_owned(), what);
        let parameters = |kind: &'static Kind| kind.parameters.iter().map(move |p| (kind.name, p));
        for (kind, p) in Kind::ALL.iter().flat_map(parameters) {
            let type_name = match p.limits {
                None => "string",
                Some(_) if p.type_name.contains("f64") => "number",
                Some(_) => "integer",
            };
            let new = || serde_json::json!({ "type": type_name, "description": "" });
            let property = properties.entry(p.name).or_insert_with(new);
            let before = property["description"].as_str().unwrap_or_default();
            let text = format!("{before} `{kind}`, {}: {}", p.allowed(), p.about);
            property["description"] = text.trim().into();
        }
        schemars::json_schema!({ "type": "object", "properties": properties, "required": ["what"] })
    }
}
