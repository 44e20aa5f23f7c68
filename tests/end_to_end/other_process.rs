//! A device in another process, driven only through its ports, against the same device in memory.

use crate::served::{LONG, Served, serve};
use phasmid::{Device, ScanOptions, Scanner};

#[test]
fn a_device_in_another_process_gives_the_bytes_of_one_in_memory() {
    let served = Served::spawn(serve().args(["--seed", "3"]));
    let options = ScanOptions {
        sequence: Some("quick-4".to_owned()),
        frame_timeout: LONG,
        reply_timeout: LONG,
        ..ScanOptions::default()
    };
    let mut scanner = Scanner::of_run_dir(&served.dir, options).unwrap();
    let far = [scanner.scan().unwrap(), scanner.scan().unwrap()];
    scanner.finish().unwrap();

    let device = Device::builder().profile("webcam-grey").scene("plane");
    let mut device = device.seed(3).build().unwrap();
    let near = [(); 2].map(|()| device.scan("quick-4").unwrap());
    for (far, near) in far.iter().zip(&near) {
        assert_eq!(far.idn, near.idn);
        assert_eq!(far.manifest, near.manifest);
        assert_eq!(far.calibration, near.calibration);
        assert!(far.images == near.images, "other pixels");
    }
    assert!(
        far[0].images != far[1].images,
        "the noise of each scan differs"
    );
}
