"""What our errors and warnings say, by words of their messages, and findings by their kinds."""

import pytest

from seakeep import DataError, RequestError, SeakeepWarning
from seakeep.quality import findings_of


def request_error(words):
    return pytest.raises(RequestError, match=words)


def data_error(words):
    return pytest.raises(DataError, match=words)


def warned(words):
    return pytest.warns(SeakeepWarning, match=words)


def findings(run, *kinds):
    return [each for each in findings_of(run) if each.kind.name in kinds]
