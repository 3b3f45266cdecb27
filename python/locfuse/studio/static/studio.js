// SPDX-License-Identifier: Apache-2.0
// What joins the page, the drawing board, the player and the server.
"use strict";

const SOON_MS = 300; // what is there by then need not be announced

globalThis.studio = {
  editor: null,
  player: null,
  _wanted: null,
  _played: new Map(),
  _ground: 0,
  _due: false,

  mount(id, world) {
    const element = document.getElementById(id);
    if (!element || this.editor) return;
    this.editor = new SceneEditor(element, (said) => emitEvent("studio", said));
    addEventListener("keydown", (event) => {
      const typing = event.target.closest("input, textarea, .cm-editor");
      if (!(event.ctrlKey || event.metaKey) || typing) return;
      const key = event.key.toLowerCase();
      if (key === "z") emitEvent("studio", {do: event.shiftKey ? "redo" : "undo"});
      else if (key === "y") emitEvent("studio", {do: "redo"});
      else return;
      event.preventDefault();
    });
    new ResizeObserver(() => { if (this._due) this._fetch_ground(); }).observe(this.editor.canvas);
    this.editor.use("select");
    this.show(world);
  },

  show(world) {
    if (!this.editor) return;
    this.editor.show(world);
    this._fetch_ground();
  },

  // Map and way take a while where they have to be made first: only the newest answer counts, and
  // nothing is asked while nobody looks at the board.
  async _fetch_ground() {
    const asked = ++this._ground;
    if (this._broken_off) this._broken_off.abort();
    this._due = !this.editor.seen();
    if (this._due) return;
    this._broken_off = new AbortController();
    const timer = setTimeout(() => this.editor.computing(true), SOON_MS);
    try {
      const answer = await fetch("studio/ground", {signal: this._broken_off.signal});
      if (asked !== this._ground || !answer.ok) return;
      const found = await answer.json();
      this.editor.ground(found);
      emitEvent("studio", {do: "ground", message: found.message || "", counts: found.counts || null});
    } catch { /* another was asked for; or the server is gone, which the page says by itself */ } finally {
      clearTimeout(timer);
      if (asked === this._ground) this.editor.computing(false);
    }
  },

  // A tab is made when it is looked at first: what it shows waits for it.
  async _element(id) {
    while (!document.getElementById(id)) {
      await new Promise((resolve) => setTimeout(resolve, 100));
      if (this._wanted) return null;
    }
    return document.getElementById(id);
  },

  // Plays what has these addresses, one after another where they change faster than they load; with
  // `more` some of it still computes.
  async play(id, urls, more) {
    this._wanted = {id, urls, more};
    if (this._loads) return;
    this._loads = true;
    try {
      while (this._wanted) {
        const wanted = this._wanted;
        this._wanted = null;
        await this._play(wanted);
      }
    } finally { this._loads = false; }
  },

  async _play({id, urls, more}) {
    const element = await this._element(id);
    if (!element) return;
    const before = this._played;
    if (!urls.length) {
      this._played = new Map();
      if (this.player) this.player.destroy();
      this.player = null;
      element.replaceChildren();
      return;
    }
    // An address ends with a number of what it holds: what has been loaded need not be again.
    const packed = await Promise.all(
      urls.map(async (url) => before.get(url) || (await fetch(url)).json()));
    this._played = new Map(urls.map((url, k) => [url, packed[k]]));
    const of = (url) => url.split("?")[0];
    if (!this.player || !element.firstChild) {
      const inside = document.createElement("div");
      inside.className = "locfuse-player";
      element.replaceChildren(inside);
      this.player = new LocfusePlayer(inside, packed, {controls: true, more});
    } else if ([...before.keys()].every((url, k) => urls[k] && of(url) === of(urls[k]))) {
      this.player.grow(packed, more);
    } else this.player.show(packed, more);
  },

  // Sends a file as it is; the server says what became of it.
  async upload(input, kind, more) {
    const file = input.files[0];
    if (!file) return;
    input.value = "";
    emitEvent("studio", {do: "uploading", kind, name: file.name});
    let said;
    try {
      const query = new URLSearchParams({kind, name: file.name, ...more});
      const answer = await fetch(`studio/upload?${query}`, {method: "POST", body: file});
      said = await answer.json();
    } catch {
      said = {error: `${file.name}: the upload broke off`};
    }
    emitEvent("studio", {do: "uploaded", kind, name: file.name, ...said});
  },
};
