import sys
from collections.abc import Iterator
from pathlib import Path

import jaxtyping
import pytest

# helper modules of this folder: tests are imported by path, not as a package
sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def as_users_run_it() -> Iterator[None]:
    """Leave annotations unchecked: elsewhere a wrong type ends before the code under test."""
    before = jaxtyping.config.jaxtyping_disable
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", before)
