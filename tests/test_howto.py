"""The how-to pages for engineers: their commands are run, and print what the pages show.

What differs is written into the pages by: python docs/engineers/console.py
"""

import console
import examples
import pytest


@pytest.fixture(scope="module")
def files(tmp_path_factory, thorough):
    folder = tmp_path_factory.mktemp("examples")
    (examples.write if thorough else examples.write_of_one_and_two)(folder)
    return folder


LONG = (  # a quarter of a minute or more each, or of more than two cameras: with --all
    "calibrate-a-camera",
    "calibrate-a-pair",
    "calibrate-a-rig",
    "calibrate-from-a-film",
    "find-a-camera-on-a-robot",
    "from-a-phone-to-a-dataset",
    "is-it-still-valid",
)


PAGES = [
    pytest.param(page, id=page.stem, marks=[pytest.mark.thorough] if page.stem in LONG else [])
    for page in console.pages()
]


@pytest.mark.parametrize("page", PAGES)
def test_the_commands_of_a_page_print_what_it_shows(page, files):
    assert console.run(page, files) == page.read_text(encoding="utf-8")


def test_there_is_a_page_for_each_task():
    index = (console.HERE / "README.md").read_text(encoding="utf-8")
    assert [page.name for page in console.pages() if f"]({page.name})" not in index] == []
    assert len(console.pages()) == 15


@pytest.mark.parametrize(
    ("shown", "printed", "same"),
    [
        ("fx = 530.80 ± 0.24 px", "fx = 530.85 ± 0.25 px", True),
        ("fx = 530.80 ± 0.24 px", "fx = 545.80 ± 0.24 px", False),
        ("a change of +0.11 px", "a change of -0.11 px", False),
        ("14 of 54", "15 of 54", False),
        ("written ... · ROS", "written 2026-11-23 12:30 · ROS", True),
        ("written ... · ROS", "written 2026-11-23 12:30 · Kalibr", False),
        ("a\n...\nz", "a\nz", True),
        ("a\n...\nz", "a\nb\nc\nz", True),
        ("a\n...\nz", "a\nb\nc", False),
        ("a", "a\nb", False),
    ],
)
def test_what_is_elided_and_a_last_digit_may_vary_and_nothing_else(shown, printed, same):
    again = console.shown_again(tuple(shown.split("\n")), printed.split("\n"))
    assert ("\n".join(again) == shown) == same


def test_a_page_that_no_longer_agrees_shows_what_is_printed_now(tmp_path):
    """A file that it shows is there for the commands below it and not for those above; a status is asked for."""
    text = (
        "```console\n$ camviz inspect a.yml\n$ echo $?\n```\n\n`a.yml`\n```yaml\nnothing: 1\n```\n\n```console\n{}```\n"
    )
    shown = console.renewed(text.format("$ camviz inspect a.yml\nold\n$ echo $?\n0\n"), tmp_path)
    first, second = (console.steps(found["commands"]) for found in console.BLOCK.finditer(shown) if found["commands"])
    assert [each.lines for each in first] == [("camviz: a.yml: there is no such file",), ("2",)]
    refusal, status = second
    assert refusal.lines[0].startswith("camviz: a.yml: ")
    assert "no such file" not in refusal.lines[0]
    assert status.lines == ("2",)
    with pytest.raises(ValueError, match=r"expected status 0, or echo \$\? below it, got 2"):
        console.renewed(text.format("$ camviz inspect a.yml\nold\n"), tmp_path)
    assert "$ cat a.yml\nnothing: 1\n```" in console.renewed(
        "`a.yml`\n```yaml\nnothing: 1\n```\n\n```console\n$ cat a.yml\nold\n```\n", tmp_path
    )
    with pytest.raises(ValueError, match=r"expected camviz …, cat FILE or echo \$\?, got ls"):
        console.renewed("```console\n$ ls\n```\n", tmp_path)
