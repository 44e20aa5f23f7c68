//! What the study says at its head.

use phasmid_report::lab::{Block, Section, Settings};

/// What was done, and what is ours.
pub(super) fn section(settings: &Settings) -> Section {
    let mut blocks = vec![Block::Words(BENCH.to_owned())];
    if settings.quick {
        blocks.push(Block::Words(QUICK.to_owned()));
    }
    Section {
        title: "The bench".to_owned(),
        blocks,
    }
}

const BENCH: &str = "Wu et al., \"Virtual 3D surface imaging system for the validation of tumor \
    tracking algorithm used in surface-guided radiotherapy\", scan in a game engine; here their \
    bench is the profile pmp-bench: a camera of 1138 x 489 pixels behind a 20 mm lens on 36 mm, a \
    projector of 1920 x 1080, baseline 400 mm, 12 phase steps of 16 px (0.172 line pairs per mm at \
    1000 mm) and a Gray code, 8 bits, shot and read noise of an industrial camera. Camera (f/16) and \
    projector (5 mm of aperture) are focused at 1000 mm. Errors are of the true rig unless said \
    otherwise; the truth is exact, by ray casting in f64.";

const QUICK: &str = "The quick form: the camera's image is cut to what the object fills, pixel by \
    pixel the same, and the calibration has fewer poses.";

/// What the sections come to.
pub(super) fn trends() -> Section {
    Section {
        title: "Where the trends agree".to_owned(),
        blocks: [AGREE, NOT]
            .map(|words| Block::Words(words.to_owned()))
            .into(),
    }
}

const AGREE: &str = "They agree in these: errors that grow to both sides of 1000 mm, if f0 is held; \
    centre before rim before foot; left like right; errors of millimetres in light that drowns the \
    fringes; reprojection errors of hundredths of a pixel.";

const NOT: &str = "They do not in these. In size: where no constant is wrong, ours are some twenty \
    to ninety times smaller, because what is left is the camera's noise over twelve frames, and neither a \
    formula nor the spacing of points adds to it. In distances below 1000 mm, where the paper's errors \
    are less than the formula's. In the cross-section, which should err more than the whole. In the view \
    from the feet, which is hardly worse than the others here. In the \
    projector's light, which costs us coverage and not truth. In HD, which one wrong pixel decides.";
