"""`iprt doctor`: drivers and packages of this machine, and commands to install missing ones."""

from __future__ import annotations

import json as json_format
from typing import Any

from iprt.errors import DeviceError


def doctor(*, json: bool = False) -> int:
    """Show OpenCL devices, the OpenGL renderer, versions, and how to install missing parts.

    Parameters
    ----------
    json
        Print one JSON object instead, for programs and bug reports.

    Returns
    -------
    int
        Exit status: 0 if an OpenCL device is usable, else 3.
    """
    from iprt.commands.installation import examine

    report = examine()
    if json:
        print(json_format.dumps(report, indent=2))
    else:
        show(report)
    return 0 if report["ok"] else DeviceError.exit_code


def show(report: dict[str, Any]) -> None:
    """Print the result of `iprt.commands.installation.examine` as text."""
    from rich.console import Console
    from rich.table import Table

    console = Console(markup=False, emoji=False, highlight=False)

    def line(text: str, style: str = "") -> None:
        console.print(text, style=style, soft_wrap=True)

    opencl, caches = report["opencl"], report["caches"]
    table = Table(title="OpenCL devices", title_justify="left")
    for column in ("", "place", "kind", "device", "platform", "driver", "memory"):
        table.add_column(column, overflow="fold")
    for device in opencl.get("devices", []):
        table.add_row(
            ">" if device["index"] == opencl.get("chosen") else "",
            device["index"],
            device["kind"],
            f"{device['name']}, {device['compute_units']} units",
            device["platform"],
            device["driver"] + (f" (not usable: {device['problem']})" if device["problem"] else ""),
            f"{device['memory_mib'] / 1024:.1f} GiB",
        )
    console.print(table)
    if "error" in opencl:
        line(f"OpenCL: {opencl['error']}", "red")
        for library, found in opencl.get("alone", {}).items():
            line(f"    {library} alone: {found}", "yellow")
        if opencl.get("alone"):
            line("    OCL_ICD_VENDORS=FOLDER leaves drivers out whose .icd files are not in FOLDER")
    else:
        line(f"chosen: {opencl['chosen']}, {opencl['reason']}")
    line(f"OpenCL drivers are registered in {opencl['vendors']}")
    if caches["problem"]:
        line(f"compiled kernels are not kept for the next run: {caches['problem']}", "yellow")
    else:
        line(f"compiled kernels are kept in {caches['folder']}")
    line("versions: " + ", ".join(f"{name} {text}" for name, text in report["versions"].items()))
    console.print()
    for part in report["parts"]:
        if "error" in part:
            line(f"no {part['name']} ({part['purpose']}): {part['error']}", "yellow")
        else:
            line(f"{part['name']} ({part['purpose']}): {part['found']}")
        if part.get("software"):
            line("OpenGL runs on the processor; scenes of many triangles render slowly", "yellow")
    line(*(("ready to render", "green") if report["ok"] else ("cannot render", "red")))
