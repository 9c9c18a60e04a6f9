"""Where commands compute."""

import os
import subprocess
import sys

import pytest

from discover.accelerators import use_the_processor_from_the_start

_SAYS_WHERE = "; ".join(
    (
        "import sys",
        "sys.argv = ['discover', '--version']",
        "from discover.cli import main",
        "import atexit",
        "atexit.register(lambda: print(__import__('os').environ['JAX_PLATFORMS']))",
        "main()",
    )
)


def test_a_command_computes_on_the_processor():
    plain = {k: v for k, v in os.environ.items() if not k.startswith("JAX_PLATFORM")}
    ran = subprocess.run(
        [sys.executable, "-c", _SAYS_WHERE], env=plain, capture_output=True, text=True, check=True
    )
    assert ran.stdout.split()[-1] == "cpu"


@pytest.mark.parametrize("name", ["JAX_PLATFORMS", "JAX_PLATFORM_NAME"])
def test_what_the_user_chose_stays(monkeypatch, name):
    for one in ("JAX_PLATFORMS", "JAX_PLATFORM_NAME"):
        monkeypatch.delenv(one, raising=False)
    monkeypatch.setenv(name, "cuda")
    use_the_processor_from_the_start()
    assert os.environ[name] == "cuda"
    assert os.environ.get("JAX_PLATFORMS", "cuda") == "cuda"
