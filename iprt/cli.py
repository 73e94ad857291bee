"""The command `iprt`: its verbs, and how errors become exit codes.

Exit codes: 0 fine; 1 a threshold given on the command line was missed; 2 bad input; 3 no usable
device; 70 a defect in iprt itself; 130 interrupted, 143 and 129 ended by SIGTERM and SIGHUP.
Results go to stdout, the log to stderr.
"""

from __future__ import annotations

import inspect
import logging
import os
import sys
import traceback
from collections.abc import Callable, Sequence
from importlib import import_module
from typing import NoReturn

from tyro.extras import SubcommandApp

from iprt.commands.help import CONFIG, explained
from iprt.ending import Ended, signals_raise
from iprt.errors import DeviceHangError, IprtError

DEFECT = 70
INTERRUPTED = 130
DESCRIPTION = """Insert virtual objects into 360° RGBD video.
`iprt VERB --help` explains a verb; `--debug` anywhere shows the traceback of an error."""

VERBS = {
    "doctor": "iprt.commands.doctor:doctor",
    "render": "iprt.commands.render:render",
    "compare": "iprt.commands.compare:compare",
    "bench": "iprt.commands.bench:bench",
    "profile": "iprt.commands.profile:profile",
    "view": "iprt.commands.view:view",
    "settings": "iprt.commands.settings:settings",
    "reference": "iprt.commands.reference:reference",
    "scene info": "iprt.commands.scene:info",
    "scene check": "iprt.commands.scene:check",
    "scene new": "iprt.commands.scene:new",
    "scene add": "iprt.commands.scene:add",
}
"""Words after `iprt` -> the function that does it. It returns the exit code, or None for 0."""

GROUPS = {"scene": "Look at, check and write scenes."}
"""What the first words of two-word verbs are about."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one verb and return the exit code. Errors of the user are one line on stderr."""
    return _run(arguments)[0]


def command(arguments: Sequence[str] | None = None) -> NoReturn:
    """The process: runs one verb and ends.

    Not by the drivers' own endings, if kernels may be running: these wait for one that hangs, and
    take away what a thread needs that still compiles one (PoCL's crash then).
    """
    code, abrupt = _run(arguments)
    if not abrupt:
        sys.exit(code)
    sys.stdout.flush()
    sys.stderr.flush()
    os._exit(code)


def _run(arguments: Sequence[str] | None) -> tuple[int, bool]:
    """The exit code, and whether the device may still be busy."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    debug = "--debug" in words
    words = [word for word in words if word != "--debug"]
    logging.basicConfig(stream=sys.stderr, format="iprt: %(message)s")
    logging.getLogger("iprt").setLevel(logging.DEBUG if debug else logging.INFO)
    try:
        with signals_raise():
            code = application(words).cli(
                prog="iprt", description=DESCRIPTION, args=words, config=CONFIG
            )
        sys.stdout.flush()
        return code or 0, False
    except IprtError as error:
        if debug:
            traceback.print_exc()
        print(f"iprt: error: {_told(error, str(error))}", file=sys.stderr)
        return error.exit_code, isinstance(error, DeviceHangError)
    except MemoryError:
        print("iprt: error: out of memory; lower --size or use a smaller panorama", file=sys.stderr)
        return IprtError.exit_code, False
    except KeyboardInterrupt as interrupt:
        print(f"iprt: {_told(interrupt, 'interrupted')}", file=sys.stderr)
        return INTERRUPTED, True
    except Ended as ended:
        print(f"iprt: {_told(ended, f'ended by {ended.signal.name}')}", file=sys.stderr)
        return 128 + ended.signal, True
    except BrokenPipeError:
        # The reader of stdout has left; Python would complain once more while it shuts down.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0, False
    except Exception:
        traceback.print_exc()
        print("iprt: this is a defect in iprt; please report the lines above", file=sys.stderr)
        return DEFECT, False


def _told(error: BaseException, message: str) -> str:
    """The message and the notes that were added on the way up."""
    return "; ".join([message, *getattr(error, "__notes__", ())])


def application(arguments: Sequence[str]) -> SubcommandApp:
    """All verbs; the one that `arguments` asks for explains itself at length, the others briefly.

    The verbs' modules import what is heavy only when they run.
    """
    root = SubcommandApp()
    groups: dict[str, SubcommandApp] = {}
    for words, target in VERBS.items():
        group, _, verb = words.rpartition(" ")
        parent = root
        if group:
            if group not in groups:
                groups[group] = SubcommandApp()
                root.command(groups[group], name=group, help=GROUPS[group])
            parent = groups[group]
        function = explained(_load(target))
        asked = list(arguments[: words.count(" ") + 1]) == words.split()
        first_line = (inspect.getdoc(function) or "").partition("\n")[0]
        parent.command(name=verb, help=None if asked else first_line)(function)
    return root


def _load(target: str) -> Callable[..., int | None]:
    module, _, name = target.partition(":")
    function: Callable[..., int | None] = getattr(import_module(module), name)
    return function
