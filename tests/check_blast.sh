#!/bin/sh
# check_blast.sh: examples/blast as a user meets it: options, bad input, files, budgets, interrupt, a
# full disk, threads, without gnuplot. Coarse runs of a few microseconds.
# shellcheck source=tests/lib.sh
. "$(dirname "$0")/lib.sh"

if [ ! -f examples/blast.c ]; then
    skip "the blast at the command line" "examples/blast.c is missing"
    finish "nothing to look at"
fi
say "building examples/blast"
$MAKE --no-print-directory INNER=1 BUILD="$work/full" CFLAGS=-O1 "$work/full/examples/blast" \
    > "$work/make.log" 2>&1 || {
    failed "examples/blast does not build:"
    tail -n 15 "$work/make.log"
    finish
}
here=$(pwd)
case $work in /*) ;; *) work=$here/$work ;; esac
program=$work/full/examples/blast

# ---- helpers ----
# 400 particles in 10 m, a reference of 4000 cells
small='--dx 0.5 --t-end 4e-6 --times 1,2 --tolerance 0.1 --dt-start 0 --size 40 --quiet'
run() { # run ARGUMENTS..: $status, and the files stdout and stderr
    # shellcheck disable=SC2086 # words
    "$program" $small "$@" > "$work/stdout" 2> "$work/stderr" < /dev/null
    status=$?
}
below() { # below LIMIT FILE COLUMN WHAT: |number| in every row that is no comment
    awk -v limit="$1" -v c="$3" '!/^#/ { n++; x = $c < 0 ? -$c : $c
        if (!(x <= limit)) bad = $c } END { if (!n) bad = "nothing"; if (bad != "") { print bad; exit 1 } }' \
        "$2" > "$work/bad" || failed "$4: column $3 of $2 has $(cat "$work/bad"), not within $1"
}
column() { awk -v c="$2" '!/^#/ { print $c }' "$1"; }

# ---- what it says of itself ----
"$program" --help > "$work/help" || failed "--help: exit status $?"
for option in yield radius rho-charge rho-air P-air gamma method scheme kernel riemann slopes density eta h-max pilot g1 g2 \
    cfl cfl-mesh dt-start dx split beta active buffer threshold flag merge coupling domain size t-end times tolerance \
    max-seconds convergence kernels out pictures threads quiet; do
    shows "$work/help" "^  --$option" "--help"
done
shows "$work/help" 'Shock radius R: outermost radius where' "--help"
shows "$work/help" 'L1:' "--help"
version=$(sed -n 's/^#define SPHPA_VERSION "\(.*\)"/\1/p' "$HEADER")
[ "$("$program" --version)" = "blast, sphpa $version" ] || failed "--version: $("$program" --version)"
say "--help lists every option, --version says $version"

# ---- bad input: each one line, and nothing is written ----
mkdir "$work/empty"
cd "$work/empty" || exit 1
refused 2 'no such option' --yeild 1
refused 2 'not an option' yield
refused 2 'not a finite number' --yield much
refused 2 'not a finite number' --yield nan
refused 2 'out of range; it goes from' --yield -1
refused 2 'out of range; it goes from' --dx 0
refused 2 'out of range; it goes from' --gamma 1
refused 2 'out of range; it goes from' --beta -1
refused 2 'out of range; it goes from' --tolerance 0
refused 2 'out of range; it goes from' --dt-start -2
refused 2 'out of range; it goes from' --max-seconds -1
refused 2 'out of range; it goes from' --t-end 0
refused 2 'not a whole number' --buffer 1.5
refused 2 'unknown; give one of all.fvm.sph.hybrid.reference' --method mesh
refused 2 'unknown; give one of gsph' --scheme psph
refused 2 'give --method sph' --scheme mpm
refused 2 'give --method sph' --scheme sph --method hybrid
refused 2 'give --domain fixed' --scheme adke --method sph
refused 2 'unknown; give one of cubic' --kernel square
refused 2 'unknown; give one of conservative.published' --coupling loose
refused 2 'unknown; give one of grow.fixed' --domain open
refused 2 'unknown; give one of number.mass' --density weight
refused 2 'out of range; it goes from' --split -1
refused 2 'its value is missing' --dx
refused 2 'takes no value' --kernels=1
refused 2 'not positive numbers with commas between' --times 1,,2
refused 2 'not positive numbers with commas between' --times 1,2,
refused 2 'not positive numbers with commas between' --times -1
refused 2 '1 us comes after 2 us; write them in order' --times 2,1
refused 2 'more than 63 numbers; give fewer' --times "$(seq -s , 1 64)"
refused 2 'not positive numbers with commas between' --convergence coarse
refused 2 'jobs of their own; give one' --convergence 1 --kernels
refused 2 'of particles; give --method sph' --kernels --method fvm
refused 2 'give another --method' --convergence 1 --method reference
refused 2 'below ten times that of the air; give a larger --yield' --yield 1e-9 --radius 1
refused 2 'less than half of dx = 0.5 m; give a smaller --dx' --radius 0.2
refused 2 'not above the air' --rho-charge 1
refused 2 'the charge and 6 particles of air around it need 8 m' --size 4
refused 1 'give a name' --out ''
refused 2 'at most 960 characters' --out "$(printf '%01000d' 0)"
[ -z "$(ls "$work/empty")" ] || failed "bad options leave files: $(ls "$work/empty")"
echo text > file
refused 1 'output folder file/out: cannot make file ' --out file/out
[ "$(cat file)" = text ] || failed "a file in the way of --out is overwritten"
cd "$here" || exit 1
say "$refusals bad command lines, one message each"

# ---- all methods: what is printed, what is written, the budgets ----
run --out "$work/whole"
[ "$status" = 0 ] || { failed "a plain run: exit status $status"; head -n 5 "$work/stderr"; finish; }
for line in '^1 kt = 4.184e\+12 J in one metre; charge: radius 1 m, 1000 kg/m3, 5.3272e\+11 Pa; air: 1.225 kg/m3' \
    '^dx = 0.5 m, until 4 us; ' '^particles: gsph, density by number, gaussian kernel, eta 1.5, .* 8 x 8 where the charge is' \
    '^hybrid: beta 2 .mesh 1 m., threshold 0.3 by both, .* particles merge below 1 of a new one$' '^threads: 1$' '^reference: 1-D' \
    '^all changes are within the tolerance of 0.1 of R' '^shock radius R .m.' '^peak density' '^L1 of the density' \
    '^fvm +[0-9.]+ +[-+][0-9.]+ %' '^sph +[0-9.]+ +[-+]' '^hybrid +[0-9.]+ +[-+]' '^method +CPU s'; do
    shows "$work/stdout" "$line" "a plain run"
done
cmp -s "$work/stdout" "$work/whole/report.txt" || failed "report.txt is not what was printed"
no_parts "$work/whole"
for method in fvm sph hybrid reference; do
    [ "$(column "$work/whole/blast_$method.log" 1 | tr '\n' ' ')" = '1.000000e-06 2.000000e-06 4.000000e-06 ' ] ||
        failed "blast_$method.log: times are $(column "$work/whole/blast_$method.log" 1 | tr '\n' ' ')"
    for us in 1 2 4; do
        [ -s "$work/whole/blast_${method}_$us.dat" ] || failed "no blast_${method}_$us.dat"
    done
done
for method in fvm sph hybrid; do
    log=$work/whole/blast_$method.log
    shows "$log" '^# +t.s. +R.m. ' "blast_$method.log"
    below 1e-12 "$log" 11 "$method: mass"
    below 1e-12 "$log" 12 "$method: momentum along x"
    below 1e-12 "$log" 13 "$method: momentum along y"
done
below 1e-12 "$work/whole/blast_fvm.log" 14 "fvm: energy"
below 1e-12 "$work/whole/blast_hybrid.log" 14 "hybrid: energy"
below 1e-4 "$work/whole/blast_sph.log" 14 "sph: energy" # of the steps that a predictor makes longer
# the profiles hold the mass that is there: density times area, to how well squares fill the last ring
for method in fvm sph hybrid; do
    awk -v method=$method '!/^#/ { m += $2 * $4; R = $1 + 0.25 } END {
        exact = 3.14159265 * (1000 + 1.225 * (R * R - 1))
        if (!(m > 0.99 * exact && m < 1.01 * exact)) { print m, exact; exit 1 } }' \
        "$work/whole/blast_${method}_1.dat" > "$work/bad" || failed "$method: mass of the profile, exact: $(cat "$work/bad")"
done
say "all methods: tables, logs and profiles; mass, momentum and energy are kept"

# ---- the same bits ----
run --threads 2 --out "$work/two"
for method in fvm sph hybrid; do
    for us in 1 4; do
        cmp -s "$work/whole/blast_${method}_$us.dat" "$work/two/blast_${method}_$us.dat" ||
            failed "blast_${method}_$us.dat differs on two threads"
    done
done
say "the same bits on 1 and 2 threads"

# ---- domains: what grows is what is large from the beginning, until something arrives ----
longer='--method fvm --dx 0.25 --t-end 1.2e-4 --times 60 --size 40 --pictures off'
# shellcheck disable=SC2086
{
    run $longer --out "$work/grown"
    run $longer --domain fixed --out "$work/fixed"
}
grown=$(column "$work/grown/blast_fvm.log" 9 | tail -n 1)
[ "$grown" -gt 1600 ] && [ "$grown" -lt 25600 ] || failed "--domain grow: $grown cells at the end"
[ "$(column "$work/fixed/blast_fvm.log" 9 | tail -n 1)" = 25600 ] || failed "--domain fixed: not 160 x 160 cells"
for c in 2 3; do
    [ "$(column "$work/grown/blast_fvm.log" $c)" = "$(column "$work/fixed/blast_fvm.log" $c)" ] ||
        failed "column $c: $(column "$work/grown/blast_fvm.log" $c | tr '\n' ' ')in domains that grow, not $(
            column "$work/fixed/blast_fvm.log" $c | tr '\n' ' ')"
done
below 1e-12 "$work/grown/blast_fvm.log" 11 "a growing domain: mass"
below 1e-12 "$work/grown/blast_fvm.log" 14 "a growing domain: energy"
run --method fvm --size 10 --domain fixed --dx 0.25 --t-end 1.2e-4 --times 60 --pictures off --out "$work/out_of_it"
shows "$work/stdout" 'it leaves, or comes close to the edges of, domains of 10 m' "a domain too small"
below 1e-12 "$work/out_of_it/blast_fvm.log" 11 "what leaves: mass"
below 1e-12 "$work/out_of_it/blast_fvm.log" 14 "what leaves: energy"
say "domains that grow: the same shock, budgets closed; so with what leaves a fixed one"

# ---- other ways ----
run --method hybrid --coupling published --out "$work/published" --pictures off
[ "$status" = 0 ] || failed "--coupling published: exit status $status"
shows "$work/stdout" 'buffer 1 cells, coupling published' "--coupling published"
shows "$work/stdout" ' 1 x 1 where the charge is' "--coupling published"
below 1 "$work/published/blast_hybrid.log" 11 "--coupling published: mass"
column "$work/published/blast_hybrid.log" 11 | awk '{ x = $1 < 0 ? -$1 : $1; if (x > 1e-9) leaks = 1 } END { exit !leaks }' ||
    failed "--coupling published does not leak: is it the other one?"
for words in '--slopes middle' '--density mass --split 2 --h-max 2' '--scheme sph' '--riemann hllc' '--kernel wendland-c4' '--dt-start -1 --t-end 1e-9' '--h-max 2' \
    '--flag pressure --method hybrid' '--beta 4 --merge -1 --method hybrid' '--threshold 1e9 --method hybrid'; do
    # shellcheck disable=SC2086
    run --method sph --pictures off --out "$work/other" $words
    [ "$status" = 0 ] || { failed "$words: exit status $status"; head -n 3 "$work/stderr"; }
done
# no cell is flagged: the hybrid is its mesh
run --method hybrid --threshold 1e9 --beta 1 --size 20 --split 1 --pictures off --out "$work/mesh"
run --method fvm --domain fixed --size 20 --pictures off --out "$work/fine"
cmp -s "$work/mesh/blast_hybrid_4.dat" "$work/fine/blast_fvm_4.dat" ||
    failed "a hybrid without particles is not the finite volumes of its mesh"
steps=$(column "$work/whole/blast_sph.log" 7 | tail -n 1)
run --method sph --dt-start -1 --pictures off --out "$work/slow"
slow=$(column "$work/slow/blast_sph.log" 7 | tail -n 1)
# sum of 6.25e-11 k^2 over k = 1 .. n reaches 4e-6 at n = 58, and one or two more end at each output
[ "$slow" -ge 57 ] && [ "$slow" -gt "$steps" ] || failed "--dt-start -1: $slow steps to 4 us, $steps without"
run --kernels --out "$work/kernels" --pictures off
for kernel in cubic quartic quintic wendland-c2 wendland-c4 wendland-c6 gaussian; do
    shows "$work/stdout" "^$kernel +(yes|NO)" "--kernels"
done
run --convergence 1,0.8 --out "$work/converge" --method fvm
[ "$(lines "$work/converge/convergence_fvm.dat")" = 4 ] || failed "--convergence 1,0.8: not three rows"
[ "$(column "$work/converge/convergence_fvm.dat" 1 | tr '\n' ' ')" = '1 0.8 0.5 ' ] || failed "--convergence: in which order?"
run --method reference --tolerance 1e-6 --t-end 2e-8 --times 1e-9 --out "$work/reference"
shows "$work/stdout" '^(all changes are within|NOT CONVERGED: [0-9]+ of them)' "--method reference"
say "--coupling, --scheme, --kernels, --convergence, --dt-start and the like do what they say"

# ---- budgets of time, interrupt, a full disk ----
run --max-seconds 1e-6 --method fvm --out "$work/budget"
[ "$status" = 0 ] || failed "--max-seconds: exit status $status"
shows "$work/stdout" '^fvm ended by --max-seconds 1e-06 at t = [0-9.e-]+ us, step 1$' "--max-seconds"
"$program" --dx 0.4 --tolerance 0.1 --t-end 1e-3 --times 0.1 --quiet --method sph --out "$work/stopped" \
    > "$work/stdout" 2> "$work/stderr" < /dev/null &
pid=$! waited=0
while [ ! -f "$work/stopped/blast_sph.log" ] && [ $waited -lt 3000 ] && kill -0 $pid 2> /dev/null; do
    sleep 0.02
    waited=$((waited + 1))
done
kill -INT $pid
wait $pid
status=$?
[ "$status" = 130 ] || failed "interrupted: exit status $status, not 130"
shows "$work/stderr" '^blast: interrupted' "interrupted"
shows "$work/stdout" '^sph interrupted at t = ' "interrupted"
shows "$work/stdout" '^sph +[0-9.]+ +[-+][0-9.]+ %' "interrupted: the table so far"
no_parts "$work/stopped"
if [ -c /dev/full ]; then
    # shellcheck disable=SC2086
    "$program" $small --method reference --pictures off --out "$work/unheard" > /dev/full 2> "$work/stderr" &&
        failed "nothing could be printed, and the exit status is 0"
    shows "$work/stderr" 'cannot write to standard output' "a full stdout"
fi
say "--max-seconds and Ctrl-C end a run cleanly"

# ---- pictures ----
pictures='plane.png lineouts.png shock.svg time.svg'
if have gnuplot; then
    for picture in $pictures; do
        [ -s "$work/whole/$picture" ] || failed "no picture $picture"
    done
    [ -s "$work/converge/convergence.svg" ] || failed "no picture convergence.svg"
    shows "$work/whole/shock.svg" '<svg' "shock.svg"
    say "every picture is there"
else
    skip "the blast's pictures" "no gnuplot"
fi
mkdir "$work/path"
# shellcheck disable=SC2086
PATH="$work/path" "$program" $small --out "$work/undrawn" > "$work/stdout" 2> "$work/stderr"
status=$?
[ "$status" = 0 ] || failed "without gnuplot: exit status $status"
for picture in $pictures; do
    shows "$work/stderr" "left out .*/$picture: no gnuplot" "without gnuplot"
    [ -f "$work/undrawn/$picture.gp" ] || failed "without gnuplot: no script $picture.gp"
done
[ -f "$work/mesh/plane.png.gp" ] && failed "--pictures off writes scripts"
say "without gnuplot it names what it left out"

finish "the blast's command line holds"
