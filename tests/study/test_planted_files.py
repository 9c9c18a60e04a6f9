"""What somebody else put into a result folder is refused, neither followed nor waited for."""

import os

import pytest

from discover.errors import InputError
from discover.study import RunFolder
from discover.study.lock import LOCK_FILE


@pytest.mark.parametrize("kind", ["pipe", "link", "folder"])
def test_a_lock_that_is_no_plain_file_is_refused_at_once(tmp_path, kind):
    lock = tmp_path / LOCK_FILE
    if kind == "pipe":
        os.mkfifo(lock)
    elif kind == "link":
        lock.symlink_to(tmp_path / "elsewhere")
    else:
        lock.mkdir()
    with pytest.raises(InputError, match="no plain file"):
        RunFolder(tmp_path, "abc")
    assert not (tmp_path / "elsewhere").exists()


def test_a_lock_left_behind_is_taken_over(tmp_path):
    (tmp_path / LOCK_FILE).write_text('{"pid": 1, "host": "another"}')
    assert not RunFolder(tmp_path, "abc").complete
