"""From a camera's frame to the overlay that answers it: `python tools/benchmarks/capture_delay.py [--echoes 100]`.

In a real JupyterLab Chromium's fake camera shows a film of 640 × 480 by a virtual camera. In one run: an echo, which
neither decodes a frame nor looks for a board and so is the floor; then a guided calibration to its goal, its frames
told apart by whether a solution was being worked out meanwhile. Needs Chromium.
"""

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
import psutil

sys.path.append(str(Path(__file__).resolve().parents[2] / "tests" / "browser"))

from laboratory import LATE_MS, chromium
from test_capture_in_jupyterlab import EXECUTE, START, filmed

ECHO = """def echo(message, buffers):
    widget.delays_ms.append(float(message.get("delay") or "nan"))
    rest = dict(corners=[], ghost=[], squares=True, covered=[], coverage=0, known=[], taken=False, views=0)
    widget.send({"number": message["number"], "size": [640, 480], "sentence": "", "done": False, **rest})
widget._answer = echo"""
LOOKED = """from time import perf_counter
seen, looks = [], widget.session.look
def look(gray, time_s):
    began = perf_counter()
    answer = looks(gray, time_s)
    seen.append((1e3 * (perf_counter() - began), answer.sentence.endswith("worked out.")))
    return answer
del widget._answer
widget.session.look = look
widget.delays_ms.clear()"""
TOLD = """for ms, (looked, solving) in zip(list(widget.delays_ms)[-len(seen) + 1 :], seen):
    print(ms, looked, int(solving))"""


def percentiles(ms: np.ndarray) -> str:
    return f"{len(ms)} | {np.percentile(ms, 50):.0f} | {np.percentile(ms, 95):.0f}" if len(ms) else "0 | - | -"


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--echoes", type=int, default=100)
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder, chromium() as browser, filmed(Path(folder), browser) as anew:
        notebook = anew()
        page = notebook.page

        def wait_until(condition: str) -> None:
            code = f"() => {{ const d = document.querySelector('.camviz-capture').dataset; return {condition}; }}"
            page.wait_for_function(code, timeout=LATE_MS)

        page.evaluate(EXECUTE, ECHO)
        page.click(START)
        wait_until(f"Number(d.answered) > {options.echoes}")
        floor = np.array(page.evaluate(EXECUTE, "print(*list(widget.delays_ms)[1:])").split(), float)
        page.evaluate(EXECUTE, LOOKED)
        wait_until("d.state === 'done'")
        lines = page.evaluate(EXECUTE, TOLD).splitlines()
        ms, looked, solving = np.array([line.split() for line in lines], float).T
        notebook.close()
    print(f"{psutil.cpu_count()} cores, load {psutil.getloadavg()[0]:.1f}")
    print("| frame to overlay, ms | frames | p50 | p95 |\n|---|---|---|---|")
    for name, part in {
        "echo, the floor": floor,
        "guided": ms,
        "guided, nothing is worked out": ms[solving == 0],
        "guided, a solution is worked out": ms[solving == 1],
        "of this the session's own": looked,
    }.items():
        print(f"| {name} | {percentiles(part)} |")


if __name__ == "__main__":
    main()
