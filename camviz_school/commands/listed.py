"""The school's commands, in the order of `camviz --help`. pyproject.toml names this tuple for the command line."""

from camviz_school.commands import bundle, classroom, doctor, join, lab, mend, teacher

COMMANDS = (lab, doctor, teacher, mend, classroom, join, bundle)
