// The pane of every visualizer: controls and a picture. It draws nothing itself and knows no mathematics:
// it tells the kernel what the reader wants and shows the picture that comes back.

const SETTLE_MS = 10;   // idle time after which a draft is replaced by the fine picture; with none, the two would share the processors
const LINKED_MS = 120;  // the same for a draft that was not asked for here: another widget's hand is at work, and may go on
const LATE_MS = 6000;   // silence of the kernel after which the reader is told
const LATE = "No answer yet. The kernel is at work on another cell, or it was restarted: then run this cell again.";

function render({ model, el }) {
  const root = build(`<div class="camviz-explorer" data-busy="false" data-rendered="0">
    <div class="camviz-controls"></div><div class="camviz-error" role="alert" hidden></div><div class="camviz-picture"></div></div>`);
  const [controls, error, picture] = root.children;
  const hidesStill = build("<style></style>");   // while this lives, the saved picture is not needed
  hidesStill.textContent = model.get("still_hidden");
  el.replaceChildren(hidesStill, root);

  const say = (words) => { error.hidden = !words; error.textContent = words; };
  const ask = asker(model, root, () => say(LATE));
  const inputs = model.get("controls").map((control) => makeControl(control, (value, draft) => {
    ask({ values: { [control.name]: value } }, draft);
  }));
  inputs.forEach((input) => controls.append(input.element));
  const reset = build(`<button type="button" data-action="reset">Reset</button>`);
  reset.addEventListener("click", () => ask({ reset: true }, false));
  controls.append(reset);

  const showValues = () => {
    const values = model.get("values");
    inputs.forEach((input) => { if (!ask.pending(input.name)) input.show(values[input.name]); });
  };
  let newest = null, showing = false;
  const showFrame = async () => {      // one picture at a time, and always the newest: a slow browser skips, it never starves
    newest = model.get("frame");
    ask.answered(newest);
    if (showing) return;
    showing = true;
    while (newest) {
      const frame = newest;
      newest = null;
      say(frame.error ? `This state could not be drawn. ${frame.error}` : "");
      await swap(picture, frame);
      refold();
      root.dataset.rendered = String(Number(root.dataset.rendered) + 1);
    }
    showing = false;
    ask.shown();
  };
  const told = {};      // by the name of the tile
  const watcher = new ResizeObserver(() => tellUnits(picture, told, ask));
  watcher.observe(picture);
  const refold = folding(picture);
  const stopHands = hands(picture, ask);
  keepKeys(root);
  model.on("change:values", showValues);
  model.on("change:frame", showFrame);
  showValues();
  showFrame();
  return () => {
    watcher.disconnect();
    stopHands();
    model.off("change:values", showValues);
    model.off("change:frame", showFrame);
  };
}

// At most one request is under way; wishes that come meanwhile merge into the next one, so the latest wins.
function asker(model, root, late) {
  let id = Date.now() % 1e9, flying = null, wish = null, settle = null, patience = null;
  const send = () => {
    flying = wish; wish = null;
    flying.id = ++id;
    root.dataset.busy = "true";
    patience = setTimeout(late, LATE_MS);
    model.send(flying);
  };
  const ask = (part, draft) => {
    clearTimeout(settle);
    settle = null;
    if (part.reset) wish = null;
    wish ??= { values: {}, drags: [], keys: [], units: {}, draft };
    wish.draft = draft;
    wish.reset ||= part.reset;
    Object.assign(wish.units, part.units);
    Object.assign(wish.values, part.values);
    for (const [handle, x, y, dx, dy] of part.drags ?? []) {
      const last = wish.drags.at(-1);
      if (last && last[0] === handle) wish.drags[wish.drags.length - 1] = [handle, x, y, last[3] + dx, last[4] + dy];
      else wish.drags.push([handle, x, y, dx, dy]);
    }
    wish.keys.push(...(part.keys ?? []));
    if (!flying) send();
  };
  ask.answered = (frame) => {
    if (flying && frame.answers !== flying.id) return;
    const pause = flying ? SETTLE_MS : LINKED_MS;
    flying = null;
    clearTimeout(patience);
    clearTimeout(settle);
    settle = null;
    if (wish) return send();
    if (frame.draft) settle = setTimeout(() => ask({}, false), pause);
  };
  ask.shown = () => { root.dataset.busy = String(Boolean(flying || settle)); };
  ask.pending = (name) => Boolean(wish && name in wish.values);
  return ask;
}

// Photographs are loaded before the picture is replaced: no flash, no half-drawn state. They travel as data: addresses,
// for a blob's address is resolved by another process, which takes longer than all the rest of this function.
async function swap(picture, frame) {
  let html = frame.html;
  await Promise.all(Object.entries(frame.photographs ?? {}).map(async ([name, data]) => {
    const address = dataAddress(new Uint8Array(data.buffer, data.byteOffset, data.byteLength));
    html = html.replaceAll(`"attached:${name}"`, `"${address}"`);
    await loaded(address);
  }));
  const held = (element) => (picture.contains(element) ? element.dataset.drag : null);
  const focused = held(document.activeElement);
  const fresh = build(html);
  keepKeys(fresh);
  if (picture.firstElementChild) patch(picture.firstElementChild, fresh);
  else picture.append(fresh);
  if (focused && held(document.activeElement) !== focused) {
    picture.querySelector(`[data-drag="${CSS.escape(focused)}"]`)?.focus({ preventScroll: true });
  }
}

// In a narrow page each tile but the first folds away under its name; what the reader folded stays so in the next picture.
function folding(picture) {
  const folded = new Set();
  const refold = () => {
    for (const button of picture.querySelectorAll(".camviz-fold")) {
      button.setAttribute("aria-expanded", String(!folded.has(button.textContent)));
    }
  };
  picture.addEventListener("click", ({ target }) => {
    const name = target.closest(".camviz-fold")?.textContent;
    if (name && !folded.delete(name)) folded.add(name);
    if (name) refold();
  });
  return refold;
}

// Words are larger, in the picture's units, where a tile is shown small: the kernel is told, so that they make room.
function tellUnits(picture, told, ask) {
  const units = {};
  for (const tile of picture.querySelectorAll(".camviz-tile")) {
    const svg = tile.lastElementChild, wide = svg.clientWidth;
    const unit = wide ? Math.max(1, svg.viewBox.baseVal.width / wide) : 1;
    const name = tile.dataset.tile;
    if (Math.abs(unit / (told[name] ?? 1) - 1) > 0.04) units[name] = told[name] = Number(unit.toFixed(2));
  }
  if (Object.keys(units).length) ask({ units }, false);
}

// Make `old` equal to `fresh`, child by child. Most of a picture stays as it is from one change to the next, and what is
// not touched the browser need not lay out again; a whole new picture takes a quarter longer to get onto the screen.
function patch(old, fresh) {
  if (old.isEqualNode(fresh)) return;
  if (kind(old) !== kind(fresh)) return old.replaceWith(fresh);
  if (old.nodeType === Node.TEXT_NODE) return void (old.data = fresh.data);
  for (const { name, value } of fresh.attributes) if (old.getAttribute(name) !== value) old.setAttribute(name, value);
  const before = [...old.childNodes], after = [...fresh.childNodes];
  before.slice(after.length).forEach((child) => child.remove());
  after.forEach((child, i) => (before[i] ? patch(before[i], child) : old.append(child)));
}

// The name of a node and of all its attributes.
function kind(node) {
  return [node.nodeName, ...(node.getAttributeNames?.() ?? [])].join();
}

function dataAddress(bytes) {
  return `data:image/${bytes[0] === 0x89 ? "png" : "jpeg"};base64,${bytes.toBase64?.() ?? byHand(bytes)}`;
}

// Base64 in browsers from before 2025: the other way takes a millisecond less for a fine picture.
function byHand(bytes) {
  let text = "";
  for (let i = 0; i < bytes.length; i += 8192) text += String.fromCharCode(...bytes.subarray(i, i + 8192));
  return btoa(text);
}

function loaded(address) {
  const image = new Image();
  return new Promise((done) => {
    image.onload = image.onerror = () => done(image);
    image.src = address;
  });
}

// Pointer and keys on the picture's handles, in the picture's own units.
function hands(picture, ask) {
  let held = null;
  const at = (event, svg) => {
    const box = svg.getBoundingClientRect(), view = svg.viewBox.baseVal, scale = view.width / box.width;
    return [view.x + (event.clientX - box.left) * scale, view.y + (event.clientY - box.top) * scale];
  };
  const down = (event) => {
    const handle = event.target.closest("[data-drag]")?.dataset.drag;
    if (!handle || event.button) return;
    const svg = event.target.closest("svg.camviz-svg");
    const [x, y] = at(event, svg);
    held = { handle, svg, x, y, moved: false };
    picture.setPointerCapture(event.pointerId);
    picture.querySelector(`[data-drag="${CSS.escape(handle)}"]`).focus({ preventScroll: true });
    event.preventDefault();
  };
  const move = (event) => {
    if (!held) return;
    const [x, y] = at(event, held.svg);
    ask({ drags: [[held.handle, x, y, x - held.x, y - held.y]] }, true);
    Object.assign(held, { x, y, moved: true });
  };
  const up = () => {      // a click is a drag of no length
    if (held && !held.moved) ask({ drags: [[held.handle, held.x, held.y, 0, 0]] }, false);
    held = null;
  };
  const key = (event) => {
    const handle = event.target.closest?.("[data-drag]")?.dataset.drag;
    if (!handle || !/^(Arrow(Left|Right|Up|Down)|[+=-])$/.test(event.key)) return;
    ask({ keys: [[handle, event.key === "=" ? "+" : event.key]] }, true);
    event.preventDefault();
  };
  const wheel = (event) => {
    const handle = event.target.closest?.("[data-drag]")?.dataset.drag;
    if (!handle || !event.ctrlKey) return;      // plain scrolling belongs to the notebook
    ask({ keys: [[handle, event.deltaY < 0 ? "+" : "-"]] }, true);
    event.preventDefault();
  };
  const all = { pointerdown: down, pointermove: move, pointerup: up, pointercancel: up, keydown: key, wheel };
  for (const [type, listener] of Object.entries(all)) picture.addEventListener(type, listener, { passive: false });
  return () => { for (const [type, listener] of Object.entries(all)) picture.removeEventListener(type, listener); };
}

// JupyterLab takes the arrow keys from whatever does not say, on the focused element itself, that it needs them.
function keepKeys(part) {
  for (const element of part.querySelectorAll("input, select, button, [tabindex]")) element.dataset.lmSuppressShortcuts = "true";
}

let count = 0;

function makeControl(control, changed) {
  const id = `camviz-${++count}`;
  const make = control.choices.length ? makeChoice : control.low === null ? makeSwitch : makeSlider;
  const element = build(`<div class="camviz-control"><label for="${id}"></label></div>`);
  element.dataset.control = control.name;
  element.title = control.help;
  const label = element.firstElementChild;
  label.textContent = control.label;
  if (control.unit) label.append(" ", build(`<span class="unit"></span>`)), (label.lastChild.textContent = `[${control.unit}]`);
  const show = make(control, id, element, changed);
  return { name: control.name, element, show };
}

function makeSlider({ label, low, high, step }, id, element, changed) {
  const range = build(`<input type="range" id="${id}" min="${low}" max="${high}" step="${step}">`);
  const number = build(`<input type="number" step="${step}" aria-label="number">`);
  number.setAttribute("aria-label", `${label}, as a number`);
  const decimals = Math.max(0, Math.ceil(-Math.log10(step) - 1e-9));
  const written = (value) => Number(value.toFixed(decimals + 2));
  let shown = low;
  const commit = () => {
    if (Number.isNaN(number.valueAsNumber)) return void (number.value = written(shown));
    if (number.valueAsNumber === written(shown)) return;
    range.value = number.value;
    changed(shown = number.valueAsNumber, false);
  };
  range.addEventListener("input", () => { number.value = range.value; changed(shown = range.valueAsNumber, true); });
  number.addEventListener("change", commit);
  number.addEventListener("keydown", (event) => { if (event.key === "Enter") commit(); });  // no change event in JupyterLab
  element.append(range, number);
  return (value) => {
    range.value = shown = value;
    if (document.activeElement !== number) number.value = written(value);
  };
}

function makeChoice({ choices }, id, element, changed) {
  const select = build(`<select id="${id}"></select>`);
  select.append(...choices.map((words) => new Option(words, words)));
  select.addEventListener("change", () => changed(select.value, false));
  element.append(select);
  return (value) => { select.value = value; };
}

function makeSwitch(_control, id, element, changed) {
  const box = build(`<input type="checkbox" id="${id}">`);
  box.addEventListener("change", () => changed(box.checked, false));
  element.append(box);
  return (value) => { box.checked = value; };
}

function build(html) {
  const template = document.createElement("template");
  template.innerHTML = html.trim();
  return template.content.firstElementChild;
}

export default { render };
