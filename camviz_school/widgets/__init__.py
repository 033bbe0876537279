"""A question in a notebook: before the picture (`ask`), and at a lesson's two ends (`quiz`)."""

from camviz_school.widgets.question import ask, quiz

__all__ = ["ask", "quiz"]
