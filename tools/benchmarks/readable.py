"""What of every picture cannot be read in a real JupyterLab, on screens from a telephone to a desk, in every lesson.

    python tools/benchmarks/readable.py [NN ...] [--width 375 720 800 1440]

Prints each word that is below 12 CSS pixels, cut off by its panel, or over another; 720 is what 1440 leaves at a zoom
of 200 %. Needs Chromium; half a minute a lesson.
"""

import argparse
import shutil
import sys
import tempfile
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.append(str(HERE.parents[1] / "tests" / "browser"))

from laboratory import ROOT, Notebook, chromium, jupyterlab  # noqa: E402


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("lessons", nargs="*", help="numbers of lessons; all of them when none is given")
    parser.add_argument("--width", nargs="*", type=int, default=[375, 720, 800, 1440])
    given = parser.parse_args()
    total = 0
    with tempfile.TemporaryDirectory() as home:
        shutil.copytree(ROOT / "lessons", Path(home) / "lessons")
        paths = [path.name for path in sorted((Path(home) / "lessons").glob("*.ipynb"))]
        with jupyterlab(Path(home) / "lessons", Path(home) / "private") as address, chromium() as browser:
            for name in [name for name in paths if not given.lessons or name[:2] in given.lessons]:
                lesson = Notebook(browser, address, name)
                lesson.run_all()
                for width in given.width:
                    found = lesson.unreadable(width)
                    total += len(found)
                    print(f"{name}, {width} px: {len(found)}", *found, sep="\n    ", flush=True)
                lesson.close()
    print(f"{total} in all")
    return int(total > 0)


if __name__ == "__main__":
    sys.exit(main())
