"""open_snapshot.py FILE...: opens snapshots, as they are, with h5py, VTK, yt and swiftsimio.

Each reader must find all particles, their positions and their densities; h5py's are the reference.
A reader that is not installed is skipped, by name.
Exit: 0 good, 1 a reader failed, 77 nothing read.
Debian's packages: python3-h5py python3-vtk9 python3-yt (swiftsimio: pip).
"""
import importlib
import sys
import warnings

warnings.filterwarnings("ignore")


def expect(good, words):
    if not good:
        raise AssertionError(words)


def with_h5py(path):
    """The layout's links, and what the others have to find."""
    import h5py
    import numpy as np

    with h5py.File(path, "r") as file:
        gas = file["PartType0"]
        x, rho = gas["Coordinates"][:], gas["Densities"][:]
        n = int(file["Header"].attrs["NumPart_ThisFile"][0])
        dim = int(file["Header"].attrs["Dimension"][0])
        expect(x.shape == (n, 3) and rho.shape == (n,), f"{n} particles, {x.shape}, {rho.shape}")
        expect(np.isfinite(x).all() and (rho > 0).all(), "a position or density is bad")
        expect((x[:, dim:] == 0).all(), f"a position beyond dimension {dim}")
        for one, other in (("VTKHDF/Points", "PartType0/Coordinates"),
                           ("VTKHDF/PointData/Densities", "PartType0/Densities"),
                           ("PartType0/Density", "PartType0/Densities"),
                           ("GasParticles", "PartType0")):
            expect(file[one] == file[other], f"{one} and {other} are two objects")
        for name, data in gas.items():
            expect("U_L exponent" in data.attrs and "Description" in data.attrs,
                   f"{name} has no unit or description")
        return {"n": n, "dim": dim, "x": x, "rho": rho, "id": gas["ParticleIDs"][:].tolist(),
                "box": np.array(file["Header"].attrs["BoxSize"])}


def with_vtk(path, truth):
    from vtkmodules.util.numpy_support import vtk_to_numpy
    from vtkmodules.vtkIOHDF import vtkHDFReader

    reader = vtkHDFReader()
    expect(reader.CanReadFile(path), "VTK does not take it for its own")
    reader.SetFileName(path)
    reader.Update()
    grid = reader.GetOutput()
    expect(grid.GetNumberOfPoints() == truth["n"], f"{grid.GetNumberOfPoints()} points")
    expect(grid.GetNumberOfCells() == 1, f"{grid.GetNumberOfCells()} cells")
    expect(grid.GetCell(0).GetNumberOfPoints() == truth["n"], "the cell lacks points")
    x = vtk_to_numpy(grid.GetPoints().GetData())
    rho = vtk_to_numpy(grid.GetPointData().GetArray("Densities"))
    expect((x == truth["x"]).all() and (rho == truth["rho"]).all(), "other numbers")
    return f"{grid.GetPointData().GetNumberOfArrays()} arrays"


def yt_check(dataset, truth, everything):
    """Positions, densities and the number of what yt finds; whose they are, by their ids."""
    import numpy as np

    data = dataset.all_data()
    x = np.array(data["PartType0", "Coordinates"].to("m"))
    rho = np.array(data["gas", "density"].to("kg/m**3"))
    place = {number: k for k, number in enumerate(truth["id"])}
    order = [place[int(number)] for number in np.array(data["PartType0", "ParticleIDs"])]
    expect(len(set(order)) == len(order), "a particle twice")
    if everything:
        expect(len(order) == truth["n"], f"{len(order)} particles of {truth['n']}")
    expect(np.allclose(x, truth["x"][order], rtol=1e-12, atol=0), "other positions")
    expect(np.allclose(rho, truth["rho"][order], rtol=1e-6, atol=0), "other densities")
    return len(order)


def with_yt(path, truth):
    """yt's SWIFT reader looks from 0 to BoxSize; three lines widen that to where particles are."""
    import yt

    if truth["dim"] < 3:
        raise NotImplementedError(f"yt indexes no {truth['dim']}-D snapshots of SWIFT's")
    yt.set_log_level(50)
    x, box = truth["x"], truth["box"]
    inside = bool(((x >= 0) & (x < box)).all())
    as_it_is = yt.load(path)
    expect(type(as_it_is).__name__ == "SwiftDataset", f"yt takes it for a {type(as_it_is)}")
    found = yt_check(as_it_is, truth, inside)
    wide = yt.load(path)
    wide.domain_left_edge = wide.arr(x.min(axis=0) - 0.1 * box, "code_length")
    wide.domain_right_edge = wide.arr(x.max(axis=0) + 0.1 * box, "code_length")
    wide.domain_width = wide.domain_right_edge - wide.domain_left_edge
    yt_check(wide, truth, True)
    return f"{found} of them between 0 and BoxSize, all with the domain's edges set"


def with_swiftsimio(path, truth):
    import numpy as np
    import swiftsimio

    gas = swiftsimio.load(path).gas
    x, rho = np.array(gas.coordinates.to("m")), np.array(gas.densities.to("kg/m**3"))
    expect(np.allclose(x, truth["x"], rtol=1e-12, atol=0), "other positions")
    expect(np.allclose(rho, truth["rho"], rtol=1e-6, atol=0), "other densities")
    return "positions and densities"


READERS = (("vtk", "vtkmodules.vtkIOHDF", with_vtk), ("yt", "yt", with_yt),
           ("swiftsimio", "swiftsimio", with_swiftsimio))


def have(module):
    try:
        importlib.import_module(module)
    except ImportError:
        return False
    return True


def main(paths):
    if not paths:
        print(__doc__)
        return 1
    if not have("h5py"):
        print("skipped: h5py, and all others with it (not installed: python3-h5py)")
        return 77
    failures = 0
    for path in paths:
        try:
            truth = with_h5py(path)
        except Exception as error:  # whatever a reader throws at us
            print(f"FAILED: h5py, {path}: {error!r}")
            failures += 1
            continue
        print(f"h5py: {path}: {truth['n']} particles in {truth['dim']}-D")
        for name, module, reader in READERS:
            if not have(module):
                print(f"skipped: {name} (not installed)")
                continue
            try:
                print(f"{name}: {path}: {truth['n']} particles, {reader(path, truth)}")
            except NotImplementedError as reason:
                print(f"skipped: {name}, {path} ({reason})")
            except Exception as error:
                print(f"FAILED: {name}, {path}: {error!r}")
                failures += 1
    return 1 if failures else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
