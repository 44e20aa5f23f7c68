//! Checks of a fault schedule.

use super::{Fault, MAX_FAULTS, Schedule, Side};
use phasmid_core::error::Result;
use phasmid_core::source::TomlSource;
use std::fmt::{Debug, Display};
use std::ops::RangeInclusive;

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

/// Maximum duration of a fault in milliseconds.
const MAX_MS: f64 = 3.6e6;

pub(super) fn schedule(schedule: &Schedule, source: &TomlSource) -> Result<()> {
    if schedule.fault.len() > MAX_FAULTS {
        let found = format!("{} faults", schedule.fault.len());
        return Err(source.violation("fault", found, format!("up to {MAX_FAULTS}")));
    }
    for (i, fault) in schedule.fault.iter().enumerate() {
        fault.check().map_err(|flaw| {
            let field = format!("fault[{i}].{}", flaw.field);
            source.violation(&field, flaw.found, flaw.allowed)
        })?;
    }
    Ok(())
}

/// Rejects faults for unknown devices, which could never occur.
pub(super) fn devices(schedule: &Schedule, names: &[&str], source: &TomlSource) -> Result<()> {
    for (i, fault) in schedule.fault.iter().enumerate() {
        fault.check_device(names).map_err(|flaw| {
            let field = format!("fault[{i}].{}", flaw.field);
            source.violation(&field, flaw.found, flaw.allowed)
        })?;
    }
    Ok(())
}

fn that(
    ok: bool,
    field: &str,
    found: impl Display,
    allowed: impl Display,
) -> std::result::Result<(), Flaw> {
    if ok {
        return Ok(());
    }
    Err(Flaw {
        field: field.to_owned(),
        found: found.to_string(),
        allowed: allowed.to_string(),
    })
}

fn within<T: PartialOrd + Debug + Copy>(
    field: &str,
    value: Option<T>,
    range: RangeInclusive<T>,
) -> std::result::Result<(), Flaw> {
    let Some(value) = value else {
        return Ok(());
    };
    // NaN fails every range check.
    that(
        range.contains(&value),
        field,
        format!("{value:?}"),
        format!("{:?} to {:?}", range.start(), range.end()),
    )
}

impl Fault {
    /// Checks constraints of the kind that the types do not enforce.
    ///
    /// # Errors
    /// Returns the first invalid field.
    pub fn check(&self) -> std::result::Result<(), Flaw> {
        self.check_parameters()?;
        within("by_ms", self.by_ms, 0.0..=MAX_MS)?;
        within("for_ms", self.for_ms, 0.0..=MAX_MS)?;
        // A frame torn at its first row would be a copy of the previous frame, which is another
        // fault.
        let first = u32::from(self.what == super::What::Torn);
        within("row", self.row, first..=65535)?;
        within("rows", self.rows, 1..=65535)?;
        let most = match self.what {
            super::What::BitsFlipped => 1_000_000,
            _ => 4096,
        };
        within("count", self.count, 1..=most)?;
        within("rate", self.rate, 0.0..=1.0)?;
        that(
            self.count.is_none() || self.rate.is_none(),
            "rate",
            "a rate and a count",
            "only one of them",
        )?;
        within("offset", self.offset, -4096..=4096)?;
        that(self.offset != Some(0), "offset", 0, "any number but 0")?;
        within("fraction", self.fraction, 0.0..=1.0)?;
        within("times", self.times, 1..=u64::MAX)?;
        self.check_when()
    }

    /// Checks that the fault's device, if it names one, is in `names`.
    ///
    /// # Errors
    /// Returns an error for the field `device` if it is not.
    pub fn check_device(&self, names: &[&str]) -> std::result::Result<(), Flaw> {
        let there = names.iter().any(|name| self.concerns(name));
        let device = self.device.as_deref().unwrap_or_default();
        let allowed = match names {
            [] => "none: there is no device".to_owned(),
            names => names.join(", "),
        };
        that(
            there || self.device.is_none(),
            "device",
            format!("{device:?}"),
            allowed,
        )
    }

    fn check_parameters(&self) -> std::result::Result<(), Flaw> {
        let kind = self.what.kind();
        let given = [
            ("by_ms", self.by_ms.is_some()),
            ("for_ms", self.for_ms.is_some()),
            ("row", self.row.is_some()),
            ("rows", self.rows.is_some()),
            ("count", self.count.is_some()),
            ("rate", self.rate.is_some()),
            ("direction", self.direction.is_some()),
            ("offset", self.offset.is_some()),
            ("fraction", self.fraction.is_some()),
        ];
        let has = |name: &str| kind.parameters.iter().any(|p| p.name == name);
        for (name, _) in given.into_iter().filter(|(_, given)| *given) {
            let own: Vec<_> = kind.parameters.iter().map(|p| p.name).collect();
            that(
                has(name),
                name,
                format!("not a parameter of {}", kind.name),
                match own.len() {
                    0 => "none".to_owned(),
                    _ => own.join(", "),
                },
            )?;
        }
        if let Some(side) = self.on {
            let name = |side: Side| match side {
                Side::Camera => "camera",
                Side::Port => "port",
            };
            let allowed: Vec<_> = kind.sides.iter().copied().map(name).collect();
            that(
                kind.sides.contains(&side),
                "on",
                format!("{} for {}", name(side), kind.name),
                allowed.join(" or "),
            )?;
        }
        let device = self.device.as_deref();
        that(
            device.is_none_or(|name| (1..=64).contains(&name.len())),
            "device",
            "no name",
            "the name of a device, of 1 to 64 bytes",
        )
    }

    fn check_when(&self) -> std::result::Result<(), Flaw> {
        let when = &self.when;
        within("when.nth", when.nth, 1..=u64::MAX)?;
        within("when.every", when.every, 1..=u64::MAX)?;
        within("when.probability", when.probability, 0.0..=1.0)?;
        if let Some([from, to]) = when.window_s {
            that(
                from >= 0.0 && from < to && to <= 1e9,
                "when.window_s",
                format!("{from} to {to}"),
                "two ascending times, 0 to 1e9 s",
            )?;
        }
        let command = when.command.as_deref();
        that(
            command.is_none_or(|text| (1..=256).contains(&text.len())),
            "when.command",
            format!("{} bytes", command.map_or(0, str::len)),
            "a part of a command, of 1 to 256 bytes",
        )?;
        that(
            when.frames.is_none() || self.side() == Side::Camera,
            "when.frames",
            format!("{} counts messages", self.what),
            "only for faults that count frames",
        )
    }
}
