// Times a change of a slider until its picture is on the screen, in the page itself. Two kinds of visualizer, one interface:
// `change(i)` moves the slider to its i-th place, `shown()` resolves when a new picture has been painted.
const painted = () => new Promise((done) => requestAnimationFrame(() => {
  const channel = new MessageChannel();           // the message comes after the frame has been painted
  channel.port1.onmessage = () => done(performance.now());
  channel.port2.postMessage(0);
}));

const once = (target, options, isNew) => new Promise((done) => {
  const watch = new MutationObserver((records) => { if (isNew(records)) { watch.disconnect(); done(); } });
  watch.observe(target, options);
});

window.stopwatch = {
  explorer(root, [name, low, high]) {
    const input = root.querySelector(`[data-control="${name}"] input[type=range]`);
    return {
      change(i) {
        input.value = low + ((high - low) * (i % 41)) / 40;
        input.dispatchEvent(new Event("input", { bubbles: true }));
      },
      async shown() { await once(root, { attributeFilter: ["data-rendered"] }, () => true); return painted(); },
      settled: async () => { await hands.pause(20); await hands.settled(root); },
    };
  },

  naive(root) {
    const handle = root.querySelector(".noUi-handle");
    let latest = performance.now();
    new MutationObserver(() => { latest = performance.now(); }).observe(root, { childList: true, subtree: true });
    const images = (records) => records.flatMap((r) => [...r.addedNodes]).flatMap((n) => (n.querySelectorAll ? [...n.querySelectorAll("img")] : []));
    return {
      change(i) {
        const key = i % 40 < 20 ? "ArrowRight" : "ArrowLeft";   // never as far as the end, where nothing would change
        handle.dispatchEvent(new KeyboardEvent("keydown", { key, bubbles: true }));
      },
      async shown() {
        let image;
        await once(root, { childList: true, subtree: true }, (records) => (image = images(records).at(-1)));
        await image.decode().catch(() => {});
        return painted();
      },
      // Nothing tells when an interact has drawn its last picture, but a quiet while.
      async settled(quiet = 100) { while (performance.now() - latest < quiet) await hands.pause(50); },
    };
  },

  // Milliseconds of `count` single changes, each awaited.
  async single(one, count) {
    const times = [];
    for (let i = 0; i < count; i++) {
      const shown = one.shown(), start = performance.now();
      one.change(i);
      times.push((await shown) - start);
      await one.settled();
    }
    return times;
  },

  // `count` changes in `duration` ms: pictures a second while they last, and ms from the last change to the last picture.
  async drag(one, count, duration) {
    const seen = [];
    let over = false;
    (async () => { while (!over) seen.push(await one.shown()); })();
    const start = performance.now();
    for (let i = 0; i < count; i++) {
      await hands.pause(Math.max(0, start + (i * duration) / count - performance.now()));
      one.change(i);
    }
    const last = performance.now();
    await one.settled(2500);
    over = true;
    const during = seen.filter((time) => time <= last).length;
    return { fps: (during * 1000) / (last - start), settle: seen.at(-1) - last };
  },

  async many(one, count) {
    for (let i = 0; i < count; i++) {
      const shown = one.shown();
      one.change(i);
      await shown;
    }
    await one.settled();
  },
};
