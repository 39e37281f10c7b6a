"""``python -m spheretwin``: the command line."""

import sys

from spheretwin.cli import main

if __name__ == "__main__":
    sys.exit(main())
