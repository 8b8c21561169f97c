#!/bin/sh
# deps.sh impact|test|bench|tutorials|book|check: installs what that task needs and the machine lacks.
#
#   impact   a C11 compiler; HDF5 (snapshots), gnuplot (pictures) and OpenMP are optional
#   test     a C11 compiler and cmocka; HDF5 is optional (its own tests need it)
#   bench    a C11 compiler; GSL (solvers to compare with), gnuplot, HDF5 and OpenMP are optional
#   tutorials  a C11 compiler; gnuplot is optional (the chapters' pictures)
#   book     pandoc; a font for formulas is optional
#   check    everything that `make check` uses: both compilers, sanitizers, the snapshot's readers
#
# Says what it does. Installs as root or with a password-less sudo, never asks; without the right
# to, it prints the one command that will. NO_INSTALL=1 never installs.
# Exit status: 0 when what is required is there (CHECK_STRICT=1: when everything is), else 1.
set -u
cd "$(dirname "$0")/.." || exit 1
: "${NO_INSTALL:=}" "${CHECK_STRICT:=}" "${CC:=cc}"
export CC
task=${1:-}
case $task in
impact) required='compiler' optional='openmp hdf5 gnuplot' ;;
test) required='compiler cmocka' optional='openmp hdf5' ;;
bench) required='compiler' optional='openmp hdf5 gnuplot gsl' ;;
tutorials) required='compiler' optional='gnuplot' ;;
book) required='pandoc' optional='math-font' ;;
check) required='compiler cmocka'
    optional='openmp hdf5 gnuplot gsl gcc g++ clang clang-openmp sanitizers memory-sanitizer nm'
    optional="$optional h5py yt vtk" ;;
*) echo "usage: $0 impact|test|bench|tutorials|book|check" >&2; exit 2 ;;
esac

# what you leave out on purpose is not missing
[ "${OPENMP:-}" = 0 ] && optional=$(echo " $optional " | sed 's/ openmp / /')
[ "${HDF5:-}" = 0 ] && optional=$(echo " $optional " | sed 's/ hdf5 / /')
[ "${GSL:-}" = 0 ] && optional=$(echo " $optional " | sed 's/ gsl / /')

say() { echo "deps: $*"; }
have() { command -v "$1" > /dev/null 2>&1; }

# ---- what is there ----
runs() { # runs COMPILER FLAGS..: does it make a program that runs?
    have "$1" || return 1
    probe_dir=$(mktemp -d) || return 1
    printf '#ifdef _OPENMP\n#include <omp.h>\n#endif\nint main(void) { return 0; }\n' > "$probe_dir/p.c"
    "$@" "$probe_dir/p.c" -o "$probe_dir/p" > /dev/null 2>&1 && "$probe_dir/p" > /dev/null 2>&1
    probe_status=$?
    rm -rf "$probe_dir"
    return $probe_status
}
look() { found=$(sh tests/flags.sh); } # one look for what the Makefile will find
seen() { echo "$found" | grep -q "^$1 := ."; }
# a module counts where `make check` will look for it: in the interpreter that python.sh chooses
module() {
    python=$(sh tests/python.sh) &&
        "$python" -c "import importlib.util as u, sys; sys.exit(u.find_spec('$1') is None)" 2> /dev/null
}
there() {
    case $1 in
    compiler) seen COMPILER_WORKS ;;
    openmp) echo "$found" | grep -q '^OPENMP_CFLAGS := .*-fopenmp\( \|$\)' ;;
    hdf5) seen HDF5_FOUND ;;
    cmocka) seen CMOCKA_FOUND ;;
    gsl) seen GSL_FOUND ;;
    gnuplot | pandoc) have "$1" ;;
    gcc | clang) runs "$1" ;;
    g++) runs g++ -x c++ ;;
    clang-openmp) runs clang -fopenmp ;;
    sanitizers) runs gcc -fsanitize=address,undefined || runs clang -fsanitize=address,undefined ;;
    memory-sanitizer) runs clang -fsanitize=memory ;;
    math-font) find /usr/share /usr/local/share -name latinmodern-math.otf 2> /dev/null | grep -q . ;;
    nm) have nm && have strip ;;
    h5py) module h5py ;;
    yt) module yt ;;
    vtk) module vtkmodules ;;
    esac
}
list_missing() { for thing; do there "$thing" || printf '%s ' "$thing"; done; }

# ---- what it is called ----
find_manager() {
    for manager in apt-get dnf pacman brew; do have "$manager" && return; done
    manager=''
}
packages() {
    case $manager:$1:$CC in # $CC decides which compiler, and whose OpenMP
    apt-get:compiler:*clang* | apt-get:openmp:*clang*) echo clang libomp-dev libc6-dev; return ;;
    dnf:compiler:*clang* | dnf:openmp:*clang*) echo clang libomp-devel; return ;;
    pacman:compiler:*clang* | pacman:openmp:*clang*) echo clang openmp; return ;;
    esac
    case $1:$CC in *:cc | *:gcc) ;; compiler:* | openmp:*) return ;; esac # a compiler of your own
    case $manager:$1 in # where nothing is said, the package has the thing's own name
    apt-get:compiler | apt-get:gcc | apt-get:openmp) echo gcc libc6-dev ;;
    apt-get:hdf5) echo libhdf5-dev ;;
    apt-get:cmocka) echo libcmocka-dev ;;
    apt-get:gnuplot) echo gnuplot-nox ;;
    apt-get:gsl) echo libgsl-dev ;;
    apt-get:math-font) echo fonts-lmodern ;;
    apt-get:clang-openmp) echo libomp-dev ;;
    apt-get:sanitizers) echo gcc libclang-rt-dev ;;
    apt-get:memory-sanitizer) echo clang libclang-rt-dev ;;
    apt-get:nm) echo binutils ;;
    apt-get:h5py) echo python3-h5py ;;
    apt-get:yt) echo python3-yt ;;
    apt-get:vtk) echo python3-vtk9 ;;
    dnf:compiler | dnf:gcc) echo gcc ;;
    dnf:g++) echo gcc-c++ ;;
    dnf:openmp) echo libgomp ;;
    dnf:hdf5) echo hdf5-devel ;;
    dnf:cmocka) echo libcmocka-devel ;;
    dnf:gsl) echo gsl-devel ;;
    dnf:math-font) echo texlive-lm-math ;;
    dnf:clang-openmp) echo libomp-devel ;;
    dnf:sanitizers) echo libasan libubsan ;;
    dnf:memory-sanitizer) echo clang compiler-rt ;;
    dnf:nm) echo binutils ;;
    dnf:h5py) echo python3-h5py ;;
    dnf:yt) echo python3-yt ;;
    dnf:vtk) echo python3-vtk ;;
    pacman:compiler | pacman:gcc | pacman:g++ | pacman:openmp | pacman:sanitizers) echo gcc ;;
    pacman:clang-openmp) echo openmp ;;
    pacman:memory-sanitizer) echo clang compiler-rt ;;
    pacman:math-font) echo otf-latinmodern-math ;;
    pacman:nm) echo binutils ;;
    pacman:h5py) echo python-h5py ;;
    pacman:yt) echo python-yt ;;
    pacman:vtk) echo vtk ;;
    brew:compiler | brew:clang | brew:nm | brew:*sanitizer*) : ;; # Xcode's: see below
    brew:openmp | brew:clang-openmp) echo libomp ;;
    brew:gcc | brew:g++) echo gcc ;;
    brew:h5py | brew:yt) : ;;
    brew:math-font) echo font-latin-modern-math ;;
    *) echo "$1" ;;
    esac
}
all_packages() { for thing; do packages "$thing"; done | tr ' ' '\n' | sort -u | tr '\n' ' '; }

refresh() { # apt alone forgets what exists; the others refresh by themselves
    say "running: ${sudo}apt-get update"
    # shellcheck disable=SC2086 # no word, or two
    ${sudo}apt-get update || say "apt-get update failed: going on with the lists that are here"
    refreshed=yes
}
known() { # of these packages, those that the manager can install
    for package; do
        case $manager in
        apt-get) apt-cache policy "$package" 2> /dev/null | grep -q 'Candidate: [^(]' ;;
        dnf) dnf -q list "$package" > /dev/null 2>&1 ;;
        pacman) pacman -Si "$package" > /dev/null 2>&1 ;;
        brew) brew info "$package" > /dev/null 2>&1 ;;
        esac && printf '%s ' "$package"
    done
}
# the command of each manager that installs without a question
command_for() {
    case $manager in
    apt-get) echo "apt-get install -y --no-install-recommends $*" ;;
    dnf) echo "dnf install -y $*" ;;
    pacman) echo "pacman -S --needed --noconfirm $*" ;;
    brew) echo "brew install $*" ;;
    esac
}
run_install() {
    say "running: $sudo$(command_for "$@")"
    # shellcheck disable=SC2046,SC2086 # the words of the command
    $sudo$environment $(command_for "$@")
}

install() { # install PACKAGES..
    wanted=$*
    if [ "$manager" = apt-get ]; then
        # no lists at all, or lists that do not know a package: ask for new ones, once
        # shellcheck disable=SC2086
        [ "$(known $wanted | wc -w)" -eq $# ] || refresh
    fi
    # shellcheck disable=SC2086
    wanted=$(known $wanted)
    [ -n "$wanted" ] || { say "$manager knows none of: $*"; return; }
    # shellcheck disable=SC2086
    run_install $wanted && return
    if [ "$manager" = apt-get ] && [ -z "$refreshed" ]; then # lists from before an update of the archive
        refresh
        # shellcheck disable=SC2086
        run_install $wanted && return
    fi
    say "that failed; trying one package at a time"
    for package in $wanted; do run_install "$package" || say "could not install $package"; done
}

# ---- what goes without, and what does not ----
without() {
    case $1 in
    compiler) echo "a C11 compiler ($CC) is required" ;;
    cmocka) echo "cmocka is required: the tests are written with it" ;;
    pandoc) echo "pandoc is required: it makes the pages" ;;
    openmp) echo "no OpenMP: everything runs on one thread" ;;
    hdf5) echo "no HDF5: plain text output instead of snapshots; the snapshot's tests are skipped" ;;
    gnuplot) echo "no gnuplot: no pictures" ;;
    math-font) echo "no Latin Modern Math: formulas look as the reader's browser can draw them" ;;
    gsl) echo "no GSL: its root finders are not in the benchmark's tables" ;;
    *) echo "no $1: its checks are skipped" ;;
    esac
}

# a compiler that is not here and that no package is known for: all else would be for nothing
first=${CC%% *}
case $first in cc | gcc | clang) ;; *)
    have "$first" || {
        say "ERROR: CC=$CC: no such compiler here; give one that is, such as CC=gcc or CC=clang"
        exit 1
    } ;;
esac

look
# shellcheck disable=SC2086
missing=$(list_missing $required $optional)
if [ -z "$missing" ]; then
    say "everything that $task uses is there"
    exit 0
fi
say "missing: $missing"

find_manager
refreshed='' sudo='' environment='' may_install=''
# shellcheck disable=SC2086
wanted=$([ -z "$manager" ] || all_packages $missing)
if [ "$manager" = brew ]; then # brew refuses to run as root, and needs no right
    [ "$(id -u)" = 0 ] || may_install=yes
elif [ "$(id -u)" = 0 ]; then
    may_install=yes
elif have sudo && sudo -n true 2> /dev/null; then
    may_install=yes sudo='sudo -n '
fi
[ "$manager" = apt-get ] && environment='env DEBIAN_FRONTEND=noninteractive '

if [ -z "$manager" ]; then
    say "no package manager that this script knows (apt, dnf, pacman, brew): please install these by hand"
elif [ -z "$(echo "$wanted" | tr -d ' ')" ]; then
    say "$manager has no packages for these"
elif [ "$NO_INSTALL" = 1 ] || [ -z "$may_install" ]; then
    [ "$NO_INSTALL" = 1 ] && say "NO_INSTALL=1: nothing is installed"
    by='sudo '
    [ "$manager" = brew ] && by=''
    # shellcheck disable=SC2086
    say "this command installs them:  $by$(command_for $wanted)"
else
    # shellcheck disable=SC2086
    install $wanted
    look
fi
case $missing in
*compiler*) [ "$(uname -s)" = Darwin ] && say "the compiler comes with:  xcode-select --install" ;;
esac

status=0
for thing in $required; do
    there "$thing" || { say "ERROR: $(without "$thing")"; status=1; }
done
seen COMPILER_WORKS || exit 1 # without one, nothing is known of the libraries
for thing in $optional; do
    if ! there "$thing"; then
        say "$(without "$thing")"
        [ "$CHECK_STRICT" = 1 ] && status=1
    fi
done
exit $status
