"""The whole attack runs only when it is asked for: ``pytest -m hardening``."""

import pytest


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    if "hardening" in config.option.markexpr:
        return
    whole = [each for each in items if each.get_closest_marker("hardening")]
    config.hook.pytest_deselected(items=whole)
    items[:] = [each for each in items if each not in whole]
