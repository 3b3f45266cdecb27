// SPDX-License-Identifier: Apache-2.0
// The picture of what anchors give over the floor: dilution of precision, or anchors in view.
"use strict";

globalThis.CoveragePicture = (() => {
  const STEPS = [0.7, 0.8, 0.9, 1, 1.2, 1.5, 2, 3, 5, 10, 20]; // as of locfuse.plot.layout
  const RAMPS = {
    light: {dop: [[247, 251, 255], [171, 208, 230], [62, 142, 196], [8, 72, 140]],
            few: [[213, 94, 0], [233, 150, 84], [246, 205, 170]],
            many: [[236, 246, 241], [150, 208, 184]]},
    dark: {dop: [[30, 36, 43], [27, 62, 92], [33, 104, 155], [96, 176, 228]],
           few: [[190, 84, 8], [128, 66, 24], [78, 50, 34]],
           many: [[26, 46, 41], [24, 92, 72]]},
  };

  function mixed(ramp, share) {
    const at = Math.min(Math.max(share, 0), 1) * (ramp.length - 1);
    const k = Math.min(Math.floor(at), ramp.length - 2);
    return ramp[k].map((c, i) => Math.round(c + (at - k) * (ramp[k + 1][i] - c)));
  }

  const css = (rgb) => `rgb(${rgb.join(",")})`;

  return class CoveragePicture {
    constructor(buffer) {
      const length = new DataView(buffer).getUint32(0, true);
      this.head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
      const cells = this.head.columns * this.head.rows;
      this.levels = new Uint8Array(buffer, 4 + length, cells);
      this.seen = new Uint8Array(buffer, 4 + length + cells, cells);
      this.canvas = document.createElement("canvas");
      this.canvas.width = this.head.columns;
      this.canvas.height = this.head.rows;
    }

    dop_of(level) {
      const {best, none} = this.head;
      return level === 255 ? Infinity : best * (none / best) ** ((level - 0.5) / 253);
    }

    // What is at a point of the floor, or null beside it.
    at(x, y) {
      const {low, step_m, columns, rows} = this.head;
      const column = Math.round((x - low[0]) / step_m), row = Math.round((y - low[1]) / step_m);
      if (column < 0 || row < 0 || column >= columns || row >= rows) return null;
      const level = this.levels[row * columns + column];
      return level === 0 ? null : {dop: this.dop_of(level), seen: this.seen[row * columns + column]};
    }

    _band(dop) {
      const k = STEPS.findIndex((step) => dop < step);
      return k < 0 ? STEPS.length : k;
    }

    // Colours of all 256 values of a byte, for a mode ("dop" or "seen") and a theme.
    _colours(mode, theme) {
      const ramp = RAMPS[theme];
      return Array.from({length: 256}, (_, value) => {
        if (mode === "dop") return mixed(ramp.dop, (this._band(this.dop_of(value)) / STEPS.length) ** 0.75);
        return value < 3 ? ramp.few[value] : mixed(ramp.many, (value - 3) / 4);
      });
    }

    paint(mode, theme) {
      const {columns, rows} = this.head;
      const image = new ImageData(columns, rows);
      const pixels = new Uint32Array(image.data.buffer);
      const table = Uint32Array.from(this._colours(mode, theme),
        ([r, g, b]) => (255 << 24) | (b << 16) | (g << 8) | r);
      const values = mode === "dop" ? this.levels : this.seen;
      for (let row = 0; row < rows; row++) { // the picture's first row is that of the highest y
        const from = row * columns, to = (rows - 1 - row) * columns;
        for (let k = 0; k < columns; k++) {
          pixels[to + k] = this.levels[from + k] === 0 ? 0 : table[values[from + k]];
        }
      }
      this.canvas.getContext("2d").putImageData(image, 0, 0);
      this.legend = this._legend(mode, theme, values);
      return this.canvas;
    }

    _legend(mode, theme, values) {
      const there = new Set();
      for (let k = 0; k < values.length; k++) if (this.levels[k] !== 0) there.add(values[k]);
      const found = new Map();
      const colours = this._colours(mode, theme);
      for (const value of [...there].sort((a, b) => a - b)) {
        const band = mode === "dop" ? this._band(this.dop_of(value)) : Math.min(value, 7);
        const text = mode === "seen" ? (band === 7 && there.size > 8 ? "7+" : String(value))
          : band === 0 ? `< ${STEPS[0]}` : band === STEPS.length ? `> ${STEPS.at(-1)}`
          : `${STEPS[band - 1]}–${STEPS[band]}`;
        found.set(band, [css(colours[value]), text]);
      }
      return [...found.values()];
    }
  };
})();
