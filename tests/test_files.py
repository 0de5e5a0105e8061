"""Files are written whole or not at all."""

import os
from pathlib import Path

import pytest

from seakeep.errors import RequestError
from seakeep.files import replacing


def test_a_file_appears_when_it_is_whole(tmp_path):
    path = tmp_path / "a.txt"
    with replacing(path) as temporary:
        temporary.write_text("new")
        assert not path.exists()
    assert path.read_text() == "new"
    assert list(tmp_path.iterdir()) == [path]


def test_a_failure_leaves_the_old_file_and_no_litter(tmp_path):
    path = tmp_path / "a.txt"
    path.write_text("old")

    def fail():
        with replacing(path) as temporary:
            temporary.write_text("half")
            raise KeyError

    with pytest.raises(KeyError):
        fail()
    assert path.read_text() == "old"
    assert list(tmp_path.iterdir()) == [path]


def test_a_full_disk_is_named(tmp_path):
    with (
        pytest.raises(
            RequestError, match=r"cannot write .*a\.txt: No space left on device\. The f"
        ),
        replacing(tmp_path / "a.txt"),
    ):
        raise OSError(28, os.strerror(28))


def test_a_missing_folder_is_named(tmp_path):
    with (
        pytest.raises(RequestError, match=r"does not exist\. Create it first"),
        replacing(tmp_path / "no" / "a.txt"),
    ):
        pass


@pytest.mark.skipif(os.name != "posix", reason="permissions of POSIX")
def test_permissions_follow_the_umask(tmp_path):
    before = os.umask(0o027)
    try:
        with replacing(tmp_path / "a.txt") as temporary:
            temporary.write_text("x")
    finally:
        os.umask(before)
    assert Path(tmp_path / "a.txt").stat().st_mode & 0o777 == 0o640


def test_a_folder_in_the_place_of_the_file_is_named(tmp_path):
    with (
        pytest.raises(RequestError, match=r"it is a folder\. Name a file in it"),
        replacing(tmp_path),
    ):
        pass


def test_a_file_in_the_place_of_the_folder_is_named(tmp_path):
    (tmp_path / "a").write_text("")
    with (
        pytest.raises(RequestError, match=r"a is a file, not a folder\. Choose another place"),
        replacing(tmp_path / "a" / "b"),
    ):
        pass


def test_a_lack_of_permission_gets_its_own_mend(tmp_path):
    with (
        pytest.raises(RequestError, match=r"Permission denied\. .* folder that you may write to"),
        replacing(tmp_path / "a.txt"),
    ):
        raise PermissionError(13, os.strerror(13))
