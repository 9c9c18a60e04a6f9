"""Estimators in files: gzipped JSON, with what made them, without pickle."""

import dataclasses
import gzip
import hashlib
import json
import os
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from discover._version import __version__
from discover.dataset.run import Run
from discover.equations import law_parts
from discover.errors import InputError
from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.each_mode import LawOfEachMode, law_of_each_mode
from discover.laws.expansion import LibraryExpansion
from discover.laws.multimode import Fluid
from discover.laws.registry import LAWS, make_law, name_of
from discover.laws.tensor_basis_network import TensorBasisNetwork
from tensor_library import TermLibrary, parse_term

FORMAT, VERSION = "discover estimator", 3
KIND = "kind"

KINDS: dict[str, type] = {"fluid": Fluid, "expansion": LibraryExpansion}
"""Dataclasses that a file may hold beside numbers, text, arrays, laws, libraries, and lists and
dictionaries of them, by their names in files."""

NETWORK_FIELDS = ("constants", "network_mask", "invariant_scale", "linear_relaxation", "base")

_Kept = TypeVar("_Kept", bound=type)


def kept_in_files(made: _Kept) -> _Kept:
    """Let files hold a dataclass; loading an estimator imports its module."""
    KINDS[made.__name__] = made
    return made


def write_estimator(
    path: str | Path,
    learner: str,
    parameters: Mapping[str, Any],
    fitted: Mapping[str, Any],
) -> Path:
    """Write an estimator to a file, replacing it whole or not at all.

    Raises InputError if something of it cannot be written, or `path` cannot be that of a file.
    """
    path = Path(path)
    if os.path.isdir(path) or not path.name:
        raise InputError(f"{path} is a folder. Name a file, such as {path / 'law.discover'}.")
    if not os.path.isdir(path.parent):
        raise InputError(f"There is no folder {path.parent} to save {path.name} in. Make it first.")
    content = {
        "format": FORMAT,
        "version": VERSION,
        "made_by": f"discover {__version__}",
        "learner": learner,
        "parameters": {k: plain(v, f"The parameter {k!r}") for k, v in parameters.items()},
        "fitted": {k: plain(v, f"The attribute {k!r}") for k, v in fitted.items()},
    }
    partial = path.with_name(path.name + ".partial")
    partial.write_bytes(gzip.compress(json.dumps(content, ensure_ascii=False).encode()))
    os.replace(partial, path)
    return path


DAMAGES = (LookupError, TypeError, ValueError, AttributeError, OverflowError, RecursionError)
"""What `restored` raises of a value that is damaged."""


def plain(value: Any, where: str) -> Any:
    """Return a value as JSON has it; InputError, which says `where`, if a file cannot hold it."""

    def all_of(items: Mapping[str, Any]) -> dict[str, Any]:
        return {name: plain(item, where) for name, item in items.items()}

    def of_fields(kind: str) -> dict[str, Any]:
        values = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
        return {KIND: kind, "fields": all_of(values)}

    if value is None or isinstance(value, bool | str | int | float):
        return value
    if isinstance(value, np.generic):
        return value.item()
    if isinstance(value, np.ndarray | jax.Array):
        array = np.asarray(value)
        return {
            KIND: "array",
            "dtype": array.dtype.str,
            "shape": list(array.shape),
            "numbers": array.ravel().tolist(),
        }
    if isinstance(value, list | tuple):
        items = [plain(item, where) for item in value]
        return {KIND: "list" if isinstance(value, list) else "tuple", "items": items}
    if isinstance(value, Mapping):
        return {KIND: "dict", "items": all_of({str(key): item for key, item in value.items()})}
    if isinstance(value, TermLibrary):
        return {KIND: "library", "terms": list(value.names)}
    for kind, made in KINDS.items():
        if type(value) is made:
            return of_fields(kind)
    if isinstance(value, TensorBasisNetwork):
        network = value.network
        weights = jax.tree.leaves(eqx.filter(network, eqx.is_array))
        return {
            KIND: "network",
            # of constants alone there is none
            "width": 0 if network is None else network.width_size,
            "depth": 0 if network is None else network.depth,
            "weights": plain(weights, where),
            "fields": all_of({name: getattr(value, name) for name in NETWORK_FIELDS}),
        }
    if isinstance(value, LawOfEachMode):
        part, _ = law_parts(value)  # it has a name, or is refused
        assert part is not None
        constants = [dict(one) for one in part.constants]
        return {KIND: "law_of_each_mode", "name": part.law, "constants": constants}
    if isinstance(value, AbstractConstitutiveLaw):
        return _named_law(value, where)
    raise InputError(
        f"{where} is a {type(value).__name__}, which a file cannot hold. Use a value of plain "
        "numbers, text or arrays, or keep the estimator with pickle."
    )


def _named_law(law: AbstractConstitutiveLaw, where: str) -> dict[str, Any]:
    found = name_of(law)
    if found is None:
        raise InputError(
            f"{where} holds a law of the kind {type(law).__name__}, which has no name. "
            f"Register it with register_law before saving; known are {', '.join(LAWS)}."
        )
    name, values = found
    relaxes = law.linear_relaxation
    return {KIND: "named_law", "name": name, "values": values, "linear_relaxation": relaxes}


def restored(content: Any) -> Any:
    """Return the value that `plain` wrote; one of `DAMAGES` is raised where it is damaged."""
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


@kept_in_files
@dataclasses.dataclass(frozen=True)
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
