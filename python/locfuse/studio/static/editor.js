// SPDX-License-Identifier: Apache-2.0
// The drawing board: shows a world, lets a mouse or a keyboard change it, and reports what was done.
//
//   const editor = new SceneEditor(element, emit);  // emit({do: "move", what: ["anchor", "A1"], ...})
//   editor.show(world); editor.ground({map, way, start}); editor.use("anchor"); editor.mode("dop");
//   editor.dop_ms  // from the mouse to the painted picture, of the last drags, milliseconds
"use strict";

globalThis.SceneEditor = (() => {
  const PALETTES = {
    light: {ground: "#ffffff", ink: "#222222", muted: "#5b636b", grid: "rgba(34,34,34,0.08)",
            metre: "rgba(34,34,34,0.16)", wall: "#444b52", nlos: "#D55E00", anchor: "#009E73",
            landmark: "#7A5195", way: "#222222", chosen: "#0072B2", halo: "rgba(255,255,255,0.85)"},
    dark: {ground: "#1b1e22", ink: "#e8eaec", muted: "#a3abb3", grid: "rgba(232,234,236,0.07)",
           metre: "rgba(232,234,236,0.14)", wall: "#b8c0c8", nlos: "#ff8a3d", anchor: "#35c79a",
           landmark: "#b79ad6", way: "#f2f2f2", chosen: "#56B4E9", halo: "rgba(22,24,27,0.8)"},
  };
  const FONT = "12px system-ui, -apple-system, 'Segoe UI', sans-serif";
  const SNAP_M = 0.1, NEAR_PX = 11, MARGIN_PX = 34;
  const HINTS = {
    select: "Drag things to move them, the floor to shift it; the wheel zooms.",
    anchor: "Click where the anchor is.",
    landmark: "Click where the landmark is.",
    cylinder: "Click where the cylinder stands: the laser sees it.",
    wall: "Drag from one end of the wall to the other: the laser sees it.",
    nlos: "Drag a wall that ranges are too long through.",
    path: "Click point after point; double-click ends, a click on the first one closes the path.",
    erase: "Click what is to go.",
  };

  return class SceneEditor {
    constructor(element, emit) {
      this.emit = emit;
      this.canvas = document.createElement("canvas");
      this.canvas.className = "studio-canvas";
      this.canvas.tabIndex = 0;
      this.canvas.setAttribute("aria-label", "Drawing board of the world");
      this.status = document.createElement("div");
      this.status.className = "studio-status";
      this.legend = document.createElement("div");
      this.legend.className = "studio-legend";
      this.busy = document.createElement("div");
      this.busy.className = "studio-busy";
      this.busy.dataset.testid = "computing";
      this.busy.setAttribute("role", "status");
      this.busy.textContent = "computing map and way \u2026";
      this.busy.hidden = true;
      element.append(this.canvas, this.busy, this.legend, this.status);
      this.tool = "select";
      this.shown = "dop";
      this.chosen = null;
      this.drawn = []; // points of the path or wall that is being drawn
      this.dop_ms = [];
      this.dark = matchMedia("(prefers-color-scheme: dark)");
      this.dark.addEventListener("change", () => this._recolour());
      new ResizeObserver(() => this._resize()).observe(this.canvas);
      this._listen();
      this._resize();
    }

    // What is shown ---------------------------------------------------------------------------

    show(world) {
      const fits = this.world && JSON.stringify(this.world.room) === JSON.stringify(world.room);
      this.world = world;
      this.drag = null;
      if (!this._there(this.chosen)) this._choose(null, true);
      if (!fits) this.fit();
      if (!world.simulated) this.cover = null;
      this._ask(null);
      this._show_legend();
      this._tell_status();
      this._paint();
    }

    ground(found) {
      this.found = found;
      this.picture = null;
      if (found.map) {
        const image = new Image();
        image.onload = () => { this.picture = image; this._paint(); };
        image.src = found.map.png;
      }
      if (this.world && !this.world.simulated) this.fit();
      this._paint();
    }

    // Whether anybody can see the board.
    seen() { return Boolean(this.canvas.clientWidth && this.canvas.isConnected); }

    // Say that map and way of the scene are being made; those that are seen are of the one before.
    computing(is_so) {
      this.busy.hidden = !is_so;
      this._paint();
    }

    use(tool) {
      this.tool = tool;
      this.drawn = [];
      this.canvas.dataset.tool = tool;
      this._tell_status();
      this._paint();
    }

    mode(shown) {
      this.shown = shown;
      this._recolour();
    }

    fit() {
      const [x0, y0, x1, y1] = this._bounds();
      const {clientWidth: w, clientHeight: h} = this.canvas;
      this.scale = Math.max(1e-3, Math.min((w - 2 * MARGIN_PX) / (x1 - x0),
                                           (h - 2 * MARGIN_PX) / (y1 - y0)));
      this.left = (w - this.scale * (x1 + x0)) / 2;
      this.bottom = (h + this.scale * (y1 + y0)) / 2;
      this._paint();
    }

    to_px(x, y) { return [this.left + this.scale * x, this.bottom - this.scale * y]; }
    to_m(px, py) { return [(px - this.left) / this.scale, (this.bottom - py) / this.scale]; }

    _bounds() {
      const map = this.found && this.found.map;
      if (this.world && this.world.simulated && !map) return [0, 0, ...this.world.room];
      let box = this.world && this.world.simulated ? [0, 0, ...this.world.room] : null;
      const add = (x, y) => {
        box = box ? [Math.min(box[0], x), Math.min(box[1], y), Math.max(box[2], x),
                     Math.max(box[3], y)] : [x, y, x, y];
      };
      if (map) {
        const [x, y] = map.origin;
        add(x, y);
        add(x + map.width * map.resolution_m, y + map.height * map.resolution_m);
      } else if (this.found) {
        (this.found.way || []).forEach(([x, y]) => add(x, y));
        Object.values(this.found.anchors || {}).forEach(([x, y]) => add(x, y));
        Object.values(this.found.landmarks || {}).forEach(([x, y]) => add(x, y));
      }
      box = box || [0, 0, 10, 10];
      return [box[0], box[1], Math.max(box[2], box[0] + 0.5), Math.max(box[3], box[1] + 0.5)];
    }

    _resize() {
      const ratio = devicePixelRatio || 1, {clientWidth: w, clientHeight: h} = this.canvas;
      if (!w || !h) return;
      const first = this.scale === undefined;
      this.canvas.width = Math.round(w * ratio);
      this.canvas.height = Math.round(h * ratio);
      if (first || !this.touched) this.fit();
      this._paint();
    }

    // Coverage --------------------------------------------------------------------------------

    // Ask for the coverage, with anchors where they are dragged to; one question at a time.
    _ask(moved) {
      if (!this.world || !this.world.simulated) return;
      this.question = {moved: moved || {}, since: performance.now(), timed: moved !== null};
      if (!this.asking) this._ask_next();
    }

    async _ask_next() {
      const {moved, since, timed} = this.question;
      this.question = null;
      this.asking = true;
      try {
        const answer = await fetch("studio/coverage", {
          method: "POST", headers: {"Content-Type": "application/json"},
          body: JSON.stringify({moved})});
        const buffer = answer.ok ? await answer.arrayBuffer() : new ArrayBuffer(0);
        this.cover = buffer.byteLength ? new CoveragePicture(buffer) : null;
        this._recolour(timed ? since : null);
      } catch { /* the server is gone; the page says so by itself */ }
      this.asking = false;
      if (this.question) this._ask_next();
    }

    _recolour(since = null) {
      if (this.cover && this.shown !== "off") this.cover.paint(this.shown, this._theme());
      this._show_legend();
      this._paint(since);
    }

    _show_legend() {
      if (!this.cover || this.shown === "off") {
        this.legend.replaceChildren();
        return;
      }
      const title = document.createElement("b");
      title.textContent = this.shown === "dop" ? "HDOP" : "anchors in view";
      const items = this.cover.legend.map(([colour, text]) => {
        const item = document.createElement("span"), patch = document.createElement("i");
        patch.style.background = colour;
        item.append(patch, text);
        return item;
      });
      const {mean, worst, none, least_seen} = this.cover.head;
      const said = document.createElement("span");
      said.className = "studio-said";
      said.textContent = this.shown === "seen" ? `at least ${least_seen} everywhere`
        : `mean ${mean.toFixed(2)}, worst ${worst < none ? worst.toFixed(2) : `over ${none}`}`;
      this.legend.replaceChildren(title, ...items, said);
    }

    // Mouse and keys --------------------------------------------------------------------------

    _listen() {
      const canvas = this.canvas;
      canvas.addEventListener("pointerdown", (event) => this._down(event));
      canvas.addEventListener("pointermove", (event) => this._move(event));
      canvas.addEventListener("pointerup", (event) => this._up(event));
      canvas.addEventListener("pointercancel", () => { this.drag = null; this._paint(); });
      canvas.addEventListener("pointerleave", () => { this.here = null; this._tell_status(); });
      canvas.addEventListener("dblclick", () => this._end_path(false));
      canvas.addEventListener("contextmenu", (event) => event.preventDefault());
      canvas.addEventListener("wheel", (event) => this._zoom(event), {passive: false});
      canvas.addEventListener("keydown", (event) => this._key(event));
    }

    _place(event) {
      const box = this.canvas.getBoundingClientRect();
      const px = event.clientX - box.left, py = event.clientY - box.top;
      const raw = this.to_m(px, py);
      const step = event.altKey ? 0.01 : SNAP_M; // of the finest use
      const at = raw.map((v) => Math.round(Math.round(v / step) * step * 1000) / 1000);
      return {px, py, raw, at};
    }

    _down(event) {
      const {px, py, at} = this._place(event);
      this.canvas.focus();
      const can_draw = this.world && this.world.simulated;
      if (event.button !== 0 || (this.tool === "select" && !this._hit(px, py)) || !can_draw) {
        if (event.button === 0) this._choose(null);
        this.drag = {pan: [px - this.left, py - this.bottom]};
      } else if (this.tool === "select") {
        const what = this._hit(px, py);
        this._choose(what);
        const fixed = (what[0] === "wall" && what.length < 3) || (what[0] === "nlos" && what.length < 4);
        this.drag = fixed ? null : {what, from: at, to: null};
      } else if (this.tool === "erase") {
        const what = this._hit(px, py);
        if (what) this.emit({do: "remove", what: what.slice(0, what[0] === "nlos" ? 3 : 2)});
      } else if (this.tool === "wall" || this.tool === "nlos") {
        this.drawn = [at, at];
        this.drag = {wall: true};
      } else if (this.tool === "path") {
        this._path_point(px, py, at);
      } else {
        this.emit({do: "add", what: this.tool, x: at[0], y: at[1]});
      }
      if (this.drag) this.canvas.setPointerCapture(event.pointerId);
      event.preventDefault();
      this._paint();
    }

    _move(event) {
      const {px, py, raw, at} = this._place(event);
      this.here = {at, raw, px, py};
      if (this.drag && this.drag.pan) {
        this.left = px - this.drag.pan[0];
        this.bottom = py - this.drag.pan[1];
        this.touched = true;
      } else if (this.drag && this.drag.what) {
        if (this.drag.to || at[0] !== this.drag.from[0] || at[1] !== this.drag.from[1]) {
          this.drag.to = at;
          if (this.drag.what[0] === "anchor") this._ask({[this.drag.what[1]]: at});
        }
      } else if (this.drag && this.drag.wall) {
        this.drawn[1] = at;
      } else {
        this.canvas.dataset.over = this._hit(px, py) ? "thing" : "";
      }
      this._tell_status();
      this._paint();
    }

    _up() {
      const drag = this.drag;
      this.drag = null;
      if (drag && drag.what && drag.to) {
        this._keep(drag.what, drag.to); // it stays there until the server has answered
        this.emit({do: "move", what: drag.what, x: drag.to[0], y: drag.to[1]});
      }
      if (drag && drag.wall) {
        const wall = this.drawn.flat();
        this.drawn = [];
        this.emit({do: "wall", wall, nlos: this.tool === "nlos"});
      }
      this._paint();
    }

    _keep(what, [x, y]) {
      const world = this.world, [kind, name, index] = what;
      if (kind === "anchor") world.anchors[name].splice(0, 2, x, y);
      else if (kind === "landmark") world.landmarks[name] = [x, y];
      else if (kind === "point") world.path.points[name] = [x, y];
      else if (kind === "center") world.path.center = [x, y];
      else if (kind === "wall") world.walls[name].splice(2 * index, 2, x, y);
      else if (kind === "nlos") {
        world.nlos.find((w) => w[0] === name && w[1] === index).splice(2 + 2 * what[3], 2, x, y);
      }
    }

    _path_point(px, py, at) {
      const near = (point) => {
        const [x, y] = this.to_px(...point);
        return Math.hypot(x - px, y - py) < NEAR_PX;
      };
      if (this.drawn.length > 2 && near(this.drawn[0])) this._end_path(true);
      else if (this.drawn.length > 1 && near(this.drawn.at(-1))) this._end_path(false);
      else this.drawn.push(at);
    }

    _end_path(closed) {
      const points = this.drawn;
      if (this.tool !== "path" || points.length < 2) return;
      this.drawn = [];
      this.emit({do: "path", points, closed});
    }

    _zoom(event) {
      const {px, py} = this._place(event);
      const factor = Math.exp(-0.0015 * event.deltaY);
      const scale = Math.min(Math.max(this.scale * factor, 0.5), 5000);
      this.left = px - (px - this.left) * scale / this.scale;
      this.bottom = py - (py - this.bottom) * scale / this.scale;
      this.scale = scale;
      this.touched = true;
      event.preventDefault();
      this._paint();
    }

    _key(event) {
      const arrows = {ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowDown: [0, -1], ArrowUp: [0, 1]};
      if (event.key === "Escape") { this.drawn = []; this.drag = null; this._choose(null); }
      else if (event.key === "Enter") this._end_path(false);
      else if (event.key === "f") { this.touched = false; this.fit(); }
      else if (this.chosen && ["Delete", "Backspace"].includes(event.key)) {
        this.emit({do: "remove", what: this.chosen.slice(0, this.chosen[0] === "nlos" ? 3 : 2)});
      } else if (this.chosen && event.key in arrows) {
        const at = this._at(this.chosen);
        if (!at) return;
        const step = event.shiftKey ? 1 : SNAP_M, [dx, dy] = arrows[event.key];
        const to = [at[0] + dx * step, at[1] + dy * step].map((v) => Math.round(v * 1000) / 1000);
        this._keep(this.chosen, to);
        this.emit({do: "move", what: this.chosen, x: to[0], y: to[1]});
      } else return;
      event.preventDefault();
      this._paint();
    }

    // Things ----------------------------------------------------------------------------------

    _things() {
      const world = this.world;
      if (!world || !world.simulated) return [];
      const ends = (kind, head, wall) => [
        [[kind, ...head, 0], wall.slice(0, 2)], [[kind, ...head, 1], wall.slice(2)]];
      return [
        ...world.path.points.map((at, k) => [["point", k], at]),
        ...Object.entries(world.anchors).map(([name, at]) => [["anchor", name], at]),
        ...Object.entries(world.landmarks).map(([name, at]) => [["landmark", name], at]),
        ...(world.path.center ? [[["center"], world.path.center]] : []),
        ...world.walls.flatMap((wall, k) => ends("wall", [k], wall)),
        ...world.nlos.flatMap(([fault, k, ...wall]) => ends("nlos", [fault, k], wall)),
      ];
    }

    _at(what) {
      const same = JSON.stringify(what);
      if (this.drag && this.drag.to && JSON.stringify(this.drag.what) === same) return this.drag.to;
      const found = this._things().find(([name]) => JSON.stringify(name) === same);
      return found && found[1];
    }

    _there(what) {
      if (!what) return true;
      if (what[0] === "wall") return what[1] < (this.world.walls || []).length;
      if (what[0] === "nlos") return (this.world.nlos || []).some((w) => w[0] === what[1] && w[1] === what[2]);
      return Boolean(this._at(what));
    }

    _hit(px, py) {
      const far = (at) => { const [x, y] = this.to_px(...at); return Math.hypot(x - px, y - py); };
      let best = null, least = NEAR_PX;
      for (const [what, at] of this._things()) {
        const off = far(at);
        if (off < least - 0.01) { best = what; least = off; }
      }
      if (best) return best;
      const {walls = [], nlos = []} = this.world || {};
      for (const [what, wall] of [...walls.map((w, k) => [["wall", k], w]),
                                  ...nlos.map(([f, k, ...w]) => [["nlos", f, k], w])]) {
        const [ax, ay] = this.to_px(wall[0], wall[1]), [bx, by] = this.to_px(wall[2], wall[3]);
        const length = (bx - ax) ** 2 + (by - ay) ** 2 || 1;
        const s = Math.min(1, Math.max(0, ((px - ax) * (bx - ax) + (py - ay) * (by - ay)) / length));
        if (Math.hypot(ax + s * (bx - ax) - px, ay + s * (by - ay) - py) < 7) return what;
      }
      return null;
    }

    _choose(what, quiet = false) {
      const changed = JSON.stringify(what) !== JSON.stringify(this.chosen);
      this.chosen = what;
      if (changed && !quiet) this.emit({do: "select", what});
      if (changed && quiet) this.emit({do: "select", what: null});
    }

    _tell_status() {
      const parts = [];
      if (this.here) {
        const [x, y] = this.here.at;
        parts.push(`x ${x.toFixed(2)}  y ${y.toFixed(2)} m`);
        const found = this.cover && this.cover.at(...this.here.raw);
        if (found) {
          parts.push(`HDOP ${found.dop < 20 ? found.dop.toFixed(2) : "over 20"}`,
                     `${found.seen} in view`);
        }
      }
      if (this.drag && this.drag.wall) {
        const [[ax, ay], [bx, by]] = this.drawn;
        parts.push(`${Math.hypot(bx - ax, by - ay).toFixed(2)} m long`);
      }
      const can_draw = this.world && this.world.simulated;
      this.status.textContent = [can_draw ? HINTS[this.tool] : "A log is replayed: there is nothing to draw.",
                                 ...parts].join("   ·   ");
    }

    // Painting --------------------------------------------------------------------------------

    _theme() { return this.dark.matches ? "dark" : "light"; }

    _paint(since = null) {
      if (since !== null) this.since = since;
      if (this.waiting) return;
      this.waiting = true;
      requestAnimationFrame(() => {
        this.waiting = false;
        this._draw();
        if (this.since !== undefined && this.since !== null) {
          this.dop_ms.push(performance.now() - this.since);
          this.dop_ms = this.dop_ms.slice(-200);
          this.since = null;
        }
      });
    }

    _draw() {
      if (!this.scale) return;
      const ratio = devicePixelRatio || 1, context = this.canvas.getContext("2d");
      const colours = PALETTES[this._theme()];
      context.setTransform(ratio, 0, 0, ratio, 0, 0);
      context.fillStyle = colours.ground;
      context.fillRect(0, 0, this.canvas.clientWidth, this.canvas.clientHeight);
      context.font = FONT;
      context.lineCap = context.lineJoin = "round";
      this._draw_floor(context, colours);
      this._draw_walls(context, colours);
      this._draw_way(context, colours);
      this._draw_places(context, colours);
      this._draw_new(context, colours);
    }

    _draw_floor(context, colours) {
      if (this.picture) {
        const {origin, width, height, resolution_m} = this.found.map;
        context.save();
        context.translate(...this.to_px(origin[0], origin[1]));
        context.rotate(-origin[2]);
        const w = width * resolution_m * this.scale, h = height * resolution_m * this.scale;
        context.imageSmoothingEnabled = this.scale * resolution_m < 1;
        if (this._theme() === "dark") context.filter = "invert(0.86)";
        context.drawImage(this.picture, 0, -h, w, h);
        context.restore();
      }
      if (this.cover && this.shown !== "off") {
        const {low, step_m, columns, rows} = this.cover.head;
        const [x, y] = this.to_px(low[0] - step_m / 2, low[1] + (rows - 0.5) * step_m);
        context.save();
        if (this.picture) context.globalCompositeOperation = this._theme() === "dark" ? "screen" : "multiply";
        context.imageSmoothingEnabled = true;
        context.drawImage(this.cover.canvas, x, y, columns * step_m * this.scale,
                          rows * step_m * this.scale);
        context.restore();
      }
      this._draw_grid(context, colours);
      if (this.world && this.world.simulated && !this.picture) {
        const [x0, y0] = this.to_px(0, 0), [x1, y1] = this.to_px(...this.world.room);
        context.strokeStyle = colours.wall;
        context.lineWidth = 2;
        context.strokeRect(x0, y1, x1 - x0, y0 - y1);
      }
    }

    _draw_grid(context, colours) {
      const step = [0.1, 0.5, 1, 5, 10, 50, 100].find((s) => s * this.scale >= 26) || 500;
      const [x0, y1] = this.to_m(0, 0), [x1, y0] = this.to_m(this.canvas.clientWidth, this.canvas.clientHeight);
      context.lineWidth = 1;
      context.textAlign = "center";
      const digits = 2 * step < 1 ? 1 : 0;
      for (let k = Math.ceil(x0 / step); k * step <= x1; k++) {
        const x = Math.round(this.to_px(k * step, 0)[0]) + 0.5;
        context.strokeStyle = k % 5 === 0 ? colours.metre : colours.grid;
        context.beginPath(); context.moveTo(x, 0); context.lineTo(x, this.canvas.clientHeight); context.stroke();
        if (k % 2 === 0) this._tick(context, colours, (k * step).toFixed(digits), x, this.canvas.clientHeight - 6);
      }
      context.textAlign = "left";
      for (let k = Math.ceil(y0 / step); k * step <= y1; k++) {
        const y = Math.round(this.to_px(0, k * step)[1]) + 0.5;
        context.strokeStyle = k % 5 === 0 ? colours.metre : colours.grid;
        context.beginPath(); context.moveTo(0, y); context.lineTo(this.canvas.clientWidth, y); context.stroke();
        if (k % 2 === 0 && y < this.canvas.clientHeight - 20) this._tick(context, colours, (k * step).toFixed(digits), 5, y - 3);
      }
    }

    _tick(context, colours, text, x, y) {
      context.lineWidth = 3;
      context.strokeStyle = colours.halo;
      context.strokeText(text, x, y);
      context.fillStyle = colours.muted;
      context.fillText(text, x, y);
      context.lineWidth = 1;
    }

    _line(context, points) {
      context.beginPath();
      points.forEach(([x, y], k) => context[k ? "lineTo" : "moveTo"](...this.to_px(x, y)));
      context.stroke();
    }

    _draw_walls(context, colours) {
      const {walls = [], nlos = []} = this.world || {};
      const draw = (what, wall, colour) => {
        const ends = [0, 1].map((end) => this._at([...what, end]) || wall.slice(2 * end, 2 * end + 2));
        context.strokeStyle = this._is_chosen(what) ? colours.chosen : colour;
        context.lineWidth = 4;
        this._line(context, ends);
        if (this._is_chosen(what) || this.tool === "select") {
          context.fillStyle = colours.ground;
          context.lineWidth = 1.5;
          for (const end of ends) this._dot(context, end, 4);
        }
      };
      walls.forEach((wall, k) => draw(["wall", k], wall, colours.wall));
      nlos.forEach(([fault, k, ...wall]) => draw(["nlos", fault, k], wall, colours.nlos));
    }

    _is_chosen(what) {
      return this.chosen && what.every((part, k) => part === this.chosen[k]);
    }

    _draw_way(context, colours) {
      const {way = [], start = null} = this.found || {};
      const path = this.world && this.world.path;
      context.strokeStyle = colours.way;
      if (path && path.points.length) { // all of it, also what there is no time for
        context.globalAlpha = 0.25;
        context.lineWidth = 3;
        const points = path.points.map((at, k) => this._at(["point", k]) || at);
        this._line(context, path.closed ? [...points, points[0]] : points);
        context.globalAlpha = 1;
      }
      context.lineWidth = 1.5;
      context.setLineDash([6, 4]);
      const dragged = this.drag && this.drag.what && this.drag.what[0] === "point";
      context.globalAlpha = this.busy.hidden ? 1 : 0.3;
      if (way.length && !dragged) this._line(context, way);
      context.globalAlpha = 1;
      context.setLineDash([]);
      if (start && !dragged) {
        const [x, y] = this.to_px(start[0], start[1]);
        context.save();
        context.translate(x, y);
        context.rotate(-start[2]);
        context.beginPath();
        context.moveTo(11, 0); context.lineTo(-6, 6); context.lineTo(-3, 0); context.lineTo(-6, -6);
        context.closePath();
        context.fillStyle = colours.way;
        context.fill();
        context.restore();
      }
      if (!path) return;
      context.fillStyle = colours.ground;
      context.lineWidth = 1.5;
      path.points.forEach((at, k) => {
        context.strokeStyle = this._is_chosen(["point", k]) ? colours.chosen : colours.way;
        this._dot(context, this._at(["point", k]) || at, 4.5);
      });
      if (path.center) {
        const [x, y] = this.to_px(...(this._at(["center"]) || path.center));
        context.strokeStyle = this._is_chosen(["center"]) ? colours.chosen : colours.way;
        context.beginPath();
        context.moveTo(x - 6, y); context.lineTo(x + 6, y);
        context.moveTo(x, y - 6); context.lineTo(x, y + 6);
        context.stroke();
      }
    }

    _dot(context, at, radius) {
      context.beginPath();
      context.arc(...this.to_px(...at), radius, 0, 2 * Math.PI);
      context.fill();
      context.stroke();
    }

    _draw_places(context, colours) {
      const source = this.world && this.world.simulated ? this.world : this.found || {};
      for (const [name, at] of Object.entries(source.landmarks || {})) {
        const place = this._at(["landmark", name]) || at;
        const [x, y] = this.to_px(...place);
        const radius = Math.max(5, (this.world.radius || 0) * this.scale);
        context.fillStyle = colours.landmark;
        context.beginPath();
        if (this.world.radius) context.arc(x, y, radius, 0, 2 * Math.PI);
        else { context.moveTo(x, y - 6); context.lineTo(x + 6, y); context.lineTo(x, y + 6); context.lineTo(x - 6, y); }
        context.fill();
        this._ring(context, colours, ["landmark", name], x, y, radius + 4);
        this._label(context, colours, name, x, y - radius - 6);
      }
      for (const [name, at] of Object.entries(source.anchors || {})) {
        const [x, y] = this.to_px(...(this._at(["anchor", name]) || at).slice(0, 2));
        context.fillStyle = colours.anchor;
        context.strokeStyle = colours.ground;
        context.lineWidth = 1.5;
        context.beginPath();
        context.moveTo(x, y - 9); context.lineTo(x + 8, y + 6); context.lineTo(x - 8, y + 6);
        context.closePath();
        context.fill();
        context.stroke();
        this._ring(context, colours, ["anchor", name], x, y, 13);
        this._label(context, colours, name, x + 19, y - 8);
      }
    }

    _ring(context, colours, what, x, y, radius) {
      if (!this._is_chosen(what)) return;
      context.strokeStyle = colours.chosen;
      context.lineWidth = 2;
      context.beginPath();
      context.arc(x, y, radius, 0, 2 * Math.PI);
      context.stroke();
    }

    _label(context, colours, text, x, y) {
      context.textAlign = "center";
      context.lineWidth = 3;
      context.strokeStyle = colours.halo;
      context.strokeText(text, x, y);
      context.fillStyle = colours.ink;
      context.fillText(text, x, y);
    }

    _draw_new(context, colours) {
      if (!this.drawn.length) return;
      const points = this.tool === "path" && this.here ? [...this.drawn, this.here.at] : this.drawn;
      context.strokeStyle = this.tool === "nlos" ? colours.nlos : this.tool === "wall" ? colours.wall : colours.chosen;
      context.lineWidth = this.tool === "path" ? 2 : 4;
      this._line(context, points);
      context.fillStyle = colours.ground;
      context.lineWidth = 2;
      if (this.tool === "path") this.drawn.forEach((at) => this._dot(context, at, 4.5));
    }
  };
})();
