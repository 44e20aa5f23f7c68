//! Messages submitted with a ticket, events that the device reports unprompted, and power cycles.

use super::{MS, Port};
use crate::firmware::Done;
use phasmid_protocol::dialect::Event;
use phasmid_protocol::scpi::ErrorCode;

fn submit(port: &mut Port, ticket: u64, message: &str) -> Vec<Done> {
    port.firmware
        .submit(message.as_bytes(), ticket, port.now_ns);
    port.collect();
    port.firmware.take_done()
}

fn codes(done: &Done) -> Vec<i16> {
    done.errors.iter().map(|e| e.code.number()).collect()
}

#[test]
fn answers_and_errors_carry_their_ticket() {
    let mut port = Port::new();
    let done = submit(&mut port, 7, "*TST?;CAM:GAIN?");
    let answers = vec![b"0".to_vec(), b"0".to_vec()];
    assert_eq!(done.len(), 1);
    assert_eq!((done[0].ticket, &done[0].answers), (7, &answers));
    assert!(done[0].errors.is_empty());
    let done = submit(&mut port, 8, "CAM:GAIN 1000;*TST?;:NONSENSE 1;*TST?");
    assert_eq!(codes(&done[0]), [-222, -113]);
    assert_eq!(done[0].answers, [b"0".to_vec()]);
    let done = submit(&mut port, 9, "*TST? ,");
    assert_eq!(codes(&done[0]).len(), 1);
    // Neither answers nor errors reach the SCPI client.
    assert_eq!(port.ask("SYST:ERR:COUN?"), "0");
    assert_eq!(port.ask("*TST?"), "0");
    assert_eq!(port.firmware.take_done(), []);
}

#[test]
fn a_ticket_waits_and_a_trigger_does_not() {
    let mut port = Port::new();
    assert_eq!(submit(&mut port, 1, "TRIG:SOUR BUS;:INIT").len(), 1);
    assert_eq!(submit(&mut port, 2, "*OPC?"), []);
    assert_eq!(submit(&mut port, 3, "*TST?"), []);
    let done = submit(&mut port, 4, "*TRG");
    assert_eq!((done.len(), done[0].ticket), (1, 4));
    let done = submit(&mut port, 5, "*TRG");
    assert_eq!((done[0].ticket, codes(&done[0])), (5, vec![-211]));
    port.at(10_000 * MS);
    let done = port.firmware.take_done();
    let tickets: Vec<_> = done.iter().map(|d| (d.ticket, d.answers.clone())).collect();
    let expected = [(2, vec![b"1".to_vec()]), (3, vec![b"0".to_vec()])];
    assert_eq!(tickets, expected);
    // The number of waiting messages is limited; a message beyond the limit fails with an error.
    submit(&mut port, 100, "INIT");
    assert_eq!(submit(&mut port, 101, "*OPC?"), []);
    let full: Vec<_> = (102..200)
        .flat_map(|ticket| submit(&mut port, ticket, "*TST?"))
        .collect();
    assert_eq!(full.len(), 98 - 64);
    assert!(
        full.iter()
            .all(|done| done.errors[0].code == ErrorCode::InputBufferOverrun)
    );
}

#[test]
fn replies_name_the_line_that_they_answer() {
    let mut port = Port::new();
    port.firmware
        .receive(b"*TST?\nCAM:GAIN 1\n*TST?;*TST?\n", 0);
    let answered = port.firmware.take_answered();
    let told: Vec<_> = answered
        .iter()
        .map(|a| (a.to.as_str(), a.bytes.as_slice()))
        .collect();
    assert_eq!(
        told,
        [("*TST?", &b"0\n"[..]), ("*TST?;*TST?", &b"0;0\n"[..])]
    );
    let long = format!("*TST?;{}*TST?\n", " ".repeat(5000));
    port.firmware.receive(long.as_bytes(), 0);
    assert_eq!(port.firmware.take_answered()[0].to.len(), 256);
}

#[test]
fn events_tell_of_exposures_the_end_and_missed_pulses() {
    let mut port = Port::new();
    port.tell("TRIG:SOUR EXT;:INIT");
    assert_eq!(port.firmware.take_events(), []);
    port.firmware.external_trigger(0);
    port.firmware.external_trigger(0);
    assert_eq!(port.firmware.take_events(), [Event::TriggerMissed]);
    port.at(10_000 * MS);
    let mut expected: Vec<_> = (0..13)
        .map(|index| Event::Exposed { index, id: index })
        .collect();
    expected.push(Event::SequenceDone);
    assert_eq!(port.firmware.take_events(), expected);
    // A free-running camera reports no events.
    assert_eq!(port.error(), -211);
    port.firmware.set_streaming(true, port.now_ns);
    port.tell("TRIG:SOUR INT");
    port.at(20_000 * MS);
    assert!(!port.taken().is_empty());
    assert_eq!(port.firmware.take_events(), []);
}

#[test]
fn power_cycle_resets_all_but_frame_ids() {
    let mut port = Port::new();
    port.tell("*CLS");
    port.tell("CAM:GAIN 3;ROI 0,0,320,200;:PROJ:POW OFF;*ESE 5;*SRE 4");
    port.tell("TRIG:SOUR BUS;DEL 10ms");
    let manifest = port.ask("SEQ:DATA?");
    let end = manifest.len();
    let digits = usize::from(manifest.as_bytes()[1] - b'0');
    let toml = manifest[2 + digits..end].to_owned();
    let length = (toml.len() + 1).to_string();
    let define = format!(
        "SEQ:DEF \"own\",#{}{length}{toml}\n;:SEQ:SEL \"own\"",
        length.len()
    );
    port.tell(&define);
    port.tell("INIT;*TRG");
    port.at(200 * MS);
    assert!(port.shots.len() > 1 && port.shots.len() < 13);
    let before = port.firmware.next_id();
    port.firmware.receive(b"*OPC?\nCAM:GA", 200 * MS);
    assert_eq!(port.ask("SYST:ERR:COUN?"), "", "it waits");
    port.firmware.power_cycle(250 * MS);
    port.now_ns = 250 * MS;
    port.collect();
    let (taken, after) = (port.taken(), port.firmware.next_id());
    assert!(taken.iter().map(|shot| shot.0).eq(0..after) && after >= before);
    assert_eq!(
        port.at(10_000 * MS),
        "",
        "no operation survives the power cycle"
    );
    assert_eq!(port.taken(), []);
    assert_eq!(port.firmware.in_flight(), 0);
    assert_eq!(port.ask("*ESR?"), "128", "power on");
    assert_eq!(port.ask("*ESE?;*SRE?;CAM:GAIN?;:PROJ:POW?"), "0;0;0;1");
    assert_eq!(port.ask("TRIG:SOUR?;DEL?"), "INT;0");
    assert!(!port.ask("SEQ:LIST?").contains("own"));
    assert!(!port.ask("CAM:ROI?").contains("320"));
    assert_eq!(port.error(), 0);
    port.tell("TRIG:SOUR BUS;:INIT;*TRG");
    port.at(20_000 * MS);
    let ids: Vec<_> = port.taken().iter().map(|shot| shot.0).collect();
    assert!(ids.into_iter().eq(after..after + 13));
}
