// The pane of every visualizer: controls and a picture. It draws nothing itself and knows no mathematics:
// it tells the kernel what the reader wants and shows the picture that comes back.

const SETTLE_MS = 10;   // idle time after which a draft is replaced by the fine picture; with none, the two would share the processors
const LINKED_MS = 120;  // the same for a draft that was not asked for here: another widget's hand is at work, and may go on
const LATE_MS = 6000;   // silence of the kernel after which the reader is told
const TELL_MS = 1000;   // rest after which a screen reader is told what has changed
const SWIPE_PX = 8;     // by which a finger shows whether it means the slider or the page
const STICKY = 0.3;     // of the window's height: larger controls would hide the picture that they change
const SCALE = "--camviz-scale";   // of words, on the whole page; an event of that name tells of a change
const MOST_KEYS = 100;  // waiting for a slow picture; the kernel takes no more than twice as many
const LATE = "No answer yet. The kernel is at work on another cell, or it was restarted: then run this cell again.";
const AGAIN = "Run this cell again (Shift + Enter).";
const GONE = {
  restarting: `The kernel was restarted, and this picture stands still. ${AGAIN}`,
  autorestarting: `The kernel died and was started again; this picture stands still. ${AGAIN}`,
  dead: "The kernel has died, and this picture stands still. Restart it (menu Kernel), and run this cell again.",
  terminating: `The kernel was shut down, and this picture stands still. ${AGAIN}`,
};

function render({ model, el }) {
  const root = build(`<div class="camviz-explorer" role="group" data-busy="false" data-rendered="0">
    <div class="camviz-controls" role="group"></div><div class="camviz-error" role="alert" hidden></div><div class="camviz-picture"></div>
    <div class="camviz-more" role="group" aria-label="more panels"></div><div class="camviz-said" role="status"></div></div>`);
  const [controls, error, picture, more, said] = root.children;
  const name = nameApart(model.get("_title"));
  root.setAttribute("aria-label", name);
  controls.setAttribute("aria-label", `Controls of ${name}`);
  const hidesStill = build("<style></style>");   // while this lives, the saved picture is not needed
  hidesStill.textContent = model.get("still_hidden");
  el.replaceChildren(hidesStill, root);

  const told = { ...model.get("frame").units };   // picture units to a CSS pixel, by the name of the tile
  const say = (words) => { error.hidden = !words; error.textContent = words; };
  const ask = asker(model, root, () => say(LATE));
  const foot = build(`<div class="camviz-foot"><button type="button" data-action="reset">Reset</button><button type="button" data-action="scale" title="for the back row: all pictures on this page with words twice as large">Large words</button><p class="camviz-help" aria-hidden="true"></p></div>`);
  const [reset, large, help] = foot.children;
  const hint = (words) => { said.textContent = help.textContent = words; };
  const inputs = model.get("controls").map((control) => makeControl(control, (value, draft) => {
    ask({ values: { [control.name]: value } }, draft);
  }, hint));
  inputs.forEach((input) => controls.append(input.element));
  reset.addEventListener("click", () => ask({ reset: true }, false));
  controls.append(foot);
  showHelp(controls, help);
  const showOpened = opening(more, model, ask);
  const stopScaling = presentation(large, model.get("_scale"), () => tellUnits(picture, told, ask));

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
  const watcher = new ResizeObserver(() => tellUnits(picture, told, ask));
  watcher.observe(picture);
  const refold = folding(picture);
  const tell = announcer(model, said);
  const stopHands = hands(picture, ask);
  const stopWatching = watchKernel(model, (words) => {
    ask.stop();
    say(words);
    root.dataset.live = "false";
    controls.inert = more.inert = true;
  });
  keepKeys(root);
  const stopSticking = stick(root, controls);
  model.on("change:values", showValues);
  model.on("change:opened", showOpened);
  model.on("change:frame", showFrame);
  model.on("change:frame", tell);
  showValues();
  showOpened();
  showFrame();
  return () => {
    watcher.disconnect();
    stopHands();
    stopSticking();
    stopScaling();
    stopWatching();
    ask.stop();
    model.off("change:values", showValues);
    model.off("change:opened", showOpened);
    model.off("change:frame", showFrame);
    model.off("change:frame", tell);
  };
}

// Below the picture a button for each panel that is not there at first: it opens the panel, and closes it again. A page
// without a kernel opens one at a time, of those that were recorded (record/panes.py).
function opening(more, model, ask) {
  const buttons = (model.get("panels") ?? []).map(({ name, words }) => {
    const button = build(`<button type="button"></button>`);
    button.dataset.opens = name;
    button.addEventListener("click", () => ask({ panels: { [name]: button.getAttribute("aria-pressed") === "false" } }, false));
    return { name, words, button };
  });
  more.append(...buttons.map(({ button }) => button));
  more.hidden = !buttons.length;
  return () => {
    for (const { name, words, button } of buttons) {
      const open = model.get("opened").includes(name);
      button.setAttribute("aria-pressed", String(open));
      button.textContent = `${open ? "−" : "+"} ${words}`;
    }
  };
}

// The title, with a number where the page has a visualizer of that name already: no two groups are called the same.
function nameApart(title) {
  const taken = new Set([...document.querySelectorAll(".camviz-explorer")].map((one) => one.ariaLabel));
  let name = title;
  for (let i = 2; taken.has(name); i++) name = `${title}, ${i}`;
  return name;
}

// Controls that are not too large stay at the notebook's upper edge. JupyterLab lets what is too wide scroll within its
// output, where nothing can stick to the edge of the notebook: not so around a visualizer, which is never too wide.
function stick(root, controls) {
  const watcher = new ResizeObserver(([{ contentRect }]) => {
    for (let one = root.parentElement; one && !one.matches(".jp-Cell"); one = one.parentElement) one.classList.add("camviz-unclipped");
    controls.classList.toggle("camviz-sticky", contentRect.height < STICKY * innerHeight);
  });
  watcher.observe(controls);
  return () => watcher.disconnect();
}

// Calls `gone` with a sentence as soon as the kernel that draws is no more. JupyterLab and Notebook lend widgets their
// connection (IKernelConnection); where a page lends none, the comm tells, and after that only silence.
function watchKernel(model, gone) {
  const kernel = model.widget_manager?.kernel;
  const changed = (_, status) => { if (GONE[status]) gone(GONE[status]); };
  const shut = () => gone(GONE.terminating);
  const cut = () => { if (!kernel?.statusChanged) gone(GONE.restarting); };
  kernel?.statusChanged?.connect(changed);
  kernel?.disposed?.connect(shut);
  model.on("comm_live_update", cut);
  return () => {
    kernel?.statusChanged?.disconnect(changed);
    kernel?.disposed?.disconnect(shut);
    model.off("comm_live_update", cut);
  };
}

// Tells a screen reader, once a state that was asked for here has rested, in which words its description differs.
function announcer(model, said) {
  let before = model.get("frame").described ?? "", timer = null;
  return () => {
    clearTimeout(timer);
    timer = setTimeout(() => {
      const { described, draft, answers } = model.get("frame");
      if (draft || !described) return;
      const known = new Set(before.split("; "));
      if (described !== before && answers) said.textContent = described.split("; ").filter((part) => !known.has(part)).join("; ");
      before = described;
    }, TELL_MS);
  };
}

// The help of the control under the pointer, or else of the one that has the focus.
function showHelp(controls, help) {
  const show = (event) => {
    const control = event.target.closest(".camviz-control") ?? document.activeElement.closest?.(".camviz-control");
    help.textContent = controls.contains(control) ? control.lastElementChild.textContent : "";
  };
  const focus = () => show({ target: document.activeElement });
  controls.addEventListener("pointerover", show);
  controls.addEventListener("pointerleave", focus);
  controls.addEventListener("focusin", show);
  controls.addEventListener("focusout", (event) => { if (!controls.contains(event.relatedTarget)) help.textContent = ""; });
}

// At most one request is under way; wishes that come meanwhile merge into the next one, so the latest wins.
function asker(model, root, late) {
  let id = Date.now() % 1e9, flying = null, wish = null, settle = null, patience = null, stopped = false;
  const send = () => {
    flying = wish; wish = null;
    flying.id = ++id;
    root.dataset.busy = "true";
    patience = setTimeout(late, LATE_MS);
    model.send(flying);
  };
  const ask = (part, draft) => {
    if (stopped) return;
    clearTimeout(settle);
    settle = null;
    if (part.reset) wish = null;
    wish ??= { values: {}, panels: {}, drags: [], keys: [], units: {}, draft };
    wish.draft = draft;
    wish.reset ||= part.reset;
    Object.assign(wish.units, part.units);
    Object.assign(wish.values, part.values);
    Object.assign(wish.panels, part.panels);
    for (const [handle, x, y, dx, dy] of part.drags ?? []) {
      const last = wish.drags.at(-1);
      if (last && last[0] === handle) wish.drags[wish.drags.length - 1] = [handle, x, y, last[3] + dx, last[4] + dy];
      else wish.drags.push([handle, x, y, dx, dy]);
    }
    if (wish.keys.length < MOST_KEYS) wish.keys.push(...(part.keys ?? []));
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
  ask.stop = () => {
    stopped = true;
    clearTimeout(patience);
    clearTimeout(settle);
    flying = wish = settle = null;
    ask.shown();
  };
  ask.shown = () => { root.dataset.busy = String(Boolean(flying || settle)); };
  ask.pending = (name) => Boolean(wish && name in wish.values);
  return ask;
}

// Photographs are loaded before the picture is replaced: no flash, no half-drawn state. They travel as data: addresses,
// for a blob's address is resolved by another process, which takes longer than all the rest of this function. On a page
// without a kernel they are files, and come as addresses (record/replay.js).
async function swap(picture, frame) {
  let html = frame.html;
  const loading = Object.entries(frame.photographs ?? {}).map(([name, data]) => {
    const address = typeof data === "string" ? data : dataAddress(new Uint8Array(data.buffer, data.byteOffset, data.byteLength));
    html = html.replaceAll(`"attached:${name}"`, `"${address}"`);
    return loaded(address);
  });
  const fresh = build(html);      // while the photographs load
  keepKeys(fresh);
  await Promise.all(loading);
  const held = (element) => (picture.contains(element) ? element.dataset.drag : null);
  const focused = held(document.activeElement);
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

// The words of all pictures on the page `first` times as large (CAMVIZ_SCALE), and at the button's press twice or once.
function presentation(button, first, resized) {
  const page = document.documentElement, scale = () => Number(page.style.getPropertyValue(SCALE)) || 1;
  const follow = () => { button.setAttribute("aria-pressed", String(scale() > 1)); resized(); };
  const set = (wanted) => { page.style.setProperty(SCALE, String(wanted)); document.dispatchEvent(new Event(SCALE)); };
  button.addEventListener("click", () => set(scale() > 1 ? 1 : 2));
  document.addEventListener(SCALE, follow);
  if (first > 1 && !page.style.getPropertyValue(SCALE)) set(first);
  button.setAttribute("aria-pressed", String(scale() > 1));
  return () => document.removeEventListener(SCALE, follow);
}

// Words are larger, in the picture's units, where a tile is shown small: the kernel is told, so that they make room.
function tellUnits(picture, told, ask) {
  const units = {}, scale = Number(document.documentElement.style.getPropertyValue(SCALE)) || 1;
  for (const svg of picture.querySelectorAll(".camviz-fitted")) {
    const tile = svg.parentElement, wide = svg.clientWidth;
    const unit = wide ? Math.min(20, Math.max(1, (scale * svg.viewBox.baseVal.width) / wide)) : 1;
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
    if (image.complete) done(image);   // at hand already: Firefox tells that only a frame later
  });
}

// Pointer and keys on the picture's handles, in the picture's own units. An svg is measured when the pointer goes down,
// and again only after the page has scrolled: never in between, for that would lay the page out at every move.
function hands(picture, ask) {
  let held = null;
  const measure = (svg) => {
    const box = svg.getBoundingClientRect(), view = svg.viewBox.baseVal, scale = view.width / box.width;
    return { x: view.x - box.left * scale, y: view.y - box.top * scale, scale };
  };
  const at = (event) => {
    held.place ??= measure(held.svg);
    return [held.place.x + event.clientX * held.place.scale, held.place.y + event.clientY * held.place.scale];
  };
  const down = (event) => {
    const target = event.target.closest("[data-drag]");
    if (!target || event.button || held) return;
    held = { id: event.pointerId, handle: target.dataset.drag, svg: target.closest("svg.camviz-svg"), moved: false };
    [held.x, held.y] = at(event);
    picture.setPointerCapture(event.pointerId);
    target.focus({ preventScroll: true });
    event.preventDefault();
  };
  const move = (event) => {
    if (event.pointerId !== held?.id) return;
    const [x, y] = at(event);
    ask({ drags: [[held.handle, x, y, x - held.x, y - held.y]] }, true);
    Object.assign(held, { x, y, moved: true });
  };
  const up = (event) => {      // a click is a drag of no length
    if (event.pointerId !== held?.id) return;
    if (!held.moved) ask({ drags: [[held.handle, held.x, held.y, 0, 0]] }, false);
    held = null;
  };
  const touch = (event) => {      // a finger on a handle drags it, and scrolls elsewhere; Chromium obeys no touch-action inside an svg
    if (event.touches.length === 1 && event.target.closest("[data-drag]")) event.preventDefault();
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
  const scrolled = () => { if (held?.svg.isConnected) held.place = null; };
  const all = { pointerdown: down, pointermove: move, pointerup: up, pointercancel: up, touchstart: touch, keydown: key, wheel };
  for (const [type, listener] of Object.entries(all)) picture.addEventListener(type, listener, { passive: false });
  document.addEventListener("scroll", scrolled, { capture: true, passive: true });
  return () => {
    for (const [type, listener] of Object.entries(all)) picture.removeEventListener(type, listener);
    document.removeEventListener("scroll", scrolled, { capture: true });
  };
}

// JupyterLab takes the arrow keys from whatever does not say, on the focused element itself, that it needs them.
function keepKeys(part) {
  for (const element of part.querySelectorAll("input, select, button, [tabindex]")) element.dataset.lmSuppressShortcuts = "true";
}

function makeControl(control, changed, hint) {
  const id = `camviz-${Math.random().toString(36).slice(2)}`;      // every visualizer loads this file anew: a count would repeat
  const make = control.choices.length ? makeChoice : control.low === null ? makeSwitch : makeSlider;
  const element = build(`<div class="camviz-control"><label for="${id}"></label></div>`);
  element.dataset.control = control.name;
  const label = element.firstElementChild;
  label.textContent = control.label;
  if (control.unit) label.append(" ", build(`<span class="unit"></span>`)), (label.lastChild.textContent = `[${control.unit}]`);
  const back = build(`<button type="button" class="camviz-back">↺</button>`);
  const [input, show] = make(control, id, element, changed, hint);
  const restore = () => { show(control.first, true); changed(control.first, false); showBack(control.first); input.focus(); };
  const showBack = (value) => { back.hidden = value === control.first; };
  back.setAttribute("aria-label", `Reset ${control.label}`);
  back.title = `back to ${control.first === true ? "on" : control.first === false ? "off" : written(control, control.first)}`;
  back.addEventListener("click", restore);
  label.addEventListener("dblclick", restore);
  const help = build(`<span hidden id="${id}-help"></span>`);
  help.textContent = [control.help, rangeOf(control)].filter(Boolean).join(" — ");
  element.querySelectorAll("input, select").forEach((one) => one.setAttribute("aria-describedby", help.id));
  element.append(back, help);
  return { name: control.name, element, show: (value) => { show(value, false); showBack(value); } };
}

// A slider's value in as many decimals as its steps have, and two more.
function written({ step }, value) {
  if (typeof value !== "number") return value;
  const decimals = Math.max(0, Math.ceil(-Math.log10(step) - 1e-9));
  return Number(value.toFixed(decimals + 2));
}

function rangeOf(control) {
  if (control.low === null || control.choices.length) return "";
  const unit = control.unit && ` ${control.unit}`;
  return `${written(control, control.low)} to ${written(control, control.high)}${unit}, at first ${written(control, control.first)}`;
}

function makeSlider(control, id, element, changed, hint) {
  const { label, low, high, step, first } = control;
  const track = build(`<span class="camviz-track"><input type="range" id="${id}" min="${low}" max="${high}" step="${step}"></span>`);
  const number = build(`<input type="number" min="${low}" max="${high}" step="${step}">`);
  const range = track.firstElementChild;
  track.style.setProperty("--first", String((first - low) / (high - low)));
  number.setAttribute("aria-label", `${label}, as a number`);
  number.setAttribute("aria-invalid", "false");      // what is between two steps may be shown, and what is typed is held
  let shown = NaN, typing = false;
  const show = (value, force) => {
    if (value === shown && !force) return;
    range.value = shown = value;
    range.setAttribute("aria-valuetext", written(control, value) + (control.unit && ` ${control.unit}`));
    if (!typing || force) number.value = written(control, value), (typing = false);
  };
  const commit = () => {
    typing = false;
    const typed = number.valueAsNumber, held = Math.min(Math.max(typed, low), high);
    if (Number.isNaN(typed) || typed === written(control, shown)) return show(shown, true);
    if (held !== typed) hint(`${label} goes from ${rangeOf(control).split(",")[0]}: ${typed} is held at ${written(control, held)}.`);
    show(held, true);
    changed(held, false);
  };
  const moved = (value) => { show(value, true); changed(value, true); };
  const swiped = fingers(range, moved);
  range.addEventListener("input", () => { if (swiped(range.valueAsNumber)) range.value = shown; else moved(range.valueAsNumber); });
  number.addEventListener("input", () => { typing = true; });
  number.addEventListener("change", commit);
  number.addEventListener("keydown", (event) => { if (event.key === "Enter") commit(); });  // no change event in JupyterLab
  element.append(track, number);
  return [range, show];
}

// A slider jumps to a finger at once, though the finger may be about to scroll the page. Until it goes sideways or lifts,
// the function that this returns keeps the value and says true; the browser takes a finger that scrolls (pointercancel).
function fingers(range, moved) {
  let finger = null;
  const on = (type, listener) => range.addEventListener(type, listener);
  on("pointerdown", (event) => { finger = event.pointerType === "touch" ? { x: event.clientX, value: range.valueAsNumber } : null; });
  on("pointermove", (event) => { if (finger && Math.abs(event.clientX - finger.x) > SWIPE_PX) finger = null; });
  on("pointercancel", () => { finger = null; });
  on("pointerup", () => { if (finger) moved(finger.value); finger = null; });
  return (value) => { if (finger) finger.value = value; return finger !== null; };
}

function makeChoice({ choices }, id, element, changed) {
  const select = build(`<select id="${id}"></select>`);
  select.append(...choices.map((words) => new Option(words, words)));
  select.addEventListener("change", () => changed(select.value, false));
  element.append(select);
  return [select, (value) => { if (select.value !== value) select.value = value; }];
}

function makeSwitch(_control, id, element, changed) {
  const box = build(`<input type="checkbox" id="${id}">`);
  box.addEventListener("change", () => changed(box.checked, false));
  element.append(box);
  return [box, (value) => { box.checked = value; }];
}

function build(html) {
  const template = document.createElement("template");
  template.innerHTML = html.trim();
  return template.content.firstElementChild;
}

export default { render };
