"""Pages of the site that are made: of root files, notebooks, registries and docstrings."""

import re
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import latex2mathml.converter
import nbconvert
from mkdocs.structure.files import File

import discover as dc
import tensor_library

ROOT = Path(__file__).parents[1]
ROOT_PAGES = {
    "README.md": "index.md",
    "CONTRIBUTING.md": "project/contributing.md",
    "CHANGELOG.md": "project/changelog.md",
    "CODE_OF_CONDUCT.md": "project/code_of_conduct.md",
    "SECURITY.md": "project/security.md",
}
REFERENCE = {
    "data": (
        "Data",
        "load_dataset from_dataframe check_folder synthetic_dataset Dataset Run LinearSweep "
        "InputError",
    ),
    "flows": (
        "Flows",
        "start_up step_rates oscillatory_shear measured_rate sampled_rate in_flow "
        "after_step_strain after_alternation after_steady_flow",
    ),
    "laws": ("Fluids and laws", "laws make_law Fluid AbstractConstitutiveLaw"),
    "learners": ("Learners", "TensorSINDy TBNNUDE load build_library ClosedForm"),
    "loops": ("Fitting, comparing and closing the loop", "fit compare close_loop effects"),
    "registering": (
        "Additions of your own",
        "register_law register_effect register_closed_form register_learner register_importer",
    ),
}

# what these return, which nobody makes by hand
RESULTS = {
    "learners": (
        "discover.equations.Equation",
        "discover.learners.RecoveredTerm",
        "discover.learners.LearnerResult",
    ),
    "loops": (
        "discover.fitting.NamedLawFit",
        "discover.comparison.comparison.Comparison",
        "discover.loop.loop_result.LoopResult",
    ),
}

# these two names are packages as well, whose reference would be that of all that they hold
TABLES = {
    "laws": "discover.laws.registry.laws_table",
    "effects": "discover.effects.registry.effects_table",
}


def on_files(files, config):
    """Add the pages that are made."""
    for path, content in [*_root_pages(), *_gallery(), *_reference(), *_tables()]:
        files.append(File.generated(config, path, content=content))
    return files


def on_page_markdown(markdown, page, **_):
    """Lead links to files of the root to their pages."""
    up = "../" * page.file.src_uri.count("/")
    for name, path in ROOT_PAGES.items():
        markdown = markdown.replace(f"](../{name}", f"]({up}{path}")
    return markdown


def on_page_content(html, **_):
    """Set formulas in MathML, which browsers read without a script."""
    formula = r'<(span|div) class="arithmatex">\\[(\[](.*?)\\[)\]]</\1>'
    return re.sub(formula, _mathml, html, flags=re.S)


def _mathml(match: re.Match) -> str:
    tag, latex = match.groups()
    latex = latex.replace("&amp;", "&").replace("&lt;", "<").replace("&gt;", ">")
    for sign in "+-":  # one sign, which the converter would set as two
        latex = latex.replace(rf"\mathrel{{{sign}}}=", rf"\text{{ {sign}= }}")
    math = latex2mathml.converter.convert(latex, display="block" if tag == "div" else "inline")
    return f'<{tag} class="arithmatex">{math}</{tag}>'


def _root_pages() -> Iterator[tuple[str, str]]:
    for name, path in ROOT_PAGES.items():
        text = (ROOT / name).read_text("utf-8")
        up = "../" * path.count("/")
        text = re.sub(r"\]\(docs/", f"]({up}", text)
        yield path, re.sub(r"\]\(([A-Z_]+\.md)", r"](../\1", text)


def _gallery() -> Iterator[tuple[str, str | bytes]]:
    """Yield the notebooks as they were executed, and their pictures."""
    for file in sorted((ROOT / "notebooks").glob("*.ipynb")):
        name = {"unique_key": f"{file.stem}_files", "output_files_dir": f"{file.stem}_files"}
        text, resources = nbconvert.MarkdownExporter().from_filename(str(file), resources=name)
        # without a style of their own the site's holds for tables
        text = re.sub(r"<style scoped>.*?</style>", "", text, flags=re.S)
        text = re.sub(r"<table[^>]*>", "<table>", text)
        yield f"gallery/{file.stem}.md", text
        for path, content in resources["outputs"].items():
            yield f"gallery/{path}", content


def _reference() -> Iterator[tuple[str, str]]:
    """Yield every public name with its docstring, and the commands with their help."""
    listed = {name for _, names in REFERENCE.values() for name in names.split()}
    if listed != set(dc.__all__):
        raise ValueError(f"names that REFERENCE lacks or invents: {listed ^ set(dc.__all__)}")
    for path, (title, names) in REFERENCE.items():
        paths = [TABLES.get(name, f"discover.{name}") for name in names.split()]
        entries = "".join(f"\n::: {name}\n" for name in (*paths, *RESULTS.get(path, ())))
        yield f"reference/{path}.md", f"# {title}\n{entries}"
    entries = "".join(f"\n::: tensor_library.{name}\n" for name in tensor_library.__all__)
    yield "reference/tensor_library.md", f"# Tensor library\n{entries}"
    command = [sys.executable, "-m", "typer", "discover.cli", "utils", "docs", "--name", "discover"]
    text = subprocess.run(command, capture_output=True, text=True, check=True).stdout
    yield "reference/commands.md", text.replace("# `discover`", "# Commands", 1)


def _tables() -> Iterator[tuple[str, str]]:
    """Yield what the registries hold."""
    laws = dc.laws().to_html(index=False, border=0, na_rep="")
    yield "reference/named_laws.md", f"# Named laws\n\nWhat `dc.laws()` returns.\n\n{laws}\n"
    lines = ["# Terms", "", "What `dc.build_library(degree=...)` holds, by the degree of its"]
    lines += ["invariants, in the order of the library.", ""]
    before: set[str] = set()
    for degree in (0, 1, 2):
        names = dc.build_library(degree=degree).names
        lines += [f"## Degree {degree}: {len(names)} terms", ""]
        lines += [f"- `{name}`" for name in names if name not in before]
        before |= set(names)
        lines += [""]
    lines += [
        "## Closed forms",
        "",
        "| name | term | inner parameter | source |",
        "|---|---|---|---|",
    ]
    for name, form in tensor_library.CLOSED_FORMS.items():
        low, high = form.inner_bounds
        inner = f"{form.inner_name}, {low:g} to {high:g}"
        lines.append(f"| `{name}` | `{form.spelling}` | {inner} | {form.source} |")
    yield "reference/terms.md", "\n".join(lines) + "\n"
