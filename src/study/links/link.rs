//! The links.

/// Ways in which commands and frames travel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Link {
    /// Direct calls of the device.
    Memory,
    /// A pty and the frame socket.
    Socket,
    /// A pty and TCP on the loopback interface.
    Tcp,
    /// USB/IP on the loopback interface, with the host's own drivers.
    UsbIp,
    /// A pty and a node of v4l2loopback.
    Video,
    /// USB/IP to this machine's kernel, whose drivers `uvcvideo` and `cdc_acm` create device nodes for
    /// it.
    Kernel,
}

/// All links, in the order of the table.
pub(super) const LINKS: [Link; 6] = [
    Link::Memory,
    Link::Socket,
    Link::Tcp,
    Link::UsbIp,
    Link::Video,
    Link::Kernel,
];

impl Link {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Memory => "in memory",
            Self::Socket => "pty and frame socket",
            Self::Tcp => "pty and TCP",
            Self::UsbIp => "USB/IP",
            Self::Video => "pty and V4L2",
            Self::Kernel => "USB of the kernel",
        }
    }

    /// Returns whether the link overwrites frames that the host does not read in time.
    pub(super) fn overwrites(self) -> bool {
        self == Self::Video
    }
}
