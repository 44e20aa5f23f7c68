//! Checks of a fault: constraints that the types do not enforce.

use super::fault::Fault;
use super::kind::{Flaw, Side, What};
use std::fmt::{Debug, Display};
use std::ops::RangeInclusive;
use toml::Value;

fn that(ok: bool, field: &str, found: impl Display, allowed: impl Display) -> Result<(), Flaw> {
    match ok {
        true => Ok(()),
        false => Err(Flaw::new(field, found, allowed)),
    }
}

fn within<T: PartialOrd + Debug + Copy>(
    field: &str,
    value: Option<T>,
    range: RangeInclusive<T>,
) -> Result<(), Flaw> {
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
    pub fn check(&self) -> Result<(), Flaw> {
        self.check_parameters()?;
        self.check_side()?;
        within("times", self.times, 1..=u64::MAX)?;
        self.check_when()
    }

    /// Checks that the fault's device, if it names one, is in `names`.
    ///
    /// # Errors
    /// Returns an error for the field `device` if it is not.
    pub fn check_device(&self, names: &[&str]) -> Result<(), Flaw> {
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

    fn check_parameters(&self) -> Result<(), Flaw> {
        let kind = self.what.kind();
        for (parameter, (name, value)) in kind.parameters.iter().zip(self.what.values()) {
            let number = match value {
                Some(Value::Integer(number)) => number as f64,
                Some(Value::Float(number)) => number,
                _ => continue,
            };
            // NaN is in no range.
            let [low, high] = parameter
                .limits
                .unwrap_or([f64::NEG_INFINITY, f64::INFINITY]);
            that(
                (low..=high).contains(&number),
                name,
                number,
                parameter.allowed(),
            )?;
        }
        match self.what {
            What::WrongPattern { offset: 0 } => that(false, "offset", 0, "any number but 0"),
            What::BitErrors {
                count: Some(_),
                rate: Some(_),
                ..
            } => that(false, "rate", "a rate and a count", "only one of them"),
            _ => Ok(()),
        }
    }

    fn check_side(&self) -> Result<(), Flaw> {
        let kind = self.what.kind();
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

    fn check_when(&self) -> Result<(), Flaw> {
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
