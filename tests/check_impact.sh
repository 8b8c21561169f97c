#!/bin/sh
# check_impact.sh: examples/pumice_impact as a user meets it: options, bad input, interrupt and
# resume, a full disk, threads, recorded states, without HDF5 and without gnuplot. Runs of 230 to 860
# particles.
# shellcheck source=tests/lib.sh
. "$(dirname "$0")/lib.sh"

if [ ! -f examples/pumice_impact.c ]; then
    skip "the impact at the command line" "examples/pumice_impact.c is missing"
    finish "nothing to look at"
fi

build() { # build PROGRAM FOLDER [VARIABLE=value]: with the output of make in FOLDER/make.log
    made=$1 folder=$2
    shift 2
    mkdir -p "$folder"
    $MAKE --no-print-directory INNER=1 BUILD="$folder" CFLAGS=-O1 "$@" \
        "$folder/$made" > "$folder/make.log" 2>&1 && return
    failed "$made does not build ($*):"
    tail -n 15 "$folder/make.log"
    finish
}
say "building examples/pumice_impact with and without HDF5"
build examples/pumice_impact "$work/full"
build examples/pumice_impact "$work/plain" HDF5=0
here=$(pwd)
case $work in /*) ;; *) work=$here/$work ;; esac
program=$work/full/examples/pumice_impact
found=$(found_for "$CC")
hdf5=$(value HDF5_FOUND "$found")
python=${PYTHON:-$(sh tests/python.sh)}

# ---- helpers ----
small='--particles 200 --projectile-particles 30 --t-end 3e-6 --compare off --quiet'
run() { # run ARGUMENTS..: $status, and the files stdout and stderr
    # shellcheck disable=SC2086 # words
    "$program" $small "$@" > "$work/stdout" 2> "$work/stderr" < /dev/null
    status=$?
}
said() { # the same, not --quiet
    # shellcheck disable=SC2086
    "$program" ${small% --quiet} "$@" > "$work/stdout" 2> "$work/stderr" < /dev/null
    status=$?
}
same_run() { # same_run ONE OTHER WHAT [LAST]: logs, tables and the datasets; the last output's number
    last=${4:-0020}
    for file in log.txt gauge.dat largest.dat spectrum.dat "palpha_$last.dat" "cut_$last.dat"; do
        cmp -s "$1/$file" "$2/$file" || failed "$3: $file differs"
    done
    [ -z "$hdf5" ] && return
    cmp -s "$1/impact.hdf.series" "$2/impact.hdf.series" || failed "$3: impact.hdf.series differs"
    for file in "impact_$last.hdf" checkpoint.hdf; do
        seen=$("${python:-python3}" tests/same_bits.py "$1/$file" "$2/$file" 2>&1)
        case $? in
        0) ;;
        1) failed "$3: $file: $seen" ;;
        *) no_h5py=yes ;;
        esac
    done
}
sums() { (cd "$1" && find . -type f -exec cksum {} + | sort -k 3); }
no_h5py=''

# ---- what it says of itself ----
"$program" --help > "$work/help" || failed "--help: exit status $?"
for option in particles projectile-particles speed angle target-diameter curve solver weibull-k \
    weibull-m seed ensemble correction balsara t-end every gauge out resume threads record-states dry-run \
    quiet; do
    shows "$work/help" "^  --$option" "--help"
done
version=$(sed -n 's/^#define SPHPA_VERSION "\(.*\)"/\1/p' "$HEADER")
[ "$("$program" --version)" = "pumice_impact, sphpa $version" ] || failed "--version: $("$program" --version)"
say "--help lists every option, --version says $version"

# ---- bad input: each one line, and nothing is written ----
mkdir "$work/empty"
cd "$work/empty" || exit 1
refused 2 'no such option' --particels 100
refused 2 'not an option' particles
refused 2 'not a whole number' --particles many
refused 2 'not a whole number' --particles 2.5e0
refused 2 'not a whole number' --particles 1e-3
refused 2 'not a whole number' --particles inf
refused 2 'out of range; it goes from 10 to 100000000' --particles 1e9
refused 2 'out of range; it goes from' --particles 3
refused 2 'out of range; it goes from' --particles 99999999999999999999
refused 2 'write --threads 0 or the like' --threads 1.5
refused 2 'write --speed 2580 or the like' --speed=
refused 2 'write --viscosity 1,3 or the like' --viscosity 1
refused 2 'viscosity -1,-3: out of range; each number goes from 0 to 1000' --viscosity -1,-3
refused 2 'out of range; each number goes from 0' --viscosity 1,-3
refused 2 'out of range; it goes from' --damage-below 1.5
refused 2 'give one' --ensemble 2 --movie film.gif
refused 2 'not a finite number' --speed fast
refused 2 'not a finite number' --speed nan
refused 2 'not a finite number' --speed inf
refused 2 'not a finite number' --speed 2580x
refused 2 'not a finite number' --speed ''
refused 2 'out of range; it goes from' --speed -5
refused 2 'out of range; it goes from' --every -1e-6
refused 2 'outputs until' --every 1e-15
refused 2 'its value is missing' --speed
refused 2 'finite numbers with commas' --gauge 1,2
refused 2 'finite numbers with commas' --gauge 0,0,0,0
refused 2 'unknown; give one of' --solver regula-falsi
refused 2 'unknown; give one of two-exponent.quadratic' --curve cubic
refused 2 'unknown; give one of on.off' --balsara yes
refused 2 'takes no value' --quiet=1
refused 2 'ends in .gif' --movie film.mp4
refused 2 'give --resume auto' --ensemble 2 --resume checkpoint.hdf
refused 2 'of one run from its beginning; leave --resume out' --record-states states.txt --resume auto
refused 2 'of one run from its beginning; leave --ensemble out' --record-states states.txt --ensemble 2
refused 2 'of one run from its beginning; leave --movie out' --record-states states.txt --movie film.gif
refused 2 'the name of a file' --record-states ''
refused 2 'the name of a file' --record-states folder/
refused 2 'the name of a file' --record-states .
refused 2 'the name of a file' --sensitivity .
refused 1 'give a name' --out ''
[ -z "$(ls "$work/empty")" ] || failed "bad options leave files: $(ls "$work/empty")"
echo text > file
refused 1 'output folder file/out: cannot make file ' --out file/out
refused 1 'output folder file: cannot make file ' --out file
refused 1 'file/table.csv: .*; give another name' --sensitivity file/table.csv
refused 1 'output folder file: .*; choose another with --record-states' --out out --record-states file/states.txt
mkdir taken taken/states.txt.part
refused 1 'cannot write taken/states.txt.part .*choose another folder with --record-states' --out out \
    --record-states taken/states.txt
[ -z "$(find out taken -type f)" ] || failed "states that cannot be written leave files: $(find out taken -type f)"
ln -s nowhere dangling
refused 1 'cannot make dangling .*choose another with --sensitivity' --sensitivity dangling/table.csv
[ "$(cat file)" = text ] || failed "a file in the way of --out is overwritten"
if [ "$(id -u)" != 0 ]; then # root may write everywhere
    mkdir -m 555 locked
    refused 1 'cannot (make|write) locked' --out locked
    refused 1 'cannot write locked/states.txt.part' --out out --record-states locked/states.txt
fi
cd "$here" || exit 1
say "$refusals bad command lines, one message each"

# ---- a run, and the same on one thread ----
run --threads 2 --out "$work/whole"
[ "$status" = 0 ] || { failed "a plain run: exit status $status"; head -n 5 "$work/stderr"; finish; }
for line in '^largest fragment: [0-9.]+ of the target.s mass .experiment 0.0996, GASPHiA 0.0835' \
    'largest distance of a loading particle' '^alpha grew: 0 particles' '^drift of mass' \
    'over linking length' 'over the last outputs' 'EOS .* forces' 'peak memory' \
    'projectile  .*mm' 'crush curve' 'flaws' '^  too short to tell .*: 3 us, less than 50; give a larger --t-end' \
    '^  the last two outputs differ by [0-9.]+$'; do
    shows "$work/stdout" "$line" "a plain run"
done
no_parts "$work/whole"
cmp -s "$work/stdout" "$work/whole/report.txt" || failed "report.txt is not what was printed"
run --threads 1 --out "$work/one_thread"
[ "$status" = 0 ] || failed "one thread: exit status $status"
same_run "$work/whole" "$work/one_thread" "one thread and two"
say "a run of 230 particles prints what it must; the same bits on 1 and 2 threads"

# ---- whether the largest fragment is settled: not by the last two outputs alone ----
settles() { # settles OUTPUTS ARGUMENTS..: the verdict is what largest.dat says of the last 20 us
    wanted=$1
    shift
    run --t-end 6e-5 --out "$work/settled" "$@"
    [ "$status" = 0 ] || { failed "--t-end 6e-5 $*: exit status $status"; return; }
    change=$(awk '$1 > 39.999 { if (!n++ || $2 < low) low = $2; if (n == 1 || $2 > high) high = $2 }
        END { printf "%.4f", high - low }' "$work/settled/largest.dat")
    verdict='settled: .*, less than 0.01$'
    awk "BEGIN { exit !($change >= 0.01) }" && verdict='NOT SETTLED: .* not less than 0.01; give a larger'
    shows "$work/stdout" "^  $verdict" "--t-end 6e-5 $*"
    shows "$work/stdout" ": over the $wanted outputs of the last [0-9]+ us it changed by $change," "--t-end 6e-5 $*"
}
settles 7
settles 3 --every 1e-5
run --t-end 6e-5 --every 3e-5 --out "$work/settled"
shows "$work/stdout" '^  too few outputs to tell .*: 1 in the last 20 us; give a smaller --every' "--every 3e-5"
say "settled goes by the last 20 us, whatever --every is; a run of 3 us cannot tell"

if [ -c /dev/full ]; then
    # shellcheck disable=SC2086
    "$program" $small --out "$work/unheard" > /dev/full 2> "$work/stderr" &&
        failed "nothing could be printed, and the exit status is 0"
    shows "$work/stderr" 'cannot write to standard output' "a full stdout"
fi

# ---- interrupt and resume ----
# two outputs, some 50 steps between them: a checkpoint that left a trace would show
longer='--particles 800 --projectile-particles 60 --t-end 4e-6 --every 2e-6'
stop_with() { # stop_with SIGNAL FOLDER [ARGUMENTS..]: somewhere behind the first output; $status
    signal=$1 folder=$2
    shift 2
    for try in 1 2 3; do
        rm -rf "$folder"
        # shellcheck disable=SC2086
        "$program" $small $longer --threads 2 --out "$folder" "$@" > "$work/stdout" 2> "$work/stderr" &
        pid=$! waited=0
        while [ ! -f "$folder/cut_0001.dat" ] && [ $waited -lt 1000 ] && kill -0 $pid 2> /dev/null; do
            sleep 0.02
            waited=$((waited + 1))
        done
        sleep 0.0$((5 - try))
        kill -"$signal" $pid 2> /dev/null
        wait $pid 2> /dev/null
        status=$?
        [ $status = 0 ] || return
    done
    skip "SIG$signal in the middle of a run" "$try times it was over before"
}
# shellcheck disable=SC2086
run $longer --out "$work/unstopped"
[ "$status" = 0 ] || failed "the run to compare with: exit status $status"
stop_with INT "$work/stopped"
if [ "$status" != 0 ]; then
    [ "$status" = 130 ] || failed "interrupted: exit status $status, not 130"
    shows "$work/stderr" '^pumice_impact: stopped at t = ' "interrupted"
    [ -s "$work/stdout" ] && failed "interrupted, and yet it prints results"
    no_parts "$work/stopped"
    if [ -z "$hdf5" ]; then
        shows "$work/stderr" 'built without HDF5, so there is no checkpoint' "interrupted"
    else
        words=$(sed -n 's/^to go on, give the same options and //p' "$work/stderr")
        [ "$words" = "--resume $work/stopped/checkpoint.hdf" ] || failed "how to go on: \"$words\""
        when=$(sed -n 's/.*stopped at //p' "$work/stderr")
        # shellcheck disable=SC2086
        run $longer --threads 1 --out "$work/stopped" $words
        [ "$status" = 0 ] || { failed "resumed: exit status $status"; cat "$work/stderr"; }
        same_run "$work/unstopped" "$work/stopped" "interrupted and resumed" 0002
        say "interrupted at $when, resumed: the bits of the run that never stopped"
    fi
fi
if [ -z "$hdf5" ]; then
    skip "resuming, bad checkpoints, full disk" "no HDF5"
else
    stop_with KILL "$work/killed"
    if [ "$status" != 0 ]; then
        # shellcheck disable=SC2086
        run $longer --out "$work/killed" --resume auto
        [ "$status" = 0 ] || { failed "resumed after a kill: exit status $status"; cat "$work/stderr"; }
        same_run "$work/unstopped" "$work/killed" "killed and resumed" 0002
        say "killed and resumed: the same bits"
    fi
    said --out "$work/new" --resume auto
    [ "$status" = 0 ] || failed "--resume auto without a checkpoint: exit status $status"
    shows "$work/stderr" "no $work/new/checkpoint.hdf: begins anew" "--resume auto without a checkpoint"
    same_run "$work/whole" "$work/new" "--resume auto without a checkpoint"
    said --out "$work/new" --resume auto --every 1.5e-7
    [ "$status" = 0 ] || failed "--resume auto of a finished run: exit status $status"
    shows "$work/stderr" "goes on from $work/new/checkpoint.hdf: t = 3e-06 s" "--resume auto of a finished run"
    shows "$work/stdout" '^largest fragment: ' "--resume auto of a finished run"
    same_run "$work/whole" "$work/new" "--resume auto of a finished run"
    run --out "$work/new" --resume auto --t-end 3.3e-6
    [ "$status" = 0 ] || failed "a later --t-end: exit status $status"
    [ -f "$work/new/impact_0022.hdf" ] || failed "a later --t-end does not go on"
    run --out "$work/new"
    shows "$work/stderr" "holds a longer run: its outputs from number 21 on" "a shorter run into the same folder"
    touch "$work/new/beside.png"
    run --out "$work/new" --compare off
    shows "$work/stderr" "beside.png is of an earlier run" "a picture of an earlier run"
fi
[ -n "$no_h5py" ] && skip "the bits of snapshots and checkpoints" "no h5py: only logs and tables were compared"

# ---- files that are no checkpoint of this run: refused, and nothing changes ----
bad_checkpoints() {
    good=$work/whole/checkpoint.hdf bad=$work/bad refusals=0
    mkdir -p "$bad"
    size=$(wc -c < "$good" | tr -d ' ')
    head -c 0 "$good" > "$bad/nothing.hdf"
    head -c 5000 "$good" > "$bad/short.hdf"
    head -c $((size - 100)) "$good" > "$bad/nearly.hdf"
    cp "$work/whole/impact_0020.hdf" "$bad/snapshot.hdf"
    echo 'a text, no HDF5' > "$bad/text.hdf"
    "${python:-python3}" -c "import h5py, sys; h5py.File(sys.argv[1], 'w')['x'] = 1.0" "$bad/foreign.hdf" \
        2> /dev/null || skip "a foreign HDF5 file for --resume" "no h5py"
    { sums "$work/whole"; sums "$bad"; } > "$work/before"
    for file in nothing short nearly snapshot text foreign; do
        [ -f "$bad/$file.hdf" ] && refused 1 "$bad/$file.hdf" --out "$work/whole" --resume "$bad/$file.hdf"
    done
    refused 1 "$bad/missing.hdf" --out "$work/whole" --resume "$bad/missing.hdf"
    refused 1 "$bad" --out "$work/whole" --resume "$bad"
    while read -r option now before name; do
        refused 1 "another run: --$name is $before in it and $now here; give the same options" \
            --out "$work/whole" --resume "$good" "$option" "$now"
    done << 'END'
--speed 2000 2580 speed
--particles 210 200 particles
--seed 2 1 seed
--curve quadratic two-exponent curve
--every 1e-06 1.5e-07 every
--balsara off on balsara
--link 0.9 1 link
--weibull-m 8.1 9 weibull-m
--lattice-seed 3 1 lattice-seed
END
    refused 1 "--gauge z is 0.025 in it and 0 here" --out "$work/whole" --resume "$good" --gauge 0,0,0
    refused 1 "--viscosity b is 3 in it and 2 here" --out "$work/whole" --resume "$good" --viscosity 1,2
    refused 1 'beyond --t-end' --out "$work/whole" --resume auto --t-end 2e-6
    { sums "$work/whole"; sums "$bad"; } > "$work/after"
    cmp -s "$work/before" "$work/after" || failed "a refused --resume changes files: $(diff "$work/before" "$work/after" | head -n 4)"
    say "$refusals bad checkpoints: one message each, no file was touched"
}
[ -n "$hdf5" ] && bad_checkpoints

# ---- a full disk ----
whole_files() { # whole_files FOLDER: no half file under a final name
    no_parts "$1"
    for file in "$1"/impact_*.hdf "$1"/checkpoint.hdf; do
        [ -f "$file" ] || continue
        "$program" --target "$file" --dry-run > /dev/null 2> "$work/stderr" ||
            failed "on a full disk, $file is not whole: $(head -n 1 "$work/stderr")"
    done
    for file in "$1"/cut_*.dat "$1"/palpha_*.dat; do
        [ -f "$file" ] || continue
        [ "$(lines "$file")" = "$(lines "$work/whole/$(basename "$file")")" ] || failed "on a full disk, $file is not whole"
    done
}
full_disk() { # full_disk FOLDER: after a run that had no room
    [ "$status" = 1 ] || failed "$1: exit status $status, not 1"
    shows "$work/stderr" "(No space left|File too large)" "$1"
    whole_files "$1"
}
if [ -n "$hdf5" ]; then
    mkdir "$work/disk"
    if [ "$(id -u)" = 0 ] && mount -t tmpfs -o size=700k none "$work/disk" 2> /dev/null; then
        trap 'umount "$work/disk" 2> /dev/null' EXIT
        run --out "$work/disk/run"
        full_disk "$work/disk/run"
        say "disk full after $(find "$work/disk/run" -name 'impact_*.hdf' | grep -c .) snapshots: one message, every file whole"
        rm -f "$work"/disk/run/impact_000[0-2].hdf
        umount "$work/disk"
    else
        say "a disk of its own cannot be mounted here: only the limit of a file's size is tried"
    fi
    # in a shell of its own: the limit in blocks of 512 bytes; a snapshot is longer
    (
        trap '' XFSZ
        ulimit -f 100
        run --out "$work/limited"
        exit "$status"
    )
    status=$?
    full_disk "$work/limited"
    [ -z "$(find "$work/limited" -name '*.hdf')" ] || failed "a snapshot longer than any file may be"
fi

# ---- the states for the solvers' benchmark ----
has_states() { # has_states FILE: a head that names material and curve, then states within bounds
    awk '/^# [a-zA-Z_0-9]+ [^ ]+$/ { head[$2] = $3; next }
        /^#/ { next }
        NF != 3 || !($1 > 0) || !($2 >= 0) || !($3 >= 1) || $3 > head["alpha0"] { bad++ }
        $3 > 1 && $3 < head["alpha0"] { loaded++ }
        END { if (head["material"] != "pumice" || bad || !loaded || head["Ps"] <= head["Pe"]) exit 1 }' "$1"
}
build bench/bench_eos "$work/full"
for curve in two-exponent quadratic; do
    states=$work/states/$curve.txt
    run --threads 1 --curve $curve --compare on --record-states "$states" --out "$work/states/$curve"
    [ "$status" = 0 ] || { failed "--record-states, $curve: exit status $status"; head -n 3 "$work/stderr"; continue; }
    has_states "$states" || failed "--record-states, $curve: not what it ought to be: $(head -n 14 "$states")"
    # the solvers' benchmark reads it; a row is solver,material,curve,..,mix,..,failures,other_root,ill
    "$work/full/bench/bench_eos" --quick --states "$states" --filter run/ --no-pictures \
        --out "$work/states" > "$work/stdout" 2> "$work/stderr" || failed "bench_eos refuses the states: $(tail -n 1 "$work/stderr")"
    grep -q "^crush-space,pumice,$curve,4.64,run,.*,0,0,0\$" "$work/states/eos.csv" ||
        failed "bench_eos: no row of an impact's states, $curve curve"
done
same_run "$work/whole" "$work/states/two-exponent" "a run whose states are recorded"
run --threads 2 --record-states "$work/states/again.txt" --out "$work/states/again"
cmp -s "$work/states/two-exponent.txt" "$work/states/again.txt" ||
    failed "--record-states: other states on 2 threads, or with --compare on"
run --dry-run --record-states "$work/states/dry.txt" --out "$work/dry"
[ -f "$work/states/dry.txt" ] && failed "--dry-run records states"
echo 'of the run before' > "$work/states/kept.txt"
stop_with INT "$work/states/stopped" --record-states "$work/states/kept.txt"
if [ "$status" != 0 ]; then
    [ "$status" = 130 ] || failed "--record-states, interrupted: exit status $status"
    [ "$(cat "$work/states/kept.txt")" = 'of the run before' ] || failed "--record-states, interrupted: half a file"
fi
if [ -c /dev/full ]; then # as a full disk: found out when the file is closed
    ln -s /dev/full "$work/states/full.txt.part"
    run --record-states "$work/states/full.txt" --out "$work/states/full"
    [ "$status" = 1 ] || failed "--record-states on a full disk: exit status $status"
    shows "$work/stderr" 'could not finish .*states/full.txt \(No space' "--record-states on a full disk"
    [ -e "$work/states/full.txt" ] && failed "--record-states on a full disk leaves a file"
fi
no_parts "$work/states"
say "--record-states: $(grep -vc '^#' "$work/states/again.txt") states that bench_eos reads, the same on 1 and 2 threads"

# ---- the rest of the options ----
run --dry-run --out "$work/dry"
for line in '^particles 2[0-9][0-9]$' '^memory +[0-9.]+ MB' '^steps +about [0-9]+' '^time +about'; do
    shows "$work/stdout" "$line" "--dry-run"
done
run --dry-run --out "$work/dry" --particles 1e8
shows "$work/stdout" '^particles 1000000[0-9][0-9]$' "--dry-run of 1e8 particles"
shows "$work/stdout" '^memory +[0-9]{6}\.[0-9] MB' "--dry-run of 1e8 particles"
[ -d "$work/dry" ] && failed "--dry-run writes files"

run --solver newton --out "$work/newton"
if [ "$status" = 0 ]; then
    say "--solver newton runs to the end here"
else
    shows "$work/stderr" 'did not converge.*particle [0-9]+.*; use the default solver' "--solver newton"
    say "--solver newton stops: $(head -n 1 "$work/stderr" | cut -c 1-90)..."
fi
for solver in bisection safe-newton; do
    run --solver $solver --out "$work/$solver"
    [ "$status" = 0 ] || failed "--solver $solver: exit status $status"
done

run --ensemble 2 --t-end 1e-6 --out "$work/ensemble"
[ "$status" = 0 ] || failed "--ensemble 2: exit status $status"
shows "$work/stdout" '^largest fragment: [0-9.]+ \+- [0-9.]+ of the target.s mass over 2 seeds' "--ensemble 2"
for seed in 1 2; do
    [ -f "$work/ensemble/seed_$seed/log.txt" ] || failed "--ensemble 2: no folder seed_$seed"
done
if [ -n "$hdf5" ]; then
    if seen=$("${python:-python3}" tests/same_bits.py "$work/ensemble/seed_1/checkpoint.hdf" \
        "$work/ensemble/seed_2/checkpoint.hdf" 2>&1); then failed "--ensemble 2: two seeds, one run"; fi
    case $seen in
    *' 0 differ'*) ;;
    *FlawThresholds* | skipped*) ;;
    *) failed "--ensemble 2: the seeds differ in something else than flaws: $seen" ;;
    esac
fi

run --compare on --compare-particles 100 --t-end 1e-6 --out "$work/compared"
[ "$status" = 0 ] || failed "--compare on: exit status $status"
shows "$work/stdout" '^largest fragment with correction and Balsara off' "--compare on"
cmp -s "$work/stdout" "$work/compared/report.txt" || failed "--compare on: report.txt is not what was printed"

table="$work/table/sensitivity.csv"
run --sensitivity "$table" --t-end 3e-7 --out "$work/table"
[ "$status" = 0 ] || { failed "--sensitivity: exit status $status"; head -n 3 "$work/stderr"; }
first=$(lines "$table")
[ "$first" = 154 ] || failed "--sensitivity: $first lines, not 17 runs by 9 readings and a header"
run --sensitivity "$table" --t-end 3e-7 --out "$work/table"
[ "$(lines "$table")" = "$first" ] || failed "--sensitivity makes runs again that are in the table"
shows "$work/stderr" '^17 of 17 runs' "--sensitivity again"
sed '20,$d' "$table" > "$work/cut.csv"
run --sensitivity "$work/cut.csv" --t-end 3e-7 --speed 2000 --out "$work/table"
shows "$work/stderr" '^0 of 17 runs' "--sensitivity with another speed"
# stopped in the middle: the same command goes on, with the same numbers; another run begins anew
several="--sensitivity $work/stop.csv --t-end 1e-6 --out $work/stop --resume auto"
# shellcheck disable=SC2086
run $several
cp "$work/stop.csv" "$work/unstopped.csv"
[ -z "$(find "$work/stop" -name checkpoint.hdf)" ] || failed "--sensitivity leaves checkpoints of runs that are in the table"
rm -r "$work/stop.csv" "$work/stop"
# shellcheck disable=SC2086
"$program" $small $several > "$work/stdout" 2> "$work/stderr" &
pid=$! waited=0
while ! grep -q '^target diameter x 0.6' "$work/stop.csv" 2> /dev/null && [ $waited -lt 1000 ]; do
    sleep 0.02
    waited=$((waited + 1))
done
kill -INT $pid
wait $pid
if [ $? = 130 ] && [ -n "$hdf5" ]; then
    shows "$work/stderr" 'stop it at any time: to go on, give the same command$' "--sensitivity"
    shows "$work/stderr" '^to go on, give the same command$' "--sensitivity, interrupted"
    cp -r "$work/stop" "$work/stop_other"
    # shellcheck disable=SC2086
    run $several
    cmp -s "$work/stop.csv" "$work/unstopped.csv" || failed "--sensitivity, interrupted and resumed: another table"
    run --sensitivity "$work/other.csv" --t-end 1e-6 --out "$work/stop_other" --resume auto --cfl 0.25
    [ "$status" = 0 ] || failed "--sensitivity beside the checkpoint of another: exit status $status"
    shows "$work/stderr" 'checkpoint.hdf is not of this run: begins anew' "--sensitivity beside the checkpoint of another"
    run --sensitivity "$work/third.csv" --t-end 1e-6 --out "$work/third" --cfl 0.25
    cmp -s "$work/other.csv" "$work/third.csv" || failed "--sensitivity beside the checkpoint of another: takes it for its own"
else
    skip "--sensitivity, interrupted" "no HDF5, or it was over before"
fi
echo 'mine,1,2' > "$work/mine.csv"
refused 1 'not a table of this program' --sensitivity "$work/mine.csv"
[ "$(cat "$work/mine.csv")" = mine,1,2 ] || failed "--sensitivity overwrites a foreign file"
say "--dry-run, --ensemble, --compare, --sensitivity do what they say"

# ---- pictures ----
pictures='palpha.png cut.png spectrum.svg largest.svg gauge.svg'
if have gnuplot; then
    for picture in $pictures; do
        [ -s "$work/whole/$picture" ] || failed "no picture $picture"
    done
    [ -s "$work/compared/beside.png" ] || failed "no picture beside.png"
    cd "$work" || exit 1
    run --movie "film's/../film/impact.gif" --t-end 3e-7 --out "$work/film"
    [ "$status" = 2 ] || failed "a movie's name with a quote: exit status $status"
    run --movie film/impact.gif --t-end 3e-7 --out "$work/its own film"
    refused 1 'cannot make mine.csv .*choose another with --movie' --movie mine.csv/film.gif
    cd "$here" || exit 1
    [ "$(head -c 4 "$work/film/impact.gif" 2> /dev/null)" = GIF8 ] || failed "no movie: $(tail -n 1 "$work/stderr")"
    no_parts "$work/film"
    say "every picture and the movie are there"
else
    skip "the impact's pictures" "no gnuplot"
fi
mkdir "$work/path"
PATH="$work/path" "$program" --movie "$work/undrawn.gif" --out "$work/undrawn" > "$work/stdout" 2> "$work/stderr" &&
    failed "--movie without gnuplot: exit status 0"
shows "$work/stderr" '--movie .*undrawn.gif: no gnuplot here to draw it; install it' "--movie without gnuplot"
[ -d "$work/undrawn" ] && failed "--movie without gnuplot runs before it says so"
PATH="$work/path" "$program" --particles 100 --projectile-particles 20 --t-end 1e-7 --compare off --quiet --out "$work/undrawn" \
    > "$work/stdout" 2> "$work/stderr"
status=$?
[ "$status" = 0 ] || failed "without gnuplot: exit status $status"
for picture in $pictures; do
    shows "$work/stderr" "left out .*/$picture: no gnuplot" "without gnuplot"
    [ -f "$work/undrawn/$picture.gp" ] || failed "without gnuplot: no script $picture.gp"
done
say "without gnuplot it names the $(grep -c 'left out' "$work/stderr") pictures that it left out"

# ---- without HDF5 ----
program=$work/plain/examples/pumice_impact
run --out "$work/text"
[ "$status" = 0 ] || failed "without HDF5: exit status $status"
shows "$work/stderr" '^built without HDF5: plain text output, no checkpoints' "without HDF5"
shows "$work/stdout" '^largest fragment: ' "without HDF5"
[ -s "$work/text/impact_0020.txt" ] || failed "without HDF5: no plain text output"
for file in log.txt gauge.dat largest.dat; do
    cmp -s "$work/whole/$file" "$work/text/$file" || failed "with and without HDF5: $file differs"
done
run --out "$work/text" --resume "$work/whole/checkpoint.hdf"
[ "$status" = 1 ] || failed "--resume without HDF5: exit status $status"
shows "$work/stderr" 'built without HDF5; install it' "--resume without HDF5"
say "without HDF5: the same run with plain text files"

finish "the impact's command line holds"
