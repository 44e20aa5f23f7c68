//! The built-in profiles, scenes, stations, dialects and patients, embedded.

/// `dialects/dlpc350.toml`.
pub const DIALECTS_DLPC350: &str = include_str!("dialects/dlpc350.toml");
/// `dialects/okline.toml`.
pub const DIALECTS_OKLINE: &str = include_str!("dialects/okline.toml");
/// `dialects/scpi.toml`.
pub const DIALECTS_SCPI: &str = include_str!("dialects/scpi.toml");
/// `dlp-evm.toml`.
pub const DLP_EVM: &str = include_str!("dlp-evm.toml");
/// `faults/bad-day.toml`.
pub const FAULTS_BAD_DAY: &str = include_str!("faults/bad-day.toml");
/// `patients/p01-woman-mean.toml`.
pub const PATIENTS_P01_WOMAN_MEAN: &str = include_str!("patients/p01-woman-mean.toml");
/// `patients/p02-man-mean.toml`.
pub const PATIENTS_P02_MAN_MEAN: &str = include_str!("patients/p02-man-mean.toml");
/// `patients/p03-man-slim.toml`.
pub const PATIENTS_P03_MAN_SLIM: &str = include_str!("patients/p03-man-slim.toml");
/// `patients/p04-woman-slim.toml`.
pub const PATIENTS_P04_WOMAN_SLIM: &str = include_str!("patients/p04-woman-slim.toml");
/// `patients/p05-woman-obese.toml`.
pub const PATIENTS_P05_WOMAN_OBESE: &str = include_str!("patients/p05-woman-obese.toml");
/// `patients/p06-man-obese.toml`.
pub const PATIENTS_P06_MAN_OBESE: &str = include_str!("patients/p06-man-obese.toml");
/// `patients/p07-child.toml`.
pub const PATIENTS_P07_CHILD: &str = include_str!("patients/p07-child.toml");
/// `patients/p08-woman-mastectomy.toml`.
pub const PATIENTS_P08_WOMAN_MASTECTOMY: &str = include_str!("patients/p08-woman-mastectomy.toml");
/// `patients/p09-man-tall.toml`.
pub const PATIENTS_P09_MAN_TALL: &str = include_str!("patients/p09-man-tall.toml");
/// `patients/p10-woman-short.toml`.
pub const PATIENTS_P10_WOMAN_SHORT: &str = include_str!("patients/p10-woman-short.toml");
/// `patients/p11-man-heavy.toml`.
pub const PATIENTS_P11_MAN_HEAVY: &str = include_str!("patients/p11-man-heavy.toml");
/// `patients/p12-woman-full-chest.toml`.
pub const PATIENTS_P12_WOMAN_FULL_CHEST: &str = include_str!("patients/p12-woman-full-chest.toml");
/// `patients/p13-man-shallow.toml`.
pub const PATIENTS_P13_MAN_SHALLOW: &str = include_str!("patients/p13-man-shallow.toml");
/// `patients/p14-man-deep.toml`.
pub const PATIENTS_P14_MAN_DEEP: &str = include_str!("patients/p14-man-deep.toml");
/// `patients/p15-woman-restless.toml`.
pub const PATIENTS_P15_WOMAN_RESTLESS: &str = include_str!("patients/p15-woman-restless.toml");
/// `pmp-bench.toml`.
pub const PMP_BENCH: &str = include_str!("pmp-bench.toml");
/// `pmp-real.toml`.
pub const PMP_REAL: &str = include_str!("pmp-real.toml");
/// `scenes/board.toml`.
pub const SCENES_BOARD: &str = include_str!("scenes/board.toml");
/// `scenes/couch.toml`.
pub const SCENES_COUCH: &str = include_str!("scenes/couch.toml");
/// `scenes/plane.toml`.
pub const SCENES_PLANE: &str = include_str!("scenes/plane.toml");
/// `scenes/sphere.toml`.
pub const SCENES_SPHERE: &str = include_str!("scenes/sphere.toml");
/// `scenes/torso.toml`.
pub const SCENES_TORSO: &str = include_str!("scenes/torso.toml");
/// `scenes/trapezoid.toml`.
pub const SCENES_TRAPEZOID: &str = include_str!("scenes/trapezoid.toml");
/// `scenes/treatment-room-board.toml`.
pub const SCENES_TREATMENT_ROOM_BOARD: &str = include_str!("scenes/treatment-room-board.toml");
/// `scenes/treatment-room-head.toml`.
pub const SCENES_TREATMENT_ROOM_HEAD: &str = include_str!("scenes/treatment-room-head.toml");
/// `scenes/treatment-room.toml`.
pub const SCENES_TREATMENT_ROOM: &str = include_str!("scenes/treatment-room.toml");
/// `sgrt-pod.toml`.
pub const SGRT_POD: &str = include_str!("sgrt-pod.toml");
/// `stations/sgrt-ceiling.toml`.
pub const STATIONS_SGRT_CEILING: &str = include_str!("stations/sgrt-ceiling.toml");
/// `stations/two-pods.toml`.
pub const STATIONS_TWO_PODS: &str = include_str!("stations/two-pods.toml");
/// `webcam-grey.toml`.
pub const WEBCAM_GREY: &str = include_str!("webcam-grey.toml");
