import json

import pytest
from numpy.testing import assert_allclose
from scipy import stats

from seakeep import LogUniform, Uniform
from seakeep.models.settings import Distribution, prior_json, prior_of

PRIORS = [
    Uniform(10, 30),
    Uniform("10 T", "30 T"),
    Distribution("truncnorm", {"a": -2, "b": 2, "loc": 1, "scale": 0.1}, "T"),
    LogUniform(0.1, 10),
    stats.norm(20, 2),
    stats.truncnorm(-1, 1, loc=20, scale=5),
    stats.randint(1, 5),
]


def test_quantiles_are_those_of_scipy():
    for q in (0.1, 0.7):
        assert_allclose(Uniform(10, 30).ppf(q), stats.uniform(10, 20).ppf(q), rtol=1e-12)
        assert_allclose(LogUniform(0.1, 10).ppf(q), stats.loguniform(0.1, 10).ppf(q), rtol=1e-9)


@pytest.mark.parametrize("prior", PRIORS, ids=lambda prior: type(prior).__name__)
def test_a_table_states_all_of_a_prior(prior):
    table = json.loads(json.dumps(prior_json(prior)))
    back = prior_of("window", table)
    assert prior_json(back) == table
    assert getattr(back, "unit", "") == getattr(prior, "unit", "")
    for q in (0.025, 0.5, 0.9):
        assert back.ppf(q) == prior.ppf(q)
