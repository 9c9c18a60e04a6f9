"""A folder of results that knows which study it belongs to and what is already done."""

import json
import shutil
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from discover.errors import InputError
from discover.study.atomic import make_folder, write_text

STATE_FOLDER = "state"
STATE_FILE = "study.json"


class RunFolder:
    """The folder that a command writes to.

    ``state/study.json`` holds the study's fingerprint and whether it is complete; every finished
    part lies beside it as JSON, so that a run that was stopped goes on where it was.

    Parameters
    ----------
    path
        The folder; made if it does not exist.
    fingerprint
        From `discover.study.fingerprint`.
    overwrite
        Forget what is there.

    Raises
    ------
    InputError
        If the folder holds another study's results, or other files, and `overwrite` is not set.
    """

    def __init__(self, path: str | Path, fingerprint: str, overwrite: bool = False):
        self.path = make_folder(path)
        self.fingerprint = fingerprint
        self._state = self.path / STATE_FOLDER
        found = _read_json(self._state / STATE_FILE)
        if overwrite:
            # only what this class writes is removed: the folder may be somebody's home
            if found is not None:
                shutil.rmtree(self._state)
            found = None
        elif found is not None and found.get("fingerprint") != fingerprint:
            if not found.get("complete") and not self._has_parts():
                found = None  # claimed, but nothing was computed: nothing can be lost
            else:
                raise InputError(
                    f"{self.path} holds the results of another study, or of this one before it "
                    "was changed. Use --overwrite to replace them, or another --out."
                )
        self.complete = bool(found and found.get("complete"))
        make_folder(self._state)
        make_folder(self.path / "figures")
        if found is None:
            self._write_state(False)

    def load(self, part: str) -> dict[str, Any] | None:
        """Return a finished part, or None if it has to be computed."""
        return _read_json(self._state / f"{part}.json")

    def save(self, part: str, content: Mapping[str, Any]) -> None:
        """Keep a finished part."""
        write_text(self._state / f"{part}.json", json.dumps(content, allow_nan=True))

    def write(self, name: str, text: str) -> Path:
        """Write one of the results."""
        return write_text(self.path / name, text)

    def finish(self) -> None:
        """Mark the study as complete; called last."""
        self._write_state(True)
        self.complete = True

    def _has_parts(self) -> bool:
        return any(file.name != STATE_FILE for file in self._state.glob("*.json"))

    def _write_state(self, complete: bool) -> None:
        content = {"fingerprint": self.fingerprint, "complete": complete}
        write_text(self._state / STATE_FILE, json.dumps(content))


def _read_json(path: Path) -> dict[str, Any] | None:
    try:
        content = json.loads(path.read_text("utf-8"))
    except (OSError, ValueError, RecursionError):
        return None  # absent or damaged: computed again
    return content if isinstance(content, dict) else None
