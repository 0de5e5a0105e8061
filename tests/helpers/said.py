"""What our errors and warnings say, by words of their messages."""

import pytest

from seakeep import DataError, RequestError, SeakeepWarning


def request_error(words):
    return pytest.raises(RequestError, match=words)


def data_error(words):
    return pytest.raises(DataError, match=words)


def warned(words):
    return pytest.warns(SeakeepWarning, match=words)
