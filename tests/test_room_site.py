"""A room serves a built site: its own kinds of files and no others, with what its pages need, and the room's script."""

import asyncio
import json
import re
from base64 import b64encode
from hashlib import sha256

import pytest
from classroom import served
from commandline import refused

from camviz_school.course.questions import questions
from camviz_school.room import hub, site
from camviz_school.room.limits import Allowance, Limits
from camviz_school.room.site import Site
from camviz_school.room.store import Room

SCRIPT = "\n  document.documentElement.dataset.mode = 'auto';\n"
LESSON = f"""<!DOCTYPE html><html><head><title>05</title><script>{SCRIPT}</script></head><body>
<div class="camviz-asked"><script type="application/json">{{}}</script></div>
<script defer src="../_static/camviz.js"></script></body></html>"""
SECRET = b"nobody reads this"


@pytest.fixture
def room(tmp_path):
    opened = Room(tmp_path / "room.sqlite", list(questions("05").values()))
    yield opened
    opened.close()


@pytest.fixture
def folder(tmp_path):
    """A small site, and what must not be served: beside it, hidden in it, and of other kinds."""
    built = tmp_path / "built"
    for name in ("lessons", "_static", ".hidden", "lessons/.git"):
        (built / name).mkdir(parents=True, exist_ok=True)
    (built / "index.html").write_text("<html><head></head><body>The site</body></html>", encoding="utf-8")
    (built / "lessons/05_distortion.html").write_text(LESSON, encoding="utf-8")
    (built / "_static/camviz.js").write_text("const x = 1;\n" * 9000, encoding="utf-8")
    (built / "_static/picture.png").write_bytes(bytes(range(256)))
    for path in ("../secret.txt", ".env", ".hidden/page.html", "lessons/.git/page.html", "room.sqlite", "key.pem"):
        (built / path).write_bytes(SECRET)
    (tmp_path / "built-next").mkdir()
    (tmp_path / "built-next/page.html").write_bytes(SECRET)
    return built


OUTSIDE = (
    *("../secret.txt", "%2e%2e/secret.txt", "..%2fsecret.txt", "lessons/../../secret.txt", "..%5csecret.txt"),
    *("/etc/hostname.txt", "%2fetc%2fpasswd", "//etc/passwd", "../built-next/page.html", "..%2Fbuilt-next%2Fpage.html"),
    *(".env", ".hidden/page.html", "lessons/.git/page.html", "lessons/%2egit/page.html", "room.sqlite", "key.pem"),
    *("linked.txt", "linked/secret.txt", "index.html%00.png", "index.html/", "lessons", "lessons/", "C:/x.txt"),
    *("a" * 5000 + ".html", "%ff.html", "index.html%20", "nothing.html"),
)


def test_nothing_outside_the_site_hidden_in_it_or_of_another_kind_is_served(room, folder):
    (folder / "linked.txt").symlink_to(folder.parent / "secret.txt")
    (folder / "linked").symlink_to(folder.parent)

    async def play(client):
        for way in OUTSIDE:
            answer = await client(f"site/{way}")
            assert answer.code in (400, 404), way
            assert SECRET not in (answer.body or b""), way
        reader, writer = await asyncio.open_connection("127.0.0.1", client.port)
        writer.write(
            b"GET /site/../secret.txt HTTP/1.1\r\nHost: 127.0.0.1\r\nConnection: close\r\n\r\n"
        )  # as it stands
        told = await reader.read()
        assert told.startswith(b"HTTP/1.1 404")
        assert SECRET not in told
        writer.close()

    served(room, play, site=Site(folder))


def test_each_file_has_its_type_and_what_keeps_it_to_itself(room, folder):
    async def play(client):
        for way, kind in (
            ("", "text/html; charset=utf-8"),
            ("index.html", "text/html; charset=utf-8"),
            ("_static/camviz.js?v=1", "text/javascript; charset=utf-8"),
            ("_static/picture.png", "image/png"),
        ):
            answer = await client(f"site/{way}")
            assert (answer.code, answer.headers["Content-Type"]) == (200, kind)
            assert answer.headers["X-Content-Type-Options"] == "nosniff"
            assert "frame-ancestors 'none'" in answer.headers["Content-Security-Policy"]
        assert (await client("site/index.html", {}, "")).code == 405
        assert (await client("site/index.html", Host="evil.example")).code == 421

    served(room, play, site=Site(folder))


def test_a_page_runs_its_own_scripts_and_none_that_is_put_into_it_later(room, folder):
    async def play(client):
        policy = (await client("site/lessons/05_distortion.html")).headers["Content-Security-Policy"]
        scripts = re.search("script-src ([^;]*);", policy)[1].split()
        own = f"'sha256-{b64encode(sha256(SCRIPT.encode()).digest()).decode()}'"
        assert own in scripts
        assert not [one for one in scripts if "unsafe" in one or "http" in one]
        assert own not in (await client("site/index.html")).headers["Content-Security-Policy"]

    served(room, play, site=Site(folder))


def test_only_a_page_with_questions_gets_the_rooms_script_and_no_file_is_changed(room, folder):
    async def play(client):
        page = (await client("site/lessons/05_distortion.html")).body.decode()
        assert page.index("_static/camviz.js") < page.index('src="../../static/lesson.js"') < page.index("</body>")
        assert b"lesson.js" not in (await client("site/index.html")).body
        assert (await client("static/lesson.js")).code == 200
        assert (folder / "lessons/05_distortion.html").read_text(encoding="utf-8") == LESSON

    served(room, play, site=Site(folder))


def test_what_is_long_comes_packed_whole_and_once(room, folder):
    async def play(client):
        plain, picture = [await client(f"site/_static/{name}") for name in ("camviz.js", "picture.png")]
        assert plain.body == (folder / "_static/camviz.js").read_bytes()
        assert picture.body == (folder / "_static/picture.png").read_bytes()
        packed = [one.headers.get("X-Consumed-Content-Encoding") for one in (plain, picture)]  # what tornado unpacked
        assert packed == ["gzip", None]
        again = await client("site/_static/camviz.js", If_None_Match=plain.headers["Etag"])
        assert (again.code, again.body or b"") == (304, b"")
        (folder / "_static/camviz.js").write_text("const y = 2;", encoding="utf-8")
        assert (await client("site/_static/camviz.js")).body == b"const y = 2;"

    served(room, play, site=Site(folder))


def test_what_is_kept_in_memory_and_what_is_read_at_all_is_bounded(folder, monkeypatch):
    monkeypatch.setattr(site, "MOST_KEPT", 3000)
    monkeypatch.setattr(site, "MOST_FILE", 2000)
    built = Site(folder)
    for number in range(9):
        (folder / f"{number}.png").write_bytes(bytes([number]) * 1500)
    (folder / "large.png").write_bytes(b"x" * 2001)

    async def read():
        return [(await built.read(built.find(f"{number}.png"))).body[:1] for number in range(9)]

    assert asyncio.run(read()) == [bytes([number]) for number in range(9)]
    assert len(built._kept) == 2
    assert built.find("large.png") is None


def test_who_reads_too_much_is_slowed_down_and_can_still_vote(room, folder):
    limits = Limits(site=Allowance(burst=20, rate=0.0))

    async def play(client):
        token = await client.join()
        await client.do("open", number=1)
        codes = [(await client("site/index.html")).code for _ in range(30)]
        assert codes == [200] * 20 + [429] * 10
        assert (await client("api/vote", {"question": "05.grid", "round": 1, "choice": 0}, token)).code == 200

    served(room, play, limits, site=Site(folder))


def test_a_student_is_told_where_to_read_and_without_a_site_nothing_is_served(room, folder):
    async def told(client):
        token = await client.join()
        await client.do("choose")
        return json.loads((await client("api/state", key=token)).body)["read"], (await client("site/")).code

    assert served(room, told, site=Site(folder)) == ("site/lessons/05_distortion.html", 200)
    assert served(room, told) == ("", 404)
    assert Site(folder).lesson("06") == "site/index.html"


def test_below_a_hubs_prefix_a_page_finds_the_room(room, folder):
    async def play(client):
        inside = "services/camviz-class/"
        page = await client(f"{inside}site/lessons/05_distortion.html", Host="hub.example.org")
        assert b'src="../../static/lesson.js"' in page.body
        assert (await client(f"{inside}static/lesson.js", Host="hub.example.org")).code == 200
        assert (await client("site/index.html")).code == 404

    served(room, play, proxied=True, site=Site(folder), prefix="/services/camviz-class/")


def test_a_folder_that_is_no_site_is_named_before_anything_is_made(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "empty").mkdir()
    said = refused(capsys, tmp_path, "class", "05", "--site", str(tmp_path / "empty"))
    assert "there is no index.html" in said
    assert "start.py site" in said
    assert not list(tmp_path.glob("room_*"))
    told = dict.fromkeys(hub.NEEDED, "x") | {"JUPYTERHUB_SERVICE_URL": "http://127.0.0.1:1"}
    told["CAMVIZ_CLASS_SITE"] = str(tmp_path / "empty")
    with pytest.raises(ValueError, match=r"no index\.html"):
        asyncio.run(hub.serve(["05"], told, tmp_path))
