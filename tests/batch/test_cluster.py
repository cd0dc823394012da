"""A batch on a dask.distributed cluster is the same as on this machine, whoever is killed."""

import csv
import os
import shutil
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import beam
import pytest
from schedulers import begun, scheduler

from eigassign.cli import main

SWEEP = "sweep: {parameters: {mechanism.links.arm.length: {min: 0.4, max: 0.6, count: 60}}}\n"


@pytest.fixture
def started(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Any]:
    distributed = pytest.importorskip("distributed", reason="dask.distributed is not installed")
    monkeypatch.chdir(tmp_path)
    Path("arm.yaml").write_text(beam.TEXT + SWEEP)
    ours = {"n_workers": 2, "threads_per_worker": 1, "dashboard_address": ":0"}
    with distributed.LocalCluster(**ours) as cluster:
        yield cluster


def summary(folder: str) -> list[dict[str, str]]:
    with open(Path(folder, "summary.csv"), newline="") as file:
        return [{**row, "seconds": ""} for row in csv.DictReader(file)]


@pytest.mark.slow
def test_a_cluster_with_a_worker_killed_half_way_gives_the_same_summary(started: Any) -> None:
    from distributed import Client

    with Client(started) as client:
        first = next(iter(client.run(os.getpid).values()))

    def kill() -> None:
        while len([*Path("there").glob("*/run.json")]) < 5:
            time.sleep(0.005)
        os.kill(first, signal.SIGKILL)

    here = ["batch", "arm.yaml", "--jobs", "1", "--reports", "none", "--out", "here"]
    assert main(here) == 1  # some frequencies cannot be reached
    killing = threading.Thread(target=kill, daemon=True)
    killing.start()
    address = started.scheduler_address
    there = ["batch", "arm.yaml", "--scheduler", address, "--reports", "none", "--out", "there"]
    assert main(there) == 1
    killing.join(timeout=10)
    assert len(summary("here")) == 60
    assert summary("there") == summary("here")


@pytest.mark.slow
@pytest.mark.parametrize("lines", [0, 5], ids=["checked", "solved"])
def test_a_scheduler_that_is_killed_costs_nothing_that_is_done(
    lines: int, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    pytest.importorskip("distributed", reason="dask.distributed is not installed")
    monkeypatch.chdir(tmp_path)
    sweep = SWEEP.replace("60", "240")  # more than one task checks
    Path("arm.yaml").write_text(beam.TEXT + sweep)
    with scheduler(tmp_path) as (address, (first, _worker)):
        command = ["batch", "arm.yaml", "--scheduler", address, "--reports", "none", "--out", "out"]
        batch = begun("eigassign", *command, stderr=subprocess.PIPE)
        assert batch.stderr is not None
        heard = [batch.stderr.readline()]
        while sum(line.startswith("case ") for line in heard) < lines:
            heard.append(batch.stderr.readline())
        first.kill()
        _, err = batch.communicate(timeout=60)
    assert "checking 240 variants" in "".join(heard)
    assert batch.returncode == 3
    assert err.splitlines()[-1].startswith("eigassign: error: --scheduler: the scheduler was lost")
    assert "Traceback" not in err
    assert not lines or len(summary("out")) >= lines
    assert main(["batch", "arm.yaml", "--jobs", "1", "--reports", "none", "--out", "out"]) == 1
    assert len(summary("out")) == 240


@pytest.mark.slow
def test_a_scheduler_with_tls_is_reached_by_the_configuration_of_dask(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("distributed", reason="dask.distributed is not installed")
    if shutil.which("openssl") is None:
        pytest.skip("openssl makes the certificate")
    monkeypatch.chdir(tmp_path)
    Path("arm.yaml").write_text(beam.TEXT + SWEEP)
    made = "openssl req -x509 -newkey rsa:2048 -nodes -keyout key.pem -out cert.pem -subj /CN=here"
    subprocess.run(made.split(), check=True, capture_output=True)
    tls = ("--tls-ca-file", "cert.pem", "--tls-cert", "cert.pem", "--tls-key", "key.pem")
    with scheduler(tmp_path, "--protocol", "tls", tls=tls) as (address, _):
        command = ["batch", "arm.yaml", "--scheduler", address, "--reports", "none", "--out", "out"]
        assert main(command) == 3
        assert "TLS configuration" in capsys.readouterr().err
        for name, file in (("CA_FILE", "cert"), ("CLIENT__CERT", "cert"), ("CLIENT__KEY", "key")):
            monkeypatch.setenv(f"DASK_DISTRIBUTED__COMM__TLS__{name}", f"{file}.pem")
        done = begun("eigassign", *command)
        assert done.wait(timeout=100) == 1
    assert len(summary("out")) == 60


STRANGER = """
import sys
sys.modules["eigassign"] = None
from distributed.cli.dask_worker import main
main()
"""


@pytest.mark.slow
def test_a_worker_without_eigassign_is_told(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    distributed = pytest.importorskip("distributed", reason="dask.distributed is not installed")
    monkeypatch.chdir(tmp_path)
    Path("arm.yaml").write_text(beam.TEXT + SWEEP)
    with scheduler(tmp_path, workers=0) as (address, _):
        command = [sys.executable, "-c", STRANGER, address, "--nthreads", "1", "--no-nanny"]
        with subprocess.Popen(command, stderr=subprocess.DEVNULL) as worker:
            with distributed.Client(address) as client:
                client.wait_for_workers(1)
            code = main(["batch", "arm.yaml", "--scheduler", address])
            worker.kill()
    assert code == 2
    assert "the workers cannot run eigassign: " in capsys.readouterr().err


@pytest.mark.slow
def test_a_case_that_takes_too_long_is_ended_and_its_worker_stays(started: Any) -> None:
    from distributed import Client

    with Client(started) as client:
        before = client.run(os.getpid)
        there = ["batch", "arm.yaml", "--scheduler", started.scheduler_address, "--reports", "none"]
        assert main([*there, "--case-time", "0.01", "--out", "there"]) == 1
        assert client.run(os.getpid) == before
    said = [row["message"] for row in summary("there")]
    # Python ignores what is raised in some callbacks; a case is over before it is raised again.
    assert said.count("takes longer than the 0.01 s of --case-time") > len(said) // 2


@pytest.mark.slow
def test_workers_that_are_not_fit_and_no_scheduler_are_told(
    started: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["batch", "arm.yaml", "--scheduler", "tcp://127.0.0.1:1"]) == 3
    assert "no scheduler answers" in capsys.readouterr().err
    from distributed import LocalCluster

    both = ["batch", "arm.yaml", "--scheduler", started.scheduler_address, "--jobs", "2"]
    assert main(both) == 2
    with LocalCluster(n_workers=1, threads_per_worker=2, dashboard_address=":0") as other:
        assert main(["batch", "arm.yaml", "--scheduler", other.scheduler_address]) == 2
    assert "use --nthreads 1" in capsys.readouterr().err
