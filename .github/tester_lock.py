"""Write requirements-test.lock: what a lock of everything has beyond requirements.lock.

python .github/tester_lock.py build/all.lock
"""

import re
import sys
from pathlib import Path


def entries(path: Path) -> list[str]:
    """The entries of a lock, each with its hashes; a package may have several, for different platforms."""
    return re.split(r"\n(?=\S)", path.read_text(encoding="utf-8").strip())


def name(entry: str) -> str:
    return entry.split("==")[0]


held = {name(one) for one in entries(Path("requirements.lock"))}
more = [one for one in entries(Path(sys.argv[1])) if name(one) not in held]
Path("requirements-test.lock").write_text("\n".join(more) + "\n", encoding="utf-8")
