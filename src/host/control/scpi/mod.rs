//! The scanner's operations in SCPI.
//!
//! The commands are the device's own unless a dialect file overrides them ([`words`]). A file for
//! SCPI defines only commands and power-on messages: line endings, the numbering of answers,
//! refusals and the detection of a power cycle follow IEEE 488.2.

mod words;

use super::{Settings, TRIES, agreed, no_words, unquoted};
use crate::{CommandPort, Instrument};
use phasmid_core::error::{Error, Result};
use phasmid_protocol::dialect::{Dialect, Value};
use phasmid_protocol::printable;
use phasmid_protocol::scpi::{Param, parse, quote};
use std::time::Duration;
use words::{Wording, Words};

/// The settings that determine what a run shows: the operation that sets or reports each, its
/// query, and its permitted values before a run. The first is the name of the sequence; the last is
/// the event register, of which the power-on bit counts (IEEE 488.2, 11.5.1.2).
const SETTINGS: [(&str, &str, &[&str]); 6] = [
    ("selected", SELECTED, &[]),
    ("quiet", "TRIG:SOUR?", &["BUS"]),
    ("quiet", "TRIG:MODE?", &["SEQ", "SEQUENCE"]),
    ("quiet", "INIT:CONT?", &["0", "OFF"]),
    ("light_on", "PROJ:POW?", &["1", "ON"]),
    ("", EVENTS, &["0"]),
];
/// Operations that report a setting. They are queried separately if a dialect file has commands for
/// them.
const TOLD: [&str; 2] = ["selected", "source"];
const SELECTED: &str = "SEQ:SEL?";
pub(super) const EVENTS: &str = "*ESR?";
const POWER_ON: u8 = 1 << 7;

/// A SCPI instrument that serves as a scanner's device.
pub(crate) struct Scpi<P> {
    instrument: Instrument<P>,
    /// Queries of [`SETTINGS`] that the device knows; `None` until it was probed.
    known: Option<Vec<&'static str>>,
    words: Words,
}

impl<P: CommandPort> Scpi<P> {
    pub(super) fn open(port: P, dialect: Option<Dialect>, timeout: Duration) -> Result<Self> {
        let words = Words::new(dialect)?;
        let instrument = Instrument::open_chatty(port, words.chatter(), timeout)?;
        Ok(Self {
            instrument,
            known: None,
            words,
        })
    }

    pub(super) fn instrument(&mut self) -> &mut Instrument<P> {
        &mut self.instrument
    }

    pub(super) fn info(&self) -> &str {
        self.instrument.info()
    }

    /// Returns the source of an operation's answer, for messages.
    pub(super) fn place(&self, operation: &str) -> String {
        if let Wording::File(file) = self.words.of(operation) {
            return format!("{}: {}", self.info(), file.name());
        }
        let query = match operation {
            "manifest" => "SEQ:DATA?",
            "calibration" => "CAL:DATA?",
            "source" => "TRIG:SOUR?",
            _ => "*IDN?",
        };
        format!("{}: {query}", self.info())
    }

    pub(super) fn recover(&mut self) -> Result<()> {
        self.instrument.recover()
    }

    /// Starts to watch for a power cycle of the device, by clearing earlier events.
    pub(super) fn begin(&mut self) -> Result<()> {
        self.instrument.order("*CLS")
    }

    pub(super) fn identify(&mut self) -> Result<Option<String>> {
        agreed(self.place("identify"), || self.word("identify", "*IDN?"))
    }

    /// Returns the name of the device's language.
    pub(super) fn language(&self) -> &str {
        self.words.language()
    }

    /// Performs an operation with a file's commands; `None` if it has no result.
    fn operate(&mut self, operation: &str, inputs: &[(&str, Value)]) -> Result<Option<Value>> {
        match self.words.of(operation) {
            Wording::File(file) => file.perform(&mut self.instrument, inputs),
            Wording::Own | Wording::None => Ok(None),
        }
    }

    /// Performs an operation with the device's own command `own`, or with a file's commands. Does
    /// nothing if the file does not define the operation.
    fn order(&mut self, operation: &str, own: &str, inputs: &[(&str, Value)]) -> Result<()> {
        match self.words.of(operation) {
            Wording::Own => self.instrument.order(own),
            Wording::File(_) | Wording::None => self.operate(operation, inputs).map(drop),
        }
    }

    /// Returns an operation's result as text without control characters; `None` if there is no
    /// command for it.
    fn word(&mut self, operation: &str, own: &str) -> Result<Option<String>> {
        if let Wording::Own = self.words.of(operation) {
            return self.instrument.query(own).map(Some);
        }
        let value = self.operate(operation, &[])?;
        Ok(value.map(|value| printable(&value.to_string())))
    }

    pub(super) fn source(&mut self) -> Result<Option<String>> {
        agreed(self.place("source"), || self.word("source", "TRIG:SOUR?"))
    }

    pub(super) fn quiet(&mut self) -> Result<()> {
        let order = "INIT:CONT OFF;:ABOR;:TRIG:SOUR BUS;MODE SEQ";
        self.order("quiet", order, &[])
    }

    pub(super) fn restore(&mut self, source: &str) -> Result<()> {
        let order = format!("ABOR;:TRIG:SOUR {source}");
        self.order("restore", &order, &[("source", Value::from(source))])
    }

    pub(super) fn light_on(&mut self) -> Result<()> {
        self.order("light_on", "PROJ:POW ON", &[])
    }

    pub(super) fn select(&mut self, name: &str) -> Result<()> {
        if let Wording::None = self.words.of("select") {
            return Err(no_words(name, self.language()));
        }
        let order = format!("SEQ:SEL {}", quote(name));
        self.order("select", &order, &[("name", Value::from(name))])
    }

    pub(super) fn list(&mut self) -> Result<Option<Vec<String>>> {
        let list = self.word("list", "SEQ:LIST?")?;
        Ok(list.map(|list| match self.words.of("list") {
            Wording::Own => strings(&list),
            _ => list.split(',').map(|name| unquoted(name.trim())).collect(),
        }))
    }

    /// Reads the settings back and checks them against what was set.
    pub(super) fn ready(&mut self, sequence: Option<&str>) -> Result<Settings> {
        let mut tries = 1;
        loop {
            let settings = self.settings()?;
            let wrong = settings.0.iter().find(|(query, word)| {
                let wanted = SETTINGS.iter().find(|(_, known, _)| known == query);
                let wanted = wanted.map_or(&[][..], |(_, _, words)| words);
                match sequence {
                    Some(name) if query == SELECTED => strings(word) != [name],
                    Some(name) if query == "selected" => word != name,
                    _ => {
                        let as_wanted = |wanted: &&str| wanted.eq_ignore_ascii_case(word);
                        !wanted.is_empty() && !wanted.iter().any(as_wanted)
                    }
                }
            });
            match wrong {
                None => return Ok(settings),
                // Reading the power-on event has cleared it, and everything set before the event is
                // void.
                Some((query, word)) if tries == TRIES || query == EVENTS => {
                    return Err(Error::device(format!(
                        "{}: {query} says {word:?}, which is not what was set: the device was \
                         reset, or another program controls it",
                        self.info()
                    )));
                }
                Some(_) => tries += 1,
            }
        }
    }

    /// Queries all settings that the device knows: in one line, except those with a file's
    /// commands.
    pub(super) fn settings(&mut self) -> Result<Settings> {
        let mut settings = self.own_settings()?;
        for what in TOLD {
            // With the device's own commands, the setting is already in the list or was never set.
            if let Wording::File(_) = self.words.of(what)
                && let Some(word) = self.word(what, "")?
            {
                settings.0.push((what.to_owned(), unquoted(&word)));
            }
        }
        Ok(settings)
    }

    fn own_settings(&mut self) -> Result<Settings> {
        let all = self.asked();
        let known = self.known.clone().unwrap_or(all);
        let query = ask_for(&known);
        let Some(reply) = self.instrument.query_optional(&query)? else {
            self.probe()?;
            return self.own_settings();
        };
        self.known = Some(known.clone());
        let words = split(&reply);
        if words.len() != known.len() {
            return Err(Error::device(format!(
                "{}: {query} was answered with {reply:?}, expected {} answers",
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

    /// Returns the queries of [`SETTINGS`] that are set or reported with the device's own commands.
    fn asked(&self) -> Vec<&'static str> {
        let own = |operation| matches!(self.words.of(operation), Wording::Own);
        let settings = SETTINGS.iter();
        let own = settings.filter(|(operation, ..)| operation.is_empty() || own(operation));
        own.map(|(_, query, _)| *query).collect()
    }

    /// Finds out which of [`SETTINGS`] the device knows, by sending each query on its own.
    ///
    /// # Errors
    /// Returns an error if the device no longer knows a query that it has answered before.
    fn probe(&mut self) -> Result<()> {
        if self.known.is_some() {
            return Err(Error::device(format!(
                "{}: the device no longer knows a query that it answered before",
                self.info()
            )));
        }
        let mut known = Vec::new();
        for query in self.asked() {
            if self.instrument.query_optional(query)?.is_some() {
                known.push(query);
            }
        }
        self.known = Some(known);
        Ok(())
    }

    pub(super) fn selected(&self, settings: &Settings) -> Option<String> {
        let find = |wanted| settings.0.iter().find(|(query, _)| query == wanted);
        if let Some((_, name)) = find("selected") {
            return Some(name.clone());
        }
        let (_, word) = find(SELECTED)?;
        strings(word).pop()
    }

    /// Reads a text that contains measurement data.
    fn text(&mut self, operation: &str, query: &str) -> Result<Option<String>> {
        if !matches!(self.words.of(operation), Wording::Own) {
            let place = self.place(operation);
            let value = agreed(&place, || self.operate(operation, &[]))?;
            let text = |value: Value| value.text().map(str::to_owned);
            let not_text = || Error::device(format!("{place}: the answer is not text"));
            return value
                .map(|value| text(value).ok_or_else(not_text))
                .transpose();
        }
        let place = format!("{}: {query}", self.info());
        // The line has no checksum, and a number with one wrong digit is still a valid number.
        match agreed(&place, || self.instrument.query_block(query))? {
            None => Ok(None),
            Some(bytes) => String::from_utf8(bytes)
                .map(Some)
                .map_err(|_| Error::device(format!("{place}: the answer is not UTF-8"))),
        }
    }

    pub(super) fn manifest(&mut self) -> Result<Option<String>> {
        self.text("manifest", "SEQ:DATA?")
    }

    pub(super) fn calibration(&mut self) -> Result<Option<String>> {
        self.text("calibration", "CAL:DATA?")
    }

    pub(super) fn settle(&mut self) -> Result<()> {
        self.word("complete", "*OPC?").map(drop)
    }

    pub(super) fn arm(&mut self) -> Result<()> {
        // INIT is refused if the device is already armed; with ABOR the command can be repeated.
        self.order("arm", "ABOR;:INIT", &[])
    }

    pub(super) fn trigger(&mut self) -> Result<()> {
        match self.words.of("trigger") {
            Wording::File(file) => file.tell(&mut self.instrument),
            Wording::Own | Wording::None => self.instrument.tell("*TRG"),
        }
    }

    pub(super) fn complaints(&mut self) -> Result<()> {
        // The location of the error queue is defined by SCPI, not by a file.
        self.instrument.check("INIT;*TRG")
    }
}

/// Joins queries into one line, each starting from the root of the command tree.
fn ask_for(queries: &[&str]) -> String {
    let rooted = queries.iter().map(|query| match query.starts_with('*') {
        true => (*query).to_owned(),
        false => format!(":{query}"),
    });
    rooted.collect::<Vec<_>>().join(";")
}

/// Splits a line into its answers; `;` inside a string does not separate.
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

/// Returns the strings in the data of an answer.
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
    fn answers_of_a_line_are_split_outside_quotes() {
        assert_eq!(split("\"a;b\";BUS;0"), ["\"a;b\"", "BUS", "0"]);
        assert_eq!(split("\"a\"\";\"\"b\";1"), ["\"a\"\";\"\"b\"", "1"]);
        assert_eq!(split(""), [""]);
        assert_eq!(strings("\"a\"\"b\",\"c\""), ["a\"b", "c"]);
        assert_eq!(ask_for(&["SEQ:SEL?", "*ESR?"]), ":SEQ:SEL?;*ESR?");
    }
}
