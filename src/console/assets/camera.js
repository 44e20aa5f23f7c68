// The picture of a camera: the grey levels as they are, enlarged without interpolation.
//
// The canvas has one sample for each pixel of the camera. The browser enlarges it as it draws the page, which
// costs less than enlarging it here, above all without a GPU.

/** Largest enlargement, in screen pixels per pixel. */
const MAX_ZOOM = 64;
/** Colour of saturated pixels: red, green, blue. */
const SATURATED = [255, 158, 51];

/** Returns the colour of each level as a sample of an image. Levels from `white` on are marked if `marks`. */
function colours(white, marks) {
  const levels = Math.min(white, 0xffff);
  const bytes = new Uint8ClampedArray(4 * (levels + 1));
  for (let level = 0; level <= levels; level++) {
    const grey = (255 * level) / white;
    bytes.set(level < white || !marks ? [grey, grey, grey, 255] : [...SATURATED, 255], 4 * level);
  }
  return new Uint32Array(bytes.buffer);
}

export class Picture {
  /** `moved` is called when the zoom has changed, `pointed` with the pixel under the pointer or null. */
  constructor(view, canvas, moved, pointed) {
    this.view = view;
    this.canvas = canvas;
    this.moved = moved;
    this.pointed = pointed;
    this.context = canvas.getContext("2d", { alpha: false });
    this.frame = null;
    this.levels = null;
    // Screen pixels per pixel; null fits the picture. The pixel in the middle.
    this.zoom = null;
    this.middle = [0, 0];
    this.white = null;
    new ResizeObserver(() => this.place()).observe(view);
    view.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.enlarge(2 ** (-Math.sign(event.deltaY) / 2), this.pixelAt(event));
    }, { passive: false });
    view.addEventListener("pointerdown", (event) => view.setPointerCapture(event.pointerId));
    view.addEventListener("pointermove", (event) => {
      if (event.buttons && this.frame) {
        this.move(-event.movementX / this.scale(), -event.movementY / this.scale());
      }
      this.point(event);
    });
    view.addEventListener("pointerleave", () => this.point(null));
    view.addEventListener("keydown", (event) => this.key(event));
  }

  /** Shows a frame. */
  show(frame, levels) {
    const { width, height, shownWhite, guessed } = frame;
    const resized = !this.image || this.image.width !== width || this.image.height !== height;
    [this.frame, this.levels] = [frame, levels];
    if (resized) {
      this.canvas.width = width;
      this.canvas.height = height;
      this.image = new ImageData(width, height);
      this.samples = new Uint32Array(this.image.data.buffer);
    }
    if (this.white !== shownWhite) {
      this.white = shownWhite;
      this.colours = colours(shownWhite, !guessed);
    }
    const { samples, colours: table } = this;
    const last = table.length - 1;
    for (let i = 0; i < samples.length; i++) {
      const level = levels[i];
      samples[i] = table[level < last ? level : last];
    }
    this.context.putImageData(this.image, 0, 0);
    if (resized) {
      this.place();
    }
    this.point(this.last);
  }

  /** Shows nothing. */
  clear() {
    [this.frame, this.levels, this.image, this.white, this.zoom] = [null, null, null, null, null];
    this.canvas.width = 0;
    this.point(null);
    this.moved();
  }

  /** Screen pixels per pixel at which the picture fits. */
  fitting() {
    return Math.min(this.view.clientWidth / this.frame.width, this.view.clientHeight / this.frame.height);
  }

  scale() {
    return this.zoom ?? this.fitting();
  }

  /** Puts the canvas where zoom and middle want it. */
  place() {
    if (!this.frame) {
      return;
    }
    const { width, height } = this.frame;
    if (this.zoom === null) {
      this.middle = [width / 2, height / 2];
    }
    const scale = this.scale();
    const left = this.view.clientWidth / 2 - scale * this.middle[0];
    const top = this.view.clientHeight / 2 - scale * this.middle[1];
    this.canvas.style.transform = `translate(${left}px, ${top}px) scale(${scale})`;
    this.moved();
  }

  /** Returns the position of a pointer in the picture; the first pixel reaches from 0 to 1. */
  pixelAt(event) {
    if (!this.frame) {
      return null;
    }
    const box = this.view.getBoundingClientRect();
    const scale = this.scale();
    return [
      this.middle[0] + (event.clientX - box.left - this.view.clientWidth / 2) / scale,
      this.middle[1] + (event.clientY - box.top - this.view.clientHeight / 2) / scale,
    ];
  }

  /** Enlarges by a factor; the position `about` stays where it is. */
  enlarge(factor, about) {
    if (!this.frame) {
      return;
    }
    const [before, least] = [this.scale(), this.fitting()];
    const after = Math.min(before * factor, Math.max(MAX_ZOOM, least));
    if (after <= least) {
      this.fit();
      return;
    }
    const [x, y] = about ?? this.middle;
    const part = before / after;
    this.middle = [x + (this.middle[0] - x) * part, y + (this.middle[1] - y) * part];
    this.zoom = after;
    this.move(0, 0);
  }

  /** Moves the view by pixels of the picture; its middle stays on the picture. */
  move(x, y) {
    if (!this.frame || this.zoom === null) {
      return;
    }
    const { width, height } = this.frame;
    this.middle = [
      Math.min(Math.max(this.middle[0] + x, 0), width),
      Math.min(Math.max(this.middle[1] + y, 0), height),
    ];
    this.place();
  }

  fit() {
    this.zoom = null;
    this.place();
  }

  point(event) {
    this.last = event;
    const at = event && this.pixelAt(event);
    const [x, y] = at ? at.map(Math.floor) : [-1, -1];
    const inside = this.frame && x >= 0 && y >= 0 && x < this.frame.width && y < this.frame.height;
    this.pointed(inside ? { x, y, level: this.levels[y * this.frame.width + x] } : null);
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || !this.frame) {
      return;
    }
    const step = (0.1 * this.view.clientWidth) / this.scale();
    const done = {
      "+": () => this.enlarge(Math.SQRT2),
      "=": () => this.enlarge(Math.SQRT2),
      "-": () => this.enlarge(Math.SQRT1_2),
      0: () => this.fit(),
      ArrowLeft: () => this.move(-step, 0),
      ArrowRight: () => this.move(step, 0),
      ArrowUp: () => this.move(0, -step),
      ArrowDown: () => this.move(0, step),
    }[event.key];
    if (done) {
      event.preventDefault();
      done();
    }
  }
}
