//! Queries, settings and errors, and `*OPC` and `*WAI`, which wait until all frames have left the
//! device.

use super::{MS, Port};
use proptest::prelude::*;

#[test]
fn queries_answer_with_the_current_settings() {
    let mut port = Port::new();
    for (order, query, answer) in [
        ("", "*IDN?", "Phasmid,webcam-grey,0001,0.1.0"),
        ("", "SYSTEM:VERSION?", "1999.0"),
        ("", "*TST?", "0"),
        ("CAM:EXP 5ms", "CAMERA:EXPOSURE?", "0.005"),
        ("CAM:EXP 50 us", "CAM:EXP?", "0.00005"),
        ("CAM:EXP DEF", "CAM:EXP?", "0.012"),
        ("", "CAM:EXP? MAX;EXP? MIN", "0.016;0.00005"),
        ("CAM:GAIN 6.5 dB", "CAM:GAIN?", "6.5"),
        ("CAM:FORM GREY", "CAM:FORM?", "GREY"),
        ("CAM:FORM yuyv", "CAM:FORM?", "YUYV"),
        ("*RST", "CAM:FORM?", "GREY"),
        ("CAM:ROI 10,20,30,40", "CAM:ROI?", "10,20,30,40"),
        ("CAM:ROI MIN,MIN,MAX,MAX", "CAM:ROI?", "0,0,640,480"),
        ("CAM:INT 40 ms", "CAM:INT?", "0.04"),
        ("PROJ:POW OFF", "PROJ:POW?", "0"),
        ("PROJ:CURR 50 PCT", "PROJ:CURR?", "0.5"),
        ("PROJ:PATT 3", "PROJ:PATT?", "3"),
        ("PROJ:PATT black", "PROJ:PATT?", "BLAC"),
        ("SEQ:SEL 'quick-4'", "SEQ:SEL?", "\"quick-4\""),
        ("", "SEQ:LIST?", "\"quick-4\",\"quick-4-xy\""),
        ("", "SEQ:COUN?", "13"),
        ("SEQ:PER 20ms", "SEQ:PER?", "0.02"),
        ("TRIG:SOUR SOFTWARE", "TRIG:SOUR?", "SOFT"),
        ("TRIG:DEL 1ms", "TRIG:DEL?", "0.001"),
        ("TRIG:MODE STEP", "TRIG:MODE?", "STEP"),
        ("INIT:CONT ON", "INIT:CONT?", "1"),
        ("*ESE 36", "*ESE?", "36"),
        ("*SRE 255", "*SRE?", "191"),
        ("STAT:OPER:ENAB 48", "STAT:OPER:ENAB?", "48"),
        ("STAT:QUES:ENAB #HFFFF", "STAT:QUES:ENAB?", "32767"),
        ("STAT:PRES", "STAT:OPER:ENAB?;:STAT:QUES:ENAB?", "0;0"),
        ("", "DIAG:FRAM?", "0"),
        (
            "*RST",
            "PROJ:POW?;PATT?;:TRIG:SOUR?;:INIT:CONT?",
            "1;WHIT;INT;0",
        ),
    ] {
        port.tell(order);
        assert_eq!(port.ask(query), answer, "{order} {query}");
    }
}

#[test]
fn errors_have_the_numbers_of_the_standard() {
    let mut port = Port::new();
    for (line, code) in [
        ("FOO:BAR", -113),
        ("CAM:EXP 1", -222),
        ("CAM:EXP -1ms", -222),
        ("CAM:EXP 17ms", -221), // above the sequence's period of 16 ms
        ("SEQ:PER 1ms", -221),
        ("CAM:EXP", -109),
        ("CAM:EXP 1,2", -108),
        ("CAM:EXP? 3", -108),
        ("CAM:EXP 5 V", -131),
        ("CAM:EXP FAST", -141),
        ("CAM:EXP 'x'", -158),
        ("CAM:EXP #11x", -168),
        ("CAM:FORM MJPG", -224),
        ("CAM:FORM Y16", -224), // more bits than the sensor has
        ("CAM:ROI 0,0,33,1;:CAM:FORM YUYV", -221),
        ("*RST;:CAM:FORM YUYV;ROI 0,0,33,1", -222),
        ("CAM:ROI 639,0,MIN,1", -222),
        ("*RST;:CAM:ROI 0,0,641,1", -222),
        ("CAM:ROI 639,0,2,1", -222),
        ("CAM:ROI 0,0", -109),
        ("CAM:GAIN 18.1", -222),
        ("CAM2:GAIN 1", -114),
        ("PROJ:CURR 1.5", -222),
        ("PROJ:PATT 13", -222),
        ("PROJ:PATT GREEN", -224),
        ("PROJ:POW MAYBE", -141),
        ("SEQ:SEL \"moon\"", -256),
        ("SEQ:SEL moon", -148),
        ("SEQ:DEL 'quick-4'", -221),
        ("TRIG:SOUR MOON", -224),
        ("*TRG", -211),
        ("TRIG", -211),
        ("INIT", -221), // the camera runs free
        ("TRIG:SOUR BUS;:INIT;INIT", -213),
        ("*IDN", -113),
        ("*RST?", -113),
        ("*CLS 1", -108),
        ("SYST:ERR? 1", -108),
        ("*ESE 256", -222),
        ("CAM:EXP 1;;@", -222),
    ] {
        assert_eq!(port.ask(line), "", "{line}");
        assert_eq!(port.error(), code, "{line}");
        port.ask("ABOR;*CLS");
    }
    assert_eq!(port.ask("FOO"), "");
    assert_eq!(
        port.ask("SYST:ERR:COUN?;NEXT?"),
        "1;-113,\"Undefined header;FOO\""
    );
    assert_eq!(port.ask("SYST:ERR?"), "0,\"No error\"");
}

#[test]
fn an_unknown_header_voids_the_rest_and_a_bad_value_does_not() {
    let mut port = Port::new();
    assert_eq!(port.ask("*TST?;FOO;*TST?"), "0");
    assert_eq!(port.ask("*TST?;CAM:GAIN 99;*TST?"), "0;0");
    assert_eq!((port.error(), port.error(), port.error()), (-113, -222, 0));
}

#[test]
fn a_stalled_block_is_given_up() {
    let mut port = Port::new();
    port.bytes(b"SEQ:IMAG 'x',#6100000abc\n*IDN?\n");
    assert!(port.firmware.inside_block());
    port.firmware.input_stalled();
    assert_eq!(port.ask("*TST?"), "0");
    assert_eq!(port.error(), -161);
}

proptest! {
    /// After any input, the device answers again once the client has reconnected and sent `*CLS`.
    #[test]
    fn answers_after_any_bytes(chunks in proptest::collection::vec(
        prop_oneof![
            proptest::collection::vec(any::<u8>(), 0..40),
            prop_oneof![
                Just("*RST\n"), Just("TRIG:SOUR BUS;:INIT;*TRG\n"), Just("*OPC?;*WAI\n"),
                Just("CAM:ROI 1,2,3,"), Just("INIT:CONT ON\n"), Just("ABOR\n"), Just(";*IDN?"),
                Just("PROJ:PATT 3\n"), Just("SEQ:DEF 'a',#13abc\n"),
            ].prop_map(|s: &str| s.as_bytes().to_vec()),
        ], 0..20))
    {
        let mut port = Port::new();
        port.firmware.set_streaming(true, 0);
        for (i, chunk) in chunks.iter().enumerate() {
            port.firmware.receive(chunk, i as u64 * 50 * MS);
            port.now_ns = i as u64 * 50 * MS;
            port.collect();
            port.firmware.take_output();
        }
        let ids: Vec<_> = port.shots.iter().map(|e| e.shot.id).collect();
        prop_assert!(ids.iter().copied().eq(0..ids.len() as u64), "ids in order, none twice");
        port.firmware.hang_up();
        port.ask("*CLS");
        prop_assert_eq!(port.ask("*TST?"), "0");
    }
}

#[test]
fn opc_waits_for_the_last_frame() {
    let mut port = Port::new();
    assert_eq!(port.ask("*OPC?"), "1");
    assert_eq!(port.ask("TRIG:SOUR BUS;:INIT;*TRG;*OPC?;*IDN?"), "");
    assert_eq!(port.ask("*TST?"), "", "queries wait behind *OPC?");
    assert_eq!(port.at(203 * MS), "");
    assert_eq!(port.at(204 * MS), "1;Phasmid,webcam-grey,0001,0.1.0\n0\n");
    port.ask("*CLS");
    port.tell("INIT;*OPC;*TRG");
    assert_eq!(port.ask("*ESR?"), "0");
    port.at(1000 * MS);
    assert_eq!(port.ask("*ESR?"), "1");
    assert_eq!(port.ask("INIT;*WAI;*TST?"), "");
    assert_eq!(port.ask("*TRG"), "", "a trigger does not wait behind *WAI");
    assert_eq!(port.at(2000 * MS), "0\n");
    assert_eq!(port.ask("INIT;*OPC?"), "");
    assert_eq!(port.ask("ABOR"), "1", "ABORt does not wait behind *OPC?");
    assert_eq!(port.ask("INIT;*OPC?"), "");
    for _ in 0..100 {
        port.ask("*TST?");
    }
    port.firmware.hang_up();
    assert_eq!(
        port.error(),
        -363,
        "the queue of waiting messages is bounded"
    );
    assert_eq!(
        port.ask("*TST?"),
        "0",
        "a hang-up discards waiting messages"
    );
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
