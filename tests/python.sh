#!/bin/sh
# python.sh: prints the Python 3 that has most of the modules that read snapshots (h5py, yt, vtk).
# The first python3 of the path need not be the one for which the package manager installs modules.
best='' best_count=-1
for python in ${PYTHON:-} python3 /usr/bin/python3; do
    count=$("$python" -c 'import importlib.util as u
print(sum(u.find_spec(m) is not None for m in ("h5py", "yt", "vtkmodules")))' 2> /dev/null) || continue
    [ "$count" -gt "$best_count" ] && best=$python best_count=$count
done
[ -n "$best" ] && echo "$best"
