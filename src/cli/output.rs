//! Writes to standard output and standard error: macros that replace the standard library's, and
//! messages that several commands print.

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
/// nobody can read must not change the exit status. A progress line is removed while the message is
/// written.
macro_rules! eprintln {
    ($($arg:tt)*) => {{
        use std::io::Write;
        let _ = $crate::cli::progress::aside(|| writeln!(std::io::stderr(), $($arg)*));
    }};
}

/// Name of standard output in error messages.
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

/// Prints a built-in document; `names` lists the names of all built-in documents of this kind.
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

/// Prints the current step of the command to standard error, if standard error is a terminal.
pub(super) fn step(what: &str) {
    use std::io::IsTerminal;
    if std::io::stderr().is_terminal() {
        eprintln!("{what} ...");
    }
}

/// Prints the backend on which a device renders and, if the device has no factory calibration, the
/// reason. `label` is the profile as given.
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

/// Returns a receiver for the messages of a served device, which prints them.
#[cfg(target_os = "linux")]
pub(super) fn printed() -> Notice {
    Notice::new(|message| eprintln!("phasmid: {message}"))
}
