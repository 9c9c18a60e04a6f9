import pytest
from user_packages import Workplace


@pytest.fixture
def workplace(tmp_path):
    return Workplace(tmp_path)
