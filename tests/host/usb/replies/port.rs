//! The serial port's endpoints and requests.

use super::Host;
use phasmid::link::usb::Event;
use phasmid::profile::{Speed, Transfer};
use phasmid::protocol::usb::Setup;
use phasmid::protocol::usb::cdc::{self, DeviceLines};
use phasmid::protocol::usb::usbip::Reply;

#[test]
fn the_port_carries_bytes_lines_and_breaks() {
    let mut host = Host::new(Speed::High, Transfer::Bulk);
    let request = cdc::request::SET_CONTROL_LINE_STATE;
    host.control(Setup::CLASS_OUT, request, 3, 2, &[]).unwrap();
    host.submit(3, false, 6, Setup::default(), b"*IDN?\n");
    let replies = host.replies();
    assert!(matches!(replies[0].0, Reply::Submit { actual: 6, .. }));
    let events = host.device.take_events();
    let received = Event::Received(b"*IDN?\n".to_vec());
    assert!(events.contains(&received), "{events:?}");
    assert!(host.device.send(b"Phasmid\n", host.wire.now()));
    host.read(3, 4);
    host.read(3, 4);
    let data: Vec<u8> = host.replies().into_iter().flat_map(|r| r.1).collect();
    assert_eq!(data, b"Phasmid\n");
    host.read(2, 16);
    let told = |host: &mut Host| DeviceLines::from_notification(&host.replies()[0].1);
    assert_eq!(told(&mut host), Some(DeviceLines::default()));
    host.read(2, 16);
    assert_eq!(host.replies(), [], "nothing new");
    let ready = DeviceLines {
        dcd: false,
        dsr: true,
    };
    host.device.set_lines(ready, host.wire.now());
    assert_eq!(told(&mut host), Some(ready));
    let coding = cdc::request::SET_LINE_CODING;
    let refused = host.control(Setup::CLASS_OUT, coding, 0, 2, &[0; 7]);
    assert_eq!(refused, None);
}
