"""The smallest widget that answers a slider with a picture: the floor under every time from a slider to its pixels."""

import anywidget
import traitlets

_ESM = """
function render({ model, el }) {
  el.innerHTML = `<div class="camviz-smallest" data-busy="false" data-rendered="0">
    <div data-control="x"><input type="range" min="0" max="100" step="0.1"></div><div></div></div>`;
  const root = el.firstElementChild, input = root.querySelector("input"), picture = root.lastElementChild;
  input.addEventListener("input", () => { root.dataset.busy = "true"; model.send({ x: input.valueAsNumber }); });
  model.on("change:svg", () => {
    picture.innerHTML = model.get("svg");
    root.dataset.busy = "false";
    root.dataset.rendered = String(Number(root.dataset.rendered) + 1);
  });
}
export default { render };
"""
_LINES = "".join(f'<line x1="{10 * i}" y1="0" x2="{10 * i}" y2="100" stroke="gray"/>' for i in range(16))


class Smallest(anywidget.AnyWidget):
    """A slider whose every change the kernel answers with an SVG of 1 kB that shows where it stands."""

    _esm = _ESM
    svg = traitlets.Unicode().tag(sync=True)

    def __init__(self) -> None:
        super().__init__()
        self.on_msg(self._receive)

    def _receive(self, _widget: object, message: dict[str, float], _buffers: object) -> None:
        place = 6 * message["x"]
        self.svg = f'<svg viewBox="0 0 600 100">{_LINES}<circle cx="{place:.1f}" cy="50" r="20" fill="teal"/></svg>'
