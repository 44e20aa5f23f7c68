// Calibration: the board in the latest image, the poses so far, and the solution.

import { attempt } from "./requests.js";
import { saveText } from "./save.js";

/** Time between two looks for the board. */
const LOOK_MS = 300;
/** Colours on the picture: the board that is seen, the poses so far, the pose that is pointed at. */
const [SEEN, TAKEN, CHOSEN] = ["#56b4e9", "#e69f0099", "#ff4fa3"];
/** Largest length on the picture of a residual that equals their RMS, in pixels. */
const RESIDUAL_PX = 20;
const SIZES = { dots: ["pitch", "dot", "marker"], chess: ["pitch"] };

const $ = (id) => document.getElementById(id);

const number = (value, digits) => (value === undefined ? "" : value.toFixed(digits));

export class Calibration {
  /** `mark` draws groups of points over the picture. */
  constructor(requests, mark) {
    this.ask = (step) => requests.ask({ calibration: step });
    this.mark = mark;
    this.shown = false;
    this.clear();
    const change = (step) => attempt(async () => this.tell(await this.ask(step())));
    $("board-form").addEventListener("submit", (event) => {
      event.preventDefault();
      change(() => ({ board: this.board() }));
    });
    $("board-kind").addEventListener("change", () => this.offerSizes());
    $("pose-scan-once").addEventListener("click", () => {
      const sequence = $("pose-sequence").value.trim() || null;
      attempt(() => requests.ask({ scan: { run: "once", sequence } }));
    });
    $("pose-take").addEventListener("click", () => change(() => ({ take: {} })));
    $("poses-forget").addEventListener("click", () => change(() => ({ forget: {} })));
    $("rig-solve").addEventListener("click", () => this.solve());
    $("rig-save").addEventListener("click", () => this.state?.solution && saveText(this.state.solution.toml, "calibration.toml"));
    $("pose-rows").addEventListener("click", ({ target }) => {
      if (target.value) {
        change(() => ({ forget: { pose: Number(target.value) } }));
      }
    });
    $("pose-rows").addEventListener("pointerover", ({ target }) => this.choose(target.closest("tr")?.dataset.pose));
    $("pose-rows").addEventListener("pointerleave", () => this.choose(undefined));
    setInterval(() => this.look(), LOOK_MS);
  }

  clear() {
    this.state = null;
    this.sight = null;
    this.chosen = undefined;
    for (const id of ["board-seen", "covered", "pose-rows", "rig-summary", "rig-warnings", "rig-rows"]) {
      $(id).replaceChildren();
    }
    $("rig-save").disabled = true;
    this.draw();
  }

  /** Whether the panel is open. */
  show(shown) {
    const opened = shown && !this.shown;
    this.shown = shown;
    if (!shown) {
      this.clear();
    } else if (opened || !this.state) {
      attempt(async () => {
        const state = await this.ask({ state: {} });
        this.fill(state.board);
        this.tell(state);
      });
    }
  }

  /** Whether this viewer may change anything. */
  control(controls) {
    if (this.controls !== controls) {
      this.controls = controls;
      this.state && this.tell(this.state);
    }
  }

  offerSizes() {
    for (const size of SIZES.dots) {
      $(`board-${size}`).disabled = !SIZES[$("board-kind").value].includes(size);
    }
  }

  fill(board) {
    $("board-kind").value = board.pattern;
    [$("board-columns").value, $("board-rows").value] = [board.columns, board.rows];
    for (const size of SIZES[board.pattern]) {
      // A board that has been scaled has sizes like 9.600000000000001.
      $(`board-${size}`).value = Number(board[`${size}_mm`].toPrecision(9));
    }
    this.offerSizes();
  }

  board() {
    const pattern = $("board-kind").value;
    const sizes = SIZES[pattern].map((size) => [`${size}_mm`, Number($(`board-${size}`).value)]);
    return { pattern, columns: Number($("board-columns").value), rows: Number($("board-rows").value), ...Object.fromEntries(sizes) };
  }

  async look() {
    if (!this.shown || this.looking || document.hidden) {
      return;
    }
    this.looking = true;
    const seen = await this.ask({ look: {} }).catch(() => null);
    this.looking = false;
    if (!this.shown) {
      return;
    }
    if (seen && this.state && seen.changes !== this.state.changes) {
      // Another viewer has changed something.
      this.ask({ state: {} }).then((state) => this.tell(state), () => {});
    }
    const sight = seen?.sight ?? null;
    this.sight = sight;
    const where = sight?.scan ? "last scan" : "live picture";
    $("board-seen").textContent = !sight ? "no picture yet" : sight.why ? `${where}: ${sight.why}` : `${where}: ${sight.points.length} of ${sight.of} points`;
    $("board-seen").className = sight?.points.length ? "" : "bad";
    this.draw();
  }

  async solve() {
    $("rig-summary").textContent = "solving";
    await attempt(async () => this.tell(await this.ask({ solve: {} })));
    if (this.state && $("rig-summary").textContent === "solving") {
      this.tell(this.state);
    }
  }

  /** Shows the poses and the solution. */
  tell(state) {
    if (!this.shown) {
      return;
    }
    this.state = state;
    const { poses, solution } = state;
    $("covered").textContent = poses.length ? `${(100 * state.covered).toFixed(0)} % of the picture covered by ${poses.length === 1 ? "1 pose" : `${poses.length} poses`}` : "no poses yet";
    $("pose-rows").replaceChildren(...poses.map((pose) => {
      const row = document.createElement("tr");
      row.dataset.pose = pose.number;
      const cells = [
        `pose ${pose.number}`,
        pose.points.length,
        pose.lit,
        number(pose.solved?.distance_mm, 0),
        number(pose.solved?.tilt_deg, 0),
        number(pose.solved?.camera_rms_px, 3),
        number(pose.solved?.projector_rms_px, 3),
      ];
      row.append(...cells.map((text) => Object.assign(document.createElement("td"), { textContent: text })));
      const forget = Object.assign(document.createElement("button"), { textContent: "Forget", value: pose.number, disabled: !this.controls });
      const last = document.createElement("td");
      last.append(forget, ` ${pose.why ?? ""}`);
      row.append(last);
      return row;
    }));
    $("rig-save").disabled = !solution;
    $("rig-summary").textContent = solution
      ? `${solution.camera_rms_px.toFixed(3)} px RMS in the camera, ${solution.projector_rms_px.toFixed(3)} px in the projector${solution.fresh ? "" : "; the poses have changed since, solve again"}`
      : "";
    $("rig-warnings").textContent = solution?.warnings.join("\n") ?? "";
    $("rig-rows").replaceChildren(...(solution?.parameters ?? []).map(({ name, unit, value, sd }) => {
      const row = document.createElement("tr");
      const digits = Math.min(12, Math.max(0, 2 - Math.floor(Math.log10(sd))));
      const cells = [name, value.toFixed(digits), sd.toPrecision(2), unit];
      row.append(...cells.map((text) => Object.assign(document.createElement("td"), { textContent: text })));
      return row;
    }));
    this.draw();
  }

  choose(pose) {
    if (this.chosen !== pose) {
      this.chosen = pose;
      this.draw();
    }
  }

  draw() {
    const { state, sight } = this;
    const size = sight?.size ?? state?.size;
    const of = (poses, colour) => ({ points: poses.flatMap(({ points }) => points), colour, radius: 1.5 });
    const isChosen = ({ number }) => String(number) === this.chosen;
    const poses = state?.poses ?? [];
    const rms = state?.solution?.camera_rms_px;
    const enlarged = rms > 0 ? 10 ** Math.floor(Math.log10(RESIDUAL_PX / rms)) : 0;
    this.mark(size, [
      of(poses.filter((pose) => !isChosen(pose)), TAKEN),
      { points: sight?.points ?? [], colour: SEEN, radius: 4 },
      of(poses.filter(isChosen), CHOSEN),
    ], enlarged);
    $("residual-hint").textContent = enlarged ? `; lines from the points are residuals, enlarged ${enlarged} times` : "";
  }
}
