// A picture of values by a table of colours, enlarged without interpolation.
//
// The canvas has one sample for each pixel of the camera. The browser enlarges it as it draws the page, which
// costs less than enlarging it here, above all without a GPU.

/** Largest enlargement, in screen pixels per pixel. */
const MAX_ZOOM = 64;

export class Picture {
  /** `moved` is called when the zoom has changed, `pointed` with the pixel under the pointer or null. */
  constructor(view, canvas, moved, pointed) {
    this.view = view;
    this.canvas = canvas;
    this.moved = moved;
    this.pointed = pointed;
    this.context = canvas.getContext("2d", { alpha: false });
    this.image = null;
    // Screen pixels per pixel; null fits the picture. The pixel in the middle.
    this.zoom = null;
    this.middle = [0, 0];
    /** Gets the two ends of a drag instead of moving the picture. */
    this.drawn = null;
    /** Moves by pixels of the picture when an arrow key is pressed, instead of moving the picture. */
    this.nudged = null;
    new ResizeObserver(() => this.place()).observe(view);
    view.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.enlarge(2 ** (-Math.sign(event.deltaY) / 2), this.pixelAt(event));
    }, { passive: false });
    view.addEventListener("pointerdown", (event) => {
      view.setPointerCapture(event.pointerId);
      this.begun = this.pixelAt(event);
    });
    view.addEventListener("pointermove", (event) => {
      if (event.buttons && this.image && this.drawn && this.begun) {
        this.drawn(this.begun, this.pixelAt(event));
      } else if (event.buttons && this.image) {
        this.move(-event.movementX / this.scale(), -event.movementY / this.scale());
      }
      this.point(event);
    });
    view.addEventListener("pointerleave", () => this.point(null));
    view.addEventListener("keydown", (event) => this.key(event));
  }

  /** Shows the colour of each index, row by row; indices past the table have its last colour. */
  show(width, height, indices, colours) {
    const resized = !this.image || this.image.width !== width || this.image.height !== height;
    if (resized) {
      this.canvas.width = width;
      this.canvas.height = height;
      this.image = new ImageData(width, height);
      this.samples = new Uint32Array(this.image.data.buffer);
    }
    const { samples } = this;
    const last = colours.length - 1;
    for (let i = 0; i < samples.length; i++) {
      const index = indices[i];
      samples[i] = colours[index < last ? index : last];
    }
    this.context.putImageData(this.image, 0, 0);
    if (resized) {
      this.place();
    }
    this.point(this.last);
  }

  /** Shows nothing. */
  clear() {
    [this.image, this.zoom] = [null, null];
    this.canvas.width = 0;
    this.point(null);
    this.moved();
  }

  /** Screen pixels per pixel at which the picture fits. */
  fitting() {
    return Math.min(this.view.clientWidth / this.image.width, this.view.clientHeight / this.image.height);
  }

  scale() {
    return this.zoom ?? this.fitting();
  }

  /** Puts the canvas where zoom and middle want it. */
  place() {
    if (!this.image) {
      return;
    }
    const { width, height } = this.image;
    if (this.zoom === null) {
      this.middle = [width / 2, height / 2];
    }
    const [left, top] = this.onScreen([0, 0]);
    this.canvas.style.transform = `translate(${left}px, ${top}px) scale(${this.scale()})`;
    this.moved();
  }

  /** Returns where a position in the picture is in the view, in screen pixels. */
  onScreen([x, y]) {
    const scale = this.scale();
    return [
      this.view.clientWidth / 2 + scale * (x - this.middle[0]),
      this.view.clientHeight / 2 + scale * (y - this.middle[1]),
    ];
  }

  /** Returns the position of a pointer in the picture; the first pixel reaches from 0 to 1. */
  pixelAt(event) {
    if (!this.image) {
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
    if (!this.image) {
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
    if (!this.image || this.zoom === null) {
      return;
    }
    const { width, height } = this.image;
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
    const inside = this.image && x >= 0 && y >= 0 && x < this.image.width && y < this.image.height;
    this.pointed(inside ? { x, y, index: y * this.image.width + x } : null);
  }

  key(event) {
    if (event.ctrlKey || event.metaKey || event.altKey || !this.image) {
      return;
    }
    const step = (0.1 * this.view.clientWidth) / this.scale();
    const arrow = (x, y) => () => (this.nudged ? this.nudged(x, y) : this.move(x * step, y * step));
    const done = {
      "+": () => this.enlarge(Math.SQRT2),
      "=": () => this.enlarge(Math.SQRT2),
      "-": () => this.enlarge(Math.SQRT1_2),
      0: () => this.fit(),
      ArrowLeft: arrow(-1, 0),
      ArrowRight: arrow(1, 0),
      ArrowUp: arrow(0, -1),
      ArrowDown: arrow(0, 1),
    }[event.key];
    if (done) {
      event.preventDefault();
      done();
    }
  }
}
