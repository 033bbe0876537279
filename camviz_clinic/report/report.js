// The report's links: a bar, its picture and its board are one choice. Without this every picture is on the page.
for (const linked of document.querySelectorAll(".linked")) {
  const all = [...linked.querySelectorAll("[data-choose]")];
  const figures = [...linked.querySelectorAll("figure[data-view]")];
  const shown = figures.map((figure) => figure.dataset.view);
  const bars = all.filter((link) => !link.classList.contains("board"));

  const choose = (view) => {
    for (const figure of figures) figure.classList.toggle("chosen", figure.dataset.view === view);
    for (const link of all) {
      const chosen = link.dataset.choose === view;
      link.classList.toggle("chosen", chosen);
      link.setAttribute("aria-current", String(chosen));
      if (chosen && link.classList.contains("board")) link.parentNode.append(link);    // in front of the others
    }
    for (const bar of bars) bar.setAttribute("tabindex", bar.dataset.choose === view ? "0" : "-1");
    linked.dataset.chosen = view;
  };
  linked.addEventListener("click", (event) => {
    const link = event.target.closest("[data-choose]");
    if (!link) return;
    event.preventDefault();
    choose(link.dataset.choose);
    bars.find((bar) => bar.dataset.choose === link.dataset.choose)?.focus({ preventScroll: true });
  });
  linked.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowDown: 1, ArrowLeft: -1, ArrowUp: -1 }[event.key];
    if (!step || !event.target.closest("[data-choose]")) return;
    event.preventDefault();
    const next = shown[shown.indexOf(linked.dataset.chosen) + step];
    if (!next) return;
    choose(next);
    bars.find((bar) => bar.dataset.choose === next)?.focus({ preventScroll: true });
  });
  const follow = () => {                                   // a finding's link names a picture
    const figure = figures.find((one) => `#${one.id}` === decodeURIComponent(location.hash));
    if (figure) { choose(figure.dataset.view); figure.scrollIntoView({ block: "nearest" }); }
  };
  addEventListener("hashchange", follow);
  linked.classList.add("live");
  choose(shown.includes(linked.dataset.first) ? linked.dataset.first : shown[0]);
  follow();
}
