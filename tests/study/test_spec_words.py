"""What a result says of its models is words that another run would say too."""

import json

from seakeep.report.study_words import settings_table
from seakeep.study import read_study, run_study


def test_a_distribution_of_scipy_is_named_and_not_its_address(study_folder):
    path = study_folder / "study.toml"
    normal = 'train_length = { distribution = "norm", parameters = { loc = 15, scale = 1 } }'
    text = path.read_text("utf-8").replace("train_length = { uniform = [10, 20] }", normal)
    path.write_text(text.replace("windows = 3", "windows = 1"), "utf-8")
    result = run_study(read_study(path), study_folder / "out")
    words = json.loads(result.attrs["specs"])["bayesian"]
    assert words["train_length"] == "scipy.stats.norm(loc=15.0, scale=1.0)"
    assert words["ridge"].startswith("LogUniform(low=")
    assert not [row for row in settings_table(result).rows if " at 0x" in row[1]]
