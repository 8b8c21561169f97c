#!/bin/sh
# flags.sh: what this compiler and this machine have, as make variables on stdout.
#
# Every answer comes from a small program that was compiled, linked and run, never from a version
# number. The Makefile keeps the answers in build/flags.mk; everything compiled depends on that
# file, so another compiler, other flags or a library that appears cause a rebuild.
#
# Reads: CC, NATIVE=1, OPENMP=0, HDF5=0, GSL=0 (leave it out), HDF5_CFLAGS and HDF5_LIBS (a library
# in a place of its own), STAMP (any text that a rebuild shall depend on).
set -u
: "${CC:=cc}" "${NATIVE:=}" "${OPENMP:=}" "${HDF5:=}" "${GSL:=}" "${HDF5_CFLAGS:=}" "${HDF5_LIBS:=}" "${STAMP:=}"

dir=$(mktemp -d) || exit 1
trap 'rm -rf "$dir"' EXIT
trap 'exit 1' HUP INT TERM

# works FLAGS LIBS: does the program on stdin compile, link and run? ($CC may hold several words)
works() {
    cat > "$dir/probe.c"
    # shellcheck disable=SC2086
    $CC -std=c11 $1 "$dir/probe.c" -o "$dir/probe" $2 > /dev/null 2>&1 && "$dir/probe" > /dev/null 2>&1
}
empty() { echo 'int main(void) { return 0; }'; }
have() { command -v "$1" > /dev/null 2>&1; }
brew_prefix() { have brew && brew --prefix "$1" 2> /dev/null; }

# ---- OpenMP: threads, else only its vector loops, else nothing ----
probe_openmp() {
    openmp_flags='' openmp_libs=''
    [ "$OPENMP" = 0 ] && return
    openmp_program='#include <omp.h>
int main(void) { return omp_get_max_threads() < 1; }'
    if echo "$openmp_program" | works -fopenmp ''; then
        openmp_flags=-fopenmp
        return
    fi
    if [ "$(uname -s)" = Darwin ]; then # Apple's clang has the front end, Homebrew the library
        omp=$(brew_prefix libomp)
        if [ -n "$omp" ] && echo "$openmp_program" |
            works "-Xpreprocessor -fopenmp -isystem $omp/include" "-L$omp/lib -lomp"; then
            openmp_flags="-Xpreprocessor -fopenmp -isystem $omp/include"
            openmp_libs="-L$omp/lib -lomp"
            return
        fi
    fi
    empty | works '-Werror -fopenmp-simd' '' && openmp_flags='-fopenmp-simd -DSPHPA_USE_OMP_SIMD'
}

# ---- leaving out what nothing calls: GNU's linker, or Apple's ----
probe_gc() {
    gc_flags=''
    if empty | works '' -Wl,--gc-sections; then
        gc_flags=-Wl,--gc-sections
    elif empty | works '' -Wl,-dead_strip; then
        gc_flags=-Wl,-dead_strip
    fi
}

probe_native() {
    native_flags=''
    [ "$NATIVE" = 1 ] || return
    if empty | works -march=native ''; then
        native_flags=-march=native
    elif empty | works -mcpu=native ''; then
        native_flags=-mcpu=native
    fi
}

# the instructions that programs are compiled for which time things: what most machines have by now
probe_bench() {
    bench_flags=$native_flags
    [ -n "$bench_flags" ] && return
    echo 'int main(void) {
    __builtin_cpu_init();
    return !(__builtin_cpu_supports("avx2") && __builtin_cpu_supports("fma"));
}' | works -march=x86-64-v3 '' && bench_flags=-march=x86-64-v3
}

# ---- HDF5 ----
# try_hdf5 CFLAGS LIBS: as they are; where the loader does not find the library, with its directory
# as run path. -isystem: the strict warnings are about our code, not about the library's headers.
hdf5_program='#include <hdf5.h>
int main(void) { unsigned a, b, c; return H5get_libversion(&a, &b, &c) < 0; }'
try_hdf5() {
    cflags=$(echo "$1" | sed 's/-I */-isystem /g')
    for rpath in '' "$(echo "$2" | tr ' ' '\n' | sed -n 's/^-L/-Wl,-rpath,/p' | tr '\n' ' ')"; do
        if echo "$hdf5_program" | works "$cflags" "$2 $rpath"; then
            hdf5_found=yes hdf5_cflags=$cflags hdf5_libs="$2 $rpath"
            return 0
        fi
    done
    return 1
}
probe_hdf5() {
    hdf5_found='' hdf5_cflags='' hdf5_libs=''
    [ "$HDF5" = 0 ] && return
    if [ -n "$HDF5_LIBS" ]; then
        try_hdf5 "$HDF5_CFLAGS" "$HDF5_LIBS" && return
    fi
    for module in hdf5 hdf5-serial; do
        if have pkg-config && pkg-config --exists "$module" 2> /dev/null; then
            try_hdf5 "$(pkg-config --cflags "$module")" "$(pkg-config --libs "$module")" && return
        fi
    done
    for serial in /usr/lib/*/hdf5/serial; do # Debian and Ubuntu
        [ -d "$serial" ] && try_hdf5 '-I/usr/include/hdf5/serial' "-L$serial -lhdf5" && return
    done
    try_hdf5 '' -lhdf5 && return
    brewed=$(brew_prefix hdf5)
    [ -n "$brewed" ] && try_hdf5 "-I$brewed/include" "-L$brewed/lib -lhdf5" && return
    if have h5cc; then # prints a whole compiler call: keep what is a flag or an archive
        shown=$(h5cc -show 2> /dev/null | tr ' ' '\n')
        try_hdf5 "$(echo "$shown" | grep '^-[ID]' | tr '\n' ' ')" \
            "$(echo "$shown" | grep -E '^-[Ll]|^-Wl|\.(a|so|dylib)$' | tr '\n' ' ')"
    fi
}

# ---- cmocka ----
cmocka_program='#include <stdarg.h>
#include <stddef.h>
#include <setjmp.h>
#include <stdint.h>
#include <cmocka.h>
static void nothing(void **state) { (void)state; }
int main(void) { const struct CMUnitTest t[] = {cmocka_unit_test(nothing)}; return cmocka_run_group_tests(t, NULL, NULL); }'
try_cmocka() {
    echo "$cmocka_program" | works "$1" "$2" || return 1
    cmocka_found=yes cmocka_cflags=$1 cmocka_libs=$2
}
probe_cmocka() {
    cmocka_found='' cmocka_cflags='' cmocka_libs=''
    try_cmocka '' -lcmocka && return
    if have pkg-config && pkg-config --exists cmocka 2> /dev/null; then
        try_cmocka "$(pkg-config --cflags cmocka)" "$(pkg-config --libs cmocka)" && return
    fi
    brewed=$(brew_prefix cmocka)
    [ -n "$brewed" ] && try_cmocka "-isystem $brewed/include" "-L$brewed/lib -lcmocka"
}

# ---- GSL: its root finders are timed beside ours ----
gsl_program='#include <gsl/gsl_roots.h>
int main(void) { return gsl_root_fsolver_brent == 0; }'
try_gsl() {
    cflags=$(echo "$1" | sed 's/-I */-isystem /g')
    echo "$gsl_program" | works "$cflags" "$2" || return 1
    gsl_found=yes gsl_cflags=$cflags gsl_libs=$2
}
probe_gsl() {
    gsl_found='' gsl_cflags='' gsl_libs=''
    [ "$GSL" = 0 ] && return
    try_gsl '' '-lgsl -lgslcblas -lm' && return
    if have pkg-config && pkg-config --exists gsl 2> /dev/null; then
        try_gsl "$(pkg-config --cflags gsl)" "$(pkg-config --libs gsl)" && return
    fi
    brewed=$(brew_prefix gsl)
    [ -n "$brewed" ] && try_gsl "-isystem $brewed/include" "-L$brewed/lib -lgsl -lgslcblas -lm"
}

compiler=''
empty | works '' '' && compiler=yes
probe_openmp
probe_gc
probe_native
probe_bench
probe_hdf5
probe_cmocka
probe_gsl
cat << END
# written by tests/flags.sh: what was found here
COMPILER_WORKS := $compiler
COMPILER_NAME := $($CC --version 2> /dev/null | head -n 1 | tr -d '#$')
OPENMP_CFLAGS := $openmp_flags
OPENMP_LIBS := $openmp_libs
GC_FLAGS := $gc_flags
NATIVE_FLAGS := $native_flags
BENCH_FLAGS := $bench_flags
HDF5_FOUND := $hdf5_found
HDF5_FOUND_CFLAGS := $hdf5_cflags
HDF5_FOUND_LIBS := $hdf5_libs
CMOCKA_FOUND := $cmocka_found
CMOCKA_CFLAGS := $cmocka_cflags
CMOCKA_LIBS := $cmocka_libs
GSL_FOUND := $gsl_found
GSL_CFLAGS := $gsl_cflags
GSL_LIBS := $gsl_libs
STAMP_SEEN := $STAMP
END
