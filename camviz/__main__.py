"""`python -m camviz` is the command `camviz`."""

import sys

from camviz_clinic.commands.command import main

if __name__ == "__main__":
    sys.exit(main())
