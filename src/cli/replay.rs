//! `phasmid replay`: serves a device that behaves as in a recording.

use super::output::printed;
use super::record;
use super::serve::{Shutdown, check_run_dir, default_run_dir, runtime, tcp};
use phasmid_core::error::{Error, Result};
use phasmid_device::link::{Outcome, Replay, RunDir, replay};
use phasmid_host::monotonic_ns;
use phasmid_protocol::Endpoints;
use phasmid_protocol::record::{About, Event, Reader};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Serve a recording: a device that behaves as recorded, until Ctrl-C or TERM.
///
/// Exit status 0 if clients sent exactly what was recorded; 1 if a client sent something else
/// (reported at once, with its position in the recording) or not everything.
#[derive(Debug, clap::Args)]
#[command(after_help = "Example:\n  phasmid replay day.rec --run-dir replay-run")]
pub(super) struct Args {
    /// Recording of `serve --record` or `scan --record`.
    file: PathBuf,
    /// Directory for the endpoints [default: one under XDG_RUNTIME_DIR or the temporary directory].
    #[arg(long, value_name = "DIR")]
    run_dir: Option<PathBuf>,
    /// When to send replies and frames.
    #[arg(long, value_enum, default_value_t = Pace::Real)]
    clock: Pace,
    /// Also serve frames on this TCP port of the loopback interface; 0 picks a free one. TCP is not
    /// authenticated: without --tcp-token, every user of this machine can read the frames.
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "0")]
    tcp: Option<u16>,
    /// File with a token that TCP clients must present: one line of at least 16 characters.
    /// `phasmid` commands find it through the environment variable PHASMID_TCP_TOKEN_FILE.
    #[arg(long, value_name = "FILE", requires = "tcp")]
    tcp_token: Option<PathBuf>,
    /// Exit when standard input closes, for programs that start a device and may be killed.
    #[arg(long)]
    while_stdin: bool,
}

#[derive(Debug, Clone, Copy, PartialEq, Eq, clap::ValueEnum)]
enum Pace {
    /// With the recorded delay after the client's message.
    Real,
    /// At once.
    Fast,
}

pub(super) fn run(args: &Args) -> Result<()> {
    check_run_dir(args.run_dir.as_deref())?;
    let mut reader = record::open(&args.file)?;
    let about = about(&mut reader, &args.file)?;
    let run_dir = match &args.run_dir {
        Some(dir) => std::path::absolute(dir).map_err(|e| Error::io(dir, e))?,
        None => default_run_dir("replay"),
    };
    let start = Instant::now();
    let what = Replay {
        monotonic_ns: monotonic_ns(),
        reader,
        about,
        fast: args.clock == Pace::Fast,
        tcp: tcp(args.tcp, args.tcp_token.as_deref())?,
        notice: printed(),
    };
    let outcome = runtime()?.block_on(async {
        // Watch for signals before creating files or folders that must be removed at the end.
        let mut shutdown = Shutdown::watch(args.while_stdin)?;
        let run_dir = RunDir::claim(&run_dir)?;
        let ready = |endpoints: &Endpoints| announce(args, endpoints);
        replay(
            what,
            run_dir,
            move || start.elapsed(),
            ready,
            shutdown.wait(),
        )
        .await
    })?;
    judge(args, &outcome)
}

fn announce(args: &Args, endpoints: &Endpoints) {
    let mut text = format!(
        "{} as recorded in {}\n  control  {}\n  camera   {}\n",
        phasmid_protocol::printable(&endpoints.name),
        args.file.display(),
        endpoints.control.display(),
        endpoints.camera
    );
    if let Some(tcp) = &endpoints.camera_tcp {
        text += &format!("           {tcp}\n");
    }
    text += "Ctrl-C ends it.\n";
    // Keep serving even if standard output is closed.
    let mut out = std::io::stdout();
    let _ = out.write_all(text.as_bytes()).and_then(|()| out.flush());
}

fn judge(args: &Args, outcome: &Outcome) -> Result<()> {
    let (matched, missing) = (outcome.matched_bytes, outcome.missing_bytes);
    let all = matched + missing;
    let file = args.file.display();
    match outcome.departures {
        0 if missing == 0 => Ok(()),
        0 => Err(Error::device(format!(
            "{file}: clients sent only {matched} of the {all} bytes recorded from clients"
        ))),
        count => Err(Error::device(format!(
            "{file}: {count} client{} left the recorded path; {matched} of the {all} bytes that \
             clients sent in it came again",
            if count == 1 { " has" } else { "s have" }
        ))),
    }
}

/// Reads the first record, which describes the recording.
///
/// # Errors
/// Returns an error if the first record is missing, damaged or of another kind.
fn about<R: std::io::Read>(reader: &mut Reader<R>, path: &Path) -> Result<About> {
    let found = match reader.read() {
        Ok(Some(record)) => match record.event {
            Event::About(about) => return Ok(about),
            _ => "a first record of another kind".to_owned(),
        },
        Ok(None) => "a recording without records".to_owned(),
        Err(damage) => damage.to_string(),
    };
    let allowed = "a recording whose first record describes it";
    Err(Error::input(path.display(), found, allowed))
}
