import sys
from pathlib import Path

import pytest

# helper modules of this folder: tests are imported by path, not as a package
sys.path.insert(0, str(Path(__file__).parent))

from user_packages import Workplace


@pytest.fixture
def workplace(tmp_path):
    return Workplace(tmp_path)
