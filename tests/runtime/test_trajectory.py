import csv
import sys

import numpy as np
import pytest

from phigen.errors import MissingPackageError
from phigen.runtime.trajectory import Trajectory, trajectory_columns


@pytest.fixture
def trajectory():
    t = 0.1 * np.arange(3)
    x = np.array([[0.1, 1 / 3], [1e-300, -0.0], [2.0, 5e22]])
    return Trajectory(
        t=t, x=x, energy=x.sum(axis=1), casimirs={"C": x[:, 0] / 7}, steps=2, h=0.1,
        parameters={"k": 2.0}, coordinates=("q", "p"),
    )  # fmt: skip


def test_csv_reads_back_bit_for_bit(trajectory, tmp_path):
    trajectory.save(tmp_path / "run.csv")
    with (tmp_path / "run.csv").open(newline="") as file:
        header, *rows = csv.reader(file)
    assert header == ["t", "q", "p", "energy", "C"]
    expected = np.column_stack([trajectory.t, trajectory.x, trajectory.energy, trajectory.casimirs["C"]])
    assert np.array(rows, dtype=float).tobytes() == expected.tobytes()


def test_npz_reads_back(trajectory, tmp_path):
    trajectory.save(str(tmp_path / "run.NPZ"))
    with np.load(tmp_path / "run.NPZ", allow_pickle=False) as data:
        np.testing.assert_array_equal(data["x"], trajectory.x)
        np.testing.assert_array_equal(data["casimir_C"], trajectory.casimirs["C"])
        assert data["coordinates"].tolist() == ["q", "p"]
        assert (int(data["steps"]), float(data["h"]), float(data["parameter_k"])) == (2, 0.1, 2.0)


def test_other_suffixes_are_refused(trajectory, tmp_path):
    with pytest.raises(ValueError, match=r"\.csv or \.npz"):
        trajectory.save(tmp_path / "run.txt")


def test_columns_are_found_by_name(trajectory):
    assert trajectory.column("p").tolist() == trajectory.x[:, 1].tolist()
    with pytest.raises(KeyError, match="q, p"):
        trajectory.column("z")


def test_no_two_columns_have_one_name():
    columns = trajectory_columns(("t", "x", "energy", "t_"), ("C", "x"))
    assert [name for c in columns for name in c.names] == ["t", "t__", "x", "energy_", "t_", "energy", "C", "x_"]
    assert [c.key for c in columns] == ["t", "x", "energy", "casimir_C", "casimir_x"]


def test_xarray_has_names_for_all_axes(trajectory):
    dataset = trajectory.to_xarray()
    assert dataset.x.sel(coordinate="p").values.tolist() == trajectory.x[:, 1].tolist()
    assert dataset.casimir_C.sel(t=0.1).item() == trajectory.casimirs["C"][1]
    assert dataset.attrs == {"h": 0.1, "steps": 2, "parameter_k": 2.0}


def test_pandas_has_the_columns_of_the_csv(trajectory):
    frame = trajectory.to_pandas()
    assert (frame.index.name, list(frame.columns)) == ("t", ["q", "p", "energy", "C"])
    np.testing.assert_array_equal(frame.to_numpy(), trajectory.rows()[:, 1:])
    assert frame.attrs["parameter_k"] == 2.0


@pytest.mark.parametrize("package", ["xarray", "pandas"])
def test_without_the_package_the_error_says_how_to_install_it(trajectory, package, monkeypatch):
    monkeypatch.setitem(sys.modules, package, None)
    with pytest.raises(MissingPackageError, match=f"pip install {package}"):
        getattr(trajectory, f"to_{package}")()


def test_plot_draws_the_orbit_and_what_was_conserved(trajectory):
    labels = [axes.get_title() for axes in trajectory.plot().axes]
    assert any("energy" in label for label in labels)
    assert any("Casimir C" in label for label in labels)


@pytest.mark.parametrize(
    ("name", "said"), [("pendulum", "relative error of the energy"), ("duffing", "change of the energy, H(t)")]
)
def test_values_are_drawn_of_an_energy_that_the_time_changes(name, said):
    pytest.importorskip("matplotlib")
    from phigen import api

    figure = api.compile(name, target="numpy").integrate([1.0, 0.2], 0.1, 20).plot()
    assert said in [axes.get_title() for axes in figure.get_axes()]
