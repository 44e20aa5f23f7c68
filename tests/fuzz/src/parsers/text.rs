//! Files that users write.

use phasmid::decode::Plan;
use phasmid::emulator::Firmware;
use phasmid::geometry::Rig;
use phasmid::host::usb::UsbAddress;
use phasmid::patient::phantom::Patient;
use phasmid::pattern::Manifest;
use phasmid::profile::faults::Schedule;
use phasmid::profile::{Profile, Scene, Station, TomlSource};
use phasmid::protocol::Endpoints;
use phasmid::protocol::dialect::Dialect;

fn text(bytes: &[u8]) -> String {
    String::from_utf8_lossy(bytes).into_owned()
}

/// Reads a manifest: writing and rereading it must give the same data.
pub fn manifest(bytes: &[u8]) -> bool {
    let Ok(manifest) = Manifest::parse(&text(bytes), "fuzz") else {
        return false;
    };
    let again = Manifest::parse(&manifest.to_toml(), "fuzz").expect("as it was written");
    assert_eq!(again, manifest);
    let _ = Plan::new(&manifest);
    true
}

/// Reads a calibration in Phasmid's own format: writing and rereading it must give the same data.
pub fn rig(bytes: &[u8]) -> bool {
    let Ok(rig) = Rig::from_toml(&text(bytes), "fuzz") else {
        return false;
    };
    rig.check().unwrap();
    assert_eq!(Rig::from_toml(&rig.to_toml(), "fuzz").unwrap(), rig);
    true
}

/// Reads a `device.json`.
pub fn endpoints(bytes: &[u8]) -> bool {
    Endpoints::parse(&text(bytes), "fuzz").is_ok()
}

/// Reads a profile: if it parses, it must be a valid device or lack a file.
pub fn profile(bytes: &[u8]) -> bool {
    let Ok(profile) = Profile::parse(&text(bytes), "fuzz") else {
        return false;
    };
    profile.nominal_rig().check().unwrap();
    let _ = Firmware::new(&profile, &[]);
    true
}

/// Reads a scene.
pub fn scene(bytes: &[u8]) -> bool {
    let Ok(scene) = Scene::parse(&text(bytes), "fuzz") else {
        return false;
    };
    assert!(scene.rig_from_scene().translation_mm.is_finite());
    true
}

/// Reads a patient: if it parses, the patient's mass must be plausible.
pub fn patient(bytes: &[u8]) -> bool {
    let Ok(patient) = Patient::parse(&text(bytes), "fuzz") else {
        return false;
    };
    assert!(patient.body_mass_index() > 5.0);
    true
}

/// Reads the address of a USB device.
pub fn usb_address(bytes: &[u8]) -> bool {
    let Ok(address) = UsbAddress::parse(&text(bytes), "fuzz") else {
        return false;
    };
    assert!(!address.host.is_empty());
    true
}

/// Reads a station file.
pub fn station(bytes: &[u8]) -> bool {
    let Ok(station) = Station::parse(&text(bytes), "fuzz") else {
        return false;
    };
    assert!(!station.device.is_empty());
    true
}

/// Reads a dialect file: if it parses, the dialect must be able to split arbitrary bytes into
/// messages.
pub fn dialect(bytes: &[u8]) -> bool {
    let Ok(dialect) = Dialect::parse(&text(bytes), "fuzz") else {
        return false;
    };
    let _ = dialect.asked(b"");
    let _ = dialect.asked(&[0x40; 64]);
    true
}

/// Reads a schedule of faults.
pub fn faults(bytes: &[u8]) -> bool {
    Schedule::from_source(&TomlSource::new(&text(bytes), "fuzz")).is_ok()
}
