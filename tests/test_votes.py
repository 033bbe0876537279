"""A class votes: each once, on what is open, told no more than may be known, and nothing lost when the server dies."""

import asyncio
import csv
import doctest
import io
import json
import os
import re
import signal
import socket
import sqlite3
import time
from pathlib import Path

import numpy as np
import pytest
from classroom import ask, camviz_class, served
from commandline import ROOT, refused

from camviz.draw import prose
from camviz_clinic.commands.command import main
from camviz_school.course.learning import class_scores, normalised_gain
from camviz_school.course.questions import question, questions
from camviz_school.room import gain as gain_module
from camviz_school.room import hub, membership, shown
from camviz_school.room.address import is_named_safely
from camviz_school.room.gain import gain, gains
from camviz_school.room.limits import Allowance, Limits
from camviz_school.room.site import Site
from camviz_school.room.store import Room, RoomError
from camviz_school.room.tables import answers_csv
from camviz_school.widgets.question import QuestionPage, QuestionWidget

ASKED = questions("05")
FIRST, SECOND = "05.grid", "05.far_rays"
RIGHT = ASKED[FIRST].answer
WRONG = (RIGHT + 1) % len(ASKED[FIRST].choices)
BEFORE = next(one.name for one in ASKED.values() if one.form == "A")


@pytest.fixture
def room(tmp_path):
    opened = Room(tmp_path / "room.sqlite", list(ASKED.values()))
    yield opened
    opened.close()


def students(room, count):
    return [room.student(room.join(room.word)) for _ in range(count)]


def voted(room, name, choices, number=1):
    """A whole vote, by new students where there are not enough."""
    room.open(name, number)
    for student, choice in enumerate(choices, 1):
        if student > room.joined():
            students(room, 1)
        room.vote(student, name, number, choice)
    room.shut(name)


def refusal(status, do, *given):
    with pytest.raises(RoomError) as told:
        do(*given)
    assert told.value.status == status
    return str(told.value)


# What counts ---------------------------------------------------------------------------------------------------------


def test_each_student_counts_once_and_the_last_choice_before_closing_is_theirs(room):
    one, other = students(room, 2)
    room.open(FIRST, 1)
    for choice in (0, 1, WRONG, WRONG):
        room.vote(one, FIRST, 1, choice)
    room.vote(other, FIRST, 1, RIGHT)
    assert room.voted(FIRST, 1) == 2
    assert room.counts(FIRST, 1)[WRONG] == 1
    assert room.counts(FIRST, 1)[RIGHT] == 1
    assert sum(room.counts(FIRST, 1)) == 2


def test_a_vote_after_closing_is_refused_and_changes_nothing(room):
    (one,) = students(room, 1)
    room.open(FIRST, 1)
    room.vote(one, FIRST, 1, WRONG)
    room.shut(FIRST)
    before = room.counts(FIRST, 1)
    assert "closed" in refusal(409, room.vote, one, FIRST, 1, RIGHT)
    assert room.counts(FIRST, 1) == before


def test_a_late_first_vote_is_not_counted_as_a_second(room):
    (one,) = students(room, 1)
    voted(room, FIRST, [WRONG])
    room.open(FIRST, 2)
    refusal(409, room.vote, one, FIRST, 1, RIGHT)
    assert (room.counts(FIRST, 1)[WRONG], room.voted(FIRST, 2)) == (1, 0)


@pytest.mark.parametrize("choice", [None, "", "0", -1, 99, 0.0, True, [0], {"a": 1}, "<script>", float("nan")])
def test_only_the_number_of_a_choice_is_a_vote(room, choice):
    (one,) = students(room, 1)
    room.open(FIRST, 1)
    refusal(400, room.vote, one, FIRST, 1, choice)
    assert room.voted(FIRST, 1) == 0


@pytest.mark.parametrize("name", [None, "05.nothing", "", "04.grid", 5, ["05.grid"], "05.grid'; DROP TABLE vote; --"])
def test_only_a_question_of_the_room_takes_votes(room, name):
    (one,) = students(room, 1)
    room.open(FIRST, 1)
    refusal(400, room.vote, one, name, 1, 0)


def test_the_second_vote_stands_beside_the_first(room):
    voted(room, FIRST, [WRONG, WRONG, RIGHT])
    voted(room, FIRST, [RIGHT, WRONG, RIGHT], 2)
    assert (room.counts(FIRST, 1)[RIGHT], room.counts(FIRST, 2)[RIGHT]) == (1, 2)
    assert room.pairs(FIRST) == [(WRONG, RIGHT), (WRONG, WRONG), (RIGHT, RIGHT)]


def test_votes_come_in_their_order_and_never_after_the_answer(room):
    refusal(409, room.open, FIRST, 2)
    refusal(409, room.reveal, FIRST)
    room.open(FIRST, 1)
    refusal(409, room.open, FIRST, 2)
    refusal(409, room.reveal, FIRST)
    refusal(409, room.open, SECOND, 1)
    refusal(409, room.choose, SECOND)
    room.shut(FIRST)
    room.reveal(FIRST)
    refusal(409, room.open, FIRST, 1)
    refusal(409, room.open, FIRST, 2)


def test_form_a_is_asked_once_and_never_told(room):
    voted(room, BEFORE, [0, 1])
    refusal(409, room.open, BEFORE, 2)
    refusal(409, room.reveal, BEFORE)


def test_at_home_each_answer_stands_and_the_second_follows_the_first(room):
    voted(room, SECOND, [0])
    one, two = 1, students(room, 1)[0]
    room.let_home(True)
    refusal(409, room.vote, two, FIRST, 2, RIGHT)
    room.vote(two, FIRST, 1, WRONG)
    refusal(409, room.vote, two, FIRST, 1, RIGHT)
    room.vote(two, FIRST, 2, RIGHT)
    refusal(409, room.vote, two, FIRST, 2, WRONG)
    refusal(409, room.vote, one, SECOND, 1, RIGHT)  # was asked in class
    refusal(409, room.open, FIRST, 1)
    room.let_home(False)
    refusal(409, room.vote, one, FIRST, 1, RIGHT)
    assert room.pairs(FIRST) == [(WRONG, RIGHT)]


def test_at_home_a_reply_comes_after_the_second_answer_and_not_before(room):
    (one,) = students(room, 1)
    room.let_home(True)
    reply = prose.to_html(ASKED[FIRST].choices[RIGHT].reply)

    def told():
        return next(each for each in shown.to_student(room, one)["questions"] if each["name"] == FIRST)

    assert (told()["open"], told()["discuss"]) == (1, "")
    room.vote(one, FIRST, 1, WRONG)
    assert (told()["open"], told()["discuss"]) == (2, shown.ALONE)
    assert "answer" not in told()
    assert reply not in json.dumps(told())
    room.vote(one, FIRST, 2, RIGHT)
    assert told()["answer"] == RIGHT
    assert told()["replies"][RIGHT] == reply


def test_the_end_deletes_what_joins_a_browser_to_its_votes(room):
    token = room.join(room.word)
    voted(room, FIRST, [RIGHT])
    room.end()
    assert room.student(token) is None
    refusal(410, room.join, room.word)
    refusal(410, room.vote, 1, FIRST, 1, WRONG)
    assert room.counts(FIRST, 1)[RIGHT] == 1
    refusal(410, room.open, FIRST, 1)
    room.choose(FIRST)  # how it went can still be seen
    assert shown.to_teacher(room)["question"]["counts"][1][RIGHT] == 1


def test_a_room_ends_when_its_time_is_over(tmp_path):
    short = Room(tmp_path / "short.sqlite", list(ASKED.values()), days=-1)
    short.join(short.word)
    assert short.end_in_time()
    assert short.ended
    assert not short.end_in_time()
    short.close()


def test_the_file_holds_no_token_no_name_no_address_and_no_time_of_a_vote(room):
    tokens = [room.join(room.word) for _ in range(3)]
    voted(room, FIRST, [0, 1, 2])
    room.close()
    held = b"".join(path.read_bytes() for path in room.path.parent.glob("room.sqlite*"))
    assert not [token for token in tokens if token.encode() in held]
    columns = {
        name: [row[1] for row in sqlite3.connect(room.path).execute(f"PRAGMA table_info({name})")]
        for name in ("vote", "student")
    }
    assert columns == {"vote": ["question", "round", "student", "choice"], "student": ["number", "token"]}
    assert os.name == "nt" or room.path.stat().st_mode & 0o077 == 0


def test_a_second_server_does_not_get_a_room_that_has_one(room):
    assert "another server has this room" in refusal(423, Room, room.path, list(ASKED.values()))


def test_a_file_that_is_no_room_is_named(tmp_path):
    (tmp_path / "letter.sqlite").write_text("Dear reader, " * 100)
    assert "letter.sqlite: is not the file of a room" in refusal(415, Room, tmp_path / "letter.sqlite", [])


# What each page is told ----------------------------------------------------------------------------------------------


def test_the_projector_and_the_students_learn_how_many_and_not_which_until_it_is_revealed(room):
    """The pages' whole state is the same for a class that is right and for one that is wrong."""
    seen = []
    for name, choice in ((FIRST, RIGHT), (FIRST, WRONG)):
        each = Room(room.path.with_name(f"other_{choice}.sqlite"), list(ASKED.values()))
        onlooker = students(each, 1)[0]
        states = []
        for number in (1, 2):
            each.open(name, number)
            for student in students(each, 3) if number == 1 else (2, 3, 4):
                each.vote(student, name, number, choice)
            states += [shown.to_projector(each), shown.to_student(each, onlooker)]
            each.shut(name)
            states += [shown.to_projector(each), shown.to_student(each, onlooker)]
        for state in states:
            state.pop("until", None)
        seen.append(json.dumps(states))
        for words in (
            '"counts"',
            '"answer"',
            '"misconception"',
            *(one.reply.split(".")[0] for one in ASKED[name].choices),
        ):
            assert words not in seen[-1]
        assert '"voted": 3' in seen[-1]
        each.reveal(name)
        assert shown.to_projector(each)["question"]["counts"][2][choice] == 3
        assert shown.to_student(each, onlooker)["question"]["answer"] == RIGHT
        each.close()
    assert seen[0] == seen[1]


def test_the_teacher_learns_the_split_when_the_vote_is_closed(room):
    one, other = students(room, 2)
    room.open(FIRST, 1)
    room.vote(one, FIRST, 1, WRONG)
    assert shown.to_teacher(room)["question"]["counts"] == {}
    assert shown.to_teacher(room)["question"]["rounds"] == [{"round": 1, "voted": 1}]
    room.vote(other, FIRST, 1, WRONG)
    room.shut(FIRST)
    told = shown.to_teacher(room)["question"]
    assert told["counts"][1][WRONG] == 2
    assert told["behind"][WRONG]["misconception"] == ASKED[FIRST].choices[WRONG].misconception
    assert told["behind"][WRONG]["reply"] == prose.to_html(ASKED[FIRST].choices[WRONG].reply)
    assert told["gains"] is None
    voted(room, FIRST, [RIGHT, WRONG], 2)
    told = shown.to_teacher(room)["question"]
    assert (told["gains"][RIGHT], told["gains"][WRONG], told["twice"]) == (0.5, 0.5, 2)


def test_neighbours_are_asked_to_talk_between_the_votes_and_at_no_other_time(room):
    students(room, 1)
    said = []
    for step in (
        lambda: room.open(FIRST, 1),
        lambda: room.shut(FIRST),
        lambda: room.open(FIRST, 2),
        lambda: room.shut(FIRST),
        lambda: room.reveal(FIRST),
    ):
        step()
        said.append(bool(shown.to_student(room, 1)["question"]["discuss"]))
        assert said[-1] == bool(shown.to_projector(room)["question"]["discuss"])
    assert said == [False, True, False, False, False]
    assert "a neighbour who chose another answer" in shown.DISCUSS
    assert "tell each other your names" in shown.DISCUSS


@pytest.mark.parametrize(
    ("right", "of", "words"), [(3, 10, "below"), (4, 10, "between"), (7, 10, "between"), (8, 10, "above")]
)
def test_the_advice_after_a_first_vote_has_crouchs_and_mazurs_limits(right, of, words):
    counts = [0] * len(ASKED[FIRST].choices)
    counts[RIGHT], counts[WRONG] = right, of - right
    assert f"{10 * right} % are right, {words}" in shown.advice(ASKED[FIRST], counts)


# The gain ------------------------------------------------------------------------------------------------------------


def test_the_gain_is_hakes_and_agrees_with_that_of_a_classs_files():
    assert gain(0.4, 0.7) == 0.5
    assert gain(0.5, 0.25) == -0.5
    assert gain(1, 1) is None
    rng = np.random.default_rng(4)
    pairs = [tuple(map(int, pair)) for pair in rng.integers(0, len(ASKED[FIRST].choices), (50, 2))]
    first, last = (np.array([pair[vote] == RIGHT for pair in pairs], float) for vote in (0, 1))
    theirs = normalised_gain(first, last, rng=rng).gain
    assert gains(ASKED[FIRST], pairs)[RIGHT] == pytest.approx(theirs)
    held, kept = (np.mean([pair[vote] == WRONG for pair in pairs]) for vote in (0, 1))
    assert held != kept
    assert gains(ASKED[FIRST], pairs)[WRONG] == pytest.approx((held - kept) / held)  # the share that gave it up


def test_a_class_that_votes_on_both_forms_has_its_gain_from_the_rooms_csv(room, tmp_path):
    """Four students: before the lesson 1 of 4 right at each question, after it 3 of 4."""
    for form, right in (("A", 1), ("B", 3)):
        for one in (each for each in ASKED.values() if each.form == form):
            wrong = (one.answer + 1) % len(one.choices)
            voted(room, one.name, [one.answer if student < right else wrong for student in range(4)])
    voted(room, FIRST, [0, 1, 0, 1])
    voted(room, FIRST, [RIGHT] * 4, 2)
    path = tmp_path / "answers.csv"
    path.write_text(answers_csv(room.answers()), encoding="utf-8")
    scores = class_scores([path], "05")
    assert (len(scores.participants), scores.incomplete) == (4, 0)
    assert (scores.before.mean(), scores.after.mean()) == (0.25, 0.75)
    rows = list(csv.DictReader(io.StringIO(path.read_text())))
    second = [row for row in rows if (row["concept"], row["attempt"]) == ("grid", "2")]
    assert [row["correct"] for row in second] == ["1"] * 4


@pytest.mark.parametrize(("module", "examples"), [(gain_module, 2), (hub, 2)])
def test_the_examples_of_the_docstrings_are_so(module, examples):
    assert doctest.testmod(module) == (0, examples)


# The server ----------------------------------------------------------------------------------------------------------


def test_a_vote_goes_from_the_page_to_the_bars(room):
    async def play(client):
        token = await client.join()
        await client.do("open", number=1)
        answer = await client("api/vote", {"question": FIRST, "round": 1, "choice": WRONG}, token)
        assert (answer.code, json.loads(answer.body)["counted"]) == (200, True)
        await client.do("close")
        late = await client("api/vote", {"question": FIRST, "round": 1, "choice": RIGHT}, token)
        assert (late.code, json.loads(late.body)) == (
            409,
            {"problem": "This vote is closed. Your choice was not counted."},
        )
        told = json.loads((await client.do("reveal")).body)
        assert told["question"]["counts"]["1"][WRONG] == 1
        counts = (await client("api/counts.csv", key=room.teacher_key)).body.decode()
        assert f"{FIRST},1,{'abcd'[WRONG]},1,0," in counts

    served(room, play)


def test_what_waits_is_answered_when_something_changes(room):
    async def play(client):
        token = await client.join()
        seen = json.loads((await client("api/state", key=token)).body)["state"]
        waiting = asyncio.ensure_future(client(f"api/state?seen={seen}", key=token))
        await asyncio.sleep(0.3)
        assert not waiting.done()
        await client.do("open", number=1)
        assert json.loads((await waiting).body)["question"]["open"] == 1
        missed = await client(f"api/state?seen={seen}", key=token)  # who was away meanwhile is told at once
        assert json.loads(missed.body)["question"]["open"] == 1

    served(room, play)


def test_each_key_opens_its_own_door_only(room):
    async def play(client):
        token = await client.join()
        for key in ("", token, room.projector_key, room.word, "é", room.teacher_key + "x"):
            assert (await client("api/do", {"do": "end"}, key)).code == 403
            assert (await client("api/answers.csv", key=key)).code == 403
        for key in ("", "guess", room.word):
            assert (await client("api/state", key=key)).code == 401
            assert (await client("api/vote", {"question": FIRST, "round": 1, "choice": 0}, key)).code == 401
            assert (await client("api/room", key=key)).code == 403
        assert "lessons" not in json.loads((await client("api/room", key=room.projector_key)).body)
        pages = [(await client(page)).body.decode() for page in ("", "teacher", "projector")]
        assert not [key for key in (room.teacher_key, room.projector_key, room.word) for page in pages if key in page]

    served(room, play)


def test_wrong_words_are_refused_and_guessing_is_throttled_also_for_the_right_word(room):
    async def play(client):
        codes = [(await client("api/join", {"word": f"prism-{number:04}x"})).code for number in range(40)]
        assert codes[:30] == [403] * 30
        assert set(codes[31:]) == {429}
        assert (await client("api/join", {"word": room.word})).code == 429
        assert room.joined() == 0

    served(room, play)


def test_the_word_may_be_typed_as_telephones_type_it(room):
    assert room.join(f" {room.word.replace('-', ' ').title()} ")


@pytest.mark.parametrize("word", ["", "\ud800", "x" * 900, 5, None, ["prism"], {"a": "b"}])
def test_anything_else_than_the_word_is_refused(room, word):
    async def play(client):
        assert (await client("api/join", {"word": word})).code in (400, 403)

    served(room, play)


def test_another_origin_and_another_name_are_refused(room):
    vote = {"question": FIRST, "round": 1, "choice": 0}

    async def play(client):
        token, port = await client.join(), client.port
        await client.do("open", number=1)
        for origin in ("http://evil.example", "null", f"http://127.0.0.1:{port + 1}", "http://127.0.0.1", ""):
            assert (await client("api/vote", vote, token, Origin=origin)).code == 403, origin
            assert (await client("api/join", {"word": room.word}, Origin=origin)).code == 403
        assert (await client("api/vote", vote, token, Sec_Fetch_Site="cross-site")).code == 403
        assert (await client("api/vote", vote, token, Content_Type="text/plain")).code == 415
        assert (await client("api/vote", vote, token, Host=f"evil.example:{port}")).code == 421
        assert room.voted(FIRST, 1) == 0
        own = f"http://127.0.0.1:{port}"
        assert (await client("api/vote", vote, token, Origin=own, Sec_Fetch_Site="same-origin")).code == 200
        answer = await client("api/state", key=token, Origin="http://evil.example")
        assert "Access-Control-Allow-Origin" not in answer.headers  # so that a browser gives it to no other page

    served(room, play)


@pytest.mark.parametrize(
    ("host", "safe"),
    [
        *((each, True) for each in ("127.0.0.1:8787", "192.168.4.1", "[::1]:8787", "localhost:1", "LOCALHOST")),
        *((each, False) for each in ("evil.example", "127.0.0.1.evil.example:8787", "", "localhost.evil.example")),
    ],
)
def test_a_host_that_could_be_made_to_lead_here_is_known(host, safe):
    assert is_named_safely(host) == safe


GARBAGE = [
    b"",
    b"null",
    b"[]",
    b"{",
    b"\xff\xfe\x00",
    b"[" * 1000,
    b'{"a":' * 190,
    b'{"choice": 1e999}',
    b"NaN",
    b'"x"',
]


@pytest.mark.parametrize("body", GARBAGE, ids=range(len(GARBAGE)))
def test_garbage_is_refused_in_a_sentence(room, body):
    async def play(client):
        token = await client.join()
        await client.do("open", number=1)
        for path, key in (("api/vote", token), ("api/join", ""), ("api/do", room.teacher_key)):
            answer = await client(path, key=key, raw=body)
            assert answer.code == 400
            assert json.loads(answer.body)["problem"]
        assert (room.joined(), room.voted(FIRST, 1)) == (1, 0)

    served(room, play)


async def refused_or_closed(asking):
    """Whether the server says no, or closes a connection on which too much comes."""
    try:
        return (await asking).code in (400, 413, 431, 599)
    except ConnectionError:
        return True


def test_a_body_or_headers_that_are_too_large_are_not_read(room):
    async def play(client):
        token = await client.join()
        await client.do("open", number=1)
        for size, name in ((1100, "padding"), (10**6, "padding")):
            padded = json.dumps({"question": FIRST, "round": 1, "choice": 0, name: "x" * size})
            assert await refused_or_closed(client("api/vote", key=token, raw=padded))
        assert await refused_or_closed(client("api/state", key="x" * 40_000))
        assert room.voted(FIRST, 1) == 0
        assert (await client("api/state", key=token)).code == 200

    served(room, play)


async def status(reader):
    """The status of the next answer on a connection."""
    head = await reader.readuntil(b"\r\n\r\n")
    await reader.readexactly(int(re.search(rb"Content-Length: (\d+)", head)[1]))
    return int(head.split()[1])


@pytest.mark.thorough
def test_ten_thousand_requests_of_one_client_are_refused_and_take_no_memory(room):
    """One token is slowed down after its thirty; a classroom's address after its thousands; both are few numbers."""
    limits = Limits()

    async def play(client):
        token = await client.join()
        await client.do("open", number=1)
        vote = json.dumps({"question": FIRST, "round": 1, "choice": 0})
        head = f"POST /api/vote HTTP/1.1\r\nHost: 127.0.0.1\r\nAuthorization: Bearer {token}\r\n"
        request = f"{head}Content-Type: application/json\r\nContent-Length: {len(vote)}\r\n\r\n{vote}".encode()
        reader, writer = await asyncio.open_connection("127.0.0.1", client.port)
        codes = []
        for _ in range(100):
            writer.write(request * 100)
            codes += [await status(reader) for _ in range(100)]
        writer.close()
        return codes

    started = time.monotonic()
    codes = served(room, play, limits)
    most = 30 + 3 * (time.monotonic() - started)
    assert (len(codes), set(codes)) == (10_000, {200, 429})
    assert 30 <= codes.count(200) <= most
    assert room.voted(FIRST, 1) == 1
    assert len(limits.token._held) == 1
    assert len(limits.address._held) == 1


def test_an_allowance_comes_back_with_time_and_forgets_the_quietest_client():
    now = [0.0]
    allowance = Allowance(burst=2, rate=1, most=3, clock=lambda: now[0])
    assert [allowance.takes("one") for _ in range(3)] == [True, True, False]
    now[0] = 1.0
    assert [allowance.takes("one") for _ in range(2)] == [True, False]
    for other in "abc":
        allowance.takes(other)
    assert len(allowance._held) == 3
    assert "one" not in allowance._held


def test_every_answer_has_a_policy_that_runs_no_script_of_a_student(room, tmp_path):
    (tmp_path / "index.html").write_text("<h1>The site</h1>")

    async def play(client):
        for path in ("", "teacher", "projector", "static/room.js", "api/state", "nothing", "static/../server.py"):
            policy = (await client(path)).headers["Content-Security-Policy"]
            assert "script-src 'self';" in policy
            assert "unsafe" not in policy
            assert "frame-ancestors 'none'" in policy
        site = await client("site/")
        assert (site.code, site.body) == (200, b"<h1>The site</h1>")
        for path in (
            "site/../room.sqlite",
            "site/%2e%2e/room.sqlite",
            "static/%2e%2e/store.py",
            "static/..%2fstore.py",
        ):
            assert (await client(path)).code in (403, 404), path

    served(room, play, site=Site(tmp_path))


def test_the_pages_have_no_script_and_no_style_of_their_own_and_ask_no_other_host():
    for page in (ROOT / "camviz_school/room/pages").iterdir():
        text = page.read_text(encoding="utf-8")
        assert not re.search(r"https?://|\bon\w+=|style=|eval\(|document\.cookie|localStorage", text), page.name
    pages = [page.read_text(encoding="utf-8") for page in (ROOT / "camviz_school/room/pages").glob("*.html")]
    assert not [page for page in pages if re.search(r"<script(?![^>]* src=)", page) or "<style" in page]


# A server in a process of its own ------------------------------------------------------------------------------------


def test_a_server_that_is_killed_loses_no_acknowledged_vote_and_the_room_goes_on(tmp_path):
    with camviz_class(tmp_path) as (process, port, text):
        word, teacher = re.search(r"join with +(\S+)", text)[1], re.search(r"teacher#(\S+)", text)[1]
        tokens = [ask(port, "api/join", {"word": word})["token"] for _ in range(20)]
        ask(port, "api/do", {"do": "open", "question": FIRST, "number": 1}, teacher)
        for token in tokens:
            assert ask(port, "api/vote", {"question": FIRST, "round": 1, "choice": WRONG}, token)["counted"]
        process.send_signal(signal.SIGKILL)
        process.wait()
    with camviz_class(tmp_path) as (_, port, text):
        assert "goes on" in text
        assert re.search(r"join with +(\S+)", text)[1] == word
        assert ask(port, "api/vote", {"question": FIRST, "round": 1, "choice": RIGHT}, tokens[0])["counted"]
        told = ask(port, "api/do", {"do": "close", "question": FIRST}, teacher)
        assert (told["joined"], told["question"]["counts"]["1"][WRONG], told["question"]["counts"]["1"][RIGHT]) == (
            20,
            19,
            1,
        )
        assert "Only this machine can join" in text


def test_it_listens_where_it_was_told_and_nowhere_else(tmp_path):
    with camviz_class(tmp_path, "05", "--host", "127.0.0.2") as (_, port, text):
        assert f"http://127.0.0.2:{port}/" in text
        socket.create_connection(("127.0.0.2", port), timeout=60).close()
        with pytest.raises(OSError):
            socket.create_connection(("127.0.0.1", port), timeout=60)


def test_a_notebook_joins_by_its_word_and_leaves(tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    with camviz_class(tmp_path) as (_, port, text):
        word = re.search(r"join with +(\S+)", text)[1]
        assert main(["join", word, f"127.0.0.1:{port}"]) == 0
        kept = membership.membership()
        assert kept.word == word
        assert kept.token not in repr(kept)
        assert kept.state()["question"] is None
        with pytest.raises(membership.RefusedError, match="closed"):
            kept.vote(FIRST, 1, 0)
        assert main(["join", "--leave"]) == 0
        assert membership.membership() is None
        with pytest.raises(membership.RefusedError, match="Join the room first"):
            kept.state()
        capsys.readouterr()


def test_joining_nobody_and_a_wrong_word_are_told_in_one_sentence(room, tmp_path, monkeypatch, capsys):
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    folder = tmp_path / "elsewhere"
    folder.mkdir()
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        nobody = probe.getsockname()[1]
    assert "no room answers" in refused(capsys, folder, "join", "prism-0000", f"127.0.0.1:{nobody}")
    assert "such as http://192.168.4.1:8787" in refused(capsys, folder, "join", "prism-0000", "ftp://x/")
    assert "expected the word" in refused(capsys, folder, "join")
    with camviz_class(tmp_path) as (_, port, _text):
        assert "not the word of the room" in refused(capsys, folder, "join", "prism-x", f"127.0.0.1:{port}")


def test_the_command_refuses_what_it_cannot_serve(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert "there is no lesson 99" in refused(capsys, tmp_path, "class", "99")
    assert "there is none" in refused(capsys, tmp_path, "class", "--room", "gone.sqlite")
    assert main(["class", "05", "--host", "192.0.2.77"]) == 2
    assert "cannot be served on" in capsys.readouterr().err


def test_a_qr_code_leads_to_the_room():
    import cv2

    from camviz_school.room.address import qr_terminal

    link = "http://192.168.4.1:8787/#prism-4817"
    rows = qr_terminal(link).splitlines()
    dots = [each for row in rows for each in ([c in "█▀" for c in row], [c in "█▄" for c in row])]
    picture = np.kron(np.array(dots, np.uint8) * 255, np.ones((8, 8), np.uint8))
    assert cv2.QRCodeDetector().detectAndDecode(picture)[0] == link


def test_questions_are_shown_as_prose_and_never_as_what_a_student_sent(room):
    (one,) = students(room, 1)
    room.open(FIRST, 1)
    told = shown.to_student(room, one)["question"]
    assert told["text"] == prose.to_html(question(FIRST).text)
    assert told["choices"] == [prose.inline(choice.text) for choice in question(FIRST).choices]


def test_the_files_are_in_the_package():
    assert {"phone.html", "teacher.html", "projector.html"} <= {
        p.name for p in Path(ROOT, "camviz_school/room/pages").iterdir()
    }


# A notebook votes ----------------------------------------------------------------------------------------------------


async def until(true, seconds=120):
    """Give the kernel's loop time until something is true."""
    for _ in range(int(seconds / 0.02)):
        if true():
            return
        await asyncio.sleep(0.02)
    raise AssertionError("it did not come true")


@pytest.fixture
def asking(tmp_path, monkeypatch):
    """An `ask` of a notebook, by a user who can join rooms."""
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return QuestionWidget(QuestionPage((question(FIRST),), "Predict"))


def test_without_a_room_a_question_is_as_before(asking):
    asking.commit(0, WRONG)
    assert asking.cards[0]["correct"] is False
    assert asking.cards[0]["reply"] == prose.to_html(ASKED[FIRST].choices[WRONG].reply)
    assert asking.room == ""


def test_in_a_room_the_choice_is_sent_and_the_reply_waits_for_the_teacher(asking, room):
    async def play(client):
        await asyncio.to_thread(membership.join, room.word, f"127.0.0.1:{client.port}")
        await client.do("open", number=1)
        asking.commit(0, WRONG)
        assert "Sending" in asking.room
        await until(lambda: "first vote is counted" in asking.room)
        assert room.counts(FIRST, 1)[WRONG] == 1
        replies = [prose.to_html(choice.reply) for choice in ASKED[FIRST].choices]
        assert not [
            reply for reply in replies if reply in json.dumps([asking.cards, asking.still()], ensure_ascii=False)
        ]
        await client.do("close")
        await client.do("open", number=2)
        await until(lambda: "choose again" in asking.room)
        assert asking.cards[0]["chosen"] is None
        asking.commit(0, RIGHT)
        await until(lambda: "second vote is counted" in asking.room)
        await client.do("close")
        await client.do("reveal")
        await until(lambda: asking.cards[0]["correct"] is True)
        assert room.pairs(FIRST) == [(WRONG, RIGHT)]

    served(room, play)


@pytest.mark.parametrize("state", ["gone", "silent", "idle"])
def test_a_room_that_does_not_take_the_vote_holds_up_no_lesson(asking, room, state, monkeypatch):
    """A server that is gone, one that accepts and never answers, and one that asks something else."""
    monkeypatch.setattr(membership.Membership.state, "__defaults__", ("", 0.5))

    async def play(client):
        joined = await asyncio.to_thread(membership.join, room.word, f"127.0.0.1:{client.port}")
        with socket.create_server(("127.0.0.1", 0)) as silent:
            if state != "idle":
                port = silent.getsockname()[1]
                if state == "gone":
                    silent.close()
                moved = json.dumps({**vars(joined), "address": f"http://127.0.0.1:{port}/"})
                membership._path().write_text(moved)
            asking.commit(0, WRONG)
            await until(lambda: asking.cards[0]["correct"] is False)
        assert ("There is no vote" if state == "idle" else "is not reached") in asking.room
        assert "\n" not in asking.room

    served(room, play)


# Under a JupyterHub --------------------------------------------------------------------------------------------------


def test_only_the_hubs_administrators_and_teachers_lead_a_room():
    assert hub.may_lead({"admin": True})
    assert hub.may_lead({"admin": False, "groups": ["students", "teachers"]})
    assert hub.may_lead({"groups": ["staff"]}, "staff")
    assert not any(
        map(hub.may_lead, ({}, {"admin": "yes"}, {"groups": None}, {"groups": ["students"]}, {"name": "teachers"}))
    )


def test_a_service_is_where_the_hub_says_and_says_what_is_missing():
    told = dict.fromkeys(hub.NEEDED, "x") | {
        "JUPYTERHUB_SERVICE_PREFIX": "/services/camviz-class/",
        "JUPYTERHUB_SERVICE_URL": "http://127.0.0.1:8787",
    }
    assert hub.service(told) == ("/services/camviz-class/", "127.0.0.1", 8787)
    with pytest.raises(ValueError, match="which sets JUPYTERHUB_API_TOKEN"):
        hub.service({name: value for name, value in told.items() if name != "JUPYTERHUB_API_TOKEN"})
    with pytest.raises(ValueError, match="an address and a port"):
        hub.service(told | {"JUPYTERHUB_SERVICE_URL": "nowhere"})


def test_below_a_prefix_and_behind_a_proxy_everything_is_as_at_home(room):
    """A proxy passes the hub's own name on, and who asks in a header; another site's page is refused as ever."""

    async def play(client):
        assert (await client("api/state")).code == 404
        inside = "services/camviz-class/"
        assert b"static/phone.js" in (await client(inside, Host="hub.example.org")).body
        assert (await client(f"{inside}static/phone.js", Host="hub.example.org")).code == 200
        word = {"word": room.word}
        own, other = (
            {"Host": "hub.example.org", "Origin": f"https://{name}"} for name in ("hub.example.org", "evil.example")
        )
        assert (await client(f"{inside}api/join", word, **own)).code == 200
        assert (await client(f"{inside}api/join", word, **other)).code == 403
        for number in range(40):
            await client(f"{inside}api/join", {"word": "wrong"}, X_Forwarded_For=f"10.0.0.{number % 2}")
        refused_there = await client(f"{inside}api/join", word, X_Forwarded_For="10.0.0.1")
        assert refused_there.code == 200  # 20 wrong words from each, of 30 that are allowed

    served(room, play, prefix="/services/camviz-class/", proxied=True)
