//! Absorption of blood.

/// Molar extinction coefficients of oxygenated and of deoxygenated haemoglobin in 1/(cm mol/l),
/// from 310 to 1000 nm in steps of 10 nm, compiled by Prahl from Gratzer and Kollias,
/// omlc.org/spectra/hemoglobin/summary.html.
#[rustfmt::skip]
const EXTINCTION: [[f64; 2]; 70] = [
    [63_352.0, 59_156.0],
    [78_752.0, 74_508.0],
    [97_512.0, 90_856.0],
    [107_884.0, 108_472.0],
    [106_576.0, 122_092.0],
    [94_744.0, 134_940.0],
    [88_176.0, 139_968.0],
    [109_564.0, 145_232.0],
    [167_748.0, 167_780.0],
    [266_232.0, 223_296.0],
    [466_840.0, 303_956.0],
    [480_360.0, 407_560.0],
    [246_072.0, 528_600.0],
    [102_580.0, 413_280.0],
    [62_816.0, 103_292.0],
    [44_480.0, 23_388.8],
    [33_209.2, 16_156.4],
    [26_629.2, 14_550.0],
    [23_684.4, 16_684.0],
    [20_932.8, 20_862.0],
    [20_035.2, 25_773.6],
    [24_202.4, 31_589.6],
    [39_956.8, 39_036.4],
    [53_236.0, 46_592.0],
    [43_016.0, 53_412.0],
    [32_613.2, 53_788.0],
    [44_496.0, 45_072.0],
    [50_104.0, 37_020.0],
    [14_400.8, 28_324.4],
    [3200.0, 14_677.2],
    [1506.0, 9443.6],
    [942.0, 6509.6],
    [610.0, 5148.8],
    [442.0, 4345.2],
    [368.0, 3750.12],
    [319.6, 3226.56],
    [294.0, 2795.12],
    [277.6, 2407.92],
    [276.0, 2051.96],
    [290.0, 1794.28],
    [314.0, 1540.48],
    [348.0, 1325.88],
    [390.0, 1102.2],
    [446.0, 1115.88],
    [518.0, 1405.24],
    [586.0, 1548.52],
    [650.0, 1311.88],
    [710.0, 1075.44],
    [756.0, 890.8],
    [816.0, 761.72],
    [864.0, 717.08],
    [916.0, 693.76],
    [974.0, 693.04],
    [1022.0, 692.36],
    [1058.0, 691.32],
    [1092.0, 694.32],
    [1128.0, 705.84],
    [1154.0, 726.44],
    [1178.0, 743.6],
    [1198.0, 761.84],
    [1214.0, 774.56],
    [1224.0, 777.36],
    [1222.0, 763.84],
    [1214.0, 693.44],
    [1204.0, 602.24],
    [1186.0, 525.56],
    [1162.0, 429.32],
    [1128.0, 359.656],
    [1080.0, 283.22],
    [1024.0, 206.784],
];
const FIRST_NM: f64 = 310.0;
const STEP_NM: f64 = 10.0;

/// Returns the absorption coefficient in 1/cm of whole blood with 150 g of haemoglobin (64,500
/// g/mol) per litre, of which the fraction `oxygenated` is oxygenated. Outside the wavelengths of
/// the table, its end values apply.
pub(super) fn absorption_per_cm(nm: f64, oxygenated: f64) -> f64 {
    let last = (EXTINCTION.len() - 1) as f64;
    let place = ((nm - FIRST_NM) / STEP_NM).clamp(0.0, last);
    let low = place as usize;
    let high = (low + 1).min(EXTINCTION.len() - 1);
    let of = |[oxy, deoxy]: [f64; 2]| oxygenated * oxy + (1.0 - oxygenated) * deoxy;
    let (a, b) = (of(EXTINCTION[low]), of(EXTINCTION[high]));
    let extinction = a + (b - a) * place.fract();
    std::f64::consts::LN_10 * extinction * 150.0 / 64_500.0
}
