// What tests and benchmarks do to a visualizer inside the page: find its controls, move them, look at its picture.
window.hands = {
  pause: (ms) => new Promise((done) => setTimeout(done, ms)),

  // Nothing under way and nothing new on two looks in a row.
  async settled(root, limit = 15000) {
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
    const seen = (box, edge) => box.left > edge.left - 1 && box.right < edge.right + 1 && box.top > edge.top - 1 && box.bottom < edge.bottom + 1;
    for (const svg of root.querySelectorAll(".camviz-fitted")) {
      if (!svg.getClientRects().length) continue;
      const scale = svg.getBoundingClientRect().width / svg.viewBox.baseVal.width;
      for (const text of svg.querySelectorAll("text")) {
        const box = text.getBoundingClientRect(), words = text.textContent.slice(0, 40);
        const panel = text.closest("svg"), edge = (panel === svg ? svg : panel.firstElementChild).getBoundingClientRect();
        if (!box.width) continue;
        if (parseFloat(getComputedStyle(text).fontSize) * scale < 11.95) found.push(`small: ${words}`);
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

  // Elements whose words have a contrast below 4.5 with the colour behind them, as "words: contrast".
  weak(selector) {
    const channels = (colour) => (colour.match(/[\d.]+/g) ?? []).map(Number);
    const luminance = (rgb) => {
      const [r, g, b] = rgb.map((c) => (c / 255 <= 0.04045 ? c / 255 / 12.92 : ((c / 255 + 0.055) / 1.055) ** 2.4));
      return 0.2126 * r + 0.7152 * g + 0.0722 * b;
    };
    const behind = (one) => {
      const colour = channels(getComputedStyle(one).backgroundColor);
      return colour.length === 3 || colour[3] > 0.99 ? colour.slice(0, 3) : one.parentElement ? behind(one.parentElement) : [255, 255, 255];
    };
    const contrast = (one) => {
      const [low, high] = [luminance(channels(getComputedStyle(one).color).slice(0, 3)), luminance(behind(one))].sort((a, b) => a - b);
      return (high + 0.05) / (low + 0.05);
    };
    const all = [...document.querySelectorAll(selector)].filter((one) => one.offsetParent && contrast(one) < 4.5);
    return all.map((one) => `${one.textContent.trim()}: ${contrast(one).toFixed(1)}`);
  },
};
