"""Estimators in files: plain text and arrays, with what made them."""

import hashlib
import io
import json
import math
import os
import zipfile
import zlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from tokenize import TokenError
from typing import Any

import numpy as np

from discover._version import __version__
from discover.dataset.run import Run
from discover.dataset.tables.table import read_bytes
from discover.errors import InputError
from discover.learners.plain_values import PlainReader, PlainWriter
from discover.plain_numbers import parse_json

FORMAT, VERSION = "discover estimator", 2
_HEADER = "estimator.json"
_LARGEST = 2**28
"""Bytes that all parts of a file unpack to, at most: an estimator of megabytes is a large one."""

_MOST_MEMBERS = 10_000

_HEAD = 512
"""Bytes of an array's head, which NumPy reads as a Python literal; of plain numbers it has 118."""


def write_estimator(
    path: str | Path,
    learner: str,
    parameters: Mapping[str, Any],
    fitted: Mapping[str, Any],
    types: Sequence[type],
) -> Path:
    """Write an estimator to a file, replacing it whole or not at all.

    Raises InputError if something of it cannot be written.
    """
    writer = PlainWriter(types)
    header = {
        "format": FORMAT,
        "version": VERSION,
        "made_by": f"discover {__version__}",
        "learner": learner,
        "parameters": {k: writer.plain(v, f"The parameter {k!r}") for k, v in parameters.items()},
        "fitted": {k: writer.plain(v, f"The attribute {k!r}") for k, v in fitted.items()},
    }
    path = Path(path)
    partial = path.with_name(path.name + ".partial")
    with zipfile.ZipFile(partial, "w", zipfile.ZIP_DEFLATED) as file:
        file.writestr(_HEADER, json.dumps(header, allow_nan=False, ensure_ascii=False))
        for name, values in writer.arrays.items():
            content = io.BytesIO()
            np.lib.format.write_array(content, values, allow_pickle=False)
            file.writestr(f"{name}.npy", content.getvalue())
    os.replace(partial, path)
    return path


class EstimatorFile:
    """Content of a file written by `write_estimator`.

    Raises InputError if there is no such file, or it is something else, damaged, or of a later
    version.
    """

    def __init__(self, path: str | Path):
        self._path = Path(path)
        # a pipe or a device has no end, and is refused here
        packed = read_bytes(self._path, str(self._path), "Check the path.", largest=_LARGEST)
        try:
            with zipfile.ZipFile(io.BytesIO(packed)) as file:
                _require_small(file)
                self._header = self._read_header(file)
                self._arrays = {
                    info.filename.removesuffix(".npy"): _read_array(file, info)
                    for info in file.infolist()
                    if info.filename.endswith(".npy")
                }
        except zipfile.BadZipFile:
            raise self._other() from None
        except _UNREADABLE as error:
            if isinstance(error, InputError):
                raise
            raise self.damaged(error) from None
        self.learner = str(self._header.get("learner"))

    def read(self, types: Sequence[type]) -> tuple[dict[str, Any], dict[str, Any]]:
        """Return the parameters and the fitted attributes, by name."""
        reader = PlainReader(types, self._arrays)
        try:
            parameters, fitted = (
                {name: reader.value(value) for name, value in self._header[part].items()}
                for part in ("parameters", "fitted")
            )
        except InputError as error:  # a law that is not registered here
            raise InputError(f"{self._path}: {error}") from None
        except (KeyError, TypeError, ValueError, AttributeError, RecursionError) as error:
            raise self.damaged(error) from None
        return parameters, fitted

    def _read_header(self, file: zipfile.ZipFile) -> dict[str, Any]:
        if _HEADER not in file.namelist():
            raise self._other()
        header = parse_json(_read(file, file.getinfo(_HEADER)))
        if not isinstance(header, dict) or header.get("format") != FORMAT:
            raise self._other()
        if header.get("version") != VERSION:
            raise InputError(
                f"{self._path} was written by {header.get('made_by', 'another version')} in the "
                f"form {header.get('version')}; this is discover {__version__}, which reads the "
                f"form {VERSION}. Use that version, or fit again."
            )
        return header

    def _other(self) -> InputError:
        return InputError(
            f"{self._path} is not a complete estimator file. Give a file that "
            "estimator.save(path) wrote; a law by itself is read elsewhere."
        )

    def damaged(self, error: Exception) -> InputError:
        """Return the error of a file whose content is not as it was written."""
        first = (str(error).splitlines() or [""])[0][:200]
        return InputError(
            f"{self._path} is damaged ({type(error).__name__}: {first}). Copy it again, or fit "
            "again."
        )


_UNREADABLE = (
    ValueError, EOFError, OSError, zlib.error, RecursionError, NotImplementedError,
    RuntimeError,  # of a member that is encrypted
    SyntaxError, TokenError,  # of an array whose head is none
)  # fmt: skip


def _require_small(file: zipfile.ZipFile) -> None:
    """Refuse, by the sizes that the file states, what would fill the memory."""
    members = file.infolist()
    size = sum(info.file_size for info in members)
    if len(members) > _MOST_MEMBERS or size > _LARGEST:
        raise ValueError(
            f"{len(members)} parts of {size / 1e6:.0f} MB in all, more than an estimator has"
        )
    packed = {info.compress_type for info in members}
    if not packed <= {zipfile.ZIP_DEFLATED, zipfile.ZIP_STORED}:
        raise ValueError("parts are packed as no estimator's are")


def _read(file: zipfile.ZipFile, info: zipfile.ZipInfo) -> bytes:
    try:
        return file.read(info)
    except zipfile.BadZipFile as error:  # a checksum that does not fit: ours, but damaged
        raise ValueError(str(error)) from None


def _read_array(file: zipfile.ZipFile, info: zipfile.ZipInfo) -> np.ndarray:
    content = io.BytesIO(_read(file, info))
    version = np.lib.format.read_magic(content)
    if version != (1, 0):
        raise ValueError(f"{info.filename} is in a form of NumPy that no estimator has")
    shape, _, dtype = np.lib.format.read_array_header_1_0(content, max_header_size=_HEAD)
    # memory is asked for by the shape, so it has to be that of the content
    if math.prod(shape) * dtype.itemsize != len(content.getvalue()) - content.tell():
        raise ValueError(f"{info.filename} has another size than its shape {shape}")
    content.seek(0)
    return np.lib.format.read_array(content, allow_pickle=False, max_header_size=_HEAD)


@dataclass(frozen=True)
class Provenance:
    """Data an estimator was fitted to; a saved one holds this in their place."""

    data: str  # name of the data set; empty for a list of runs
    runs: tuple[str, ...]  # names of the runs
    samples: int  # number of samples in all
    fingerprint: str  # hash of times, rates and shear stresses
    version: str = __version__  # of this software


def provenance_of(data: Any, runs: Sequence[Run]) -> Provenance:
    """Return the provenance of a fit to runs; of a data set with its name."""
    return Provenance(
        str(getattr(data, "name", "")),
        tuple(run.name for run in runs),
        sum(len(run) for run in runs),
        fingerprint_of(runs),
    )


def fingerprint_of(runs: Sequence[Run]) -> str:
    """Return a hash of the samples of some runs, whatever their order."""
    digest = hashlib.sha256()
    for run in sorted(runs, key=lambda run: run.name):
        digest.update(f"{run.name}|{len(run)}|".encode())
        for values in (run.time, run.rate, run.recorded):
            digest.update(np.ascontiguousarray(values, dtype=float).tobytes())
    return digest.hexdigest()[:16]
