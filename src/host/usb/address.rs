//! Addresses of USB devices on a USB/IP server, without a kernel driver: `usb:HOST:PORT` or
//! `usb:HOST:PORT/BUSID`.

use phasmid_core::error::{Error, Result};
use phasmid_protocol::usb::usbip::BUS_ID_LEN;

/// A parsed address.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct UsbAddress {
    /// `HOST:PORT` of a USB/IP server.
    pub host: String,
    /// Bus id of the device on the server; `None` selects the server's only device.
    pub bus_id: Option<String>,
}

impl UsbAddress {
    /// Parses an address; `place` names it in messages.
    ///
    /// # Errors
    /// Returns an error if the address has another form.
    pub fn parse(address: &str, place: &str) -> Result<Self> {
        let bad = || {
            Error::input(
                place,
                format!("{address:?}"),
                "usb:HOST:PORT or usb:HOST:PORT/BUSID, the port a number from 1 to 65535",
            )
        };
        let rest = address.strip_prefix("usb:").ok_or_else(bad)?;
        let (host, bus_id) = match rest.split_once('/') {
            Some((host, bus_id)) => (host, Some(bus_id)),
            None => (rest, None),
        };
        let (name, port) = host.rsplit_once(':').ok_or_else(bad)?;
        let named = bus_id.is_none_or(|id| {
            (1..BUS_ID_LEN).contains(&id.len()) && id.bytes().all(|b| b.is_ascii_graphic())
        });
        if name.is_empty() || !named || port.parse::<u16>().ok().is_none_or(|port| port == 0) {
            return Err(bad());
        }
        Ok(Self {
            host: host.to_owned(),
            bus_id: bus_id.map(str::to_owned),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn reads_addresses_and_refuses_others_with_expected_form() {
        let read = |address| UsbAddress::parse(address, "--device");
        let address = read("usb:[::1]:3240/1-2").unwrap();
        assert_eq!(address.host, "[::1]:3240");
        assert_eq!(address.bus_id.as_deref(), Some("1-2"));
        assert_eq!(read("usb:board:3240").unwrap().bus_id, None);
        let long = format!("usb:a:1/{}", "x".repeat(32));
        for bad in [
            "",
            "usb:",
            "usb:board",
            "usb::3240",
            "usb:a:0",
            "usb:a:70000",
            "tcp:a:1",
            "usb:a:1/",
            "usb:a:1/a b",
            &long,
        ] {
            let error = read(bad).unwrap_err();
            assert_eq!(error.exit_code(), 2);
            assert!(error.to_string().contains("usb:HOST:PORT/BUSID"), "{error}");
        }
    }
}
