//! The scanner's operations in SCPI.

use super::{Settings, TRIES, agreed};
use crate::error::{Error, Result};
use crate::host::{CommandPort, Instrument};
use crate::protocol::scpi::{Param, parse, quote};
use std::time::Duration;

/// What decides what a run shows, and what it is before one; the first is the sequence's name, the
/// last one the events, of which power-on counts (IEEE 488.2, 11.5.1.2).
const SETTINGS: [(&str, &[&str]); 6] = [
    (SELECTED, &[]),
    ("TRIG:SOUR?", &["BUS"]),
    ("TRIG:MODE?", &["SEQ", "SEQUENCE"]),
    ("INIT:CONT?", &["0", "OFF"]),
    ("PROJ:POW?", &["1", "ON"]),
    (EVENTS, &["0"]),
];
const SELECTED: &str = "SEQ:SEL?";
pub(super) const EVENTS: &str = "*ESR?";
const POWER_ON: u8 = 1 << 7;

/// A SCPI instrument as a scanner's device.
pub(in crate::host) struct Scpi<P> {
    instrument: Instrument<P>,
    /// Those of [`SETTINGS`] that the device knows, once it has been asked.
    known: Option<Vec<&'static str>>,
}

impl<P: CommandPort> Scpi<P> {
    pub(super) fn open(port: P, timeout: Duration) -> Result<Self> {
        let instrument = Instrument::open(port, timeout)?;
        Ok(Self {
            instrument,
            known: None,
        })
    }

    pub(super) fn instrument(&mut self) -> &mut Instrument<P> {
        &mut self.instrument
    }

    pub(super) fn info(&self) -> &str {
        self.instrument.info()
    }

    /// Where an operation's answer comes from, for messages.
    pub(super) fn place(&self, operation: &str) -> String {
        let query = match operation {
            "manifest" => "SEQ:DATA?",
            "calibration" => "CAL:DATA?",
            _ => "*IDN?",
        };
        format!("{}: {query}", self.info())
    }

    pub(super) fn recover(&mut self) -> Result<()> {
        self.instrument.recover()
    }

    /// From here on a device that is switched off and on is found out, as the events of before are
    /// no news any more.
    pub(super) fn begin(&mut self) -> Result<()> {
        self.instrument.order("*CLS")
    }

    pub(super) fn identify(&mut self) -> Result<Option<String>> {
        agreed(self.place("identify"), || self.instrument.query("*IDN?")).map(Some)
    }

    /// What the device speaks.
    pub(super) fn language(&self) -> &str {
        "SCPI"
    }

    pub(super) fn source(&mut self) -> Result<Option<String>> {
        let place = format!("{}: TRIG:SOUR?", self.info());
        agreed(place, || self.instrument.query("TRIG:SOUR?")).map(Some)
    }

    pub(super) fn quiet(&mut self) -> Result<()> {
        let order = "INIT:CONT OFF;:ABOR;:TRIG:SOUR BUS;MODE SEQ";
        self.instrument.order(order)
    }

    pub(super) fn restore(&mut self, source: &str) -> Result<()> {
        let order = format!("ABOR;:TRIG:SOUR {source}");
        self.instrument.order(&order)
    }

    pub(super) fn light_on(&mut self) -> Result<()> {
        self.instrument.order("PROJ:POW ON")
    }

    pub(super) fn select(&mut self, name: &str) -> Result<()> {
        self.instrument.order(&format!("SEQ:SEL {}", quote(name)))
    }

    pub(super) fn list(&mut self) -> Result<Option<Vec<String>>> {
        let list = self.instrument.query("SEQ:LIST?")?;
        Ok(Some(strings(&list)))
    }

    /// Asks back what was ordered.
    pub(super) fn ready(&mut self, sequence: Option<&str>) -> Result<Settings> {
        let mut tries = 1;
        loop {
            let settings = self.settings()?;
            let wrong = settings.0.iter().find(|(query, word)| {
                let wanted = SETTINGS.iter().find(|(known, _)| known == query);
                let wanted = wanted.map_or(&[][..], |(_, words)| words);
                match sequence {
                    Some(name) if query == SELECTED => strings(word) != [name],
                    _ => {
                        let as_wanted = |wanted: &&str| wanted.eq_ignore_ascii_case(word);
                        !wanted.is_empty() && !wanted.iter().any(as_wanted)
                    }
                }
            });
            match wrong {
                None => return Ok(settings),
                // The power-on event has been read, and what was ordered before it is void.
                Some((query, word)) if tries == TRIES || query == EVENTS => {
                    return Err(Error::device(format!(
                        "{}: {query} says {word:?}, which is not what was ordered: the device was \
                         reset, or somebody else gives it orders",
                        self.info()
                    )));
                }
                Some(_) => tries += 1,
            }
        }
    }

    /// Asks for all settings that the device knows, in one line.
    pub(super) fn settings(&mut self) -> Result<Settings> {
        let all: Vec<&'static str> = SETTINGS.iter().map(|(query, _)| *query).collect();
        let known = self.known.clone().unwrap_or(all);
        let query = ask_for(&known);
        let Some(reply) = self.instrument.query_optional(&query)? else {
            self.probe()?;
            return self.settings();
        };
        self.known = Some(known.clone());
        let words = split(&reply);
        if words.len() != known.len() {
            return Err(Error::device(format!(
                "{}: {query} was answered with {reply:?}, want {} answers",
                self.info(),
                known.len()
            )));
        }
        let word = |(query, word): (&str, String)| {
            let events = word.parse::<f64>().ok().filter(|_| query == EVENTS);
            let power_on = events.map(|events| (events as u8 & POWER_ON).to_string());
            (query.to_owned(), power_on.unwrap_or(word))
        };
        Ok(Settings(known.into_iter().zip(words).map(word).collect()))
    }

    /// Finds out which of [`SETTINGS`] the device knows; fewer each time.
    ///
    /// # Errors
    /// A device that knows no longer what it has answered.
    fn probe(&mut self) -> Result<()> {
        if self.known.is_some() {
            return Err(Error::device(format!(
                "{}: the device no longer knows what it has answered before",
                self.info()
            )));
        }
        let mut known = Vec::new();
        for (query, _) in SETTINGS {
            if self.instrument.query_optional(query)?.is_some() {
                known.push(query);
            }
        }
        self.known = Some(known);
        Ok(())
    }

    pub(super) fn selected(&self, settings: &Settings) -> Option<String> {
        let (_, word) = settings.0.iter().find(|(query, _)| query == SELECTED)?;
        strings(word).pop()
    }

    fn text(&mut self, query: &str) -> Result<Option<String>> {
        let place = format!("{}: {query}", self.info());
        // The line has no checksum, and a number with one wrong digit is a number.
        match agreed(&place, || self.instrument.query_block(query))? {
            None => Ok(None),
            Some(bytes) => String::from_utf8(bytes)
                .map(Some)
                .map_err(|_| Error::device(format!("{place}: the answer is not UTF-8"))),
        }
    }

    pub(super) fn manifest(&mut self) -> Result<Option<String>> {
        self.text("SEQ:DATA?")
    }

    pub(super) fn calibration(&mut self) -> Result<Option<String>> {
        self.text("CAL:DATA?")
    }

    pub(super) fn settle(&mut self) -> Result<()> {
        self.instrument.query("*OPC?").map(drop)
    }

    pub(super) fn arm(&mut self) -> Result<()> {
        // Armed already is refused; this may be given twice.
        self.instrument.order("ABOR;:INIT")
    }

    pub(super) fn trigger(&mut self) -> Result<()> {
        self.instrument.tell("*TRG")
    }

    pub(super) fn complaints(&mut self) -> Result<()> {
        self.instrument.check("INIT;*TRG")
    }
}

/// Questions in one line, each from the root.
fn ask_for(queries: &[&str]) -> String {
    let rooted = queries.iter().map(|query| match query.starts_with('*') {
        true => (*query).to_owned(),
        false => format!(":{query}"),
    });
    rooted.collect::<Vec<_>>().join(";")
}

/// The answers of a line: `;` in a string parts nothing.
fn split(reply: &str) -> Vec<String> {
    let mut words = vec![String::new()];
    let mut quoted = false;
    for c in reply.chars() {
        quoted ^= c == '"';
        match words.last_mut() {
            Some(word) if quoted || c != ';' => word.push(c),
            _ => words.push(String::new()),
        }
    }
    words
}

/// The strings among the data of an answer.
fn strings(answer: &str) -> Vec<String> {
    parse(format!("LIST {answer}").as_bytes())
        .units
        .into_iter()
        .flat_map(|unit| unit.params)
        .filter_map(|param| match param {
            Param::Text(name) => Some(name),
            _ => None,
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn answers_of_a_line_are_told_apart() {
        assert_eq!(split("\"a;b\";BUS;0"), ["\"a;b\"", "BUS", "0"]);
        assert_eq!(split("\"a\"\";\"\"b\";1"), ["\"a\"\";\"\"b\"", "1"]);
        assert_eq!(split(""), [""]);
        assert_eq!(strings("\"a\"\"b\",\"c\""), ["a\"b", "c"]);
        assert_eq!(ask_for(&["SEQ:SEL?", "*ESR?"]), ":SEQ:SEL?;*ESR?");
    }
}
