//! What was published of commercial systems. They measured other bodies by other means: the figures
//! give a size to ours and no more.

/// What we find, what of commercial systems is nearest to it, and where that is from.
#[derive(Debug, Clone, Copy)]
pub(super) struct Published {
    /// As published, with the unit.
    pub(super) figure: &'static str,
    /// Where, and what exactly was measured there.
    pub(super) source: &'static str,
}

pub(super) const SHIFTS: Published = Published {
    figure: "at most 0.3 mm, 0.2 deg",
    source: "Looe et al., arXiv:2604.00589 (2026): LUNA 3D, largest deviation of shifts of a phantom, \
             the reference surface captured by the system (0.8 mm with one from the CT)",
};

pub(super) const DRIFT: Published = Published {
    figure: "below 0.4 mm",
    source: "Looe et al., arXiv:2604.00589 (2026): LUNA 3D, drift with temperature, each axis",
};

pub(super) const NOISE: Published = Published {
    figure: "0.04 to 0.06 mm",
    source: "Liu et al., J Appl Clin Med Phys (2025), doi 10.1002/acm2.70138, and an abstract of the \
             AAPM's meeting of 2026 on the same system: LUNA 3D, RMS noise of the tracked shift of a \
             head phantom at rest, not of its points",
};

pub(super) const HIDDEN: Published = Published {
    figure: "0.50 and 0.80 mm",
    source: "J Appl Clin Med Phys (2023), PMC10562042: IDENTIFY, medians of the reported offsets of \
             patients with white and with black skin while the gantry hides a pod, the patients' own \
             motion among them",
};

pub(super) const HOLD: Published = Published {
    figure: "131 to 149 ms",
    source: "Naylor, Barlow and Papangelou, Phys Med (2025), doi 10.1016/j.ejmp.2025.105181: AlignRT \
             on TrueBeam and Versa HD, means of beam-hold latency from motion to dose, the linac's part \
             of it among them",
};
