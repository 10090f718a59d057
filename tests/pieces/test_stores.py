"""Archives in an object store, as S3 answers: whole, slow, refusing, and changed since it was listed."""

from __future__ import annotations

import threading

import pytest
from piece_work import lengths, parts_of, write_archive, write_rows

from kineme.errors import DataError, KinemeError
from kineme.pieces import archive as stored
from kineme.pieces import map as map_pieces
from kineme.pieces import plan
from lerobot_sets import write_v3

moto_server = pytest.importorskip("moto.server")
make_server = pytest.importorskip("werkzeug.serving").make_server


class _Store:
    """The store as a WSGI application; reading an object fails as `faults` says, the last one first."""

    def __init__(self):
        self.faults = []
        self.application = moto_server.DomainDispatcherApplication(moto_server.create_backend_app)

    def __call__(self, environment, start_response):
        reads = environment["REQUEST_METHOD"] == "GET" and "list-type" not in environment["QUERY_STRING"]
        fault = self.faults.pop() if self.faults and reads else ""
        if fault == "503":
            start_response("503 Slow Down", [("Content-Length", "0")])
            return [b""]
        data = b"".join(self.application(environment, start_response))
        return [data[: len(data) // 2] if fault == "cut" else data]


@pytest.fixture(scope="module")
def store():
    """A store on this machine, and its address."""
    application = _Store()
    server = make_server("127.0.0.1", 0, application, threaded=True)
    thread = threading.Thread(target=server.serve_forever, daemon=True)
    thread.start()
    yield application, f"127.0.0.1:{server.server_port}"
    server.shutdown()
    thread.join()


@pytest.fixture
def uri(store, monkeypatch):
    """Return what puts a folder into the store, and gives its URI."""
    from pyarrow import fs

    monkeypatch.setenv("AWS_ACCESS_KEY_ID", "name")
    monkeypatch.setenv("AWS_SECRET_ACCESS_KEY", "secret")
    monkeypatch.setenv("AWS_EC2_METADATA_DISABLED", "true")
    application, address = store
    application.faults.clear()
    stored._open.cache_clear()
    options = f"endpoint_override={address.replace(':', '%3A')}&scheme=http&region=us-east-1&allow_bucket_creation=true"

    def put(folder, name):
        where = f"s3://fleet/{name}?{options}"
        system, path = fs.FileSystem.from_uri(where)
        system.create_dir("fleet")
        for file in sorted(folder.rglob("*")):
            if file.is_file():
                with system.open_output_stream(f"{path}/{file.relative_to(folder).as_posix()}") as stream:
                    stream.write(file.read_bytes())
        return where

    return put


def test_parts_of_a_store_have_the_rows_of_a_folder(uri, tmp_path):
    from pyarrow import parquet

    archive = write_archive(tmp_path / "archive", 6)
    (archive / ".hidden.csv").write_text("no recording")
    address = uri(archive, "six")
    map_pieces(lengths, archive, output=tmp_path / "here")
    outcomes = map_pieces(lengths, address, output=tmp_path / "there")
    assert [outcome.state for outcome in outcomes] == ["done"]
    here, there = (parquet.read_table(next((tmp_path / name).glob("part-*"))) for name in ("here", "there"))
    assert here.to_pylist() == there.to_pylist()
    assert [outcome.state for outcome in map_pieces(lengths, address, output=tmp_path / "there")] == ["skipped"]


@pytest.mark.parametrize("name", ["sets/one", "sets"])
def test_a_data_set_in_a_store_is_divided_like_one_in_a_folder(uri, tmp_path, name):
    write_v3(tmp_path / "sets" / "one", [30, 40, 50, 60])
    address = uri(tmp_path / name, f"{name}-{tmp_path.name}")
    here, there = (plan(where, 3000).pieces for where in (str(tmp_path / name), address))
    assert len(here) > 1
    assert [(piece.first, piece.last) for piece in there] == [(piece.first, piece.last) for piece in here]
    outcomes = map_pieces(lengths, address, output=tmp_path / "out", size=3000)
    assert [outcome.rows for outcome in outcomes] == [len(piece.numbers) for piece in there]


def test_a_file_of_rows_in_a_store_is_divided_like_one_in_a_folder(uri, tmp_path):
    write_rows(tmp_path / "archive" / "all.parquet", [70] * 60)
    address = uri(tmp_path / "archive", f"rows-{tmp_path.name}")
    here, there = (plan(where, 4000).pieces for where in (str(tmp_path / "archive"), address))
    assert len(here) > 3
    assert [(piece.first, piece.last) for piece in there] == [(piece.first, piece.last) for piece in here]
    outcomes = map_pieces(lengths, address, output=tmp_path / "out", size=4000)
    assert sum(outcome.rows for outcome in outcomes) == 60


@pytest.mark.parametrize("faults", [["503"], ["503", "503"], ["cut"]])
def test_a_store_that_fails_now_and_then_is_read_all_the_same(store, uri, tmp_path, faults):
    address = uri(write_archive(tmp_path / "archive", 4), f"failing-{tmp_path.name}")
    pieces = plan(address, 1).pieces
    store[0].faults[:] = faults
    outcomes = map_pieces(lengths, address, output=tmp_path / "out", size=1)
    if "failed" in {outcome.state for outcome in outcomes}:
        assert "the store refuses" in next(o.reason for o in outcomes if o.state == "failed")
        outcomes = map_pieces(lengths, address, output=tmp_path / "out", size=1)
    assert {outcome.state for outcome in outcomes} <= {"done", "skipped"}
    assert len(parts_of(tmp_path / "out")) == len(pieces) == 4


def test_a_file_that_has_changed_since_the_listing_fails_its_piece(uri, tmp_path):
    archive = write_archive(tmp_path / "archive", 3)
    address = uri(archive, f"changing-{tmp_path.name}")
    (unit,) = plan(address).pieces[0].units[:1]
    with (
        pytest.raises(DataError, match="expected 1 bytes"),
        stored.local_copy(unit._replace(files=(unit.files[0]._replace(size=1),))),
    ):
        pass
    with (
        pytest.raises(DataError, match="vanished"),
        stored.local_copy(unit._replace(files=(unit.files[0]._replace(name="arc/gone.csv"),))),
    ):
        pass
    with (
        pytest.raises(DataError, match="within the archive"),
        stored.local_copy(unit._replace(files=(unit.files[0]._replace(name="../../etc/passwd"),))),
    ):
        pass


def test_a_bucket_that_is_not_there_is_said(uri, tmp_path):
    address = uri(write_archive(tmp_path / "archive", 1), "some")
    with pytest.raises(DataError, match="expected the bucket 'nowhere' of s3://nowhere/some"):
        plan(address.replace("fleet/some", "nowhere/some"))
    with pytest.raises(DataError, match="found none"):
        plan(address.replace("fleet/some", "fleet/other"))


@pytest.mark.parametrize(
    ("address", "said"),
    [
        ("s3://fleet/a?endpoint=http://127.0.0.1:1", "Unexpected query parameter in S3 URI: 'endpoint'"),
        ("s3:///a", "Missing bucket name"),
        ("unheard://fleet/a", "unheard"),
    ],
)
def test_what_is_wrong_with_a_uri_is_said_by_who_knows_its_scheme(address, said):
    """A package was to be installed that would not have helped."""
    with pytest.raises(KinemeError, match=said) as caught:
        stored._open(address)
    assert ("pyarrow opens" in str(caught.value)) == address.startswith("s3")
