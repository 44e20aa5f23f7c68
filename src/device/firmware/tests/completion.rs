//! `*OPC` and `*WAI` wait for frames that have left the device.

use super::{MS, Port};

#[test]
fn opc_waits_for_the_last_frame() {
    let mut port = Port::new();
    assert_eq!(port.ask("*OPC?"), "1");
    assert_eq!(port.ask("TRIG:SOUR BUS;:INIT;*TRG;*OPC?;*IDN?"), "");
    assert_eq!(port.ask("*TST?"), "", "behind the waiting *OPC?");
    assert_eq!(port.at(203 * MS), "");
    assert_eq!(port.at(204 * MS), "1;Phasmid,webcam-grey,0001,0.1.0\n0\n");
    port.ask("*CLS");
    port.tell("INIT;*OPC;*TRG");
    assert_eq!(port.ask("*ESR?"), "0");
    port.at(1000 * MS);
    assert_eq!(port.ask("*ESR?"), "1");
    assert_eq!(port.ask("INIT;*WAI;*TST?"), "");
    assert_eq!(port.ask("*TRG"), "", "a trigger acts at once");
    assert_eq!(port.at(2000 * MS), "0\n");
    assert_eq!(port.ask("INIT;*OPC?"), "");
    assert_eq!(port.ask("ABOR"), "1", "and so does ABORt");
    assert_eq!(port.ask("INIT;*OPC?"), "");
    for _ in 0..100 {
        port.ask("*TST?");
    }
    port.firmware.hang_up();
    assert_eq!(port.error(), -363, "what waits is bounded");
    assert_eq!(port.ask("*TST?"), "0", "and goes with the cable");
}

#[test]
fn frames_in_flight_hold_up_completion() {
    let mut port = Port::new();
    port.firmware
        .receive(b"TRIG:SOUR BUS;:INIT;*TRG;*OPC?\n", 0);
    port.firmware.advance(1000 * MS);
    assert_eq!(port.firmware.take_exposures().len(), 13);
    assert_eq!(port.firmware.take_output(), b"");
    port.firmware.delivered(12);
    assert_eq!(port.firmware.take_output(), b"");
    port.firmware.delivered(1);
    assert_eq!(port.firmware.take_output(), b"1\n");
}
