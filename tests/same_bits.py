"""same_bits.py FILE OTHER: whether two HDF5 files hold the same datasets, bit by bit.

Attributes are not compared: they hold the date and how long things took.
Exit: 0 the same, 1 not (says where), 77 no h5py.
"""
import sys

try:
    import h5py
except ImportError:
    print("skipped: no h5py (python3-h5py)")
    sys.exit(77)


def datasets(path):
    found = {}
    with h5py.File(path, "r") as file:
        file.visititems(lambda name, item: found.update({name: item[()].tobytes()})
                        if isinstance(item, h5py.Dataset) else None)
    return found


one, other = (datasets(path) for path in sys.argv[1:3])
differ = sorted(name for name in one.keys() | other.keys() if one.get(name) != other.get(name))
print(f"{len(one)} datasets, {len(differ)} differ: {' '.join(differ[:8])}")
sys.exit(1 if differ or not one else 0)
