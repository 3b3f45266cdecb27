// SPDX-License-Identifier: Apache-2.0
// Plays runs packed by locfuse.report.player.pack: one global class, LocfusePlayer, no library, no network.
//
//   const player = new LocfusePlayer(element, [packed, ...], {controls: true, theme: "auto"});
//   player.show([packed, ...]); player.play(2); player.pause(); player.step(-1); player.seek(12.5);
//   player.time, playing, speed, duration, frames_per_s; player.pose(run), player.true_pose(run)
//   player.show([...], true); player.grow([...], more); player.more, live; player.go_live()
//   const off = player.on("time" | "play" | "pause" | "end", callback); player.destroy();
//
// While runs are being computed, `grow` adds `more` and the view stays: play waits at the end, or
// follows the newest row while live, until the user pauses or seeks.
// Times are seconds since the first run's first message, lengths metres, angles radians.
"use strict";

globalThis.LocfusePlayer = (() => {
  // Colours of locfuse.report.palette; the same hues on a dark page.
  const PALETTES = {
    light: {
      ground: "#ffffff", ink: "#222222", muted: "#6b6b6b", grid: "#e4e4e4", unknown: "#e4e4e4",
      wall: "#6b6b6b", truth: "#222222", rejected: "#D55E00", anchor: "#009E73", scan: "#B0407F",
      band: "#cfe3f1", future: "rgba(255,255,255,0.55)",
      runs: ["#0072B2", "#CC79A7", "#E69F00", "#56B4E9", "#7A5195", "#8C6D31"],
      states: {initializing: "#d9d9d9", ok: "#cdeadd", degraded: "#f3e6b3", ambiguous: "#ead1e3",
               dead_reckoning: "#f6d3b0", lost: "#f0a58a"},
    },
    dark: {
      ground: "#1b1e22", ink: "#e8eaec", muted: "#a3abb3", grid: "#2e3338", unknown: "#2a2e33",
      wall: "#8d959d", truth: "#f2f2f2", rejected: "#ff8a3d", anchor: "#35c79a", scan: "#e58cc0",
      band: "#1f3f56", future: "rgba(27,30,34,0.6)",
      runs: ["#56B4E9", "#e08fbd", "#E69F00", "#a6d4f0", "#b79ad6", "#cdb06b"],
      states: {initializing: "#4a4f55", ok: "#1f5443", degraded: "#5f5320", ambiguous: "#573b50",
               dead_reckoning: "#6b4526", lost: "#843a22"},
    },
  };
  const SPEEDS = [0.1, 0.25, 0.5, 1, 2, 5, 10, 20, 50, 100];
  const LAYERS = [
    ["truth", "truth"], ["trail", "estimate"], ["ellipse", "ellipse"], ["scan", "scan"],
    ["particles", "particles"], ["ranges", "ranges"], ["fixes", "fixes"], ["map", "map"],
  ];
  const TURNED_DOWN = ["gated", "not_modelled", "implausible"];
  const LONGEST_GAP_S = 2.0; // poses are not interpolated over longer gaps
  const BUTTONS = 44; // pixels at the right of the world
  const PAPER = 720; // width of the world on paper, in pixels
  const LABEL = 15; // pixels above a strip
  const TRAIL_S = 120; // for which a trail is strong
  const KEPT_S = 2; // after which its picture is drawn anew
  const MESSAGE_S = 0.6; // for which a message is seen
  const FONT = "system-ui, -apple-system, 'Segoe UI', sans-serif";
  const TYPES = {f64: Float64Array, f32: Float32Array, u32: Uint32Array, u16: Uint16Array,
                 u8: Uint8Array};

  // Data ----------------------------------------------------------------------------------------

  function decoded(value) {
    const type = Object.keys(TYPES).find((name) => name in value);
    if (type === undefined) return value;
    const text = atob(value[type]);
    const bytes = new Uint8Array(text.length);
    for (let k = 0; k < text.length; k++) bytes[k] = text.charCodeAt(k);
    return new TYPES[type](bytes.buffer);
  }

  function table(packed) {
    if (!packed) return null;
    const is_array = (value) => value && typeof value === "object" && "shape" in value;
    return Object.fromEntries(Object.entries(packed).map(
      ([name, value]) => [name, is_array(value) ? decoded(value) : value]));
  }

  // The last row whose time is not after t, or -1.
  function row_at(times, t) {
    let low = 0, high = times.length;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (times[middle] <= t) low = middle + 1; else high = middle;
    }
    return low - 1;
  }

  function wrapped(angle) {
    return angle - 2 * Math.PI * Math.floor((angle + Math.PI) / (2 * Math.PI));
  }

  function median_step(times) {
    if (times.length < 2) return 1;
    const steps = Array.from(times.slice(1, 2000), (t, k) => t - times[k]).sort((a, b) => a - b);
    return steps[steps.length >> 1];
  }

  function pose_of(track, t) {
    if (!track || track.t.length === 0) return null;
    const row = row_at(track.t, t);
    if (row < 0) return null;
    const next = Math.min(row + 1, track.t.length - 1);
    const gap = track.t[next] - track.t[row];
    const held = next === row || gap > Math.max(LONGEST_GAP_S, 3 * track.step);
    if (next === row && t - track.t[row] > LONGEST_GAP_S) return null;
    const share = held ? 0 : (t - track.t[row]) / gap;
    const turn = wrapped(track.heading[next] - track.heading[row]);
    return {
      row,
      x: track.x[row] + share * (track.x[next] - track.x[row]),
      y: track.y[row] + share * (track.y[next] - track.y[row]),
      heading: share === 0 ? track.heading[row] : wrapped(track.heading[row] + share * turn),
    };
  }

  class Run {
    constructor(packed, base) {
      this.packed = packed;
      this.name = packed.name;
      this.visible = true;
      for (const name of ["estimate", "truth", "errors", "health", "scans", "messages",
                          "particles"]) {
        this[name] = table(packed[name]);
      }
      for (const track of [this.estimate, this.truth]) {
        if (track) track.step = median_step(track.t);
      }
      if (this.scans) this.scans.step = median_step(this.scans.t);
      if (this.particles) this.particles.step = median_step(this.particles.t);
      // Runs of one recording may begin at different messages; others all begin at 0.
      const after = Number(BigInt(packed.start_ns) - BigInt(base.start_ns)) / 1e9;
      const overlap = after < base.end && after + packed.end > 0;
      this._move(overlap ? after : 0);
      this.groups = this._groups();
    }

    _move(after) {
      this.start = this.packed.start + after;
      this.end = this.packed.end + after;
      for (const part of [this.estimate, this.truth, this.errors, this.health, this.scans,
                          this.messages, this.particles]) {
        if (part && after !== 0) for (let k = 0; k < part.t.length; k++) part.t[k] += after;
      }
      this.events = this.packed.events.map((event) => ({...event, t: event.t + after}));
    }

    // Rows of messages that were compared with a prediction, by source and degrees of freedom.
    _groups() {
      const groups = new Map();
      const {source, dof, nis, verdict} = this.messages;
      this.turned_down = [];
      for (let row = 0; row < source.length; row++) {
        const from = this.packed.sources[source[row]];
        if (from !== "scans" && TURNED_DOWN.includes(this.packed.verdicts[verdict[row]][0])) {
          this.turned_down.push(row); // scans are not listed
        }
        if (dof[row] === 0 || !Number.isFinite(nis[row])) continue;
        const key = `${from}|${dof[row]}`;
        if (!groups.has(key)) groups.set(key, []);
        groups.get(key).push(row);
      }
      this.turned_down_t = Float64Array.from(this.turned_down, (row) => this.messages.t[row]);
      return groups;
    }

    verdict(row) { return this.packed.verdicts[this.messages.verdict[row]][0]; }
    source(row) { return this.packed.sources[this.messages.source[row]]; }
    who(row) { return this.packed.names[this.messages.who[row]]; }

    // The verdict on a message as a sentence.
    sentence(row) {
      const kind = {ranges: "anchor", landmark_sightings: "landmark"}[this.source(row)];
      const who = this.who(row);
      const named = kind && who.toLowerCase().startsWith(kind) ? who : `${kind} ${who}`;
      const subject = who && kind ? named : this.source(row).replaceAll("_", " ");
      const verdict = this.packed.verdicts[this.messages.verdict[row]][1];
      const reason = this.packed.reasons[this.messages.reason[row]]
        .replace("{nis}", rounded(this.messages.nis[row]));
      return `${subject}: ${reason || verdict}`;
    }
  }

  function rounded(value) {
    if (!Number.isFinite(value)) return "-";
    return Math.abs(value) >= 1000 ? value.toFixed(0) : value.toPrecision(3);
  }

  // Page ----------------------------------------------------------------------------------------

  function make(tag, attributes = {}, ...children) {
    const element = document.createElement(tag);
    for (const [name, value] of Object.entries(attributes)) {
      if (name.startsWith("on")) element.addEventListener(name.slice(2), value);
      else element.setAttribute(name, value);
    }
    element.append(...children);
    return element;
  }

  // Signs as lines, which look the same with any font.
  const ICONS = {
    play: "M5 3 L13 8 L5 13 Z", pause: "M4 3h3v10h-3z M9 3h3v10h-3z",
    back: "M3 3v10 M13 3 L6 8 L13 13 Z", on: "M13 3v10 M3 3 L10 8 L3 13 Z",
    plus: "M8 3v10 M3 8h10", minus: "M3 8h10",
    all: "M3 6v-3h3 M10 3h3v3 M13 10v3h-3 M6 13h-3v-3",
    follow: "M8 1v4 M8 11v4 M1 8h4 M11 8h4 M8 4a4 4 0 1 0 .01 0",
  };

  function icon(name) {
    const holder = document.createElement("template");
    holder.innerHTML = `<svg viewBox="0 0 16 16" aria-hidden="true"><path d="${ICONS[name]}"/></svg>`;
    return holder.content;
  }

  function sized(canvas, width, height, ratio) {
    const [w, h] = [Math.max(1, Math.round(width * ratio)), Math.max(1, Math.round(height * ratio))];
    if (canvas.width !== w || canvas.height !== h) {
      canvas.width = w;
      canvas.height = h;
    }
    const context = canvas.getContext("2d");
    context.setTransform(ratio, 0, 0, ratio, 0, 0);
    return context;
  }

  function rgb(colour) {
    return [1, 3, 5].map((k) => parseInt(colour.slice(k, k + 2), 16));
  }

  // A colour as a picture's pixels hold it, on every machine that runs a browser.
  function packed_colour(colour, opacity) {
    const [red, green, blue] = rgb(colour);
    return ((Math.round(255 * opacity) << 24) | (blue << 16) | (green << 8) | red) >>> 0;
  }

  // The step of a grid or axis, 1, 2 or 5 times a power of ten, that gives at most `most` lines.
  function nice_step(length, most) {
    const rough = length / Math.max(most, 1);
    const power = 10 ** Math.floor(Math.log10(rough));
    return power * [1, 2, 5, 10].find((factor) => factor * power >= rough);
  }

  function clock(seconds) {
    return `${seconds.toFixed(seconds < 1000 ? 2 : 1)} s`;
  }

  // World ---------------------------------------------------------------------------------------

  class World {
    constructor(canvas, player) {
      this.canvas = canvas;
      this.player = player;
      this.still = document.createElement("canvas");
      this.trails = document.createElement("canvas");
      this.dots = document.createElement("canvas");
      this.version = 0;
      this.follow = false;
      this.grid = null;
    }

    load() {
      const map = this.player.runs[0].packed.map;
      this.grid = null;
      this.fitted = true;
      this.grow();
      if (!map) return;
      const image = new Image();
      image.onload = () => {
        this.grid = image;
        this.tint();
        this.player.redraw(true);
      };
      image.src = map.png;
    }

    // Takes in new rows; a view of a part stays where it is.
    grow() {
      this.box = this._box();
      if (this.fitted) this.fit();
    }

    // Gives the map the colours of the theme.
    tint() {
      if (!this.grid) return;
      const {ground, unknown, wall} = this.player.palette;
      const [free, dim, dark] = [ground, unknown, wall].map(rgb);
      this.map = document.createElement("canvas");
      this.map.width = this.grid.width;
      this.map.height = this.grid.height;
      const context = this.map.getContext("2d", {willReadFrequently: true});
      context.drawImage(this.grid, 0, 0);
      const pixels = context.getImageData(0, 0, this.map.width, this.map.height);
      for (let k = 0; k < pixels.data.length; k += 4) {
        const grey = pixels.data[k];
        pixels.data.set(grey < 64 ? dark : grey > 192 ? free : dim, k);
      }
      context.putImageData(pixels, 0, 0);
    }

    // The box of paths, places, and the map unless it is far larger.
    _box() {
      const box = {x0: Infinity, y0: Infinity, x1: -Infinity, y1: -Infinity};
      const add = (x, y) => {
        if (!Number.isFinite(x) || !Number.isFinite(y)) return;
        box.x0 = Math.min(box.x0, x); box.x1 = Math.max(box.x1, x);
        box.y0 = Math.min(box.y0, y); box.y1 = Math.max(box.y1, y);
      };
      for (const run of this.player.runs) {
        for (const [x, y] of run.packed.mapped || []) add(x, y);
        for (const track of [run.estimate, run.truth]) {
          if (track) for (let k = 0; k < track.t.length; k++) add(track.x[k], track.y[k]);
        }
      }
      const {anchors, landmarks, walls, map} = this.player.runs[0].packed;
      for (const [x, y] of [...Object.values(anchors), ...Object.values(landmarks)]) add(x, y);
      for (const [x1, y1, x2, y2] of walls) { add(x1, y1); add(x2, y2); }
      if (map) {
        const [x, y, yaw] = map.origin;
        const size = [map.width * map.resolution_m, map.height * map.resolution_m];
        const path = Math.max(box.x1 - box.x0, box.y1 - box.y0, 1);
        if (Math.max(...size) < 2.5 * path) {
          const [c, s] = [Math.cos(yaw), Math.sin(yaw)];
          for (const [u, v] of [[0, 0], [size[0], 0], [0, size[1]], size]) {
            add(x + c * u - s * v, y + s * u + c * v);
          }
        }
      }
      if (box.x0 > box.x1) return {x0: -1, y0: -1, x1: 1, y1: 1};
      const rim = 0.06 * Math.max(box.x1 - box.x0, box.y1 - box.y0, 1);
      return {x0: box.x0 - rim, y0: box.y0 - rim, x1: box.x1 + rim, y1: box.y1 + rim};
    }

    resize(width, most_height) {
      const shape = (this.box.y1 - this.box.y0) / (this.box.x1 - this.box.x0);
      const height = Math.round(Math.min(Math.max((width - BUTTONS) * shape, 220), most_height));
      if (width === this.width && height === this.height) return;
      const fitted = this.fitted !== false;
      [this.width, this.height] = [width, height];
      this.canvas.style.height = `${height}px`;
      if (fitted) this.fit(); else this.version++;
    }

    fit() {
      this.fitted = true;
      this.follow = false;
      this.cx = (this.box.x0 + this.box.x1) / 2;
      this.cy = (this.box.y0 + this.box.y1) / 2;
      const [width, height] = [this.width || 600, this.height || 400];
      this.scale = Math.min((width - BUTTONS) / (this.box.x1 - this.box.x0),
                            height / (this.box.y1 - this.box.y0));
      this.cx += BUTTONS / 2 / this.scale;
      this.version++;
    }

    zoom(factor, px = this.width / 2, py = this.height / 2) {
      const [x, y] = this.to_world(px, py);
      this.scale = Math.min(Math.max(this.scale * factor, 1e-3), 1e5);
      this.cx = x - (px - this.width / 2) / this.scale;
      this.cy = y + (py - this.height / 2) / this.scale;
      this.fitted = false;
      this.version++;
    }

    // Puts the robot in the middle, large.
    centre(pose) {
      if (this.fitted) this.zoom(2.5);
      if (pose) [this.cx, this.cy] = [pose.x, pose.y];
      this.version++;
    }

    pan(dx, dy) {
      this.cx -= dx / this.scale;
      this.cy += dy / this.scale;
      this.fitted = false;
      this.follow = false;
      this.version++;
    }

    to_world(px, py) {
      return [this.cx + (px - this.width / 2) / this.scale,
              this.cy - (py - this.height / 2) / this.scale];
    }

    sx(x) { return (x - this.cx) * this.scale + this.width / 2; }
    sy(y) { return this.height / 2 - (y - this.cy) * this.scale; }

    draw(ratio) {
      const {player} = this;
      if (this.follow) {
        const pose = player.pose(player.runs.indexOf(player.shown()));
        // A still picture is easier to read: it moves only when the robot nears its edge.
        const room = 0.3 * Math.min(this.width, this.height) / this.scale;
        if (pose && Math.max(Math.abs(pose.x - this.cx), Math.abs(pose.y - this.cy)) > room) {
          [this.cx, this.cy] = [pose.x, pose.y];
          this.version++;
        }
      }
      const key = `${this.version} ${player.version} ${this.width} ${this.height} ${ratio}`;
      if (key !== this.key) {
        this.key = key;
        this._project();
        this._draw_still(sized(this.still, this.width, this.height, ratio));
      }
      const context = sized(this.canvas, this.width, this.height, ratio);
      context.save();
      context.setTransform(1, 0, 0, 1, 0, 0);
      context.drawImage(this.still, 0, 0);
      context.restore();
      this._draw_trails(context, ratio);
      const visible = player.runs.filter((run) => run.visible);
      const shown = player.shown();
      this._draw_dots(context, ratio, visible, shown);
      this._draw_messages(context, shown);
      for (const run of visible) this._draw_robot(context, run);
      this._draw_scale(context);
    }

    _draw_still(context) {
      const {palette, layers, runs} = this.player;
      const {packed} = runs[0];
      context.fillStyle = palette.ground;
      context.fillRect(0, 0, this.width, this.height);
      if (this.grid && layers.map) this._draw_map(context, packed.map); else this._draw_grid(context);
      context.lineCap = "round";
      context.strokeStyle = palette.rejected; // the colour of rejected ranges, which walls cause
      context.lineWidth = 3;
      context.beginPath();
      for (const [x1, y1, x2, y2] of packed.walls) {
        context.moveTo(this.sx(x1), this.sy(y1));
        context.lineTo(this.sx(x2), this.sy(y2));
      }
      context.stroke();
      for (const path of this.paths) {
        if (layers[path.layer] && path.run.visible) {
          this._stroke(context, path, 0, path.t.length - 1, 0.25);
        }
      }
      this._draw_places(context, packed);
    }

    _draw_map(context, map) {
      const [x, y, yaw] = map.origin;
      const cell = map.resolution_m * this.scale;
      context.save();
      context.fillStyle = this.player.palette.unknown;
      context.fillRect(0, 0, this.width, this.height);
      context.translate(this.sx(x), this.sy(y));
      context.rotate(-yaw);
      context.imageSmoothingEnabled = cell < 1;
      context.drawImage(this.map, 0, -map.height * cell, map.width * cell, map.height * cell);
      context.restore();
    }

    _draw_grid(context) {
      const step = nice_step(this.width / this.scale, Math.max(3, this.width / 90));
      context.strokeStyle = this.player.palette.grid;
      context.lineWidth = 1;
      context.beginPath();
      const [x0, y1] = this.to_world(0, 0), [x1, y0] = this.to_world(this.width, this.height);
      for (let x = Math.ceil(x0 / step) * step; x <= x1; x += step) {
        context.moveTo(Math.round(this.sx(x)) + 0.5, 0);
        context.lineTo(Math.round(this.sx(x)) + 0.5, this.height);
      }
      for (let y = Math.ceil(y0 / step) * step; y <= y1; y += step) {
        context.moveTo(0, Math.round(this.sy(y)) + 0.5);
        context.lineTo(this.width, Math.round(this.sy(y)) + 0.5);
      }
      context.stroke();
    }

    _draw_places(context, packed) {
      const {palette} = this.player;
      const landmarks = Object.entries(packed.landmarks), anchors = Object.entries(packed.anchors);
      context.lineWidth = 1.5;
      for (const [, [x, y, radius]] of landmarks) {
        context.beginPath();
        context.arc(this.sx(x), this.sy(y), Math.max(radius * this.scale, 3.5), 0, 2 * Math.PI);
        context.fillStyle = palette.grid;
        context.strokeStyle = palette.muted;
        context.fill();
        context.stroke();
      }
      for (const [, [x, y]] of anchors) {
        const [px, py] = [this.sx(x), this.sy(y)];
        context.beginPath();
        context.moveTo(px, py - 7);
        context.lineTo(px + 6.5, py + 5);
        context.lineTo(px - 6.5, py + 5);
        context.closePath();
        context.fillStyle = palette.anchor;
        context.strokeStyle = palette.ground;
        context.fill();
        context.stroke();
      }
      if (landmarks.length + anchors.length > 60) return;
      context.font = `12px ${FONT}`;
      for (const [name, [x, y]] of [...landmarks, ...anchors]) {
        const text = name.length > 16 ? `${name.slice(0, 15)}…` : name;
        const wide = context.measureText(text).width;
        const left = this.sx(x) + 10 + wide > this.width - 4;
        this._text(context, text, this.sx(x) + (left ? -10 - wide : 10), this.sy(y) + 4,
                   palette.ink);
      }
    }

    _text(context, text, x, y, colour) {
      context.lineWidth = 3;
      context.lineJoin = "round";
      context.strokeStyle = this.player.palette.ground;
      context.strokeText(text, x, y);
      context.fillStyle = colour;
      context.fillText(text, x, y);
    }

    // Paths in pixels; of points closer than that, one.
    _project() {
      this.paths = this.player.runs.flatMap((run, k) => [
        this._projected(run, run.truth, "truth", this.player.palette.truth, k),
        this._projected(run, run.estimate, "trail", this.player.colour(k), k),
      ].filter((path) => path));
    }

    _projected(run, track, layer, colour, order) {
      if (!track || track.t.length === 0) return null;
      if (layer === "truth" && order > 0) return null; // one truth is enough
      const n = track.t.length;
      const path = {run, layer, colour, width: layer === "truth" ? 1.3 : 2, t: new Float64Array(2 * n),
                    x: new Float32Array(2 * n), y: new Float32Array(2 * n), gap: new Uint8Array(2 * n)};
      let kept = 0;
      const keep = (px, py, time, gap) => {
        [path.x[kept], path.y[kept], path.t[kept], path.gap[kept]] = [px, py, time, gap];
        kept++;
      };
      const longest = Math.max(LONGEST_GAP_S, 3 * track.step);
      let left = true, last; // whether the line left the picture, and the point before
      for (let row = 0; row < n; row++) {
        const [px, py, time] = [this.sx(track.x[row]), this.sy(track.y[row]), track.t[row]];
        const side = this._side(px, py);
        const jumps = last === undefined || time - last.time > longest;
        if (!jumps && (side & last.side)) left = true; // no part of it is seen
        else if (jumps) { keep(px, py, time, 1); left = false; }
        else {
          if (left) keep(last.px, last.py, last.time, 1);
          if (left || Math.hypot(px - path.x[kept - 1], py - path.y[kept - 1]) >= 0.8) {
            keep(px, py, time, 0);
          }
          left = false;
        }
        last = {px, py, time, side};
      }
      path.t = path.t.subarray(0, kept);
      return path;
    }

    // On which sides of the picture a point lies, as bits: two points with one in common see nothing.
    _side(px, py) {
      return (px < -5 ? 1 : px > this.width + 5 ? 2 : 0) | (py < -5 ? 4 : py > this.height + 5 ? 8 : 0);
    }

    // The latest part of the path, strong over the pale whole path. While the view does not move, most
    // of it is kept as a picture, as smoothing long lines takes most of the time of a frame.
    _draw_trails(context, ratio) {
      const {time, _printing} = this.player;
      const begin = _printing ? -Infinity : time - TRAIL_S;
      if (this.trail_key !== this.key) {
        this.trail_key = this.key;
        this.trail_at = -Infinity;
        this._stroke_between(context, begin, time);
        return;
      }
      if (time < this.trail_at || time > this.trail_at + KEPT_S) {
        const kept = sized(this.trails, this.width, this.height, ratio);
        kept.clearRect(0, 0, this.width, this.height);
        this._stroke_between(kept, begin, time);
        this.trail_at = time;
      }
      context.drawImage(this.trails, 0, 0, this.width, this.height);
      this._stroke_between(context, this.trail_at, time);
    }

    _stroke_between(context, begin, end) {
      for (const path of this.paths) {
        if (!this.player.layers[path.layer] || !path.run.visible) continue;
        const from = Math.max(row_at(path.t, begin), 0), to = row_at(path.t, end);
        if (to > from) this._stroke(context, path, from, to, 1);
      }
    }

    _stroke(context, path, from, to, alpha) {
      context.globalAlpha = alpha;
      context.strokeStyle = path.colour;
      context.lineWidth = path.width;
      context.lineJoin = context.lineCap = "round";
      context.beginPath();
      context.moveTo(path.x[from], path.y[from]);
      for (let k = from + 1; k <= to; k++) {
        if (path.gap[k]) context.moveTo(path.x[k], path.y[k]); else context.lineTo(path.x[k], path.y[k]);
      }
      context.stroke();
      context.globalAlpha = 1;
    }

    // Particles and ends of beams, thousands of them: written as pixels, which is fastest.
    _draw_dots(context, ratio, runs, shown) {
      const {layers, palette} = this.player;
      const clouds = layers.particles ? runs.filter((run) => run.particles) : [];
      const scan = layers.scan && shown && shown.scans;
      if (clouds.length === 0 && !scan) return;
      const {width, height} = this.canvas;
      const surface = sized(this.dots, width, height, 1);
      if (!this.pixels || this.pixels.width !== width || this.pixels.height !== height) {
        this.pixels = surface.createImageData(width, height);
      }
      const pixels = new Uint32Array(this.pixels.data.buffer);
      pixels.fill(0);
      const side = Math.round(2 * ratio);
      const dot = (x, y, colour) => {
        const left = Math.round(x * ratio) - (side >> 1), top = Math.round(y * ratio) - (side >> 1);
        if (left < 0 || top < 0 || left + side > width || top + side > height) return;
        for (let row = top; row < top + side; row++) {
          pixels.fill(colour, row * width + left, row * width + left + side);
        }
      };
      for (const run of clouds) {
        this._particles(run, dot, packed_colour(this.player.colour(this.player.runs.indexOf(run)), 0.6));
      }
      if (scan) this._scan(shown, dot, packed_colour(palette.scan, 1));
      surface.putImageData(this.pixels, 0, 0);
      context.save();
      context.setTransform(1, 0, 0, 1, 0, 0);
      context.drawImage(this.dots, 0, 0);
      context.restore();
    }

    _particles(run, dot, colour) {
      const cloud = run.particles;
      const row = row_at(cloud.t, this.player.time);
      if (row < 0 || this.player.time - cloud.t[row] > Math.max(1, 3 * cloud.step)) return;
      const ax = cloud.scale[0] * this.scale, ay = -cloud.scale[1] * this.scale;
      const bx = this.sx(cloud.low[0]), by = this.sy(cloud.low[1]);
      for (let k = 2 * cloud.first[row]; k < 2 * cloud.first[row + 1]; k += 2) {
        dot(cloud.xy[k] * ax + bx, cloud.xy[k + 1] * ay + by, colour);
      }
    }

    _scan(run, dot, colour) {
      const {scans} = run;
      const {time} = this.player;
      const drawn = new Set(); // the latest scan of each laser
      for (let row = row_at(scans.t, time); row >= 0; row--) {
        if (drawn.size === scans.lasers.length) return;
        if (time - scans.t[row] > Math.max(1, 3 * scans.lasers.length * scans.step)) return;
        if (!drawn.has(scans.laser[row])) this._scan_of(run, row, dot, colour);
        drawn.add(scans.laser[row]);
      }
    }

    _scan_of(run, row, dot, colour) {
      const {scans} = run;
      const laser = scans.lasers[scans.laser[row]];
      const pose = pose_of(run.estimate, scans.t[row]);
      if (!pose) return;
      const beams = scans.ranges_cm.length / scans.t.length;
      const [mx, my, mount] = laser.mount;
      const [c, s] = [Math.cos(pose.heading), Math.sin(pose.heading)];
      const x = pose.x + c * mx - s * my, y = pose.y + s * mx + c * my;
      for (let k = 0; k < beams; k++) {
        const range = scans.ranges_cm[row * beams + k] / 100;
        if (range === 0) continue;
        const angle = pose.heading + mount + laser.angle_min + k * laser.angle_increment;
        dot(this.sx(x + range * Math.cos(angle)), this.sy(y + range * Math.sin(angle)), colour);
      }
    }

    // The latest messages: ranges as circles, sightings as rays, fixes as crosses.
    _draw_messages(context, run) {
      const {t} = run.messages;
      const {layers, time} = this.player;
      const seen = new Set();
      for (let row = row_at(t, time); row >= 0 && time - t[row] <= MESSAGE_S; row--) {
        const source = run.source(row);
        const key = `${source} ${run.messages.who[row]} ${run.messages.tag[row]}`;
        if (seen.has(key) || !Number.isFinite(run.messages.seen[2 * row])) continue;
        if (source !== "landmark_sightings") seen.add(key);
        const rejected = TURNED_DOWN.includes(run.verdict(row));
        const {palette} = this.player;
        context.strokeStyle = rejected ? palette.rejected
          : run.verdict(row) === "fused" ? palette.anchor : palette.muted;
        context.lineWidth = rejected ? 2 : 1.3;
        context.globalAlpha = (rejected ? 0.95 : 0.75) * (1 - 0.7 * (time - t[row]) / MESSAGE_S);
        context.setLineDash(rejected ? [6, 5] : []);
        if (source === "ranges" && layers.ranges) this._draw_range(context, run, row, rejected);
        if (source === "landmark_sightings" && layers.ranges) this._draw_sighting(context, run, row);
        if ((source === "positions" || source === "poses") && layers.fixes) {
          this._draw_fix(context, run, row);
        }
      }
      context.globalAlpha = 1;
      context.setLineDash([]);
    }

    _draw_range(context, run, row, rejected) {
      const at = run.packed.anchors[run.who(row)];
      if (!at) return;
      const tag = run.packed.tags[run.packed.tag_names[run.messages.tag[row]]] || [0, 0, 0];
      const up = at[2] - tag[2];
      const flat = Math.sqrt(Math.max(run.messages.seen[2 * row] ** 2 - up * up, 0));
      const [px, py] = [this.sx(at[0]), this.sy(at[1])];
      context.beginPath();
      context.arc(px, py, flat * this.scale, 0, 2 * Math.PI);
      context.stroke();
      if (!rejected) return;
      context.setLineDash([]);
      context.lineWidth = 2.5;
      context.beginPath();
      for (const way of [-1, 1]) {
        context.moveTo(px - 8, py - 8 * way);
        context.lineTo(px + 8, py + 8 * way);
      }
      context.stroke();
    }

    _draw_sighting(context, run, row) {
      const pose = pose_of(run.estimate, run.messages.t[row]);
      if (!pose) return;
      const [mx, my, mount] = run.packed.landmark_sensor || [0, 0, 0];
      const [c, s] = [Math.cos(pose.heading), Math.sin(pose.heading)];
      const x = pose.x + c * mx - s * my, y = pose.y + s * mx + c * my;
      const [range, bearing] = run.messages.seen.subarray(2 * row, 2 * row + 2);
      if (!Number.isFinite(bearing)) return;
      const angle = pose.heading + mount + bearing;
      context.beginPath();
      context.moveTo(this.sx(x), this.sy(y));
      context.lineTo(this.sx(x + range * Math.cos(angle)), this.sy(y + range * Math.sin(angle)));
      context.stroke();
    }

    _draw_fix(context, run, row) {
      const px = this.sx(run.messages.seen[2 * row]), py = this.sy(run.messages.seen[2 * row + 1]);
      context.setLineDash([]);
      context.lineWidth = 2;
      context.beginPath();
      context.moveTo(px - 5, py); context.lineTo(px + 5, py);
      context.moveTo(px, py - 5); context.lineTo(px, py + 5);
      context.stroke();
    }

    _draw_robot(context, run) {
      const {player} = this;
      const order = player.runs.indexOf(run);
      const pose = player.pose(order), truth = order === 0 ? player.true_pose(0) : null;
      if (player.layers.ellipse) this._draw_mapped(context, run, player.colour(order));
      if (pose && player.layers.ellipse && run.estimate.covariance) {
        const covariance = run.estimate.covariance.subarray(3 * pose.row, 3 * pose.row + 3);
        this._draw_ellipse(context, run, pose, covariance, player.colour(order));
      }
      if (truth && player.layers.truth) this._draw_arrow(context, truth, player.palette.truth, true);
      if (pose && player.layers.trail) this._draw_arrow(context, pose, player.colour(order), false);
    }

    _draw_mapped(context, run, colour) {
      for (const [x, y, ...covariance] of run.packed.mapped || []) {
        this._draw_ellipse(context, run, {x, y}, covariance, colour);
        context.beginPath();
        context.arc(this.sx(x), this.sy(y), 2.5, 0, 2 * Math.PI);
        context.fillStyle = colour;
        context.fill();
      }
    }

    _draw_ellipse(context, run, pose, [xx, xy, yy], colour) {
      const middle = (xx + yy) / 2, spread = Math.hypot((xx - yy) / 2, xy);
      const axis = (variance) => Math.min(
        run.packed.ellipse_sigmas * Math.sqrt(Math.max(variance, 0)) * this.scale, 1e5);
      context.beginPath();
      context.ellipse(this.sx(pose.x), this.sy(pose.y), axis(middle + spread), axis(middle - spread),
                      -0.5 * Math.atan2(2 * xy, xx - yy), 0, 2 * Math.PI);
      context.fillStyle = context.strokeStyle = colour;
      context.globalAlpha = 0.15;
      context.fill();
      context.globalAlpha = 0.9;
      context.lineWidth = 1.2;
      context.stroke();
      context.globalAlpha = 1;
    }

    _draw_arrow(context, pose, colour, ring) {
      const [px, py] = [this.sx(pose.x), this.sy(pose.y)];
      context.strokeStyle = colour;
      context.lineWidth = 2.5;
      if (Number.isFinite(pose.heading)) {
        context.beginPath();
        context.moveTo(px, py);
        context.lineTo(px + 17 * Math.cos(pose.heading), py - 17 * Math.sin(pose.heading));
        context.stroke();
      }
      context.beginPath();
      context.arc(px, py, ring ? 8 : 5, 0, 2 * Math.PI);
      if (ring) { context.lineWidth = 2; context.stroke(); return; }
      context.fillStyle = colour;
      context.fill();
      context.strokeStyle = this.player.palette.ground;
      context.lineWidth = 1.5;
      context.stroke();
    }

    // A bar of known length, in the lower left corner.
    _draw_scale(context) {
      const {palette} = this.player;
      const length = nice_step(this.width / this.scale / 4, 1) / (this.width < 420 ? 2 : 1);
      const wide = length * this.scale, y = this.height - 12;
      context.strokeStyle = palette.ground;
      context.lineWidth = 5;
      context.beginPath(); context.moveTo(12, y); context.lineTo(12 + wide, y); context.stroke();
      context.strokeStyle = palette.ink;
      context.lineWidth = 2;
      context.beginPath();
      context.moveTo(12, y - 4); context.lineTo(12, y);
      context.lineTo(12 + wide, y); context.lineTo(12 + wide, y - 4);
      context.stroke();
      context.font = `12px ${FONT}`;
      this._text(context, `${+length.toPrecision(2)} m`, 16, y - 5, palette.ink);
    }
  }

  // Strips --------------------------------------------------------------------------------------

  class Strips {
    constructor(canvas, player) {
      this.canvas = canvas;
      this.player = player;
      this.still = document.createElement("canvas");
    }

    load() {
      this.whole = true;
      this.grow();
    }

    // Takes in new rows; a view of a part of the time stays where it is.
    grow() {
      const {runs} = this.player;
      const rows = [];
      if (runs.some((run) => run.health)) rows.push({kind: "health", height: 34});
      if (runs.some((run) => run.turned_down.length)) {
        rows.push({kind: "turned down", height: Math.max(22, 11 * runs.length)});
      }
      if (runs.some((run) => run.errors && run.errors.t.length)) {
        const named = [["x error [m]", 0], ["y error [m]", 1], ["heading error [deg]", 2]];
        for (const [label, component] of named) {
          if (component < 2 || runs.some((run) => run.errors && Number.isFinite(run.errors.error[2]))) {
            rows.push({kind: "error", label, component, height: 62});
          }
        }
      }
      if (runs.some((run) => run.estimate.height)) rows.push({kind: "height", height: 62});
      const keys = new Set(runs.flatMap((run) => [...run.groups.keys()]));
      for (const key of keys) {
        const [source, dof] = key.split("|");
        // A strip for each run: thousands of points would hide one another.
        for (const run of runs.filter((one) => one.groups.has(key))) {
          const of = runs.length > 1 ? `${run.name}: ` : "";
          rows.push({kind: "nis", key, dof, run, height: runs.length > 1 ? 48 : 66,
                     label: `${of}NIS of ${source.replaceAll("_", " ")}`});
        }
      }
      this.rows = rows;
      if (this.whole) this.zoom(1e9);
      this.height = rows.reduce((sum, row) => sum + LABEL + row.height + 5, 0) + 20;
    }

    resize(width) {
      this.width = width;
      this.left = width < 520 ? 40 : 52;
      this.canvas.style.height = `${this.height}px`;
    }

    x(t) {
      return this.left + (t - this.start) / Math.max(this.end - this.start, 1e-9)
        * (this.width - this.left - 6);
    }

    time(px) {
      const share = (px - this.left) / (this.width - this.left - 6);
      return this.start + Math.min(Math.max(share, 0), 1) * (this.end - this.start);
    }

    // Shows more or less time, and leaves what is at t where it is.
    zoom(factor, t = this.player.start) {
      const {start, end} = this.player;
      const length = Math.min(Math.max(((this.end - this.start) || 1) * factor, 0.5), end - start);
      const share = (t - this.start) / ((this.end - this.start) || 1) || 0;
      this.whole = length === end - start;
      this._begin(t - share * length, length);
    }

    _begin(at, length) {
      const {start, end} = this.player;
      this.start = Math.min(Math.max(at, start), end - length);
      this.end = this.start + length;
    }

    // Turns the page when the time moves beyond it, but not while the user looks elsewhere.
    _keep_up() {
      const {time} = this.player, length = this.end - this.start;
      if (time === this.kept_up_to) return;
      this.kept_up_to = time;
      if (time < this.start || time > this.end) this._begin(time - 0.1 * length, length);
    }

    draw(ratio) {
      const {player} = this;
      this._keep_up();
      const key = `${player.version} ${this.width} ${ratio} ${this.start} ${this.end}`;
      const px = Math.round(2 * this.x(player.time)) / 2;
      if (key === this.key && px === this.px) return; // time has not moved by half a pixel
      if (key !== this.key) {
        this.key = key;
        this._draw_still(sized(this.still, this.width, this.height, ratio));
      }
      this.px = px;
      const context = sized(this.canvas, this.width, this.height, ratio);
      context.save();
      context.setTransform(1, 0, 0, 1, 0, 0);
      context.drawImage(this.still, 0, 0);
      context.restore();
      let top = 0;
      for (const {height} of this.rows) {
        top += LABEL;
        context.fillStyle = player.palette.future;
        context.fillRect(px, top, this.width - 6 - px, height);
        context.fillStyle = player.palette.ink;
        context.fillRect(px - 0.75, top - 1, 1.5, height + 2);
        top += height + 5;
      }
    }

    _draw_still(context) {
      const {palette} = this.player;
      context.fillStyle = palette.ground;
      context.fillRect(0, 0, this.width, this.height);
      context.font = `11px ${FONT}`;
      let top = 0;
      for (const row of this.rows) {
        top += LABEL;
        context.save();
        if (row.kind === "health") this._draw_health(context, top, row);
        if (row.kind === "turned down") this._draw_turned_down(context, top, row);
        if (row.kind === "error") this._draw_error(context, top, row);
        if (row.kind === "height") this._draw_height(context, top, row);
        if (row.kind === "nis") this._draw_nis(context, top, row);
        context.restore();
        top += row.height + 5;
      }
      this._draw_axis(context, top);
    }

    _draw_axis(context, top) {
      const {start, end} = this, {palette} = this.player;
      const step = nice_step(Math.max(end - start, 1e-3), Math.max(2, this.width / 90));
      context.fillStyle = palette.muted;
      context.font = `11px ${FONT}`;
      context.textAlign = "center";
      for (let t = Math.ceil(start / step) * step; t <= end + 1e-9; t += step) {
        context.fillRect(this.x(t), top - 2, 1, 4);
        const px = Math.min(this.x(t), this.width - 14);
        context.fillText(`${+t.toPrecision(6)}${t + step > end ? " s" : ""}`, px, top + 14);
      }
      context.textAlign = "left";
    }

    _frame(context, top, row, label) {
      const {palette} = this.player;
      context.strokeStyle = palette.grid;
      context.lineWidth = 1;
      context.strokeRect(this.left + 0.5, top + 0.5, this.width - this.left - 7, row.height - 1);
      context.fillStyle = palette.ink;
      context.fillText(label, this.left, top - 4);
    }

    _tick(context, y, text) {
      context.fillStyle = this.player.palette.muted;
      context.textAlign = "right";
      context.fillText(text, this.left - 5, y + 4);
      context.textAlign = "left";
    }

    // Marks a row of a shared strip at the left with the colour of its run.
    _mark(context, run, top, height) {
      context.fillStyle = this.player.colour(this.player.runs.indexOf(run));
      context.fillRect(this.left - 6, top + 1, 4, height - 2);
    }

    _clip(context, top, row) {
      context.beginPath();
      context.rect(this.left, top, this.width - this.left - 6, row.height);
      context.clip();
    }

    _draw_health(context, top, row) {
      const {palette, runs} = this.player;
      const shown = runs.filter((run) => run.health && run.visible);
      const each = row.height / Math.max(shown.length, 1);
      context.save();
      this._clip(context, top, row);
      shown.forEach((run, k) => {
        const {t, state, within} = run.health;
        for (let a = 0; a < t.length;) {
          let b = a;
          while (b < t.length && state[b] === state[a]) b++;
          const name = run.health.states[state[a]];
          const until = b < t.length ? t[b] : t[t.length - 1];
          context.fillStyle = palette.states[name] || palette.grid;
          context.fillRect(this.x(t[a]), top + k * each, this.x(until) - this.x(t[a]) + 0.5, each);
          a = b;
        }
        context.strokeStyle = this.player.colour(runs.indexOf(run));
        context.lineWidth = 1.2;
        context.beginPath();
        for (let a = 0; a < t.length; a++) {
          context.lineTo(this.x(t[a]), top + (k + 1) * each - 2 - within[a] * (each - 4));
        }
        context.stroke();
      });
      context.restore();
      const each_of = shown.length > 1 ? " of each run" : "";
      const label = `health${each_of}: ${this._states(shown)}, and probability that it is within its limit`;
      this._frame(context, top, row, label);
      if (shown.length > 1) {
        shown.forEach((run, k) => this._mark(context, run, top + k * each, each));
        return;
      }
      this._tick(context, top + 4, "1");
      this._tick(context, top + row.height - 4, "0");
    }

    _states(shown) {
      const seen = new Set(shown.flatMap((run) => [...new Set(run.health.state)]
        .map((state) => run.health.states[state].replaceAll("_", " "))));
      return [...seen].join(", ");
    }

    _draw_turned_down(context, top, row) {
      const {palette, runs} = this.player;
      const shown = runs.filter((run) => run.visible);
      const each = row.height / Math.max(shown.length, 1);
      context.save();
      this._clip(context, top, row);
      context.fillStyle = palette.rejected;
      context.globalAlpha = 0.7;
      shown.forEach((run, k) => {
        for (const t of run.turned_down_t) context.fillRect(this.x(t) - 0.5, top + k * each, 1.2, each);
      });
      context.restore();
      this._frame(context, top, row, `rejected messages${shown.length > 1 ? " of each run" : ""}`);
      if (shown.length > 1) shown.forEach((run, k) => this._mark(context, run, top + k * each, each));
    }

    _draw_error(context, top, row) {
      const {palette, runs} = this.player;
      const factor = row.component === 2 ? 180 / Math.PI : 1;
      const shown = runs.filter((run) => run.visible && run.errors);
      let most = 0, wide = [];
      for (const {errors, packed} of shown) {
        for (let k = 0; k < errors.t.length; k++) {
          most = Math.max(most, Math.abs(errors.error[3 * k + row.component] || 0) * factor);
          if (errors.sigma) wide.push(packed.band_sigmas * errors.sigma[3 * k + row.component] * factor);
        }
      }
      // An unknown start may claim kilometres: the band may leave the strip, the error not.
      wide.sort((a, b) => a - b);
      most = 1.12 * Math.max(most, wide.length ? wide[Math.floor(0.95 * (wide.length - 1))] : 0, 1e-6);
      const y = (value) => top + row.height / 2 - value / most * row.height / 2;
      context.save();
      this._clip(context, top, row);
      const {errors: first, packed} = shown[0] || {};
      if (first && first.sigma) {
        context.fillStyle = palette.band;
        context.beginPath();
        const edge = (k) => packed.band_sigmas * first.sigma[3 * k + row.component] * factor;
        for (let k = 0; k < first.t.length; k++) context.lineTo(this.x(first.t[k]), y(edge(k)));
        for (let k = first.t.length - 1; k >= 0; k--) context.lineTo(this.x(first.t[k]), y(-edge(k)));
        context.fill();
      }
      context.fillStyle = palette.muted;
      context.fillRect(this.left, y(0) - 0.5, this.width, 1);
      for (const {errors} of shown) {
        context.strokeStyle = this.player.colour(runs.findIndex((run) => run.errors === errors));
        context.lineWidth = 1.2;
        context.beginPath();
        let last = -Infinity;
        for (let k = 0; k < errors.t.length; k++) {
          const at = y(errors.error[3 * k + row.component] * factor);
          if (errors.t[k] - last > LONGEST_GAP_S) context.moveTo(this.x(errors.t[k]), at);
          else context.lineTo(this.x(errors.t[k]), at);
          last = errors.t[k];
        }
        context.stroke();
      }
      context.restore();
      const of = shown.length > 1 ? ` of ${packed.name}` : "";
      const sigmas = first && first.sigma ? ` in the ±${packed.band_sigmas} sigma band${of}` : "";
      this._frame(context, top, row, this.width < 520 ? row.label : row.label + sigmas);
      const tick = [1, 1.25, 2, 2.5, 4].map((parts) => nice_step(most, parts))
        .find((step) => step < 0.9 * most);
      for (const value of [tick, 0, -tick]) this._tick(context, y(value), `${+value.toPrecision(2)}`);
    }

    // Heights of bodies that fly, with the band of the first run and its truth.
    _draw_height(context, top, row) {
      const {palette, runs} = this.player;
      const shown = runs.filter((run) => run.visible && run.estimate.height);
      const {estimate: first, truth, packed} = shown[0] || {};
      const lines = shown.map((run) => [run.estimate, this.player.colour(runs.indexOf(run))]);
      if (truth && truth.height) lines.unshift([truth, palette.truth]);
      let low = Infinity, high = -Infinity;
      for (const [{height}] of lines) for (const value of height) {
        if (value < low) low = value;
        if (value > high) high = value;
      }
      const margin = Math.max(0.1 * (high - low), 0.05);
      const y = (value) => top + row.height * (high + margin - value) / (high - low + 2 * margin);
      context.save();
      this._clip(context, top, row);
      if (first && first.sigma_height) {
        context.fillStyle = palette.band;
        context.beginPath();
        const edge = (k, side) => y(first.height[k] + side * packed.band_sigmas * first.sigma_height[k]);
        for (let k = 0; k < first.t.length; k++) context.lineTo(this.x(first.t[k]), edge(k, 1));
        for (let k = first.t.length - 1; k >= 0; k--) context.lineTo(this.x(first.t[k]), edge(k, -1));
        context.fill();
      }
      for (const [{t, height}, colour] of lines) {
        context.strokeStyle = colour;
        context.lineWidth = 1.2;
        context.beginPath();
        let last = -Infinity;
        for (let k = 0; k < t.length; k++) {
          if (t[k] - last > LONGEST_GAP_S) context.moveTo(this.x(t[k]), y(height[k]));
          else context.lineTo(this.x(t[k]), y(height[k]));
          last = t[k];
        }
        context.stroke();
      }
      context.restore();
      const band = first && first.sigma_height ? ` with its ±${packed.band_sigmas} sigma band` : "";
      const beside = truth && truth.height ? ", and the truth" : "";
      this._frame(context, top, row, this.width < 520 ? "height [m]" : `height [m]${band}${beside}`);
      if (!(high >= low)) return;
      const digits = Math.max(0, Math.min(3, 1 - Math.floor(Math.log10(Math.max(high - low, 1e-3)))));
      for (const value of [low, high]) this._tick(context, y(value), value.toFixed(digits));
    }

    _draw_nis(context, top, row) {
      const {palette, runs} = this.player;
      const shown = row.run.visible ? [row.run] : [];
      const [low, high] = (runs.find((run) => run.packed.bands[row.dof]) || runs[0]).packed.bands[row.dof];
      let most = 3 * high;
      for (const run of runs) for (const k of run.groups.get(row.key) || []) {
        most = Math.max(most, 1.6 * run.messages.nis[k]);
      }
      const floor = Math.log(low / 3), top_log = Math.log(most);
      const y = (nis) => top + row.height - 2
        - (Math.max(Math.log(nis), floor) - floor) / (top_log - floor) * (row.height - 4);
      context.save();
      this._clip(context, top, row);
      context.fillStyle = palette.band;
      context.fillRect(this.left, y(high), this.width, y(low) - y(high));
      for (const rejected of [false, true]) for (const run of shown) {
        context.fillStyle = rejected ? palette.rejected : this.player.colour(runs.indexOf(run));
        context.globalAlpha = rejected ? 0.95 : 0.6;
        const size = rejected ? 3 : 2;
        for (const k of run.groups.get(row.key)) {
          if ((run.verdict(k) === "gated") !== rejected) continue;
          context.fillRect(this.x(run.messages.t[k]) - size / 2, y(run.messages.nis[k]) - size / 2,
                           size, size);
        }
      }
      context.restore();
      const band = this.width < 520 ? "" : `, 95 % band ${low.toPrecision(2)} to ${high.toPrecision(3)}`;
      this._frame(context, top, row, row.label + band);
      this._tick(context, y(high), high.toPrecision(2));
      this._tick(context, y(low), low.toPrecision(1));
    }
  }

  // Player --------------------------------------------------------------------------------------

  return class LocfusePlayer {
    constructor(element, packed, options = {}) {
      this.element = element;
      this.options = {controls: true, theme: "auto", ...options};
      this.listeners = {time: [], play: [], pause: [], end: []};
      this.layers = Object.fromEntries(LAYERS.map(([name]) => [name, true]));
      this.playing = false;
      this.live = false;
      this._pace = 0;
      this._grown = performance.now();
      this.speed = 1;
      this.frames_per_s = 0;
      this.version = 0;
      this._frames = [];
      this._build();
      this._world = new World(this._parts.world, this);
      this._strips = new Strips(this._parts.strips, this);
      this._dark = matchMedia("(prefers-color-scheme: dark)");
      this._observe();
      this.show(packed, this.options.more);
    }

    // API ---

    show(packed, more = false) {
      this._load(packed, more);
      this._paint();
      this._world.load();
      this._strips.load();
      this._build_legend();
      this._layout();
      this.live = false;
      if (more && this._growing()) this.go_live();
      this.redraw(true);
    }

    // Shows more of the same runs, or others beside them.
    grow(packed, more = false) {
      const hidden = this.runs.map((run) => !run.visible);
      const begins = !this._growing() && !this.playing && this.time === this.start;
      this._load(packed, more);
      this.runs.forEach((run, k) => { run.visible = !hidden[k]; });
      const now = performance.now();
      const since_s = Math.min(Math.max((now - this._grown) / 1000, 0.5), 10);
      this._grown = now;
      this._pace = Math.max(this.newest() - this.time, 0) / since_s;
      if (this.live) this.time = Math.min(this.time, this.newest());
      this._world.grow();
      this._strips.grow();
      this._build_legend();
      this._layout();
      if (more && begins && this._growing()) this.go_live(); // who has not begun to look elsewhere
      this.redraw(true);
    }

    go_live() {
      this.seek(this.newest());
      this.live = this.more;
      this._pace = 0;
      this._grown = performance.now();
      this.play();
    }

    // The end of the run that computes, or of all.
    newest() { return (this._growing() || this).end; }

    get duration() { return this.end - this.start; }

    play(speed = this.speed) {
      this._set_speed(speed);
      if (this.time >= this.end && !this.more) this.seek(this.start);
      if (!this.playing) {
        this.playing = true;
        this._last = undefined;
        this._frames = [];
        this._emit("play");
      }
      this.redraw();
    }

    pause() {
      this.live = false;
      if (!this.playing) return;
      this.playing = false;
      this._emit("pause");
      this.redraw();
    }

    // To the next or the previous estimate of the first run that is seen.
    step(way) {
      this.pause();
      const {t} = this.shown().estimate;
      const row = row_at(t, this.time);
      const next = way > 0 ? row + 1 : t[row] < this.time ? row : row - 1;
      if (next >= 0 && next < t.length) this.seek(t[next]);
    }

    seek(seconds) {
      const time = Math.min(Math.max(Number(seconds), this.start), this.end);
      if (!Number.isFinite(time)) throw new Error(`seek to ${seconds}; expected a number of seconds`);
      this.live = false;
      this.time = time;
      this._emit("time");
      this.redraw();
    }

    pose(run = 0) { return pose_of(this.runs[run]?.estimate, this.time); }
    true_pose(run = 0) { return pose_of(this.runs[run]?.truth, this.time); }

    on(event, callback) {
      if (!(event in this.listeners)) {
        throw new Error(`no event ${event}; expected ${Object.keys(this.listeners).join(", ")}`);
      }
      this.listeners[event].push(callback);
      return () => {
        this.listeners[event] = this.listeners[event].filter((one) => one !== callback);
      };
    }

    destroy() {
      this.playing = false;
      cancelAnimationFrame(this._request);
      this._resizes.disconnect();
      for (const undo of this._undo) undo();
      this.element.replaceChildren();
      this.element.classList.remove("locfuse-player");
    }

    // Inside ---

    // The first run that is seen: its scan, ranges and figures are shown.
    shown() { return this.runs.find((run) => run.visible) || this.runs[0]; }

    colour(order) { return this.palette.runs[order % this.palette.runs.length]; }

    _emit(event) { for (const callback of [...this.listeners[event]]) callback(this); }

    // Draws in the next frame; `anew` if more than the time has changed.
    redraw(anew = false) {
      if (anew) this.version++;
      if (this._request === undefined) {
        this._request = requestAnimationFrame((now) => this._tick(now));
      }
    }

    _tick(now) {
      this._request = undefined;
      if (this.playing) {
        const passed = this._last === undefined ? 0 : Math.min((now - this._last) / 1000, 0.25);
        this._last = now;
        this._frames.push(now);
        while (now - this._frames[0] > 1000) this._frames.shift();
        const span = (now - this._frames[0]) / 1000;
        if (span > 0.2) this.frames_per_s = (this._frames.length - 1) / span;
        // Live, it reaches the newest row when the next rows arrive.
        const speed = this.live ? Math.max(this.speed, this._pace) : this.speed;
        this.time = Math.min(this.time + passed * speed, this.live ? this.newest() : this.end);
        this._emit("time");
      }
      this._draw();
      if (!this.playing) return;
      if (this.time < (this.live ? this.newest() : this.end)) this.redraw();
      else if (this.more) {
        this._last = undefined; // waits for it
        this._update_texts();
      } else {
        this.pause();
        this._emit("end");
      }
    }

    _load(packed, more) {
      if (packed.length === 0) throw new Error("no run to show; expected at least one");
      this.runs = packed.map((one) => new Run(one, packed[0]));
      this.more = Boolean(more);
      this.start = Math.min(...this.runs.map((run) => run.start));
      this.end = Math.max(...this.runs.map((run) => run.end));
      this.time = Math.min(Math.max(this.time ?? this.start, this.start), this.end);
    }

    _growing() { return this.runs.filter((run) => run.packed.whole === false).pop(); }

    _draw() {
      const ratio = this._printing ? 2 : Math.min(devicePixelRatio || 1, 2);
      this._world.draw(ratio);
      this._strips.draw(ratio);
      const now = performance.now();
      if (this.playing && now - this._texts_at < 100) return; // faster than anybody reads
      this._texts_at = now;
      this._update_texts();
    }

    _paint() {
      const {theme} = this.options;
      const dark = !this._printing && (theme === "dark" || (theme === "auto" && this._dark.matches));
      this.palette = PALETTES[dark ? "dark" : "light"];
      this.element.dataset.theme = dark ? "dark" : "light";
      this._world.tint();
      [...this._parts.runs.querySelectorAll(".lp-swatch")].forEach((swatch, k) => {
        swatch.style.background = this.colour(k);
      });
      this.version++;
    }

    _build() {
      const parts = {};
      parts.world = make("canvas", {class: "lp-world", tabindex: "0", role: "img",
                                    "aria-label": "Map with the estimated path"});
      parts.strips = make("canvas", {class: "lp-strips", role: "img",
                                     "aria-label": "Health, rejections, errors and innovations over time"});
      const button = (label, sign, action, more = {}) =>
        make("button", {type: "button", "aria-label": label, title: label, onclick: action, ...more}, sign);
      parts.play = button("Play (space)", icon("play"), () => this.playing ? this.pause() : this.play(),
                          {class: "lp-play"});
      parts.slider = make("input", {type: "range", min: "0", max: "1000", step: "any", value: "0",
                                    "aria-label": "Time", class: "lp-slider"});
      parts.slider.addEventListener("input", () => this.seek(parts.slider.value));
      parts.clock = make("output", {class: "lp-clock"});
      parts.speed = make("select", {"aria-label": "Speed", title: "Speed",
                                    onchange: () => this._set_speed(parts.speed.value)},
        ...SPEEDS.map((speed) => make("option", {value: String(speed)}, `${speed}×`)));
      const zooms = make("div", {class: "lp-zoom"},
        button("Zoom in", icon("plus"), () => this._zoom(1.5)),
        button("Zoom out", icon("minus"), () => this._zoom(1 / 1.5)),
        button("Show all", icon("all"), () => { this._world.fit(); this._build_follow(); this.redraw(); }),
        parts.follow = button("Follow the robot", icon("follow"), () => this._follow(),
                              {"aria-pressed": "false"}));
      parts.controls = make("div", {class: "lp-controls"},
        parts.play, button("One step back (,)", icon("back"), () => this.step(-1)),
        button("One step on (.)", icon("on"), () => this.step(1)), parts.slider, parts.clock, parts.speed);
      parts.live = button("Follow what is being computed", "Live", () => this.go_live(),
                          {class: "lp-live", "aria-pressed": "false"});
      parts.state = make("p", {class: "lp-state"});
      parts.hint = make("div", {class: "lp-hint", "aria-hidden": "true"}, "Ctrl + wheel zooms");
      parts.whose = make("p", {class: "lp-whose"});
      parts.now = make("table", {class: "lp-now"});
      parts.runs = make("div", {class: "lp-runs"});
      parts.layers = make("div", {class: "lp-layers", role: "group", "aria-label": "Layers"});
      parts.news = make("ol", {class: "lp-latest"});
      this.element.replaceChildren(make("div", {class: "lp-body"},
        make("div", {class: "lp-main"}, make("div", {class: "lp-stage"}, parts.world, zooms, parts.hint),
             parts.controls, parts.strips),
        make("div", {class: "lp-side"}, parts.runs, parts.layers, parts.whose, parts.state, parts.now,
             make("h3", {}, "Latest rejections and events"), parts.news,
             parts.thinned = make("p", {class: "lp-decimated"}))));
      this.element.classList.add("locfuse-player");
      if (!this.options.controls) parts.controls.hidden = true;
      this._parts = parts;
    }

    _build_legend() {
      const {slider, thinned} = this._parts;
      thinned.textContent = this._decimation_note();
      slider.min = this.start;
      slider.max = this.end;
      this._set_speed(this.speed);
      const has_source = (...sources) =>
        this.runs.some((run) => run.packed.sources.some((source) => sources.includes(source)));
      const has = {
        truth: this.runs[0].truth, trail: true, ellipse: this.runs.some((run) => run.estimate.covariance),
        scan: this.runs.some((run) => run.scans), particles: this.runs.some((run) => run.particles),
        ranges: has_source("ranges", "landmark_sightings"), fixes: has_source("positions", "poses"),
        map: this.runs[0].packed.map,
      };
      const offered = LAYERS.filter(([name]) => has[name]);
      // Unchanged buttons stay: the user may be pressing one.
      const key = JSON.stringify([offered, this.runs.map((run) => run.name)]);
      if (key !== this._legend) this._make_legend(offered);
      this._legend = key;
      [...this._parts.runs.children].forEach((label, k) => {
        const {metrics: {position_rmse_m: rmse}, whole} = this.runs[k].packed;
        const figure = typeof rmse === "number" ? `RMSE ${rounded(rmse)} m` : "";
        label.querySelector("input").checked = this.runs[k].visible;
        label.querySelector(".lp-rmse").textContent = figure + (whole === false ? " so far" : "");
      });
    }

    _make_legend(offered) {
      const {runs, layers} = this._parts;
      runs.replaceChildren(...this.runs.map((run, k) => {
        const box = make("input", {type: "checkbox"});
        box.addEventListener("change", () => {
          this.runs[k].visible = box.checked;
          this.redraw(true);
        });
        const swatch = make("span", {class: "lp-swatch"});
        swatch.style.background = this.colour(k);
        return make("label", {}, box, swatch, make("span", {class: "lp-name"}, run.name),
                    make("span", {class: "lp-rmse"}));
      }));
      layers.replaceChildren(...offered.map(([name, label]) => {
        const button = make("button", {type: "button", "aria-pressed": String(this.layers[name]),
                                       "data-layer": name},
                            make("span", {class: `lp-mark lp-mark-${name}`}), label);
        button.addEventListener("click", () => {
          this.layers[name] = !this.layers[name];
          button.setAttribute("aria-pressed", String(this.layers[name]));
          this.redraw(true);
        });
        return button;
      }));
    }

    // Which part of a decimated run is shown.
    _decimation_note() {
      const [run] = this.runs;
      const shares = ["estimate", "messages", "scans", "particles"].flatMap((name) => {
        const part = run[name];
        if (!part || part.t.length === part.of) return [];
        return [`${name} ${Math.ceil(100 * part.t.length / part.of)} %`];
      });
      if (shares.length === 0) return "";
      return `Shown of this long run: ${shares.join(", ")}. The files of the run hold all.`;
    }

    _build_follow() { this._parts.follow.setAttribute("aria-pressed", String(this._world.follow)); }

    _follow() {
      this._world.follow = !this._world.follow;
      if (this._world.follow) this._world.centre(this.pose(this.runs.indexOf(this.shown())));
      this._build_follow();
      this.redraw();
    }

    _zoom(factor) {
      this._world.zoom(factor);
      this.redraw();
    }

    _set_speed(speed) {
      const number = Number(speed);
      if (!(number > 0)) throw new Error(`speed ${speed}; expected a number above 0`);
      this.speed = number;
      this._parts.speed.value = String(number);
    }

    // Texts: the clock, the state, figures of now, the latest rejections.
    _update_texts() {
      const {play, slider, clock: time, state, live} = this._parts;
      if (!this.more) live.remove();
      else if (!live.isConnected) time.after(live);
      live.setAttribute("aria-pressed", String(this.live));
      if (document.activeElement !== slider || this.playing) slider.value = this.time;
      slider.setAttribute("aria-valuetext", `${clock(this.time)} of ${clock(this.end)}`);
      time.textContent = `${clock(this.time)} / ${clock(this.end)}`;
      const label = this.playing ? "Pause (space)" : "Play (space)";
      if (play.getAttribute("aria-label") !== label) {
        play.setAttribute("aria-label", label);
        play.title = label;
        play.replaceChildren(icon(this.playing ? "pause" : "play"));
      }
      const run = this.shown();
      const row = run.health ? row_at(run.health.t, this.time) : -1;
      const name = row >= 0 ? run.health.states[run.health.state[row]] : "";
      state.hidden = !name;
      state.textContent = name && `Health: ${name.replaceAll("_", " ")}` +
        (run.health.reasons[run.health.reason[row]] ? `, ${run.health.reasons[run.health.reason[row]]}` : "");
      state.style.background = this.palette.states[name] || "";
      this._update_whose(run);
      this._update_now(run);
      this._update_latest(run);
    }

    // The run that state, figures and rejections belong to.
    _update_whose(run) {
      const {whose} = this._parts;
      whose.hidden = this.runs.length < 2;
      if (whose.hidden || whose.dataset.of === `${this.runs.indexOf(run)} ${this.version}`) return;
      whose.dataset.of = `${this.runs.indexOf(run)} ${this.version}`;
      const swatch = make("span", {class: "lp-swatch"});
      swatch.style.background = this.colour(this.runs.indexOf(run));
      whose.replaceChildren(swatch, make("b", {}, run.name), " in figures, scan, ranges, rejections");
    }

    _update_now(run) {
      const order = this.runs.indexOf(run);
      const pose = this.pose(order), truth = this.true_pose(order);
      const rows = [];
      if (pose) {
        rows.push(["x, y", `${pose.x.toFixed(3)}, ${pose.y.toFixed(3)} m`]);
        rows.push(["heading", `${(pose.heading * 180 / Math.PI).toFixed(1)} deg`]);
        if (run.estimate.covariance) {
          const [xx, , yy] = run.estimate.covariance.subarray(3 * pose.row, 3 * pose.row + 3);
          rows.push(["sigma of x, y", `${Math.sqrt(xx).toFixed(3)}, ${Math.sqrt(yy).toFixed(3)} m`]);
        }
        const {height} = this.runs[order].estimate;
        if (height) rows.push(["height", `${height[pose.row].toFixed(3)} m`]);
        if (truth) rows.push(["error", `${Math.hypot(pose.x - truth.x, pose.y - truth.y).toFixed(3)} m`]);
      } else rows.push(["estimate", "none yet"]);
      if (this._rows !== rows.length) {
        this._rows = rows.length;
        this._parts.now.replaceChildren(
          ...rows.map(() => make("tr", {}, make("th", {scope: "row"}), make("td"))));
      }
      rows.forEach(([name, value], k) => {
        const [head, cell] = this._parts.now.rows[k].cells;
        head.textContent = name;
        cell.textContent = value;
      });
    }

    _update_latest(run) {
      const last = row_at(run.turned_down_t, this.time);
      const event = run.events.filter(({t}) => t <= this.time).length;
      const key = `${this.runs.indexOf(run)} ${last} ${event} ${this.version}`;
      if (key === this._latest) return;
      this._latest = key;
      const lines = run.turned_down.slice(Math.max(last - 7, 0), last + 1)
        .map((row) => [run.messages.t[row], run.sentence(row)]);
      lines.push(...run.events.slice(0, event).slice(-4).map(({t, text}) => [t, text]));
      lines.sort((a, b) => b[0] - a[0]);
      const items = lines.slice(0, 8).map(
        ([t, text]) => make("li", {}, make("b", {}, `${t.toFixed(2)} s`), ` ${text}`));
      this._parts.news.replaceChildren(...(items.length ? items : [make("li", {}, "none so far")]));
    }

    // Input ---

    _observe() {
      this._undo = [];
      const listen = (target, name, action, options) => {
        target.addEventListener(name, action, options);
        this._undo.push(() => target.removeEventListener(name, action, options));
      };
      this._resizes = new ResizeObserver(() => { this._layout(); this.redraw(); });
      this._resizes.observe(this.element);
      listen(this._dark, "change", () => { this._paint(); this.redraw(true); });
      listen(window, "beforeprint", () => this._print(true));
      listen(window, "afterprint", () => this._print(false));
      listen(this.element, "keydown", (event) => this._key(event));
      this._observe_world(listen);
      const {strips} = this._parts;
      const scrub = (event) => {
        this.seek(this._strips.time(event.clientX - strips.getBoundingClientRect().left));
      };
      listen(strips, "pointerdown", (event) => { strips.setPointerCapture(event.pointerId); scrub(event); });
      listen(strips, "pointermove", (event) => { if (event.buttons) scrub(event); });
      listen(strips, "wheel", (event) => {
        if (!event.ctrlKey && !event.metaKey) return;
        event.preventDefault();
        const at = this._strips.time(event.clientX - strips.getBoundingClientRect().left);
        this._strips.zoom(Math.exp(0.0015 * event.deltaY), at);
        this.redraw();
      }, {passive: false});
      listen(strips, "dblclick", () => { this._strips.zoom(1e9); this.redraw(); });
    }

    _observe_world(listen) {
      const {world, hint} = this._parts;
      const held = new Map();
      const place = (event) => {
        const box = world.getBoundingClientRect();
        return [event.clientX - box.left, event.clientY - box.top];
      };
      listen(world, "pointerdown", (event) => {
        held.set(event.pointerId, place(event));
        world.setPointerCapture(event.pointerId);
      });
      listen(world, "pointermove", (event) => {
        if (!held.has(event.pointerId)) return;
        const [was, is] = [held.get(event.pointerId), place(event)];
        const other = [...held].find(([id]) => id !== event.pointerId)?.[1];
        if (other) {
          const far = (point) => Math.max(Math.hypot(point[0] - other[0], point[1] - other[1]), 10);
          this._world.zoom(far(is) / far(was), ...other);
        } else this._world.pan(is[0] - was[0], is[1] - was[1]);
        held.set(event.pointerId, is);
        this._build_follow();
        this.redraw();
      });
      for (const name of ["pointerup", "pointercancel"]) {
        listen(world, name, (event) => held.delete(event.pointerId));
      }
      listen(world, "dblclick", (event) => { this._world.zoom(2, ...place(event)); this.redraw(); });
      // A wheel that only passes by scrolls the page.
      listen(world, "wheel", (event) => {
        if (!event.ctrlKey && !event.metaKey && document.activeElement !== world) {
          hint.classList.add("lp-seen");
          setTimeout(() => hint.classList.remove("lp-seen"), 1200);
          return;
        }
        event.preventDefault();
        this._world.zoom(Math.exp(-0.0015 * event.deltaY), ...place(event));
        this.redraw();
      }, {passive: false});
    }

    _key(event) {
      if (event.ctrlKey || event.metaKey || event.altKey || event.target.tagName === "SELECT") return;
      const far = event.shiftKey ? 10 : 1;
      const faster = (way) => {
        const at = SPEEDS.findIndex((speed) => speed >= this.speed);
        this._set_speed(SPEEDS[Math.min(Math.max(at + way, 0), SPEEDS.length - 1)]);
      };
      const actions = {
        " ": () => this.playing ? this.pause() : this.play(),
        ArrowLeft: () => this.seek(this.time - far), ArrowRight: () => this.seek(this.time + far),
        ArrowUp: () => faster(1), ArrowDown: () => faster(-1),
        ",": () => this.step(-1), ".": () => this.step(1),
        Home: () => this.seek(this.start),
        End: () => this.more ? this.go_live() : this.seek(this.end),
        "+": () => this._zoom(1.5), "-": () => this._zoom(1 / 1.5),
      };
      const presses = ["BUTTON", "INPUT"].includes(event.target.tagName) && event.target.type !== "range";
      if (!(event.key in actions) || (event.key === " " && presses)) return;
      event.preventDefault();
      actions[event.key]();
    }

    _layout() {
      const {world, strips} = this._parts;
      const most = this._printing ? 600 : Math.max(240, Math.min(640, 0.68 * innerHeight));
      this._world.resize(this._printing ? PAPER : Math.max(world.clientWidth, 100), most);
      this._strips.resize(Math.max(strips.clientWidth, 100));
    }

    // One still picture on paper: of the moment that is seen, of the end where nothing was sought.
    _print(begins) {
      if (begins === Boolean(this._printing)) return;
      if (begins) this._time_on_screen = this.time;
      this._printing = begins;
      this.time = begins && this.time === this.start ? this.end : this._time_on_screen;
      this._paint();
      this._layout();
      this.version++;
      this._draw();
    }
  };
})();
