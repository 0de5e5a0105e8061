"""Fetching a public data set, against a server on this machine."""

import functools
import hashlib
import http.server
import threading
from dataclasses import replace

import pytest
from said import data_error, request_error

from seakeep.campaign import datasets


@pytest.fixture
def upstream(tmp_path):
    folder = tmp_path / "upstream"
    folder.mkdir()
    for name in (names := ("a.csv", "b.csv")):
        (folder / name).write_text(f"Time [s],x [m]\n0,{name}\n")

    class Handler(http.server.SimpleHTTPRequestHandler):
        def do_GET(self):
            if self.path.startswith("/cut/"):
                self.send_response(200)
                self.send_header("Content-Length", "1000000")
                self.end_headers()
                self.wfile.write(b"Time [s],x [m]\n0,")
                self.close_connection = True
            else:
                super().do_GET()

    files = {name: hashlib.sha256((folder / name).read_bytes()).hexdigest() for name in names}
    handler = functools.partial(Handler, directory=str(folder))
    with http.server.ThreadingHTTPServer(("127.0.0.1", 0), handler) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        address = f"http://127.0.0.1:{server.server_port}"
        sources = (f"{address}/gone", address)
        yield folder, replace(datasets.DATASETS[0], name="toy", files=files, sources=sources)
        server.shutdown()


def test_fetch_takes_the_first_address_that_has_the_file_resumes_and_repairs(upstream, tmp_path):
    (folder, dataset), told = upstream, []
    datasets.fetch(dataset, tmp_path, lambda *step: told.append(step))
    assert told == [(1, 2, "a.csv"), (2, 2, "b.csv")]
    kept = (tmp_path / "toy/a.csv").stat().st_mtime_ns
    (tmp_path / "toy/b.csv").write_bytes(b"Time")
    assert "1 altered" in datasets.state_of(dataset, tmp_path)
    datasets.fetch(dataset, tmp_path)
    assert (tmp_path / "toy/a.csv").stat().st_mtime_ns == kept
    assert (tmp_path / "toy/b.csv").read_bytes() == (folder / "b.csv").read_bytes()


def test_an_altered_file_upstream_is_refused_and_nothing_is_written(upstream, tmp_path):
    folder, dataset = upstream
    (folder / "a.csv").write_bytes(b"something else")
    with data_error(r"a\.csv was received with another SHA-256 .* upstream ch"):
        datasets.fetch(dataset, tmp_path)
    assert list((tmp_path / "toy").iterdir()) == []


def test_a_cut_download_is_no_file_and_the_next_source_is_tried(upstream, tmp_path):
    _, dataset = upstream
    whole = dataset.sources[-1]
    with request_error(r"a\.csv could not be fetched\. Tried: .*Incomplete"):
        datasets.fetch(replace(dataset, sources=[f"{whole}/cut"]), tmp_path)
    assert list((tmp_path / "toy").iterdir()) == []
    datasets.fetch(replace(dataset, sources=[f"{whole}/cut", whole]), tmp_path)
    assert datasets.state_of(dataset, tmp_path) == "complete"
