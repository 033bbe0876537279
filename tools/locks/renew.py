"""Renew the locks: the newest versions that pyproject.toml allows, for every platform and Python, with hashes.

    python tools/locks/renew.py        (needs uv and a network)

No lock names a host. The reader's holds the build backend, too; the site's and the tester's hold only what each adds.
"""

import re
import subprocess
from pathlib import Path

ROOT = Path(__file__).resolve().parents[2]
LOCKS = Path(__file__).resolve().parent
BACKEND = "hatchling\neditables\n"
COMPILE = [
    "uv",
    "pip",
    "compile",
    "--universal",
    "--generate-hashes",
    "--no-header",
    "--no-annotate",
    "--no-emit-index-url",
]


def entries(path: Path) -> list[str]:
    """The entries of a lock, each with its hashes; a package may have several, for different platforms."""
    return re.split(r"\n(?=\S)", path.read_text(encoding="utf-8").strip())


def name(entry: str) -> str:
    return entry.split("==")[0]


def keep_what_each_adds(reader: Path, larger: dict[str, Path]) -> None:
    """Write requirements-NAME.lock beside the reader's: what each larger lock has beyond those before it."""
    held = {name(one) for one in entries(reader)}
    for what, lock in larger.items():
        more = [one for one in entries(lock) if name(one) not in held]
        held |= {name(one) for one in more}
        reader.with_name(f"requirements-{what}.lock").write_text("\n".join(more) + "\n", encoding="utf-8")


def main() -> None:
    build, reader = ROOT / "build", LOCKS / "requirements.lock"
    build.mkdir(exist_ok=True)
    (build / "backend.in").write_text(BACKEND)
    site, everything = build / "site.lock", build / "all.lock"
    for words in (
        ["--upgrade", "pyproject.toml", "build/backend.in", "--extra", "lab", "--output-file", reader],
        ["pyproject.toml", "--extra", "site", "-c", reader, "--output-file", site],
        ["pyproject.toml", "--extra", "test", "-c", site, "--output-file", everything],
    ):
        subprocess.run([*COMPILE, *words], cwd=ROOT, check=True)
    keep_what_each_adds(reader, {"site": site, "test": everything})


if __name__ == "__main__":
    main()
