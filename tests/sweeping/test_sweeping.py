"""Sweeps over parameters: every member agrees with a single run, even if workers are killed or the disk is full. All
tests share one cluster of workers.
"""

import os
import resource
import signal
import sys
import threading
import time
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner

import phigen
from phigen import resources
from phigen import spec as specs
from phigen.api import compilation_of, interface_of
from phigen.errors import FileError, MissingPackageError, SpecError
from phigen.spec.model import Axis, SweepSettings
from phigen.spec.sweeps import end_of_its_own
from phigen.study.lyapunov import spectrum
from phigen.sweeping import api, chunk, store
from phigen.sweeping.plan import Plan, chunk_of, values_of

xarray = pytest.importorskip("xarray")
dask = pytest.importorskip("dask")
distributed = pytest.importorskip("distributed")
pytest.importorskip("zarr")

from phigen.runtime.origin import read_origin  # noqa: E402
from phigen.sweeping import cluster as clusters  # noqa: E402
from phigen.sweeping import sweep as sweeping  # noqa: E402

BODY = """\
phigen: 1
name: swept
coordinates: [x1, x2, x3]
parameters: {I1: 1, I2: 2, I3: 3}
poisson: {brackets: {x1: {x2: -x3, x3: x2}, x2: {x3: -x1}}}
hamiltonian: (x1**2/I1 + x2**2/I2 + x3**2/I3)/2
casimirs: {C: x1**2 + x2**2 + x3**2}
order: 2
runs: {flip: {initial: [0.01, 1, 0.01], step: 0.1, steps: 60, section: x2}}
"""
MADE = {}
OVER = {"I2": {"from": 1.5, "to": 2.5, "count": 12}, "x1": np.linspace(-0.2, 0.2, 40)}


@pytest.fixture(scope="module")
def spec():
    return specs.loads(BODY)


@pytest.fixture(scope="module")
def cluster(request):
    """Start a cluster with one worker, or with two if --all is given, as workers take seconds to start."""
    several = request.config.option.all
    with distributed.LocalCluster(
        n_workers=1 + several, threads_per_worker=1, processes=True, dashboard_address=":0", silence_logs=50
    ) as local_cluster:
        local_cluster.scheduler.allowed_failures = clusters.TRIES
        yield local_cluster


@pytest.fixture(autouse=True)
def compiled_once(monkeypatch):
    """Compile each spec once for all tests, since these tests do not concern compilation."""

    def once(spec, **options):
        key = spec.source.partition("sweeps:")[0], options["tangent"]
        if key not in MADE:
            MADE[key] = compilation_of(spec, **options)
        return MADE[key]

    monkeypatch.setattr(sweeping, "compilation_of", once)


@pytest.fixture
def small_chunks(monkeypatch):
    """Divide sweeps into chunks of 40 members, as if members took long."""
    monkeypatch.setattr(sweeping, "_seconds_of_a_member", lambda job: sweeping._SECONDS / 40)


def grid(shape=(5, 6, 7), **more):
    axes = tuple(Axis(f"a{k}", (), (0.0, 1.0), size) for k, size in enumerate(shape))
    plan = Plan("p", ("x",), (0.0,), 0.1, 0.0, {"a0": 0.0, "a1": 0.0, "a2": 0.0}, 10, axes=axes, **more)
    return plan


@pytest.mark.parametrize("members", [1, 4, 7, 20, 100, 1000])
def test_chunks_hold_every_member_once_in_order(members):
    plan = grid()
    plan = replace(plan, chunk=chunk_of(plan, members))
    assert Plan.from_json(plan.as_json()) == plan
    chunks = [plan.varied(plan.region(k), {}) for k in range(int(np.prod(plan.boxes)))]
    assert max(len(chunk["a0"]) for chunk in chunks) <= members
    concatenated = np.array([np.concatenate([chunk[f"a{k}"] for chunk in chunks]) for k in range(3)])
    expected = np.meshgrid(*(values_of(axis) for axis in plan.axes), indexing="ij")
    assert sorted(map(tuple, concatenated.T)) == sorted(zip(*map(np.ravel, expected), strict=True))


@pytest.mark.parametrize("members", [3, 10, 64, 1000])
def test_draws_do_not_depend_on_chunks(members):
    plan = Plan("p", ("x",), (0.0,), 0.1, 0.0, {"a": 0.0, "b": 1.0}, 10, members=257, seed=5,
                axes=(Axis("a", (), (1.0, 2.0)), Axis("b", (), (1.0, 1e4), 0, "log")))  # fmt: skip
    whole = plan.varied((slice(0, 257),), {})
    plan = replace(plan, chunk=chunk_of(plan, members))
    parts = [plan.varied(plan.region(k), {}) for k in range(plan.boxes[0])]
    for name in ("a", "b"):
        assert (np.concatenate([part[name] for part in parts]) == whole[name]).all()
    assert 1.4 < whole["a"].mean() < 1.6
    assert 30 < np.median(whole["b"]) < 300
    assert abs(np.corrcoef(whole["a"], np.log(whole["b"]))[0, 1]) < 0.2


@pytest.mark.slow
def test_stored_values_of_members_agree_with_single_runs(spec, cluster, tmp_path, small_chunks):
    """A sweep from the command line stores for each member what a single run gives: the final state, the largest
    errors, the number of crossings, the Lyapunov exponent, and frames.
    """
    (tmp_path / "s.yaml").write_text(BODY + "sweeps: {one: {over: {I2: [1.5, 2.5], x1: [0.1, 0.2, 0.3]}, frames: 25, "
        "keep: [final, energy_error, casimir_error, lyapunov, crossings]}}\n")  # fmt: skip
    from phigen.cli import group

    store = tmp_path / "s.zarr"
    arguments = ["sweep", str(tmp_path / "s.yaml"), "-o", str(store), "--scheduler", cluster.scheduler_address]
    result = CliRunner().invoke(group, [*arguments, "--plot", str(tmp_path / "map.svg")])
    assert result.exit_code == 0, result.output
    assert "6 members (I2 2 × x1 3), 6 computed now" in result.output
    assert "<svg" in (tmp_path / "map.svg").read_text()
    assert str(read_origin(tmp_path / "map.svg")).endswith(" by sweep")
    data = xarray.open_zarr(store).load()
    assert data.sizes == {"I2": 2, "x1": 3, "coordinate": 3, "frame": 3}
    solver = phigen.compile(spec, tangent=True)
    for i, I2 in enumerate(data.I2.values):
        for j, x1 in enumerate(data.x1.values):
            start, member = [x1, 1, 0.01], data.isel(I2=i, x1=j)
            alone = solver.integrate(start, 0.1, 60, I2=I2)
            np.testing.assert_allclose(member.final, alone.x[-1], rtol=0, atol=1e-13)
            np.testing.assert_allclose(member.frames, alone.x[[0, 25, 50]], rtol=0, atol=1e-13)
            seen = alone.energy[[0, 25, 50, 60]]
            np.testing.assert_allclose(member.energy_error, np.abs(seen - seen[0]).max(), rtol=0, atol=1e-14)
            assert member.casimir_error < 1e-14
            assert member.crossings == len(solver.section(start, 0.1, 60, lambda x: x[:, 1], I2=I2).t)
            assert member.lyapunov == pytest.approx(spectrum(solver, start, 0.1, 60, {"I2": I2}).largest, abs=1e-9)
    assert (data.status == 0).all()


def test_a_member_that_fails_costs_itself_and_says_why(spec, cluster, tmp_path):
    data = phigen.sweep(spec, over={"I2": [2.0, -1.0, 2.5], "step": [0.1, 1e3, 0.0]}, keep=["final", "energy_error"],
                        output=tmp_path / "s.zarr", scheduler=cluster.scheduler_address)  # fmt: skip
    names = data.status.attrs["flag_meanings"].split()
    status_names = [[names[int(v)] for v in row] for row in data.status.values]
    assert [row[0] for row in status_names] == ["OK"] * 3
    assert status_names[0][1] in ("NO_CONVERGENCE", "NOT_FINITE", "SINGULAR")
    assert status_names[2][2] == "BAD_ARGUMENT"
    for name in ("final", "energy_error"):
        failed = np.isnan(data[name].values.reshape(9, -1)).any(axis=1)
        assert (failed == (data.status.values.ravel() != 0)).all()


def test_members_with_noise_take_the_seed_of_the_run_and_paths_of_their_own(cluster):
    noisy = specs.loads(BODY.replace("order: 2", "order: 2\nnoise: {kick: {hamiltonian: x1, amplitude: 0.3}}").replace(
        "section: x2", "seed: 7"))  # fmt: skip
    options = {"over": {"I2": [2.0, 2.5], "seed": {"count": 2}}, "keep": ["final", "lyapunov"], "target": "numpy"}
    data = phigen.sweep(noisy, **options, scheduler=cluster.scheduler_address)
    solver = phigen.compile(noisy, target="numpy", tangent=True)
    for place in range(4):
        about = {"seed": 7, "member": place, "parameters": {"I2": [2.0, 2.5][place // 2]}}
        member, alone = data.isel(I2=place // 2, seed=place % 2), solver.integrate([0.01, 1, 0.01], 0.1, 60, **about)
        np.testing.assert_allclose(member.final, alone.x[-1], rtol=0, atol=1e-13)
        exponents = spectrum(solver, [0.01, 1, 0.01], 0.1, 60, **about)
        assert member.lyapunov == pytest.approx(exponents.largest, abs=1e-12)


@pytest.mark.parametrize(
    ("end", "over", "refused"),
    [
        ("steps: 60, stop: x2", "I2: [1, 2]", True),
        ("until: 6.05", "I2: [1, 2]", True),
        ("until: 6", "step: [0.1, 0.2]", True),
        ("duration: 6", "step: [0.1, 0.2]", True),
        ("until: 6", "I2: [1, 2]", False),
    ],
)
def test_runs_that_do_not_end_with_the_same_whole_step_are_refused(spec, end, over, refused):
    text = BODY.replace("steps: 60", end) + f"sweeps: {{s: {{over: {{{over}}}}}}}\n"
    if not refused:
        assert specs.loads(text).sweeps["s"].run == "flip"
        return
    with pytest.raises(SpecError, match="the same number of whole steps"):
        specs.loads(text)
    run = specs.loads(BODY.replace("steps: 60", end))
    with pytest.raises(ValueError, match="the same number of whole steps"):
        phigen.sweep(run, over={"step": [0.1, 0.2]})


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"parameters": {"I9": 1}}, "unknown parameter 'I9'"),
        ({"parameters": {"I2": np.nan}}, "'I2' must be finite"),
        ({"initial": [0, np.nan, 0]}, "initial must be finite"),
        ({"initial": "abc"}, "initial must be an array of numbers"),
        ({"h": 0}, "must not be 0"),
        ({"steps": -1}, "steps must be at least 1"),
        ({"frames": -1}, "frames must be at least 0"),
        ({"keep": "final"}, "keep must be a list"),
        ({"over": ["I2"]}, "over must map names"),
        ({"over": {}}, "nothing to vary"),
        ({"over": {"I2": {"form": 1, "to": 2, "count": 3}}}, "I2 needs from and to"),
        ({"over": {"I2": {"from": 1, "to": np.inf, "count": 3}}}, "I2: to must be finite"),
        ({"over": {"I2": {"from": 1, "to": 2, "count": -3}}}, "I2: count must be at least 1"),
        ({"over": {"I2": {"from": 1, "to": 2, "count": 3, "scale": "lgo"}}}, "linear or log"),
        (
            {"over": {"I2": {"from": 0, "to": 2, "count": 3, "scale": "log"}}},
            "I2 must be positive on a logarithmic scale, not 0",
        ),
        ({"over": {"I2": [1, 2j]}}, "I2 must be real"),
        ({"over": {"random": 5.0, "I2": {"from": 1, "to": 2}}}, "random must be an integer"),
        ({"over": {"random": 5, "seed": -1, "I2": {"from": 1, "to": 2}}}, "seed must be at least 0"),
        ({"over": {"file": "members.csv", "I2": [1]}}, "remove the other keys"),
        ({"over": {n: {"from": 1, "to": 2, "count": 10**6} for n in ("I2", "I3")}}, "members, the limit is"),
    ],
)
def test_invalid_sweeps_are_refused_before_they_start(options, said):
    with pytest.raises((TypeError, ValueError), match=said):
        phigen.sweep("rigid_body", **{"over": {"I2": [1, 2]}, **options})


@pytest.mark.parametrize("name", ["status", "final", "coordinate", "frame"])
def test_names_that_the_store_needs_are_not_varied(tmp_path, name):
    spec = specs.loads(BODY.replace("I2", name))
    with pytest.raises(SpecError, match=f"'{name}' is also the name"):
        phigen.sweep(spec, over={name: [1, 2]}, output=tmp_path / "map.zarr")
    assert not (tmp_path / "map.zarr").exists()


@pytest.mark.slow
def test_killed_workers_cost_no_member(spec, cluster, tmp_path, small_chunks):
    """Workers are killed at random during a sweep, and the result is still that of one ensemble."""
    stop, killed, random = threading.Event(), [], np.random.default_rng(1)

    def kill():
        while not stop.wait(0.3) and len(killed) < 3:
            processes = [w.process.pid for w in cluster.workers.values() if w.process and w.process.pid]
            if processes:
                killed.append(int(random.choice(processes)))
                os.kill(killed[-1], signal.SIGKILL)

    thread = threading.Thread(target=kill)

    def told(members, failed):
        if not thread.ident:
            thread.start()
        time.sleep(0.15)

    data = phigen.sweep(spec, over=OVER, output=tmp_path / "s.zarr", scheduler=cluster.scheduler_address, progress=told)
    stop.set()
    thread.join()
    assert killed
    I2, x1 = (v.ravel() for v in np.meshgrid(values_of(Axis("I2", (), (1.5, 2.5), 12)), OVER["x1"], indexing="ij"))
    start = np.column_stack([x1, np.ones(480), np.full(480, 0.01)])
    expected = phigen.compile(spec).ensemble(start, 0.1, 60, I2=I2)
    np.testing.assert_allclose(data.final.values.reshape(480, 3), expected, rtol=0, atol=1e-13)


def test_an_interrupted_sweep_goes_on_where_it_stopped_and_another_is_refused(spec, cluster, tmp_path, small_chunks):
    options = {"over": OVER, "output": tmp_path / "s.zarr", "scheduler": cluster.scheduler_address}
    first, second = [], []

    def interrupt(members, failed):
        first.append(members)
        if len(first) == 4:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        phigen.sweep(spec, **options, progress=interrupt)
    data = phigen.sweep(spec, **options, progress=lambda members, failed: second.append(members))
    assert sum(second) <= 480 - sum(first)
    assert (data.status == 0).all()
    with pytest.raises(FileError, match=r"holds another sweep: number of steps 60, not 61\n"):
        phigen.sweep(spec, **options, steps=61)
    with pytest.raises(FileError, match="not a sweep of phigen"):
        phigen.sweep(spec, over=OVER, output=tmp_path)


@pytest.mark.slow
def test_full_disk_is_reported_and_no_member_is_lost(spec, cluster, tmp_path, small_chunks):
    """After two chunks workers cannot write files larger than 64 bytes: the sweep reports a full disk, and can be
    continued later.
    """
    options = {"over": OVER, "output": tmp_path / "s.zarr", "scheduler": cluster.scheduler_address}
    chunks_made = []
    with distributed.Client(cluster) as client:

        def full(members, failed):
            chunks_made.append(members)
            if len(chunks_made) == 2:
                client.run(setattr, sys, "dont_write_bytecode", True)  # no truncated modules, as in full_disk.py
                client.run(resource.setrlimit, resource.RLIMIT_FSIZE, (64, resource.RLIM_INFINITY))

        try:
            with pytest.raises(clusters.SweepError, match="File too large"):
                phigen.sweep(spec, **options, progress=full)
        finally:
            client.run(resource.setrlimit, resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
    rest = []
    data = phigen.sweep(spec, **options, progress=lambda members, failed: rest.append(members))
    assert (data.status == 0).all()
    assert sum(rest) < 480


@pytest.mark.slow
def test_loss_of_the_scheduler_is_reported(spec, tmp_path, small_chunks, monkeypatch):
    monkeypatch.setattr(clusters, "PATIENCE", "0.5s")
    patience = dask.config.set({"distributed.comm.timeouts.connect": "500ms", "distributed.scheduler.worker-ttl": None})
    local = distributed.LocalCluster(n_workers=1, threads_per_worker=1, processes=False, dashboard_address=":0")
    with patience, local as own_cluster:

        def leave(members, failed):
            own_cluster.sync(own_cluster.scheduler.close)

        with pytest.raises(clusters.SweepError, match="the connection to the scheduler was lost"):
            phigen.sweep(
                spec, over=OVER, output=tmp_path / "s.zarr", scheduler=own_cluster.scheduler_address, progress=leave
            )
    with pytest.raises(clusters.SweepError, match="no scheduler answers"):
        phigen.sweep(spec, over=OVER, output=tmp_path / "s.zarr", scheduler="tcp://127.0.0.1:1")


@pytest.mark.parametrize(("end", "steps"), [("duration: 6", 120), ("until: 6", 120), ("steps: 60", 60)])
def test_another_step_size_keeps_the_duration_of_a_run(end, steps):
    run = api._run_of(specs.loads(BODY.replace("steps: 60", end)), None, None, None, 0.05, None, None)
    assert run.steps == steps
    assert end_of_its_own(SweepSettings("s", run.name), run, monitored=False) == ""


def test_a_step_that_does_not_divide_a_duration_is_refused(spec):
    spec = specs.loads(BODY.replace("steps: 60", "duration: 6"))
    with pytest.raises(
        ValueError, match=r"the duration 6 is not a whole number of steps of 0\.07 \(it is 85\.7142857 steps\)"
    ):
        phigen.sweep(spec, over={"I2": [1, 2]}, h=0.07)


def test_a_system_without_a_time_has_no_start_to_vary(spec, tmp_path):
    with pytest.raises(ValueError, match="over: start: this system does not depend on the time"):
        phigen.sweep(spec, over={"start": [0, 1]})
    (tmp_path / "members.csv").write_text("x1, start\n0.1, 3\n")
    (tmp_path / "s.yaml").write_text(BODY + "sweeps: {listed: {over: {file: members.csv}}}\n")
    with pytest.raises(SpecError, match="'start' is not a parameter"):
        phigen.sweep(tmp_path / "s.yaml", output=tmp_path / "s.zarr")


@pytest.mark.thin(2)
@pytest.mark.parametrize(
    ("text", "why"),
    [
        (None, "No such file"),
        ("", "it has no members"),
        ("I2\n", "it has no members"),
        ("I2, I2\n1, 2\n", "two columns have the same name"),
        ("I2, I4\n1, 2\n", "'I4' is not a parameter or a coordinate"),
        ("I2\n1\nx\n", "line 3: could not convert string to float: 'x'"),
        ("I2, I3\n\n1\n", "line 3 has 1 number, but there are 2 names"),
        ("I2;I3\n1;2\n", "line 2: could not convert string to float: '1;2'"),
    ],
)
def test_a_file_of_members_that_cannot_be_read_is_refused_at_its_place(tmp_path, text, why):
    if text is not None:
        (tmp_path / "members.csv").write_text(text)
    (tmp_path / "s.yaml").write_text(BODY + "sweeps: {listed: {over: {file: members.csv}}}\n")
    with pytest.raises(SpecError, match=why) as error:
        phigen.sweep(tmp_path / "s.yaml", output=tmp_path / "s.zarr")
    assert error.value.diagnostics[0].location.column == 32


@pytest.mark.slow
def test_two_sweeps_into_one_new_store_share_it(cluster, tmp_path, monkeypatch):
    setting = {"over": {"I2": [2.0, 2.5]}, "output": tmp_path / "s.zarr", "scheduler": cluster.scheduler_address}
    (tmp_path / "s.yaml").write_text(BODY)
    create, others = store.create, []

    def another_first(*arguments):
        if not others:
            others.append(0)
            others[0] = phigen.sweep(tmp_path / "s.yaml", **setting).load()
        return create(*arguments)

    monkeypatch.setattr(store, "create", another_first)
    data = phigen.sweep(tmp_path / "s.yaml", **setting)
    assert (data.status == 0).all()
    assert data.equals(others[0])
    assert [path.name for path in tmp_path.iterdir() if path.name.startswith(".")] == []


def test_another_sweep_into_a_store_that_is_being_made_is_refused(cluster, tmp_path, monkeypatch):
    setting = {"output": tmp_path / "s.zarr", "scheduler": cluster.scheduler_address}
    (tmp_path / "s.yaml").write_text(BODY)
    create, others = store.create, []

    def another_first(*arguments):
        if not others:
            others.append(0)
            phigen.sweep(tmp_path / "s.yaml", over={"I2": [1.0, 2.5]}, **setting)
        return create(*arguments)

    monkeypatch.setattr(store, "create", another_first)
    with pytest.raises(FileError, match=r"holds another sweep: other ranges of over\n"):
        phigen.sweep(tmp_path / "s.yaml", over={"I2": [2.0, 2.5]}, **setting)


SPRINGS = """\
phigen: 1
name: chain
lattice: {axes: [i], boundary: open}
coordinates: [q, p]
parameters: {k: 1}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + k*(q[i+1] - q)**2/2
scheme: splitting
order: 2
runs: {go: {sizes: [4], initial: {q: "i", p: 0}, step: 0.1, steps: 20}}
"""


def test_only_changes_that_determine_results_refuse_a_stored_sweep(cluster, tmp_path):
    """A stored sweep can be continued with other titles or targets in the spec, but not with other equations, sections,
    starts of lattices or listed members.
    """
    setting = {"output": tmp_path / "s.zarr", "scheduler": cluster.scheduler_address}

    def sweep(text, **more):
        (tmp_path / "s.yaml").write_text(text)
        return phigen.sweep(tmp_path / "s.yaml", **setting, **more)

    sweep(BODY, over={"I2": [2.0, 2.5]}, keep=["crossings"])
    texts = "title: Another title\ntargets: [numpy]\n"
    data = sweep(BODY.replace("runs:", f"{texts}runs:"), over={"I2": [2.0, 2.5]}, keep=["crossings"])
    assert (data.status == 0).all()
    for old, new, said in [
        ("section: x2", "section: x3", "another section"),
        ("x3**2/I3)/2", "x3**2/I3)/3", "another solver: other equations"),
    ]:
        with pytest.raises(FileError, match=f"holds another sweep: {said}"):
            sweep(BODY.replace(old, new), over={"I2": [2.0, 2.5]}, keep=["crossings"])
    setting["output"] = tmp_path / "chain.zarr"
    sweep(SPRINGS, over={"k": [1.0]})
    sweep(SPRINGS.replace("order: 2", "order: 2\ntargets: [numpy]"), over={"k": [1.0]})
    with pytest.raises(FileError, match=r"holds another sweep: other initial values, bonds or parameters at sites\n"):
        sweep(SPRINGS.replace('"i"', '"2*i"'), over={"k": [1.0]})
    setting["output"] = tmp_path / "listed.zarr"
    (tmp_path / "m.csv").write_text("I2\n2.0\n2.5\n")
    sweep(BODY, over={"file": "m.csv"})
    (tmp_path / "m.csv").write_text("I2\n2.0\n2.6\n")
    with pytest.raises(FileError, match=r"holds another sweep: other values in the file of members\n"):
        sweep(BODY, over={"file": "m.csv"})
    setting["output"] = tmp_path / "refused.zarr"
    (tmp_path / "m.csv").write_text("I2\n2.0\nnan\n")
    assert [(sweep(BODY, over={"file": "m.csv"}).status != 0).values.tolist() for _ in range(2)] == [[False, True]] * 2
    with pytest.raises(FileError, match=r"holds another sweep: parameter I1 1.0, not 1.5\n"):
        sweep(BODY.replace("I1: 1", "I1: 1.5", 1), over={"file": "m.csv"})


def test_other_contents_of_a_data_file_make_another_sweep(cluster, tmp_path):
    setting = {"output": tmp_path / "s.zarr", "scheduler": cluster.scheduler_address}
    for name in ("s", "renamed"):
        (tmp_path / f"{name}.yaml").write_text(SPRINGS.replace('"i"', "w.npy"))
    np.save(tmp_path / "w.npy", np.arange(4.0))
    for name in ("s", "renamed"):
        phigen.sweep(tmp_path / f"{name}.yaml", over={"k": [1.0]}, **setting)
    np.save(tmp_path / "w.npy", 2 * np.arange(4.0))
    with pytest.raises(FileError, match=r"holds another sweep: other data file w\.npy\n"):
        phigen.sweep(tmp_path / "s.yaml", over={"k": [1.0]}, **setting)


def test_the_target_of_a_sweep_is_that_of_the_spec_unless_another_is_requested(cluster, tmp_path, monkeypatch):
    from phigen.cli import group

    monkeypatch.setattr(sweeping, "workers_of", lambda target: 1)
    (tmp_path / "s.yaml").write_text(BODY + "sweeps: {one: {over: {I2: [1.5]}, target: numpy}}\n")
    setting = {"scheduler": cluster.scheduler_address}
    for target, expected in [(None, "numpy"), ("c", "c"), ("auto", "c")]:
        data = phigen.sweep(tmp_path / "s.yaml", target=target, **setting)
        assert data.attrs["target"] == expected
    with pytest.raises(ValueError, match="unknown target 'opencll'; did you mean 'opencl'"):
        phigen.sweep(tmp_path / "s.yaml", target="opencll")
    command = ["sweep", str(tmp_path / "s.yaml"), "--scheduler", setting["scheduler"]]
    for options, expected in [([], "numpy"), (["-t", "c"], "c")]:
        output = str(tmp_path / f"{expected}.zarr")
        result = CliRunner().invoke(group, [*command, "-o", output, *options])
        assert result.exit_code == 0, result.output
        assert xarray.open_zarr(output).attrs["target"] == expected


def test_a_target_that_is_unknown_or_unavailable_is_refused_at_its_place(tmp_path, monkeypatch):
    text = BODY + "sweeps: {one: {over: {I2: [1.5]}, target: %s}}\n"
    with pytest.raises(SpecError, match=r":10:43: error: target: 'opencll' is not known") as refused:
        specs.loads(text % "opencll")
    assert "did you mean 'opencl'?" in str(refused.value)

    def none(target):
        raise MissingPackageError(f"target {target} needs CuPy")

    monkeypatch.setattr(sweeping, "workers_of", none)
    (tmp_path / "s.yaml").write_text(text % "cuda")
    for workers in (None, 2):
        with pytest.raises(MissingPackageError, match=r"s\.yaml:10:43: target cuda needs CuPy\n  hint: .* by -t"):
            phigen.sweep(tmp_path / "s.yaml", workers=workers)
    with pytest.raises(MissingPackageError, match=r"^target cuda needs CuPy$"):
        phigen.sweep(tmp_path / "s.yaml", target="cuda")


@pytest.mark.parametrize("varied", [(), ("I2",), ("step",)])
def test_numbers_common_to_all_members_are_passed_once(spec, varied):
    """Parameters, steps and start times that all members share are passed as numbers, so that devices compute the
    coefficients of steps once.
    """
    passed = []
    solver = phigen.compile(spec, "numpy")
    plan = Plan("p", spec.coordinates, (0.01, 1.0, 0.01), 0.1, 0.0, solver.interface.parameters, 10)
    values = {"x1": np.array([0.1, 0.2]), "I2": np.array([2.0, 2.5]), "step": np.array([0.1, 0.2])}

    def ensemble(members, threads):
        passed.append(members)
        return members.x0

    stub = SimpleNamespace(interface=solver.interface, backend=SimpleNamespace(ensemble=ensemble))
    chunk._measured(SimpleNamespace(plan=plan), stub, {n: values[n] for n in ("x1", *varied)}, np.arange(2))
    (members,) = passed
    shapes = {"I1": members.parameters["I1"], "I2": members.parameters["I2"], "step": members.h, "start": members.t0}
    assert {name for name, value in shapes.items() if np.ndim(value)} == {*varied}
    assert members.alike == (not varied)


def test_members_of_a_file_are_made_in_its_order(cluster, tmp_path):
    (tmp_path / "members.csv").write_text("x1, I3\n0.1, 3\n0.2, 4\n0.3, 5\n")
    (tmp_path / "s.yaml").write_text(BODY + "sweeps: {listed: {over: {file: members.csv}}}\n")
    data = phigen.sweep(tmp_path / "s.yaml", output=tmp_path / "s.zarr", scheduler=cluster.scheduler_address)
    solver = phigen.compile(tmp_path / "s.yaml")
    start = [[x1, 1, 0.01] for x1 in (0.1, 0.2, 0.3)]
    np.testing.assert_allclose(data.final, solver.ensemble(start, 0.1, 60, I3=[3, 4, 5]), rtol=0, atol=1e-13)
    assert data.I3.values.tolist() == [3, 4, 5]


CHAIN = """\
phigen: 1
name: swept_chain
lattice: {axes: [i], boundary: periodic}
coordinates: [x, y, z]
parameters: {J: {value: 1, positive: true}, W: 0.5, B: {at: sites, value: 1}}
poisson: {brackets: {x: {y: -z, z: y}, y: {z: -x}}}
hamiltonian: -J*(x*x[i+1] + y*y[i+1] + z*z[i+1]) - W*B*z
casimirs: {length: x**2 + y**2 + z**2}
order: 2
runs:
  hot:
    {sizes: [8], initial: {random: sphere, seed: 3}, parameters: {B: {random: uniform, seed: 7}}, step: 0.05, steps: 40}
sweeps:
  disorder: {over: {W: [0.0, 2.0], seed: {count: 2}}, keep: [final, energy_error, casimir_error, lyapunov], frames: 15}
"""


@pytest.mark.slow
def test_members_are_lattices_with_disorder_of_their_own(cluster, tmp_path, monkeypatch):
    """Draw k of a sweep adds k to the seeds of the run: that of the initial state and that of the parameter at
    sites.
    """
    from phigen.lattice.states import start_of

    spec = specs.loads(CHAIN)
    data = phigen.sweep(spec, output=tmp_path / "s.zarr", scheduler=cluster.scheduler_address, target="numpy")
    assert data.sizes == {"W": 2, "seed": 2, "coordinate": 3, "i": 8, "frame": 3}
    solver = phigen.compile(spec, target="numpy")
    for draw in (0, 1):
        moved = specs.loads(CHAIN.replace("seed: 3", f"seed: {3 + draw}").replace("seed: 7", f"seed: {7 + draw}"))
        start = start_of(moved, moved.runs["hot"])
        for k, W in enumerate((0.0, 2.0)):
            alone = solver.integrate(start.state, 0.05, 40, 15, B=start.parameters["B"], W=W)
            member = data.isel(W=k, seed=draw)
            np.testing.assert_allclose(member.final, alone.x[-1], rtol=0, atol=1e-13)
            np.testing.assert_allclose(member.frames, alone.x[:3], rtol=0, atol=1e-13)
            np.testing.assert_allclose(member.energy_error, np.abs(alone.energy - alone.energy[0]).max(), atol=1e-13)
            assert 0 < member.casimir_error < 1e-14
    assert data.W.values.tolist() == [0.0, 2.0]
    assert np.isfinite(data.lyapunov).all()
    assert np.ptp(data.final.values, axis=1).min() > 0
    titles = [axes.get_title() for axes in drawn(tmp_path / "s.zarr", monkeypatch, "final")]
    assert titles == [f"final: {c}, mean over the sites, median over seed" for c in spec.coordinates]


@pytest.mark.slow
def test_lattices_that_fail_cost_themselves_and_maps_are_drawn(cluster, tmp_path):
    from phigen.cli import group

    changed = (
        CHAIN.replace("W: [0.0, 2.0], seed: {count: 2}", "J: [1, 2], step: [0.05, 0]")
        .replace("final, ", "")
        .replace(", lyapunov", "")
    )
    (tmp_path / "s.yaml").write_text(changed)
    arguments = ["sweep", str(tmp_path / "s.yaml"), "-o", str(tmp_path / "s.zarr"), "--plot", str(tmp_path / "s.svg")]
    result = CliRunner().invoke(group, [*arguments, "-t", "numpy", "--scheduler", cluster.scheduler_address])
    assert result.exit_code == 0, result.output
    assert "4 members (J 2 × step 2), 4 computed now, of which 2 failed" in result.output
    data = xarray.open_zarr(tmp_path / "s.zarr").load()
    assert (np.isnan(data.energy_error) == [[False, True]] * 2).all()
    shown = CliRunner().invoke(group, [*arguments, "--show", "final"])
    assert (shown.exit_code, "the sweep stores energy_error" in shown.output) == (2, True)
    with pytest.raises(ValueError, match="'x' is not a parameter"):
        phigen.sweep(specs.loads(CHAIN), over={"x": [1.0]})
    with pytest.raises(ValueError, match="needs a run of the spec"):
        phigen.sweep(specs.loads(CHAIN), initial=[1, 0, 0])
    with pytest.raises(phigen.SpecError, match="crossings: not available in sweeps of lattices"):
        specs.loads(CHAIN.replace("keep: [final", "keep: [crossings"))


@pytest.mark.parametrize("noise", ["", "noise: {kick: {hamiltonian: x, amplitude: 0.3}}\n"], ids=["quiet", "noisy"])
def test_exponents_of_lattices_are_the_growth_of_a_vector(noise):
    """The Lyapunov exponent of a member is the growth rate of a tangent vector, although the vector is rescaled during
    the run. With noise, the vector follows the same noisy path.
    """
    from phigen.runtime.interface import FIRST_DRAWS, Draws
    from phigen.sweeping.lattice_members import exponent

    ring = CHAIN.partition("sweeps:")[0] + noise
    solver, rng = phigen.compile(specs.loads(ring + "tangent: true\n"), target="numpy"), np.random.default_rng(4)
    x, parameters = rng.normal(size=(3, 4)), {"B": rng.normal(size=4), "W": 1.0}
    draws = Draws(3) if noise else FIRST_DRAWS
    session = solver.backend.start(x, solver.values(parameters, {}, (4,)), 0.0, draws)
    computed = exponent(session, 0.05, 130)
    vector, grown = np.random.default_rng(0).normal(size=(1, 3, 4)), 0.0
    start = np.linalg.norm(vector)
    for _, carried in solver.tangents(x, 0.05, 130, vector, parameters=parameters, **({"seed": 3} if noise else {})):
        grown = np.log(np.linalg.norm(carried) / start) / (130 * 0.05)
    assert computed == pytest.approx(grown, rel=1e-12)


PENDULUM = """\
phigen: 1
name: swinging
coordinates: [q, p]
parameters: {k: 1}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 - k*cos(q)
order: 2
runs: {swing: {initial: [1.2, 0], step: 0.9, steps: 40}}
sweeps:
  map: {over: {k: {from: 0.01, to: 3, count: 5, scale: log}, q: [0.5, 1.2, 2.0]}, keep: [energy_error], frames: 1}
"""


def drawn(store, monkeypatch, shown=None):
    """Draw the figure of a stored sweep and return its axes."""
    from phigen.drawing import sweep_map

    figures = []
    monkeypatch.setattr(sweep_map, "save", lambda figure, path, origin: figures.append(figure))
    sweep_map.draw(store, store.with_suffix(".svg"), shown)
    return figures[0].get_axes()


def test_interfaces_come_back_from_a_store():
    """The description of a solver's interface, with its nested record about device kernels, is unchanged by storing and
    loading.
    """
    for source in (BODY, SPRINGS):
        about = interface_of(compilation_of(specs.loads(source)).program)
        stored = store.solver_data(about, {}, "", "")["interface"]
        assert store.interface_of(stored) == about


@pytest.mark.slow
def test_lattices_of_a_sweep_run_on_a_device(cluster):
    pytest.importorskip("pyopencl")
    setting = {"over": {"k": [1.0, 2.0]}, "scheduler": cluster.scheduler_address}
    ours, theirs = (phigen.sweep(specs.loads(SPRINGS), target=target, **setting) for target in ("opencl", "numpy"))
    assert (ours.status == 0).all()
    np.testing.assert_allclose(ours.final, theirs.final, rtol=0, atol=1e-13)


def test_logarithmic_axes_and_large_energy_errors_are_seen(cluster, tmp_path, monkeypatch):
    from phigen.cli import group

    (tmp_path / "s.yaml").write_text(PENDULUM)
    arguments = ["sweep", str(tmp_path / "s.yaml"), "-o", str(tmp_path / "s.zarr"), "-t", "numpy"]
    result = CliRunner().invoke(group, [*arguments, "--scheduler", cluster.scheduler_address])
    assert result.exit_code == 0, result.output
    data = xarray.open_zarr(tmp_path / "s.zarr").load()
    scale = np.abs(data.k * np.cos(data.q))
    assert (scale > 1e-3 * data.k * data.q * np.sin(data.q)).all()
    large = int((data.energy_error / scale > 0.1).sum())
    assert large > 0
    assert f"warning: {large} of 15 members have an energy error above 10% of their energy" in result.stderr
    axes = drawn(tmp_path / "s.zarr", monkeypatch)[0]
    assert (axes.get_xlabel(), axes.get_xscale()) == ("q", "linear")
    assert (axes.get_ylabel(), axes.get_yscale()) == ("k", "log")
    low, high = axes.get_ylim()
    assert 0.001 < low < 0.01
    assert 3 < high < 30


QUARTIC_CHAIN = """\
phigen: 1
name: stiffening
lattice: {axes: [i]}
coordinates: [q, p]
parameters: {k: 1}
poisson: {canonical: {q: [q], p: [p]}}
hamiltonian: p**2/2 + k*(q[i+1] - q)**2/2 + q**4/4
order: 2
runs: {r: {sizes: [16], initial: {q: {random: normal, seed: 3, scale: 0.5}, p: 0}, step: 0.38, steps: 60}}
sweeps: {s: {over: {k: {from: 0.1, to: 3, count: 3}, seed: {count: 2}}, keep: [energy_error]}}
"""


@pytest.mark.slow
def test_large_energy_errors_of_lattices_are_counted_in_the_unit_of_runs(cluster, tmp_path):
    from phigen.cli import group

    (tmp_path / "s.yaml").write_text(QUARTIC_CHAIN)
    arguments = ["sweep", str(tmp_path / "s.yaml"), "-o", str(tmp_path / "s.zarr"), "-t", "numpy"]
    result = CliRunner().invoke(group, [*arguments, "--scheduler", cluster.scheduler_address])
    assert result.exit_code == 0, result.output
    data, large, largest = xarray.open_zarr(tmp_path / "s.zarr").load(), 0, 0.0
    for number, seed in enumerate((3, 4)):
        text = QUARTIC_CHAIN.replace("seed: 3", f"seed: {seed}")
        solver = phigen.compile(phigen.spec.loads(text), target="numpy")
        for k in data.k.values:
            relative = float(data.energy_error.sel(k=k)[number]) / solver.run(k=float(k), steps=1).energy_scale
            large, largest = large + (relative > 0.1), max(largest, relative)
    assert 0 < large < 6
    expected = (
        f"warning: {large} of 6 members have an energy error above 10% of their energy; the largest is {largest:.0%}"
    )
    assert expected in result.stderr


@pytest.mark.slow
@pytest.mark.parametrize("varied", ["g", "q"])
def test_members_on_a_device_are_those_of_c(cluster, varied):
    pytest.importorskip("pyopencl")
    options = {"scheduler": cluster.scheduler_address, "profile": "small"}
    pendulum = Path(resources.file_of("pendulum_euler")).read_text().partition("sweeps:")[0]
    one = f"sweeps: {{one: {{over: {{{varied}: [0.9, 1.0, 1.1]}}, keep: [final], target: opencl}}}}\n"
    spec = specs.loads(pendulum + one)
    ours, theirs = (phigen.sweep(spec, **options, steps=200, target=target) for target in (None, "c"))
    assert (ours.attrs["target"], theirs.attrs["target"]) == ("opencl", "c")
    names = [name for name in ours.data_vars if name in ("q", "p", "final")]
    assert names
    for name in names:
        np.testing.assert_allclose(ours[name].values, theirs[name].values, rtol=0, atol=1e-9)
