//! What a reader has to know.

pub(super) const WHAT: &str = "A clinic accepts a surface-guidance system by phantoms on a couch whose \
    displacements are known. This is that suite for the three pods of the ceiling, the decoder and the \
    rigid tracker, all of it as a client of the ports has it. Calibration and couch are exact here but \
    for the pods of the section on their frame, so that what is left is what pods and tracker do. The published figures are of other systems, bodies \
    and ways of measuring; they stand beside ours for their size.";

pub(super) const KNOWN: &str = "The torso is opaque, as phantoms are. The patient holds the breath at \
    the reference phase; light goes into the skin, and what comes out of it elsewhere shifts what is measured by some \
    tenths of a millimetre, so that against the planned surface there is an error that is the same in all \
    scans. Against a surface that the scanner has captured itself it cancels.";

pub(super) const FRAME: &str = "In all other sections pods are what their profile says and stand where \
    the station says. Here each is built with errors of its own (projector and focal length) and hangs a \
    millimetre or so from its place. A board in many poses calibrates each pod, as `phasmid calibrate` \
    does; a board at the isocentre, seen by all of them, tells where each stands, as `phasmid locate` does. \
    What is left is beside what it would be without either, and beside pods that are known exactly.";

pub(super) const DRIFT: &str = "Fading light dims the fringes and moves no phase. What moves a \
    scanner in clinics is heat: as an example the beam between camera and projector of each pod, of \
    aluminium, grows by 5 K, to which the calibration is blind. Both are examples of ours, as is how fast \
    they go.";

pub(super) const HIDDEN: &str = "The head of the linac rotates about the couch's axis; under the couch, \
    at 180 degrees, it hides nothing. The pod over the foot end is never hidden from the isocentre. At \
    some angles the head takes from a pod the far side of the chest only.";

pub(super) const PHANTOMS: &str = "A flat board slides and turns in its plane, a sphere turns about its \
    centre, a cylinder slides along its axis and turns about it, and no surface scanner sees it. An \
    answer that does not say so is wrong, whatever its figures. What the shape does determine has to be \
    right all the same.";

pub(super) const REGION: &str = "A small region is flat: shifts along it and turns about axes in it are \
    poorly known or not at all, and the tracker has to say so. The deviations beside the errors are those \
    of noise; what `phasmid track` adds to them for light in the skin is not in them.";

pub(super) const TONES: &str = "Dark skin returns less light: more noise, fewer points. It also lets \
    less light come back from below, so that the error which all scans share need not grow with it.";

pub(super) const HOLD: &str = "The projectors take turns, so that a jump in the middle of a scan is \
    seen by the pods that come after it, and only the next scan has it whole. How soon the beam is held \
    depends on when in a scan the patient moves.";

pub(super) const LATENCY: &str = "Latency is device time, in which the emulated device tells it, plus \
    the host's time, which is measured. A patient breathes before pods of full resolution; each scan is \
    tracked from the answer to the one before, rigidly and by the motion model, by what `phasmid track` \
    uses: the frames are held against their sequence, and of the pixels every second of every second row \
    is decoded, which leaves several times the points that are fitted. The frames of a pod are looked at \
    while the next one scans, so that only the last one's are left when the last frame has come; what a \
    host takes for all of a scan says how many it keeps up with. Frames are in memory: what a link takes to \
    carry them is in the study `speed`. The quick form runs beside other tests, and is not held to times.";
