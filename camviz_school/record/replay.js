// Widgets that move without a kernel: their own JavaScript (an anywidget's `render`), unchanged, before a model that answers
// from recorded frames. It finds every .camviz-recorded, and loads its recording when it comes near the screen.
// A classic script, and recordings are scripts too: both may be loaded by a page that was opened as a file.
// Where a recording is one file (record/one_file.py), it hands over its parts by name before they are asked for.
(() => {
  if (window.camvizRecorded) return;   // a second pane in one file brings the player again
  const NEAR = "600px";   // from the screen, where a recording is fetched
  const PANEL = "panel";   // the axis of panels that a button opens (record/panes.py)
  const LATE = "This picture stands still: its recording could not be loaded.";
  const waiting = new Map(), kept = new Map(), sources = new Map(), styled = new WeakMap();

  window.camvizRecorded = (name, content) => waiting.has(name) ? waiting.get(name)(content) : kept.set(name, content);

  // The content of a script that calls camvizRecorded.
  function loaded(address) {
    const name = address.split("/").pop();
    if (kept.has(name)) return Promise.resolve(kept.get(name));
    return new Promise((done, failed) => {
      const script = document.createElement("script");
      waiting.set(name, done);
      Object.assign(script, { src: address, onerror: () => failed(new Error(`${address} could not be loaded`)) });
      document.head.append(script);
    }).finally(() => waiting.delete(name));
  }

  // Where a photograph is.
  const photograph = (base, name) => kept.get(name) ?? base + name;

  // A widget's style sheet, once in the page, or in the shadow root that keeps the page's own sheets out.
  function style(root, css) {
    const sheets = styled.get(root) ?? new Set();
    if (sheets.has(css)) return;
    styled.set(root, sheets.add(css));
    const sheet = document.createElement("style");
    sheet.textContent = css;
    (root.head ?? root).append(sheet);
  }

  // A widget's module and style sheet, once for all its panes.
  function widget(address) {
    if (!sources.has(address)) sources.set(address, loaded(address).then(async ({ esm, css }) => {
      const url = URL.createObjectURL(new Blob([esm], { type: "text/javascript" }));
      const { default: own, render } = await import(url);
      return { css, ...((typeof own === "function" ? await own() : own) ?? { render }) };
    }));
    return sources.get(address);
  }

  // What the packer made of a value (record/packing.py), as it was; `told` says how small each tile is shown.
  function unpacker({ pieces }, base) {
    const tile = ({ $tile, units, texts }, told) => {
      const fitting = units.findLastIndex((unit) => unit <= (told[$tile] ?? 1) * 1.2);
      return texts[Math.max(fitting, 0)];
    };
    const unpacked = (value, told) => {
      if (value === null || typeof value !== "object") return value;
      if (Array.isArray(value)) return value.map((one) => unpacked(one, told));
      if (value.$text) return text(value.$text);
      if (value.$joined) return value.$joined.map((one) => unpacked(one, told)).join("");
      if (value.$tile) return unpacked(tile(value, told), told);
      if (value.$image) return photograph(base, value.$image);
      return Object.fromEntries(Object.entries(value).map(([name, one]) => [name, unpacked(one, told)]));
    };
    const text = (runs) => {
      let whole = "";
      for (let i = 0; i < runs.length; i += 2) whole += pieces.slice(runs[i], runs[i] + runs[i + 1]).join("");
      return whole;
    };
    return unpacked;
  }

  // The recorded states: `snap` finds the one nearest to wished values.
  function states({ axes, sheets }) {
    const first = Object.fromEntries(axes.map((axis) => [axis.name, axis.first]));
    const all = new Map(axes.map((axis) => [axis.name, axis]));
    const alone = new Map(sheets.filter((sheet) => sheet.axes.length === 1).map((sheet) => [sheet.axes[0], sheet.values[0]]));
    const apart = (name, a, b) => {
      if (typeof a !== "number" || typeof b !== "number") return a === b ? 0 : 1;
      const period = all.get(name).period, gap = Math.abs(a - b);
      if (period) return Math.min(gap % period, period - (gap % period)) / period;
      const values = alone.get(name);
      return gap / (values.at(-1) - values[0] || 1);
    };
    const nearest = (name, values, wished) => values.reduce((best, one, i) => (
      apart(name, one, wished) < apart(name, values[best], wished) ? i : best), 0);
    // By what a sheet would lose of a wish: first of what was moved just now, then of what was moved before.
    const loss = (sheet, wished, moved) => {
      const lost = [0, 0];
      for (const { name } of axes) if (!sheet.axes.includes(name)) lost[moved.includes(name) ? 0 : 1] += apart(name, wished[name], first[name]);
      return lost;
    };
    const snap = (wished, moved) => {
      let best = null, least = null;
      for (const sheet of sheets) {
        const [now, before] = loss(sheet, wished, moved);
        if (!best || now < least[0] - 1e-9 || (now < least[0] + 1e-9 && before < least[1] - 1e-9)) [best, least] = [sheet, [now, before]];
      }
      let frame = 0;
      const shown = { ...first };
      best.axes.forEach((name, i) => {
        const at = nearest(name, best.values[i], wished[name]);
        frame = frame * best.values[i].length + at;
        shown[name] = best.values[i][at];
      });
      return { frame: best.frames[frame], shown, axes: best.axes };
    };
    // The recorded value one position on (1) or back (-1); of an angle, all around.
    const stepped = (name, value, sign) => {
      const values = alone.get(name), at = nearest(name, values, value) + sign;
      if (all.get(name).period) return values[(at + values.length) % values.length];
      return values[Math.min(Math.max(at, 0), values.length - 1)];
    };
    return { first, snap, stepped, nearest: (name, value) => alone.get(name)[nearest(name, alone.get(name), value)], has: (name) => all.has(name) };
  }

  // What a hand on the picture does (record/hands.py): new values of the axes that it moves.
  function pulled({ hands = {}, pulls = [] }, periods, wished, [handle, x, y, dx, dy]) {
    const { pulls: lines = {}, places } = hands[handle] ?? {}, values = {};
    for (const [name, [direction, after]] of Object.entries(lines)) {
      const middle = after[(after.length - 1) / 2], period = periods[name];
      const around = period ? period * Math.round((wished[name] - middle) / period) : 0;
      values[name] = along(pulls, after, wished[name] - around, direction === "x" ? dx : dy);
    }
    if (places && Number.isFinite(x)) {
      const [left, top, width, height] = places.cell, [columns, rows] = places.size;
      const held = (place, count) => Math.min(Math.max(Math.floor(place * count), 0), count - 1);
      const at = held((y - top) / height, rows) * columns + held((x - left) / width, columns);
      for (const [name, all] of Object.entries(places.values)) values[name] = all[at];
    }
    return values;
  }

  // The value after a further pull: `after` are the values after each of `pulls`, which rise; beyond them it stays.
  function along(pulls, after, value, further) {
    const line = (from, to, place) => {
      let i = 1;
      while (i < from.length - 1 && (from[0] < from.at(-1) ? from[i] < place : from[i] > place)) i++;
      const share = from[i] === from[i - 1] ? 0 : (place - from[i - 1]) / (from[i] - from[i - 1]);
      return to[i - 1] + Math.min(Math.max(share, 0), 1) * (to[i] - to[i - 1]);
    };
    return line(pulls, after, line(after, pulls, value) + further);
  }

  // The model that `render` gets: its traits are those of a recorded frame.
  function makeModel(content, base, tell) {
    const { traits, frames } = content, unpacked = unpacker(content, base), { first, snap, stepped, nearest, has } = states(content);
    const listeners = new Map(), told = {}, periods = Object.fromEntries(content.axes.map(({ name, period }) => [name, period]));
    const start = { ...snap(first, []), axes: [] };
    let wished = { ...first }, state = start, now = {}, changed = {}, stepping = false;
    const show = (answers) => {
      now = unpacked(frames[state.frame], told);
      if (now.frame && answers) now.frame.answers = answers;
      for (const name of Object.keys(now)) emit(`change:${name}`, now[name]);
      emit("change");
    };
    const emit = (name, ...words) => [...(listeners.get(name) ?? [])].forEach((listener) => listener(...words));
    const wish = (values, exact) => {
      const moved = Object.keys(values).filter(has);
      if (!moved.length) return;
      const before = { ...wished };
      for (const name of moved) {
        const value = values[name], same = nearest(name, value) === state.shown[name] && value !== state.shown[name];
        wished[name] = stepping && same && typeof value === "number" ? stepped(name, value, Math.sign(value - state.shown[name])) : value;
      }
      state = snap(wished, moved);
      const back = Object.keys(first).filter((name) => ![...state.axes, ...moved].includes(name) && before[name] !== first[name]);
      for (const { name } of content.axes) wished[name] = exact && state.axes.includes(name) ? wished[name] : state.shown[name];
      tell(state, back);
    };
    const answer = (message) => {
      const open = wished[PANEL];
      if (message.reset) (wished = { ...first }), (state = start), tell(state, []);
      if (message.reset && open) wish({ [PANEL]: open }, false);   // a reset leaves panels to the reader who opened them
      for (const [name, wanted] of Object.entries(message.panels ?? {})) wish({ [PANEL]: wanted ? name : "" }, false);
      Object.assign(told, message.units);
      wish(message.values ?? message, false);
      for (const drag of message.drags ?? []) wish(pulled(traits, periods, wished, drag), true);
      for (const [handle, key] of message.keys ?? []) {
        const steps = Object.entries(traits.hands?.[handle]?.keys?.[key] ?? {});
        wish(Object.fromEntries(steps.map(([name, sign]) => [name, stepped(name, state.shown[name], sign)])), false);
      }
      show(message.id);
    };
    now = unpacked(frames[state.frame], told);
    tell(state, []);
    return {
      get: (name) => (name in changed ? changed[name] : name in now ? now[name] : name in traits ? traits[name] : state.shown[name]),
      set: (name, value) => { changed[name] = value; },
      save_changes() { const values = changed; changed = {}; answer(values); },
      send: (message) => queueMicrotask(() => answer(message)),
      on: (name, listener) => listeners.set(name, [...(listeners.get(name) ?? []), listener]),
      off: (name, listener) => listeners.set(name, (listeners.get(name) ?? []).filter((one) => listener && one !== listener)),
      keyed: (pressed) => { stepping = pressed; },
    };
  }

  // The line below a pane: what is shown, what went back because it was recorded alone, and how many positions there are.
  function says({ traits, positions, axes }, line) {
    const label = (name) => name === PANEL ? "panel" : traits.controls?.find((one) => one.name === name)?.label ?? (name === "eye" ? "turned by" : name);
    const value = (one, name) => {
      if (name === PANEL) return traits.panels.find((panel) => panel.name === one)?.words ?? "none more";
      if (typeof one !== "number") return one === true ? "on" : one === false ? "off" : one;
      const axis = axes.find((axis) => axis.name === name);
      return axis.period ? `${Math.round(one - axis.first)}°` : String(Number(one.toPrecision(4))).replace("-", "−");
    };
    return (state, back) => {
      const moved = state.axes.map((name) => `${label(name)} ${value(state.shown[name], name)}`);
      const words = [moved.length ? `Shown: ${moved.join(", ")}.` : "", `${positions} positions are recorded; the nearest one is shown.`];
      if (back.length) words.unshift(`Not recorded together: ${back.map(label).join(", ")} went back to the first value.`);
      line.textContent = words.filter(Boolean).join(" ");
    };
  }

  // The still picture stays until the pane has been painted in its place, its photographs at hand: nothing jumps.
  async function play(element) {
    const { recording } = element.dataset, base = recording.slice(0, recording.lastIndexOf("/") + 1);
    const content = await loaded(recording);
    const { css, initialize, render } = await widget(base + content.source);
    style(element.getRootNode(), css);
    const pane = document.createElement("div"), line = element.querySelector(".camviz-recorded-line");
    const stills = [...element.children].filter((one) => one !== line);
    await Promise.all(images([content.frames[0]], base).map((one) => one.decode().catch(() => {})));
    const model = makeModel(content, base, says(content, line));
    pane.addEventListener("keydown", () => model.keyed(true), true);
    pane.addEventListener("pointerdown", () => model.keyed(false), true);
    Object.assign(element.style, { position: "relative" });
    Object.assign(pane.style, { position: "absolute", width: "100%", visibility: "hidden" });
    line.before(pane);
    await initialize?.({ model });
    await render({ model, el: pane });
    await drawn(pane, stills);
    stills.forEach((one) => one.remove());
    pane.removeAttribute("style");
    element.dataset.live = "true";
    element.kept = images(content.frames, base);
  }

  // A widget may draw later than its render returns: until the pane is nearly as high as its stills, what is below would
  // jump up and down again. One that is never that high is shown all the same.
  const AS_HIGH = 0.8, PATIENT_FRAMES = 90;
  async function drawn(pane, stills) {
    const painted = () => new Promise((done) => requestAnimationFrame(done));
    const bottom = stills.length ? stills.at(-1).getBoundingClientRect().bottom - stills[0].getBoundingClientRect().top : 0;
    for (let i = 0; i < PATIENT_FRAMES && pane.offsetHeight < AS_HIGH * bottom; i++) await painted();
    await painted().then(painted);
  }

  // The photographs of some frames, fetched before they are asked for; they stay at hand as long as they are held.
  function images(frames, base) {
    const names = new Set(JSON.stringify(frames).match(/(?<="\$image":")[^"]+/g));
    return [...names].map((name) => Object.assign(new Image(), { fetchPriority: "low", src: photograph(base, name) }));
  }

  const watcher = new IntersectionObserver((entries) => {
    for (const { isIntersecting, target } of entries) {
      if (!isIntersecting) continue;
      watcher.unobserve(target);
      play(target).catch((error) => {
        target.querySelector(".camviz-recorded-line").textContent = LATE;
        console.error(error);
      });
    }
  }, { rootMargin: NEAR });
  window.camvizRecorded.watch = (element) => watcher.observe(element);
  const start = () => document.querySelectorAll(".camviz-recorded").forEach(window.camvizRecorded.watch);
  if (document.readyState === "loading") document.addEventListener("DOMContentLoaded", start);
  else start();
})();
