//! An imported and configured USB device: its descriptors, and requests to it.

use super::address::UsbAddress;
use super::client::Client;
use super::topology::{Configuration, word};
use phasmid_core::error::{Error, Result};
use phasmid_protocol::usb::descriptor::{kind, text};
use phasmid_protocol::usb::{Setup, request};
use std::time::Duration;

/// English (United States), the language used for devices that list none.
const ENGLISH: u16 = 0x0409;

/// Contents of the device descriptor.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Identity {
    /// Release of USB, binary coded decimal.
    pub usb_bcd: u16,
    /// Vendor id.
    pub vendor_id: u16,
    /// Product id.
    pub product_id: u16,
    /// Release of the device, binary coded decimal.
    pub release_bcd: u16,
    /// Manufacturer, if the device reports it.
    pub manufacturer: Option<String>,
    /// Product, if the device reports it.
    pub product: Option<String>,
    /// Serial number, if the device reports it.
    pub serial: Option<String>,
}

/// A configured device, shared by its camera and its port.
pub struct UsbDevice {
    client: Client,
    identity: Identity,
    configuration: Configuration,
    /// Binary object store (BOS); empty if the device has none.
    capabilities: Vec<u8>,
    timeout: Duration,
}

impl UsbDevice {
    /// Imports a device, reads its descriptors and configures it; `timeout` bounds each request,
    /// now and later.
    ///
    /// # Errors
    /// Returns the errors of [`Client::import`], and an error if the descriptors are invalid or a
    /// request is refused or unanswered.
    pub fn open(address: &UsbAddress, timeout: Duration) -> Result<Self> {
        let client = Client::import(&address.host, address.bus_id.as_deref(), timeout)?;
        Self::configure(client, timeout)
    }

    /// Reads the descriptors of an imported device and configures it.
    ///
    /// # Errors
    /// Same as [`Self::open`].
    pub fn configure(client: Client, timeout: Duration) -> Result<Self> {
        let read = |kind, number, length| descriptor(&client, kind, number, 0, length, timeout);
        let bad = |what: String| Error::device(format!("{}: {what}", client.place()));
        let device = read(kind::DEVICE, 0, 18)?;
        if device.len() < 18 || device[1] != kind::DEVICE {
            return Err(bad(format!("device descriptor {device:02x?}")));
        }
        let usb_bcd = word(&device, 2);
        let head = read(kind::CONFIGURATION, 0, 9)?;
        let whole = read(kind::CONFIGURATION, 0, word(&head, 2).max(9))?;
        let configuration = Configuration::parse(&whole).map_err(|e| e.at(client.place()))?;
        // Devices of USB 2.01 and later have a binary object store (BOS).
        let capabilities = match usb_bcd {
            0x0201.. => {
                let head = read(kind::BOS, 0, 5)?;
                read(kind::BOS, 0, word(&head, 2).max(5))?
            }
            _ => Vec::new(),
        };
        let languages = read(kind::STRING, 0, 255).unwrap_or_default();
        let language = match word(&languages, 2) {
            0 => ENGLISH,
            language => language,
        };
        let string = |number: u8| -> Result<Option<String>> {
            if number == 0 {
                return Ok(None);
            }
            descriptor(&client, kind::STRING, number, language, 255, timeout).map(|b| text(&b))
        };
        let identity = Identity {
            usb_bcd,
            vendor_id: word(&device, 8),
            product_id: word(&device, 10),
            release_bcd: word(&device, 12),
            manufacturer: string(device[14])?,
            product: string(device[15])?,
            serial: string(device[16])?,
        };
        let set = Setup {
            kind: Setup::STANDARD_OUT,
            request: request::SET_CONFIGURATION,
            value: configuration.value.into(),
            ..Setup::default()
        };
        client.control(set, &[], timeout)?;
        Ok(Self {
            client,
            identity,
            configuration,
            capabilities,
            timeout,
        })
    }

    /// Returns the address, for messages.
    pub fn place(&self) -> &str {
        self.client.place()
    }

    /// Returns the identity in the device descriptor.
    pub fn identity(&self) -> &Identity {
        &self.identity
    }

    /// Returns the configuration.
    pub fn configuration(&self) -> &Configuration {
        &self.configuration
    }

    /// Returns the binary object store (BOS); empty if the device has none.
    pub fn capabilities(&self) -> &[u8] {
        &self.capabilities
    }

    /// Returns the client that carries the transfers.
    pub fn client(&self) -> &Client {
        &self.client
    }

    /// Performs a control request that returns data to the host.
    ///
    /// # Errors
    /// Returns an error if the device refuses, does not answer, or is gone.
    pub fn get(
        &self,
        kind: u8,
        request: u8,
        value: u16,
        index: u16,
        length: u16,
    ) -> Result<Vec<u8>> {
        let setup = Setup {
            kind,
            request,
            value,
            index,
            length,
        };
        self.client.control(setup, &[], self.timeout)
    }

    /// Performs a control request that sends data to the device.
    ///
    /// # Errors
    /// Same as [`Self::get`].
    pub fn set(&self, kind: u8, request: u8, value: u16, index: u16, data: &[u8]) -> Result<()> {
        let setup = Setup {
            kind,
            request,
            value,
            index,
            length: data.len() as u16,
        };
        self.client.control(setup, data, self.timeout).map(drop)
    }

    /// Clears the halt of an endpoint.
    ///
    /// # Errors
    /// Same as [`Self::get`].
    pub fn clear_halt(&self, address: u8) -> Result<()> {
        let feature = request::ENDPOINT_HALT;
        self.set(
            Setup::ENDPOINT_OUT,
            request::CLEAR_FEATURE,
            feature,
            address.into(),
            &[],
        )
    }

    /// Selects an alternate setting of an interface.
    ///
    /// # Errors
    /// Same as [`Self::get`].
    pub fn set_interface(&self, number: u8, setting: u8) -> Result<()> {
        let (kind, request) = (Setup::INTERFACE_OUT, request::SET_INTERFACE);
        self.set(kind, request, setting.into(), number.into(), &[])
    }
}

fn descriptor(
    client: &Client,
    kind: u8,
    number: u8,
    language: u16,
    length: u16,
    timeout: Duration,
) -> Result<Vec<u8>> {
    let setup = Setup {
        kind: Setup::STANDARD_IN,
        request: request::GET_DESCRIPTOR,
        value: u16::from(kind) << 8 | u16::from(number),
        index: language,
        length,
    };
    client.control(setup, &[], timeout)
}
