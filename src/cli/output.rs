//! Writing to standard output and standard error: macros that replace the standard ones, and messages that
//! several commands print, also about emulated devices.

use phasmid_core::error::{Error, Result};
#[cfg(target_os = "linux")]
use phasmid_device::{Device, link::Notice};

/// Prints to standard output. If the reader has closed the pipe, as in `phasmid doctor | head`, the
/// program ends with status 0.
macro_rules! print {
    ($($arg:tt)*) => {{
        use std::io::Write;
        if let Err(e) = write!(std::io::stdout(), $($arg)*) {
            $crate::cli::output::unheard(&e);
        }
    }};
}

/// [`print!`] followed by a newline.
macro_rules! println {
    () => { print!("\n") };
    ($($arg:tt)*) => { print!("{}\n", format_args!($($arg)*)) };
}

/// Writes a line to standard error. The standard macro panics when the write fails; a message that
/// nobody can read must not change the exit status. A line of progress is moved out of its way.
macro_rules! eprintln {
    ($($arg:tt)*) => {{
        use std::io::Write;
        let _ = $crate::cli::progress::aside(|| writeln!(std::io::stderr(), $($arg)*));
    }};
}

/// Place in messages about standard output.
pub(super) const STANDARD_OUTPUT: &str = "standard output";

/// Ends the program because standard output cannot be written: with status 0 if the reader has
/// closed the pipe, else with status 1.
pub(super) fn unheard(e: &std::io::Error) -> ! {
    if e.kind() == std::io::ErrorKind::BrokenPipe {
        std::process::exit(0);
    }
    eprintln!("phasmid: {STANDARD_OUTPUT}: {e}");
    std::process::exit(1);
}

/// Prints a built-in document; `names` lists the existing ones.
pub(super) fn show<'a>(
    kind: &str,
    name: &str,
    text: Option<&str>,
    names: impl Iterator<Item = &'a str>,
) -> Result<()> {
    let Some(text) = text else {
        let names: Vec<_> = names.collect();
        return Err(Error::input(
            name,
            format!("no built-in {kind}"),
            names.join(", "),
        ));
    };
    print!("{text}");
    Ok(())
}

/// Reports the current step on standard error if that is a terminal.
pub(super) fn step(what: &str) {
    use std::io::IsTerminal;
    if std::io::stderr().is_terminal() {
        eprintln!("{what} ...");
    }
}

/// Prints where a device renders, and why it has no factory calibration if it has none. `label` is the
/// profile as given.
///
/// # Errors
/// Returns an error if the requested backend is not available.
#[cfg(target_os = "linux")]
pub(super) fn tell(label: &str, device: &mut Device) -> Result<()> {
    if let Some(news) = device.renderer.news()? {
        eprintln!("phasmid: {label}: {news}");
    }
    if let Some(adapter) = device.renderer.adapter() {
        let (name, kind, driver) = (&adapter.name, adapter.kind, &adapter.driver);
        eprintln!("phasmid: {label}: rendering on a GPU, {kind}: {name} ({driver})");
    }
    if let Err(why) = device.machine.firmware().factory_calibration() {
        eprintln!("phasmid: {why}; CALibration:DATA? answers with an error");
    }
    Ok(())
}

/// Returns the receiver of a served device's messages that prints them.
#[cfg(target_os = "linux")]
pub(super) fn printed() -> Notice {
    Notice::new(|message| eprintln!("phasmid: {message}"))
}
