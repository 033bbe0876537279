"""What a teacher gets beside the lessons: plans by the minute, the teacher's edition, exercise sheets and slides.

A lesson's plan is lessons/material/NN/plan.toml (camviz_school.teaching.plans says how one is written). Everything else
is made from the lesson's notebook, its questions and its exercises, and works for a lesson that has no plan yet.
"""
