"""Widgets that move on a static page: recorded once in Python, replayed without a kernel.

A widget of anywidget asks its kernel, and the kernel answers with traits. A static page has no kernel. So `record` asks
all that a reader may ask, along every slider and choice, and stores the answers; `replay.js` gives the widget's own
JavaScript, unchanged, a small model that answers from them.

**A camviz pane** needs nothing else. Controls that belong together are recorded in all combinations:

    from camviz_school.record import record, write_player
    from camviz.views.distortion import DistortionView
    from camviz.widgets import explore

    pane = record(explore(DistortionView(), "k1", "k2", together=("k1", "k2")), "build/recorded")
    write_player("build/recorded")
    page = pane.html("recorded/") + '<script src="recorded/replay.js" defer></script>'

**Your own anywidget** says what is moved; its kernel is asked as it is in a notebook, by traits or by a message:

    from camviz_school.record import Axis, Widget, record

    record(Widget(widget, (Axis.slider("x", 0, 100, 0.1, first=0),), title="A dot"), "build/recorded")

Its JavaScript may call `get`, `set`, `save_changes`, `send`, `on` and `off`. What it sends or sets must hold values by
the names of the axes: {"x": 50}, or {"values": {"x": 50}}. Its frames are all traits that are synchronised. A widget
that needs more (handles that are dragged, texts for small screens) implements `Pane`, as `Explored` does.

**A page that others build** (MyST, Quarto, a learning platform) takes a pane in one file: `write_one_file` makes
a module for MyST's `{anywidget}`, or a page for a frame. See docs/recorded-widgets.md.

**What is recorded.** Each axis alone, the others at their first value, and the combinations of those that belong
together. A wish between two positions is answered by the nearest one. A wish for two axes that were not recorded
together keeps the one that was moved last, and the line below the pane says which one went back.

**What it costs.** `Budget` holds the size of a pane as transferred and the number of its positions. Positions are
thinned until both hold; `BudgetError` says in a sentence what is too large all the same. Texts are stored in pieces
that frames share, photographs once each as WebP; all files are named by their content. They are scripts and images,
which a page may load that was opened as a file: no server is needed. Many panes are recorded in several processes,
which must be started afresh ("spawn"): a fork would share the OpenGL of solid pictures, and wait forever.
"""

from camviz_school.record.axes import Axis
from camviz_school.record.one_file import write_one_file
from camviz_school.record.panes import Pane, Widget
from camviz_school.record.recording import Budget, BudgetError, RecordedPane, record, write_player

__all__ = [
    "Axis",
    "Budget",
    "BudgetError",
    "Pane",
    "RecordedPane",
    "Widget",
    "record",
    "write_one_file",
    "write_player",
]
