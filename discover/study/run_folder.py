"""A folder of results that knows which study it belongs to and what is already done."""

import contextlib
import hashlib
import json
import shutil
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

from discover.dataset.tables.table import read_bytes
from discover.errors import InputError
from discover.plain_numbers import parse_json
from discover.progress import resumable
from discover.study.atomic import PART_SUFFIX, lock_folder, make_folder, require_free, write_text

STATE_FOLDER = "state"
STATE_FILE = "study.json"
_RESULTS = ("report.html", "comparison.json", "loop.json")


class RunFolder:
    """The folder that a command writes to, and no other process while the object lives.

    ``state/study.json`` holds the study's fingerprint, whether it is complete, and the hash of
    every result; finished parts lie beside it, so that a run that was stopped goes on.

    `overwrite`: forget what is there. Raises InputError if the folder holds another study's
    results, cannot be written to, or is in use.
    """

    def __init__(self, path: str | Path, fingerprint: str, overwrite: bool = False):
        self.path = make_folder(path)
        self.fingerprint = fingerprint
        self._state = self.path / STATE_FOLDER
        self._written: dict[str, str] = {}
        with _writable(f"The folder {self.path} cannot be written to", "with"):
            self._lock = lock_folder(self.path)
        if not overwrite:
            require_free(self.path, _RESULTS, STATE_FOLDER)
        found = _read_json(self._state / STATE_FILE)
        if overwrite:
            # only what this class writes is removed: the folder may be somebody's home
            if found is not None:
                old = f"The old results in {self._state} cannot be removed"
                with _writable(old, "folder with"):
                    shutil.rmtree(self._state)
            found = None
        elif found is not None and found.get("fingerprint") != fingerprint:
            parts = (file.name for file in self._state.glob("*.json") if file.name != STATE_FILE)
            if not found.get("complete") and not any(parts):
                found = None  # claimed, but nothing was computed: nothing can be lost
            else:
                raise InputError(
                    f"{self.path} holds the results of another study, or of this one before it "
                    "was changed. Use --overwrite to replace them, or another --out."
                )
        self.complete = bool(found and found.get("complete") is True)
        for folder in (self.path, make_folder(self._state), make_folder(self.path / "figures")):
            # what a killed process was about to write: it is ours, and only we are here
            for rest in folder.glob(f".*{PART_SUFFIX}"):
                with contextlib.suppress(OSError):
                    rest.unlink()
        files = (found or {}).get("files")
        self._files: dict[str, Any] = files if isinstance(files, dict) else {}
        if found is None:
            self._write_state(False)
        resumable.set()

    def load(self, part: str) -> dict[str, Any] | None:
        """Return a finished part, or None if it has to be computed."""
        kept = _read_json(self._state / f"{part}.json")
        if kept is None or kept.get("hash") != self._hash(kept.get("content")):
            return None
        return kept["content"]

    def save(self, part: str, content: Mapping[str, Any]) -> None:
        """Keep a finished part."""
        content = json.loads(json.dumps(content))  # as it will be read: keys become text
        kept = {"hash": self._hash(content), "content": content}
        write_text(self._state / f"{part}.json", json.dumps(kept))

    def _hash(self, content: object) -> str:
        text = json.dumps(content, sort_keys=True)
        return hashlib.sha256(f"{self.fingerprint}|{text}".encode()).hexdigest()[:16]

    def write(self, name: str, text: str) -> Path:
        """Write one of the results."""
        written = write_text(self.path / name, text)
        self._written[name] = _digest(written)
        return written

    def holds(self, *names: str) -> bool:
        """Return whether results of these names, and all others, are as they were written."""
        return set(names) <= set(self._files) and all(
            digest == _digest(self.path / name) for name, digest in self._files.items()
        )

    def finish(self) -> None:
        """Mark the study as complete; called last."""
        self._files |= self._written
        self._write_state(True)
        self.complete = True
        self._lock.release()

    def _write_state(self, complete: bool) -> None:
        content: dict[str, Any] = {"fingerprint": self.fingerprint, "complete": complete}
        if complete:
            content["files"] = self._files
        write_text(self._state / STATE_FILE, json.dumps(content))


@contextlib.contextmanager
def _writable(what: str, where: str) -> Iterator[None]:
    """Turn a refusal of the system's into an InputError that says what cannot be done."""
    try:
        yield
    except OSError as error:
        raise InputError(f"{what}: {error.strerror}. Choose another {where} --out.") from None


def _digest(path: Path) -> str:
    try:
        return hashlib.sha256(read_bytes(path, path.name, is_input=False)).hexdigest()
    except InputError:
        return ""


def _read_json(path: Path) -> dict[str, Any] | None:
    try:
        content = parse_json(read_bytes(path, path.name, is_input=False))
    except ValueError:
        return None  # absent or damaged: computed again
    return content if isinstance(content, dict) else None
