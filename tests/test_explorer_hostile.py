"""Whatever a page sends to any view, the widget answers, and no picture has a place that is no number."""

import re

import pytest
from every_view import STATES

from camviz.widgets import explore

NO_PLACE = re.compile(r'="[^"]*\b(nan|inf)\b[^"]*"')
IN_WORDS = re.compile(r"<(title|desc)>.*?</\1>|aria-label=\"[^\"]*\"")
FAR = 99_999
NAN = float("nan")
SHOVES = [(FAR, -FAR, FAR, -FAR), (-FAR, FAR, -FAR, FAR), (0, 0, NAN, 0), (0, 0, 0, NAN), (NAN, 0, 1, 1)]


@pytest.mark.parametrize("name", STATES)
def test_no_message_of_a_page_draws_what_is_no_number(name):
    explorer = explore(STATES[name]())
    handles = sorted(set(re.findall(r'data-drag="([^"]+)"', str(explorer.frame))))
    numbers = [control["name"] for control in explorer.controls if control["low"] is not None]
    messages = [{"values": dict.fromkeys(numbers, value)} for value in (1e308, -1e308, NAN)]
    messages += [{"drags": [[handle, *shove] for handle in handles] * 10} for shove in SHOVES[:2]]
    messages += [{"drags": [[handle, *shove]]} for handle in handles for shove in SHOVES[2:]]
    messages += [{"keys": [[handle, "+"] for handle in handles] * 30}]
    for number, message in enumerate(messages, 1):
        explorer._receive(explorer, {"id": number, "draft": True, **message}, [])
        assert explorer.frame["answers"] == number
        assert not NO_PLACE.search(IN_WORDS.sub("", str(explorer.frame))), message
