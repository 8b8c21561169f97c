#!/bin/sh
# check_readers.sh: a snapshot of the impact is opened, as it is, by other people's readers: h5py, VTK
# (ParaView's reader), yt, and by examples/read_snapshot.py.
# shellcheck source=tests/lib.sh
. "$(dirname "$0")/lib.sh"

if [ ! -f examples/pumice_impact.c ]; then
    skip "readers of snapshots" "examples/pumice_impact.c is missing"
    finish "nothing to read"
fi
if [ -z "$(value HDF5_FOUND "$(found_for "$CC")")" ]; then
    skip "readers of snapshots" "no HDF5"
    finish "nothing to read"
fi
python=${PYTHON:-$(sh tests/python.sh)}
[ -n "$python" ] || { skip "readers of snapshots" "no python3"; finish "nobody to read"; }

say "building examples/pumice_impact and writing snapshots of 230 particles"
program=$work/examples/pumice_impact
$MAKE --no-print-directory INNER=1 BUILD="$work" CFLAGS=-O1 "$program" > "$work/make.log" 2>&1 || {
    failed "it does not build:"
    tail -n 15 "$work/make.log"
    finish
}
"$program" --particles 200 --projectile-particles 30 --t-end 1e-6 --every 5e-7 --compare off --quiet \
    --out "$work/run" > "$work/run.log" 2>&1 || {
    failed "it does not run:"
    tail -n 5 "$work/run.log"
    finish
}

# ---- the first and the last snapshot, and a checkpoint ----
"$python" tests/open_snapshot.py "$work/run/impact_0000.hdf" "$work/run/impact_0002.hdf" \
    "$work/run/checkpoint.hdf" > "$work/readers.log" 2>&1
status=$?
sed 's/^/    /' "$work/readers.log"
case $status in
0) ;;
77) ;; # its own words name what is missing
*) failed "a reader fails on a snapshot" ;;
esac
sed -n 's/^skipped: //p' "$work/readers.log" | sort -u > "$work/skipped"
while IFS= read -r reader; do
    case $reader in
    swiftsimio*) say "skipped: $reader; it is no package of Debian's, and not asked for" ;;
    *) skip "a reader of snapshots" "$reader" ;;
    esac
done < "$work/skipped"
# the scene's coordinates are positive, so that yt needs no help to find every particle
if grep -q '^yt: ' "$work/readers.log"; then
    grep -q '^yt: .*impact_0002.hdf: 230 particles, 230 of them between' "$work/readers.log" ||
        failed "yt does not see all particles of the last snapshot as it is"
fi

# ---- the series ----
"$python" - "$work/run" << 'END' || failed "impact.hdf.series does not list the snapshots and their times"
import json, os, sys
with open(os.path.join(sys.argv[1], "impact.hdf.series")) as text:
    files = json.load(text)["files"]
names, times = [f["name"] for f in files], [f["time"] for f in files]
assert names == [f"impact_{k:04d}.hdf" for k in range(3)], names
assert all(os.path.isfile(os.path.join(sys.argv[1], name)) for name in names)
assert all(abs(t - 5e-7 * k) < 1e-18 for k, t in enumerate(times)), times
END

# ---- the options it was made with, and the example that reads ----
if "$python" -c 'import h5py' 2> /dev/null; then
    "$python" - "$work/run/impact_0002.hdf" << 'END' || failed "a snapshot's Parameters lack options, or have other values"
import h5py, sys
kept = h5py.File(sys.argv[1], "r")["Parameters"].attrs
for option, value in {"speed": 2580, "particles": 200, "cfl": 0.3, "t-end": 1e-6, "every": 5e-7}.items():
    assert float(kept["Impact:" + option]) == value, option
END
    "$python" examples/read_snapshot.py "$work/run/impact_0002.hdf" > "$work/read.log" 2>&1 ||
        failed "examples/read_snapshot.py: $(tail -n 1 "$work/read.log")"
    for words in 't = 1.0000e-06 s, 230 particles' 'body 0: 200 particles, mass 0.26' 'kg m s^-1' \
        'body 1: 30 particles' 'largest damage' 'mean distention 4.6'; do
        grep -Fq "$words" "$work/read.log" || failed "examples/read_snapshot.py does not say: $words"
    done
    echo text > "$work/text.hdf"
    for file in "$work/text.hdf" "$work/missing.hdf"; do
        "$python" examples/read_snapshot.py "$file" > "$work/read.log" 2>&1 &&
            failed "examples/read_snapshot.py takes $file for a snapshot"
        [ "$(wc -l < "$work/read.log")" -eq 1 ] || failed "examples/read_snapshot.py: not one line for $file: $(cat "$work/read.log")"
    done
    grep -q 'missing.hdf: no such file; give ' "$work/read.log" || failed "examples/read_snapshot.py without the file: $(cat "$work/read.log")"
fi
here=$(pwd)
cd "$work" && "$python" "$here/examples/read_snapshot.py" > read.log 2>&1 &&
    failed "examples/read_snapshot.py without a file and without a run says nothing is wrong"
cd "$here" || exit 1
grep -Eq 'run make impact|install it' "$work/read.log" || failed "examples/read_snapshot.py: no cure: $(tail -n 1 "$work/read.log")"
"$python" -S -I examples/read_snapshot.py > "$work/read.log" 2>&1 # a python without packages
grep -q "python.*: No module named .*install it: " "$work/read.log" || failed "examples/read_snapshot.py without h5py: $(tail -n 1 "$work/read.log")"
finish "snapshots open as they are"
