//! Scans with any scanner, emulated or physical, given the addresses of its camera and control
//! port, and writes the measured points to a PLY file.
//!
//! ```sh
//! cargo run --release --example drive_a_scanner -- /dev/video10 /dev/ttyACM0 cloud.ply
//! ```

use phasmid::host::Progress;
use phasmid::{DecodeOptions, Error, ScanOptions, Scanner};
use std::path::Path;

fn main() -> Result<(), Error> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let [camera, control, out] = arguments.as_slice() else {
        eprintln!("usage: drive_a_scanner CAMERA CONTROL_PORT CLOUD.ply");
        std::process::exit(2);
    };
    drive(camera, Path::new(control), Path::new(out))
}

fn drive(camera: &str, control: &Path, out: &Path) -> Result<(), Error> {
    let mut scanner = Scanner::connect(camera, control, ScanOptions::default())?;
    let capture = scanner.scan_with(|progress| match progress {
        Progress::Identified(name) => println!("{name}"),
        Progress::Retry(why) => println!("{why}; scanning again"),
        _ => {}
    })?;
    scanner.finish()?;
    let rig = capture.calibration.as_ref();
    let decoding = phasmid::decode(&capture, rig, &DecodeOptions::default())?;
    print!("{}", decoding.summary());
    decoding.write_ply(out)
}

#[cfg(test)]
mod tests {
    use phasmid::{Device, ServeOptions};

    #[test]
    fn runs() {
        let device = Device::builder().profile("webcam-grey").scene("sphere");
        let serving = device
            .build()
            .unwrap()
            .serve(&ServeOptions::default())
            .unwrap();
        let at = serving.endpoints();
        let folder = tempfile::tempdir().unwrap();
        let out = folder.path().join("cloud.ply");
        super::drive(&at.camera, &at.control, &out).unwrap();
        assert!(std::fs::metadata(&out).unwrap().len() > 100_000);
    }
}
