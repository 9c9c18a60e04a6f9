"""Of the whole code: no module imports another in a circle, and tests check shapes as they run."""

import first_calls
import grimp
import jax.numpy as jnp
import jaxtyping
import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components

from discover.forward.grid import make_grid
from discover.protocols import start_up
from tensor_library import trace


def circles(*packages):
    """Groups of modules that import each other, directly or through others."""
    graph = grimp.build_graph(*packages, cache_dir=None)
    names = sorted(graph.modules)
    imports = np.zeros((len(names), len(names)), dtype=bool)
    for i, name in enumerate(names):
        imports[i] = np.isin(names, list(graph.find_modules_directly_imported_by(name)))
    _, group = connected_components(imports, directed=True, connection="strong")
    together = [[names[i] for i in np.flatnonzero(group == g)] for g in np.unique(group)]
    return sorted(members for members in together if len(members) > 1)


def test_no_module_imports_another_in_a_circle_and_one_that_did_would_be_found(
    tmp_path, monkeypatch
):
    assert circles("discover", "tensor_library") == []
    monkeypatch.syspath_prepend(tmp_path)
    (tmp_path / "made_up").mkdir()
    back = "if TYPE_CHECKING:\n    from made_up.first import First"
    files = {"__init__": "", "first": "import made_up.second", "second": "from . import third"}
    for name, text in (files | {"third": back}).items():
        (tmp_path / "made_up" / f"{name}.py").write_text(text)
    assert circles("made_up") == [["made_up.first", "made_up.second", "made_up.third"]]


def test_a_shape_that_does_not_fit_is_an_error_on_first_calls_of_each_file():
    assert not jaxtyping.config.jaxtyping_disable
    with pytest.raises(jaxtyping.TypeCheckError):
        trace(jnp.zeros((5, 4)))
    flow, wrong = start_up(1.0), np.zeros((2, 2))
    first_calls.begin_file()
    for _ in range(first_calls.CALLS):
        with pytest.raises(jaxtyping.TypeCheckError):
            make_grid(flow, wrong)
    with pytest.raises(Exception, match=r".") as later:
        make_grid(flow, wrong)
    assert not isinstance(later.value, jaxtyping.TypeCheckError)
    first_calls.begin_file()
    with pytest.raises(jaxtyping.TypeCheckError):
        make_grid(flow, wrong)
