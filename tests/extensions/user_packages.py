"""Packages of a user's own, made from the pages of the guide as `pip install` would make them."""

import json
import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).parents[2]
COMMAND = "from discover.cli import main; main()"


def blocks(page, language):
    text = (ROOT / "docs" / page).read_text("utf-8")
    return re.findall(rf"^```{language}\n(.*?)^```", text, re.S | re.M)


def install(folder, module, code, project):
    """Put a module and the record of its distribution into a folder, as an installer does."""
    folder.mkdir(exist_ok=True)
    (folder / f"{module}.py").write_text(code)
    told = tomllib.loads(project)["project"]
    record = folder / f"{told['name'].replace('-', '_')}-{told['version']}.dist-info"
    record.mkdir()
    (record / "METADATA").write_text(
        f"Metadata-Version: 2.1\nName: {told['name']}\nVersion: {told['version']}\n"
    )
    lines = []
    for group, entries in told["entry-points"].items():
        lines += [f"[{group}]", *(f"{name} = {value}" for name, value in entries.items())]
    (record / "entry_points.txt").write_text("\n".join(lines) + "\n")


LEARNER_CODE = """
import discover as dc
from discover.learners import LearnerResult, RecoveredTerm


def learn(task):
    law = dc.make_law("giesekus", {"alpha": 0.2})
    return LearnerResult("", law, (RecoveredTerm("sigma.sigma", 0.2),))


dc.register_learner("mine", learn)
"""


def project(kind, name="mine", **entries):
    """Return the project file of a distribution of version 2.5 with entry points of one kind."""
    lines = [f'[project]\nname = "{name}"\nversion = "2.5"']
    lines += [f'[project.entry-points."discover.{kind}"]']
    return "\n".join([*lines, *(f'{key} = "{value}"' for key, value in entries.items())])


class Workplace:
    """A user's folder, where packages are installed and commands run as processes of their own."""

    def __init__(self, folder):
        self.folder = folder
        self.packages = folder / "packages"

    def follow(self, page):
        """Do what a page says: save its file under the name that it gives, and install it."""
        text = (ROOT / "docs" / page).read_text("utf-8")
        module, code = re.search(
            r"`(\w+)\.py`:\n\n```python\n(.*?)^```", text, re.S | re.M
        ).groups()
        project = next(block for block in blocks(page, "toml") if "[project]" in block)
        install(self.packages, module, code, project)

    def study(self, page, name="study.toml", more=""):
        """Write the study of a page, with more lines at its end."""
        text = next(block for block in blocks(page, "toml") if "[data]" in block)
        (self.folder / name).write_text(f"{text}\n{more}")
        return name

    def run(self, *arguments, code=0, script=COMMAND):
        """Run a command, or a script, and return its process."""
        environment = os.environ | {
            "PYTHONPATH": str(self.packages),
            "JAX_COMPILATION_CACHE_DIR": str(ROOT / ".pytest_cache" / "compiled"),
            "COLUMNS": "200",
        }
        done = subprocess.run(
            [sys.executable, "-c", script, *map(str, arguments)],
            capture_output=True, text=True, timeout=600, cwd=self.folder, env=environment,
        )  # fmt: skip
        assert done.returncode == code, done.stderr
        assert "Traceback" not in done.stderr
        return done

    def text(self, name):
        return (self.folder / name).read_text("utf-8")

    def json(self, name):
        return json.loads(self.text(name))

    def with_data(self, study, section, *replaced):
        """Let a study read the folder ``data`` in place of what stands before a section."""
        text = self.text(study)
        start, end = text.index("synthetic"), text.index(section)
        rest = text[end:].replace(*replaced) if replaced else text[end:]
        (self.folder / study).write_text(text[:start] + 'folder = "data"\n' + rest)
