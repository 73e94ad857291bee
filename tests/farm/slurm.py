"""Stand-in for SLURM: `sbatch` and `scontrol`, and a cluster that runs submitted jobs."""

from __future__ import annotations

import json
import os
import random
import re
import shlex
import signal
import subprocess
import sys
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

SBATCH = """#!{python}
import json, pathlib, sys
words, folder = sys.argv[1:], pathlib.Path({folder!r})
options = [word for word in words if word.startswith("-")]
files = [word for word in words if not word.startswith("-")]
text = pathlib.Path(files[0]).read_text() if files else sys.stdin.read()
number = 100 + len(list(folder.glob("*.job")))
(folder / f"{{number}}.job").write_text(json.dumps({{"options": options, "text": text}}))
print(f"{{number}};cluster")
"""
SCONTROL = """#!{python}
import pathlib, sys
assert sys.argv[1] == "requeue", sys.argv
pathlib.Path({folder!r}, sys.argv[2] + ".requeue").touch()
"""


@dataclass
class Task:
    """A job, or a task of an array."""

    job: int
    index: int | None
    script: Path
    restarts: int = 0
    code: int = 0


@dataclass
class Slurm:
    """Queue in a folder. Tasks run one by one, in an order that `seed` chooses.

    Attributes
    ----------
    kills : int
        Number of tasks that are killed once at a random moment, as if their node had failed.
    """

    folder: Path
    seed: int = 0
    kills: int = 0
    ran: list[Task] = field(default_factory=list)

    def __post_init__(self) -> None:
        self.folder.mkdir()
        self._random = random.Random(self.seed)
        for name, text in (("sbatch", SBATCH), ("scontrol", SCONTROL)):
            file = self.folder / name
            file.write_text(text.format(python=sys.executable, folder=str(self.folder)))
            file.chmod(0o755)

    @property
    def environment(self) -> dict[str, str]:
        return {**os.environ, "PATH": f"{self.folder}:{os.environ['PATH']}"}

    def submit(self, script: Path, *words: str, shell: str = "sh") -> str:
        """Run a script as a user does; return its output."""
        return subprocess.run(
            [shell, script, *words],
            env=self.environment,
            stdout=subprocess.PIPE,
            text=True,
            check=True,
        ).stdout

    def options(self, number: int) -> dict[str, str]:
        """Return the options of a job by name; the command line overrides the script."""
        record = self._record(number)
        lines = re.findall(r"^#SBATCH (.*)$", record["text"], re.MULTILINE)
        words = [*(word for line in lines for word in shlex.split(line)), *record["options"]]
        return {name: value for name, _, value in (word.partition("=") for word in words)}

    def run(self) -> None:
        """Run all jobs, dependent ones last."""
        numbers = sorted(int(file.stem) for file in self.folder.glob("*.job"))
        ended: set[int] = set()
        while left := [number for number in numbers if number not in ended]:
            free = [n for n in left if self._dependencies(n) <= ended]
            assert free, "jobs wait for each other"
            self._run_job(free[0])
            ended.add(free[0])

    def _dependencies(self, number: int) -> set[int]:
        kind, _, others = self.options(number).get("--dependency", "").partition(":")
        assert kind in ("", "afterany")
        return {int(other) for other in others.split(":") if other}

    def _record(self, number: int) -> dict[str, Any]:
        found: dict[str, Any] = json.loads((self.folder / f"{number}.job").read_text())
        return found

    def _run_job(self, number: int) -> None:
        options = self.options(number)
        script = self.folder / f"{number}.sh"
        script.write_text(self._record(number)["text"])
        script.chmod(0o755)
        tasks = [Task(number, None, script)]
        if "--array" in options:
            first, last = map(int, options["--array"].partition("%")[0].split("-"))
            assert last <= 1000
            tasks = [Task(number, index, script) for index in range(first, last + 1)]
        while tasks:
            task = tasks.pop(self._random.randrange(len(tasks)))
            killed = self._run_task(task, kill=self.kills > 0 and task.restarts == 0)
            self.kills -= killed
            asked = self.folder / f"{self._id(task)}.requeue"
            if (killed and "--requeue" in options) or asked.exists():
                asked.unlink(missing_ok=True)
                tasks.append(Task(task.job, task.index, script, task.restarts + 1))

    def _id(self, task: Task) -> int:
        return task.job if task.index is None else 1000 * task.job + task.index

    def _run_task(self, task: Task, *, kill: bool) -> bool:
        """Run a task to its end; True if it was killed before."""
        environment = {**self.environment, "SLURM_JOB_ID": str(self._id(task))}
        if task.index is not None:
            environment["SLURM_ARRAY_TASK_ID"] = str(task.index)
        if task.restarts:
            environment["SLURM_RESTART_COUNT"] = str(task.restarts)
        child = subprocess.Popen([task.script], env=environment, start_new_session=True)
        if kill:
            time.sleep(self._random.uniform(0.0, 6.0))
            if child.poll() is None:
                os.killpg(child.pid, signal.SIGKILL)
        task.code = child.wait()
        self.ran.append(task)
        return task.code == -signal.SIGKILL
