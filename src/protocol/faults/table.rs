//! All fault kinds and their parameters.

use super::kind::{Kind, Parameter, Side, What};

const BY: Parameter = Parameter {
    name: "by_ms",
    default: "500",
    allowed: "0 to 3600000 ms",
};
const ROW: Parameter = Parameter {
    name: "row",
    default: "the middle row",
    allowed: "1 to 65535",
};
const GARBAGE: Parameter = Parameter {
    name: "count",
    default: "8",
    allowed: "1 to 4096 bytes",
};
const CAMERA: &[Side] = &[Side::Camera];
const PORT: &[Side] = &[Side::Port];

const fn kind(
    what: What,
    name: &'static str,
    sides: &'static [Side],
    parameters: &'static [Parameter],
    about: &'static str,
) -> Kind {
    Kind {
        what,
        name,
        sides,
        parameters,
        about,
    }
}

impl Kind {
    /// All fault kinds, frame faults first.
    pub const ALL: &'static [Self] = &[
        kind(
            What::Dropped,
            "dropped",
            CAMERA,
            &[],
            "the frame never arrives",
        ),
        kind(
            What::Repeated,
            "repeated",
            CAMERA,
            &[],
            "the frame arrives twice",
        ),
        kind(
            What::Late,
            "late",
            CAMERA,
            &[BY],
            "the frame arrives late, and those behind it wait",
        ),
        kind(
            What::Swapped,
            "swapped",
            CAMERA,
            &[Parameter {
                name: "by_ms",
                default: "1000",
                allowed: "0 to 3600000 ms",
            }],
            "the frame arrives after the next one, or after by_ms where none comes",
        ),
        kind(
            What::Torn,
            "torn",
            CAMERA,
            &[ROW],
            "from a row on, the frame is the one before it",
        ),
        kind(
            What::RowsMissing,
            "rows-missing",
            CAMERA,
            &[
                Parameter {
                    allowed: "0 to 65535",
                    ..ROW
                },
                Parameter {
                    name: "rows",
                    default: "8",
                    allowed: "1 to 65535",
                },
            ],
            "rows are missing, those below move up, and as many at the bottom are black",
        ),
        kind(
            What::BitsFlipped,
            "bits-flipped",
            CAMERA,
            &[Parameter {
                name: "count",
                default: "64",
                allowed: "1 to 1000000 bits",
            }],
            "bits anywhere in the frame, including the embedded data line, are flipped",
        ),
        kind(
            What::Dark,
            "dark",
            CAMERA,
            &[],
            "the projector's lamp is off",
        ),
        kind(
            What::WrongPattern,
            "wrong-pattern",
            CAMERA,
            &[Parameter {
                name: "offset",
                default: "1",
                allowed: "-4096 to 4096, not 0",
            }],
            "the projector shows the pattern that stands offset places further in the sequence",
        ),
        kind(
            What::PartialExposure,
            "partial-exposure",
            CAMERA,
            &[Parameter {
                name: "fraction",
                default: "0.5",
                allowed: "0 to 1",
            }],
            "the projector is lit for that fraction of the exposure",
        ),
        kind(
            What::NoReply,
            "no-reply",
            PORT,
            &[],
            "the reply never arrives",
        ),
        kind(
            What::LateReply,
            "late-reply",
            PORT,
            &[BY],
            "the reply arrives late, and those behind it wait",
        ),
        kind(
            What::ReplyTwice,
            "reply-twice",
            PORT,
            &[],
            "the reply arrives twice",
        ),
        kind(
            What::GarbageBefore,
            "garbage-before",
            PORT,
            &[GARBAGE],
            "random bytes arrive before the reply",
        ),
        kind(
            What::GarbageInside,
            "garbage-inside",
            PORT,
            &[GARBAGE],
            "random bytes arrive inside of the reply",
        ),
        kind(
            What::BitErrors,
            "bit-errors",
            PORT,
            &[
                Parameter {
                    name: "direction",
                    default: "to-host",
                    allowed: "to-device or to-host",
                },
                Parameter {
                    name: "count",
                    default: "1",
                    allowed: "1 to 4096 bits of a message",
                },
                Parameter {
                    name: "rate",
                    default: "a count instead",
                    allowed: "0 to 1 for each bit",
                },
            ],
            "bits of a message are flipped",
        ),
        kind(
            What::Nak,
            "nak",
            PORT,
            &[],
            "the command is refused as by a device that is busy, and not executed",
        ),
        kind(
            What::Disconnect,
            "disconnect",
            &[Side::Port, Side::Camera],
            &[Parameter {
                name: "for_ms",
                default: "1000",
                allowed: "0 to 3600000 ms",
            }],
            "the control port is gone for that long, and data in transit is lost",
        ),
        kind(
            What::Reset,
            "reset",
            &[Side::Camera, Side::Port],
            &[],
            "the device boots: settings, uploads and frames under way are gone",
        ),
    ];
}
