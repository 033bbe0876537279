// What tests and benchmarks do to a visualizer inside the page: find its controls, move them, look at its picture.
window.hands = {
  pause: (ms) => new Promise((done) => setTimeout(done, ms)),

  // Nothing under way and nothing new on two looks in a row.
  async settled(root, limit = 200000) {
    const end = performance.now() + limit;
    for (let before = null; performance.now() < end; await hands.pause(40)) {
      const now = root.dataset.rendered;
      if (root.dataset.busy === "false" && now === before) return;
      before = now;
    }
    throw new Error(`the visualizer did not come to rest within ${limit} ms`);
  },

  // The picture as text, with every photograph in it replaced by the digest of its bytes.
  async picture(root) {
    let svg = root.querySelector(".camviz-flow")?.outerHTML ?? "";
    for (const url of new Set(svg.match(/blob:[^"]+/g))) {
      const bytes = await (await fetch(url)).arrayBuffer();
      const digest = new Uint8Array(await crypto.subtle.digest("SHA-1", bytes));
      svg = svg.replaceAll(url, digest.join("."));
    }
    return svg;
  },

  controls: (root) => [...root.querySelectorAll("[data-control]")].map((one) => one.dataset.control),

  // Move a control to a place between 0 (one end) and 1 (the other), by the events a browser sends.
  move(root, name, place) {
    const input = root.querySelector(`[data-control="${CSS.escape(name)}"]`).querySelector("input, select");
    if (input.type === "checkbox") {
      if (input.checked !== place > 0.5) input.click();
      return String(input.checked);
    }
    if (input.tagName === "SELECT") input.selectedIndex = Math.round(place * (input.options.length - 1));
    else input.value = Number(input.min) + place * (Number(input.max) - Number(input.min));
    input.dispatchEvent(new Event("input", { bubbles: true }));
    input.dispatchEvent(new Event("change", { bubbles: true }));
    return input.value;
  },

  reset: (root) => root.querySelector('button[data-action="reset"]').click(),
  error: (root) => root.querySelector(".camviz-error:not([hidden])")?.textContent ?? "",

  handles: (root) => [...new Set([...root.querySelectorAll(".camviz-picture [data-drag]")].map((one) => one.dataset.drag))],

  // Count the moves of a pointer over a visualizer's picture, in window.moves; what the browser took together counts apart.
  countMoves(root) {
    window.moves = 0;
    root.querySelector(".camviz-picture").onpointermove = (event) => { window.moves += event.getCoalescedEvents().length || 1; };
  },

  // The middle one of the points of the page where the pointer would take hold of a handle.
  async grip(root, name) {
    const svg = root.querySelector(`.camviz-picture [data-drag="${CSS.escape(name)}"]`).closest(".camviz-fitted");
    for (let i = 0; i < 5; i++) {      // cells that come into view take their true height only then, and push
      svg.scrollIntoView({ block: "center" });
      await hands.pause(40);
    }
    const box = svg.getBoundingClientRect(), points = [];
    for (let i = 0; i < 60 * 60; i++) {
      const [s, t] = [((i % 60) + 0.5) / 60, (Math.floor(i / 60) + 0.5) / 60];
      const [x, y] = [box.left + s * box.width, box.top + t * box.height];
      if (document.elementFromPoint(x, y)?.closest("[data-drag]")?.dataset.drag === name) points.push([x, y]);
    }
    if (!points.length) throw new Error(`the pointer cannot reach the handle ${name}`);
    const [u, v] = [0, 1].map((axis) => points.reduce((sum, point) => sum + point[axis], 0) / points.length);
    return points.reduce((a, b) => (Math.hypot(b[0] - u, b[1] - v) < Math.hypot(a[0] - u, a[1] - v) ? b : a));
  },

  // Words of a picture that are below 12 CSS pixels, cut off by their panel or tile, or over others.
  unreadable(root) {
    const found = [], all = [];
    const size = (text) => { const { a, b } = text.getScreenCTM(); return Math.hypot(a, b); };   // pixels a unit, turned or not
    const seen = (box, edge) => box.left > edge.left - 1 && box.right < edge.right + 1 && box.top > edge.top - 1 && box.bottom < edge.bottom + 1;
    for (const svg of root.querySelectorAll(".camviz-fitted")) {
      if (!svg.getClientRects().length) continue;
      for (const text of svg.querySelectorAll("text")) {
        const box = text.getBoundingClientRect(), words = text.textContent.slice(0, 40);
        const panel = text.closest("svg"), edge = (panel === svg ? svg : panel.firstElementChild).getBoundingClientRect();
        if (!box.width) continue;
        if (parseFloat(getComputedStyle(text).fontSize) * size(text) < 11.95) found.push(`small: ${words}`);
        if (!seen(box, edge)) found.push(`cut: ${words}`);
        all.push([words, box]);
      }
    }
    all.forEach(([words, a], i) => all.slice(i + 1).forEach(([others, b]) => {
      const wide = Math.min(a.right, b.right) - Math.max(a.left, b.left), high = Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top);
      if (wide > 1 && high > 2) found.push(`over each other: ${words} | ${others}`);
    }));
    return found;
  },

  // How much higher the controls with the first tile are than what JupyterLab shows of a notebook, in CSS pixels.
  beyond(root) {
    const tile = root.querySelector(".camviz-tile"), shown = document.querySelector(".jp-NotebookPanel:not(.lm-mod-hidden) .jp-WindowedPanel-outer");
    return tile.getBoundingClientRect().bottom - root.getBoundingClientRect().top - shown.clientHeight;
  },

  // Elements whose words have a contrast below 4.5 with the colour behind them, as "words: contrast".
  weak(selector) {
    const behind = (one) => {
      const [colour, alpha] = hands.colour(getComputedStyle(one).backgroundColor);
      return alpha > 0.99 ? colour : one.parentElement ? behind(one.parentElement) : [255, 255, 255];
    };
    const contrast = (one) => hands.contrast(hands.colour(getComputedStyle(one).color)[0], behind(one));
    const all = [...document.querySelectorAll(selector)].filter((one) => one.offsetParent && contrast(one) < 4.5);
    return all.map((one) => `${one.textContent.trim()}: ${contrast(one).toFixed(1)}`);
  },

  // The same for the words of a picture. Behind them is what lies at their middle: nothing is told of photographs.
  weakInPicture(root) {
    const found = new Set();
    const opacity = (one) => (one.matches("svg svg, svg *") ? Number(getComputedStyle(one).opacity) * opacity(one.parentElement) : 1);
    for (const svg of root.querySelectorAll(".camviz-fitted")) {
      svg.scrollIntoView({ block: "center" });
      const [paper] = hands.colour(getComputedStyle(svg).backgroundColor);
      for (const text of svg.querySelectorAll("text")) {
        const box = text.getBoundingClientRect(), style = getComputedStyle(text);
        const at = document.elementsFromPoint((box.left + box.right) / 2, (box.top + box.bottom) / 2);
        if (!text.textContent.trim() || !at.includes(svg)) continue;
        const own = at.findIndex((one) => text.contains(one));
        const below = at.slice(own + 1, at.indexOf(svg)).reverse().filter((one) => svg.contains(one) && !one.closest("text"));
        if (below.at(-1)?.matches("image")) continue;
        let ground = paper;
        for (const one of below) {
          const [colour, alpha] = hands.colour(getComputedStyle(one).fill);
          ground = hands.mixed(colour, ground, alpha * Number(getComputedStyle(one).fillOpacity) * opacity(one));
        }
        if (style.stroke !== "none") [ground] = hands.colour(style.stroke);      // its halo
        const [ink, alpha] = hands.colour(style.fill);
        const contrast = hands.contrast(hands.mixed(ink, ground, alpha * Number(style.fillOpacity) * opacity(text)), ground);
        if (contrast < 4.495) found.add(`${text.textContent.trim().slice(0, 40)}: ${contrast.toFixed(2)}`);
      }
    }
    return [...found];
  },

  // A computed colour as [[red, green, blue], alpha].
  colour(words) {
    const [r = 0, g = 0, b = 0, alpha = words.startsWith("rgb(") ? 1 : 0] = (words.match(/[\d.]+/g) ?? []).map(Number);
    return [[r, g, b], alpha];
  },

  mixed: (over, under, alpha) => over.map((one, i) => alpha * one + (1 - alpha) * under[i]),

  // The contrast of two colours (WCAG 2.2, "contrast ratio").
  contrast(one, other) {
    const luminance = (rgb) => {
      const [r, g, b] = rgb.map((c) => (c / 255 <= 0.04045 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4));
      return 0.2126 * r + 0.7152 * g + 0.0722 * b;
    };
    const [low, high] = [luminance(one), luminance(other)].sort((a, b) => a - b);
    return (high + 0.05) / (low + 0.05);
  },
};
