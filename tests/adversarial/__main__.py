"""``python -m tests.adversarial``: the long run. See --help."""

import sys

from .command import main

if __name__ == "__main__":
    sys.exit(main())
