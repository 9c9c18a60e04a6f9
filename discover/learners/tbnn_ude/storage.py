"""Save and load a trained law: a JSON header and the raw arrays, no pickle."""

import json
import os
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp

from discover.errors import InputError
from discover.laws.tensor_basis_network import TensorBasisNetwork

FORMAT = "discover tensor-basis network 1"


def save_law(law: TensorBasisNetwork, path: str | Path) -> None:
    """Write a trained law to a file, replacing it whole or not at all.

    Parameters
    ----------
    law
        The law; one with a base law is refused.
    path
        The file.
    """
    if law.base is not None:
        raise InputError("A network on top of a base law cannot be stored; store its parts.")
    header = {
        "format": FORMAT,
        "width": law.network.width_size,
        "depth": law.network.depth,
        "linear_relaxation": law.linear_relaxation,
        "scaled": law.invariant_scale is not None,
    }
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
            law = TensorBasisNetwork.initialise(
                jax.random.key(0),
                int(header["width"]),
                int(header["depth"]),
                bool(header["linear_relaxation"]),
            )
            if header["scaled"]:
                law = eqx.tree_at(
                    lambda tree: tree.invariant_scale,
                    law,
                    jnp.ones(8),
                    is_leaf=lambda leaf: leaf is None,
                )
            return eqx.tree_deserialise_leaves(file, law)
    except FileNotFoundError:
        raise InputError(f"There is no file {path}.") from None
    except InputError:
        raise
    except (ValueError, KeyError, TypeError, RuntimeError, EOFError, AttributeError) as error:
        raise InputError(
            f"{path} does not hold a trained network of this software ({error})."
        ) from None
