//! The system files that Phasmid ships, which set up v4l2loopback.

/// A system file that Phasmid ships.
#[derive(Debug, PartialEq, Eq)]
pub struct Shipped {
    /// Name of the file for `phasmid doctor --print`.
    pub name: &'static str,
    /// Path where it is installed.
    pub path: &'static str,
    /// Contents.
    pub text: &'static str,
}

/// udev rules for stable names and permissions.
pub const UDEV: Shipped = Shipped {
    name: "udev",
    path: "/etc/udev/rules.d/60-phasmid.rules",
    text: include_str!("../../udev/60-phasmid.rules"),
};

/// Options of v4l2loopback.
pub const MODPROBE: Shipped = Shipped {
    name: "modprobe",
    path: "/etc/modprobe.d/v4l2loopback-phasmid.conf",
    text: include_str!("../../udev/v4l2loopback-phasmid.conf"),
};

/// Loads the module at boot.
pub const MODULES_LOAD: Shipped = Shipped {
    name: "modules-load",
    path: "/etc/modules-load.d/phasmid.conf",
    text: include_str!("../../udev/phasmid-modules.conf"),
};
