"""What is shipped holds what it needs, and nothing else."""

import re
import subprocess
import sys
import tarfile
import zipfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def built(tmp_path_factory):
    """Wheel and sdist, as a release builds them."""
    pytest.importorskip("hatchling")
    pytest.importorskip("hatch_fancy_pypi_readme")
    folder = tmp_path_factory.mktemp("dist")
    command = [sys.executable, "-m", "hatchling", "build", "-d", str(folder)]
    subprocess.run(command, cwd=ROOT, check=True, capture_output=True)
    (wheel,), (sdist,) = folder.glob("*.whl"), folder.glob("*.tar.gz")
    return zipfile.ZipFile(wheel), tarfile.open(sdist)


def test_the_wheel_holds_both_packages_their_templates_and_nothing_else(built):
    names = built[0].namelist()
    info = next(name for name in names if name.endswith("/METADATA")).split("/")[0]
    assert {name.split("/")[0] for name in names} == {"discover", "tensor_library", info}
    assert f"{info}/licenses/LICENSE" in names
    for package in ("discover", "tensor_library"):
        kept = {
            str(path.relative_to(ROOT))
            for path in (ROOT / package).rglob("*")
            if path.is_file() and "__pycache__" not in path.parts
        }
        assert kept == {name for name in names if name.split("/")[0] == package}


def test_the_sdist_holds_what_a_packager_builds_and_tests_with(built):
    names = {"/".join(name.split("/")[1:]) for name in built[1].getnames()}
    wanted = {
        "pyproject.toml", "LICENSE", "README.md", "CHANGELOG.md", "CITATION.cff", "mkdocs.yml",
    }  # fmt: skip
    assert wanted <= names
    assert {"tests/docs/test_distribution.py", "docs/tutorial.md"} <= names
    assert not [name for name in names if name.startswith((".venv", "results", "site/", "data/"))]


def test_the_readme_outside_the_repository_has_no_link_that_leads_nowhere(built):
    (name,) = [name for name in built[0].namelist() if name.endswith("/METADATA")]
    text = built[0].read(name).decode()
    relative = r"\]\((?!https?:)[^)]+\)"
    assert re.search(relative, (ROOT / "README.md").read_text("utf-8"))  # there it has some
    assert not re.search(relative, text)
    assert "discover demo" in text
    assert "docs/picture.py" not in text
