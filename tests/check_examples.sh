#!/bin/sh
# check_examples.sh: the smaller examples at the command line: what they refuse and how, that nothing
# half written stays behind, that words, tables and pictures agree.
# shellcheck source=tests/lib.sh
. "$(dirname "$0")/lib.sh"

say "building the examples"
$MAKE --no-print-directory INNER=1 BUILD="$work" CFLAGS=-O1 -j"$JOBS" examples-build > "$work/make.log" 2>&1 || {
    failed "the examples do not build:"
    tail -n 15 "$work/make.log"
    finish
}
run() { # run PROGRAM ARGUMENTS..: $status, and the files stdout and stderr
    program=$1
    shift
    "$work/examples/$program" "$@" > "$work/stdout" 2> "$work/stderr" < /dev/null
    status=$?
}
refused() { # refused STATUS PATTERN PROGRAM ARGUMENTS..: one line on stderr, none on stdout, no folder
    wanted=$1 pattern=$2
    shift 2
    rm -rf "$work/refused"
    run "$@" --out "$work/refused"
    [ "$status" = "$wanted" ] || failed "$*: exit status $status, not $wanted"
    [ "$(wc -l < "$work/stderr")" -eq 1 ] || failed "$*: $(wc -l < "$work/stderr") lines on stderr, not one"
    [ -s "$work/stdout" ] && failed "$*: prints something although it is refused"
    [ -d "$work/refused" ] && failed "$*: makes its folder although it is refused"
    shows "$work/stderr" "$pattern" "$*"
}

# ---- every program tells its version, and what it is ----
version=$(sed -n 's/^#define SPHPA_VERSION "\(.*\)"/\1/p' "$HEADER")
count=0
for file in examples/*.c; do
    name=$(basename "$file" .c)
    [ -x "$work/examples/$name" ] || continue # needs HDF5
    run "$name" --version
    [ "$status $(cat "$work/stdout")" = "0 $name, sphpa $version" ] || failed "$name --version: $(cat "$work/stdout")"
    run "$name" --help
    if [ "$status" != 0 ] || ! [ -s "$work/stdout" ]; then failed "$name --help: exit status $status"; fi
    count=$((count + 1))
done
say "$count programs tell their version and their use"

# ---- refused, with the value and the cure ----
for program in sod porous_piston; do
    refused 2 'viscosity -1,2: out of range; each number goes from 0 to ' $program --viscosity -1,2
    refused 2 'write --viscosity 1,2 or the like' "$program" --viscosity 1
    refused 2 'not a whole number; write --particles [0-9]+ or the like' "$program" --particles 1e2.5
done
refused 2 'the first wave is at the far end at .*; stop before' porous_piston --t-end 1
refused 2 'the shock is at the side of the box at t = 0\.75.*; stop before' sedov --t-end 5
refused 2 'the shock is at the side of the box at t = ' sedov --dim 3 --t-end 5
for program in porous_piston crush_cube; do
    run $program --solver newton --out "$work/newton"
    [ "$status" = 1 ] || failed "$program --solver newton: exit status $status"
    shows "$work/stderr" 'did not converge.*; use the default solver' "$program --solver newton"
    grep -q 'smaller cfl' "$work/stderr" && failed "$program --solver newton: cfl is no cure"
    parts=$(find "$work/newton" -name '*.part')
    [ -z "$parts" ] || failed "$program --solver newton leaves $parts"
done
say "bad options and a solver that fails: one message each"

# ---- what is printed and what is drawn ----
run porous_piston --particles 2e2 --out "$work/piston"
[ "$status" = 0 ] || failed "porous_piston: exit status $status"
shows "$work/stdout" ', 200 particles, ' "porous_piston --particles 2e2"
shows "$work/piston/porous_piston.png.gp" ', 200 particles, ' "porous_piston's picture"
run sedov --particles 500 --out "$work/sedov"
shows "$work/stdout" "^densest shell's mean, exact peak " sedov
if have gnuplot; then
    for words in 'sod --t-end 0' 'own_pass --t-end 0' 'rotating_body --turns 1e-6 --quiet' \
        'porous_piston --speed 0.01 --particles 20' 'sedov --particles 500 --t-end 1e-6' \
        'crush_cube --edge 4 --steps 4 --cycles 1'; do
        # shellcheck disable=SC2086
        run $words --out "$work/plain"
        [ "$status" = 0 ] || failed "$words: exit status $status"
        grep -i 'warning\|left out' "$work/stderr" && failed "$words: gnuplot complains"
    done
    "$work/examples/sod" --quiet --out "$work/sod" > "$work/both" 2>&1
    [ "$(tail -n 1 "$work/both")" = "drew $work/sod/sod.png" ] || failed "sod: a picture is drawn before all is printed"
else
    skip "pictures of the examples" "no gnuplot"
fi
say "pictures say what the programs say, and nothing is complained of"

# ---- the README's material has every key, and is the table's ----
# shellcheck disable=SC2016 # those are a fence of Markdown
sed -n '/^name = /,/^```/{/^```/!p;}' README.md > "$work/material.txt"
cat > "$work/material.c" << 'END'
#define SPHPA_EOS_IMPLEMENTATION
#include "sphpa.h"
int main(int argc, char **argv) {
    sphpa_material m, row = *sphpa_material_find("basalt");
    sphpa_error err;
    if (sphpa_material_read(argc > 1 ? argv[1] : "", &m, &err) != SPHPA_OK) return puts(err.message), 1;
    memset(m.name, 0, sizeof m.name);
    memset(row.name, 0, sizeof row.name);
    return memcmp(&m, &row, sizeof m) != 0;
}
END
$CC -std=c11 -I"$include" "$work/material.c" -o "$work/material" -lm || failed "the reader of a material does not build"
"$work/material" "$work/material.txt" || failed "the README's material is not read, or is not basalt"
echo 'every = 1' > "$work/no_such_key.txt"
for key in $("$work/material" "$work/no_such_key.txt" | sed 's/.*the keys are //; s/,//g'); do
    [ "$key" = like ] || grep -q "^$key = " "$work/material.txt" || failed "the README's material lacks the key $key"
done

# ---- a compiler that is not here: said before anything is looked for or installed ----
CC=no-such-cc sh tests/deps.sh impact > "$work/deps" 2>&1 && failed "deps.sh with CC=no-such-cc: exit status 0"
[ "$(wc -l < "$work/deps")" -eq 1 ] || failed "deps.sh with CC=no-such-cc: $(wc -l < "$work/deps") lines, not one"
shows "$work/deps" 'CC=no-such-cc: no such compiler here; give one that is' "deps.sh"
finish "the examples' command lines hold"
