"""Runs the how-to pages' commands: `python docs/engineers/console.py [PAGE]` writes what they print into the pages.

A block that begins with ```console holds commands, each after `$ `, and below it what it prints. Known are
`camviz …` and `echo $?`, which prints the status of the command before; a status that no `echo $?` asks for is 0.
A file that a page shows, its name in backticks above a fence, is written there and then, as in docs/recipes.md. Every
page begins in a folder of its own with the files that examples.py writes.

What is printed must be what the page shows, but for this: a line `...` stands for any lines, and `...` inside a line
for any words. A number may differ by 2 %, or by two in its last digit, because machines round differently.
Where only numbers differ, they are replaced. Where words differ, all that the command prints is, and one elides anew.
"""

from __future__ import annotations

import io
import re
import shlex
import shutil
import sys
import tempfile
from collections.abc import Iterator
from contextlib import chdir, redirect_stderr, redirect_stdout
from dataclasses import dataclass
from pathlib import Path

from camviz_clinic.commands.command import main

HERE = Path(__file__).parent
BLOCK = re.compile(
    r"^```console\n(?P<commands>.*?)^```$|^`(?P<path>[^`\n]+)`\n```\w+\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL
)
NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e-?\d+)?")
ELIDED = "..."


@dataclass(frozen=True)
class Step:
    """A command, and the lines that the page shows below it."""

    command: str
    lines: tuple[str, ...]


def pages() -> list[Path]:
    """The pages that show commands with their output."""
    return [path for path in sorted(HERE.glob("*.md")) if "```console" in path.read_text(encoding="utf-8")]


def steps(block: str) -> Iterator[Step]:
    """The commands of a block in their order."""
    for part in re.split(r"^\$ ", block, flags=re.MULTILINE)[1:]:
        command, *lines = part.rstrip("\n").split("\n")
        yield Step(command, tuple(lines))


def renewed(text: str, files: Path) -> str:
    """The text of a page with what its commands print now, run in the folder `files`."""
    with chdir(files):
        return BLOCK.sub(_done, text)


def _done(block: re.Match[str]) -> str:
    """A file is written, commands are run."""
    if block["path"]:
        Path(block["path"]).write_text(block["text"], encoding="utf-8")
        return block[0]
    return f"```console\n{_run(block['commands'])}```"


def _run(block: str) -> str:
    """The block with what its commands print; the same if they print what it shows."""
    asked = list(steps(block))
    printed, status = [], 0
    for step, following in zip(asked, [*asked[1:], None], strict=True):
        if step.command == "echo $?":
            printed.append([str(status)])
            continue
        name, *words = shlex.split(step.command)
        if name == "cat" and len(words) == 1:
            printed.append(Path(words[0]).read_text(encoding="utf-8").splitlines())
            continue
        if name != "camviz":
            raise ValueError(f"expected camviz …, cat FILE or echo $?, got {step.command}")
        out = io.StringIO()
        with redirect_stdout(out), redirect_stderr(out):
            status = main(words)
        if status and (following is None or following.command != "echo $?"):
            raise ValueError(f"{step.command}: expected status 0, or echo $? below it, got {status}: {out.getvalue()}")
        printed.append(out.getvalue().rstrip("\n").split("\n") if out.getvalue() else [])
    return "".join(
        f"$ {step.command}\n" + "".join(f"{line}\n" for line in shown_again(step.lines, lines))
        for step, lines in zip(asked, printed, strict=True)
    )


def shown_again(shown: tuple[str, ...], printed: list[str]) -> list[str]:
    """What a page is to show where this was printed: the same if it agrees.

    >>> shown_again(("a", "...", "took ... s, 1.00 px"), ["a", "b", "c", "took 5 s, 1.02 px"])
    ['a', '...', 'took ... s, 1.00 px']
    >>> shown_again(("took ... s, 1.00 px",), ["took 5 s, 1.30 px"])
    ['took ... s, 1.30 px']
    >>> shown_again(("took ... s, 1.00 px",), ["gave up"])
    ['gave up']
    """
    pairs = _matched(shown, printed)
    return printed if pairs is None else [_refreshed(line, numbers) for line, numbers in pairs]


def _matched(shown: tuple[str, ...], printed: list[str]) -> list[tuple[str, tuple[str, ...]]] | None:
    """Each shown line with the numbers that are printed in its place; None where the words differ."""
    if not shown:
        return None if printed else []
    if shown[0] == ELIDED:
        tails = (_matched(shown[1:], printed[skipped:]) for skipped in range(len(printed) + 1))
        rest = next((tail for tail in tails if tail is not None), None)
        return None if rest is None else [(ELIDED, ()), *rest]
    found = _pattern(shown[0]).fullmatch(printed[0]) if printed else None
    rest = _matched(shown[1:], printed[1:]) if found else None
    return None if found is None or rest is None else [(shown[0], found.groups()), *rest]


def _pattern(shown: str) -> re.Pattern[str]:
    number = f"({NUMBER.pattern})"
    return re.compile(".*?".join(number.join(map(re.escape, NUMBER.split(part))) for part in shown.split(ELIDED)))


def _refreshed(shown: str, printed: tuple[str, ...]) -> str:
    """The line with the numbers that are printed, where one of them is no longer close."""
    held = NUMBER.findall(shown)
    if all(map(_close, held, printed)):
        return shown
    left = iter(printed)
    return NUMBER.sub(lambda _: next(left), shown)


def _close(shown: str, printed: str) -> bool:
    mantissa, _, exponent = shown.partition("e")
    last = 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))
    return abs(float(shown) - float(printed)) <= max(0.02 * float(shown), 2.01 * last if "." in mantissa else 0)


def run(page: Path, examples: Path) -> str:
    """The text of a page with what its commands print now, run in a copy of the folder `examples`."""
    with tempfile.TemporaryDirectory() as folder:
        files = Path(shutil.copytree(examples, Path(folder) / "files"))
        return renewed(page.read_text(encoding="utf-8"), files)


if __name__ == "__main__":
    from examples import write

    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder))
        for page in [Path(word) for word in sys.argv[1:]] or pages():
            page.write_text(run(page, Path(folder)), encoding="utf-8")
