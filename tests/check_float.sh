#!/bin/sh
# check_float.sh: all tests once with the particles' state in single precision. Bounds that depend on it
# are FINE(in double, in float) of tests/near.h.
# shellcheck source=tests/lib.sh
. "$(dirname "$0")/lib.sh"

[ -n "$(value CMOCKA_FOUND "$(found_for "$CC")")" ] || { skip "tests in float" "no cmocka"; finish "not run"; }
say "tests with REAL=float, at their smaller size (SPHPA_TEST_SMALL)"
run_tests float '' REAL=float CC="$CC" CFLAGS=-O1
finish "the tests hold in single precision"
