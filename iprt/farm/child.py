"""`python -m iprt.farm.child WORDS`: `iprt WORDS`, which ends together with its starter.

The starter holds the pipe to stdin open. It closes when the starter ends, in whatever way.
"""

from __future__ import annotations

import os
import runpy
import signal
import threading
import time

from iprt.files.termination import PATIENCE_S, SIGNALS


def main() -> None:
    """Run the command, and watch stdin meanwhile."""
    # The command waits for signals in a thread of its own: all others must block them.
    signal.pthread_sigmask(signal.SIG_BLOCK, SIGNALS)
    threading.Thread(target=_follow, daemon=True).start()
    runpy.run_module("iprt", run_name="__main__", alter_sys=True)


def _follow() -> None:
    """End the process and its children once stdin is closed."""
    while os.read(0, 4096):
        pass
    os.kill(os.getpid(), signal.SIGTERM)
    time.sleep(PATIENCE_S)
    os.killpg(0, signal.SIGKILL)


if __name__ == "__main__":
    main()
