"""`python -m truearm`: the commands, where the program is not on PATH."""

import sys

from truearm.cli import main

sys.exit(main())
