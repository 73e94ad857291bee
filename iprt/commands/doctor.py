"""`iprt doctor`: what this machine offers, what is missing, and the commands that install it."""

from __future__ import annotations

import json as json_format
from typing import TYPE_CHECKING, Any

from iprt.errors import DeviceError

if TYPE_CHECKING:
    from rich.table import Table

Record = dict[str, Any]


def doctor(*, json: bool = False) -> int:
    """Show OpenCL devices, the OpenGL renderer, versions, and how to install what is missing.

    Parameters
    ----------
    json
        Print one JSON object instead of tables, for programs and bug reports.

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


def show(report: Record) -> None:
    """Print a report of `iprt.commands.installation.examine` for people."""
    from rich.console import Console

    console = Console(markup=False, emoji=False, highlight=False)

    def line(text: str, style: str = "") -> None:
        console.print(text, style=style, soft_wrap=True)

    opencl, opengl, caches = report["opencl"], report["opengl"], report["caches"]
    console.print(device_table(opencl.get("devices", [])))
    if "error" in opencl:
        line(f"OpenCL: {opencl['error']}", "red")
        for library, record in opencl.get("alone", {}).items():
            found = record.get("error") or ", ".join(record["devices"])
            line(f"    {library} alone: {found}", "yellow")
        if opencl.get("alone"):
            line("    OCL_ICD_VENDORS=FOLDER leaves drivers out whose .icd files are not in FOLDER")
    else:
        line(f"chosen: {opencl['chosen']}, {opencl['reason']}")
    line(f"OpenCL drivers are registered in {opencl['vendors']}")
    if caches["problem"]:
        line(f"compiled kernels are not kept for the next run: {caches['problem']}\n", "yellow")
    else:
        line(f"compiled kernels are kept in {caches['folder']}\n")
    if "error" in opengl:
        line(f"OpenGL through EGL: {opengl['error']}", "red")
    else:
        line(f"OpenGL through EGL: {opengl['renderer']}, {opengl['version']}")
    if opengl.get("software"):
        line("OpenGL runs on the processor; scenes of many triangles render slowly", "yellow")
    console.print()
    console.print(_optional_table(report["optional"]))
    console.print(_version_table(report["versions"]))
    for lack in report["missing"]:
        line(f"missing: {lack['what']} ({lack['why']})", "yellow")
        line(f"    {lack['install']}")
    line(*(("ready to render", "green") if report["ok"] else ("cannot render", "red")))


def device_table(devices: list[Record]) -> Table:
    """One row per OpenCL device; an arrow marks the one that would be used."""
    from rich.table import Table

    table = Table(title="OpenCL devices", title_justify="left")
    for column in ("", "place", "kind", "device", "platform", "driver", "memory"):
        table.add_column(column, overflow="fold")
    for device in devices:
        table.add_row(
            ">" if device["chosen"] else "",
            device["index"],
            device["kind"],
            f"{device['name']}, {device['compute_units']} units",
            device["platform"],
            device["driver"] + (f" (not usable: {device['problem']})" if device["problem"] else ""),
            f"{device['memory_mib'] / 1024:.1f} GiB",
        )
    return table


def _optional_table(parts: list[Record]) -> Table:
    from rich.table import Table

    table = Table(title="Optional parts", title_justify="left")
    for column in ("part", "for", "version", "state"):
        table.add_column(column, overflow="fold")
    for part in parts:
        table.add_row(part["name"], part["purpose"], part["version"] or "", part["state"])
    return table


def _version_table(versions: dict[str, str | None]) -> Table:
    from rich.table import Table

    table = Table(title="Versions", title_justify="left", show_header=False)
    table.add_column()
    table.add_column(overflow="fold")
    for name, version in versions.items():
        table.add_row(name, version or "missing")
    return table
