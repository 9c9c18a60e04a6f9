"""Values as plain JSON with arrays beside it, and back, without pickle."""

import dataclasses
import math
from collections.abc import Mapping, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from discover.equations import law_parts
from discover.errors import InputError
from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.each_mode import LawOfEachMode, law_of_each_mode
from discover.laws.expansion import LibraryExpansion
from discover.laws.multimode import Fluid
from discover.laws.registry import LAWS, make_law, name_of
from discover.laws.tensor_basis_network import TensorBasisNetwork
from tensor_library import TermLibrary, parse_term

KIND = "kind"

Arrays = dict[str, np.ndarray]


class PlainWriter:
    """Writer of values as JSON, with arrays beside it in `arrays`, by name.

    `types`: dataclasses that may be written besides numbers, text, arrays, laws, fluids, libraries,
    and lists and dictionaries of them.
    """

    def __init__(self, types: Sequence[type]):
        self._types = tuple(types)
        self.arrays: Arrays = {}

    def plain(self, value: Any, where: str) -> Any:
        """Return a value as JSON-able ones; raises InputError if it cannot be written."""
        if value is None or isinstance(value, bool | str | int):
            return value
        if isinstance(value, np.generic):
            return self.plain(value.item(), where)
        if isinstance(value, float):
            return value if math.isfinite(value) else {KIND: "float", "text": repr(value)}
        if isinstance(value, np.ndarray | jax.Array):
            name = f"array{len(self.arrays)}"
            self.arrays[name] = np.asarray(value)
            return {KIND: "array", "name": name}
        if isinstance(value, list | tuple):
            kind = "list" if isinstance(value, list) else "tuple"
            return {KIND: kind, "items": [self.plain(item, where) for item in value]}
        if isinstance(value, Mapping):
            items = {str(key): self.plain(item, where) for key, item in value.items()}
            return {KIND: "dict", "items": items}
        if isinstance(value, TermLibrary):
            return {KIND: "library", "terms": list(value.names)}
        if isinstance(value, Fluid):
            return {KIND: "fluid", **self._fields(value, where)}
        if isinstance(value, AbstractConstitutiveLaw):
            return self._law(value, where)
        if type(value) in self._types:
            return {KIND: type(value).__name__, **self._fields(value, where)}
        raise InputError(
            f"{where} is a {type(value).__name__}, which a file cannot hold. Use a value of plain "
            "numbers, text or arrays, or keep the estimator with pickle."
        )

    def _fields(self, value: Any, where: str) -> dict[str, Any]:
        fields = [f.name for f in dataclasses.fields(value)]
        return {"fields": {name: self.plain(getattr(value, name), where) for name in fields}}

    def _law(self, law: AbstractConstitutiveLaw, where: str) -> dict[str, Any]:
        if isinstance(law, LibraryExpansion):
            return {KIND: "expansion", **self._fields(law, where)}
        if isinstance(law, TensorBasisNetwork):
            network = law.network
            weights = jax.tree.leaves(eqx.filter(network, eqx.is_array))
            return {
                KIND: "network",
                # of constants alone there is none
                "width": 0 if network is None else network.width_size,
                "depth": 0 if network is None else network.depth,
                "weights": self.plain(weights, where),
                "fields": {
                    name: self.plain(getattr(law, name), where)
                    for name in _NETWORK_FIELDS
                },
            }  # fmt: skip
        if isinstance(law, LawOfEachMode):
            part, _ = law_parts(law)  # it has a name, or is refused
            assert part is not None
            return {
                KIND: "law_of_each_mode",
                "name": part.law,
                "constants": [dict(one) for one in part.constants],
            }
        found = name_of(law)
        if found is None:
            raise InputError(
                f"{where} holds a law of the kind {type(law).__name__}, which has no name. "
                f"Register it with register_law before saving; known are {', '.join(LAWS)}."
            )
        name, values = found
        return {
            KIND: "named_law",
            "name": name,
            "values": values,
            "linear_relaxation": law.linear_relaxation,
        }


_NETWORK_FIELDS = ("constants", "network_mask", "invariant_scale", "linear_relaxation", "base")


class PlainReader:
    """Reader of what `PlainWriter` wrote; `types`: the dataclasses that may occur."""

    def __init__(self, types: Sequence[type], arrays: Mapping[str, np.ndarray]):
        self._types = {one.__name__: one for one in types}
        self._arrays = arrays

    def value(self, plain: Any) -> Any:
        """Return the value; raises KeyError, TypeError or ValueError where it is damaged."""
        if not isinstance(plain, dict):
            return plain
        kind = plain[KIND]
        if kind == "float":
            return float(plain["text"])
        if kind == "array":
            return self._arrays[plain["name"]]
        if kind in ("list", "tuple"):
            items = [self.value(item) for item in plain["items"]]
            return items if kind == "list" else tuple(items)
        if kind == "dict":
            return {key: self.value(item) for key, item in plain["items"].items()}
        if kind == "library":
            return TermLibrary(tuple(parse_term(name) for name in plain["terms"]))
        if kind == "named_law":
            law = make_law(plain["name"], plain["values"])
            relaxes = bool(plain["linear_relaxation"])
            if law.linear_relaxation == relaxes:
                return law
            return dataclasses.replace(law, linear_relaxation=relaxes)
        if kind == "law_of_each_mode":
            return law_of_each_mode([make_law(plain["name"], one) for one in plain["constants"]])
        fields = {key: self.value(item) for key, item in plain["fields"].items()}
        if kind == "network":
            return self._network(plain, fields)
        if kind == "fluid":
            return Fluid(**fields)
        if kind == "expansion":
            for name in ("coefficients", "inner"):
                fields[name] = jnp.asarray(fields[name])
            return LibraryExpansion(**fields)
        return self._types[kind](**fields)

    def _network(self, plain: Mapping[str, Any], fields: dict[str, Any]) -> TensorBasisNetwork:
        weights = self.value(plain["weights"])
        width, depth = int(plain["width"]), int(plain["depth"])
        known: dict[str, Any] = {
            key: jnp.asarray(value) if isinstance(value, np.ndarray) else value
            for key, value in fields.items()
        }
        if not width and not depth and not weights:
            return TensorBasisNetwork(network=None, **known)
        # a network is not made larger than the weights that the file has for it
        if len(weights) != 2 * (depth + 1) or len(weights[0]) != width:
            raise ValueError("weights do not fit the network")
        made = TensorBasisNetwork.initialise(jax.random.key(0), width, depth)
        dynamic, static = eqx.partition(made.network, eqx.is_array)
        leaves, structure = jax.tree.flatten(dynamic)
        if [w.shape for w in weights] != [leaf.shape for leaf in leaves]:
            raise ValueError("weights do not fit the network")
        network = eqx.combine(structure.unflatten(map(jnp.asarray, weights)), static)
        return TensorBasisNetwork(network=network, **known)
