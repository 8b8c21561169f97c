#!/bin/sh
# check_sanitizers.sh: all tests once with AddressSanitizer and UndefinedBehaviorSanitizer, on two threads each;
# those that need no HDF5 once with MemorySanitizer, too, which finds reads of what was never set.
# SPHPA_VALIDATE_ARRAYS turns on the checks of whole arrays.
# shellcheck source=tests/lib.sh
. "$(dirname "$0")/lib.sh"

has() { # has COMPILER FLAGS: does it make a program with this sanitizer that runs?
    # shellcheck disable=SC2086 # words
    have "${1%% *}" && $1 $2 "$work/probe.c" -o "$work/probe" 2> /dev/null && "$work/probe"
}
must_fail() { # must_fail COMPILER FLAGS KIND: the program KIND.c has the error that this sanitizer is for
    # shellcheck disable=SC2086
    $1 -w $2 "$work/$3.c" -o "$work/$3.bad" && "$work/$3.bad" > /dev/null 2>&1 && failed "$3 sanitizer lets an error pass"
}
has_cmocka() { [ -n "$(value CMOCKA_FOUND "$(found_for "$1")")" ]; }
options='-O1 -g1 -fno-omit-frame-pointer'

printf '#include <stdlib.h>\nint main(void) { void *p = malloc(8); free(p); return 0; }\n' > "$work/probe.c"
# they must be able to fail: one bad program each
printf '#include <stdlib.h>\nint main(int n, char **v) { (void)v; char *p = malloc((size_t)n); p[n] = 1; free(p); return 0; }\n' > "$work/address.c"
printf '#include <limits.h>\nint main(int n, char **v) { (void)v; int x = INT_MAX; x += n; return x == 0; }\n' > "$work/undefined.c"
printf 'struct curve { int kind, n; };\nstatic void prepare(struct curve *c, int kind) { c->kind = kind; if (kind != 1) c->n = 1; }\nint main(int n, char **v) { struct curve c; (void)v; prepare(&c, n); if (c.n == 7) c.kind = 0; return c.kind == 3; }\n' > "$work/memory.c"

# ---- addresses and undefined behaviour ----
address_and_undefined() {
    flags='-fsanitize=address,undefined -fno-sanitize-recover=all'
    for sanitizing in gcc clang "$CC" ''; do has "$sanitizing" "$flags" && break; done
    [ -n "$sanitizing" ] || { skip "sanitizers" "no compiler has their runtime"; return; }
    has_cmocka "$sanitizing" || { skip "sanitizers" "no cmocka"; return; }
    for kind in address undefined; do must_fail "$sanitizing" "$flags" $kind; done
    say "$sanitizing $flags, tests at their smaller size (SPHPA_TEST_SMALL)"
    run_tests address -DSPHPA_VALIDATE_ARRAYS CC="$sanitizing" CFLAGS="$options $flags" LDFLAGS="$flags"
}

# ---- memory that was never set: clang alone looks for it ----
# What a library sets that was not compiled so counts as unset. cmocka and libm get along with that;
# HDF5 and OpenMP do not.
memory() {
    flags='-fsanitize=memory -fno-sanitize-recover=all'
    for sanitizing in clang "$CC" ''; do has "$sanitizing" "$flags" && break; done
    [ -n "$sanitizing" ] || { skip "memory sanitizer" "no clang with its runtime"; return; }
    has_cmocka "$sanitizing" || { skip "memory sanitizer" "no cmocka"; return; }
    must_fail "$sanitizing" "$flags" memory
    say "$sanitizing $flags, the same without HDF5 and OpenMP"
    run_tests memory -DSPHPA_VALIDATE_ARRAYS OPENMP=0 HDF5=0 CC="$sanitizing" CFLAGS="$options $flags" LDFLAGS="$flags"
}

address_and_undefined
memory
finish "no error in what was run"
