"""What the attack found, cause by cause, where no case of it shows the cause."""

import hashlib
import io
import os
import re
import subprocess
import sys
from dataclasses import replace

import ground
import h5py
import numpy as np
import pytest

from seakeep import (
    BayesianHankelDMDc,
    Fixed,
    HankelDMDc,
    ProbeAlignment,
    load_model,
)
from seakeep.campaign import read_campaign
from seakeep.cli import main
from seakeep.errors import DataError, RequestError, SeakeepWarning
from seakeep.files import (
    SEAL,
    check_place,
    make_folder,
    read_sealed,
    replacing,
    working_folder,
    write_netcdf,
)
from seakeep.formats import limits, read_columns
from seakeep.models import store
from seakeep.study.store import UnitFolder

EVERY = BayesianHankelDMDc(
    window=Fixed("4 T"), state_delays=Fixed("0.2 T"), input_delays=Fixed("0.3 T"), ridge=Fixed(1.0),
    encounter_period=5.0, n_members=2, seed=1,
)  # fmt: skip


@pytest.fixture
def hdf5(tmp_path):
    path = tmp_path / "run.h5"
    with h5py.File(path, "w") as file:
        file["t"], file["heave"] = np.arange(50) * 0.1, np.sin(np.arange(50) * 0.1)
    return path


@pytest.mark.parametrize("fate", ["import time; time.sleep(60)", "import os; os.abort()"])
def test_a_file_on_which_hdf5_never_returns_is_refused_and_the_next_one_is_read(
    hdf5, monkeypatch, fate
):
    monkeypatch.setattr(limits, "PATIENCE", 0.5)
    monkeypatch.setattr(limits, "_WALK", fate)
    limits._walker.cache_clear()
    with pytest.raises(DataError, match=r"run\.h5 is damaged: HDF5 crashes on it, or has not"):
        read_columns(hdf5)
    monkeypatch.undo()
    assert set(read_columns(hdf5).names) == {"t", "heave"}


def test_bytes_are_compared_before_hdf5_reads_them(tmp_path, make_dataset):
    path = tmp_path / "kept.nc"
    write_netcdf(path, make_dataset(np.arange(3.0), heave=np.arange(3.0)))
    with h5py.File(read_sealed(path), "r") as file:
        assert list(file["heave"]) == [0.0, 1.0, 2.0]
    content = bytearray(path.read_bytes())
    content[200] ^= 4
    path.write_bytes(content)
    with pytest.raises(DataError, match="its checksum is another one"):
        read_sealed(path)


def seal(path, content):
    path.write_bytes(content + SEAL + hashlib.sha256(content).hexdigest().encode())
    return path


@pytest.mark.parametrize(
    ("sizes", "said"),
    [
        ((10**9,), r"'h0' declares 1000000000 values \(7629 MiB\)"),
        ((3 * 10**7,) * 3, r"its 3 sets declare too much together \(687 MiB\)"),
    ],
)
def test_what_a_file_of_ours_declares_is_judged_before_it_is_read(tmp_path, sizes, said):
    made = io.BytesIO()
    with h5py.File(made, "w") as file:
        for number, size in enumerate(sizes):
            file.create_dataset(f"h{number}", (size,), "f8", chunks=(10**5,), fillvalue=1.0)
    path = seal(tmp_path / "m.nc", made.getvalue())
    with pytest.raises(DataError, match=rf"m\.nc: {said}, and 0 MiB.* make it anew\."):
        load_model(path)


@pytest.fixture(scope="module")
def wave(make_dataset):
    t = 0.1 * np.arange(400.0)
    noise = np.random.default_rng(0).standard_normal(400) * 0.01
    return make_dataset(t, heave=np.sin(t) + noise, eta=np.cos(1.3 * t))


@pytest.fixture(scope="module")
def served(wave):
    return HankelDMDc(2, 3, 1.0).fit(wave, states=["heave"], inputs=["eta"])


@pytest.fixture(scope="module")
def ensemble(wave):
    return EVERY.fit(wave, states=["heave"], inputs=["eta"])


@pytest.mark.parametrize(
    ("attribute", "old", "new", "said"),
    [
        ("signature", '"dt": 0.1', '"dt": "x"',
         "signature.dt: received 'x', which should be a number"),
        ("signature", '"dt": 0.1', '"dt": ' + "9" * 5000,
         f"signature.dt: received {'9' * 60}, which nothing measures"),
        ("signature", '"dt": 0.1, ', "", "signature.dt is missing"),
        ("signature", '"maps": []', '"maps": 5',
         "input_map.maps: received 5, which should be a list"),
        ("ensemble", '"seed": "1"', '"seed": "' + "9" * 5000 + '"',
         f"seed: received '{'9' * 59}, which should be a whole number"),
        ("ensemble", '"value": 1.0', '"value": "x"',
         "ridge.value: received 'x', which should be a number"),
        ("ensemble", '"encounter_period": 5.0', '"encounter_period": "x"',
         "encounter_period must be a positive number of seconds; received 'x'"),
        ("runs", '"offsets": [185]', '"offsets": ["x"]',
         "runs.offsets.0: received 'x', which should be an integer"),
        ("calibration", "null", "x", "calibration: received 'x', which is no JSON"),
        ("runs", "{", "[" * 9999, "runs is nested hundreds of levels deep"),
    ],
)  # fmt: skip
def test_a_value_of_another_kind_in_a_model_file_is_named(
    ensemble, tmp_path, attribute, old, new, said
):
    kept = ensemble.to_dataset()
    assert old in kept.attrs[attribute]
    kept.attrs[attribute] = kept.attrs[attribute].replace(old, new, 1)
    path = store.write(kept, tmp_path / "m.nc", ensemble.kind)
    with pytest.raises(DataError) as refused:
        load_model(path)
    assert str(refused.value) == (
        f"{path} does not hold what seakeep writes: {said}. Fit the model again."
    )


@pytest.mark.parametrize(
    ("name", "dims", "said"),
    [
        ("ridge", ("member",), "ridge is <U1 over ('member',), not a number per member"),
        ("states_0", ("sample", "state"), "states_0 holds <U1, not numbers"),
    ],
)
def test_words_in_place_of_numbers_of_a_model_file_are_named(ensemble, tmp_path, name, dims, said):
    kept = ensemble.to_dataset().drop_vars(name)
    words = np.full([kept.sizes.get(each, 1) for each in dims], "x")
    path = store.write(kept.assign({name: (dims, words)}), tmp_path / "m.nc", ensemble.kind)
    with pytest.raises(DataError, match=re.escape(said)):
        load_model(path)


@pytest.mark.parametrize(
    ("call", "said"),
    [
        (
            lambda m, c: m.live(noise=[1]),
            r"noise must be a mapping, such as a dict; received \[1\]",
        ),
        (
            lambda m, c: m.live(noise={"heave": 1e300}),
            r"noise of heave is 1e\+300 m, which nothing",
        ),
        (lambda m, c: m.live(like={}), r"like must be a Dataset, .*; received dict"),
        (lambda m, c: c.live_chain(None), r"campaign\.toml has no run 'None'"),
        (lambda m, c: c.seconds([1]), r"a length must be a number; received \[1\]"),
        (lambda m, c: c.live_chain("one").push(None), r"samples must be a mapping"),
        (lambda m, c: c.live_chain("one").push({"mru": 1}), r"samples of 'mru' must be a mapping"),
        (
            lambda m, c: replace(EVERY, dt=1e-320),
            r"are countless steps of dt = .* Correct the step",
        ),
        (lambda m, c: replace(EVERY, ridge=np.ones(2)), r"ridge must be a prior; received array"),
        (lambda m, c: replace(EVERY, readouts=np.ones(2)), r"readouts must hold seakeep\.ReadOut"),
        (
            lambda m, c: ProbeAlignment(celerity=np.ones(2)),
            r"alignment: celerity must be a positive",
        ),
    ],
)
def test_arguments_of_another_kind_are_named(served, tmp_path, call, said):
    campaign = read_campaign(ground.write(tmp_path) / "campaign.toml")
    with pytest.raises(RequestError, match=said):
        call(served, campaign)


def test_a_sealed_file_that_is_no_netcdf_is_refused(tmp_path):
    path = seal(tmp_path / "m.nc", b"words")
    with pytest.raises(DataError, match=r"m\.nc is no NetCDF file, although its checksum fits"):
        load_model(path)


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="pipes with names are POSIX")
def test_nothing_but_a_regular_file_is_replaced(tmp_path):
    os.mkfifo(tmp_path / "pipe.nc")
    for name, said in (
        ("pipe.nc", "it is a pipe, and only regular files"),
        ("n" * 300, "File name too long"),
        ("a\0b", "null (byte|character)"),
    ):
        with pytest.raises(RequestError, match=rf"cannot write .*{said}"):
            check_place(tmp_path / name)
    with pytest.raises(RequestError, match=r"cannot make the folder .*null (byte|character)"):
        make_folder(tmp_path / "a\0b")


@pytest.mark.parametrize(
    "arguments",
    [
        ("init", "one_mru.csv", "-o", "n" * 400),
        ("prepare", "campaign.toml", "-o", "n" * 400),
        ("tank", "--settings", "tank.toml", "--out", "n" * 400),
        ("report", "n" * 400),
        ("study", "study.toml", "-o", "o"),
    ],
)
def test_a_path_that_cannot_be_looked_at_is_told(tmp_path, monkeypatch, capsys, arguments):
    place = ground.write(tmp_path)
    monkeypatch.chdir(place)
    study = ground.STUDY.replace("[study]", f"[study]\ntruth = {'n' * 400!r}")
    (place / "study.toml").write_text(study, encoding="utf-8")
    assert main(list(arguments)) == 2
    said = " ".join(capsys.readouterr().err.split())
    assert re.search(r"n{150}…n.* cannot be read: File name too long\. Correct the", said)


def test_what_the_system_refuses_is_no_fault_of_seakeep(monkeypatch, capsys):
    def fail(*_, **__):
        raise OSError(5, "Input/output error", "run.nc")

    monkeypatch.setattr("seakeep.campaign.read_campaign", fail)
    assert main(["prepare", "campaign.toml"]) == 1
    assert "Error: run.nc: Input/output error. Correct the path" in capsys.readouterr().err


def test_a_study_clears_what_a_killed_run_left_and_says_so(tmp_path):
    (tmp_path / "units").mkdir()
    (tmp_path / "units" / ".cell.npz.12.ab.tmp").touch()
    (tmp_path / "notes.tmp").touch()
    with (
        pytest.warns(SeakeepWarning, match=r"removed 1 unfinished file\(s\) of a killed run"),
        UnitFolder(tmp_path, "digest").alone(),
    ):
        assert not list(tmp_path.glob("units/*"))
    assert (tmp_path / "notes.tmp").exists()


@pytest.mark.parametrize(
    ("old", "new", "said"),
    [
        ("n_members = 3", "n_members = 100000000",
         "models.ensemble.n_members: received 100000000, which should be less than or equal to "
         "1000000. Give number of members of an ensemble, 1 to 1000000"),
        ('"one_mru.csv"', '"a\\u0000b.csv"',
         "runs.one.files.mru: no file has a name with a NUL character; correct it; received"),
        ("[model.alignment]", "[model.select]\nhorizon = []\n[model.alignment]",
         "model.select.horizon: received [], which is empty. Give a length of free runs in"),
        ("[model.alignment]", "[model.select]\nhorizon = '1e300 T'\n[model.alignment]",
         "model.select.horizon: free runs last 1e-6 to 1e6 encounter periods, such as '15 T'; "
         "received '1e300 T'"),
    ],
)  # fmt: skip
def test_what_no_run_can_change_is_judged_before_a_run_is_read(tmp_path, old, new, said):
    path = tmp_path / "campaign.toml"
    path.write_text(ground.CAMPAIGN.replace(old, new), encoding="utf-8")
    with pytest.raises(RequestError, match=re.escape(said)):
        read_campaign(path)


@pytest.mark.skipif(os.name == "nt", reason="a process cannot be asked for without ending it")
def test_the_next_run_clears_what_a_dead_one_left(tmp_path):
    gone = subprocess.Popen([sys.executable, "-c", ""])
    gone.wait()
    names = {pid: f".m.nc.{pid}.0a1b2c3d.tmp" for pid in (gone.pid, os.getpid(), "x")}
    for name in names.values():
        (tmp_path / name).touch()
    (tmp_path / f".seakeep.{gone.pid}.abcd.tmp" / "inner").mkdir(parents=True)
    with replacing(tmp_path / "m.nc") as path:
        path.write_text("whole", encoding="utf-8")
    with working_folder(tmp_path) as folder:
        assert folder.name.startswith(f".seakeep.{os.getpid()}.")
    found = {each.name for each in tmp_path.iterdir()}
    assert found == {"m.nc", names[os.getpid()], names["x"]}


def test_a_command_keeps_blas_to_one_thread_and_prints_in_any_encoding(tmp_path):
    code = (
        "import seakeep.cli, sys, os\n"
        "assert 'numpy' not in sys.modules\n"
        "assert seakeep.cli.main(['info']) == 0\n"
        "import threadpoolctl, scipy.linalg\n"
        "assert {each['num_threads'] for each in threadpoolctl.threadpool_info()} == {1}\n"
        "sys.exit(seakeep.cli.main(['compare', 'm.nc', 'c.toml', '--format', '\\u03c0']))\n"
    )
    posix = {"LC_ALL": "POSIX", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    environment = {**os.environ, **posix, "OMP_NUM_THREADS": "2", "OPENBLAS_NUM_THREADS": "2"}
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, env=environment, check=False,
        cwd=tmp_path,
    )  # fmt: skip
    assert done.returncode == 2
    assert b"received '?'" in done.stderr
    assert b"Traceback" not in done.stderr


@pytest.mark.hardening
def test_the_same_seed_gives_the_same_bytes_everywhere(tmp_path):
    first = {"LC_ALL": "C.UTF-8", "OMP_NUM_THREADS": "1", "PYTHONHASHSEED": "1", "TZ": "UTC"}
    other = {"LC_ALL": "POSIX", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0", "TZ": "Asia/Tokyo",
             "OMP_NUM_THREADS": "2", "PYTHONHASHSEED": "2",
             "PYTHONIOENCODING": "utf-16"}  # fmt: skip
    found = []
    # Twice with the same empty caches: the first run after an installation, and the second.
    for name, place in (("cold", first), ("warm", first), ("other", other)):
        folder = tmp_path / name
        folder.mkdir()
        made = ground.write(folder)
        caches = {"NUMBA_CACHE_DIR": str(tmp_path / "numba"),
                  "PYTHONPYCACHEPREFIX": str(tmp_path / "bytecode")}  # fmt: skip
        for arguments in (
            ("tank", "--settings", "tank.toml", "--out", "o"),
            ("prepare", "campaign.toml"),
            ("fit", "campaign.toml", "--model", "ensemble", "-o", "model.nc"),
            ("compare", "model.nc", "campaign.toml", "-o", "compared"),
        ):
            done = subprocess.run(
                [sys.executable, "-m", "seakeep", *arguments], cwd=made, check=False,
                env={**os.environ, **caches, **place}, capture_output=True,
            )  # fmt: skip
            assert done.returncode == 0, done.stderr
            assert b"Traceback" not in done.stderr
        files = (each for each in made.rglob("*") if each.is_file())
        found.append({
            str(each.relative_to(made)): hashlib.sha256(each.read_bytes()).hexdigest()
            for each in files
        })  # fmt: skip
    cold, warm, elsewhere = found
    assert len(cold) > 12
    assert {name for name in cold if warm[name] != cold[name]} == set()
    assert {name for name in cold if elsewhere[name] != cold[name]} == set()


@pytest.mark.parametrize(
    ("name", "value", "said"),
    [
        ("training_run", 7, "member 1: it learns from run 7, and there are 1"),
        ("last_sample", 10**6, "member 1: its window is not one of the"),
        ("last_sample", 0, "member 1: its window is not one of the"),
        ("window_samples", 2**62, "member 1: its window is not one of the"),
        ("window_samples", 1, "member 1: its window is not one of the"),
        ("ridge", -1.0, "member 1: its ridge is -1.0"),
        ("state_delays_samples", 10**7, "member 1: its window is not one of the"),
        ("state_delays_samples", 11, "state_delays of the members reach 11, not those stated"),
    ],
)
def test_a_member_that_its_runs_cannot_teach_is_named_when_a_file_is_loaded(
    ensemble, tmp_path, name, value, said
):
    kept = ensemble.to_dataset()
    kept[name] = kept[name].copy(data=[*kept[name].values[:1], value])
    path = store.write(kept, tmp_path / "m.nc", ensemble.kind)
    with pytest.raises(DataError) as refused:
        load_model(path)
    assert f"m.nc does not hold what seakeep writes: {said}" in str(refused.value)


def test_a_kind_that_is_a_list_is_no_fault_of_seakeep(served, tmp_path):
    dataset = served.to_dataset()
    path = store.write(dataset, tmp_path / "m.nc", served.kind)
    write_netcdf(path, store.read(path).assign_attrs(seakeep_kind=["hankel_dmdc", "x"]))
    with pytest.raises(DataError, match="which this version does not know"):
        load_model(path)


@pytest.mark.parametrize(
    ("rate", "said"),
    [
        ("1e308", r"sampling_rate = 1e\+308: .* samples of run 'one' .* at most 1907 are allowed"),
        ("5e-324", r"is shorter than two steps of inf s\. Correct preparation\.sampling_rate = 4"),
    ],
)
def test_a_rate_beyond_numbers_is_named(tmp_path, rate, said):
    place = ground.write(tmp_path)
    text = (place / "campaign.toml").read_text(encoding="utf-8")
    assert "sampling_rate = " in text
    (place / "campaign.toml").write_text(
        re.sub(r"sampling_rate = \S+", f"sampling_rate = {rate}", text), encoding="utf-8"
    )
    with pytest.raises(RequestError, match=said):
        read_campaign(place / "campaign.toml").prepare(["one"])


def test_times_closer_than_numbers_tell_draft_no_rate(tmp_path, monkeypatch, capsys):
    rows = "".join(f"{i}e-320,{i}\n" for i in range(20))
    (tmp_path / "b.csv").write_text("t [s],a [m]\n" + rows, encoding="utf-8")
    monkeypatch.chdir(tmp_path)
    assert main(["init", "b.csv", "-o", "b.toml"]) == 0, capsys.readouterr().err


X = np.random.default_rng(0).standard_normal(200)
