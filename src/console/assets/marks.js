// Marks over the camera's picture: points of a board, and how far a solution is from them.

export class Marks {
  constructor(canvas, picture) {
    this.canvas = canvas;
    this.picture = picture;
    this.groups = [];
  }

  /** Shows groups of `points` in pixels of an image of this `size`, each with a `colour` and a `radius`. The
   * third and fourth number of a point are its residual, which is drawn `enlarged` that many times. */
  show(size, groups, enlarged) {
    [this.size, this.groups, this.enlarged] = [size, groups, enlarged];
    this.draw();
  }

  draw() {
    const { canvas, picture } = this;
    const ratio = devicePixelRatio || 1;
    const [width, height] = [canvas.clientWidth, canvas.clientHeight];
    [canvas.width, canvas.height] = [width * ratio, height * ratio];
    const { image } = picture;
    // Marks of an image of another size have no place here.
    if (!image || image.width !== this.size?.[0] || image.height !== this.size?.[1]) {
      return;
    }
    const context = canvas.getContext("2d");
    context.scale(ratio, ratio);
    for (const { points, colour, radius } of this.groups) {
      [context.strokeStyle, context.fillStyle] = [colour, colour];
      context.beginPath();
      for (const [x, y, dx, dy] of points) {
        const at = picture.onScreen([x, y]);
        context.moveTo(at[0] + radius, at[1]);
        context.arc(...at, radius, 0, 2 * Math.PI);
        if (dx !== undefined) {
          context.moveTo(...at);
          context.lineTo(...picture.onScreen([x - this.enlarged * dx, y - this.enlarged * dy]));
        }
      }
      context.stroke();
    }
  }
}
