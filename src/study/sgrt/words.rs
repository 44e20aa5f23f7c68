//! What a reader has to know.

pub(super) const COMPARED: &str = "Fifteen generated patients lie on the couch on the day of \
    treatment: set up by hand some millimetres and degrees off, breathing deeper or shallower than at \
    planning, drifting. The tracker knows the planning folder only: the skin, the tumour and ten \
    displacement fields of one breathing cycle. Three skins go into the same tracker: points of the true \
    skin, the same points with Gaussian noise of 0.5 mm along each axis, and the skin that the three pods \
    of the ceiling scan in turn, as a client decodes it, by cameras of 320 x 240 pixels. The truth is that of the middle of the scan. The \
    patients, the tracker and the scanner are ours, not the paper's, so that the figures stand \
    beside each other for their size only.";

pub(super) const POSITION: &str = "An ideal skin is not a tumour: what is left of the error with it is \
    what skin cannot say, the hysteresis between skin and tumour, breathing that is not planning's, and \
    the set-up, which the skin shows as well as its shape allows.";

pub(super) const TERMS: &str = "Each line compares two inputs at the same moments that differ in one \
    term: the scan while the patient breathes and one of a patient who stays as in its middle; that \
    and one of skin which no light enters; that and one by sensors without noise; that and the true skin \
    at the same pixels; that and all of the true skin. Together the lines lead from the ideal skin to \
    the scanned one, so that their sum is the difference in the table above.";
