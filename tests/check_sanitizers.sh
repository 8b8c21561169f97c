#!/bin/sh
# check_sanitizers.sh: all tests once with AddressSanitizer and UndefinedBehaviorSanitizer, on two threads.
# SPHPA_VALIDATE_ARRAYS turns on the checks of whole arrays.
# shellcheck source=tests/lib.sh
. "$(dirname "$0")/lib.sh"

flags='-fsanitize=address,undefined -fno-sanitize-recover=all'
sanitizing=''
printf '#include <stdlib.h>\nint main(void) { void *p = malloc(8); free(p); return 0; }\n' > "$work/probe.c"
for compiler in gcc clang "$CC"; do
    # shellcheck disable=SC2086
    if have "${compiler%% *}" && $compiler $flags "$work/probe.c" -o "$work/probe" 2> /dev/null && "$work/probe"; then
        sanitizing=$compiler
        break
    fi
done
[ -n "$sanitizing" ] || { skip "sanitizers" "no compiler has their runtime"; finish "not run"; }
[ -n "$(value CMOCKA_FOUND "$(found_for "$sanitizing")")" ] || { skip "sanitizers" "no cmocka"; finish "not run"; }

# they must be able to fail: one bad program each
printf '#include <stdlib.h>\nint main(int n, char **v) { (void)v; char *p = malloc((size_t)n); p[n] = 1; free(p); return 0; }\n' > "$work/address.c"
printf '#include <limits.h>\nint main(int n, char **v) { (void)v; int x = INT_MAX; x += n; return x == 0; }\n' > "$work/undefined.c"
for kind in address undefined; do
    # shellcheck disable=SC2086
    $sanitizing -w $flags "$work/$kind.c" -o "$work/$kind" && "$work/$kind" > /dev/null 2>&1 && failed "$kind sanitizer lets an error pass"
done

say "$sanitizing $flags, tests at their smaller size (SPHPA_TEST_SMALL)"
run_tests -DSPHPA_VALIDATE_ARRAYS CC="$sanitizing" CFLAGS="-O1 -g -fno-omit-frame-pointer $flags" LDFLAGS="$flags"
finish "no error"
