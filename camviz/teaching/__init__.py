"""What a teacher gets beside the lessons: plans by the minute, the teacher's edition, exercise sheets and slides.

A lesson's plan is NN.toml in this folder (camviz.teaching.plans says how one is written); everything else is made from
the lesson's notebook, its questions and its exercises, and works for a lesson that has no plan yet.
"""
