"""Command `iprt`: its verbs, and the conversion of errors to exit codes.

Exit codes: 0 success; 1 a threshold given on the command line was missed; 2 bad input, or stdout
cannot be written; 3 no usable device; 70 a defect in iprt itself; 130 interrupted, 143 and 129
terminated by SIGTERM and SIGHUP. A reader of stdout that leaves early changes none of these.
Results go to stdout, the log to stderr.

Slow imports are deferred: before `command` runs, a signal would show a traceback.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress

from iprt.errors import DeviceHangError, IprtError, OutputError
from iprt.files.termination import end, end_on_signals

TYPE_CHECKING = False  # `typing` is slow to import
if TYPE_CHECKING:
    from typing import NoReturn

    from tyro.extras import SubcommandApp

DEFECT = 70
DESCRIPTION = """Insert virtual objects into 360° RGBD video.
`iprt VERB --help` explains a verb. These go with every verb: -q, --quiet (only results and
errors), -v, --verbose (log more), --debug (also show the traceback of an error), --version."""
LEVELS = {
    "-q": "ERROR",
    "--quiet": "ERROR",
    "-v": "DEBUG",
    "--verbose": "DEBUG",
    "--debug": "DEBUG",
}
"""Flags valid anywhere on the line -> log level. Progress is shown where INFO is."""

VERBS = {
    "doctor": "iprt.commands.doctor:doctor",
    "render": "iprt.commands.render:render",
    "join": "iprt.commands.join:join",
    "farm openjd": "iprt.commands.farm:openjd",
    "farm slurm": "iprt.commands.farm:slurm",
    "farm plan": "iprt.commands.farm:plan",
    "compare": "iprt.commands.compare:compare",
    "bench": "iprt.commands.bench:bench",
    "bench-video": "iprt.commands.bench_video:bench_video",
    "profile": "iprt.commands.profile:profile",
    "sweep": "iprt.commands.sweep:sweep",
    "converge": "iprt.commands.converge:converge",
    "equal-time": "iprt.commands.equal_time:equal_time",
    "race": "iprt.commands.race:race",
    "claims": "iprt.commands.claims:claims",
    "calibrate": "iprt.commands.calibrate:calibrate",
    "view": "iprt.commands.view:view",
    "remote status": "iprt.commands.remote:status",
    "remote look": "iprt.commands.remote:look",
    "remote load": "iprt.commands.remote:load",
    "remote set": "iprt.commands.remote:set_",
    "remote place": "iprt.commands.remote:place",
    "remote render": "iprt.commands.remote:render",
    "remote save": "iprt.commands.remote:save",
    "remote quit": "iprt.commands.remote:quit_",
    "settings": "iprt.commands.settings:settings",
    "methods": "iprt.commands.methods:methods",
    "reference": "iprt.commands.reference:reference",
    "capture": "iprt.commands.capture:capture",
    "export": "iprt.commands.export:export",
    "scene info": "iprt.commands.scene:info",
    "scene check": "iprt.commands.scene:check",
    "scene new": "iprt.commands.scene:new",
    "scene add": "iprt.commands.scene:add",
    "scene light": "iprt.commands.scene_light:light",
    "scene gloss": "iprt.commands.scene_gloss:gloss",
    "scene sun": "iprt.commands.scene_sun:sun",
}
"""Words after `iprt` -> function. It returns the exit code, or None for 0."""

GROUPS = {
    "farm": "Render films on farms and clusters.",
    "remote": "Control a running viewer.",
    "scene": "Inspect, check and edit scenes.",
}
"""Subject of the first word of each two-word verb."""


def main(arguments: Sequence[str] | None = None) -> int:
    """Run one verb and return the exit code. User errors are one line on stderr."""
    return _run(arguments)[0]


def command(arguments: Sequence[str] | None = None) -> NoReturn:
    """Run one verb and end the process.

    If the device hangs, the drivers' own exit handlers are skipped, because they wait for it.
    """
    end_on_signals()
    from iprt.commands.standard_streams import prepare_streams

    try:
        prepare_streams()
    except OutputError as error:
        _complain(error)
        sys.exit(error.exit_code)
    code, hangs = _run(arguments)
    with suppress(OutputError):  # of a verb that has failed already
        sys.stdout.flush()
    if not hangs:
        sys.exit(code)
    end(code)


def _run(arguments: Sequence[str] | None) -> tuple[int, bool]:
    """Run one verb, and return the exit code and whether the device hangs."""
    import logging
    import traceback

    words = list(sys.argv[1:] if arguments is None else arguments)
    flags = [word for word in words if word in LEVELS]
    debug = "--debug" in flags
    level = LEVELS[flags[0]] if flags else "INFO"
    from iprt.commands.standard_streams import OneLine

    handler = logging.StreamHandler()
    handler.setFormatter(OneLine("iprt: %(message)s"))
    logging.basicConfig(handlers=[handler])
    logging.getLogger("iprt").setLevel(level)
    try:
        if any(LEVELS[flag] != level for flag in flags):
            raise IprtError(f"{' and '.join(dict.fromkeys(flags))}: give one of them")
        code = _verb([word for word in words if word not in LEVELS])
        sys.stdout.flush()
        return code or 0, False
    except IprtError as error:
        if debug:
            traceback.print_exc()
        _complain(error)
        return error.exit_code, isinstance(error, DeviceHangError)
    except MemoryError:
        print("iprt: error: out of memory; lower --size or use a smaller panorama", file=sys.stderr)
        return IprtError.exit_code, False
    except Exception:
        if not _has_folder():
            print("iprt: error: the current folder was deleted; go to another one", file=sys.stderr)
            return IprtError.exit_code, False
        traceback.print_exc()
        print("iprt: this is a defect in iprt; please report the lines above", file=sys.stderr)
        return DEFECT, False


def _verb(words: list[str]) -> int | None:
    from iprt.commands.help import CONFIG

    if "--version" in words:
        print(versions())
        return None
    try:
        code: int | None = application(words).cli(
            prog="iprt", description=DESCRIPTION, args=words, config=CONFIG
        )
    except SystemExit:  # tyro's, behind a help text
        sys.stdout.flush()
        raise
    return code


def versions() -> str:
    """Return versions and platform for a bug report, in one line."""
    import platform
    from importlib.metadata import PackageNotFoundError, version

    from iprt import __version__

    try:
        opencl = version("pyopencl")
    except PackageNotFoundError:
        opencl = "missing"
    return f"iprt {__version__}, Python {platform.python_version()}, pyopencl {opencl}"


def _complain(error: IprtError) -> None:
    """Print an error, with the notes added by callers."""
    from iprt.commands.standard_streams import one_line

    *lines, last = error.lines
    lines.append("; ".join([last, *getattr(error, "__notes__", ())]))
    print("iprt: error:", "\n".join(map(one_line, lines)), file=sys.stderr)


def _has_folder() -> bool:
    """Return whether the current folder still exists, which relative paths need."""
    try:
        os.getcwd()
    except FileNotFoundError:
        return False
    return True


def application(arguments: Sequence[str]) -> SubcommandApp:
    """Return the application with all verbs; only the verb in `arguments` has its full help text.

    The verbs' modules defer heavy imports until they run.
    """
    import inspect

    from tyro.extras import SubcommandApp

    from iprt.commands.help import explained

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
    from importlib import import_module

    module, _, name = target.partition(":")
    function: Callable[..., int | None] = getattr(import_module(module), name)
    return function
