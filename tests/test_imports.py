"""Of the whole code: no module imports another in a circle, and tests check shapes as they run."""

import ast
from pathlib import Path

import first_calls
import jax.numpy as jnp
import jaxtyping
import numpy as np
import pytest
from scipy.sparse.csgraph import connected_components

from discover.forward.grid import make_grid
from discover.protocols import start_up
from tensor_library import trace

ROOT = Path(__file__).parents[1]


def modules_in(root, packages):
    """Files of all modules by name; a package is its ``__init__``."""
    files = {}
    for package in packages:
        for file in sorted((root / package).rglob("*.py")):
            parts = file.relative_to(root).with_suffix("").parts
            files[".".join(parts[:-1] if parts[-1] == "__init__" else parts)] = file
    return files


def imported_by(name, file, known):
    """Names of the known modules that a module imports, wherever in it the import stands."""
    found = set()
    package = name.split(".") if file.name == "__init__.py" else name.split(".")[:-1]
    for node in ast.walk(ast.parse(file.read_text("utf-8"))):
        if isinstance(node, ast.Import):
            found |= {alias.name for alias in node.names}
        elif isinstance(node, ast.ImportFrom):
            above = package[: len(package) - node.level + 1] if node.level else []
            base = ".".join([*above, *([node.module] if node.module else [])])
            inner = {f"{base}.{alias.name}" for alias in node.names}
            # what is no module is a name in the package
            found |= inner & known
            found |= {base} if inner - known else set()
    return (found & known) - {name}


def circles(root, packages):
    """Groups of modules that import each other, directly or through others."""
    files = modules_in(root, packages)
    names = sorted(files)
    imports = np.zeros((len(names), len(names)), dtype=bool)
    for name, file in files.items():
        for other in imported_by(name, file, set(files)):
            imports[names.index(name), names.index(other)] = True
    _, group = connected_components(imports, directed=True, connection="strong")
    together = [[names[i] for i in np.flatnonzero(group == g)] for g in np.unique(group)]
    return sorted(members for members in together if len(members) > 1)


def test_no_module_imports_another_in_a_circle():
    assert circles(ROOT, ["discover", "tensor_library"]) == []


@pytest.mark.parametrize(
    "back",
    [
        "from made_up.first import first",
        "from made_up import first",
        "from . import first",
        "from .first import first",
        "import made_up.first",
        "if TYPE_CHECKING:\n    from made_up.first import First",
        "def later():\n    from made_up.first import first",
    ],
)
def test_a_circle_is_found_however_it_is_closed(tmp_path, back):
    package = tmp_path / "made_up"
    package.mkdir()
    for name, text in {
        "__init__": "from made_up.first import first",
        "first": "import made_up.second",
        "second": "from made_up.third import third",
        "third": "import numpy",
    }.items():
        (package / f"{name}.py").write_text(text)
    assert circles(tmp_path, ["made_up"]) == []
    (package / "third.py").write_text(back)
    assert circles(tmp_path, ["made_up"]) == [["made_up.first", "made_up.second", "made_up.third"]]


def test_a_shape_that_does_not_fit_is_an_error_on_first_calls_of_each_file():
    assert not jaxtyping.config.jaxtyping_disable
    with pytest.raises(jaxtyping.TypeCheckError):
        make_grid(start_up(1.0), np.zeros((2, 2)))
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
