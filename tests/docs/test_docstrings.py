"""Documentation: docstrings say shapes and units, the site is built and has every name."""

import inspect
import re
import subprocess
import sys
from html.parser import HTMLParser
from pathlib import Path

import pytest

import discover
import discover as dc
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


ROOT = Path(__file__).parents[2]


class Page(HTMLParser):
    """What a page loads, and the places in it."""

    def __init__(self, text):
        super().__init__()
        self.loaded, self.places = [], set()
        self.feed(text)

    def handle_starttag(self, tag, attrs):
        values = dict(attrs)
        self.places |= {values[key] for key in ("id", "name") if values.get(key)}
        if tag in ("script", "img", "iframe") and values.get("src"):
            self.loaded.append(values["src"])
        elif tag == "link" and values.get("rel") in ("stylesheet", "icon", "preload", "prefetch"):
            self.loaded.append(values["href"])


@pytest.fixture(scope="module")
def site(tmp_path_factory):
    for name in ("material", "mkdocstrings", "nbconvert"):
        pytest.importorskip(name)
    folder = tmp_path_factory.mktemp("site")
    command = [sys.executable, "-m", "mkdocs", "build", "-q", "-d", str(folder)]
    # strict, and a link that leads nowhere is a warning: an error
    subprocess.run(command, cwd=ROOT, check=True)
    pages = {path: Page(path.read_text("utf-8")) for path in folder.rglob("*.html")}
    pages.pop(folder / "404.html")  # written for the root of a server
    return pages


def test_the_site_loads_nothing_from_a_network(site):
    assert len(site) > 30
    for path, page in site.items():
        assert not [source for source in page.loaded if "//" in source], path.name


def test_every_public_name_and_what_users_hold_of_it_is_in_the_reference(site):
    places = set().union(*(page.places for page in site.values()))
    tables = {
        "laws": "discover.laws.registry.laws_table",
        "effects": "discover.effects.registry.effects_table",
    }
    for name in dc.__all__:
        assert tables.get(name, f"discover.{name}") in places, name
    for name in tensor_library.__all__:
        assert f"tensor_library.{name}" in places, name
    for learner in ("TensorSINDy", "TBNNUDE"):
        for method in ("fit", "predict", "score", "save", "equation_"):
            assert f"discover.{learner}.{method}" in places
    for method in ("to_html", "to_dataframe", "to_json", "errors_table"):
        assert f"discover.comparison.comparison.Comparison.{method}" in places
        assert f"discover.loop.loop_result.LoopResult.{method}" in places
    assert "discover.equations.Equation.latex" in places


def test_formulas_are_set_and_search_knows_them_by_name(site):
    (effects,) = [path for path in site if path.name == "effects.html"]
    text = effects.read_text("utf-8")
    assert text.count("<math") > 20
    assert not re.search(r'class="arithmatex">\\', text)
    assert "giesekus_mobility" in (effects.parent / "search/search_index.js").read_text("utf-8")
