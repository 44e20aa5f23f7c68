//! Shows a device in the browser while a host scans with it.
//!
//! ```sh
//! cargo run --release --example console
//! ```

use phasmid::{
    Console, ConsoleOptions, Device, Error, ScanOptions, Scanner, ServeOptions, Serving,
};

fn main() -> Result<(), Error> {
    let console = Console::start(&ConsoleOptions::default())?;
    println!("to control, open {}", console.url());
    println!("to watch, open {}", console.view_url());
    let serving = serve(&console)?;
    let at = serving.endpoints();
    let mut scanner = Scanner::connect(&at.camera, &at.control, ScanOptions::default())?;
    for scan in 1..=3 {
        let capture = scanner.scan()?;
        println!("scan {scan}: {} frames", capture.images.len());
    }
    Ok(())
}

/// Serves a device whose frames the console shows.
fn serve(console: &Console) -> Result<Serving, Error> {
    let options = ServeOptions {
        observer: Some(console.observer("webcam")),
        ..ServeOptions::default()
    };
    let device = Device::builder().profile("webcam-grey").scene("sphere");
    device.build()?.serve(&options)
}
