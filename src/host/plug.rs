//! Identifies the USB device behind a device node. When plugged in again, a device may get other
//! nodes (`ttyACM1` for `ttyACM0`, `video2` for `video0`), and its old nodes may go to another
//! device. The device's descriptors, and the interface that a node belongs to, stay the same.
//!
//! Linux publishes descriptors and interfaces in sysfs (Documentation/ABI/stable/sysfs-bus-usb and
//! testing/sysfs-bus-usb). On systems without sysfs, no node is attributed to a device.

use phasmid_core::error::{Error, Result};
use phasmid_protocol::printable;
use std::fmt::{self, Display};
use std::fs;
use std::path::{Path, PathBuf};

/// Mount point of sysfs.
const SYSFS: &str = "/sys";

/// One function of a USB device, used to find its node again.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) struct Plug {
    /// Kernel class of its nodes: `tty` or `video4linux`.
    class: &'static str,
    device: Label,
    /// `bInterfaceNumber`.
    interface: String,
    /// Index of the node among the nodes of the interface, if the kernel states it. It matters for
    /// uvcvideo, whose second node delivers no frames.
    index: Option<String>,
    /// USB location, such as `1-2.4`.
    place: String,
    /// Whether the device is found again only at the same USB location, because it has no unique
    /// serial number.
    stays: bool,
}

/// Identity of a device by its descriptors.
#[derive(Debug, Clone, PartialEq, Eq)]
struct Label {
    vendor: String,
    product: String,
    serial: Option<String>,
}

impl Plug {
    /// Identifies the USB device that a node (or the target of a link) belongs to; `None` if the
    /// node does not belong to a USB device. `class` is the kernel class of the node, `tty` or
    /// `video4linux`.
    pub(super) fn of(class: &'static str, node: &str) -> Option<Self> {
        Self::of_node(Path::new(SYSFS), class, Path::new(node))
    }

    /// Returns the node under `/dev`; `None` if the device is not plugged in.
    fn node(&self) -> Option<PathBuf> {
        self.node_in(Path::new(SYSFS))
    }

    /// Returns the path of the device's current node, or `given` if that path leads to the same
    /// node.
    ///
    /// # Errors
    /// Returns an error if the device is not plugged in.
    pub(super) fn path(&self, given: &str) -> Result<String> {
        let node = self
            .node()
            .ok_or_else(|| Error::device(format!("no {self}")))?;
        let same = fs::canonicalize(given).is_ok_and(|there| there == node);
        Ok(match same {
            true => given.to_owned(),
            false => node.display().to_string(),
        })
    }

    fn of_node(sysfs: &Path, class: &'static str, node: &Path) -> Option<Self> {
        let node = fs::canonicalize(node).ok()?;
        let mut plug = Self::read(sysfs, class, node.file_name()?.as_ref())?;
        let twins = plug.all(sysfs);
        plug.stays = plug.device.serial.is_none() || twins.iter().any(|t| t.1.place != plug.place);
        Some(plug)
    }

    fn node_in(&self, sysfs: &Path) -> Option<PathBuf> {
        let mut found = self.all(sysfs);
        found.sort_by_key(|(_, plug)| plug.place != self.place);
        let (name, plug) = found.into_iter().next()?;
        if self.stays && plug.place != self.place {
            return None;
        }
        let event = sysfs.join(folder(self.class)).join(&name).join("uevent");
        let event = fs::read_to_string(event).ok()?;
        let name = event
            .lines()
            .find_map(|line| line.strip_prefix("DEVNAME="))?;
        Some(Path::new("/dev").join(name))
    }

    /// Lists the nodes whose class, descriptors, interface and index equal this device's, by name.
    fn all(&self, sysfs: &Path) -> Vec<(PathBuf, Self)> {
        let Ok(entries) = fs::read_dir(sysfs.join(folder(self.class))) else {
            return Vec::new();
        };
        let names = entries
            .flatten()
            .map(|entry| PathBuf::from(entry.file_name()));
        let plugs = names.filter_map(|name| {
            let plug = Self::read(sysfs, self.class, &name)?;
            Some((name, plug))
        });
        let mut all: Vec<_> = plugs.filter(|(_, plug)| self.is_like(plug)).collect();
        all.sort_by(|a, b| a.0.cmp(&b.0));
        all
    }

    fn is_like(&self, other: &Self) -> bool {
        (&self.device, &self.interface, &self.index)
            == (&other.device, &other.interface, &other.index)
    }

    /// Reads a node's entry in sysfs; `None` if the entry disappears while it is read.
    fn read(sysfs: &Path, class: &'static str, name: &Path) -> Option<Self> {
        let entry = sysfs.join(folder(class)).join(name);
        let lowest = fs::canonicalize(entry.join("device")).ok()?;
        // The port of an adapter is a child of the interface, not the interface itself.
        let interface = lowest
            .ancestors()
            .find(|folder| folder.join("bInterfaceNumber").exists())?;
        let device = interface.parent()?;
        Some(Self {
            class,
            device: Label {
                vendor: word(&device.join("idVendor"))?,
                product: word(&device.join("idProduct"))?,
                serial: word(&device.join("serial")),
            },
            interface: word(&interface.join("bInterfaceNumber"))?,
            index: word(&entry.join("index")),
            place: device.file_name()?.to_str()?.to_owned(),
            stays: false,
        })
    }
}

impl Display for Plug {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Label {
            vendor,
            product,
            serial,
        } = &self.device;
        write!(f, "USB device {vendor}:{product}")?;
        if let Some(serial) = serial {
            // The serial number comes from the device: keep control characters off the terminal.
            write!(f, " with serial number {}", printable(serial))?;
        }
        match self.stays {
            true => write!(f, " at {}", self.place),
            false => Ok(()),
        }
    }
}

/// Returns the sysfs folder that lists the nodes of a class.
fn folder(class: &str) -> PathBuf {
    Path::new("class").join(class)
}

/// Reads an attribute; `None` if it is missing or empty.
fn word(path: &Path) -> Option<String> {
    let word = fs::read_to_string(path).ok()?;
    let word = word.trim();
    (!word.is_empty()).then(|| word.to_owned())
}

#[cfg(all(test, unix))]
mod tests {
    use super::*;
    use std::os::unix::fs::symlink;

    /// A temporary folder laid out like sysfs.
    struct Fake(tempfile::TempDir);

    impl Fake {
        fn new() -> Self {
            Self(tempfile::tempdir().unwrap())
        }

        fn put(&self, path: &str, text: &str) {
            let path = self.0.path().join(path);
            fs::create_dir_all(path.parent().unwrap()).unwrap();
            fs::write(path, text).unwrap();
        }

        /// Plugs in a device with a camera (two nodes) at interface 0 and a serial port at interface 2.
        fn plug(&self, place: &str, serial: &str, video: [&str; 2], tty: &str) {
            let device = format!("devices/usb1/{place}");
            self.put(&format!("{device}/idVendor"), "1209\n");
            self.put(&format!("{device}/idProduct"), "0001\n");
            if !serial.is_empty() {
                self.put(&format!("{device}/serial"), &format!("{serial}\n"));
            }
            let nodes = [
                ("video4linux", video[0], 0, "0"),
                ("video4linux", video[1], 0, "1"),
                ("tty", tty, 2, ""),
            ];
            for (class, name, number, index) in nodes {
                let interface = format!("{device}/{place}:1.{number}");
                self.put(
                    &format!("{interface}/bInterfaceNumber"),
                    &format!("0{number}\n"),
                );
                let entry = format!("class/{class}/{name}");
                self.put(
                    &format!("{entry}/uevent"),
                    &format!("MAJOR=1\nDEVNAME={name}\n"),
                );
                self.put(&format!("{entry}/index"), &format!("{index}\n"));
                let link = self.0.path().join(&entry).join("device");
                symlink(self.0.path().join(interface), link).unwrap();
                self.put(&format!("dev/{name}"), "");
            }
        }

        fn unplug(&self, place: &str, nodes: &[&str]) {
            let root = self.0.path();
            fs::remove_dir_all(root.join("devices/usb1").join(place)).unwrap();
            for name in nodes {
                fs::remove_file(root.join("dev").join(name)).unwrap();
                for class in ["tty", "video4linux"] {
                    let _ = fs::remove_dir_all(root.join("class").join(class).join(name));
                }
            }
        }

        fn of(&self, class: &'static str, node: &str) -> Option<Plug> {
            let root = self.0.path();
            Plug::of_node(root, class, &root.join("dev").join(node))
        }

        fn node(&self, plug: &Plug) -> Option<String> {
            let node = plug.node_in(self.0.path())?;
            Some(node.to_str().unwrap().to_owned())
        }
    }

    #[test]
    fn device_is_found_by_serial_number_on_any_usb_port() {
        let fake = Fake::new();
        fake.plug("1-1", "0001", ["video0", "video1"], "ttyACM0");
        fake.plug("1-2", "0002", ["video2", "video3"], "ttyACM1");
        // A user's link, as udev creates them.
        symlink("ttyACM0", fake.0.path().join("dev/scanner")).unwrap();
        let port = fake.of("tty", "scanner").unwrap();
        let camera = fake.of("video4linux", "video0").unwrap();
        assert_eq!(fake.node(&port).unwrap(), "/dev/ttyACM0");
        assert_eq!(fake.node(&camera).unwrap(), "/dev/video0");
        assert_eq!(
            port.to_string(),
            "USB device 1209:0001 with serial number 0001"
        );
        fake.unplug("1-1", &["video0", "video1", "ttyACM0"]);
        // Neither the twin device nor a device that gets the old node names may be taken for the
        // first one.
        assert_eq!((fake.node(&port), fake.node(&camera)), (None, None));
        fake.plug("1-1", "0003", ["video0", "video1"], "ttyACM0");
        assert_eq!((fake.node(&port), fake.node(&camera)), (None, None));
        fake.plug("1-4.2", "0001", ["video4", "video5"], "ttyACM2");
        assert_eq!(fake.node(&port).unwrap(), "/dev/ttyACM2");
        assert_eq!(fake.node(&camera).unwrap(), "/dev/video4");
    }

    #[test]
    fn without_a_serial_number_of_its_own_a_device_is_known_by_its_place() {
        for serial in ["", "0001"] {
            let fake = Fake::new();
            fake.plug("1-1", serial, ["video0", "video1"], "ttyACM0");
            fake.plug("1-2", serial, ["video2", "video3"], "ttyACM1");
            let port = fake.of("tty", "ttyACM0").unwrap();
            fake.unplug("1-1", &["video0", "video1", "ttyACM0"]);
            assert_eq!(fake.node(&port), None, "the twin is another device");
            fake.plug("1-1", serial, ["video0", "video1"], "ttyACM2");
            assert_eq!(fake.node(&port).unwrap(), "/dev/ttyACM2");
            assert!(port.to_string().ends_with(" at 1-1"), "{port}");
        }
    }

    #[test]
    fn finds_port_of_usb_adapter_and_ignores_nodes_without_usb() {
        let fake = Fake::new();
        fake.plug("1-1", "0001", ["video0", "video1"], "ttyACM0");
        let below = fake.0.path().join("devices/usb1/1-1/1-1:1.2/ttyUSB0");
        fs::create_dir(&below).unwrap();
        fake.put("class/tty/ttyUSB0/uevent", "DEVNAME=ttyUSB0\n");
        fake.put("dev/ttyUSB0", "");
        symlink(&below, fake.0.path().join("class/tty/ttyUSB0/device")).unwrap();
        let port = fake.of("tty", "ttyUSB0").unwrap();
        assert_eq!(port.interface, "02");
        // None of these belongs to a USB device: a serial port on the mainboard, a pty, a node that
        // does not exist.
        let board = fake.0.path().join("devices/pnp0");
        fs::create_dir(&board).unwrap();
        fake.put("class/tty/ttyS0/uevent", "DEVNAME=ttyS0\n");
        fake.put("dev/ttyS0", "");
        symlink(&board, fake.0.path().join("class/tty/ttyS0/device")).unwrap();
        fake.put("dev/pts/3", "");
        for node in ["ttyS0", "pts/3", "nothing"] {
            assert_eq!(fake.of("tty", node), None, "{node}");
        }
    }
}
