//! Encodings documented by the kernel, and round trips.

use super::words::put_words;
use super::*;
use crate::usb::Setup;
use proptest::prelude::*;

/// Import and transfer examples from the kernel's documentation.
#[test]
fn reads_examples_of_the_kernel_documentation() {
    assert_eq!(
        Operation::Import.encode(),
        [0x01, 0x11, 0x80, 0x03, 0, 0, 0, 0]
    );
    let mut submit = [0u8; HEADER_LEN];
    for (at, word) in [
        (0, 1u32),
        (4, 0x0d05),
        (8, 0x0001_000f),
        (12, 1),
        (16, 1),
        (20, 0x200),
        (24, 0x40),
        (32, u32::MAX),
        (36, 4),
    ] {
        submit[at..at + 4].copy_from_slice(&word.to_be_bytes());
    }
    let Command::Submit(read) = Command::decode(&submit).unwrap() else {
        panic!("a submit");
    };
    assert_eq!((read.seqnum, read.device), (0x0d05, 0x0001_000f));
    assert_eq!((read.input, read.endpoint, read.length), (true, 1, 64));
    assert_eq!((read.packets, read.interval), (None, 4));
    assert_eq!(Command::Submit(read).encode(), submit);
}

proptest! {
    #[test]
    fn encoded_commands_and_replies_decode_equal(words: [u32; 12]) {
        let mut bytes = [0u8; HEADER_LEN];
        put_words(&mut bytes, &words);
        bytes[3] %= 5;
        bytes[..3].fill(0);
        if let Ok(command) = Command::decode(&bytes) {
            prop_assert_eq!(Command::decode(&command.encode()).unwrap(), command);
            if let Command::Submit(submit) = command {
                prop_assert!(submit.length <= MAX_TRANSFER && submit.endpoint < 16);
                prop_assert!(submit.packets.is_none_or(|packets| packets <= MAX_PACKETS));
            }
        }
        if let Ok(reply) = Reply::decode(&bytes) {
            prop_assert_eq!(Reply::decode(&reply.encode()).unwrap(), reply);
        }
    }

    #[test]
    fn encoded_devices_decode_equal(bus_id in "[0-9]{1,3}-[0-9]{1,3}", numbers: [u32; 3], ids: [u16; 3]) {
        let device = DeviceInfo {
            bus_id,
            bus: numbers[0],
            device: numbers[1],
            speed: numbers[2],
            vendor: ids[0],
            product: ids[1],
            release: ids[2],
            class: [0xEF, 2, 1],
            interfaces: 4,
        };
        prop_assert_eq!(DeviceInfo::decode(&device.encode()), device);
    }
}

#[test]
fn other_protocols_and_sizes_are_refused() {
    let list = Operation::List.encode();
    assert!(Operation::decode(*b"GET / HT").is_err());
    assert_eq!(Operation::decode(list).unwrap(), Operation::List);
    assert!(Operation::List.decode_reply(list).is_err());
    for (outcome, code) in [
        (Outcome::Done, 0),
        (Outcome::Busy, 2),
        (Outcome::NoDevice, 4),
        (Outcome::Refused(1), 1),
    ] {
        let reply = Operation::Import.reply(outcome);
        assert_eq!(reply[4..], [0, 0, 0, code]);
        assert_eq!(Operation::Import.decode_reply(reply).unwrap(), outcome);
    }
    let mut huge = Command::Submit(Submit {
        seqnum: 1,
        device: 2,
        input: true,
        endpoint: 1,
        flags: 0,
        length: MAX_TRANSFER,
        packets: Some(MAX_PACKETS),
        interval: 0,
        setup: Setup::default(),
    })
    .encode();
    assert!(Command::decode(&huge).is_ok());
    huge[27] = 1;
    assert!(
        Command::decode(&huge)
            .unwrap_err()
            .to_string()
            .contains("bytes")
    );
    huge[27] = 0;
    huge[35] = 1;
    assert!(
        Command::decode(&huge)
            .unwrap_err()
            .to_string()
            .contains("packets")
    );
}
