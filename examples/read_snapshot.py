"""read_snapshot.py [FILE]: what a snapshot holds, body by body; without FILE the newest in build/impact.

Needs h5py. Debian's python3-h5py is for /usr/bin/python3; for another python3: pip install h5py."""
import glob, os, sys

if sys.argv[1:2] in (["-h"], ["--help"]):
    sys.exit(print(__doc__))
try:
    import h5py, numpy as np
except ImportError as missing:
    sys.exit(f"{sys.executable}: {missing}; install it: {sys.executable} -m pip install h5py, or apt install "
             "python3-h5py and call /usr/bin/python3 examples/read_snapshot.py")
newest = sorted(glob.glob("build/impact/impact_*.hdf"), key=os.path.getmtime)[-1:]
path = (sys.argv[1:] + newest + [None])[0]
if path is None or path.startswith("-"):
    sys.exit("no snapshot in build/impact: run make impact, or give a file: read_snapshot.py FILE")
if not os.path.isfile(path):
    sys.exit(f"{path}: no such file; give a snapshot, such as build/impact/impact_0020.hdf")

def unit(data):  # from the exponents of length, mass and time; the units of the file are those of SI
    powers = [(name, data.attrs[f"U_{u} exponent"][0]) for u, name in zip("LMt", ("m", "kg", "s"))]
    return " ".join(name if p == 1 else f"{name}^{p:g}" for name, p in powers if p) or "1"

try:
    with h5py.File(path, "r") as file:
        gas, time = file["PartType0"], file["Header"].attrs["Time"][0]
        m, v, body = gas["Masses"], gas["Velocities"], gas["BodyIDs"]
        print(f"{path}: t = {time:.4e} s, {len(m)} particles, {m[:].sum():.6g} {unit(m)}")
        for b in np.unique(body[:]):
            own = body[:] == b
            momentum = (m[:][own, None] * v[:][own]).sum(axis=0)
            print(f"body {b}: {own.sum()} particles, mass {m[:][own].sum():.6g} {unit(m)}, momentum "
                  f"({momentum[0]:.4g}, {momentum[1]:.4g}, {momentum[2]:.4g}) {unit(m)} {unit(v)}")
            if "Damages" in gas: print(f"    largest damage {gas['Damages'][:][own].max():.4f}")
            if "Distentions" in gas: print(f"    mean distention {gas['Distentions'][:][own].mean():.4f}")
except (OSError, KeyError) as why:
    sys.exit(f"{path} is no snapshot of this toolkit: {why}; give one, such as build/impact/impact_0020.hdf")
