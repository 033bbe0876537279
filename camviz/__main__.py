"""`python -m camviz` is the command `camviz`, wherever it is installed."""

import sys
from importlib.metadata import entry_points

if __name__ == "__main__":
    (command,) = {each.value: each for each in entry_points(group="console_scripts", name="camviz")}.values()
    sys.exit(command.load()())
