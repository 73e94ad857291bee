"""`python -m iprt`: the same as the command `iprt`."""

import sys

from iprt.cli import main

if __name__ == "__main__":
    sys.exit(main())
