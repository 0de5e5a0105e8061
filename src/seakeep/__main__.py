"""``python -m seakeep``."""

import sys

from seakeep.cli import main

if __name__ == "__main__":
    sys.exit(main())
