"""What a result says of its models is words that another run would say too."""

from seakeep.report.sections.data import setting_text
from seakeep.study import read_study, run_study


def test_a_distribution_of_scipy_is_named_and_not_its_address(study_folder):
    path = study_folder / "study.toml"
    normal = 'window = { distribution = "norm", parameters = { loc = 15, scale = 1 }, unit = "T" }'
    text = path.read_text("utf-8").replace('window = { uniform = ["10 T", "20 T"] }', normal)
    path.write_text(text.replace("windows = 3", "windows = 1"), "utf-8")
    result = run_study(read_study(path), study_folder / "out")
    told = result.model_settings["bayesian"]["settings"]
    assert setting_text("window", told["window"]["value"]) == (
        "scipy.stats.norm(loc=15, scale=1) T̂"
    )
    assert list(told["ridge"]["value"]) == ["log_uniform"]
    assert " at 0x" not in result.attrs["models"]
