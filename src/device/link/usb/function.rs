//! Handles requests on the control endpoint: enumeration, negotiation and controls of the video
//! class, and line state of the serial class. Each request returns an answer and may queue events;
//! nothing here blocks or sends.

use super::descriptors::{
    CAMERA_TERMINAL, Descriptors, ENDPOINTS, INTERFACES, PROCESSING_UNIT, SERIAL_CONTROL,
    VIDEO_CONTROL, VIDEO_IN, VIDEO_STREAMING,
};
use super::{CameraLimits, CameraState, Event};
use phasmid_profile::Transfer;
use phasmid_protocol::usb::cdc::{self, HostLines, LineCoding};
use phasmid_protocol::usb::descriptor::kind;
use phasmid_protocol::usb::uvc::{self, Negotiation, error_code, selector};
use phasmid_protocol::usb::{Setup, request};

/// An answer on the control endpoint.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(super) enum Answer {
    /// Bytes for the host; empty to acknowledge a request without data.
    Data(Vec<u8>),
    /// The request is unknown or cannot be satisfied.
    Stall,
}

/// An acknowledgement without data.
const DONE: Answer = Answer::Data(Vec::new());

/// State that requests on the control endpoint read and set.
pub(super) struct Function {
    pub(super) descriptors: Descriptors,
    limits: CameraLimits,
    /// Camera state reported by the firmware.
    camera: CameraState,
    configuration: u8,
    /// Alternate setting of the streaming interface.
    setting: u8,
    halted: Vec<u8>,
    probe: Negotiation,
    /// Stream parameters committed by the host.
    committed: Option<Negotiation>,
    line: LineCoding,
    host_lines: HostLines,
    last_error: u8,
    events: Vec<Event>,
}

impl Function {
    pub(super) fn new(descriptors: Descriptors, limits: CameraLimits, camera: CameraState) -> Self {
        let probe = descriptors.default_negotiation();
        Self {
            descriptors,
            limits,
            camera,
            configuration: 0,
            setting: 0,
            halted: Vec::new(),
            probe,
            committed: None,
            line: LineCoding::default(),
            host_lines: HostLines::default(),
            last_error: error_code::NONE,
            events: Vec::new(),
        }
    }

    /// Resets the state as a bus reset does: unconfigured, no stream parameters, lines low.
    pub(super) fn reset(&mut self) {
        self.configuration = 0;
        self.setting = 0;
        self.halted.clear();
        self.probe = self.descriptors.default_negotiation();
        self.committed = None;
        self.set_lines(HostLines::default());
        self.last_error = error_code::NONE;
    }

    /// Stores the camera state reported by the firmware.
    pub(super) fn set_camera(&mut self, camera: CameraState) {
        self.camera = camera;
    }

    /// Takes the events since the last call.
    pub(super) fn take_events(&mut self) -> Vec<Event> {
        std::mem::take(&mut self.events)
    }

    /// Returns the committed stream parameters if the present configuration and alternate setting
    /// can carry a stream.
    pub(super) fn stream(&self) -> Option<Negotiation> {
        let carries = match self.descriptors.transfer {
            Transfer::Bulk => true,
            Transfer::Isochronous => self.setting == 1,
        };
        self.committed
            .filter(|_| carries && self.configuration == 1)
    }

    /// Returns whether an endpoint (address with the direction in bit 7) is halted. It stays halted
    /// until the host clears it.
    pub(super) fn is_halted(&self, address: u8) -> bool {
        self.halted.contains(&address)
    }

    /// Halts an endpoint, as devices do on errors.
    pub(super) fn halt(&mut self, address: u8) {
        if !self.is_halted(address) {
            self.halted.push(address);
        }
    }

    /// Answers a request; `data` holds the bytes of its data stage.
    pub(super) fn control(&mut self, setup: Setup, data: &[u8]) -> Answer {
        let answer = match setup.kind & 0x60 {
            0x00 => self.standard(setup),
            0x20 => self.class(setup, data),
            _ => Answer::Stall,
        };
        match answer {
            Answer::Data(mut bytes) => {
                bytes.truncate(setup.length.into());
                Answer::Data(bytes)
            }
            Answer::Stall => Answer::Stall,
        }
    }

    fn standard(&mut self, setup: Setup) -> Answer {
        let [low, high] = setup.value.to_le_bytes();
        let [index, _] = setup.index.to_le_bytes();
        match (setup.kind, setup.request) {
            (Setup::STANDARD_IN, request::GET_DESCRIPTOR) => match self.descriptor(high, low) {
                Some(bytes) => Answer::Data(bytes),
                None => Answer::Stall,
            },
            (Setup::STANDARD_IN, request::GET_CONFIGURATION) => {
                Answer::Data(vec![self.configuration])
            }
            (Setup::STANDARD_OUT, request::SET_CONFIGURATION) if low <= 1 => {
                self.reset();
                self.configuration = low;
                self.events.push(Event::Stopped);
                DONE
            }
            // The bus handles SET_ADDRESS, and the link handles the latencies, so both are only
            // acknowledged.
            (
                Setup::STANDARD_OUT,
                request::SET_ADDRESS | request::SET_SEL | request::SET_ISOCH_DELAY,
            ) => DONE,
            (Setup::STANDARD_IN, request::GET_STATUS) => Answer::Data(vec![0, 0]),
            (Setup::INTERFACE_IN, request::GET_STATUS) if index < INTERFACES => {
                Answer::Data(vec![0, 0])
            }
            // The control endpoint is never halted.
            (Setup::ENDPOINT_IN, request::GET_STATUS) if index & 0x7F == 0 => {
                Answer::Data(vec![0, 0])
            }
            (Setup::ENDPOINT_IN, request::GET_STATUS) if ENDPOINTS.contains(&index) => {
                Answer::Data(vec![u8::from(self.is_halted(index)), 0])
            }
            (Setup::ENDPOINT_OUT, request::CLEAR_FEATURE)
                if setup.value == request::ENDPOINT_HALT && ENDPOINTS.contains(&index) =>
            {
                self.halted.retain(|halted| *halted != index);
                // Hosts end a bulk stream by clearing the halt of its endpoint.
                if index == 0x80 | VIDEO_IN && self.descriptors.transfer == Transfer::Bulk {
                    self.events.push(Event::Stopped);
                }
                DONE
            }
            (Setup::ENDPOINT_OUT, request::SET_FEATURE)
                if setup.value == request::ENDPOINT_HALT && ENDPOINTS.contains(&index) =>
            {
                self.halt(index);
                DONE
            }
            // Function suspend and U1/U2 (SuperSpeed), and remote wake-up, need no action.
            (
                Setup::STANDARD_OUT | Setup::INTERFACE_OUT,
                request::SET_FEATURE | request::CLEAR_FEATURE,
            ) => DONE,
            (Setup::INTERFACE_IN, request::GET_INTERFACE) if index < INTERFACES => {
                let streaming = index == VIDEO_STREAMING;
                Answer::Data(vec![if streaming { self.setting } else { 0 }])
            }
            (Setup::INTERFACE_OUT, request::SET_INTERFACE) => self.set_interface(index, low),
            _ => Answer::Stall,
        }
    }

    fn set_interface(&mut self, interface: u8, setting: u8) -> Answer {
        let most = match self.descriptors.transfer {
            Transfer::Isochronous if interface == VIDEO_STREAMING => 1,
            _ => 0,
        };
        if interface >= INTERFACES || setting > most {
            return Answer::Stall;
        }
        if interface == VIDEO_STREAMING {
            self.setting = setting;
            if setting == 0 {
                self.events.push(Event::Stopped);
            }
        }
        DONE
    }

    fn descriptor(&self, kind_of: u8, number: u8) -> Option<Vec<u8>> {
        let own = &self.descriptors;
        match (kind_of, number) {
            (kind::DEVICE, 0) => Some(own.device.clone()),
            (kind::CONFIGURATION, 0) => Some(own.configuration.clone()),
            (kind::STRING, number) => own.string(number),
            (kind::DEVICE_QUALIFIER, 0) => own.qualifier.clone(),
            (kind::OTHER_SPEED_CONFIGURATION, 0) => own.other_speed.clone(),
            (kind::BOS, 0) => own.bos.clone(),
            _ => None,
        }
    }

    fn class(&mut self, setup: Setup, data: &[u8]) -> Answer {
        let recipient_is_interface = setup.kind & 0x1F == 1;
        let [interface, entity] = setup.index.to_le_bytes();
        let [_, selector] = setup.value.to_le_bytes();
        if !recipient_is_interface {
            return Answer::Stall;
        }
        match interface {
            VIDEO_CONTROL => self.video_control(setup, entity, selector, data),
            VIDEO_STREAMING => self.video_streaming(setup, selector, data),
            SERIAL_CONTROL => self.serial(setup, data),
            _ => Answer::Stall,
        }
    }

    fn video_control(&mut self, setup: Setup, entity: u8, selector: u8, data: &[u8]) -> Answer {
        if (entity, selector) == (0, selector::REQUEST_ERROR_CODE) {
            return match setup.request {
                uvc::request::GET_CUR => Answer::Data(vec![self.last_error]),
                uvc::request::GET_INFO => Answer::Data(vec![1]),
                _ => Answer::Stall,
            };
        }
        let result = match (entity, selector) {
            (CAMERA_TERMINAL, selector::EXPOSURE_TIME_ABSOLUTE) => self.exposure(setup, data),
            (PROCESSING_UNIT, selector::GAIN) => self.gain(setup, data),
            // Entity 0 is the interface itself.
            (0 | CAMERA_TERMINAL | PROCESSING_UNIT, _) => Err(error_code::INVALID_CONTROL),
            _ => Err(error_code::INVALID_UNIT),
        };
        match result {
            Ok(bytes) => {
                self.last_error = error_code::NONE;
                Answer::Data(bytes)
            }
            Err(code) => {
                self.last_error = code;
                Answer::Stall
            }
        }
    }

    fn exposure(&mut self, setup: Setup, data: &[u8]) -> Result<Vec<u8>, u8> {
        let units = |ns: u64| (ns / uvc::EXPOSURE_UNIT_NS).max(1);
        let (min, max) = self.limits.exposure_ns;
        let range = Range {
            min: min.div_ceil(uvc::EXPOSURE_UNIT_NS).max(1),
            max: units(max),
            default: units(self.limits.default_exposure_ns),
            now: units(self.camera.exposure_ns),
            len: 4,
        };
        let (answer, set) = range.answer(setup.request, data)?;
        if let Some(units) = set {
            let longest = self.camera.settable_ns.ok_or(error_code::WRONG_STATE)?;
            // Drivers set exposures up to the limits of the range; like cameras do, clamp such an
            // exposure to the frame period.
            self.camera.exposure_ns = (units * uvc::EXPOSURE_UNIT_NS).min(longest);
            self.events.push(Event::Exposure(self.camera.exposure_ns));
        }
        Ok(answer)
    }

    fn gain(&mut self, setup: Setup, data: &[u8]) -> Result<Vec<u8>, u8> {
        let units = |db: f64| (db / uvc::GAIN_UNIT_DB).round() as u64;
        let range = Range {
            min: 0,
            max: units(self.limits.max_gain_db).min(u16::MAX.into()),
            default: 0,
            now: units(self.camera.gain_db).min(u16::MAX.into()),
            len: 2,
        };
        let (answer, set) = range.answer(setup.request, data)?;
        if let Some(units) = set {
            if self.camera.settable_ns.is_none() {
                return Err(error_code::WRONG_STATE);
            }
            self.camera.gain_db = (units as f64 * uvc::GAIN_UNIT_DB).min(self.limits.max_gain_db);
            self.events.push(Event::Gain(self.camera.gain_db));
        }
        Ok(answer)
    }

    fn video_streaming(&mut self, setup: Setup, selector: u8, data: &[u8]) -> Answer {
        if selector != selector::PROBE && selector != selector::COMMIT {
            return Answer::Stall;
        }
        let probing = selector == selector::PROBE;
        let slowest = *self.descriptors.intervals.last().unwrap_or(&1);
        match setup.request {
            uvc::request::SET_CUR => {
                let Some(wanted) = Negotiation::decode(data) else {
                    return Answer::Stall;
                };
                let agreed = self.agree(wanted);
                self.probe = agreed;
                if !probing {
                    self.committed = Some(agreed);
                    self.events.push(Event::Committed(agreed));
                }
                DONE
            }
            uvc::request::GET_CUR if probing => Answer::Data(self.probe.encode().into()),
            uvc::request::GET_CUR => {
                let agreed = self.committed.unwrap_or(self.probe);
                Answer::Data(agreed.encode().into())
            }
            uvc::request::GET_LEN => Answer::Data(vec![Negotiation::LEN as u8, 0]),
            uvc::request::GET_INFO => Answer::Data(vec![3]),
            uvc::request::GET_DEF | uvc::request::GET_MIN if probing => {
                Answer::Data(self.descriptors.default_negotiation().encode().into())
            }
            // All fields take their values from lists, so no field has a resolution.
            uvc::request::GET_RES if probing => Answer::Data(vec![0; Negotiation::LEN]),
            uvc::request::GET_MAX if probing => {
                let last = self.descriptors.modes.len() as u8;
                Answer::Data(self.descriptors.negotiation(last, slowest).encode().into())
            }
            _ => Answer::Stall,
        }
    }

    /// Returns the supported parameters that are closest to the parameters that the host wants.
    fn agree(&self, wanted: Negotiation) -> Negotiation {
        let distance = |interval: &u32| interval.abs_diff(wanted.interval);
        let intervals = self.descriptors.intervals.iter().copied();
        let interval = intervals.min_by_key(distance).unwrap_or(1);
        Negotiation {
            hint: wanted.hint,
            ..self.descriptors.negotiation(wanted.format, interval)
        }
    }

    fn serial(&mut self, setup: Setup, data: &[u8]) -> Answer {
        match setup.request {
            cdc::request::SET_LINE_CODING => match LineCoding::decode(data) {
                Some(line) => {
                    self.line = line;
                    self.events.push(Event::LineCoding(line));
                    DONE
                }
                None => Answer::Stall,
            },
            cdc::request::GET_LINE_CODING => Answer::Data(self.line.encode().into()),
            cdc::request::SET_CONTROL_LINE_STATE => {
                self.set_lines(HostLines::decode(setup.value));
                DONE
            }
            cdc::request::SEND_BREAK => {
                self.events.push(Event::Break(setup.value != 0));
                DONE
            }
            _ => Answer::Stall,
        }
    }

    fn set_lines(&mut self, lines: HostLines) {
        if lines != self.host_lines {
            self.host_lines = lines;
            self.events.push(Event::Lines(lines));
        }
    }
}

/// An integer that a control of the video class reads and sets.
struct Range {
    min: u64,
    max: u64,
    default: u64,
    now: u64,
    /// Size on the wire in bytes.
    len: usize,
}

impl Range {
    /// Returns the answer to a request and, for SET_CUR, the value to set.
    fn answer(&self, request: u8, data: &[u8]) -> Result<(Vec<u8>, Option<u64>), u8> {
        let bytes = |value: u64| value.to_le_bytes()[..self.len].to_vec();
        match request {
            uvc::request::GET_CUR => Ok((bytes(self.now), None)),
            uvc::request::GET_MIN => Ok((bytes(self.min), None)),
            uvc::request::GET_MAX => Ok((bytes(self.max), None)),
            uvc::request::GET_RES => Ok((bytes(1), None)),
            uvc::request::GET_DEF => Ok((bytes(self.default), None)),
            uvc::request::GET_LEN => Ok((vec![self.len as u8, 0], None)),
            uvc::request::GET_INFO => Ok((vec![3], None)),
            uvc::request::SET_CUR if data.len() == self.len => {
                let mut word = [0; 8];
                word[..self.len].copy_from_slice(data);
                let value = u64::from_le_bytes(word);
                if !(self.min..=self.max).contains(&value) {
                    return Err(error_code::OUT_OF_RANGE);
                }
                Ok((Vec::new(), Some(value)))
            }
            _ => Err(error_code::INVALID_REQUEST),
        }
    }
}
