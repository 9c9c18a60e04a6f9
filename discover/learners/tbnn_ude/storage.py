"""Save and load a trained law: a JSON header and the raw arrays, no pickle."""

import json
import os
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from discover.errors import InputError
from discover.laws.base import AbstractConstitutiveLaw
from discover.laws.registry import LAWS, make_law
from discover.laws.tensor_basis_network import TensorBasisNetwork

FORMAT = "discover tensor-basis network 1"


def save_law(law: TensorBasisNetwork, path: str | Path) -> None:
    """Write a trained law to a file, replacing it whole or not at all.

    Parameters
    ----------
    law
        The law. A law beneath the network must be a named one (`discover.laws.LAWS`) or a network
        itself: the file says which, and never how to make an arbitrary object.
    path
        The file.

    Raises
    ------
    InputError
        If the law beneath the network has no name.
    """
    header = {"format": FORMAT, **_description(law)}
    path = Path(path)
    partial = path.with_name(path.name + ".partial")
    with partial.open("wb") as file:
        file.write((json.dumps(header) + "\n").encode())
        eqx.tree_serialise_leaves(file, law)
    os.replace(partial, path)


def load_law(path: str | Path) -> TensorBasisNetwork:
    """Return a law written by `save_law`.

    Raises
    ------
    InputError
        If the file is missing or is not such a law.
    """
    path = Path(path)
    try:
        with path.open("rb") as file:
            header = json.loads(file.readline(10_000).decode())
            if header.get("format") != FORMAT:
                raise InputError(f"{path} does not hold a trained network of this software.")
            return eqx.tree_deserialise_leaves(file, _template(header))
    except FileNotFoundError:
        raise InputError(f"There is no file {path}.") from None
    except InputError:
        raise
    except (
        ValueError,
        KeyError,
        TypeError,
        RuntimeError,
        EOFError,
        AttributeError,
        RecursionError,
    ) as error:
        raise InputError(
            f"{path} does not hold a trained network of this software ({error})."
        ) from None


def _description(law: TensorBasisNetwork) -> dict[str, Any]:
    """Return what has to be known of a law before its arrays can be read."""
    return {
        "width": law.network.width_size,
        "depth": law.network.depth,
        "linear_relaxation": law.linear_relaxation,
        "scaled": law.invariant_scale is not None,
        "base": None if law.base is None else _description_of_base(law.base),
    }


def _description_of_base(base: AbstractConstitutiveLaw) -> dict[str, Any]:
    if isinstance(base, TensorBasisNetwork):
        return _description(base)
    for name, entry in LAWS.items():
        if entry.build is type(base) and base.linear_relaxation:
            return {"law": name}
    raise InputError(
        f"A network on top of {type(base).__name__} cannot be stored: its base must be one of "
        f"{', '.join(LAWS)}, or another network. Store the parts, and put them together again."
    )


def _template(described: Mapping[str, Any]) -> TensorBasisNetwork:
    """Return a law of the described shape; its numbers mean nothing yet."""
    law = TensorBasisNetwork.initialise(
        jax.random.key(0),
        int(described["width"]),
        int(described["depth"]),
        bool(described["linear_relaxation"]),
    )
    base = described.get("base")  # files of the first versions do not mention it
    return eqx.tree_at(
        lambda tree: (tree.invariant_scale, tree.base),
        law,
        (jnp.ones(8) if described["scaled"] else None, _template_of_base(base)),
        is_leaf=lambda leaf: leaf is None,
    )


def _template_of_base(described: Mapping[str, Any] | None) -> AbstractConstitutiveLaw | None:
    if described is None:
        return None
    if "law" not in described:
        return _template(described)
    name = str(described["law"])
    entry = LAWS.get(name)
    lowest = {} if entry is None else {key: low for key, (low, _) in entry.parameters.items()}
    return make_law(name, lowest)
