"""Every public name says what it takes: each parameter, and of arrays the shape and the unit."""

import inspect
import re

import pytest

import discover
import tensor_library

UNITS = re.compile(r"\b(Pa|s|1/s|rad|rad/s|°C|[Dd]imensionless|number|[Ss]train)\b|σ|γ̇")
SHAPES = re.compile(r"shape|\([a-z0-9]+,[^)]*\)|one value for each|one for each")


def described(doc: str) -> dict[str, str]:
    """Return what the sections on parameters and attributes of a numpydoc text say, by name."""
    found: dict[str, str] = {}
    for section in re.findall(r"^(?:Parameters|Attributes)\n-+\n(.*?)(?=\n\w+\n---|\Z)", doc,
                              re.S | re.M):  # fmt: skip
        for names, text in re.findall(r"^(\S.*?)(?: : .*)?\n((?:    .*\n?|\n)*)", section, re.M):
            for name in names.split(","):
                found[name.strip().lstrip("*")] = f"{names} {text}"
    return found


def callables():
    """Yield the name and the object of everything public that is called, methods included."""
    for package in (discover, tensor_library):
        for name in package.__all__:
            public = getattr(package, name)
            if name in ("laws", "effects"):  # packages, which answer calls by their tables
                continue
            if inspect.isclass(public) and not issubclass(public, Exception):
                yield f"{package.__name__}.{name}", public
                for method, function in inspect.getmembers(public, inspect.isfunction):
                    own = function.__module__.partition(".")[0] in ("discover", "tensor_library")
                    if own and not method.startswith("_"):
                        yield f"{package.__name__}.{name}.{method}", function
            elif callable(public) and not inspect.isclass(public):
                yield f"{package.__name__}.{name}", public


def silent_about(public) -> list[str]:
    """Return the parameters that the docstring does not name; one alone may stand in its text."""
    doc = inspect.getdoc(public) or ""
    wanted = [
        name for name in inspect.signature(public).parameters
        if name not in ("self", "args", "kwargs") and not name.startswith("_")
    ]  # fmt: skip
    missing = [name for name in wanted if name not in described(doc)]
    summary = doc.partition("\n\n")[0]
    if len(missing) == len(wanted) <= 2 and "Parameters" not in doc:
        return [] if summary else wanted
    return missing


def without_shape_or_unit(public) -> list[str]:
    """Return the array-valued parameters whose description has no shape or no unit."""
    said = described(inspect.getdoc(public) or "")
    arrays = [
        name for name, parameter in inspect.signature(public).parameters.items()
        if re.search(r"\bFloat\[", str(parameter.annotation)) and name in said
    ]  # fmt: skip
    return [n for n in arrays if not (UNITS.search(said[n]) and SHAPES.search(said[n]))]


@pytest.mark.parametrize(("name", "public"), list(callables()))
def test_every_parameter_is_described_arrays_with_shape_and_unit(name, public):
    assert (inspect.getdoc(public) or "").strip(), name
    assert not silent_about(public), name
    assert not without_shape_or_unit(public), name


def test_what_says_nothing_is_found():
    # control of the test above
    def mute(first, second, third):
        """Return nothing."""

    def vague(values: "Float[np.ndarray, ' n']"):  # noqa: F821
        """Return nothing.

        Parameters
        ----------
        values
            Some values.
        """

    assert silent_about(mute) == ["first", "second", "third"]
    assert without_shape_or_unit(vague) == ["values"]
