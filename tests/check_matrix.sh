#!/bin/sh
# check_matrix.sh: sphpa.h compiles without one warning in every way in which it may be included:
# each section alone, all, none; C11 and C++11; gcc and clang; double and float; with and without
# OpenMP; static or not; once or twice; in one unit or in two. Where only warnings are wanted the compilers
# look at the text alone; one of them makes objects of it, too, which tell whether all is there that a
# section calls. Optimised builds take half a minute each: not each with each compiler. Jobs run side by side.
# shellcheck source=tests/lib.sh
. "$(dirname "$0")/lib.sh"

# ---- the compilers ----
# language NAME: the flags and the strict warnings of c or c++
flags_of() {
    case $1 in
    c) echo "-x c -std=c11 $strict -Wstrict-prototypes" ;;
    c++) echo "-x c++ -std=c++11 $strict" ;;
    esac | tr '\n' ' '
}
compilers='' # words COMPILER:LANGUAGE
for pair in gcc:c g++:c++ clang++:c++ clang:c; do # an order that turn() relies on
    if have "${pair%:*}"; then compilers="$compilers $pair"; else skip "${pair%:*}" "not found"; fi
done
if [ -z "$compilers" ]; then
    compilers="$CC:c"
    say "only $CC is here"
fi
first=${compilers# }
first=${first%% *}
cc=${first%:*} # the one for what needs to be done only once
maker=$cc # the one whose objects of single sections are looked into; clang needs half of gcc's time
have clang && maker=clang
case $first in *:c++) failed "no C compiler among:$compilers" ;; esac

found=$(found_for "$cc")
hdf5_cflags=$(value HDF5_FOUND_CFLAGS "$found")
has_hdf5=$(value HDF5_FOUND "$found")
[ -z "$has_hdf5" ] && skip ">>snapshot" "no HDF5"
openmp_of() { # -fopenmp, where the compiler has it
    printf '#include <omp.h>\nint main(void) { return 0; }\n' > "$work/omp.c"
    # shellcheck disable=SC2046
    "$1" $([ "$2" = c++ ] && echo -x c++) -fopenmp "$work/omp.c" -o "$work/omp" 2> /dev/null && echo -fopenmp
}

# ---- the sources ----
all=$(sections)
[ -n "$all" ] || failed "the header has no section: nothing to compile"
everything='-DSPHPA_IMPLEMENTATION'
[ -n "$has_hdf5" ] && everything="$everything -DSPHPA_SNAPSHOT_IMPLEMENTATION"
printf '#include "sphpa.h"\n' > "$work/once.c"
# before, with and after the macro; then one section more, then the same again
cat > "$work/twice.c" << 'END'
#include "sphpa.h"
#include "sphpa.h"
#define SPHPA_KERNEL_IMPLEMENTATION
#include "sphpa.h"
#include "sphpa.h"
#define SPHPA_IMPLEMENTATION
#include "sphpa.h"
#include "sphpa.h"
END
# two units of one program; main says by its status whether the calls answer
cat > "$work/main.c" << 'END'
#include "sphpa.h"
const char *other(void);
int main(void) {
    return sphpa_result_message(SPHPA_OK)[0] == other()[0] ? 0 : 1;
}
END
cat > "$work/other.c" << 'END'
#include "sphpa.h"
const char *other(void);
const char *other(void) { return sphpa_result_message(SPHPA_OK); }
END

# ---- jobs: a file each; its first line names it ----
mkdir "$work/jobs" || exit 1
count=0
job() { # job NAME COMMANDS: a job fails when one of its commands does or when it prints anything
    count=$((count + 1))
    printf '# %s\nset -e\n%s\n' "$1" "$2" > "$work/jobs/$(printf %04d $count).sh"
}
# unit NAME COMPILER LANGUAGE FLAGS OUTPUT: one unit
unit() { job "$1" "$2 $(flags_of "$3") $4 $hdf5_cflags -I'$include' $5 '$work/once.c'"; }
# text NAME COMPILER LANGUAGE FLAGS: its warnings, without an object. clang sees all that it would say at
# -O0; gcc says nothing of static functions that nobody calls, which clang and the objects below do.
text() { unit "$@" -fsyntax-only; }
# object NAME COMPILER LANGUAGE FLAGS: compiled as well
object() { unit "$@" "-o '$work/jobs/$((count + 1)).o' -c"; }
# alone NAME COMPILER ..: everything that the section calls must be there
alone() {
    [ "$2" = "$maker" ] || { text "$@"; return; }
    object "$@"
    have nm && cat >> "$work/jobs/$(printf %04d $count).sh" << END
if nm -u '$work/jobs/$count.o' | grep 'sphpa_'; then echo 'is used but not there: the closure block misses something'; exit 1; fi
END
}
# What takes long goes round the compilers: way NUMBER to every COUNTth of them; of gcc and clang each the
# C or the C++ one takes it with a COUNT of 2, one of the four with 4.
compilers_n=$(echo "$compilers" | wc -w)
turn() { # turn NUMBER COUNT: is it this compiler's turn?
    every=$(($2 < compilers_n ? $2 : compilers_n))
    [ $(($1 % every)) = $((compiler_i % every)) ]
}
compiler_i=-1
for pair in $compilers; do
    compiler=${pair%:*} language=${pair##*:}
    compiler_i=$((compiler_i + 1))
    openmp=$(openmp_of "$compiler" "$language")
    [ -n "$openmp" ] || skip "OpenMP builds with $compiler" "it has no OpenMP"
    for threads in '' $openmp; do
        for real in '' -DSPHPA_FLOAT; do
            how="$compiler $language -O0 $threads $real"
            flags="-O0 $threads $real"
            text "$how, declarations only" "$compiler" "$language" "$flags"
            text "$how, base" "$compiler" "$language" "$flags -DSPHPA_BASE_IMPLEMENTATION"
            way=0
            for section in $all; do # plain ones by every compiler
                way=$((way + 1))
                [ "$section" = "$outside" ] && [ -z "$has_hdf5" ] && continue
                [ -z "$threads$real" ] || turn $way 2 || continue
                alone "$how, $section alone" "$compiler" "$language" "$flags -DSPHPA_$(capitals "$section")_IMPLEMENTATION"
            done
            alone "$how, all" "$compiler" "$language" "$flags $everything"
            text "$how, all, static" "$compiler" "$language" "$flags $everything -DSPHPA_STATIC"
        done
    done
    way=0
    for optimised in "-O2 $openmp" "-O3 $openmp" '-O2 -DSPHPA_FLOAT'; do # other warnings come with what is inlined
        way=$((way + 1))
        turn $way 2 || continue
        object "$compiler $language $optimised, all" "$compiler" "$language" "$optimised $everything"
    done
    wide=-march=x86-64-v3
    echo 'int main(void) { return 0; }' > "$work/wide.c"
    "$compiler" $wide -c "$work/wide.c" -o "$work/wide.o" 2> /dev/null || wide=''
    way=0
    # other lanes of the pair loops; in this order gcc and clang see each
    for vectors in -DSPHPA_NO_VECTORS "$wide -DSPHPA_FLOAT" '-DSPHPA_NO_VECTORS -DSPHPA_FLOAT' "$wide"; do
        turn $way 4 && object "$compiler $language -O2 $vectors, all" "$compiler" "$language" "-O2 $vectors $everything"
        way=$((way + 1))
    done
    for section in $all; do # what somebody drops into another program: one section, static
        [ "$section" = "$outside" ] && [ -z "$has_hdf5" ] && continue
        alone "$compiler $language static, $section alone" "$compiler" "$language" "-O0 -DSPHPA_STATIC -DSPHPA_$(capitals "$section")_IMPLEMENTATION"
    done
    text "$compiler $language -fopenmp-simd, all" "$compiler" "$language" "-O0 -fopenmp-simd -DSPHPA_USE_OMP_SIMD $everything"

    build="$compiler $(flags_of "$language") $hdf5_cflags -I'$include' -O0"
    d="$work/jobs/$compiler"
    job "$compiler $language: included twice" "$build -fsyntax-only '$work/twice.c'"
    # static declarations without bodies can only be a mistake: refused with the cure
    job "$compiler $language: static without a section is refused" "
if $build -DSPHPA_STATIC -c '$work/once.c' -o '$d.refused.o' 2> '$d.refused'; then echo 'it compiles'; exit 1; fi
grep -q 'error.*sphpa: SPHPA_STATIC without' '$d.refused' || { cat '$d.refused'; exit 1; }"
    job "$compiler $language: static in two units of one program" "
$build -DSPHPA_STATIC -DSPHPA_IMPLEMENTATION -c '$work/main.c' -o '$d.s1.o'
$build -DSPHPA_STATIC -DSPHPA_IMPLEMENTATION -c '$work/other.c' -o '$d.s2.o'
$compiler '$d.s1.o' '$d.s2.o' -o '$d.static' -lm
'$d.static'"
    job "$compiler $language: two units, the bodies in one" "
$build -DSPHPA_IMPLEMENTATION -c '$work/main.c' -o '$d.p1.o'
$build -c '$work/other.c' -o '$d.p2.o'
$compiler '$d.p1.o' '$d.p2.o' -o '$d.plain' -lm
'$d.plain'"
    if [ "$language" = c++ ] && [ "$cc" != "$compiler" ]; then
        job "$compiler: C++ that calls bodies compiled as C" "
$cc -std=c11 -I'$include' -DSPHPA_IMPLEMENTATION -c '$work/once.c' -o '$d.c.o'
$build -c '$work/main.c' -o '$d.m.o'
$build -c '$work/other.c' -o '$d.o.o'
$compiler '$d.c.o' '$d.m.o' '$d.o.o' -o '$d.mixed' -lm
'$d.mixed'"
    fi
done

# ---- run them ----
cat > "$work/run_job" << 'END'
log=${1%.sh}.log
sh "$1" > "$log" 2>&1 && [ ! -s "$log" ] && exit 0
echo failed > "${1%.sh}.failed"
END
say "$count builds with:$compilers, $JOBS at a time"
find "$work/jobs" -name '*.sh' | sort | xargs -n 1 -P "$JOBS" sh "$work/run_job"
bad=0
for mark in "$work"/jobs/*.failed; do
    [ -f "$mark" ] || continue
    bad=$((bad + 1))
    [ $bad -gt 10 ] && continue
    failed "$(sed -n '1s/^# //p' "${mark%.failed}.sh" | tr -s ' ')"
    [ $bad -gt 3 ] || head -n 8 "${mark%.failed}.log" # most often all say the same
done
[ $bad -gt 10 ] && failed "and $((bad - 10)) builds more (see $work/jobs/*.log)"

# ---- a program in float does not link with bodies in double, nor the other way round ----
# A unit takes the address of one function that touches state; its name is found in the float object.
if have nm && [ $bad = 0 ]; then
    for real in double float; do
        flag=''
        [ $real = float ] && flag=-DSPHPA_FLOAT
        # shellcheck disable=SC2086
        $cc -std=c11 $flag -I"$include" -DSPHPA_IMPLEMENTATION -c "$work/once.c" -o "$work/$real.o" || failed "no $real object"
    done
    renamed=$(symbols "$work/float.o" | sed -n 's/_f32$//p' | head -n 1)
    if [ -n "$renamed" ]; then
        printf '#include "sphpa.h"\nvoid (*volatile call)(void) = (void (*)(void))%s;\nint main(void) { return call == 0; }\n' "$renamed" > "$work/user.c"
        for user in double float; do
            flag=''
            [ $user = float ] && flag=-DSPHPA_FLOAT
            # shellcheck disable=SC2086
            $cc -std=c11 -w $flag -I"$include" -c "$work/user.c" -o "$work/user_$user.o" || failed "no $user user"
            for bodies in double float; do
                if $cc "$work/user_$user.o" "$work/$bodies.o" -o "$work/linked" -lm > "$work/link.log" 2>&1; then
                    [ $user = $bodies ] || failed "a $user unit that calls $renamed links with $bodies bodies"
                elif [ $user = $bodies ]; then
                    failed "a $user unit that calls $renamed does not link with $bodies bodies:"
                    head -n 5 "$work/link.log"
                elif ! grep -q "$renamed" "$work/link.log"; then
                    failed "a $user unit and $bodies bodies fail to link, but not for $renamed:"
                    head -n 5 "$work/link.log"
                fi
            done
        done
        [ $failures = 0 ] && say "float and double do not link together ($renamed)"
    elif sections | grep -q '^particles$'; then
        failed "no function of the float build ends in _f32: float and double would link together"
    fi
fi

# ---- the allocator: all three or none ----
if have "$cc"; then
    echo '#include "sphpa.h"' > "$work/alloc.c"
    if $cc -std=c11 -I"$include" -DSPHPA_MALLOC=malloc -DSPHPA_IMPLEMENTATION -c "$work/alloc.c" -o "$work/alloc.o" 2> "$work/alloc.log"; then
        failed "SPHPA_MALLOC alone, without _REALLOC and _FREE, compiles"
    elif ! grep -q 'all three or none' "$work/alloc.log"; then
        failed "SPHPA_MALLOC alone: not told so:"
        head -n 3 "$work/alloc.log"
    fi
fi
[ $failures = 0 ] && rm -rf "$work/jobs" # some hundred objects
finish "$count builds without a warning"
