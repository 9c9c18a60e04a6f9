"""The pages do what they say: recipes followed literally, links and commands that exist."""

import ast
import doctest
import importlib
import importlib.util
import inspect
import re
import sys
from pathlib import Path

import pytest
import typer.main
from user_packages import blocks

import discover
import tensor_library
from discover.cli import app
from discover.laws import LAWS
from discover.study import read_study
from discover.study.schema import Study

ROOT = Path(__file__).parents[2]
OF_THE_ROOT = ("README.md", "CONTRIBUTING.md", "SECURITY.md", "CODE_OF_CONDUCT.md")
PAGES = [*(ROOT / name for name in OF_THE_ROOT), *sorted((ROOT / "docs").glob("*.md"))]


def test_the_page_on_effects_names_neighbours_that_exist():
    text = (ROOT / "docs" / "adding-an-effect.md").read_text("utf-8")
    table = "".join(re.findall(r"^ *\|.*\n", text, re.M))
    for name in re.findall(r"`(\w+\.py)`", table):
        assert list((ROOT / "discover" / "effects").rglob(name)), name


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_links_lead_somewhere(page):
    for target in re.findall(r"\]\(([\w./:-]+)(?:#[\w-]+)?\)", page.read_text("utf-8")):
        if not target.startswith(("http:", "https:")):
            assert (page.parent / target).exists(), target


def known_options():
    """The options of every command, by its words."""
    known = {}

    def walk(command, words):
        for name, inner in getattr(command, "commands", {}).items():
            walk(inner, (*words, name))
        known[words] = {option for p in command.params for option in p.opts}

    walk(typer.main.get_command(app), ())
    return known


@pytest.mark.parametrize("page", PAGES, ids=lambda page: page.name)
def test_commands_and_options_on_the_pages_exist(page):
    known = known_options()
    text = re.sub(r"\\\n", " ", page.read_text("utf-8"))
    lines = re.findall(r"^(?:.*&& )?(?:\.venv/bin/)?discover (\S.*)$", text, re.M)
    lines += re.findall(r"`discover ([^`\n]+)`", text)
    for line in lines:
        words = line.split("#")[0].split()
        command = tuple(words[: 2 if words[0] == "data" else 1])
        if not command[0].islower():
            continue  # a sentence that begins with the name
        assert command in known, line
        options = {w.split("=")[0] for w in words if w.startswith("-") and len(w) > 1}
        assert options <= known[command] | {"--help"}, line


def test_examples_in_docstrings_run():
    """Every module with an example in a docstring, found by its prompt."""
    ran = 0
    for package in ("discover", "tensor_library"):
        for file in (ROOT / package).rglob("*.py"):
            if ">>> " in file.read_text("utf-8"):
                path = file.parent if file.stem == "__init__" else file.with_suffix("")
                name = ".".join(path.relative_to(ROOT).parts)
                result = doctest.testmod(importlib.import_module(name))
                assert result.failed == 0, name
                ran += result.attempted
    assert ran >= 5


@pytest.mark.parametrize("package", [discover, tensor_library], ids=lambda p: p.__name__)
def test_every_public_name_that_is_called_has_an_example(package):
    for name in package.__all__:
        public = getattr(package, name)
        if name in ("laws", "effects"):  # packages, which answer calls by their tables
            public = getattr(public.registry, f"{name}_table")
        if callable(public):
            assert has_example(public, name), name
    assert not has_example(inspect.cleandoc, "cleandoc")  # control: not everything has one


def has_example(public, name):
    """Whether a docstring has an example, or that of its module or package one with its name."""
    heading, module = "\nExamples\n--------\n", public.__module__
    if heading in inspect.getdoc(public):
        return True
    near = (sys.modules[one] for one in (module, module.rpartition(".")[0]) if one)
    shown = [(one.__doc__ or "").partition(heading)[2] for one in near]
    return any(re.search(rf"\b{name}\b", text) for text in shown)


def test_the_citation_file_names_this_version():
    text = (ROOT / "CITATION.cff").read_text("utf-8")
    assert f"\nversion: {discover.__version__}\n" in text
    assert "\ncff-version: 1.2.0\n" in f"\n{text}"
    assert "license: MIT" in text


@pytest.mark.parametrize("package", ["discover", "tensor_library"])
def test_packages_say_that_they_are_typed(package):
    assert (ROOT / package / "py.typed").is_file()


def test_a_study_file_of_the_tutorial_is_a_study(tmp_path):
    for i, text in enumerate(blocks("tutorial.md", "toml")):
        (tmp_path / f"{i}.toml").write_text(text)
        read_study(tmp_path / f"{i}.toml")


def test_the_batch_script_for_a_cluster_is_python():
    for text in blocks("batches.md", "python"):
        ast.parse(text)


def test_the_readme_fits_two_screens_with_one_picture_that_follows_light_and_dark():
    (name,) = re.findall(r"!\[[^\]]+\]\(([^)]+)\)", (ROOT / "README.md").read_text("utf-8"))
    picture = (ROOT / name).read_text("utf-8")
    assert "prefers-color-scheme: dark" in picture
    assert "http://" not in re.sub(r'xmlns(?::\w+)?="[^"]*"|<metadata>.*?</metadata>', "", picture,
                                   flags=re.S).split("<svg", 1)[1]  # fmt: skip
    for text in ("σ₁₂", "N₁", "N₂", "truth", "sparse regression", "neural network"):
        assert text in picture
    assert len(picture) < 60_000
    assert len((ROOT / "README.md").read_text("utf-8").splitlines()) <= 100


def script(name):
    """Return a script of docs/ as a module."""
    spec = importlib.util.spec_from_file_location(name, ROOT / "docs" / f"{name}.py")
    made = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(made)
    return made


def test_pages_of_keys_and_effects_are_those_of_schema_and_dictionary_and_say_what_they_mean():
    made = script("study_keys")
    assert made.PAGE.read_text("utf-8") == made.study_page(), "run: python docs/study_keys.py"
    made = script("effects_page")
    assert made.PAGE.read_text("utf-8") == made.reference_page(), "run: docs/effects_page.py"
    schema = Study.model_json_schema()
    sections = [schema, *(part for part in schema["$defs"].values() if "properties" in part)]
    assert len(sections) > 5
    for section in sections:
        for key, entry in section["properties"].items():
            assert entry.get("description"), f"{section['title']}.{key}"


def test_the_ten_answers_run():
    page = "ten-questions.md"
    known = set(LAWS.present)
    names = {}
    try:
        for text in blocks(page, "python"):
            exec(compile(text, page, "exec"), names)
    finally:
        for name in set(LAWS.present) - known:
            del LAWS[name]
    assert (
        len(re.findall(r"^## \d+\. .*\?$", (ROOT / "docs" / page).read_text("utf-8"), re.M)) == 10
    )
    assert (names["errors"] > 0.0).all()
    assert "The misfit is systematic" in names["answer"]  # the runs were made with another α
    assert names["loop"].verdict == "effects_added"
    assert names["number"] == 1
