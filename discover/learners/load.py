"""A saved estimator, whichever learner it is of."""

import os
import zlib
from pathlib import Path
from typing import Any

from discover._version import __version__
from discover.dataset.tables.table import read_bytes
from discover.errors import InputError
from discover.learners.files import DAMAGES, FORMAT, VERSION, restored
from discover.learners.tbnn_ude import TBNNUDE
from discover.learners.tensor_sindy import TensorSINDy
from discover.plain_numbers import parse_json

_LEARNERS = {one.learner: one for one in (TensorSINDy, TBNNUDE)}

_LARGEST = 2**28
"""Bytes of a file, and of what it unpacks to, at most: an estimator of megabytes is a large one."""


def load(path: str | Path) -> TensorSINDy | TBNNUDE:
    """Return the fitted estimator in a file that its `save` wrote; it predicts the same numbers.

    Raises
    ------
    InputError
        If there is no such file, it is something else or damaged, or it needs a law that is not
        registered here.

    Examples
    --------
    >>> import discover as dc
    >>> law = dc.load("law.discover")  # doctest: +SKIP
    >>> law.predict(test)  # doctest: +SKIP
    """
    if not isinstance(path, str | os.PathLike):
        raise InputError(f"load takes the path of a file; got a {type(path).__name__}.")
    content = _content(Path(path))
    name = str(content.get("learner"))
    if name not in _LEARNERS:
        raise InputError(
            f"{path} holds an estimator of the kind {name!r}; known are "
            f"{', '.join(_LEARNERS)}. Give a file that one of them saved."
        )
    try:
        parameters, fitted = (
            {key: restored(value) for key, value in content[part].items()}
            for part in ("parameters", "fitted")
        )
        return _LEARNERS[name](**parameters)._with_fit(fitted)
    except InputError as error:  # a law that is not registered here
        raise InputError(f"{path}: {error}") from None
    except DAMAGES as error:
        raise _damaged(path, error) from None


def _content(path: Path) -> dict[str, Any]:
    """Return what a file holds; InputError if it is none, damaged, or of another version."""
    if os.path.isdir(path):
        raise InputError(f"{path} is a folder. Give the file that estimator.save(path) wrote.")
    # a pipe or a device has no end, and is refused here
    packed = read_bytes(path, str(path), "Check the path.", largest=_LARGEST)
    content: Any = None
    if packed.startswith(b"\x1f\x8b"):  # of gzip
        try:
            content = parse_json(_unpacked(packed))
        except (ValueError, zlib.error) as error:
            raise _damaged(path, error) from None
    elif packed.startswith(b"PK") and b"estimator.json" in packed:  # before the third form
        content = {"format": FORMAT, "version": "1 or 2", "made_by": "an earlier version"}
    if not isinstance(content, dict) or content.get("format") != FORMAT:
        raise InputError(
            f"{path} is not a complete estimator file. Give a file that "
            "estimator.save(path) wrote; a law by itself is read elsewhere."
        )
    if content.get("version") != VERSION:
        raise InputError(
            f"{path} was written by {content.get('made_by', 'another version')} in the "
            f"form {content.get('version')}; this is discover {__version__}, which reads the "
            f"form {VERSION}. Use that version, or fit again."
        )
    return content


def _damaged(path: str | Path, error: Exception) -> InputError:
    first = (str(error).splitlines() or [""])[0][:200]
    return InputError(
        f"{path} is damaged ({type(error).__name__}: {first}). Copy it again, or fit again."
    )


def _unpacked(packed: bytes) -> bytes:
    """Return what gzip packed, by its checksum; no more than an estimator has is unpacked."""
    unpacker = zlib.decompressobj(wbits=zlib.MAX_WBITS | 16)
    content = unpacker.decompress(packed, _LARGEST)
    if not unpacker.eof:
        raise ValueError(f"it ends early, or unpacks to more than {_LARGEST / 1e6:.0f} MB")
    return content
