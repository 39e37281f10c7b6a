"""``python -m spheretwin``: the command line."""

import sys

from spheretwin.cli import main

sys.exit(main())
