"""What is shown where a view's evidence is not in the file: words that say so."""

from __future__ import annotations

from dataclasses import dataclass

from camviz.draw import svg
from camviz.draw.picture import Picture
from camviz.views.base import View


@dataclass(frozen=True)
class MissingView(View):
    """A picture of one sentence: what the view called `subject` needs and this calibration does not hold."""

    subject: str
    sentence: str

    def figure(self, *, draft: bool = False) -> Picture:
        words = svg.text((20, 26), self.subject, "title") + svg.paragraph((36, 62), self.sentence, 860, "label")
        card = svg.rectangle(20, 38, 920, 70, "card") + svg.rectangle(20, 38, 920, 70, "frame")
        return Picture.whole(card + words, 960, 122, self.subject, self.sentence)
