"""A saved estimator, whichever learner it is of."""

import dataclasses
import os
import zlib
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from discover._version import __version__
from discover.dataset.tables.table import read_bytes
from discover.errors import InputError
from discover.laws.each_mode import law_of_each_mode
from discover.laws.registry import make_law
from discover.laws.tensor_basis_network import TensorBasisNetwork
from discover.learners.files import FORMAT, KIND, KINDS, VERSION
from discover.learners.tbnn_ude import TBNNUDE
from discover.learners.tensor_sindy import TensorSINDy
from discover.plain_numbers import parse_json
from tensor_library import TermLibrary, parse_term

_LEARNERS = {one.learner: one for one in (TensorSINDy, TBNNUDE)}

_LARGEST = 2**28
"""Bytes of a file, and of what it unpacks to, at most: an estimator of megabytes is a large one."""

_DAMAGES = (LookupError, TypeError, ValueError, AttributeError, OverflowError, RecursionError)


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
    except _DAMAGES as error:
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


def restored(content: Any) -> Any:
    """Return the value that `plain` wrote; one of `_DAMAGES` is raised where it is damaged."""
    if not isinstance(content, dict):
        return content
    kind = content[KIND]
    if kind == "array":
        dtype = np.dtype(content["dtype"])
        if dtype.kind not in "biuf":  # of texts one alone may fill the memory
            raise ValueError(f"an array of {dtype}")
        return np.array(content["numbers"], dtype).reshape(content["shape"])
    if kind in ("list", "tuple"):
        items = [restored(item) for item in content["items"]]
        return items if kind == "list" else tuple(items)
    if kind == "dict":
        return {key: restored(item) for key, item in content["items"].items()}
    if kind == "library":
        return TermLibrary(tuple(parse_term(name) for name in content["terms"]))
    if kind == "named_law":
        law = make_law(content["name"], content["values"])
        relaxes = bool(content["linear_relaxation"])
        if law.linear_relaxation == relaxes:
            return law
        return dataclasses.replace(law, linear_relaxation=relaxes)
    if kind == "law_of_each_mode":
        return law_of_each_mode([make_law(content["name"], one) for one in content["constants"]])
    fields = {key: restored(item) for key, item in content["fields"].items()}
    for name, value in fields.items():  # those of modules are JAX's
        fields[name] = jnp.asarray(value) if isinstance(value, np.ndarray) else value
    if kind == "network":
        return _network(restored(content["weights"]), content["width"], content["depth"], fields)
    return KINDS[kind](**fields)


def _network(
    weights: Sequence[np.ndarray], width: int, depth: int, fields: dict[str, Any]
) -> TensorBasisNetwork:
    if not width and not depth and not weights:
        return TensorBasisNetwork(network=None, **fields)
    # a network is not made larger than the weights that the file has for it
    if len(weights) != 2 * (depth + 1) or len(weights[0]) != width:
        raise ValueError("weights do not fit the network")
    made = TensorBasisNetwork.initialise(jax.random.key(0), width, depth)
    dynamic, static = eqx.partition(made.network, eqx.is_array)
    leaves, structure = jax.tree.flatten(dynamic)
    if [w.shape for w in weights] != [leaf.shape for leaf in leaves]:
        raise ValueError("weights do not fit the network")
    network = eqx.combine(structure.unflatten(map(jnp.asarray, weights)), static)
    return TensorBasisNetwork(network=network, **fields)
