//! Shows a device in the browser while a host scans with it.
//!
//! ```sh
//! cargo run --release --example console
//! ```

use phasmid::{
    Console, ConsoleOptions, Device, Error, Follower, ScanOptions, Scanner, ServeOptions, Serving,
};

fn main() -> Result<(), Error> {
    let console = Console::start(&ConsoleOptions::default())?;
    println!("to control, open {}", console.url());
    println!("to watch, open {}", console.view_url());
    let follower = Follower::start(console.source("webcam"))?;
    let serving = serve(&follower)?;
    let at = serving.endpoints();
    let mut scanner = Scanner::connect(&at.camera, &at.control, ScanOptions::default())?;
    for scan in 1..=3 {
        let capture = scanner.scan()?;
        println!("scan {scan}: {} frames", capture.images.len());
    }
    Ok(())
}

/// Serves a device whose frames and scans the console shows.
fn serve(follower: &Follower) -> Result<Serving, Error> {
    let options = ServeOptions {
        observer: Some(follower.observer()),
        ..ServeOptions::default()
    };
    let device = Device::builder().profile("webcam-grey").scene("sphere");
    let serving = device.build()?.serve(&options)?;
    follower.ask_at(&serving.endpoints().service);
    Ok(serving)
}
