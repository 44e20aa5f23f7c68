//! The common commands of IEEE 488.2, `STATus`, `SYSTem`, `CALibration` and `DIAGnostic`.

use super::{Answer, say};
use crate::firmware::Firmware;
use crate::firmware::pending::Block;
use crate::firmware::table::Command;
use phasmid_protocol::scpi::{Args, ErrorCode, Quantity, Unit, encode_block};
use phasmid_protocol::usb::cdc::LineCoding;

impl Firmware {
    pub(super) fn common(&mut self, unit: &Unit, command: Command) -> Answer {
        let mut args = Args::new(&unit.params);
        match command {
            Command::Identify => {
                let id = &self.profile.identity;
                return say(format!(
                    "{},{},{},{}",
                    id.manufacturer, id.model, id.serial, id.firmware
                ));
            }
            Command::Reset => self.reset()?,
            Command::ClearStatus => {
                self.status.clear();
                self.completion_asked = false;
            }
            Command::EventEnable if unit.query => return say(self.status.event_enable),
            Command::EventEnable => {
                let value = args.number(Quantity::Plain)?.within(0.0, 255.0, 0.0)?;
                args.finish()?;
                self.status.event_enable = value.round() as u8;
            }
            Command::EventStatus => return say(self.status.take_event()),
            Command::OperationComplete if unit.query => self.block = Some(Block::Answer),
            Command::OperationComplete => {
                self.completion_asked = true;
                self.settle();
            }
            Command::ServiceEnable if unit.query => return say(self.status.service_enable),
            Command::ServiceEnable => {
                let value = args.number(Quantity::Plain)?.within(0.0, 255.0, 0.0)?;
                args.finish()?;
                // Bit 6 cannot be enabled (IEEE 488.2, 11.3.2.3).
                self.status.service_enable = value.round() as u8 & !(1 << 6);
            }
            Command::StatusByte => return say(self.status.byte(!self.answers.is_empty())),
            Command::SelfTest => return say(0),
            Command::Wait => self.block = Some(Block::Silent),
            Command::OperationEvent => return say(self.status.operation.take_event()),
            Command::OperationCondition => return say(self.status.operation.condition()),
            Command::QuestionableEvent => return say(self.status.questionable.take_event()),
            Command::QuestionableCondition => return say(self.status.questionable.condition()),
            Command::OperationEnable | Command::QuestionableEnable => {
                let register = match command {
                    Command::OperationEnable => &mut self.status.operation,
                    _ => &mut self.status.questionable,
                };
                if unit.query {
                    return say(register.enable);
                }
                let value = args.number(Quantity::Plain)?.within(0.0, 65535.0, 0.0)?;
                args.finish()?;
                // Bit 15 is not used (SCPI-1999 vol 1, 20).
                register.enable = value.round() as u16 & 0x7fff;
            }
            Command::Preset => self.status.preset(),
            Command::NextError => return say(self.status.next_error()),
            Command::ErrorCount => return say(self.status.error_count()),
            Command::Version => return say("1999.0"),
            Command::Baud => return say(self.line.baud),
            Command::DataBits => return say(self.line.data_bits),
            Command::Parity => return say(parity(self.line)),
            Command::StopBits => return say(stop_bits(self.line)),
            Command::Calibration => {
                let rig = self.reported_calibration();
                let rig = rig.map_err(|why| ErrorCode::CalibrationFailed.with(why))?;
                return Ok(Some(encode_block(rig.to_toml().as_bytes())));
            }
            _ => return say(self.next_id),
        }
        Ok(None)
    }
}

/// The SCPI-1999 name of the parity.
fn parity(line: LineCoding) -> &'static str {
    match line.parity {
        1 => "ODD",
        2 => "EVEN",
        3 => "ONE",
        4 => "ZERO",
        _ => "NONE",
    }
}

fn stop_bits(line: LineCoding) -> &'static str {
    match line.stop_bits {
        1 => "1.5",
        2 => "2",
        _ => "1",
    }
}
