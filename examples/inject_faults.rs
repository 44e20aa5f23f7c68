//! Injects faults into an emulated device and prints how a host copes with them: it scans again, or it
//! fails with a message. It never returns a wrong surface.
//!
//! ```sh
//! cargo run --release --example inject_faults
//! ```

use phasmid::profile::faults::{Fault, What};
use phasmid::{DecodeOptions, Device, Error};

fn main() -> Result<(), Error> {
    for (name, fault) in [
        ("the third frame is lost", Fault::once(What::Dropped, 3)),
        ("every frame is lost", Fault::new(What::Dropped)),
        (
            "the fifth frame arrives twice",
            Fault::once(What::Repeated, 5),
        ),
        (
            "the device restarts at a command",
            Fault::once(What::Reset, 9),
        ),
    ] {
        let mut device = Device::builder()
            .profile("webcam-grey")
            .scene("sphere")
            .exact_calibration(true)
            .build()?;
        device.inject(fault)?;
        let outcome = match device.scan("quick-4") {
            Ok(capture) => {
                let decoding = phasmid::decode(&capture, &device.rig(), &DecodeOptions::default())?;
                let score = phasmid::compare(&decoding, &device.truth()?, &device.rig())?;
                assert!(
                    score.coverage > 0.95 && score.gross_error_rate < 1e-3,
                    "{score:?}"
                );
                format!("scanned, {} points", score.points)
            }
            Err(error) => format!("refused: {error}"),
        };
        println!("{name} ({} times): {outcome}", device.struck().len());
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    #[test]
    fn runs() {
        super::main().unwrap();
    }
}
