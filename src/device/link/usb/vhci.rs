//! The kernel's virtual USB host controller, `vhci_hcd`, accessed through its sysfs files: its
//! ports, and the device nodes that drivers create for an attached device.

use phasmid_core::error::{Error, Result};
use std::fs;
use std::path::{Path, PathBuf};

/// Sysfs folder of the first controller.
const CONTROLLER: &str = "/sys/devices/platform/vhci_hcd.0";
/// Sysfs folder of USB devices, by bus name.
const DEVICES: &str = "/sys/bus/usb/devices";
/// State of an unused port in the controller's table.
const FREE: &str = "004";

/// A port of the controller.
#[derive(Debug, Clone)]
pub struct Port(u32);

/// Device nodes that drivers have created for an attached device.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Nodes {
    /// Node created by uvcvideo: `/dev/videoN`.
    pub camera: Option<PathBuf>,
    /// Node created by cdc_acm: `/dev/ttyACMN`.
    pub tty: Option<PathBuf>,
}

impl Nodes {
    /// Returns whether both nodes exist.
    pub fn is_complete(&self) -> bool {
        self.camera.is_some() && self.tty.is_some()
    }
}

impl Port {
    /// Finds an unused port for devices of a speed, which is given as the kernel's number.
    ///
    /// # Errors
    /// Returns an error with a remedy if the controller is missing or all ports of this speed are in
    /// use.
    pub(super) fn free(speed: u32) -> Result<Self> {
        Self::free_at(Path::new(CONTROLLER), speed)
    }

    fn free_at(controller: &Path, speed: u32) -> Result<Self> {
        let file = controller.join("status");
        let text = fs::read_to_string(&file).map_err(|e| match e.kind() {
            std::io::ErrorKind::NotFound => Error::device(
                "--usb attach: this kernel has no virtual USB host controller; `sudo modprobe \
                 vhci-hcd` loads it",
            ),
            _ => Error::io(&file, e),
        })?;
        let hub = if speed >= 5 { "ss" } else { "hs" };
        let free = rows(&text).find(|row| row.hub == hub && row.state == FREE);
        free.map(|row| Self(row.port)).ok_or_else(|| {
            Error::device(format!(
                "--usb attach: all ports of {} are taken, `usbip port` lists them",
                controller.display()
            ))
        })
    }

    /// Passes one end of a socket to the kernel, which keeps its own reference to it. The device
    /// with this id and speed must answer at the other end of the socket.
    ///
    /// # Errors
    /// Returns an error if the sysfs file cannot be written.
    pub(super) fn attach(&self, socket: i32, id: u32, speed: u32) -> Result<()> {
        let file = format!("{CONTROLLER}/attach");
        let line = format!("{} {socket} {id} {speed}", self.0);
        fs::write(&file, line).map_err(|e| Error::io(&file, e))
    }

    /// Returns the device nodes created so far for the device on this port.
    pub fn nodes(&self) -> Nodes {
        let status = Path::new(CONTROLLER).join("status");
        let Ok(text) = fs::read_to_string(status) else {
            return Nodes::default();
        };
        let row = rows(&text).find(|row| row.port == self.0);
        row.map_or_else(Nodes::default, |row| {
            nodes(&Path::new(DEVICES).join(row.bus_id))
        })
    }
}

/// A row of the controller's table of ports.
struct Row<'a> {
    /// Speed of the port: `hs` (high speed) or `ss` (SuperSpeed).
    hub: &'a str,
    port: u32,
    state: &'a str,
    /// Bus name of the attached device, `0-0` if there is none.
    bus_id: &'a str,
}

/// Parses the controller's table of ports, whose columns are hub, port, state, speed, device, socket
/// and the device's bus name. Skips the heading.
fn rows(table: &str) -> impl Iterator<Item = Row<'_>> {
    table.lines().filter_map(|line| {
        let mut words = line.split_whitespace();
        Some(Row {
            hub: words.next()?,
            port: words.next()?.parse().ok()?,
            state: words.next()?,
            bus_id: words.nth(3)?,
        })
    })
}

/// Returns the device nodes of all interfaces of a device.
fn nodes(device: &Path) -> Nodes {
    let mut nodes = Nodes::default();
    for interface in entries(device) {
        for camera in entries(&interface.join("video4linux")) {
            // Node 0 delivers the camera's frames, node 1 their metadata.
            let index = fs::read_to_string(camera.join("index")).unwrap_or_default();
            if index.trim() == "0" {
                nodes.camera = dev(&camera);
            }
        }
        if let Some(tty) = entries(&interface.join("tty")).first() {
            nodes.tty = dev(tty);
        }
    }
    nodes
}

fn dev(class_device: &Path) -> Option<PathBuf> {
    let path = Path::new("/dev").join(class_device.file_name()?);
    Some(path)
}

/// Returns the sorted entries of a folder; empty if the folder does not exist.
fn entries(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).into_iter().flatten();
    let mut paths: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    paths.sort();
    paths
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Output of kernel 6.1 in `status`, shortened.
    const TABLE: &str = "hub port sta spd dev      sockfd local_busid\n\
        hs  0000 006 003 00010002 000003 1-1\n\
        hs  0001 004 000 00000000 000000 0-0\n\
        ss  0008 004 000 00000000 000000 0-0\n";

    #[test]
    fn ports_are_chosen_by_speed_and_state() {
        let tree = tempfile::tempdir().unwrap();
        fs::write(tree.path().join("status"), TABLE).unwrap();
        let port = |speed| Port::free_at(tree.path(), speed).unwrap().0;
        assert_eq!((port(3), port(5)), (1, 8));
        fs::write(tree.path().join("status"), &TABLE[..90]).unwrap();
        let error = Port::free_at(tree.path(), 3).unwrap_err().to_string();
        assert!(error.contains("taken"), "{error}");
        let error = Port::free_at(Path::new("/no/such"), 3).unwrap_err();
        assert!(error.to_string().contains("modprobe"), "{error}");
        assert_eq!(rows(TABLE).next().unwrap().bus_id, "1-1");
    }

    #[test]
    fn nodes_are_those_of_the_device_s_interfaces() {
        let tree = tempfile::tempdir().unwrap();
        let device = tree.path();
        assert_eq!(nodes(device), Nodes::default());
        for (node, index) in [("video5", "1\n"), ("video4", "0\n")] {
            let folder = device.join("1-1:1.0/video4linux").join(node);
            fs::create_dir_all(&folder).unwrap();
            fs::write(folder.join("index"), index).unwrap();
        }
        assert!(!nodes(device).is_complete());
        fs::create_dir_all(device.join("1-1:1.2/tty/ttyACM3")).unwrap();
        let found = nodes(device);
        assert_eq!(found.camera, Some("/dev/video4".into()));
        assert_eq!(found.tty, Some("/dev/ttyACM3".into()));
    }
}
