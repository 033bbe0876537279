"""Write requirements-site.lock and requirements-test.lock: what each of three locks has beyond those before it.

python .github/added_locks.py requirements.lock build/site.lock build/all.lock
"""

import re
import sys
from pathlib import Path


def entries(path: Path) -> list[str]:
    """The entries of a lock, each with its hashes; a package may have several, for different platforms."""
    return re.split(r"\n(?=\S)", path.read_text(encoding="utf-8").strip())


def name(entry: str) -> str:
    return entry.split("==")[0]


reader, *larger = (entries(Path(path)) for path in sys.argv[1:])
held = {name(one) for one in reader}
for what, lock in zip(("site", "test"), larger, strict=True):
    more = [one for one in lock if name(one) not in held]
    held |= {name(one) for one in more}
    Path(f"requirements-{what}.lock").write_text("\n".join(more) + "\n", encoding="utf-8")
