"use strict";
// One slide at a time, by keys, clicks and swipes. Its number stays in the address, so that a page that is loaded again
// goes on where it was. `?print` leaves all slides below each other.
(() => {
  const slides = [...document.querySelectorAll(".slide")];
  const help = document.querySelector(".help");
  const root = document.documentElement;
  let now = 0;

  function show(number) {
    slides[now].classList.remove("now");
    slides[now].querySelector(".near")?.classList.remove("near");
    now = Math.max(0, Math.min(slides.length - 1, number));
    slides[now].classList.add("now");
    history.replaceState(null, "", `#${slides[now].id}`);
  }

  function part(name) {
    const found = slides.findIndex((slide) => slide.dataset.part === name);
    if (found >= 0) show(found);
  }

  function turnLight() {
    const dark = getComputedStyle(root).colorScheme === "light dark"
      ? matchMedia("(prefers-color-scheme: dark)").matches : root.style.colorScheme === "dark";
    root.style.colorScheme = dark ? "light" : "dark";
  }

  function enlarge() { // twice as large about the pointer, for labels that the last row cannot read
    slides[now].querySelector(".panels")?.classList.toggle("near");
  }

  const keys = {
    ArrowRight: () => show(now + 1), ArrowDown: () => show(now + 1), PageDown: () => show(now + 1),
    " ": (event) => show(now + (event.shiftKey ? -1 : 1)), Enter: () => show(now + 1),
    ArrowLeft: () => show(now - 1), ArrowUp: () => show(now - 1), PageUp: () => show(now - 1), Backspace: () => show(now - 1),
    Home: () => show(0), End: () => show(slides.length - 1),
    d: turnLight, z: enlarge, p: () => window.print(), "?": () => { help.hidden = !help.hidden; },
    f: () => document.fullscreenElement ? document.exitFullscreen() : root.requestFullscreen(),
  };

  if (new URLSearchParams(location.search).has("print")) return;
  document.body.classList.add("shown");
  show(Math.max(0, slides.findIndex((slide) => `#${slide.id}` === location.hash)));
  help.hidden = now !== 0;
  addEventListener("hashchange", () => {
    help.hidden = true;
    show(slides.findIndex((slide) => `#${slide.id}` === location.hash));
  });
  addEventListener("keydown", (event) => {
    if (event.ctrlKey || event.metaKey || event.altKey) return;
    const act = keys[event.key] ?? (/^[0-9]$/.test(event.key) ? () => part(event.key) : null);
    if (!act) return;
    event.preventDefault();
    if (event.key !== "?") help.hidden = true;
    act(event);
  });
  addEventListener("click", (event) => {
    if (!String(getSelection())) show(now + (event.clientX < innerWidth / 4 ? -1 : 1));
    help.hidden = true;
  });

  addEventListener("mousemove", (event) => {
    const shown = slides[now].querySelector(".panels");
    if (!shown) return;
    const x = 100 * event.clientX / innerWidth, y = 100 * event.clientY / innerHeight;
    shown.style.transformOrigin = `${x}% ${y}%`;
  });

  let begun = null;
  addEventListener("touchstart", (event) => { begun = event.touches.length === 1 ? event.touches[0] : null; }, { passive: true });
  addEventListener("touchend", (event) => {
    const ended = event.changedTouches[0];
    const across = begun ? ended.clientX - begun.clientX : 0;
    if (begun && Math.abs(across) > 40 && Math.abs(across) > Math.abs(ended.clientY - begun.clientY)) {
      event.preventDefault();
      show(now + (across < 0 ? 1 : -1));
    }
    begun = null;
  });
})();
