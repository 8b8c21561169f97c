#!/bin/sh
# check_float.sh: the tests once with the particles' state in single precision. Bounds that depend on it
# are FINE(in double, in float) of tests/near.h. A test that knows no precision is of code that has none.
# shellcheck source=tests/lib.sh
. "$(dirname "$0")/lib.sh"

[ -n "$(value CMOCKA_FOUND "$(found_for "$CC")")" ] || { skip "tests in float" "no cmocka"; finish "not run"; }
aware=$(grep -l 'FINE(\|sphpa_real\|SPHPA_R(' tests/test_*.c | tr '\n' ' ')
say "tests with REAL=float, at their smaller size (SPHPA_TEST_SMALL): $aware"
run_tests float '' ONLY="$aware" REAL=float CC="$CC" CFLAGS=-O1
finish "the tests hold in single precision"
