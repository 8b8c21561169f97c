# shellcheck shell=sh
# lib.sh: what the checks share; sourced, by scripts that stand beside it. POSIX sh.
#
# A check is a script tests/check_*.sh. It is run from the top of the project,
# prints what it did, and exits with 0 (good), 77 (skipped as a whole) or anything else (failed).
#   HEADER          the header to check (sphpa.h); another one lets a check be tried on a spoilt copy
#   BUILD           where generated files go (build)
#   CHECK_STRICT=1  a skip is a failure (so is CI set to anything but false)
#   CHECK_SKIPS     a file that collects what was skipped, for the last line of `make check`
set -u
cd "$(dirname "$0")/.." || exit 1

: "${HEADER:=sphpa.h}" "${BUILD:=build}" "${CHECK_STRICT:=}" "${CHECK_SKIPS:=/dev/null}" "${CC:=cc}"
: "${MAKE:=make}"
[ -n "${CI:-}" ] && [ "${CI:-}" != false ] && CHECK_STRICT=1
: "${JOBS:=$(getconf _NPROCESSORS_ONLN 2> /dev/null || echo 2)}"
# shellcheck disable=SC2034 # all of these are for the scripts that source this file
{
    check=$(basename "$0" .sh)
    check=${check#check_}
    include=$(cd "$(dirname "$HEADER")" && pwd)
    strict='-Wall -Wextra -Wpedantic -Wconversion -Wsign-conversion -Wshadow -Wundef
-Wdouble-promotion -Wcast-qual -Werror'
    outside=snapshot # the sections that need an outside library: never implied by SPHPA_IMPLEMENTATION
}
work=$BUILD/check/$check
rm -rf "$work"
mkdir -p "$work" || exit 1

say() { echo "$check: $*"; }
failures=0
failed() { echo "$check: FAILED: $*"; failures=$((failures + 1)); }
skip() { # skip WHAT WHY
    echo "$check: skipped: $1 ($2)"
    echo "$1 ($2)" >> "$CHECK_SKIPS"
    [ "$CHECK_STRICT" = 1 ] && failed "nothing may be skipped here (CHECK_STRICT): $1"
}
finish() { # finish SUMMARY: the last line of a check
    if [ "$failures" -gt 0 ]; then
        echo "$check: FAILED, $failures of its findings are above"
        exit 1
    fi
    say "$*"
    exit 0
}
have() { command -v "$1" > /dev/null 2>&1; }

[ -f "$HEADER" ] || { failed "there is no $HEADER"; exit 1; }

# what flags.sh found for the compiler $1: lines NAME := value
found_for() { CC=$1 sh tests/flags.sh; }
value() { echo "$2" | sed -n "s/^$1 := //p"; } # value NAME "lines"

# the sections that have an implementation, in the header's order; base is always there
sections() { awk -f tests/header.awk "$HEADER" | awk '$1 == "impl" && $2 != "base" { print $2 }'; }
capitals() { echo "$1" | tr '[:lower:]' '[:upper:]'; }

# run_tests FOLDER EXTRA_CFLAGS VARIABLE=value..: all tests, built into that folder of $work;
# SPHPA_TEST_SMALL makes the long ones smaller
run_tests() {
    folder=$work/$1
    mkdir -p "$folder"
    extra="-DSPHPA_TEST_SMALL $2"
    shift 2
    $MAKE --no-print-directory INNER=1 BUILD="$folder" -j"$JOBS" EXTRA_CFLAGS="$extra" "$@" tests-run \
        > "$folder/log" 2>&1 || {
        failed "see $folder/log; its errors:"
        grep -E -B 1 -A 6 '^=+[0-9]+=+(ERROR|WARNING): |runtime error: |^\[  FAILED  |error: ' "$folder/log" | head -n 60
    }
    grep -E '^(skipped|programs): ' "$folder/log"
}

# global symbols that an object or program defines, one a line (macOS puts an underscore in front)
symbols() { nm -g "$1" | awk 'NF == 3 && $2 ~ /^[A-TV-Z]$/ { print $3 }' | plain_symbols; }
undefined_symbols() { nm -u "$1" | awk '{ print $NF }' | plain_symbols; }
plain_symbols() { if [ "$(uname -s)" = Darwin ]; then sed 's/^_//'; else cat; fi; }

# ---- a program's command line: its script says how it is run: run ARGUMENTS.. sets $status and makes the
# files stdout and stderr in $work ----
lines() { wc -l < "$1" | tr -d ' '; }
shows() { # shows FILE PATTERN WHAT
    grep -Eq -e "$2" "$1" || { failed "$3: no line like \"$2\" in:"; head -n 5 "$1"; }
}
refused() { # refused STATUS PATTERN ARGUMENTS..: ends so, with one line on stderr and none on stdout
    wanted=$1 pattern=$2
    shift 2
    run "$@"
    [ "$status" = "$wanted" ] || failed "$*: exit status $status, not $wanted"
    [ "$(lines "$work/stderr")" = 1 ] || failed "$*: $(lines "$work/stderr") lines on stderr, not one"
    [ -s "$work/stdout" ] && failed "$*: prints something although it is refused"
    shows "$work/stderr" "$pattern" "$*"
    refusals=$((refusals + 1))
}
no_parts() { # no_parts FOLDER
    parts=$(find "$1" -name '*.part')
    [ -z "$parts" ] || failed "left behind: $parts"
}
refusals=0
